// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ground/pass/order_follower.hpp"
#include "ground/pass/pass_journal.hpp"
#include "ground/pass/pass_memory.hpp"
#include "ground/pass/pass_session.hpp"

namespace srfs::ground::pass {

/// What a runner reports while it works.
struct RunnerOutput {
  std::function<void(const Item&)> item;         ///< it has changed
  std::function<void(const std::string&)> note;  ///< ready to print
};

/// How a run of a plan ended.
struct RunEnd {
  enum class How : std::uint8_t { over, interrupted, link_closed, not_stored };
  How how = How::over;
  std::string why = {};  ///< for people
  bool contact = false;
};

/// Carries out what a PassSession wants, on the link: sends, follows, judges, stores. One thread; blocks
/// until the pass is over, a signal comes, or the link ends.
class PassRunner {
 public:
  struct Place {
    std::filesystem::path files;  ///< STATE/files
    ArchivePlace archive;         ///< of the server
  };
  PassRunner(const mission::Dictionary& dictionary, const PassPlan& plan, std::unique_ptr<StationLink> link,
             Place place, RunnerOutput output);

  /// @param journal  as loaded; what became of the items, and this pass, is added and stored
  /// @param keep_going  as PassSession::Settings
  [[nodiscard]] RunEnd run(JournalFile& file, PassJournal& journal, const LineRates& rates, bool keep_going,
                           nanoseconds length);
  /// Newest values that came.
  [[nodiscard]] const LatestValues& latest() const { return orders_.latest(); }
  [[nodiscard]] const std::vector<Item>& items() const { return session_->items(); }

 private:
  void on_file(const cfdp::News& news);
  void carry_out(const PassAction& action);
  [[nodiscard]] Result<void, std::string> make_folder() const;
  void take_arrived();
  void take_progress();
  void count_gaps();
  [[nodiscard]] Result<void, std::string> store();
  void tell_items();
  /// Until the pass is over. @return why it ended early, if it did
  [[nodiscard]] RunEnd fly();
  void turn();

  const mission::Dictionary& dictionary_;
  const PassPlan& plan_;
  Place place_;
  RunnerOutput output_;
  PassMemory memory_;
  OrderFollower orders_;
  std::optional<PassSession> session_;
  JournalFile* file_ = nullptr;
  PassJournal* journal_ = nullptr;
  std::vector<Item> told_;
  MonotonicTime next_count_;
  MonotonicTime next_progress_;
  std::uint64_t octets_before_ = 0;
};

}  // namespace srfs::ground::pass
