// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/service.hpp"

#include <algorithm>

#include "base/log.hpp"

namespace srfs::ros {
namespace {

constexpr std::size_t most_waiting = 1024;

bool is_reader(const GUID_t& guid) {
  return (guid.entityId.value[3] & 0x04) != 0;
}

}  // namespace

SampleIdentity request_identity(const MessageInfo& info) {
  SampleIdentity identity;
  const GUID_t& response_reader = info.related.writer_guid();
  identity.writer_guid(response_reader != GUID_t::unknown() ? response_reader : info.identity.writer_guid());
  identity.sequence_number(info.identity.sequence_number());
  return identity;
}

/// The sender fills in who is to get the reply, and so may write anybody's name there. A client has its
/// reader and its writer in one participant; a stranger, or a limited member, that names another's reader
/// wants to pass for that one.
static bool borrows_a_name(const Participant& participant, const MessageInfo& info) {
  const GUID_t& sender = info.identity.writer_guid();
  return request_identity(info).writer_guid().guidPrefix != sender.guidPrefix &&
         !participant.may_order(sender);
}

std::optional<std::int64_t> first_attempt(const MessageInfo& info) {
  const auto first = static_cast<std::int64_t>(info.related.sequence_number().to64long());
  if (first <= 0 || first >= static_cast<std::int64_t>(info.identity.sequence_number().to64long()))
    return std::nullopt;
  return first;
}

bool ReplyQueue::can_reach(const GUID_t& client) const {
  return !is_reader(client) || writer_.matched(client);
}

bool ReplyQueue::transmit(const SampleIdentity& request, const void* response) {
  WriteParams params;
  params.related_sample_identity(request);
  return writer_.write(response, &params);
}

bool ReplyQueue::send(const SampleIdentity& request, std::shared_ptr<const void> response) {
  if (can_reach(request.writer_guid())) return transmit(request, response.get());
  if (waiting_.size() == most_waiting) {
    waiting_.pop_front();
    ++dropped_;
  }
  const MonotonicTime give_up = monotonic_now() + ServiceRequests::longest_to_match;
  waiting_.push_back({request, std::move(response), give_up});
  if (!timer_)
    timer_ = executor_.add_timer(
        give_up, nanoseconds(0), [this] { flush(); }, "reply queue");
  return true;
}

void ReplyQueue::flush() {
  timer_.reset();
  const MonotonicTime now = monotonic_now();
  std::erase_if(waiting_, [&](const Waiting& reply) {
    if (can_reach(reply.request.writer_guid())) {
      if (!transmit(reply.request, reply.response.get())) ++dropped_;
      return true;
    }
    if (now < reply.give_up) return false;
    ++dropped_;
    return true;
  });
  if (!waiting_.empty())
    timer_ = executor_.add_timer(waiting_.front().give_up, nanoseconds(0), [this] { flush(); });
}

std::uint64_t RefusalQueue::add(const GUID_t& client, std::int64_t first, std::int64_t last) {
  if (first > last) return 0;
  const auto count = static_cast<std::uint64_t>(last - first) + 1;
  if (!runs_.empty() && runs_.back().client == client && runs_.back().last + 1 == first &&
      last - runs_.back().next < longest_run) {
    runs_.back().last = last;
    return 0;
  }
  if (runs_.size() == most_runs) return count;
  const std::int64_t begin = last - first < longest_run ? first : last - longest_run + 1;
  runs_.push_back({client, begin, last});
  return static_cast<std::uint64_t>(begin - first);
}

std::optional<SampleIdentity> RefusalQueue::take() {
  if (runs_.empty()) return std::nullopt;
  Run& run = runs_.front();
  SampleIdentity request;
  request.writer_guid(run.client);
  request.sequence_number(sequence_number(run.next));
  if (run.next++ == run.last) runs_.pop_front();
  return request;
}

ServiceCore::ServiceCore(Executor& executor, Participant& participant, const std::string& dds_topic,
                         dds::TypeSupport response_type, const Qos& qos, std::shared_ptr<const void> refusal)
    : executor_(executor),
      participant_(participant),
      topic_(dds_topic),
      refusal_(std::move(refusal)),
      writer_(participant, dds_topic, std::move(response_type), qos),
      replies_(executor, writer_) {
  writer_.on_match_change([this, &executor, alive = std::weak_ptr<bool>(alive_)] {
    executor.post([this, alive] {
      if (!alive.expired()) review_clients();
    });
  });
}

bool ServiceCore::within_reach(const GUID_t& client) const {
  return is_reader(client) ? writer_.matched(client) : writer_.matched_in_participant_of(client);
}

void ServiceCore::review_clients() {
  replies_.flush();
  const auto dropped =
      requests_.drop_vanished([this](const GUID_t& client) { return within_reach(client); }, monotonic_now());
  if (clients_changed_) clients_changed_(dropped);
}

std::optional<Ticket> ServiceCore::begin(const MessageInfo& info) {
  if (borrows_a_name(participant_, info)) {
    ++unrefused_;
    return std::nullopt;
  }
  const SampleIdentity request = request_identity(info);
  const auto judgement =
      requests_.judge(request, first_attempt(info), within_reach(request.writer_guid()), executor_.now());
  if (judgement.verdict == ServiceRequests::Verdict::answer_again) replies_.send(request, judgement.response);
  if (judgement.verdict == ServiceRequests::Verdict::refuse) {
    const auto sequence = static_cast<std::int64_t>(request.sequence_number().to64long());
    refuse(request.writer_guid(), sequence, sequence);
  }
  if (judgement.verdict != ServiceRequests::Verdict::execute) return std::nullopt;
  return judgement.ticket;
}

void ServiceCore::on_lost(const MessageInfo& info, std::int64_t first, std::int64_t last) {
  if (borrows_a_name(participant_, info)) return;
  refuse(request_identity(info).writer_guid(), first, last);
}

void ServiceCore::refuse(const GUID_t& client, std::int64_t first, std::int64_t last) {
  if (!participant_.is_foreign(client)) return;  // ours repeats, and gives up in time
  unrefused_ += refusals_.add(client, first, last);
  if (refusing_ || refusals_.empty()) return;
  refusing_ = true;
  send_refusals();
}

void ServiceCore::send_refusals() {
  for (std::size_t i = 0; i < RefusalQueue::at_a_time; ++i) {
    const auto request = refusals_.take();
    if (!request) break;
    replies_.send(*request, refusal_);
  }
  refusing_ = !refusals_.empty();
  if (!refusing_) return;
  next_refusals_ = executor_.add_timer(
      monotonic_now(), nanoseconds(0), [this] { send_refusals(); }, "refusals");
}

void ServiceCore::add_to(InputStats& stats) const {
  stats.repeats = counters().repeats;
  stats.refused = counters().refused;
  stats.unanswered = counters().dropped + dropped_replies();
}

bool ServiceCore::reply(Ticket ticket, std::shared_ptr<const void> response) {
  const auto request = requests_.answer(ticket, response, executor_.now());
  if (!request || replies_.send(*request, std::move(response))) return true;
  ++refused_replies_;
  log::error("a reply on {} exceeds a bound of its type and is not sent: the client will time out", topic_);
  return false;
}

}  // namespace srfs::ros
