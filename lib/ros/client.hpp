#pragma once

#include <map>

#include "base/result.hpp"
#include "ros/endpoint.hpp"

namespace srfs::ros {

enum class CallError : std::uint8_t {
  no_server,  ///< nobody serves this name within the deadline
  timeout,    ///< every attempt went unanswered
  refused,    ///< the request breaks a bound of its type, or too many calls are waiting
};
[[nodiscard]] const char* to_text(CallError error);

/// Bookkeeping of a client's calls, without types: attempts, deadlines, which reply belongs to which call.
class CallTable {
 public:
  /// Sends one attempt. @return its sequence number, nullopt when it could not be written
  using Attempt = std::function<std::optional<std::int64_t>()>;
  using Failed = std::function<void(std::uint64_t call, CallError)>;

  CallTable(Executor& executor, std::function<bool()> server_ready, Failed failed);

  /// Makes a call that begin() sends.
  /// @param deadline for each attempt, from its sending (or from now while no server is matched)
  /// @return id of the call, or nullopt when 64 calls are waiting already
  [[nodiscard]] std::optional<std::uint64_t> add(Attempt attempt, nanoseconds deadline, int attempts);
  void begin(std::uint64_t call);
  /// The reply to one attempt came. @return the call it ends; nullopt for an unknown or ended one
  [[nodiscard]] std::optional<std::uint64_t> finish(std::int64_t sequence);
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

/// Calls one service of type S. Calls never block; the callback runs on the work thread exactly once per
/// call, unless the client is dropped before.
template <class S>
class Client {
 public:
  using Request = typename S::Request;
  using Response = typename S::Response;
  using Callback = std::function<void(Result<Response, CallError>)>;

  Client(Executor& executor, Participant& participant, const std::string& name, const Qos& qos,
         Priority priority)
      : reader_(TypedReader<Response>::create(
            executor, participant, reply_dds_name(name), qos, priority,
            [this](const Response& r, const MessageInfo& info) { on_reply(r, info); })),
        writer_(std::make_shared<WriterEndpoint>(participant, request_dds_name(name),
                                                 dds::TypeSupport(new TypeSupport<Request>), qos)),
        table_(std::make_shared<CallTable>(
            executor, [this] { return is_ready(); },
            [this](std::uint64_t id, CallError error) { end(id, Err(error)); })) {
    const auto wake = [&executor, table = std::weak_ptr<CallTable>(table_)] {
      executor.post([table] {
        if (const auto alive = table.lock()) alive->server_changed();
      });
    };
    writer_->on_match_change(wake);
    reader_->on_match_change(wake);
  }

  ~Client() {
    reader_->close();
    // Captured callbacks of other threads hold the table only weakly.
  }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  /// @param deadline for one attempt; @param attempts at least 1. A request that may be sent twice must be
  /// idempotent.
  void call(const Request& request, nanoseconds deadline, int attempts, Callback callback) {
    auto kept = std::make_shared<Request>(request);
    const auto attempt = [this, kept]() -> std::optional<std::int64_t> {
      WriteParams params;
      params.related_sample_identity().writer_guid(reader_->guid());
      if (!writer_->write(kept.get(), &params)) return std::nullopt;
      return params.sample_identity().sequence_number().to64long();
    };
    const auto id = table_->add(attempt, deadline, attempts);
    if (!id) {
      callback(Err(CallError::refused));
      return;
    }
    callbacks_[*id] = std::move(callback);
    table_->begin(*id);
  }

  /// A server is matched in both directions. Matched is not alive.
  [[nodiscard]] bool is_ready() const { return writer_->matched_count() > 0 && reader_->matched_count() > 0; }
  [[nodiscard]] GUID_t reader_guid() const { return reader_->guid(); }
  [[nodiscard]] GUID_t writer_guid() const { return writer_->guid(); }

 private:
  void on_reply(const Response& response, const MessageInfo& info) {
    const GUID_t& to = info.related.writer_guid();
    if (to != reader_->guid() && to != writer_->guid()) return;  // another client's
    if (const auto id = table_->finish(info.related.sequence_number().to64long())) end(*id, response);
  }
  void end(std::uint64_t id, Result<Response, CallError> outcome) {
    const auto found = callbacks_.find(id);
    if (found == callbacks_.end()) return;
    const Callback callback = std::move(found->second);
    callbacks_.erase(found);  // before calling: the callback may call again
    callback(std::move(outcome));
  }

  std::shared_ptr<TypedReader<Response>> reader_;
  std::shared_ptr<WriterEndpoint> writer_;
  std::shared_ptr<CallTable> table_;
  std::map<std::uint64_t, Callback> callbacks_;
};

}  // namespace srfs::ros
