// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include <mission/structures.hpp>

#include "base/bounded_queue.hpp"
#include "suite/commanding/command_authority.hpp"
#include "suite/commanding/telecommand_journal.hpp"
#include "suite/node.hpp"

namespace srfs {

/// A node that executes telecommands at once, one at a time, in the order in which they came. (A payload
/// executes them in its CAN slots: nodes/payload.) What is not ttc's is rejected (CommandAuthority). Each is
/// on disk before its acceptance is reported and stays there until its end is; a known id is reported again,
/// not executed again.
class CommandedNode : public suite::Node {
 public:
  using Node::Node;

 protected:
  /// In on_configure: takes up what an earlier process left, and listens. Blocks on the disk.
  void open_commanding();
  /// In on_activate: what was stored goes on.
  void resume_commanding() { settle(); }
  /// In on_cleanup, on_shutdown and on_error: what is not done stays on disk. Blocks until the last write.
  void close_commanding();

  /// Why a telecommand is refused before it is stored; mission::failure::none: it is not.
  [[nodiscard]] virtual FailureCode check(std::uint16_t function, OctetView arguments) const = 0;
  /// Executes one that passed check(). It ends with a call of finished(), now or later.
  virtual void execute(const StoredTelecommand& telecommand) = 0;
  void finished(FailureCode outcome);
  /// Its discovery of this node is complete: what is published now reaches it.
  [[nodiscard]] bool is_heard_by_ttc() const;

 private:
  void on_telecommand(const srfs_msgs::msg::Telecommand& message);
  void settle();
  void write_journal();
  void on_written(std::uint64_t revision, bool ok);
  void flush_reports();

  std::optional<CommandAuthority> authority_;  ///< as long as the journal
  std::optional<TelecommandJournal> journal_;
  bool executing_ = false;
  bool awaits_record_ = false;  ///< the start of the next one, an at-most-once command
  std::uint64_t written_ = 0;   ///< newest revision on disk
  bool writing_ = false;
  bool settling_ = false;
  std::shared_ptr<ros::Worker> store_;
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::TelecommandReport>> reports_;
  std::shared_ptr<ros::Subscription<srfs_msgs::msg::Telecommand>> telecommands_;
  ros::Timer timer_;
  BoundedQueue<srfs_msgs::msg::TelecommandReport> unheard_{64, Overflow::drop_oldest};
};

}  // namespace srfs
