// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/starter.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/log.hpp"
#include "suite/added_nodes.hpp"
#include "suite/ring/membership.hpp"
#include "suite/ring/restarter.hpp"

namespace srfs::suite {
namespace {

constexpr milliseconds longest_restart{5000};

enum class Kind : std::uint8_t { restart = 1, recovered = 2, commit = 3 };

/// Texts of the two messages are cut to what fits and end with a NUL.
struct Request {
  std::uint32_t number;
  Kind kind;
  FaultClass fault;
  std::int32_t pid;
  std::uint32_t incarnation;
  std::uint32_t generation;
  std::uint32_t misses;
  std::uint32_t version;
  std::int64_t first_evidence_ns;
  std::int64_t decided_ns;  ///< of recovered: when it was Active
  std::array<char, 64> subject;
  std::array<char, 256> detail;
};

struct Answer {
  std::uint32_t number;
  RestartOutcome::What what;
  bool has_not_before, has_version, has_fallback;
  std::int32_t pid;
  std::int64_t not_before_ns;
  std::uint32_t version, from, to;
  std::array<char, 512> reason;
  std::array<char, 512> why;
};

template <std::size_t N>
void put(std::array<char, N>& field, const std::string& text) {
  const std::size_t length = std::min(text.size(), N - 1);
  std::memcpy(field.data(), text.data(), length);
}

template <std::size_t N>
std::string text_of(const std::array<char, N>& field) {
  return {field.data(), strnlen(field.data(), N)};
}

Request request_of(const Accusation& a, std::uint32_t number) {
  Request r{};
  r.number = number;
  r.kind = Kind::restart;
  r.fault = a.fault;
  r.pid = a.pid;
  r.incarnation = a.incarnation;
  r.generation = a.generation;
  r.misses = a.misses;
  r.first_evidence_ns = a.first_evidence.ns();
  r.decided_ns = a.decided.ns();
  put(r.subject, a.subject);
  put(r.detail, a.detail);
  return r;
}

Accusation accusation_of(const Request& r) {
  Accusation a;
  a.subject = text_of(r.subject);
  a.fault = r.fault;
  a.pid = r.pid;
  a.incarnation = r.incarnation;
  a.generation = r.generation;
  a.misses = r.misses;
  a.first_evidence = MonotonicTime(nanoseconds(r.first_evidence_ns));
  a.decided = MonotonicTime(nanoseconds(r.decided_ns));
  a.detail = text_of(r.detail);
  return a;
}

Answer answer_of(const RestartOutcome& outcome, std::uint32_t number) {
  Answer a{};
  a.number = number;
  a.what = outcome.what;
  a.pid = outcome.pid;
  if ((a.has_not_before = outcome.not_before.has_value())) a.not_before_ns = outcome.not_before->ns();
  if ((a.has_version = outcome.version.has_value())) a.version = *outcome.version;
  if ((a.has_fallback = outcome.fallback.has_value())) {
    a.from = outcome.fallback->from;
    a.to = outcome.fallback->to;
    put(a.why, outcome.fallback->why);
  }
  put(a.reason, outcome.reason);
  return a;
}

RestartOutcome outcome_of(const Answer& a) {
  RestartOutcome outcome{a.what, a.pid, {}, text_of(a.reason)};
  if (a.has_not_before) outcome.not_before = MonotonicTime(nanoseconds(a.not_before_ns));
  if (a.has_version) outcome.version = a.version;
  if (a.has_fallback) outcome.fallback = VersionFallback{a.from, a.to, text_of(a.why)};
  return outcome;
}

/// The starter's work, one request after the other.
class Service {
 public:
  Service(const std::filesystem::path& deployment, const VarPaths& var, std::string observer, Trust trust)
      : live_(Deployment::load(deployment), var),
        var_(var),
        trust_(trust),
        restarter_(live_.first(), var, std::move(observer)) {
    restarter_.set_generation_source(
        [this] { return read_membership(var_, live_.current()).membership.generation; });
    restarter_.set_deployment_source([this]() -> const Deployment& { return live_.current(); });
  }

  /// @return nullopt: it has no answer
  std::optional<Answer> serve(const Request& request) {
    (void)live_.refresh();
    switch (request.kind) {
      case Kind::restart:
        return answer_of(restart(accusation_of(request)), request.number);
      case Kind::recovered:
        restarter_.on_recovered(text_of(request.subject), request.incarnation,
                                MonotonicTime(nanoseconds(request.decided_ns)));
        return std::nullopt;
      case Kind::commit:
        // A version is not kept on the word of code that was uplinked itself: other observers see it, too.
        if (trust_ != Trust::foreign) restarter_.commit(text_of(request.subject), request.version);
        return std::nullopt;
    }
    return std::nullopt;
  }

 private:
  RestartOutcome restart(Accusation accusation) {
    if (trust_ == Trust::foreign) {
      auto doubt = doubt_of_foreign(accusation, live_.first().ring.period, monotonic_now());
      if (!doubt.empty()) return {RestartOutcome::What::not_believed, accusation.pid, {}, std::move(doubt)};
    }
    return restarter_.restart(accusation);
  }

  LiveDeployment live_;
  const VarPaths var_;
  const Trust trust_;
  Restarter restarter_;
};

}  // namespace

std::optional<StarterClient> StarterClient::of_this_process() {
  const char* told = std::getenv(starter_variable);
  if (told == nullptr || std::atoi(told) != starter_fd || fcntl(starter_fd, F_SETFD, FD_CLOEXEC) != 0)
    return std::nullopt;
  unsetenv(starter_variable);
  return StarterClient(Fd(starter_fd));
}

Result<RestartOutcome, std::string> StarterClient::restart(const Accusation& accusation) {
  const Request request = request_of(accusation, ++number_);
  const auto gone = [](int error) { return Err("the node's starter is gone: " + errno_text(error)); };
  if (send(socket_.get(), &request, sizeof request, MSG_NOSIGNAL) != static_cast<ssize_t>(sizeof request))
    return gone(errno);
  const MonotonicTime give_up = monotonic_now() + longest_restart;
  while (true) {
    const auto left = std::chrono::ceil<milliseconds>(give_up - monotonic_now());
    pollfd entry{socket_.get(), POLLIN, 0};
    const int ready = poll(&entry, 1, static_cast<int>(std::max(left, milliseconds(0)).count()));
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0)
      return RestartOutcome{RestartOutcome::What::under_way, 0, {}, "its starter does not answer"};
    Answer answer{};
    const ssize_t octets = recv(socket_.get(), &answer, sizeof answer, 0);
    if (octets != static_cast<ssize_t>(sizeof answer)) return gone(octets < 0 ? errno : EPIPE);
    if (answer.number == request.number) return outcome_of(answer);  // else one that came too late
  }
}

void StarterClient::recovered(const std::string& subject, std::uint32_t incarnation, MonotonicTime active) {
  Request r{};
  r.kind = Kind::recovered;
  r.incarnation = incarnation;
  r.decided_ns = active.ns();
  put(r.subject, subject);
  (void)send(socket_.get(), &r, sizeof r, MSG_NOSIGNAL | MSG_DONTWAIT);
}

void StarterClient::commit(const std::string& subject, std::uint32_t version) {
  Request r{};
  r.kind = Kind::commit;
  r.version = version;
  put(r.subject, subject);
  (void)send(socket_.get(), &r, sizeof r, MSG_NOSIGNAL | MSG_DONTWAIT);
}

std::string doubt_of_foreign(Accusation& accusation, nanoseconds period, MonotonicTime now) {
  switch (accusation.fault) {
    case FaultClass::absent:
    case FaultClass::exited:  // the restarter looks for the process
      return "";
    case FaultClass::silent:
      accusation.decided = std::min(accusation.decided, now - 2 * period);
      return "";
    default:
      return "an uplinked program's word alone: only what is dead or stands still is restarted for it";
  }
}

int serve_starter(Fd socket, const std::filesystem::path& deployment, const VarPaths& var,
                  const std::string& observer, Trust trust) {
  Service service(deployment, var, observer, trust);
  while (true) {
    Request request{};
    const ssize_t octets = recv(socket.get(), &request, sizeof request, 0);
    if (octets < 0 && errno == EINTR) continue;
    if (octets <= 0) return 0;  // the node has ended
    const bool whole = octets == static_cast<ssize_t>(sizeof request);
    if (!whole || request.fault > FaultClass::cpu_hog) continue;
    const auto answer = service.serve(request);
    if (answer) (void)send(socket.get(), &*answer, sizeof *answer, MSG_NOSIGNAL | MSG_DONTWAIT);
  }
}

}  // namespace srfs::suite
