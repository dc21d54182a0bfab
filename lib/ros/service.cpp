#include "ros/service.hpp"

namespace srfs::ros {
namespace {

constexpr milliseconds match_wait{100};
constexpr milliseconds match_poll{5};
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

ReplyQueue::ReplyQueue(Executor& executor, WriterEndpoint& writer) : executor_(executor), writer_(writer) {}

bool ReplyQueue::can_reach(const SampleIdentity& request) const {
  return !is_reader(request.writer_guid()) || writer_.matched(request.writer_guid());
}

void ReplyQueue::transmit(const SampleIdentity& request, const Write& write) {
  WriteParams params;
  params.related_sample_identity(request);
  write(params);
}

void ReplyQueue::send(const SampleIdentity& request, Write write) {
  if (can_reach(request)) {
    transmit(request, write);
    return;
  }
  if (waiting_.size() == most_waiting) {
    waiting_.pop_front();
    ++dropped_;
  }
  waiting_.push_back({request, std::move(write), executor_.now() + match_wait});
  if (!timer_)
    timer_ = executor_.add_timer(
        executor_.now() + match_poll, match_poll, [this] { flush(); }, "reply queue");
}

void ReplyQueue::flush() {
  std::deque<Waiting> still;
  for (Waiting& reply : waiting_) {
    if (can_reach(reply.request)) {
      transmit(reply.request, reply.write);
    } else if (executor_.now() < reply.give_up) {
      still.push_back(std::move(reply));
    } else {
      ++dropped_;
    }
  }
  waiting_ = std::move(still);
  if (waiting_.empty()) timer_.reset();
}

}  // namespace srfs::ros
