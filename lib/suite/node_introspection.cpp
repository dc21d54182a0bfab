// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/node_introspection.hpp"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

#include <mission/structures.hpp>

#include "base/excerpt.hpp"
#include "base/file.hpp"
#include "base/saturate.hpp"
#include "suite/mission_time.hpp"
#include "suite/node.hpp"
#include "suite/run_node.hpp"

namespace srfs::suite {
namespace {

constexpr const char* parameter_file = "parameters.yaml";
constexpr const char* set_aside_file = "parameters_set_aside.yaml";
constexpr const char* damaged_file = "parameters.damaged";
constexpr std::size_t most_set_aside_told = 32;
constexpr std::size_t longest_told = 250;
constexpr std::size_t longest_content = 150;  // of an event
constexpr std::size_t most_on_trial_told = 64;
constexpr std::size_t most_set_aside_events = 8;

std::string cut(std::string_view text, std::size_t longest) {
  return excerpt(text, longest);
}

srfs_msgs::msg::CallbackStatistics to_message(const ros::CallbackRecord& record, nanoseconds budget) {
  srfs_msgs::msg::CallbackStatistics m;
  m.kind = static_cast<std::uint8_t>(record.kind);
  m.name = cut(record.name, 96);
  m.count = record.run_time.count();
  m.over_budget = record.over_budget;
  m.failed = record.failed;
  m.missed_periods = record.missed_periods;
  m.budget_us = as_us(budget);
  m.p50_us = as_us(record.run_time.quantile(0.5));
  m.p99_us = as_us(record.run_time.quantile(0.99));
  m.max_us = as_us(record.run_time.max());
  m.total_us = static_cast<std::uint64_t>(record.total / microseconds(1));
  return m;
}

}  // namespace

KeptParameters read_kept_parameters(const std::filesystem::path& state) {
  const std::filesystem::path file = state / parameter_file;
  KeptParameters kept;
  const auto text = read_file(file, largest_parameter_file);
  std::error_code ec;
  if (!text && !std::filesystem::exists(file, ec)) return kept;
  auto stored = text ? read_stored(*text) : Err(text.error().message);
  if (!stored) {
    std::filesystem::rename(file, state / damaged_file, ec);
    log::error("{} is damaged and set aside as {}: {}", file.string(), damaged_file, stored.error());
    kept.not_used.push_back({parameter_file, stored.error()});
    return kept;
  }
  for (const std::string& what : stored->damaged) {
    log::warn("{}: {}", file.string(), what);
    if (kept.not_used.size() < most_set_aside_told) kept.not_used.push_back({parameter_file, what});
  }
  kept.history = std::move(stored->history);
  return kept;
}

NodeIntrospection::NodeIntrospection(Node& node, KeptParameters kept)
    : node_(node),
      start_(monotonic_now()),
      counted_since_(start_),
      last_work_(start_),
      not_used_(std::move(kept.not_used)),
      storage_(node.parameters(), node.name(), std::move(kept.history)) {
  using srfs_msgs::srv::GetExecutorStatistics;
  using srfs_msgs::srv::GetNodeStatus;
  status_ = node_.create_service<GetNodeStatus>(
      "~/get_status", [this](const auto&, GetNodeStatus::Response& response) { fill(response); });
  statistics_ = node_.create_service<GetExecutorStatistics>(
      "~/get_executor_statistics",
      [this](const GetExecutorStatistics::Request& request, GetExecutorStatistics::Response& response) {
        fill(response);
        if (!request.reset) return;
        node_.executor().statistics().reset();
        counted_since_ = node_.now();
        busy_before_reset_ = node_.executor().statistics().busy();
      });
  save_ = node_.create_deferred_service<SaveParameters>(
      "~/save_parameters",
      [this](const SaveParameters::Request& request, auto ticket) { on_save(request, ticket); });
}

std::string NodeIntrospection::path(const char* file) const {
  return (node_.state_dir() / file).string();
}

// ---------------------------------------------------------------- kept parameters

milliseconds NodeIntrospection::trial_time() const {
  return seconds(node_.get_parameter<std::int64_t>("parameter_trial_s"));
}

void NodeIntrospection::on_save(const SaveParameters::Request& request, ros::Ticket ticket) {
  const auto answer = [this, ticket](const Result<void, std::string>& outcome) {
    if (!outcome) log::warn("parameters not saved: {}", outcome.error());
    save_->reply(ticket, outcome_of(outcome));
  };
  if (node_.refuses_order(save_->client(ticket), "~/save_parameters"))
    return answer(Err(std::string("refused: not from the suite")));
  if (request.operation > SaveParameters::Request::REPORT)
    return answer(Err(fmt::format("there is no operation {}", request.operation)));
  ParameterStorage::Request wanted{.operation = static_cast<ParameterStorage::Operation>(request.operation),
                                   .names = request.names,
                                   .generation = request.generation,
                                   .origin = request.origin};
  for (const auto& parameter : request.values) {
    const auto value = ros::from_message(parameter.value);
    if (!value) {
      return answer(Err(fmt::format("parameter '{}': values of type {} are not supported",
                                    excerpt(parameter.name), parameter.value.type)));
    }
    wanted.values.emplace_back(parameter.name, *value);
  }
  const auto done = storage_.submit(wanted, node_.now(), trial_time(), to_iso8601(system_utc_now(), 0));
  if (done && storage_.to_write() && wanted.operation != ParameterStorage::Operation::report) {
    write(answer);
  } else {
    answer(done);
  }
  follow_storage();
}

srfs_msgs::srv::SaveParameters_Response NodeIntrospection::outcome_of(
    const Result<void, std::string>& outcome) const {
  SaveParameters::Response r;
  r.success = outcome.has_value();
  if (!outcome) r.reason = cut(outcome.error(), longest_told);
  for (const ros::StoredParameter& p : node_.parameters().stored()) r.stored.push_back(p.name);
  for (const ros::StoredParameter& p : storage_.on_trial()) {
    if (r.on_trial.size() < most_on_trial_told) r.on_trial.push_back(p.name);
  }
  if (const auto end = storage_.deadline())
    r.trial_left_ms = as_u32(std::max<std::int64_t>((*end - node_.now()) / milliseconds(1), 1));
  const auto& generations = storage_.history().generations;
  for (auto g = generations.rbegin(); g != generations.rend(); ++g) {
    srfs_msgs::msg::ParameterGeneration m;
    m.number = g->number;
    m.saved = cut(g->saved, 32);
    m.origin = cut(g->origin, 60);
    m.count = static_cast<std::uint16_t>(g->values.size());
    m.values = cut(to_text(g->values), 200);
    r.history.push_back(std::move(m));
  }
  return r;
}

void NodeIntrospection::write(std::function<void(const Result<void, std::string>&)> answer) {
  if (!disk_)
    disk_ = std::make_unique<ros::Worker>(node_.executor(), "parameters", 1, node_.worker_deadline());
  auto written = std::make_shared<Result<void, FileError>>();
  const auto end = [this, written, answer = std::move(answer)] {
    storage_.on_written(written->has_value());
    if (!*written) log::error("parameters not saved: {}", written->error().message);
    if (answer) {
      answer(*written ? Result<void, std::string>{}
                      : Err("not saved, so it holds only until the next start: " + written->error().message));
    }
    storage_.poll(node_.now());
    if (storage_.to_write()) write({});
    follow_storage();
  };
  const bool taken = disk_->post(
      [file = path(parameter_file), text = *storage_.to_write(), written] {
        try {
          *written = write_file_atomically(file, text);
        } catch (const std::exception& e) {
          *written = Err(FileError{e.what()});
        }
      },
      end);
  if (taken) return;
  *written = Err(FileError{"the disk is still busy with another file"});
  end();
}

void NodeIntrospection::on_parameters_changed(const std::vector<std::string>& names) {
  storage_.on_changed(names, node_.now(), trial_time());
  follow_storage();
}

void NodeIntrospection::follow_storage() {
  trial_end_.reset();
  // While something is being written, its end looks after the trial.
  if (const auto end = storage_.deadline(); end && !storage_.to_write()) {
    trial_end_ = node_.create_one_shot(
        *end,
        [this] {
          storage_.poll(node_.now());
          if (storage_.to_write()) write({});
          follow_storage();
        },
        "end of the trial");
  }
  const auto content = [](const ParameterNews& news) { return cut(to_text(news.values), longest_content); };
  for (const ParameterNews& news : storage_.take_news()) {
    switch (news.kind) {
      case ParameterNews::Kind::kept:
        log::info("parameters kept as generation {}: {}", news.generation, to_text(news.values));
        node_.raise(mission::ParameterKeptEvent{.generation = news.generation,
                                                .values = static_cast<std::uint16_t>(news.values.size()),
                                                .content = content(news)});
        break;
      case ParameterNews::Kind::on_trial:
        log::warn("on trial for {} s: {}", news.time / seconds(1), to_text(news.values));
        node_.raise(mission::ParameterOnTrialEvent{
            .time_s = static_cast<std::uint32_t>(news.time / seconds(1)), .content = content(news)});
        break;
      case ParameterNews::Kind::confirmed:
        log::info("no longer on trial: {}", to_text(news.values));
        node_.raise(mission::ParameterConfirmedEvent{.content = content(news)});
        break;
      case ParameterNews::Kind::reverted:
        log::warn("{}, reverted to: {}", news.reason, to_text(news.values));
        node_.raise(mission::ParameterRevertedEvent{.reason = news.reason, .content = content(news)});
        break;
    }
  }
}

void NodeIntrospection::begin_keeping() {
  keep_set_aside();
  storage_.begin(to_iso8601(system_utc_now(), 0));
  if (!storage_.to_write()) return;
  const auto written = write_file_atomically(path(parameter_file), *storage_.to_write());
  if (!written) log::error("{}", written.error().message);
  storage_.on_written(written.has_value());
}

/// First where they go, then (begin_keeping) where they come from: a crash in between loses nothing.
void NodeIntrospection::keep_set_aside() {
  const auto& unused = node_.parameters().set_aside();
  if (unused.empty()) return;
  std::vector<ros::StoredParameter> moved;
  for (const ros::SetAside& entry : unused) {
    log::warn("stored parameter '{}' is not used: {}", entry.parameter.name, entry.reason);
    note_unused(entry.parameter.name, entry.reason);
    moved.push_back(entry.parameter);
  }
  // What was set aside at earlier starts stays behind them, the newest value of each name, while there is
  // room.
  if (const auto text = read_file(path(set_aside_file), largest_parameter_file)) {
    if (const auto before = read_stored(*text)) {
      for (const ros::StoredParameter& old : before->history.values()) {
        const bool newer =
            std::any_of(moved.begin(), moved.end(), [&](const auto& m) { return m.name == old.name; });
        if (!newer && moved.size() < most_stored_parameters) moved.push_back(old);
      }
    }
  }
  if (const auto written = write_file_atomically(path(set_aside_file), write_list(node_.name(), moved));
      !written)
    log::error("{}", written.error().message);
}

void NodeIntrospection::note_unused(std::string what, std::string reason) {
  if (not_used_.size() < most_set_aside_told) not_used_.push_back({std::move(what), std::move(reason)});
}

void NodeIntrospection::raise_start_report() {
  for (std::size_t i = 0; i < std::min(not_used_.size(), most_set_aside_events); ++i) {
    const mission::NodeParameterSetAsideEvent event{.parameter = not_used_[i].what,
                                                    .reason = not_used_[i].reason};
    node_.raise(event);
  }
  follow_storage();
}

void NodeIntrospection::fill(srfs_msgs::srv::GetNodeStatus_Response& r) const {
  const ros::LastTransition& last = node_.last_transition();
  const log::Losses losses = log::losses();
  r.state = static_cast<std::uint8_t>(node_.state());
  r.state_label = std::string(label(node_.state()));
  r.incarnation = node_.incarnation();
  r.version = version();
  r.uptime_ns = static_cast<std::uint64_t>((node_.now() - start_).count());
  r.last_transition = cut(last.label, 32);
  r.last_outcome = static_cast<std::uint8_t>(last.outcome);
  r.last_reason = cut(last.reason, longest_told);
  r.last_took_ms = as_us(last.took) / 1000;
  r.last_was_late = last.late;
  r.failed_transitions = node_.failed_transitions();
  r.failed_callbacks = node_.failed_callbacks();
  r.log_held_back = losses.held_back;
  r.log_lost = losses.lost;
  r.events_suppressed = node_.suppressed_events();
  for (const NotUsed& n : not_used_)
    r.parameters_set_aside.push_back(cut(fmt::format("{}: {}", n.what, n.reason), longest_told));
}

void NodeIntrospection::fill(srfs_msgs::srv::GetExecutorStatistics_Response& r) const {
  ros::Executor& executor = node_.executor();
  ros::CallbackStatistics& statistics = executor.statistics();
  r.counted_for_ns = static_cast<std::uint64_t>((node_.now() - counted_since_).count());
  r.busy_ns = static_cast<std::uint64_t>((statistics.busy() - busy_before_reset_).count());
  r.missed_timer_periods = executor.missed_timer_periods();
  r.refused_posts = executor.refused_posts();
  r.callback_budget_us = as_us(milliseconds(node_.get_parameter<std::int64_t>("callback_budget_ms")));
  for (const ros::CallbackRecord& record : statistics.records())
    r.callbacks.push_back(to_message(record, statistics.budget(record)));
  executor.for_each_source([&](const ros::CallbackRecord& record, const ros::Source& source) {
    const auto* reader = dynamic_cast<const ros::ReaderEndpoint*>(&source);
    if (reader == nullptr || r.inputs.size() == 256) return;
    srfs_msgs::msg::InputStatistics input;
    const ros::InputStats stats = reader->stats();
    input.name = cut(record.name, 96);
    input.received = stats.received;
    input.malformed = stats.malformed;
    input.lost = stats.lost;
    input.foreign = stats.foreign;
    input.repeats = stats.repeats;
    input.refused = stats.refused;
    input.unanswered = stats.unanswered;
    input.matched = as_u32(reader->matched_count());
    r.inputs.push_back(std::move(input));
  });
}

void NodeIntrospection::publish_work() {
  const std::optional<mission::WorkThreadStructure> structure = node_.work_structure();
  ros::Executor& executor = node_.executor();
  ros::CallbackStatistics& statistics = executor.statistics();
  const ros::CallbackStatistics::Longest longest = statistics.take_longest();
  const MonotonicTime now = monotonic_now();
  const nanoseconds busy = statistics.busy() - busy_at_last_work_;
  const nanoseconds period = std::max<nanoseconds>(now - last_work_, nanoseconds(1));
  busy_at_last_work_ = statistics.busy();
  last_work_ = now;
  if (!structure) return;

  const log::Losses losses = log::losses();
  mission::WorkThread work;
  work.state = is_primary(node_.state()) ? static_cast<mission::LifecycleState>(node_.state())
                                         : mission::LifecycleState::transition;
  work.mode_change = node_.obeyed_change().value_or(UINT32_MAX);
  work.callbacks = statistics.all().count();
  work.over_budget = as_u32(statistics.over_budget());
  work.failed = node_.failed_callbacks();
  work.run_p50_us = as_us(statistics.all().quantile(0.5));
  work.run_p99_us = as_us(statistics.all().quantile(0.99));
  work.longest_us = as_us(longest.took);
  if (longest.record != nullptr) work.longest = cut(longest.record->name, 40);
  work.busy =
      static_cast<float>(100.0 * static_cast<double>(busy.count()) / static_cast<double>(period.count()));
  work.missed_timer_periods = as_u32(executor.missed_timer_periods());
  work.refused_posts = as_u32(executor.refused_posts());
  executor.for_each_source([&](const ros::CallbackRecord&, const ros::Source& source) {
    const auto* reader = dynamic_cast<const ros::ReaderEndpoint*>(&source);
    if (reader == nullptr) return;
    work.samples_lost += as_u32(reader->stats().lost);
  });
  work.samples_malformed = as_u32(node_.malformed_samples());
  work.failed_transitions = node_.failed_transitions();
  work.log_held_back = as_u32(losses.held_back);
  work.log_lost = as_u32(losses.lost);
  work.events_suppressed = as_u32(node_.suppressed_events());

  srfs_msgs::msg::PayloadTelemetry m;
  m.source = node_.name();
  m.apid = structure->apid;
  m.structure_id = structure->structure_id;
  m.utc = ros::to_message(system_utc_now());
  m.time_valid = false;  // the node's own clock; ttc stamps the report with mission time
  m.monotonic_ns = static_cast<std::uint64_t>(now.ns());
  OctetWriter out;
  work.encode(out);
  m.data = out.take();
  node_.publish_telemetry(m);
}

}  // namespace srfs::suite
