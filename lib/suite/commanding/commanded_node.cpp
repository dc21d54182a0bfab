// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/commanding/commanded_node.hpp"

#include <mission/structures.hpp>

#include "base/file.hpp"
#include "base/text.hpp"
#include "suite/commanding/messages.hpp"

namespace srfs {

void CommandedNode::open_commanding() {
  const auto file = state_dir() / "telecommands";
  authority_.emplace(*this);
  journal_ = read_journal(file);
  written_ = 0;
  store_ = create_worker("store", 8);
  reports_ = create_publisher(suite::topics::telecommand_report);
  telecommands_ = create_subscription(suite::topics::telecommand,
                                      [this](const srfs_msgs::msg::Telecommand& m) { on_telecommand(m); });
  // Expiry, and reports that had no listener yet.
  timer_ = create_timer(
      milliseconds(200), [this] { settle(); }, "telecommands");
}

void CommandedNode::close_commanding() {
  timer_.reset();
  telecommands_.reset();
  if (store_) store_->drain();
  store_.reset();
  reports_.reset();
  journal_.reset();
  authority_.reset();
  executing_ = false;
  awaits_record_ = false;
  writing_ = false;
}

void CommandedNode::on_telecommand(const srfs_msgs::msg::Telecommand& message) {
  if (message.target != name() || !journal_ || !authority_->admits(message)) return;
  StoredTelecommand telecommand = from_message(message);
  if (!journal_->repeat_reports(telecommand.id)) {
    const FailureCode refusal = check(telecommand.function, telecommand.arguments);
    if (!is_active()) {
      journal_->refuse(telecommand.id, mission::failure::node_not_active);
    } else if (refusal != mission::failure::none) {
      journal_->refuse(telecommand.id, refusal);
    } else if (telecommand.has_expired(now())) {
      journal_->refuse(telecommand.id, mission::failure::expired);
    } else {
      journal_->add(std::move(telecommand));
    }
  }
  settle();
}

/// Brings the disk, the execution and the reports up to what the journal says.
void CommandedNode::settle() {
  if (settling_ || !journal_) return;  // finished() within execute(): the loop below goes on
  settling_ = true;
  while (is_active() && !executing_) {
    const StoredTelecommand* next = journal_->next(monotonic_now());
    if (next == nullptr) break;
    if (next->repeat == RepeatClass::at_most_once) {
      journal_->mark_started();
      awaits_record_ = !journal_->start_is_durable();
      if (awaits_record_) break;
    }
    journal_->begin();
    executing_ = true;
    execute(*next);
  }
  if (journal_->revision() > written_ && !writing_) write_journal();
  for (const StageReport& report : journal_->take_reports())
    unheard_.push(to_message(report, name(), incarnation(), monotonic_now()));
  flush_reports();
  settling_ = false;
}

void CommandedNode::finished(FailureCode outcome) {
  if (!journal_ || !executing_) return;  // closed in the meantime: it stays on disk
  executing_ = false;
  journal_->finish(outcome);
  settle();
}

void CommandedNode::write_journal() {
  const std::uint64_t revision = journal_->revision();
  writing_ = store_->ask(
      [file = state_dir() / "telecommands", content = journal_->encode()] {
        const auto written = write_file_atomically(file, as_text(content));
        if (!written) log::error("telecommands cannot be stored: {}", written.error().message);
        return written.has_value();
      },
      [this, revision](bool ok) {
        writing_ = false;
        if (!journal_) return;
        on_written(revision, ok);
        settle();
      });
  if (!writing_) on_written(revision, false);
}

void CommandedNode::on_written(std::uint64_t revision, bool ok) {
  written_ = revision;  // what failed is not written again for its own sake
  journal_->on_written(revision, ok);
  if (!ok && awaits_record_) journal_->finish(mission::failure::storage_unavailable);
  if (!ok) awaits_record_ = false;
}

bool CommandedNode::is_heard_by_ttc() const {
  return reports_ && telecommands_ && reports_->is_heard_by_a_publisher_of(*telecommands_);
}

void CommandedNode::flush_reports() {
  // ttc publishes the telecommands; a recorder that listens to the reports keeps none of them for it.
  if (!is_heard_by_ttc()) return;
  while (auto report = unheard_.pop()) {
    authority_->prove(*report);
    reports_->publish(*report);
  }
}

}  // namespace srfs
