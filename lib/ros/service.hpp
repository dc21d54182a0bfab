// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <deque>
#include <span>

#include "ros/endpoint.hpp"
#include "ros/service_requests.hpp"

namespace srfs::ros {

/// Names the request a reply belongs to (ROS2_WIRE: the client's response reader, else its request writer;
/// sequence).
[[nodiscard]] SampleIdentity request_identity(const MessageInfo& info);
/// Sequence number of the first attempt when the request says that it is a repeat (ServiceRequests).
[[nodiscard]] std::optional<std::int64_t> first_attempt(const MessageInfo& info);

/// Sends replies. A reply whose client reader has not been matched yet would be lost, so it waits (bounded:
/// 1024 replies, 3 s each) until the match; it never blocks the work thread.
class ReplyQueue {
 public:
  ReplyQueue(Executor& executor, WriterEndpoint& writer) : executor_(executor), writer_(writer) {}
  /// @param response kept until it is sent or given up. @return false when it breaks a bound of its type
  bool send(const SampleIdentity& request, std::shared_ptr<const void> response);
  /// Sends what can be sent now, gives up what is too late.
  void flush();
  [[nodiscard]] bool can_reach(const GUID_t& client) const;
  /// Replies given up because the client's reader never matched.
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }

 private:
  struct Waiting {
    SampleIdentity request;
    std::shared_ptr<const void> response;
    MonotonicTime give_up;
  };
  bool transmit(const SampleIdentity& request, const void* response);

  Executor& executor_;
  WriterEndpoint& writer_;
  std::deque<Waiting> waiting_;
  Timer timer_;
  std::uint64_t dropped_ = 0;
};

/// Requests that are not executed and whose client may wait for ever: each is answered with a refusal, in
/// order, at most `at_a_time` in a turn. Bounded: 64 runs of at most 16384 requests, the newest of each.
/// Pure.
class RefusalQueue {
 public:
  static constexpr std::size_t at_a_time = 16;
  static constexpr std::size_t most_runs = 64;
  static constexpr std::int64_t longest_run = 16'384;

  /// Requests @p first to @p last of a client. @return how many of them are not in the queue: they found no
  /// room
  std::uint64_t add(const GUID_t& client, std::int64_t first, std::int64_t last);
  /// The next one; nullopt: none.
  [[nodiscard]] std::optional<SampleIdentity> take();
  [[nodiscard]] bool empty() const { return runs_.empty(); }

 private:
  struct Run {
    GUID_t client;
    std::int64_t next;
    std::int64_t last;
  };
  std::deque<Run> runs_;
};

/// The half of a service that does not know its types: which requests to execute, which replies to send.
class ServiceCore {
 public:
  /// @param refusal what a client outside the suite gets for a request that is not executed
  ServiceCore(Executor& executor, Participant& participant, const std::string& dds_topic,
              dds::TypeSupport response_type, const Qos& qos, std::shared_ptr<const void> refusal);

  /// A request came. @return the ticket to execute it under; nullopt when there is nothing to execute
  [[nodiscard]] std::optional<Ticket> begin(const MessageInfo& info);
  bool reply(Ticket ticket, std::shared_ptr<const void> response);
  /// Requests @p first to @p last of the writer of this one are lost.
  void on_lost(const MessageInfo& info, std::int64_t first, std::int64_t last);
  void forget(Ticket ticket) { requests_.forget(ticket); }
  void on_clients_changed(std::function<void(std::span<const Ticket> dropped)> callback) {
    clients_changed_ = std::move(callback);
  }
  [[nodiscard]] GUID_t client(Ticket ticket) const { return requests_.client(ticket); }
  [[nodiscard]] bool within_reach(const GUID_t& client) const;
  [[nodiscard]] const ServiceRequests::Counters& counters() const { return requests_.counters(); }
  /// Replies that were not sent: the client's reader never matched, or the reply broke a bound of its type.
  [[nodiscard]] std::uint64_t dropped_replies() const {
    return replies_.dropped() + refused_replies_ + unrefused_;
  }
  [[nodiscard]] std::size_t pending() const { return requests_.pending(); }
  void add_to(InputStats& stats) const;
  [[nodiscard]] GUID_t writer_guid() const { return writer_.guid(); }

 private:
  void review_clients();
  void refuse(const GUID_t& client, std::int64_t first, std::int64_t last);
  void send_refusals();

  Executor& executor_;
  Participant& participant_;
  const std::string topic_;
  const std::shared_ptr<const void> refusal_;
  RefusalQueue refusals_;
  bool refusing_ = false;        // a turn of send_refusals() is on its way
  std::uint64_t unrefused_ = 0;  // found no room among the refusals
  std::uint64_t refused_replies_ = 0;
  ServiceRequests requests_;
  WriterEndpoint writer_;
  ReplyQueue replies_;
  Timer next_refusals_;
  std::function<void(std::span<const Ticket>)> clients_changed_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);  // for what is posted by middleware threads
};

/// Marks a service whose replies come later, by Service::reply.
struct DeferReplies {};
inline constexpr DeferReplies defer_replies{};

/// Serves one service of type S, any number of clients at once. The handler runs on the work thread.
///
/// Bounds: service_depth requests wait to be taken. What is lost before, or finds 64 requests waiting for
/// their reply, is not executed and counted. A client outside the suite, which may wait for ever, is then
/// answered with the empty response (a goal: not accepted; a result: of an unknown goal); one of the suite
/// repeats its request, and gives up at its deadline.
///
/// A request that one of our clients repeats is executed once: the first answer is sent again
/// (ServiceRequests states the bounds). ROS 2 clients never repeat.
template <class S>
class Service {
 public:
  using Request = typename S::Request;
  using Response = typename S::Response;
  using Handler = std::function<void(const Request&, Response&)>;
  using DeferredHandler = std::function<void(const Request&, Ticket)>;

  /// @param handler fills the response, which is sent when it returns
  Service(Executor& executor, Participant& participant, const std::string& name, const Qos& qos,
          Priority priority, Handler handler)
      : Service(executor, participant, name, qos, priority, defer_replies,
                [this, f = std::move(handler)](const Request& request, Ticket ticket) {
                  auto response = std::make_shared<Response>();
                  f(request, *response);
                  core_.reply(ticket, std::move(response));
                }) {}

  /// @param handler keeps the ticket; reply() answers it, then or later. At most 64 requests wait at a time.
  Service(Executor& executor, Participant& participant, const std::string& name, const Qos& qos,
          Priority priority, DeferReplies, DeferredHandler handler)
      : handler_(std::move(handler)),
        core_(executor, participant, reply_dds_name(name), dds::TypeSupport(new TypeSupport<Response>),
              deep(qos), std::make_shared<Response>()),
        reader_(TypedReader<Request>::create(
            executor, participant, request_dds_name(name), deep(qos), priority,
            [this](const Request& request, const MessageInfo& info) { serve(request, info); })) {
    reader_->on_gap([this](const MessageInfo& info, std::int64_t first, std::int64_t last) {
      core_.on_lost(info, first, last);
    });
    reader_->add_to_stats([this](InputStats& stats) { core_.add_to(stats); });
  }

  ~Service() { reader_->close(); }
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;

  /// Answers a request, once. On the work thread. A ticket that was answered, or whose client vanished, is
  /// ignored. @return false when the response breaks a bound of its type: nothing was sent
  bool reply(Ticket ticket, Response response) {
    return core_.reply(ticket, std::make_shared<Response>(std::move(response)));
  }
  /// The sender of a request that waits (its response reader, else its request writer).
  [[nodiscard]] GUID_t client(Ticket ticket) const { return core_.client(ticket); }
  /// The client can be sent replies now.
  [[nodiscard]] bool within_reach(const GUID_t& client) const { return core_.within_reach(client); }
  /// Called on the work thread after clients came or went, with the tickets that were dropped because their
  /// clients vanished.
  void on_clients_changed(std::function<void(std::span<const Ticket> dropped)> callback) {
    core_.on_clients_changed(std::move(callback));
  }
  [[nodiscard]] const ServiceRequests::Counters& counters() const { return core_.counters(); }
  /// Replies given up because the client's reader never matched.
  [[nodiscard]] std::uint64_t dropped_replies() const { return core_.dropped_replies(); }
  /// Requests that wait for their reply.
  [[nodiscard]] std::size_t pending() const { return core_.pending(); }

  [[nodiscard]] InputStats stats() const { return reader_->stats(); }
  [[nodiscard]] GUID_t reader_guid() const { return reader_->guid(); }
  [[nodiscard]] GUID_t writer_guid() const { return core_.writer_guid(); }

 private:
  static Qos deep(Qos qos) {
    qos.depth = std::max(qos.depth, service_depth);
    return qos;
  }
  void serve(const Request& request, const MessageInfo& info) {
    const auto ticket = core_.begin(info);
    if (!ticket) return;
    try {
      handler_(request, *ticket);
    } catch (...) {
      core_.forget(*ticket);  // the client times out; the executor reports the exception
      throw;
    }
  }

  DeferredHandler handler_;
  ServiceCore core_;
  std::shared_ptr<TypedReader<Request>> reader_;
};

}  // namespace srfs::ros
