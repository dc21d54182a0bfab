#pragma once

#include <deque>

#include "ros/endpoint.hpp"

namespace srfs::ros {

/// Names the request a reply belongs to (ROS2_WIRE: the client's response reader, else its request writer;
/// sequence).
[[nodiscard]] SampleIdentity request_identity(const MessageInfo& info);

/// Sends replies. A reply whose client reader has not been matched yet would be lost, so it waits (bounded:
/// 32 replies, 100 ms each) until the match; it never blocks the work thread.
class ReplyQueue {
 public:
  using Write = std::function<bool(WriteParams&)>;

  ReplyQueue(Executor& executor, WriterEndpoint& writer);
  /// @param write writes the reply with the given parameters; kept until it is sent or given up
  void send(const SampleIdentity& request, Write write);
  /// Replies given up because the client's reader never matched.
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }

 private:
  struct Waiting {
    SampleIdentity request;
    Write write;
    MonotonicTime give_up;
  };
  void flush();
  [[nodiscard]] bool can_reach(const SampleIdentity& request) const;
  void transmit(const SampleIdentity& request, const Write& write);

  Executor& executor_;
  WriterEndpoint& writer_;
  std::deque<Waiting> waiting_;
  Timer timer_;
  std::uint64_t dropped_ = 0;
};

/// Marks a service whose replies come later, by Service::reply.
struct DeferReplies {};
inline constexpr DeferReplies defer_replies{};
/// Names a request that waits for its reply.
using Ticket = SampleIdentity;

/// Serves one service of type S. The handler runs on the work thread and fills the response.
template <class S>
class Service {
 public:
  using Request = typename S::Request;
  using Response = typename S::Response;
  using Handler = std::function<void(const Request&, Response&)>;
  using DeferredHandler = std::function<void(const Request&, Ticket)>;

  Service(Executor& executor, Participant& participant, const std::string& name, const Qos& qos,
          Priority priority, Handler handler)
      : Service(executor, participant, name, qos, priority, defer_replies,
                [this, f = std::move(handler)](const Request& request, Ticket ticket) {
                  Response response;
                  f(request, response);
                  reply(ticket, std::move(response));
                }) {}

  /// @param handler keeps the ticket; reply() answers it, then or later
  Service(Executor& executor, Participant& participant, const std::string& name, const Qos& qos,
          Priority priority, DeferReplies, DeferredHandler handler)
      : handler_(std::move(handler)),
        writer_(std::make_shared<WriterEndpoint>(participant, reply_dds_name(name),
                                                 dds::TypeSupport(new TypeSupport<Response>), qos)),
        replies_(executor, *writer_),
        reader_(TypedReader<Request>::create(executor, participant, request_dds_name(name), qos, priority,
                                             [this](const Request& request, const MessageInfo& info) {
                                               handler_(request, request_identity(info));
                                             })) {}

  ~Service() { reader_->close(); }
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;

  /// Answers a request, once. On the work thread.
  void reply(Ticket ticket, Response response) {
    replies_.send(ticket, [writer = writer_, kept = std::make_shared<Response>(std::move(response))](
                              WriteParams& params) { return writer->write(kept.get(), &params); });
  }

  [[nodiscard]] InputStats stats() const { return reader_->stats(); }
  [[nodiscard]] GUID_t reader_guid() const { return reader_->guid(); }
  [[nodiscard]] GUID_t writer_guid() const { return writer_->guid(); }

 private:
  DeferredHandler handler_;
  std::shared_ptr<WriterEndpoint> writer_;
  ReplyQueue replies_;
  std::shared_ptr<TypedReader<Request>> reader_;
};

}  // namespace srfs::ros
