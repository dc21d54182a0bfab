// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <mutex>
#include <thread>

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/pps.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/bounded_queue.hpp"
#include "base/log.hpp"
#include "hw/backends.hpp"
#include "hw/linux/clock_offset.hpp"
#include "hw/reopening.hpp"

namespace srfs::hw {
namespace {

constexpr std::size_t queue_capacity = 8;
constexpr milliseconds fetch_timeout{200};

/// /dev/ppsN (RFC 2783, linux/pps.h). poll() on it is of no use (it says readable at any time),
/// so a thread waits in PPS_FETCH and hands each pulse over through an eventfd. Destroying waits for that
/// thread: at most 0.2 s.
class Pps : public PulseSource {
 public:
  Pps(std::string uri, path device)
      : uri_(std::move(uri)),
        device_path_(std::move(device)),
        wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
        thread_([this] { run(); }) {}
  Pps(const Pps&) = delete;
  Pps& operator=(const Pps&) = delete;
  ~Pps() override {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    stopped_.notify_all();
    thread_.join();
  }

  [[nodiscard]] int fd() const override { return wake_.get(); }
  [[nodiscard]] std::string reason() const override {
    const std::lock_guard lock(mutex_);
    return reason_;
  }
  [[nodiscard]] const PulseCounters& counters() const override {
    const std::lock_guard lock(mutex_);
    shown_ = counters_;
    shown_.dropped = queue_.dropped();
    return shown_;
  }
  [[nodiscard]] std::optional<Pulse> read() override {
    const std::lock_guard lock(mutex_);
    auto pulse = queue_.pop();
    if (queue_.empty()) {
      std::uint64_t count = 0;
      [[maybe_unused]] const auto n = ::read(wake_.get(), &count, sizeof count);
    }
    return pulse;
  }

 private:
  void run() {
    Fd device;
    bool was_there = false;
    while (true) {
      if (!device) {
        device = open(was_there);
        if (!device) {
          std::unique_lock lock(mutex_);
          if (stopped_.wait_for(lock, Reopening::retry_interval, [this] { return stop_; })) return;
          continue;
        }
        was_there = true;
      }
      if (!fetch(device.get())) device.reset();
      const std::lock_guard lock(mutex_);
      if (stop_) return;
    }
  }

  Fd open(bool was_there) {
    Fd device(::open(device_path_.c_str(), O_RDWR | O_CLOEXEC));
    std::string reason = device ? "" : fmt::format("{}: {}", device_path_.string(), errno_text(errno));
    if (device) {
      pps_kparams parameters{};
      if (::ioctl(device.get(), PPS_GETPARAMS, &parameters) != 0) {
        reason = fmt::format("{} is not a PPS device: {}", device_path_.string(), errno_text(errno));
      } else if ((parameters.mode & PPS_CAPTUREASSERT) == 0) {
        parameters.mode |= PPS_CAPTUREASSERT;
        if (::ioctl(device.get(), PPS_SETPARAMS, &parameters) != 0)
          reason = "PPS_SETPARAMS: " + errno_text(errno);
      }
    }
    if (!reason.empty()) device.reset();
    const std::lock_guard lock(mutex_);
    if (device && was_there) ++counters_.reopened;
    if (reason != reason_) {
      reason_ = reason;
      if (!reason.empty()) log::warn("{}: {}", uri_, reason);
    }
    last_sequence_.reset();
    return device;
  }

  /// Waits for the next edge. false: the device is gone.
  bool fetch(int device) {
    pps_fdata edge{};
    edge.timeout.nsec = static_cast<int>(nanoseconds(fetch_timeout).count());
    if (::ioctl(device, PPS_FETCH, &edge) != 0) {
      if (errno == EINTR) return true;
      if (errno != ETIMEDOUT) return lost("PPS_FETCH: " + errno_text(errno));
      // A device whose driver went away times out like one without pulses; its file shows it.
      if (!is_the_file(device)) return lost(device_path_.string() + " was removed");
      // An edge between two waits is found by asking once without waiting (a time-out of zero).
      edge = {};
      if (::ioctl(device, PPS_FETCH, &edge) != 0)
        return errno == EINTR || lost("PPS_FETCH: " + errno_text(errno));
    }
    on_edge(edge.info);
    return true;
  }

  bool is_the_file(int device) const {
    struct stat opened {};
    struct stat named {};
    return ::fstat(device, &opened) == 0 && ::stat(device_path_.c_str(), &named) == 0 &&
           opened.st_dev == named.st_dev && opened.st_ino == named.st_ino;
  }

  bool lost(std::string reason) {
    const std::lock_guard lock(mutex_);
    reason_ = std::move(reason);
    log::warn("{}: {}", uri_, reason_);
    return false;
  }

  void on_edge(const pps_kinfo& info) {
    const std::uint32_t sequence = info.assert_sequence;
    const bool first = !last_sequence_;
    if (!first && *last_sequence_ == sequence) return;
    // The 32-bit sequence goes on in 64 bits; what was captured before we looked is not news.
    total_ = first ? sequence : total_ + static_cast<std::uint32_t>(sequence - *last_sequence_);
    last_sequence_ = sequence;
    const timespec stamp{.tv_sec = info.assert_tu.sec, .tv_nsec = info.assert_tu.nsec};
    const auto edge = place_on_monotonic(to_utc_time(stamp));
    if (first && !edge) return;
    const std::lock_guard lock(mutex_);
    if (!edge) {
      ++counters_.malformed;  // CLOCK_REALTIME was stepped between the edge and now
      return;
    }
    ++counters_.received;
    queue_.push({.edge = *edge, .counter = total_});
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto n = ::write(wake_.get(), &one, sizeof one);
  }

  std::string uri_;
  path device_path_;
  Fd wake_;

  mutable std::mutex mutex_;
  std::condition_variable stopped_;
  bool stop_ = false;
  std::string reason_;
  PulseCounters counters_;
  mutable PulseCounters shown_;
  BoundedQueue<Pulse> queue_{queue_capacity, Overflow::drop_oldest};

  std::optional<std::uint32_t> last_sequence_;  // of the thread alone
  std::uint64_t total_ = 0;
  std::thread thread_;  // last: it uses everything above
};

}  // namespace

std::unique_ptr<PulseSource> make_pps(const std::string& uri, const path& device) {
  return std::make_unique<Pps>(uri, device);
}

}  // namespace srfs::hw
