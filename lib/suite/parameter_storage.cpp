// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/parameter_storage.hpp"

#include <algorithm>

#include <fmt/format.h>

namespace srfs::suite {
namespace {

constexpr const char* start_origin = "start, unusable values dropped";

void forget_value(std::vector<ros::StoredParameter>& values, const std::string& name) {
  std::erase_if(values, [&](const ros::StoredParameter& s) { return s.name == name; });
}

/// One that is there already keeps its time.
void put_value(std::vector<ros::StoredParameter>& values, const std::string& name,
               const ros::ParameterValue& value, const std::string& saved) {
  const auto found = std::find_if(values.begin(), values.end(),
                                  [&](const ros::StoredParameter& s) { return s.name == name; });
  if (found == values.end()) {
    values.push_back({name, value, saved});
  } else if (found->value != value) {
    *found = {name, value, saved};
  }
}

const ros::StoredParameter* find_value(const std::vector<ros::StoredParameter>& values,
                                       const std::string& name) {
  const auto found = std::find_if(values.begin(), values.end(),
                                  [&](const ros::StoredParameter& s) { return s.name == name; });
  return found == values.end() ? nullptr : &*found;
}

std::string origin_of(const std::string& what, const ParameterStorage::Request& request) {
  return request.origin.empty() ? what : fmt::format("{} ({})", what, request.origin);
}

}  // namespace

void ParameterStorage::begin(const std::string& saved) {
  for (const std::string& name : set_.names()) {
    if (set_.is_guarded(name)) settled_[name] = *set_.find(name);
  }
  if (!history_.trial.empty()) {
    Values back;
    for (const ros::StoredParameter& lost : history_.trial) {
      if (const ros::ParameterValue* value = set_.find(lost.name)) back.push_back({lost.name, *value, saved});
    }
    news_.push_back({.kind = ParameterNews::Kind::reverted,
                     .values = std::move(back),
                     .reason = "restarted before it was confirmed"});
  }
  if (history_.trial.empty() && set_.set_aside().empty()) return;
  static_cast<void>(store(set_.stored(), start_origin, saved));  // no more than what was read: it fits
}

bool ParameterStorage::is_on_trial(const std::string& name) const {
  const auto settled = settled_.find(name);
  return settled != settled_.end() && *set_.find(name) != settled->second;
}

std::vector<ros::StoredParameter> ParameterStorage::on_trial() const {
  Values values;
  for (const auto& [name, settled] : settled_) {
    if (is_on_trial(name)) values.push_back({name, *set_.find(name), {}});
  }
  return values;
}

void ParameterStorage::put_on_trial(MonotonicTime now, milliseconds trial_time) {
  deadline_ = now + trial_time;
  confirmed_ = false;
  news_.push_back({.kind = ParameterNews::Kind::on_trial, .values = on_trial(), .time = trial_time});
}

void ParameterStorage::on_changed(const std::vector<std::string>& names, MonotonicTime now,
                                  milliseconds trial_time) {
  const Values trial = on_trial();
  std::erase_if(to_keep_, [&](const std::string& name) { return !is_on_trial(name); });
  if (trial.empty()) {
    deadline_.reset();
  } else if (std::any_of(names.begin(), names.end(), [&](const auto& name) { return is_on_trial(name); })) {
    put_on_trial(now, trial_time);
  }
}

Result<void, std::string> ParameterStorage::submit(const Request& request, MonotonicTime now,
                                                   milliseconds trial_time, const std::string& saved) {
  if (request.operation == Operation::report) return {};
  if (text_) return Err(std::string("another save is in progress"));
  switch (request.operation) {
    case Operation::keep:
      return keep(request, now, trial_time, saved);
    case Operation::forget:
      return forget(request, saved);
    case Operation::confirm:
      return confirm(request, saved);
    case Operation::restore:
      return restore(request, now, trial_time, saved);
    case Operation::reset:
      return reset(request, saved);
    case Operation::report:
      break;
  }
  return {};
}

Result<void, std::string> ParameterStorage::keep(const Request& request, MonotonicTime now,
                                                 milliseconds trial_time, const std::string& saved) {
  for (const std::string& name : request.names) {
    if (set_.find(name) == nullptr) return Err(fmt::format("parameter '{}' has not been declared", name));
  }
  for (const auto& [name, value] : request.values) {
    if (const std::string why = set_.next_start_refusal(name, value); !why.empty()) return Err(why);
    if (set_.is_guarded(name))
      return Err(fmt::format("parameter '{}' is guarded: set it, keep it and confirm it", name));
  }
  Values values = set_.stored();
  const bool all = request.names.empty() && request.values.empty();
  bool some_on_trial = false;
  for (const std::string& name : all ? set_.names() : request.names) {
    const ros::ParameterValue& value = *set_.find(name);
    if (is_on_trial(name)) {
      to_keep_.insert(name);
      some_on_trial = true;
    } else if (!all || (value != *set_.find_start(name) && !set_.declaration(name)->read_only)) {
      put_value(values, name, value, saved);
    } else if (!set_.declaration(name)->read_only) {
      forget_value(values, name);
    }
  }
  for (const auto& [name, value] : request.values) put_value(values, name, value, saved);
  if (some_on_trial) put_on_trial(now, trial_time);
  return store(std::move(values), origin_of("keep", request), saved);
}

Result<void, std::string> ParameterStorage::forget(const Request& request, const std::string& saved) {
  Values values = set_.stored();
  if (request.names.empty()) values.clear();
  for (const std::string& name : request.names) {
    if (find_value(values, name) == nullptr) return Err(fmt::format("parameter '{}' is not stored", name));
    forget_value(values, name);
  }
  return store(std::move(values), origin_of("forget", request), saved);
}

Result<void, std::string> ParameterStorage::confirm(const Request& request, const std::string& saved) {
  const Values trial = on_trial();
  // A repeat of a confirmation is none of nothing.
  if (trial.empty())
    return confirmed_ ? Result<void, std::string>{} : Err(std::string("nothing is on trial"));
  Values values = set_.stored();
  std::map<std::string, ros::ParameterValue> confirms;
  for (const ros::StoredParameter& p : trial) {
    confirms[p.name] = p.value;
    if (!to_keep_.contains(p.name)) continue;
    if (p.value == *set_.find_start(p.name)) {
      forget_value(values, p.name);
    } else {
      put_value(values, p.name, p.value, saved);
    }
  }
  confirms_ = std::move(confirms);
  auto stored = store(std::move(values), origin_of("confirm", request), saved);
  if (!stored) {
    confirms_.clear();
  } else if (!text_) {
    settle(std::exchange(confirms_, {}));
  }
  return stored;
}

void ParameterStorage::settle(const std::map<std::string, ros::ParameterValue>& confirmed) {
  Values values;
  for (const auto& [name, value] : confirmed) {
    to_keep_.erase(name);
    if (!is_on_trial(name)) continue;  // set back by hand in the meantime
    settled_[name] = value;
    values.push_back({name, value, {}});
  }
  if (!values.empty()) news_.push_back({.kind = ParameterNews::Kind::confirmed, .values = std::move(values)});
  if (!on_trial().empty()) return;  // one was changed again in the meantime
  deadline_.reset();
  confirmed_ = true;
}

Result<void, std::string> ParameterStorage::restore(const Request& request, MonotonicTime now,
                                                    milliseconds trial_time, const std::string& saved) {
  const ParameterGeneration* found = history_.find(request.generation);
  if (found == nullptr) return Err(fmt::format("there is no generation {}", request.generation));
  const Values wanted = found->values;
  for (const ros::StoredParameter& p : wanted) {
    if (const std::string why = set_.next_start_refusal(p.name, p.value); !why.empty()) return Err(why);
  }
  Changes changes;
  for (const std::string& name : set_.names()) {
    if (set_.declaration(name)->read_only) continue;
    const ros::StoredParameter* stored = find_value(wanted, name);
    const ros::ParameterValue& target = stored != nullptr ? stored->value : *set_.find_start(name);
    if (target != *set_.find(name)) changes.emplace_back(name, target);
  }
  for (const std::string& why : set_.set_atomically(changes)) {
    if (!why.empty()) return Err(why);
  }
  Values values;
  const Values present = set_.stored();
  for (const ros::StoredParameter& p : wanted) {
    if (!is_on_trial(p.name)) values.push_back(p);
  }
  for (const ros::StoredParameter& p : on_trial()) {
    to_keep_.insert(p.name);
    if (const ros::StoredParameter* confirmed = find_value(present, p.name)) values.push_back(*confirmed);
  }
  if (!to_keep_.empty() && deadline_ != now + trial_time) put_on_trial(now, trial_time);
  return store(std::move(values), origin_of(fmt::format("restore {}", request.generation), request), saved);
}

Result<void, std::string> ParameterStorage::reset(const Request& request, const std::string& saved) {
  Changes changes;
  for (const std::string& name : set_.names()) {
    const ros::ParameterValue start = *set_.find_start(name);
    if (settled_.contains(name)) settled_[name] = start;
    if (!set_.declaration(name)->read_only && start != *set_.find(name)) changes.emplace_back(name, start);
  }
  to_keep_.clear();
  deadline_.reset();
  confirmed_ = false;
  set_.put_back(changes);
  return store({}, origin_of("factory reset", request), saved);
}

void ParameterStorage::poll(MonotonicTime now) {
  if (text_) return;
  if (deadline_ && now >= *deadline_) revert("not confirmed in time");
  // The record of a trial that is over.
  if (!deadline_ && !history_.trial.empty() && !disk_failed_)
    static_cast<void>(store(set_.stored(), start_origin, {}));
}

void ParameterStorage::revert(const std::string& reason) {
  Changes back;
  Values values;
  for (const ros::StoredParameter& p : on_trial()) {
    back.emplace_back(p.name, settled_.at(p.name));
    values.push_back({p.name, settled_.at(p.name), {}});
  }
  to_keep_.clear();
  deadline_.reset();
  confirmed_ = false;
  set_.put_back(back);
  news_.push_back({.kind = ParameterNews::Kind::reverted, .values = std::move(values), .reason = reason});
}

Result<void, std::string> ParameterStorage::store(Values values, const std::string& origin,
                                                  const std::string& saved) {
  std::sort(values.begin(), values.end(),
            [](const ros::StoredParameter& a, const ros::StoredParameter& b) { return a.name < b.name; });
  ParameterHistory next = history_;
  next.add(std::move(values), origin, saved);
  next.trial.clear();
  for (const ros::StoredParameter& p : on_trial()) {
    if (to_keep_.contains(p.name) && !confirms_.contains(p.name))
      next.trial.push_back({p.name, p.value, saved});
  }
  if (next == history_) return {};
  auto text = write_stored(node_, next);
  if (!text) return Err(text.error());
  next_ = std::move(next);
  text_ = std::move(*text);
  return {};
}

void ParameterStorage::on_written(bool ok) {
  disk_failed_ = !ok;
  text_.reset();
  const auto confirms = std::exchange(confirms_, {});
  if (!ok) return;
  const std::uint32_t before = history_.generations.empty() ? 0 : history_.generations.back().number;
  history_ = std::move(next_);
  set_.set_stored_now(history_.values());
  if (!history_.generations.empty() && history_.generations.back().number != before) {
    news_.push_back({.kind = ParameterNews::Kind::kept,
                     .values = history_.values(),
                     .generation = history_.generations.back().number});
  }
  if (!confirms.empty()) settle(confirms);
}

}  // namespace srfs::suite
