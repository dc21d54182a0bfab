// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/pass/pass_session.hpp"

#include <algorithm>
#include <string_view>

#include <fmt/format.h>

#include "base/text.hpp"
#include "cfdp/safe_name.hpp"
#include "ground/pass/pass_journal.hpp"
#include "ground/remote.hpp"
#include "ground/terminal_text.hpp"

namespace srfs::ground::pass {
namespace {

constexpr std::string_view unrecorded_prefix = "alone";  ///< of tokens that no archive can know

TelecommandText listing_of(const std::string& folder, const std::string& after) {
  TelecommandText text{.name = "file.list", .arguments = {"repository=" + folder}};
  if (!after.empty()) text.arguments.push_back("after=" + after);
  return text;
}

std::pair<std::string, std::string> split(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  if (slash == std::string::npos) return {"", path};
  return {path.substr(0, slash), path.substr(slash + 1)};
}

}  // namespace

PassSession::PassSession(const PassPlan& plan, std::vector<Item> items, bool suspended, Settings settings,
                         MonotonicTime set)
    : plan_(plan),
      items_(std::move(items)),
      suspended_(suspended),
      settings_(std::move(settings)),
      set_(set) {
  for (std::size_t i = 0; i < items_.size(); ++i) {
    if (items_[i].state == ItemState::ordered) from_before_.insert(i);
    last_operation_ = std::max(last_operation_, items_[i].operation);
  }
  // The most urgent wish's folder is next.
  for (const FilesDown& wish : plan.down) {
    const bool known = std::any_of(listings_.begin(), listings_.end(),
                                   [&](const auto& l) { return l.folder == wish.folder; });
    if (!known) listings_.insert(listings_.begin(), Listing{wish.folder});
  }
}

std::string PassSession::folder_of(const PassPlan& plan) {
  return cfdp::safe_name("passes/" + plan.name);
}

std::string PassSession::target_of(const PassPlan& plan, const Item& item) {
  constexpr std::size_t digits = 8;
  std::string name = split(item.path).second;
  const std::size_t room = name_octets_max - digits - 1;
  if (name.size() > room) name = name.substr(name.size() - room);
  return cfdp::safe_name(fmt::format("{}/{}-{}", folder_of(plan), item.key.substr(0, digits), name));
}

PassAction PassSession::order(Purpose purpose, TelecommandText telecommand, std::size_t item) {
  current_ = Current{.tag = next_tag_++, .purpose = purpose, .item = item};
  return {.kind = PassAction::Kind::telecommand, .tag = current_->tag, .telecommand = std::move(telecommand)};
}

std::optional<PassAction> PassSession::next(MonotonicTime now, UtcTime utc) {
  const bool closes = now >= set_ - closing;
  if (closes) stop_following();
  if (current_ || over(now) || (!closes && resting_until_ && now < *resting_until_)) return std::nullopt;
  if (closes) return close();
  if (!contact_ || suspended_ || questions_asked_ < settings_.first_questions.size())
    return next_of_contact();
  if (auto action = next_put(utc)) return action;
  if (auto action = next_query()) return action;
  if (auto action = next_of_script(now, utc)) return action;
  if (auto action = next_gaps()) return action;
  if (auto action = next_listing()) return action;
  return next_copy(now, utc);
}

PassAction PassSession::next_of_contact() {
  if (!contact_) return order(Purpose::contact, {.name = "ttc.ping", .arguments = {}});
  if (suspended_) return order(Purpose::resume, {.name = "file.resume_all", .arguments = {}});
  return order(Purpose::question, settings_.first_questions.at(questions_asked_));
}

std::optional<PassAction> PassSession::next_query() {
  for (std::size_t i = 0; i < items_.size(); ++i) {
    if (items_[i].kind == ItemKind::query && !is_over(items_[i].state) && may_try(i))
      return order(Purpose::query, items_[i].telecommand, i);
  }
  return std::nullopt;
}

/// The first line that is to be done. One whose end is open, or not as wanted, holds back those behind it;
/// with keep_going only a wait does.
std::optional<PassAction> PassSession::next_of_script(MonotonicTime now, UtcTime utc) {
  for (std::size_t i = 0; i < items_.size(); ++i) {
    const Item& item = items_[i];
    if (item.kind != ItemKind::telecommand && item.kind != ItemKind::wait) continue;
    if (!is_over(item.state)) {
      if (auto action = next_of_line(i, now, utc)) return action;
    }
    if (item.state != ItemState::done && !settings_.keep_going) return std::nullopt;
    if (item.kind == ItemKind::wait && item.state != ItemState::done) return std::nullopt;
  }
  return std::nullopt;
}

std::optional<PassAction> PassSession::next_of_line(std::size_t i, MonotonicTime now, UtcTime utc) {
  Item& item = items_[i];
  if (item.kind == ItemKind::wait) {
    if (!waiting_until_) waiting_until_ = now + item.step->duration;
    if (now < *waiting_until_) return std::nullopt;
    waiting_until_.reset();
    set(item, ItemState::done, "", utc);
    return std::nullopt;
  }
  if (!may_try(i)) return std::nullopt;
  if (item.state == ItemState::waiting) return send_line(i, utc);
  if (!settings_.remembers || item.token.starts_with(unrecorded_prefix)) {
    set(item, ItemState::unknown, "perhaps sent: the run ended meanwhile, and no server remembers it", utc);
    return std::nullopt;
  }
  const auto again = look_again_.find(i);
  if (again != look_again_.end() && now < again->second) return std::nullopt;
  current_ = Current{.tag = next_tag_++, .purpose = Purpose::script, .item = i};
  return PassAction{.kind = PassAction::Kind::look_up,
                    .tag = current_->tag,
                    .telecommand = item.telecommand,
                    .step = item.step,
                    .token = item.token,
                    .ordered = item.changed};
}

std::optional<PassAction> PassSession::send_line(std::size_t i, UtcTime utc) {
  Item& item = items_[i];
  const bool again = !item.token.empty();
  // A later run with an archive sees that none knew of this one.
  item.token =
      fmt::format("{}-{}-{}", settings_.remembers ? "pass" : unrecorded_prefix, plan_.name, item.key);
  set(item, ItemState::ordered, "being sent", utc);
  PassAction action = order(Purpose::script, item.telecommand, i);
  action.step = item.step;
  action.token = item.token;
  action.again = again;
  return action;
}

bool PassSession::may_try(std::size_t item) const {
  const auto tries = tries_.find(item);
  return tries == tries_.end() || tries->second < tries_max;
}

std::optional<PassAction> PassSession::next_gaps() {
  const auto gaps = find(ItemKind::gaps, [](const Item& item) { return !is_over(item.state); });
  if (!gaps || std::exchange(gaps_ordered_, true) || !settings_.remembers) return std::nullopt;
  return PassAction{.kind = PassAction::Kind::fill_gaps};
}

std::optional<PassAction> PassSession::next_put(UtcTime utc) {
  if (putting_.size() >= copies_max) return std::nullopt;
  for (const std::size_t i : open_items(items_, ItemKind::up)) {
    if (putting_.contains(i) || !may_try(i)) continue;
    Item& item = items_[i];
    if (from_before_.contains(i))  // it may have arrived
      return order(Purpose::check_up, {.name = "file.report", .arguments = {"file=" + item.file.name}}, i);
    set(item, ItemState::ordered, "goes up", utc);
    putting_.insert(i);
    return PassAction{.kind = PassAction::Kind::put, .tag = i, .file = item.file};
  }
  return std::nullopt;
}

std::optional<PassAction> PassSession::next_listing() {
  if (listings_.empty()) return std::nullopt;
  return order(Purpose::list, listing_of(listings_.back().folder, listings_.back().after));
}

std::optional<PassAction> PassSession::next_copy(MonotonicTime now, UtcTime utc) {
  if (copying_.size() >= copies_max) return std::nullopt;
  auto candidates = open_items(items_, ItemKind::down);
  std::erase_if(candidates, [&](std::size_t i) { return copying_.contains(i) || !may_try(i); });
  // What is under way already goes on first: its octets are on the line in any case.
  const auto before = std::find_if(candidates.begin(), candidates.end(),
                                   [&](std::size_t i) { return from_before_.contains(i); });
  const auto chosen =
      before != candidates.end() ? std::optional(*before) : choose(items_, candidates, octets_left(now));
  if (!chosen) return std::nullopt;
  Item& item = items_[*chosen];
  if (item.operation == 0) {
    // Another one than the copies that may be under way: a number of the last 49 days.
    const auto now_ms =
        static_cast<std::uint32_t>(static_cast<std::uint64_t>(utc.ns() / 1'000'000) & UINT32_MAX);
    last_operation_ = std::max(now_ms, last_operation_ + 1);
    item.operation = std::max<std::uint32_t>(last_operation_, 1);
  }
  set(item, ItemState::ordered, "ordered", utc);
  const auto [folder, name] = split(item.path);
  return order(
      Purpose::copy,
      {.name = "file.copy",
       .arguments = {fmt::format("operation={}", item.operation), "source_repository=" + folder,
                     "source_file=" + name, "target_repository=ground:" + split(target_of(plan_, item)).first,
                     "target_file=" + split(target_of(plan_, item)).second}},
      *chosen);
}

/// A telecommand under way does not keep copies from being suspended in time. Its end is not waited for: it
/// is as if the program had ended.
void PassSession::stop_following() {
  if (!current_ || current_->purpose == Purpose::suspend) return;
  if (current_->purpose == Purpose::copy) copying_.try_emplace(current_->item, 0);  // perhaps it has begun
  if (contact_ && must_suspend_ && !copying_.empty()) current_.reset();
}

/// What is under way on board rests until the next pass: its octets would go to where no one hears them.
std::optional<PassAction> PassSession::close() {
  if (!contact_ || copying_.empty() || !std::exchange(must_suspend_, false)) {
    closed_ = true;
    return std::nullopt;
  }
  suspended_ = true;  // perhaps; resuming what does not rest does no harm
  changed_ = true;
  return order(Purpose::suspend, {.name = "file.suspend_all", .arguments = {}});
}

void PassSession::on_lost(MonotonicTime now) {
  constexpr unsigned losses_max = 2;
  resting_until_ = now + rest;
  if (++losses_ < losses_max) return;
  contact_ = false;
  losses_ = 0;
}

void PassSession::on_end(std::uint64_t tag, const OrderEnd& end, MonotonicTime now, UtcTime utc) {
  if (!current_ || current_->tag != tag) return;
  const Current ended = *std::exchange(current_, std::nullopt);
  const bool lost = end.how == OrderEnd::How::lost || end.how == OrderEnd::How::unknown;
  const bool as_wanted = end.how == OrderEnd::How::as_wanted;
  if (lost || end.how == OrderEnd::How::not_sent) {
    if (ended.purpose == Purpose::query || ended.purpose == Purpose::check_up ||
        ended.purpose == Purpose::copy)
      ++tries_[ended.item];
    on_lost(now);
  } else {
    losses_ = 0;
  }
  switch (ended.purpose) {
    case Purpose::contact:
      contact_ = as_wanted || end.how == OrderEnd::How::otherwise;
      if (!contact_) resting_until_ = now + rest;
      return;
    case Purpose::resume:
      if (lost || end.how == OrderEnd::How::not_sent) return;
      suspended_ = false;
      changed_ = true;
      return;
    case Purpose::suspend:
      closed_ = !lost;
      must_suspend_ = lost;
      return;
    case Purpose::question: {
      constexpr unsigned question_losses_max = 3;
      if (lost && ++question_losses_ < question_losses_max) return;
      question_losses_ = 0;
      ++questions_asked_;
      return;
    }
    case Purpose::query:
      return end_query(ended.item, end, utc);
    case Purpose::script:
      return end_line(ended.item, end, now, utc);
    case Purpose::list:
      return end_listing(end, utc);
    case Purpose::check_up:
      return end_check(ended.item, end, utc);
    case Purpose::copy:
      return end_copy(ended.item, end, utc);
  }
}

void PassSession::end_query(std::size_t i, const OrderEnd& end, UtcTime utc) {
  using How = OrderEnd::How;
  if (end.how == How::as_wanted) return set(items_[i], ItemState::done, "", utc);
  if (end.how == How::otherwise) return fail_once(items_[i], end.why, utc);
  items_[i].detail = "no answer";
}

void PassSession::end_line(std::size_t i, const OrderEnd& end, MonotonicTime now, UtcTime utc) {
  Item& item = items_[i];
  switch (end.how) {
    case OrderEnd::How::as_wanted:
      return set(item, ItemState::done, "", utc);
    case OrderEnd::How::otherwise:
      return set(item, ItemState::failed, end.why, utc);
    case OrderEnd::How::not_sent:
      item.token.clear();
      ++tries_[i];
      return set(item, ItemState::waiting, "not sent: " + end.why, utc);
    case OrderEnd::How::lost:
    case OrderEnd::How::unknown:
      break;
  }
  const bool sent = end.how == OrderEnd::How::lost;
  if (!settings_.remembers)
    return set(item, ItemState::unknown,
               sent ? "sent; no report of its end came" : "perhaps sent: " + end.why, utc);
  look_again_[i] = now + look_up_period;
  set(item, ItemState::ordered, sent ? "sent; no report of its end came yet" : "perhaps sent: " + end.why,
      utc);
}

void PassSession::on_looked_up(std::uint64_t tag, const LookedUp& found, MonotonicTime now, UtcTime utc) {
  if (!current_ || current_->tag != tag) return;
  const std::size_t i = std::exchange(current_, std::nullopt)->item;
  Item& item = items_[i];
  switch (found.what) {
    case LookedUp::What::as_wanted:
      return set(item, ItemState::done, "", utc);
    case LookedUp::What::otherwise:
      return set(item, ItemState::failed, found.why, utc);
    case LookedUp::What::cannot_tell:
      return set(item, ItemState::unknown, "perhaps sent: " + found.why, utc);
    case LookedUp::What::open:
      look_again_[i] = now + look_up_period;
      return set(item, ItemState::ordered, "sent; no report of its end came yet", utc);
    case LookedUp::What::not_recorded:
      break;
  }
  // It goes up by the same token: should the archive know it by now, it is not sent again.
  set(item, ItemState::waiting, "", utc);
}

void PassSession::end_listing(const OrderEnd& end, UtcTime) {
  Listing listing = listings_.back();
  listings_.pop_back();
  const TelecommandText page = listing_of(listing.folder, listing.after);
  const bool came = end.how == OrderEnd::How::as_wanted;
  if (came && is_whole(page, end.reports, listing.left)) {
    take_found(listing.folder, end.reports);
    if (next_page(page, end.reports)) {
      listing.left = left_behind(end.reports);
      listing.after = field_text(end.reports.back(), "object_name");
      listings_.push_back(listing);
    }
    return;
  }
  if (++listing.failures < failures_max) return listings_.push_back(listing);
  notes_.push_back(fmt::format("the folder '{}' on board cannot be listed: {}", for_terminal(listing.folder),
                               came ? "parts of the answer were lost" : end.why));
}

void PassSession::take_found(const std::string& folder, const std::vector<TelemetryReport>& reports) {
  for (const TelemetryReport& report : reports) {
    const std::string name = field_text(report, "object_name");
    if (field_text(report, "object") != "file" || name.empty() || name.size() > name_octets_max) continue;
    const FilesDown* const wish = wish_for(plan_, folder, name);
    if (wish == nullptr) continue;
    const auto octets = to_number<std::uint64_t>(field_text(report, "octets"));
    Item item = item_of_file(folder.empty() ? name : folder + "/" + name, octets.value_or(0), wish->priority);
    const bool known =
        find(ItemKind::down, [&](const Item& other) { return other.key == item.key; }).has_value();
    if (known) continue;
    if (files_found() >= PassJournal::found_files_max || for_terminal(name) != name) {
      ++left_out_;
      continue;
    }
    items_.push_back(std::move(item));
    changed_ = true;
  }
}

void PassSession::end_check(std::size_t i, const OrderEnd& end, UtcTime utc) {
  const bool answered = end.how == OrderEnd::How::as_wanted || end.how == OrderEnd::How::otherwise;
  if (!answered) return;
  from_before_.erase(i);
  if (!end.reports.empty() && reported_sha256(end.reports.front()) == items_[i].file.sha256)
    set(items_[i], ItemState::done, "", utc);
}

void PassSession::on_put(std::uint64_t tag, const std::optional<std::string>& why, UtcTime utc) {
  if (!why || tag >= items_.size()) return;
  putting_.erase(tag);
  fail_once(items_[tag], *why, utc);
}

void PassSession::on_up_ended(const std::string& name, const std::optional<std::string>& why, UtcTime utc) {
  const auto up = find(ItemKind::up, [&](const Item& item) {
    return item.file.name == name && item.state == ItemState::ordered;
  });
  if (!up) return;
  putting_.erase(*up);
  why ? fail_once(items_[*up], *why, utc) : set(items_[*up], ItemState::done, "", utc);
}

void PassSession::end_copy(std::size_t i, const OrderEnd& end, UtcTime utc) {
  Item& item = items_[i];
  if (is_over(item.state) || item.operation == 0) return;  // its transfer ended before its report came
  switch (end.how) {
    case OrderEnd::How::as_wanted:
      from_before_.erase(i);
      copying_.try_emplace(i, 0);
      return set(item, ItemState::ordered, "comes down", utc);
    case OrderEnd::How::otherwise:
      from_before_.erase(i);
      item.operation = 0;
      return fail_once(item, end.why, utc);
    case OrderEnd::How::not_sent:
    case OrderEnd::How::lost:
    case OrderEnd::How::unknown:
      from_before_.insert(i);  // by the same number it is ordered once, however often it goes up
      return;
  }
}

void PassSession::on_down_progress(const std::string& target, std::uint64_t octets) {
  const auto down = find(ItemKind::down, [&](const Item& item) { return target_of(plan_, item) == target; });
  if (down && copying_.contains(*down)) copying_[*down] = octets;
}

void PassSession::on_down_ended(const std::string& target, const std::optional<std::string>& why,
                                UtcTime utc) {
  const auto down = find(ItemKind::down, [&](const Item& item) { return target_of(plan_, item) == target; });
  if (!down || is_over(items_[*down].state)) return;
  copying_.erase(*down);
  from_before_.erase(*down);
  if (!why) return set(items_[*down], ItemState::done, target, utc);
  items_[*down].operation = 0;
  fail_once(items_[*down], *why, utc);
}

void PassSession::on_gaps(std::size_t open, UtcTime utc) {
  const auto gaps = find(ItemKind::gaps, [](const Item&) { return true; });
  if (!gaps) return;
  Item& item = items_[*gaps];
  const ItemState state = open == 0 && gaps_ordered_ ? ItemState::done : ItemState::waiting;
  const std::string why = open == 0 ? "" : fmt::format("{} open", open);
  if (item.state != state || item.detail != why) set(item, state, why, utc);
}

void PassSession::set(Item& item, ItemState state, std::string why, UtcTime utc) {
  if (item.state != state) item.changed = utc;
  item.state = state;
  item.detail = std::move(why);
  changed_ = true;
}

void PassSession::fail_once(Item& item, const std::string& why, UtcTime utc) {
  ++item.failures;
  set(item, item.failures >= failures_max ? ItemState::failed : ItemState::waiting, why, utc);
}

double PassSession::octets_left(MonotonicTime now) const {
  double octets = std::chrono::duration<double>(set_ - closing - now).count() * settings_.rates.down_octets_s;
  for (const auto& [i, came] : copying_)
    octets -= static_cast<double>(items_[i].octets - std::min(items_[i].octets, came));
  return octets;
}

std::size_t PassSession::files_found() const {
  return static_cast<std::size_t>(std::count_if(
      items_.begin(), items_.end(), [](const Item& item) { return item.kind == ItemKind::down; }));
}

std::optional<std::size_t> PassSession::find(ItemKind kind,
                                             const std::function<bool(const Item&)>& is) const {
  for (std::size_t i = 0; i < items_.size(); ++i) {
    if (items_[i].kind == kind && is(items_[i])) return i;
  }
  return std::nullopt;
}

std::optional<std::string> PassSession::over(MonotonicTime now) const {
  if (now >= set_) return "the spacecraft has set";
  if (closed_) return "ended in order before the set";
  if (!contact_ || current_ || !listings_.empty()) return std::nullopt;
  if (suspended_ || questions_asked_ < settings_.first_questions.size()) return std::nullopt;
  bool held = false;
  for (const Item& item : items_) {
    const bool line = item.kind == ItemKind::telecommand || item.kind == ItemKind::wait;
    if (line && is_over(item.state) && item.state != ItemState::done && !settings_.keep_going) held = true;
    const bool cannot = (line && held) || (item.kind == ItemKind::gaps && !settings_.remembers);
    if (!is_over(item.state) && !cannot) return std::nullopt;
  }
  return "nothing is left to do";
}

MonotonicTime PassSession::next_deadline(MonotonicTime now) const {
  MonotonicTime next = now < set_ - closing ? set_ - closing : set_;
  if (resting_until_ && now < *resting_until_) next = std::min(next, *resting_until_);
  if (waiting_until_ && now < *waiting_until_) next = std::min(next, *waiting_until_);
  for (const auto& [i, time] : look_again_) {
    if (now < time) next = std::min(next, time);
  }
  return next;
}

}  // namespace srfs::ground::pass
