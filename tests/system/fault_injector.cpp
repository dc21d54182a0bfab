// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The fault campaign preloads this library into the nodes (LD_PRELOAD). It injects process faults into
// programs that contain no test code. A real-time signal queued to one thread selects the fault; its handler
// runs on that thread between any two instructions. The commands must match python/srfs/campaign/faults.py.

#include <arpa/inet.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <pthread.h>
#include <sys/epoll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string_view>

#include "ros/datagram_seal.hpp"
#include "ros/executor.hpp"
#include "suite/node.hpp"

namespace {

enum Command : std::uint32_t {
  healthy = 0,      // ends every fault that can be ended
  do_abort = 1,     // SIGABRT
  do_segfault = 2,  // a store to address 8
  loop = 3,         // the thread never returns and uses a whole CPU
  deadlock = 4,     // the thread never returns and waits
  late = 5,         // delays every turn of the work thread by so many ms
  deaf = 6,         // drops all input from the network
  stale_nonce = 7,  // answers to check_alive carry a wrong nonce
  wrong_incarnation = 8,
  wrong_state = 9,
  grow = 10,             // allocates so many MiB per second
  use_descriptors = 11,  // opens descriptors until none are left
  clock_step = 12,       // shifts CLOCK_REALTIME by so many minutes (signed)
  idle = 13,             // handles liveness checks only; other input waits, the node's timers do nothing
  hog = 14,              // starts eight threads that load the CPUs
};

constexpr int signal_number_offset = 7;  // SIGRTMIN + 7

std::atomic<std::uint32_t> wrong_answer{healthy};
std::atomic<bool> is_deaf{false};
std::atomic<bool> is_idle{false};
std::atomic<int> late_ms{0};
std::atomic<std::int64_t> clock_offset_ns{0};
std::atomic<int> growth_mib_s{0};
std::atomic<std::uint64_t> last_nonce{0};
std::atomic<bool> have_nonce{false};

template <class F>
F* real(const char* name) {
  return reinterpret_cast<F*>(dlsym(RTLD_NEXT, name));
}

void sleep_ms(int ms) {
  timespec left{ms / 1000, ms % 1000 * 1'000'000L};
  while (nanosleep(&left, &left) != 0 && errno == EINTR) {
  }
}

void* grow_without_end(void*) {
  while (true) {
    const auto size = static_cast<std::size_t>(std::max(1, growth_mib_s.load() / 20)) << 20U;
    if (void* memory = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        memory != MAP_FAILED)
      std::memset(memory, 1, size);
    sleep_ms(50);
  }
}

void* burn(void*) {
  while (true) (void)late_ms.load();
}

void on_command(int, siginfo_t* info, void*) {
  const auto word = static_cast<std::uint64_t>(reinterpret_cast<std::uintptr_t>(info->si_value.sival_ptr));
  const auto argument = static_cast<std::int32_t>(word >> 32U);
  switch (static_cast<Command>(word & UINT32_MAX)) {
    case healthy:
      wrong_answer = healthy;
      is_deaf = false;
      late_ms = 0;
      clock_offset_ns = 0;
      break;
    case do_abort:
      std::abort();
    case do_segfault:
      *reinterpret_cast<volatile int*>(8) = 1;
      break;
    case loop:
      while (true) (void)late_ms.load();
    case deadlock:
      while (true) pause();
    case late:
      late_ms = argument;
      break;
    case deaf:
      is_deaf = true;
      break;
    case stale_nonce:
    case wrong_incarnation:
    case wrong_state:
      wrong_answer = static_cast<std::uint32_t>(word & UINT32_MAX);
      break;
    case grow: {
      growth_mib_s = argument;
      pthread_t thread;  // not async-signal-safe, but this fault ruins the process anyway
      pthread_create(&thread, nullptr, grow_without_end, nullptr);
      break;
    }
    case hog:
      for (int i = 0; i < 8; ++i) {
        pthread_t thread;
        pthread_create(&thread, nullptr, burn, nullptr);
      }
      break;
    case use_descriptors:
      while (open("/dev/null", O_RDONLY | O_CLOEXEC) >= 0) {
      }
      break;
    case idle:
      is_idle = true;
      break;
    case clock_step:
      clock_offset_ns = static_cast<std::int64_t>(argument) * 60'000'000'000;
      break;
  }
}

/// Redirects all calls of @p function to @p by. Must not run while @p function runs.
void replace(void* function, const void* by) {
#if defined(__x86_64__)
  std::array<std::uint8_t, 12> jump{0x48, 0xB8, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xE0};  // mov rax, by; jmp rax
  std::memcpy(jump.data() + 2, &by, sizeof by);
#else
  std::array<std::uint8_t, 16> jump{0x50, 0, 0, 0x58, 0, 0x02, 0x1F, 0xD6};  // ldr x16, by; br x16
  std::memcpy(jump.data() + 8, &by, sizeof by);
#endif
  const auto page = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
  const auto address = reinterpret_cast<std::uintptr_t>(function);
  const std::uintptr_t first = address / page * page;
  if (mprotect(reinterpret_cast<void*>(first), address + jump.size() - first,
               PROT_READ | PROT_WRITE | PROT_EXEC) != 0)
    std::abort();  // a campaign that cannot inject its faults must fail
  std::memcpy(function, jump.data(), jump.size());
  auto* code = static_cast<char*>(function);
  __builtin___clear_cache(code, code + jump.size());
}

/// Leaves all input waiting from now on, counted as in any node that falls behind. Runs on the work thread,
/// outside the executor function that it replaces. The library calls that function directly, so preloading
/// the symbol alone has no effect.
void stop_taking_input() {
  constexpr const char* name = "_ZN4srfs3ros8Executor14run_one_sourceEv";
  void* const flight = dlsym(RTLD_NEXT, name);
  void* const here = dlsym(RTLD_DEFAULT, name);
  if (flight == nullptr || here == nullptr || flight == here) std::abort();
  replace(flight, here);
}

std::function<void()> unless_idle(std::function<void()> callback) {
  return [f = std::move(callback)] {
    if (!is_idle) f();
  };
}

/// Applies SRFS_FAULT_AT_START to this process: "NODE:exit" ends it, "NODE:hang:MS" stops its work thread
/// MS milliseconds after its start.
void fail_at_start() {
  const char* wanted = std::getenv("SRFS_FAULT_AT_START");
  if (wanted == nullptr) return;
  std::array<char, 4096> line{};
  const int fd = open("/proc/self/cmdline", O_RDONLY | O_CLOEXEC);
  const ssize_t size = fd < 0 ? 0 : read(fd, line.data(), line.size() - 1);
  if (fd >= 0) close(fd);
  const std::string_view text(line.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
  const std::string_view request(wanted);
  const std::string_view node = request.substr(0, request.find(':'));
  constexpr std::string_view option("--name\0", 7);
  const auto at = text.find(option);
  if (at == std::string_view::npos || std::string_view(text.data() + at + option.size()) != node) return;
  const std::string_view fault = request.substr(node.size() + 1);
  if (fault == "exit") _exit(1);
  if (fault.substr(0, 5) != "hang:") return;
  sigevent event{};
  event.sigev_notify = SIGEV_THREAD_ID;
  event.sigev_signo = SIGRTMIN + signal_number_offset;
  event.sigev_value.sival_ptr = reinterpret_cast<void*>(static_cast<std::uintptr_t>(deadlock));
  event._sigev_un._tid = getpid();  // the work thread is the first thread
  timer_t timer{};
  const int ms = std::atoi(fault.data() + 5);
  const itimerspec once{{}, {ms / 1000, ms % 1000 * 1'000'000L}};
  if (timer_create(CLOCK_MONOTONIC, &event, &timer) == 0) timer_settime(timer, 0, &once, nullptr);
}

__attribute__((constructor)) void prepare() {
  struct sigaction action {};
  action.sa_sigaction = on_command;
  action.sa_flags = SA_SIGINFO | SA_RESTART | SA_NODEFER;
  sigaction(SIGRTMIN + signal_number_offset, &action, nullptr);
  fail_at_start();
}

bool is_network(int fd) {
  sockaddr_storage address{};
  socklen_t length = sizeof address;
  return getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length) == 0 && address.ss_family == AF_INET;
}

// The check_alive request on the wire (CDR, little-endian): nonce u64 | length of the observer's name with
// NUL u32 | name.
constexpr std::array<std::string_view, 9> observers{
    "timing", "can_switcher",      "payload_adcs",     "payload_eps", "payload_thermal",
    "ttc",    "image_acquisition", "image_processing", "maintenance"};

void look_for_question(const std::uint8_t* data, std::size_t size) {
  if (wrong_answer == healthy) return;
  for (const std::string_view observer : observers) {
    std::array<std::uint8_t, 64> pattern{};
    const auto length = static_cast<std::uint32_t>(observer.size() + 1);
    std::memcpy(pattern.data(), &length, 4);
    std::memcpy(pattern.data() + 4, observer.data(), observer.size());
    const void* found = memmem(data, size, pattern.data(), 4 + length);
    if (found == nullptr || static_cast<const std::uint8_t*>(found) - data < 8) continue;
    std::uint64_t nonce = 0;
    std::memcpy(&nonce, static_cast<const std::uint8_t*>(found) - 8, 8);
    last_nonce = nonce;
    have_nonce = true;
    return;
  }
}

/// Where datagrams are sealed, the seal is the first submessage behind the RTPS header: without it.
std::size_t without_seal(std::uint8_t* datagram, std::size_t size) {
  constexpr std::size_t header = 20;
  constexpr std::size_t submessage_header = 4;
  if (!srfs::ros::datagram_seal() || size < header + submessage_header) return size;
  const std::size_t octets =
      submessage_header + (std::size_t{datagram[header + 2]} << 8 | datagram[header + 3]);
  const std::size_t behind = header + octets;
  if (size < behind) return size;
  std::memmove(datagram + header, datagram + behind, size - behind);
  return size - octets;
}

/// The node itself says the wrong thing: it bears its seal.
std::size_t sealed(std::uint8_t* datagram, std::size_t size, std::size_t room) {
  const auto& seal = srfs::ros::datagram_seal();
  if (!seal) return size;
  thread_local srfs::Octets out;
  seal->seal({datagram, size}, srfs::monotonic_now(), out);
  if (out.size() > room) return 0;
  std::copy(out.begin(), out.end(), datagram);
  return out.size();
}

/// Writes the falsified datagram to @p copy. @return its size; 0: send the original
std::size_t falsified(const msghdr& message, std::uint8_t* copy, std::size_t room) {
  std::size_t size = 0;
  for (std::size_t i = 0; i < message.msg_iovlen; ++i) {
    if (size + message.msg_iov[i].iov_len > room) return 0;
    std::memcpy(copy + size, message.msg_iov[i].iov_base, message.msg_iov[i].iov_len);
    size += message.msg_iov[i].iov_len;
  }
  size = without_seal(copy, size);
  const std::uint64_t nonce = last_nonce;
  auto* found = static_cast<std::uint8_t*>(memmem(copy, size, &nonce, sizeof nonce));
  if (found == nullptr || static_cast<std::size_t>(found - copy) + 13 > size) return 0;
  // The answer: nonce u64 | incarnation u32 | lifecycle state u8 | ...
  switch (wrong_answer.load()) {
    case stale_nonce:
      found[0] ^= 0x55U;
      break;
    case wrong_incarnation:
      found[9] ^= 0x55U;
      break;
    default:
      found[12] = 99;
      break;
  }
  return sealed(copy, size, room);
}

}  // namespace

namespace srfs::ros {

/// Replaces the flight code's function in an idle node: handles only the input of liveness checks.
bool Executor::run_one_source() {
  auto& queue = ready_[static_cast<std::size_t>(Priority::liveness)];
  while (!queue.empty()) {
    const std::shared_ptr<Source> source = queue.front().lock();
    queue.pop_front();
    if (!source) continue;
    now_ = monotonic_now();
    source->queued_ = false;
    if (source->dispatch_one(now_) && !source->queued_.exchange(true)) {
      source->ready_since_ = now_;
      queue.push_back(source);
    }
    return true;
  }
  return false;
}

// The timers that node programs and libsrfs_suite make through the node; the ring and run_node ask the
// executor.
Timer LifecycleNode::create_timer(nanoseconds period, std::function<void()> callback,
                                  std::string_view timer_name) {
  return executor_.add_timer(monotonic_now() + period, period, unless_idle(std::move(callback)), timer_name);
}

Timer LifecycleNode::create_one_shot(MonotonicTime at, std::function<void()> callback,
                                     std::string_view timer_name) {
  return executor_.add_timer(at, nanoseconds(0), unless_idle(std::move(callback)), timer_name);
}

}  // namespace srfs::ros

extern "C" {

int epoll_wait(int epoll, epoll_event* events, int most, int timeout) {
  static auto* const next = real<int(int, epoll_event*, int, int)>("epoll_wait");
  const int result = next(epoll, events, most, timeout);
  const int saved = errno;
  if (const int ms = late_ms; ms > 0 && syscall(SYS_gettid) == getpid()) sleep_ms(ms);
  if (static bool stopped = false; is_idle && !stopped && syscall(SYS_gettid) == getpid()) {
    stopped = true;
    stop_taking_input();
  }
  errno = saved;
  return result;
}

ssize_t recvmsg(int fd, msghdr* message, int flags) {
  static auto* const next = real<ssize_t(int, msghdr*, int)>("recvmsg");
  const msghdr before = *message;
  while (true) {
    const ssize_t result = next(fd, message, flags);
    if (result <= 0 || !is_deaf || !is_network(fd)) {
      if (result > 0 && message->msg_iovlen > 0)
        look_for_question(static_cast<const std::uint8_t*>(message->msg_iov[0].iov_base),
                          static_cast<std::size_t>(result));
      return result;
    }
    *message = before;
  }
}

ssize_t recvfrom(int fd, void* buffer, std::size_t size, int flags, sockaddr* from, socklen_t* length) {
  static auto* const next = real<ssize_t(int, void*, std::size_t, int, sockaddr*, socklen_t*)>("recvfrom");
  while (true) {
    const ssize_t result = next(fd, buffer, size, flags, from, length);
    if (result <= 0 || !is_deaf || !is_network(fd)) return result;
  }
}

int recvmmsg(int fd, mmsghdr* messages, unsigned count, int flags, timespec* timeout) {
  static auto* const next = real<int(int, mmsghdr*, unsigned, int, timespec*)>("recvmmsg");
  const int result = next(fd, messages, count, flags, timeout);
  if (result > 0 && is_deaf && is_network(fd)) {
    errno = EAGAIN;
    return -1;
  }
  for (int i = 0; i < result; ++i) {
    if (messages[i].msg_hdr.msg_iovlen > 0)
      look_for_question(static_cast<const std::uint8_t*>(messages[i].msg_hdr.msg_iov[0].iov_base),
                        messages[i].msg_len);
  }
  return result;
}

ssize_t sendmsg(int fd, const msghdr* message, int flags) {
  static auto* const next = real<ssize_t(int, const msghdr*, int)>("sendmsg");
  if (wrong_answer == healthy || !have_nonce) return next(fd, message, flags);
  thread_local std::array<std::uint8_t, 65536> copy;
  const std::size_t size = falsified(*message, copy.data(), copy.size());
  if (size == 0) return next(fd, message, flags);
  iovec part{copy.data(), size};
  msghdr changed = *message;
  changed.msg_iov = &part;
  changed.msg_iovlen = 1;
  return next(fd, &changed, flags);
}

ssize_t sendto(int fd, const void* data, std::size_t size, int flags, const sockaddr* to, socklen_t length) {
  static auto* const next =
      real<ssize_t(int, const void*, std::size_t, int, const sockaddr*, socklen_t)>("sendto");
  if (wrong_answer == healthy || !have_nonce) return next(fd, data, size, flags, to, length);
  thread_local std::array<std::uint8_t, 65536> copy;
  iovec part{const_cast<void*>(data), size};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  const std::size_t changed = falsified(message, copy.data(), copy.size());
  return changed == 0 ? next(fd, data, size, flags, to, length)
                      : next(fd, copy.data(), changed, flags, to, length);
}

int clock_gettime(clockid_t clock, timespec* now) noexcept {
  static auto* const next = real<int(clockid_t, timespec*)>("clock_gettime");
  const int result = next(clock, now);
  const std::int64_t offset = clock_offset_ns;
  if (clock == CLOCK_REALTIME && offset != 0 && result == 0) {
    const std::int64_t moved = now->tv_sec * 1'000'000'000 + now->tv_nsec + offset;
    now->tv_sec = moved / 1'000'000'000;
    now->tv_nsec = moved % 1'000'000'000;
  }
  return result;
}
}
