// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/starter.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <map>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/cpu_wait.hpp"
#include "base/log.hpp"
#include "suite/added_nodes.hpp"
#include "suite/ring/heartbeat_page.hpp"
#include "suite/ring/membership.hpp"
#include "suite/ring/restarter.hpp"

namespace srfs::suite {
namespace {

constexpr int most_unanswered = 2;

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

/// Heartbeat pages of accused nodes, one per name.
class PagesInDoubt {
 public:
  explicit PagesInDoubt(VarPaths var) : var_(std::move(var)) {}

  /// To be called at each accusation: only what stays the same from one to the next stands still.
  std::optional<StillPage> look(const std::string& node) {
    const auto page = HeartbeatPage::read(var_, node);
    if (!page) {
      seen_.erase(node);
      return std::nullopt;
    }
    const MonotonicTime now = monotonic_now();
    const auto before = seen_.find(node);
    if (before == seen_.end() || before->second.pid != page->pid || before->second.turns != page->turns)
      seen_.insert_or_assign(
          node, Seen{page->pid, page->turns, now, ThreadCpuFiles::open(page->pid, page->pid), {}});
    Seen& s = seen_.at(node);
    if (const auto cpu = s.cpu ? s.cpu->read() : std::nullopt)
      s.wait.on_reading(*cpu, s.cpu->state() == 'R', now);
    return StillPage{s.pid, s.since, now - s.since - s.wait.total()};
  }

 private:
  struct Seen {
    pid_t pid;
    std::uint64_t turns;
    MonotonicTime since;
    std::optional<ThreadCpuFiles> cpu;  ///< of its work thread
    CpuWait wait;
  };
  VarPaths var_;
  std::map<std::string, Seen> seen_;
};

bool has_hung_up(int socket) {
  pollfd entry{socket, POLLRDHUP, 0};
  return poll(&entry, 1, 0) > 0 && (entry.revents & (POLLRDHUP | POLLHUP | POLLERR)) != 0;
}

/// The starter's work, one request after the other.
class Service {
 public:
  /// @param socket  to the node, for whether it is still there
  Service(const std::filesystem::path& deployment, const VarPaths& var, std::string observer, Trust trust,
          int socket)
      : live_(Deployment::load(deployment), var),
        var_(var),
        trust_(trust),
        pages_(var),
        restarter_(live_.first(), var, std::move(observer)) {
    restarter_.set_wanted_source([socket] { return !has_hung_up(socket); });
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
        recovered(text_of(request.subject), request.incarnation,
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
      if (live_.current().find(accusation.subject) == nullptr)
        return {RestartOutcome::What::not_believed, 0, {}, "no node of this deployment"};
      const RingSettings& ring = live_.first().ring;
      auto doubt = doubt_of_foreign(accusation, pages_.look(accusation.subject), ring.misses * ring.period);
      if (!doubt.empty()) return {RestartOutcome::What::not_believed, accusation.pid, {}, std::move(doubt)};
    }
    auto outcome = restarter_.restart(accusation);
    if (outcome.what == RestartOutcome::What::restarted) unrecovered_[accusation.subject] = outcome.pid;
    return outcome;
  }

  /// A foreign node's word counts once for each restart of this starter, and for the process of that restart.
  void recovered(const std::string& subject, std::uint32_t incarnation, MonotonicTime active) {
    const auto restarted = unrecovered_.find(subject);
    if (trust_ == Trust::foreign) {
      if (restarted == unrecovered_.end()) return;
      const auto running = find_instance(var_, subject);
      if (!running || running->pid != restarted->second || running->incarnation != incarnation) return;
      active = std::min(active, monotonic_now());
    }
    if (restarted != unrecovered_.end()) unrecovered_.erase(restarted);
    restarter_.on_recovered(subject, incarnation, active);
  }

  LiveDeployment live_;
  const VarPaths var_;
  const Trust trust_;
  PagesInDoubt pages_;
  std::map<std::string, pid_t> unrecovered_;  ///< by node
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

bool StarterClient::is_gone() const {
  pollfd entry{socket_.get(), POLLRDHUP, 0};
  return poll(&entry, 1, 0) == 1 && (entry.revents & (POLLRDHUP | POLLHUP | POLLERR)) != 0;
}

Result<RestartOutcome, std::string> StarterClient::restart(const Accusation& accusation) {
  const Request request = request_of(accusation, ++number_);
  const auto gone = [](int error) { return Err("the node's starter is gone: " + errno_text(error)); };
  // No room: it has taken nothing for long.
  if (send(socket_.get(), &request, sizeof request, MSG_NOSIGNAL | MSG_DONTWAIT) !=
      static_cast<ssize_t>(sizeof request))
    return gone(errno);
  const MonotonicTime give_up = monotonic_now() + patience_;
  while (true) {
    const auto left = std::chrono::ceil<milliseconds>(give_up - monotonic_now());
    pollfd entry{socket_.get(), POLLIN, 0};
    const int ready = poll(&entry, 1, static_cast<int>(std::max(left, milliseconds(0)).count()));
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) {
      if (++unanswered_ >= most_unanswered) return gone(ETIMEDOUT);
      return RestartOutcome{RestartOutcome::What::under_way, 0, {}, "its starter does not answer"};
    }
    Answer answer{};
    const ssize_t octets = recv(socket_.get(), &answer, sizeof answer, 0);
    if (octets != 1 && octets != static_cast<ssize_t>(sizeof answer)) return gone(octets < 0 ? errno : EPIPE);
    unanswered_ = 0;
    if (octets == 1)  // of srfs-starter
      return RestartOutcome{
          RestartOutcome::What::cannot_start, 0, {}, "its starter has failed; the node's log says why"};
    has_answered_ = true;
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

std::string doubt_of_foreign(Accusation& accusation, const std::optional<StillPage>& page,
                             nanoseconds bound) {
  switch (accusation.fault) {
    case FaultClass::absent:
    case FaultClass::exited:  // the restarter looks for the process
      return "";
    case FaultClass::silent:
      if (!page || page->pid != accusation.pid)
        return "an uplinked program's word alone: no heartbeat page of that process";
      if (page->lasted < bound)
        return fmt::format("its heartbeat page was not seen standing still for {} ms yet",
                           bound / milliseconds(1));
      accusation.decided = std::min(accusation.decided, page->since);
      return "";
    default:
      return "an uplinked program's word alone: only what is dead or stands still is restarted for it";
  }
}

int serve_starter(Fd socket, const std::filesystem::path& deployment, const VarPaths& var,
                  const std::string& observer, Trust trust) {
  Service service(deployment, var, observer, trust, socket.get());
  while (true) {
    pollfd entry{socket.get(), POLLIN | POLLRDHUP, 0};
    if (poll(&entry, 1, -1) < 0 && errno == EINTR) continue;
    if (has_hung_up(socket.get())) return 0;  // the node has ended: its last requests may be void
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
