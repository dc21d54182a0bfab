#include "ros/service.hpp"

#include <algorithm>

#include "base/log.hpp"

namespace srfs::ros {
namespace {

constexpr std::size_t most_waiting = 32;

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
  const MonotonicTime give_up = monotonic_now() + RequestBook::longest_to_match;
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

ServiceCore::ServiceCore(Executor& executor, Participant& participant, const std::string& dds_topic,
                         dds::TypeSupport response_type, const Qos& qos)
    : executor_(executor),
      topic_(dds_topic),
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
      book_.drop_vanished([this](const GUID_t& client) { return within_reach(client); }, monotonic_now());
  if (clients_changed_) clients_changed_(dropped);
}

std::optional<Ticket> ServiceCore::begin(const MessageInfo& info) {
  const SampleIdentity request = request_identity(info);
  const auto judgement =
      book_.judge(request, first_attempt(info), within_reach(request.writer_guid()), executor_.now());
  if (judgement.verdict == RequestBook::Verdict::answer_again) replies_.send(request, judgement.response);
  if (judgement.verdict != RequestBook::Verdict::execute) return std::nullopt;
  return judgement.ticket;
}

void ServiceCore::add_to(InputStats& stats) const {
  stats.repeats = counters().repeats;
  stats.refused = counters().refused;
  stats.unanswered = counters().dropped + dropped_replies();
}

bool ServiceCore::reply(Ticket ticket, std::shared_ptr<const void> response) {
  const auto request = book_.answer(ticket, response, executor_.now());
  if (!request || replies_.send(*request, std::move(response))) return true;
  ++refused_replies_;
  log::error("a reply on {} breaks a bound of its type and is not sent: the client will time out", topic_);
  return false;
}

}  // namespace srfs::ros
