// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>

#include "base/result.hpp"
#include "ros/endpoint.hpp"
#include "ros/service_requests.hpp"

namespace srfs::ros {

enum class CallError : std::uint8_t {
  no_server,  ///< no server of this name within the deadline
  timeout,    ///< every attempt went unanswered
  refused,    ///< the request breaks a bound of its type, or too many calls are waiting
};
[[nodiscard]] const char* to_text(CallError error);

/// Bookkeeping of a client's calls, without types: attempts, deadlines, which reply belongs to which call.
class CallTable {
 public:
  /// Sends one attempt; a repeat gets the sequence number of the first one.
  /// @return its own sequence number, nullopt when it could not be written
  using Attempt = std::function<std::optional<std::int64_t>(std::optional<std::int64_t> first)>;
  using Failed = std::function<void(std::uint64_t call, CallError)>;

  CallTable(Executor& executor, std::function<bool()> server_ready, Failed failed);

  /// Makes a call that begin() sends.
  /// @param deadline for each attempt, from its sending (or from now while no server is matched)
  /// @return id of the call, or nullopt when 64 calls are waiting already
  [[nodiscard]] std::optional<std::uint64_t> add(Attempt attempt, nanoseconds deadline, int attempts);
  void begin(std::uint64_t call);
  /// The reply to one attempt came. @return the call it ends; nullopt for an unknown or ended one
  [[nodiscard]] std::optional<std::uint64_t> finish(std::int64_t sequence);
  /// Ends a call without a callback; unknown ones are ignored.
  void forget(std::uint64_t call) { calls_.erase(call); }
  /// Ends all calls without a callback.
  void clear() { calls_.clear(); }
  /// Sends what waited for a server. Work thread.
  void server_changed();
  [[nodiscard]] std::size_t waiting() const { return calls_.size(); }

 private:
  struct Call {
    Attempt attempt;
    nanoseconds deadline;
    int attempts_left;
    std::vector<std::int64_t> sequences;  // of every attempt: a late reply to an earlier one counts
    bool sent = false;
    Timer timer;
  };
  void send(std::uint64_t id, Call& call);
  void on_deadline(std::uint64_t id);
  void fail(std::uint64_t id, CallError error);

  Executor& executor_;
  std::function<bool()> server_ready_;
  Failed failed_;
  std::map<std::uint64_t, Call> calls_;
  std::uint64_t next_id_ = 1;
};

/// Names a call at its client.
enum class CallId : std::uint64_t {};

/// Calls one service of type S. Calls never block; the callback runs on the work thread exactly once per
/// call, unless the call is forgotten or the client dropped before.
///
/// A repeat is a new sample that names its first attempt (ServiceRequests): our services execute such a
/// request once and answer every attempt alike, as long as they live. A service of ROS 2 does not look and
/// executes each attempt, so give it more than one only for what may be done twice.
template <class S>
class Client {
 public:
  using Request = typename S::Request;
  using Response = typename S::Response;
  using Outcome = Result<Response, CallError>;
  /// @param server the reply's writer; unknown GUID without a reply
  using Callback = std::function<void(Outcome, const GUID_t& server)>;

  Client(Executor& executor, Participant& participant, const std::string& name, const Qos& qos,
         Priority priority)
      : reader_(TypedReader<Response>::create(
            executor, participant, reply_dds_name(name), qos, priority,
            [this](const Response& r, const MessageInfo& info) { on_reply(r, info); })),
        writer_(std::make_shared<WriterEndpoint>(participant, request_dds_name(name),
                                                 dds::TypeSupport(new TypeSupport<Request>), qos)),
        table_(std::make_shared<CallTable>(
            executor, [this] { return is_ready() && (!condition_ || condition_()); },
            [this](std::uint64_t id, CallError error) { end(id, Err(error), GUID_t::unknown()); })) {
    const auto wake = [this, &executor, table = std::weak_ptr<CallTable>(table_)] {
      executor.post([this, table] {
        const auto alive = table.lock();
        if (!alive) return;
        alive->server_changed();
        const bool dropped_by_a_callback = alive.use_count() == 1;
        if (!dropped_by_a_callback && server_changed_) server_changed_();
      });
    };
    writer_->on_match_change(wake);
    reader_->on_match_change(wake);
  }

  ~Client() {
    reader_->close();
    table_->clear();  // a loop over it, whose callback drops this client, ends
    // Captured callbacks of other threads hold the table only weakly.
  }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  /// @param deadline for one attempt, from its sending, or from now while there is no server
  /// @param attempts at least 1; a late reply to an earlier attempt counts
  /// @param callback called with (Outcome) or (Outcome, const GUID_t& server)
  /// @return its id; when 64 calls wait already the callback is called at once with CallError::refused
  template <class F>
  CallId call(const Request& request, nanoseconds deadline, int attempts, F callback) {
    Callback kept_callback;
    if constexpr (std::is_invocable_v<F, Outcome, const GUID_t&>) {
      kept_callback = std::move(callback);
    } else {
      kept_callback = [f = std::move(callback)](Outcome outcome, const GUID_t&) mutable {
        f(std::move(outcome));
      };
    }
    auto kept = std::make_shared<Request>(request);
    const auto attempt = [this, kept](std::optional<std::int64_t> first) -> std::optional<std::int64_t> {
      WriteParams params;
      SampleIdentity& related = params.related_sample_identity();
      related.writer_guid(reader_->guid());
      if (first) related.sequence_number(sequence_number(*first));
      if (!writer_->write(kept.get(), &params)) return std::nullopt;
      return params.sample_identity().sequence_number().to64long();
    };
    const auto id = table_->add(attempt, deadline, attempts);
    if (!id) {
      kept_callback(Err(CallError::refused), GUID_t::unknown());
      return CallId{0};
    }
    callbacks_[*id] = std::move(kept_callback);
    table_->begin(*id);
    return static_cast<CallId>(*id);
  }
  /// Ends a call; its callback is dropped. Unknown and ended ones are ignored.
  void forget(CallId call) {
    table_->forget(static_cast<std::uint64_t>(call));
    callbacks_.erase(static_cast<std::uint64_t>(call));
  }

  /// A server is matched in both directions. Matched is not alive.
  [[nodiscard]] bool is_ready() const { return writer_->matched_count() > 0 && reader_->matched_count() > 0; }
  /// The process of this server still takes our requests, as far as discovery knows.
  [[nodiscard]] bool is_served_by(const GUID_t& server) const {
    return writer_->matched_in_participant_of(server);
  }
  /// Calls wait for this too before they are sent; server_changed() asks again.
  void set_condition(std::function<bool()> condition) { condition_ = std::move(condition); }
  void server_changed() { table_->server_changed(); }
  /// Called on the work thread when a server may have come or gone.
  void on_server_change(std::function<void()> callback) { server_changed_ = std::move(callback); }
  /// Calls without an outcome yet.
  [[nodiscard]] std::size_t waiting() const { return table_->waiting(); }
  [[nodiscard]] GUID_t reader_guid() const { return reader_->guid(); }
  [[nodiscard]] GUID_t writer_guid() const { return writer_->guid(); }

 private:
  void on_reply(const Response& response, const MessageInfo& info) {
    const GUID_t& to = info.related.writer_guid();
    if (to != reader_->guid() && to != writer_->guid()) return;  // another client's
    if (const auto id = table_->finish(info.related.sequence_number().to64long()))
      end(*id, response, info.identity.writer_guid());
  }
  void end(std::uint64_t id, Outcome outcome, const GUID_t& server) {
    const auto found = callbacks_.find(id);
    if (found == callbacks_.end()) return;
    const Callback callback = std::move(found->second);
    callbacks_.erase(found);  // before calling: the callback may call again
    callback(std::move(outcome), server);
  }

  std::function<bool()> condition_;
  std::function<void()> server_changed_;
  std::shared_ptr<TypedReader<Response>> reader_;
  std::shared_ptr<WriterEndpoint> writer_;
  std::shared_ptr<CallTable> table_;
  std::map<std::uint64_t, Callback> callbacks_;
};

}  // namespace srfs::ros
