// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/pass/order_follower.hpp"

#include <algorithm>
#include <array>

#include <poll.h>

#include "base/signals.hpp"

namespace srfs::ground::pass {
namespace {

OrderEnd end_of(const StageReport& report) {
  using How = OrderEnd::How;
  switch (report.outcome) {
    case Outcome::timed_out:
      return {.how = How::lost, .why = "no report of its end came"};
    case Outcome::unknown:
      return {.how = How::unknown, .why = report.failure_text};
    case Outcome::not_sent:
      return {.how = How::not_sent, .why = report.failure_text};
    default:
      return {.how = How::otherwise,
              .why = report.failure_text.empty() ? std::string(to_text(report)) : report.failure_text};
  }
}

}  // namespace

OrderFollower::OrderFollower(const mission::Dictionary& dictionary, std::unique_ptr<StationLink> link,
                             Output output)
    : dictionary_(dictionary),
      output_(std::move(output)),
      signals_(termination_signals()),
      station_(dictionary, std::move(link), station_output()) {}

StationOutput OrderFollower::station_output() {
  return {.telemetry = [this](const auto& report) { on_telemetry(report); },
          .stage = [this](const auto& report) { on_stage(report); },
          .retrieval_over = {},
          .cop = {},
          .file = output_.file,
          .keys = {},
          .problem = output_.note,
          .note = output_.note};
}

void OrderFollower::send(const PassAction& action) {
  followed_ = Followed{.tag = action.tag, .step = action.step};
  const auto& [name, arguments] = action.telecommand;
  const auto encoded = dictionary_.encode(name, arguments);
  if (encoded && !action.step) followed_->order = ReportOrder::of(dictionary_, *encoded);
  const auto timeout = action.step ? action.step->timeout : std::nullopt;
  const auto release =
      action.step && action.step->at ? std::optional(action.step->at->at(system_utc_now())) : std::nullopt;
  // What relies on its record is never sent without one.
  const bool recorded_alone = !action.token.empty();
  const auto sent = release ? station_.send_at(*release, name, arguments, timeout, action.tag, action.token,
                                               action.again, recorded_alone)
                            : station_.send(name, arguments, timeout, action.tag, action.token, action.again,
                                            recorded_alone);
  if (sent) return;
  end({.how = sent.error().is_unknown() ? OrderEnd::How::unknown : OrderEnd::How::not_sent,
       .why = sent.error().text});
}

void OrderFollower::end(OrderEnd how) {
  if (!followed_ || followed_->end) return;
  followed_->end = std::move(how);
  if (followed_->order && followed_->end->how == OrderEnd::How::as_wanted)
    followed_->order->on_completed(monotonic_now());
}

std::optional<OrderFollower::Ended> OrderFollower::take_end() {
  if (!followed_ || !followed_->end) return std::nullopt;
  OrderEnd& end = *followed_->end;
  if (followed_->order && end.how == OrderEnd::How::as_wanted) {
    if (!followed_->order->is_over(monotonic_now())) return std::nullopt;
    if (!followed_->order->came() && !followed_->order->may_be_none())
      end = {.how = OrderEnd::How::lost, .why = "completed, but its report was lost"};
  }
  end.reports = std::move(followed_->reports);
  Ended ended{.tag = followed_->tag, .end = std::move(end)};
  followed_.reset();
  return ended;
}

void OrderFollower::on_telemetry(const TelemetryReport& report) {
  latest_.take(report, system_utc_now());
  if (followed_ && followed_->order && followed_->order->take(report, monotonic_now()))
    followed_->reports.push_back(report);
}

void OrderFollower::on_stage(const StageReport& report) {
  if (!followed_ || report.tag != followed_->tag) return;
  if (report.insertion && !report.is_failure()) return;  // the telecommand itself says that it is scheduled
  if (followed_->step) {
    if (const auto judged = judge(*followed_->step, report)) end(*judged ? OrderEnd{} : end_of(report));
    return;
  }
  if (report.is_completed()) return end({});
  if (report.is_final()) end(end_of(report));
}

bool OrderFollower::wait(MonotonicTime wake) {
  if (const auto next = station_.next_deadline()) wake = std::min(wake, *next);
  if (followed_ && followed_->order && followed_->order->deadline())
    wake = std::min(wake, *followed_->order->deadline());
  const auto left = std::chrono::ceil<milliseconds>(wake - monotonic_now()).count();
  std::array<pollfd, 2> fds{{{station_.fd(), POLLIN, 0}, {signals_.get(), POLLIN, 0}}};
  static_cast<void>(
      ::poll(fds.data(), fds.size(), static_cast<int>(std::clamp<std::int64_t>(left, 0, 1000))));
  if (fds[1].revents != 0) interrupted_ = true;
  if (fds[0].revents != 0) {
    if (const auto read = station_.on_readable(); !read) problem_ = read.error();
  }
  if (const auto done = station_.on_time(); !done) problem_ = done.error();
  return problem_.empty();
}

}  // namespace srfs::ground::pass
