// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "ground/latest_values.hpp"
#include "ground/pass/pass_session.hpp"
#include "ground/station_link.hpp"

namespace srfs::ground::pass {

/// Something that an operator should know after the first words of a spacecraft.
struct Finding {
  enum class Level : std::uint8_t {
    fine,
    look,  ///< worth a look
    act,   ///< to be acted on
  };
  Level level = Level::fine;
  std::string what;
  std::string advice = {};  ///< what to do; empty: nothing
};
[[nodiscard]] std::string_view to_text(Finding::Level level);

/// What the newest packets say of the spacecraft: boots and their cause, mode and why, clock, keys and
/// counters, power, storage, nodes, rotation. What did not come is left out. Pure.
/// @param now  of the ground
[[nodiscard]] std::vector<Finding> assess_spacecraft(const LatestValues& latest, UtcTime now);

/// What of the way to the spacecraft works, from the line upwards.
struct LinkFacts {
  DownlinkCounters counters;  ///< since the procedure began
  bool beacon = false;        ///< one came, or that of srfs_rescue
  bool answered = false;      ///< a telecommand came through
};
/// Where it ends, and what to do. Empty: both ways work. Pure.
[[nodiscard]] std::vector<Finding> assess_link(const LinkFacts& facts);

/// The procedure of a first contact: calls until there is an answer, asks what must be known, sets the clock
/// if that is wanted and it was never set. Nothing else is commanded. Pure.
class FirstContact {
 public:
  static constexpr seconds call_period{5};

  /// @param questions  telecommands, in their order
  /// @param sets_time  timing.set_time is sent once if the spacecraft's time is not valid
  FirstContact(std::vector<TelecommandText> questions, bool sets_time, MonotonicTime deadline)
      : questions_(std::move(questions)), sets_time_(sets_time), deadline_(deadline) {}

  /// nullopt: nothing now. @param latest  what came so far
  [[nodiscard]] std::optional<PassAction> next(MonotonicTime now, UtcTime utc, const LatestValues& latest);
  void on_end(std::uint64_t tag, const OrderEnd& end, MonotonicTime now);
  [[nodiscard]] bool is_over(MonotonicTime now) const { return done_ || now >= deadline_; }
  [[nodiscard]] bool answered() const { return answered_; }
  /// What it did that cannot be undone, or could not do.
  [[nodiscard]] const std::vector<Finding>& findings() const { return findings_; }
  [[nodiscard]] MonotonicTime next_deadline(MonotonicTime now) const;

  /// What is asked, as far as the mission has it.
  [[nodiscard]] static std::vector<TelecommandText> questions_of(const mission::Dictionary& dictionary);

 private:
  enum class Step : std::uint8_t { call, ask, set_time, look_at_time };
  [[nodiscard]] PassAction order(TelecommandText telecommand);
  void next_question();

  std::vector<TelecommandText> questions_;
  bool sets_time_;
  MonotonicTime deadline_;
  Step step_ = Step::call;
  std::size_t asked_ = 0;
  unsigned losses_ = 0;
  std::uint64_t next_tag_ = 1;
  std::optional<std::uint64_t> current_;
  std::optional<MonotonicTime> resting_until_;
  bool answered_ = false;
  bool done_ = false;
  std::vector<Finding> findings_;
};

/// How the procedure ended on a link.
struct ContactEnd {
  std::vector<Finding> findings;
  bool answered = false;
};
/// Carries the procedure out. Blocks until it is over, @p length has passed, a signal comes, or the link
/// ends.
/// @param note  what an operator should know meanwhile, ready to print
[[nodiscard]] ContactEnd run_first_contact(const mission::Dictionary& dictionary,
                                           std::unique_ptr<StationLink> link, bool sets_time,
                                           nanoseconds length, std::function<void(const std::string&)> note);

/// For people, in Markdown.
[[nodiscard]] std::string contact_to_markdown(const std::vector<Finding>& findings, UtcTime now);
/// {"type": "first_contact", contact, findings [{level, what, advice}]}
[[nodiscard]] nlohmann::json contact_to_json(const std::vector<Finding>& findings, bool answered,
                                             UtcTime now);

}  // namespace srfs::ground::pass
