// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/ring/liveness_ring.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>

#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <sys/epoll.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <mission/structures.hpp>

#include "base/saturate.hpp"
#include "suite/node_versions.hpp"
#include "suite/ring/heartbeat_page.hpp"
#include "suite/ring/node_record.hpp"

namespace srfs::suite {
namespace {

constexpr ros::Qos check_qos{.depth = 8};
constexpr seconds client_memory{60};  ///< an unused client is kept: its node may fall silent again
constexpr std::size_t longest_detail = 128;
constexpr std::size_t longest_event_detail = 80;
/// Of a restart, which blocks for up to 3.8 s: 0.65 s for the end of the old process, 2 s for an exec beside
/// other programs, 1 s for the instance lock. A node that makes one is not to be killed.
constexpr milliseconds longest_restart{5000};
constexpr milliseconds between_worker_trials{500};
/// Of the caps; a node at its cap fails in ways of its own.
constexpr std::uint64_t cap_percent = 90;
constexpr seconds between_commits{5};
constexpr seconds shortest_survey{1};  ///< the kernel counts the time of processes in 10 ms

std::uint64_t random_seed() {
  std::uint64_t seed = 0;
  if (getrandom(&seed, sizeof seed, GRND_NONBLOCK) != sizeof seed)
    seed = static_cast<std::uint64_t>(monotonic_now().ns()) * 6364136223846793005U +
           static_cast<std::uint64_t>(getpid());
  return seed;
}

/// The first part of a file; empty when there is none.
std::string_view read_begin(const char* path, std::array<char, 4096>& buffer) {
  const Fd fd(open(path, O_RDONLY | O_CLOEXEC));
  const ssize_t n = fd ? read(fd.get(), buffer.data(), buffer.size()) : 0;
  return {buffer.data(), n > 0 ? static_cast<std::size_t>(n) : 0};
}

/// The same, of a file of /proc/PID.
std::string_view read_proc(pid_t pid, const char* file, std::array<char, 4096>& buffer) {
  std::array<char, 64> path{};
  fmt::format_to_n(path.data(), path.size() - 1, "/proc/{}/{}", pid, file);
  return read_begin(path.data(), buffer);
}

/// The first number behind @p key; 0: none (also "unlimited").
std::uint64_t number_after(std::string_view text, std::string_view key) {
  const auto at = text.find(key);
  if (at == std::string_view::npos) return 0;
  text.remove_prefix(at + key.size());
  text.remove_prefix(std::min(text.find_first_not_of(" \t"), text.size()));
  std::uint64_t value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

/// A node with a real-time priority is bounded by the kernel (RLIMIT_RTTIME), and a niced one gives way.
bool may_be_culprit(const NodeEntry& entry) {
  const Scheduling& s = entry.scheduling;
  return s.policy == SchedulingPolicy::other && s.nice <= 0 && !s.background;
}

/// CPUs that a process may run on; a control group's quota is ignored.
std::size_t usable_cpus(pid_t pid) {
  cpu_set_t cpus;
  if (sched_getaffinity(pid, sizeof cpus, &cpus) == 0) return static_cast<std::size_t>(CPU_COUNT(&cpus));
  return static_cast<std::size_t>(std::max(sysconf(_SC_NPROCESSORS_ONLN), 1L));
}

/// @param told  by the process itself: its descriptors
Footprint read_footprint(pid_t pid, const NodeEntry* entry, std::optional<ProcessCpu>& cpu,
                         std::uint64_t told) {
  std::array<char, 4096> buffer{};
  Footprint footprint;
  if (cpu && entry != nullptr && entry->scheduling.policy != SchedulingPolicy::fifo) {
    footprint.busy_threads = cpu->count_busy_threads(monotonic_now());
    footprint.busy_threads_cap = std::max<std::size_t>(usable_cpus(pid), 2);
  }
  if (entry != nullptr && entry->memory_limit_mib > 0) {
    const auto status = read_proc(pid, "status", buffer);
    footprint.memory_octets = number_after(status, "VmData:") * 1024;  // what RLIMIT_DATA counts
    footprint.memory_cap_octets =
        (static_cast<std::uint64_t>(entry->memory_limit_mib) << 20U) / 100 * cap_percent;
  }
  footprint.descriptors = std::max(count_descriptors(pid), told);
  footprint.descriptor_cap =
      number_after(read_proc(pid, "limits", buffer), "Max open files") * cap_percent / 100;
  return footprint;
}

}  // namespace

/// Asks one node. Holds no calls: an answer is known by its nonce, a missing one by the next round.
class LivenessRing::CheckClient {
 public:
  using Handler = std::function<void(const CheckAlive::Response&)>;
  CheckClient(LivenessRing& ring, ros::Participant& participant, const std::string& node, Handler handler)
      : reader_(ros::TypedReader<CheckAlive::Response>::create(
            ring.executor_, participant, ros::reply_dds_name(check_alive_name(node)), check_qos,
            ros::Priority::liveness,
            [this, &ring, &participant, f = std::move(handler)](const auto& response,
                                                                const ros::MessageInfo& info) {
              if (info.related.writer_guid() != reader_->guid()) return;  // another observer's
              ros::GuidPrefix prefix{};
              std::memcpy(prefix.data(), info.identity.writer_guid().guidPrefix.value, prefix.size());
              if (participant.known_participants().is_foreign(prefix)) {
                ++ring.foreign_answers_;
                return;
              }
              f(response);
            })),
        writer_(participant, ros::request_dds_name(check_alive_name(node)),
                ros::dds::TypeSupport(new ros::TypeSupport<CheckAlive::Request>), check_qos) {}
  ~CheckClient() { reader_->close(); }
  CheckClient(const CheckClient&) = delete;
  CheckClient& operator=(const CheckClient&) = delete;

  void ask(const CheckAlive::Request& request) {
    ros::WriteParams params;
    params.related_sample_identity().writer_guid(reader_->guid());
    writer_.write(&request, &params);
  }
  /// Handles what has come in.
  void take_waiting() {
    const auto reader = reader_;
    while (reader->dispatch_one(monotonic_now())) {
    }
  }

 private:
  std::shared_ptr<ros::TypedReader<CheckAlive::Response>> reader_;
  ros::WriterEndpoint writer_;
};

LivenessRing::LivenessRing(Node& node, Hooks hooks)
    : node_(node), executor_(node.executor()), settings_(node.deployment().ring), hooks_(std::move(hooks)) {
  auto reading = read_membership(node.var(), node.deployment());
  for (const std::string& problem : reading.problems) log::warn("ring: {}", problem);
  membership_problems_ = std::move(reading.problems);
  reports_ = node.create_publisher(topics::liveness);
  report_.observer = node.name();
  report_.observer_incarnation = node.incarnation();
  worker_ = std::make_unique<ros::Worker>(executor_, "ring", Membership::most_members + 1,
                                          std::max(node.worker_deadline(), longest_restart));
  const RingPatience patience{settings_.period, settings_.misses, settings_.start_deadline,
                              settings_.work_deadline, settings_.absence_counts_misses};
  own_cpu_ = ProcessCpu::open(getpid());
  read_stolen_time();
  const MonotonicTime now = monotonic_now();
  monitor_ = std::make_unique<RingMonitor>(
      node.name(), patience, std::move(reading.membership),
      [this](std::string_view subject) { return look(subject); }, random_seed(), now,
      [this](std::string_view subject, pid_t pid, bool doubt) { return look_at_cpu(subject, pid, doubt); });
  if (monitor_->membership().members.size() > 1) {
    // The two clients that are surely needed; discovery takes its time.
    self_ = std::make_unique<CheckClient>(*this, node.participant(), node.name(),
                                          [this](const auto& response) { on_self_answer(response); });
    for (const std::string_view subject : monitor_->watched()) (void)client_of(std::string(subject));
  }
  node.check_alive().set_member(this);
  due_ = now + settings_.period;
  next_second_ = now + seconds(1);
  timer_ = executor_.add_timer(
      due_, settings_.period, [this] { on_period(); }, "liveness ring");
  act();
}

LivenessRing::~LivenessRing() {
  timer_.reset();
  node_.check_alive().set_member(nullptr);
  worker_.reset();
}

// ---- What the node's answers say of the ring

void LivenessRing::on_asked(const std::string& observer, std::uint32_t generation) {
  monitor_->on_asked(observer, generation, executor_.now());
  act();
}

std::uint32_t LivenessRing::generation() const {
  return monitor_->membership().generation;
}

nanoseconds LivenessRing::last_check_age() const {
  return monitor_->last_check_age(executor_.now());
}

nanoseconds LivenessRing::held_up_since(MonotonicTime since) const {
  return std::max(monitor_->held_up_since(since), own_history_.since(since).waited);
}

nanoseconds LivenessRing::stopped_since(MonotonicTime since) const {
  return monitor_->stopped_since(since) + stolen_history_.since(since).waited;
}

// ---- Input

void LivenessRing::on_period() {
  // The executor's own grid: periods that were missed are skipped.
  const MonotonicTime now = executor_.now();
  const nanoseconds late = now - due_;
  due_ += settings_.period * (late / settings_.period + 1);
  if (late > settings_.period) read_stolen_time();  // or it would count as stopped first, and as stolen later
  monitor_->on_period(now, late, waited_since_last_period(now));
  act();
  if (now >= next_worker_trial_) {
    next_worker_trial_ = now + between_worker_trials;
    try_worker();
  }
  if (now >= next_second_) {
    next_second_ = now + seconds(1);
    each_second();
  }
}

/// A restarter that hangs is found before it is needed.
void LivenessRing::try_worker() {
  if (!std::exchange(worker_tried_, true))
    worker_tried_ = worker_->post([] {}, [this] { worker_tried_ = false; }, node_.worker_deadline());
}

void LivenessRing::each_second() {
  read_stolen_time();
  review_membership();
  review_footprints();
  review_versions();
  drop_unused_clients();
}

void LivenessRing::on_answer(const std::string& subject, const CheckAlive::Response& r) {
  CheckAnswer answer;
  answer.nonce = r.nonce;
  answer.incarnation = r.incarnation;
  answer.state = static_cast<ros::State>(r.lifecycle_state);
  answer.desired = static_cast<ros::State>(r.desired_state);
  answer.generation = r.ring_generation;
  answer.work_done = r.work_done;
  answer.oldest_due = milliseconds(r.oldest_due_ms);
  answer.worker = r.worker;
  answer.worker_busy = milliseconds(r.worker_busy_ms);
  answer.worker_deadline = milliseconds(r.worker_deadline_ms);
  answer.own_last_check_age = milliseconds(r.own_last_check_age_ms);
  monitor_->on_answer(subject, answer, monotonic_now());
  act();
}

/// Input that came before the answer to our own self-check is handled before it: the socket keeps the order,
/// the readers behind it do not.
void LivenessRing::on_self_answer(const CheckAlive::Response& response) {
  node_.participant().receive_waiting();
  for (auto& [name, peer] : peers_) {
    if (peer.client) peer.client->take_waiting();
  }
  monitor_->on_self_answer(response.nonce, monotonic_now());
  act();
}

NodeReading LivenessRing::look(std::string_view subject) const {
  const std::string name(subject);
  NodeReading reading;
  if (const auto instance = find_instance(node_.var(), name)) {
    reading.pid = instance->pid;
    reading.incarnation = instance->incarnation;
    reading.page = HeartbeatPage::read(node_.var(), name);
  } else {
    reading.starting = find_starting(node_.var(), name).has_value();
  }
  const NodeEntry* entry = node_.deployment().find(name);
  reading.real_time = entry != nullptr && entry->scheduling.policy == SchedulingPolicy::fifo;
  return reading;
}

std::optional<CpuTotals> LivenessRing::look_at_cpu(std::string_view subject, pid_t pid, bool doubt) {
  Peer& peer = peers_[std::string(subject)];
  if (peer.cpu_pid != pid) {
    peer.cpu = ProcessCpu::open(pid);
    peer.cpu_pid = pid;
    peer.loan.reset();
  }
  // A process that put itself behind others, or holds a lock there, gets what it needs for its answer.
  if (!doubt) {
    peer.loan.reset();
  } else {
    if (!peer.loan) peer.loan.emplace(pid);
    peer.loan->lend();
  }
  if (!peer.cpu) return std::nullopt;
  const MonotonicTime now = monotonic_now();
  auto totals = peer.cpu->read(doubt, now);
  if (!totals) return std::nullopt;
  // What this node's own middleware waits for keeps the answers of others from it as well.
  if (doubt && own_cpu_) {
    if (const auto own = own_cpu_->read(true, now)) own_middleware_waited_ = own->any_waited - own->waited;
    read_stolen_time();
  }
  totals->any_waited += own_middleware_waited_;
  // Time that the host of a virtual machine takes cannot be attributed: it may be the subject's.
  totals->waited += stolen_.total();
  totals->any_waited += stolen_.total();
  return totals;
}

nanoseconds LivenessRing::waited_since_last_period(MonotonicTime now) {
  const auto own = own_cpu_ ? own_cpu_->read(false, now) : std::nullopt;
  if (!own) return nanoseconds(0);
  stolen_history_.add(now, {.waited = stolen_.total()});
  const nanoseconds total = own->waited + stolen_.total();
  own_history_.add(now, {total, own->ran, own->any_waited});
  return total - std::exchange(own_waited_, total);
}

void LivenessRing::read_stolen_time() {
  std::array<char, 4096> buffer{};
  (void)stolen_.on_reading(read_begin("/proc/stat", buffer));
}

LivenessRing::CheckClient& LivenessRing::client_of(const std::string& subject) {
  Peer& peer = peers_[subject];
  if (!peer.client) {
    peer.client = std::make_unique<CheckClient>(
        *this, node_.participant(), subject,
        [this, subject](const auto& response) { on_answer(subject, response); });
  }
  peer.client_used = executor_.now();
  return *peer.client;
}

// ---- Actions

/// In order, also when carrying one out gives the monitor something new.
void LivenessRing::act() {
  if (acting_) return;
  acting_ = true;
  while (auto action = monitor_->next_action()) {
    std::visit([this](auto& a) { carry_out(a); }, *action);
  }
  acting_ = false;
}

LivenessRing::CheckAlive::Request LivenessRing::request(std::uint64_t nonce) const {
  CheckAlive::Request request;
  request.nonce = nonce;
  request.observer = node_.name();
  request.ring_generation = monitor_->membership().generation;
  return request;
}

void LivenessRing::carry_out(const RingMonitor::Ask& action) {
  client_of(std::string(action.subject)).ask(request(action.nonce));
}

void LivenessRing::carry_out(const RingMonitor::AskSelf& action) {
  if (self_) self_->ask(request(action.nonce));
}

void LivenessRing::carry_out(const RingMonitor::Follow& action) {
  const std::string subject(action.subject);
  Peer& peer = peers_[subject];
  peer.exit_watch.reset();
  peer.pid = action.pid;
  peer.pidfd = Fd(static_cast<int>(syscall(SYS_pidfd_open, action.pid, 0)));  // close-on-exec by itself
  if (!peer.pidfd) {
    if (errno == ESRCH) monitor_->on_exit(subject, action.pid, monotonic_now());
    return;  // without descriptors left, its silence shows it
  }
  peer.exit_watch = executor_.add_fd(
      peer.pidfd.get(), EPOLLIN,
      [this, subject, pid = action.pid](std::uint32_t) {
        Peer& ended = peers_[subject];
        const auto watch = std::exchange(ended.exit_watch, nullptr);  // level-triggered: once is enough
        monitor_->on_exit(subject, pid, monotonic_now());
        act();
      },
      "exit of a watched process");
}

void LivenessRing::carry_out(const RingMonitor::Unwatch& action) {
  const auto found = peers_.find(action.subject);
  if (found == peers_.end()) return;
  found->second.exit_watch.reset();
  found->second.pidfd.reset();
  found->second.pid = 0;
  found->second.cpu.reset();
  found->second.loan.reset();
  found->second.cpu_pid = 0;
}

void LivenessRing::carry_out(RingMonitor::Accuse& action) {
  Accusation& accusation = action.accusation;
  std::error_code ec;
  if (std::filesystem::exists(node_.var().stopping_flag(), ec)) {
    conclude(accusation.subject, {RestartOutcome::What::stopping, 0, std::nullopt, {}});
    return;
  }
  log::warn("ring: {} is {} after {} misses{}{}", accusation.subject, to_text(accusation.fault),
            accusation.misses, accusation.detail.empty() ? "" : ": ", accusation.detail);
  mission::RingNodeAccusedEvent event;
  event.node = accusation.subject;
  event.fault = static_cast<decltype(event.fault)>(accusation.fault);
  event.misses = static_cast<std::uint8_t>(std::min<std::uint32_t>(accusation.misses, UINT8_MAX));
  event.detail = accusation.detail.substr(0, longest_event_detail);
  node_.raise(event);
  // Dead nodes are restarted before time is spent on killing the others.
  const auto is_gone = [](const Accusation& a) {
    return a.fault == FaultClass::exited || a.fault == FaultClass::absent;
  };
  const auto place =
      is_gone(accusation) ? std::find_if_not(waiting_.begin(), waiting_.end(), is_gone) : waiting_.end();
  waiting_.insert(place, std::move(accusation));
  restart_next();
}

void LivenessRing::restart_next() {
  if (restarting_ || waiting_.empty()) return;
  auto accusation = std::make_shared<const Accusation>(std::move(waiting_.front()));
  waiting_.pop_front();
  restarting_ = worker_->ask(
      [this, accusation]() -> RestartOutcome {
        try {
          return hooks_.restart(*accusation);
        } catch (const std::exception& e) {
          return {RestartOutcome::What::cannot_start, 0, std::nullopt, e.what()};
        }
      },
      [this, accusation](const RestartOutcome& outcome) {
        restarting_ = false;
        conclude(accusation->subject, outcome);
        act();
        restart_next();
      });
}

void LivenessRing::conclude(const std::string& subject, const RestartOutcome& outcome) {
  using What = RestartOutcome::What;
  if (outcome.fallback) {
    mission::RingVersionFailedEvent event;
    event.node = subject;
    event.version = outcome.fallback->from;
    event.started = outcome.fallback->to;
    event.why = outcome.fallback->why.substr(0, longest_event_detail);
    node_.raise(event);
  }
  if (outcome.what != What::stopping) {
    log::info("ring: {}: {}{}{}", subject, to_text(outcome.what), outcome.reason.empty() ? "" : ": ",
              outcome.reason);
  }
  monitor_->on_outcome(subject, outcome, monotonic_now());
}

void LivenessRing::carry_out(const RingMonitor::Report& action) {
  report_.subject = action.subject;
  report_.subject_incarnation = action.incarnation;
  report_.generation = monitor_->membership().generation;
  report_.verdict = static_cast<std::uint8_t>(action.verdict);
  report_.fault_class = static_cast<std::uint8_t>(action.fault);
  report_.outcome = action.outcome ? static_cast<std::uint8_t>(*action.outcome) : std::uint8_t{0};
  report_.lifecycle_state = static_cast<std::uint8_t>(action.state);
  report_.misses = action.misses;
  report_.age_ms = as_ms(action.answer_age);
  report_.round_trip_us = as_us(action.round_trip);
  report_.monotonic_ns = static_cast<std::uint64_t>(monotonic_now().ns());
  report_.detail = std::string_view(action.detail).substr(0, longest_detail);
  reports_->publish(report_);
  if (action.verdict != LivenessVerdict::not_asked) return;
  mission::RingNotAskedEvent event;
  event.node = std::string(action.subject);
  event.age_ms = as_ms(10 * settings_.period);
  node_.raise(event);
}

void LivenessRing::carry_out(const RingMonitor::Recovered& action) {
  mission::RingNodeRestartedEvent event;
  event.node = std::string(action.subject);
  event.fault = static_cast<decltype(event.fault)>(action.fault);
  event.took_ms = as_ms(action.took);
  node_.raise(event);
  log::info("ring: {} is back after {} ms", action.subject, event.took_ms);
  if (hooks_.recovered) hooks_.recovered(event.node, action.incarnation, action.at);
}

/// What takes the CPUs is read on the worker: all processes of the machine, some ms.
void LivenessRing::carry_out(const RingMonitor::Starved& action) {
  auto users = std::make_shared<std::vector<CpuUser>>();
  const auto survey = [this, users] {
    const MonotonicTime now = monotonic_now();
    const bool renew =
        !survey_ || now - survey_->at >= shortest_survey;  // else: one answer for all that starve
    if (renew) {
      CpuSurvey next{now, read_process_table(), {}};
      if (survey_) next.users = largest_cpu_users(survey_->processes, next.processes, now - survey_->at);
      survey_ = std::move(next);
    }
    *users = survey_->users;
  };
  const auto finish = [this, users, node = std::string(action.subject), report = action.report,
                       silent_for = action.silent_for, waited = action.waited] {
    if (!report) return;
    mission::RingNodeStarvedEvent event;
    event.node = node;
    event.waited_ms = as_ms(waited);
    event.silent_ms = as_ms(silent_for);
    event.taken_by = to_text(*users).substr(0, longest_event_detail);
    node_.raise(event);
    log::warn("ring: {} waited {} of {} ms for a CPU and is not restarted for it; CPU time went to {}", node,
              event.waited_ms, event.silent_ms, to_text(*users));
    accuse_culprit(*users);
  };
  if (!worker_->post(survey, finish)) finish();
}

/// A node that takes half of the CPUs it may run on, or more, without a real-time priority and not niced: it
/// is restarted, not the nodes that it starves.
void LivenessRing::accuse_culprit(const std::vector<CpuUser>& users) {
  if (users.empty() || users.front().processes != 1) return;
  const pid_t pid = users.front().largest;
  if (users.front().cpus < static_cast<double>(usable_cpus(pid)) / 2) return;
  for (const NodeEntry& entry : node_.deployment().nodes) {
    if (!may_be_culprit(entry)) continue;
    const auto instance = find_instance(node_.var(), entry.name);
    if (!instance || instance->pid != pid) continue;
    Accusation accusation;
    accusation.subject = entry.name;
    accusation.fault = FaultClass::cpu_hog;
    accusation.pid = pid;
    accusation.incarnation = instance->incarnation;
    accusation.generation = monitor_->membership().generation;
    accusation.first_evidence = accusation.decided = monotonic_now();
    accusation.detail = fmt::format("takes {:.1f} CPUs while others starve", users.front().cpus);
    RingMonitor::Accuse accuse{std::move(accusation)};
    carry_out(accuse);
    return;
  }
}

void LivenessRing::carry_out(const RingMonitor::ReadMembership&) {
  // A node claims another generation. The file decides, read at most each second (each_second), since a
  // claim is cheap.
}

void LivenessRing::carry_out(const RingMonitor::ExitSelf&) {
  log::fatal("ring: this node does not hear its own checks; it ends, and its upstream starts it again");
  hooks_.exit();
}

// ---- Each second

void LivenessRing::review_membership() {
  struct stat status {};
  std::string stamp;
  if (stat(membership_file(node_.var()).c_str(), &status) == 0) {
    stamp = fmt::format("{}.{}.{}.{}", status.st_ino, status.st_mtim.tv_sec, status.st_mtim.tv_nsec,
                        status.st_size);
  }
  if (stamp == membership_stamp_) return;
  membership_stamp_ = stamp;
  auto reading = read_membership(node_.var(), node_.deployment());
  if (reading.problems != membership_problems_) {
    for (const std::string& problem : reading.problems) log::warn("ring: {}", problem);
    membership_problems_ = reading.problems;
  }
  if (reading.membership == monitor_->membership()) return;
  log::info("ring: generation {}, {} members", reading.membership.generation,
            reading.membership.members.size());
  waiting_.clear();  // verdicts of the generation before
  monitor_->on_membership(std::move(reading.membership), monotonic_now());
  if (!self_ && monitor_->membership().members.size() > 1) {
    self_ = std::make_unique<CheckClient>(*this, node_.participant(), node_.name(),
                                          [this](const auto& response) { on_self_answer(response); });
  }
  act();
}

void LivenessRing::on_deployment_changed() {
  membership_stamp_ = "unread";
  review_membership();
}

void LivenessRing::review_footprints() {
  for (const std::string_view subject : monitor_->watched()) {
    const std::string name(subject);
    const pid_t pid = monitor_->process_of(name);
    if (pid == 0) continue;
    const auto page = HeartbeatPage::read(node_.var(), name);
    const std::uint64_t told = page && page->pid == pid ? page->descriptors : 0;
    monitor_->on_footprint(name, pid,
                           read_footprint(pid, node_.deployment().find(name), peers_[name].cpu, told),
                           monotonic_now());
  }
  act();
}

void LivenessRing::review_versions() {
  std::vector<std::string> names;
  for (const std::string_view subject : monitor_->watched()) names.emplace_back(subject);
  for (const std::string& name : names) review_version(name);
  act();
}

/// Checks the probation of the version that a node runs, if there is one.
void LivenessRing::review_version(const std::string& subject) {
  Peer& peer = peers_[subject];
  struct stat status {};
  std::string stamp;
  if (stat(versions_folder(node_.var(), subject).c_str(), &status) == 0)
    stamp = fmt::format("{}.{}.{}", status.st_ino, status.st_mtim.tv_sec, status.st_mtim.tv_nsec);
  if (stamp != peer.versions_stamp) {
    peer.versions_stamp = stamp;
    auto before = std::exchange(peer.table, std::nullopt);
    if (!stamp.empty()) peer.table = read_versions(node_.var(), subject).table;
    const update::Version* was_on_trial = before ? before->on_trial() : nullptr;
    if (was_on_trial != nullptr && peer.table && peer.table->last_good() == was_on_trial->number) {
      mission::RingVersionKeptEvent event;
      event.node = subject;
      event.version = was_on_trial->number;
      node_.raise(event);
    }
  }
  const pid_t pid = monitor_->process_of(subject);
  if (!peer.table || peer.table->on_trial() == nullptr || pid == 0) return;
  const auto started = last_started(node_.var(), subject);
  if (!started || started->pid != pid) return;
  const MonotonicTime now = monotonic_now();
  const auto trial = trial_of(node_.var(), settings_, subject, *peer.table, true, now);
  if (!trial) return;
  monitor_->on_trial(subject, pid, trial->lived, now);
  const bool in_probation = trial->to_confirm || trial->lived < trial->probation;
  if (const auto violation = violation_of(node_.var(), subject, pid); violation && in_probation) {
    monitor_->on_bad_version(subject, pid, FaultClass::limit_violation, *violation, now);
    return;
  }
  if (trial->lived < trial->probation) return;
  if (trial->to_confirm) {
    monitor_->on_bad_version(subject, pid, FaultClass::not_confirmed, "", now);
    return;
  }
  if (!monitor_->is_as_desired(subject)) return;
  if (now < peer.next_commit || !hooks_.commit) return;
  peer.next_commit = now + between_commits;
  hooks_.commit(subject, trial->version);
}

void LivenessRing::drop_unused_clients() {
  for (auto& [name, peer] : peers_) {
    if (peer.client && executor_.now() - peer.client_used > client_memory) peer.client.reset();
  }
}

}  // namespace srfs::suite
