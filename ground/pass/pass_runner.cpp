// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/pass/pass_runner.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "ground/files.hpp"
#include "ground/pass/first_contact.hpp"

namespace srfs::ground::pass {
namespace {

constexpr seconds count_period{5};
constexpr milliseconds progress_period{500};
constexpr milliseconds longest_wait{200};

std::string why_not_arrived(const cfdp::News& news) {
  return fmt::format("the transfer ended: {}", wire::to_string(news.event.outcome.condition));
}

}  // namespace

PassRunner::PassRunner(const mission::Dictionary& dictionary, const PassPlan& plan,
                       std::unique_ptr<StationLink> link, Place place, RunnerOutput output)
    : dictionary_(dictionary),
      plan_(plan),
      place_(std::move(place)),
      output_(std::move(output)),
      memory_(dictionary, place_.archive),
      orders_(dictionary, std::move(link),
              {.file = [this](const auto& news) { on_file(news); }, .note = output_.note}) {}

RunEnd PassRunner::run(JournalFile& file, PassJournal& journal, const LineRates& rates, bool keep_going,
                       nanoseconds length) {
  file_ = &file;
  journal_ = &journal;
  if (const auto made = make_folder(); !made) return {.how = RunEnd::How::not_stored, .why = made.error()};
  session_.emplace(plan_, with_journal(items_of(plan_), journal), journal.suspended,
                   PassSession::Settings{.first_questions = FirstContact::questions_of(dictionary_),
                                         .remembers = orders_.link().remembers(),
                                         .keep_going = keep_going,
                                         .rates = rates},
                   monotonic_now() + length);
  told_ = session_->items();
  if (journal.flown.size() == PassJournal::flown_max) journal.flown.erase(journal.flown.begin());
  journal.flown.push_back({.began = system_utc_now()});
  octets_before_ = orders_.link().counters().octets;
  RunEnd end = fly();
  end.contact = session_->in_contact();
  journal.flown.back().ended = system_utc_now();
  journal.flown.back().end = end.why;
  if (const auto stored = store(); !stored)
    return {.how = RunEnd::How::not_stored, .why = stored.error(), .contact = end.contact};
  return end;
}

RunEnd PassRunner::fly() {
  if (const auto stored = store(); !stored) return {.how = RunEnd::How::not_stored, .why = stored.error()};
  while (true) {
    if (auto why = session_->over(monotonic_now())) return {.how = RunEnd::How::over, .why = std::move(*why)};
    const auto action = session_->next(monotonic_now(), system_utc_now());
    // On the disk before it is done: whatever ends this program, the next run knows that it may have been
    // done.
    if (session_->take_changed()) {
      if (const auto stored = store(); !stored)
        return {.how = RunEnd::How::not_stored, .why = stored.error()};
    }
    if (action) {
      carry_out(*action);
      continue;
    }
    if (!orders_.wait(std::min(session_->next_deadline(monotonic_now()), monotonic_now() + longest_wait)))
      return {.how = RunEnd::How::link_closed, .why = orders_.problem()};
    if (orders_.interrupted()) return {.how = RunEnd::How::interrupted, .why = "interrupted"};
    turn();
  }
}

void PassRunner::turn() {
  if (const auto ended = orders_.take_end())
    session_->on_end(ended->tag, ended->end, monotonic_now(), system_utc_now());
  take_progress();
  count_gaps();
}

Result<void, std::string> PassRunner::store() {
  take_arrived();
  static_cast<void>(session_->take_changed());
  FlownPass& flown = journal_->flown.back();
  flown.down_octets = orders_.link().counters().octets - octets_before_;
  for (std::size_t i = 0; i < session_->items().size(); ++i) {
    const bool before = i < told_.size() && told_[i].state == ItemState::done;
    if (session_->items()[i].state == ItemState::done && !before) ++flown.items_done;
  }
  tell_items();
  take_items(*journal_, session_->items());
  journal_->suspended = session_->suspended();
  journal_->left_out = session_->left_out();
  return file_->store(*journal_);
}

void PassRunner::tell_items() {
  const auto& items = session_->items();
  for (std::size_t i = 0; i < items.size(); ++i) {
    const bool same =
        i < told_.size() && told_[i].state == items[i].state && told_[i].detail == items[i].detail;
    if (!same) output_.item(items[i]);
  }
  told_ = items;
  for (const std::string& note : session_->take_notes()) output_.note(note);
}

/// A file that comes down for a folder that is not there would be refused.
Result<void, std::string> PassRunner::make_folder() const {
  const std::filesystem::path folder = place_.files / PassSession::folder_of(plan_);
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return Err(fmt::format("{}: {}", folder.string(), error.message()));
  return {};
}

/// Files that are here already: of a run that ended before it knew, or whose journal was lost.
void PassRunner::take_arrived() {
  for (const Item& item : std::vector<Item>(session_->items())) {
    if (item.kind != ItemKind::down || is_over(item.state)) continue;
    const std::string target = PassSession::target_of(plan_, item);
    std::error_code error;
    const auto octets = std::filesystem::file_size(place_.files / target, error);
    if (!error && octets == item.octets) session_->on_down_ended(target, std::nullopt, system_utc_now());
  }
}

void PassRunner::carry_out(const PassAction& action) {
  switch (action.kind) {
    case PassAction::Kind::telecommand:
      return orders_.send(action);
    case PassAction::Kind::look_up:
      session_->on_looked_up(action.tag, memory_.look_up(action.token, action.step, action.ordered),
                             monotonic_now(), system_utc_now());
      return;
    case PassAction::Kind::put: {
      const auto put = orders_.link().put(action.file.file, action.file.name, true);
      session_->on_put(action.tag, put ? std::nullopt : std::optional(put.error().text), system_utc_now());
      return;
    }
    case PassAction::Kind::fill_gaps:
      if (const auto ordered = orders_.link().fill_gaps(); !ordered) output_.note(ordered.error().text);
      return;
  }
}

void PassRunner::on_file(const cfdp::News& news) {
  if (!session_ || news.event.kind != cfdp::EventKind::finished) return;
  const auto why = has_arrived(news) ? std::nullopt : std::optional(why_not_arrived(news));
  if (news.event.role == cfdp::Role::receiving)
    session_->on_down_ended(news.file.destination_file, why, system_utc_now());
  else
    session_->on_up_ended(news.file.destination_file, why, system_utc_now());
}

void PassRunner::take_progress() {
  const MonotonicTime now = monotonic_now();
  if (now < next_progress_) return;
  next_progress_ = now + progress_period;
  for (const cfdp::Report& report : orders_.link().transfers()) {
    if (report.role == cfdp::Role::receiving)
      session_->on_down_progress(report.destination_file, report.progress_octets);
  }
}

void PassRunner::count_gaps() {
  const MonotonicTime now = monotonic_now();
  if (!plan_.gaps || !orders_.link().remembers() || now < next_count_) return;
  next_count_ = now + count_period;
  if (const auto open = memory_.open_gaps()) session_->on_gaps(*open, system_utc_now());
}

}  // namespace srfs::ground::pass
