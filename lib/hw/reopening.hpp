// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "base/fd.hpp"
#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs::hw {

/// A device that may vanish and come back, behind a descriptor that stays. fd() is an epoll descriptor:
/// readable when the device is (or has hung up), and when another try to open it is due. Not thread-safe.
class Reopening {
 public:
  /// Opens the device without blocking; the error is the reason, for a person.
  using Opener = std::function<Result<Fd, std::string>()>;
  static constexpr milliseconds retry_interval{100};
  static constexpr milliseconds first_retry_interval{1};  ///< of Retry::at_once; each next is twice as long
  enum class Retry : std::uint8_t {
    later,    ///< after retry_interval
    at_once,  ///< by the next device(), then soon: it is expected back within moments
  };

  /// Tries once at once. @param name  stands in log lines: the URI
  /// @param watched  false for devices that epoll does not take (watchdog, GPIO)
  Reopening(std::string name, Opener opener, bool watched = true);

  [[nodiscard]] int fd() const { return epoll_.get(); }
  /// The device's descriptor, opened now if that is due; -1 while it is gone.
  [[nodiscard]] int device();
  [[nodiscard]] bool present() const { return static_cast<bool>(device_); }
  /// Closes the device; it is tried again, in the end every retry_interval. Logs the first time only.
  void lost(std::string reason, Retry retry = Retry::later);
  /// Makes fd() readable at @p at too, once and while the device is there, until it is set anew; nullopt: no
  /// longer.
  void wake_at(std::optional<MonotonicTime> at);
  [[nodiscard]] const std::string& reason() const { return reason_; }
  /// Times the device came back after it had been there.
  [[nodiscard]] std::uint64_t reopened() const { return reopened_; }

 private:
  void try_open();
  void retry_after(nanoseconds wait);

  std::string name_;
  Opener opener_;
  bool watched_;
  Fd epoll_;
  Fd timer_;
  Fd device_;
  MonotonicTime next_try_;
  nanoseconds wait_ = retry_interval;  ///< behind the next try that fails
  std::string reason_;
  bool was_there_ = false;
  std::uint64_t reopened_ = 0;
};

}  // namespace srfs::hw
