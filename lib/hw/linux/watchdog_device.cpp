// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/watchdog.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>

#include "base/file.hpp"
#include "base/log.hpp"
#include "hw/backends.hpp"
#include "hw/reopening.hpp"

namespace srfs::hw {
namespace {

/// Whether the driver was built or loaded with nowayout. The old name /dev/watchdog is the first device's.
std::optional<bool> read_nowayout(int fd) {
  struct stat file {};
  if (::fstat(fd, &file) != 0) return std::nullopt;
  constexpr unsigned misc_major = 10;
  const path folder =
      major(file.st_rdev) == misc_major
          ? path("/sys/class/watchdog/watchdog0")
          : path(fmt::format("/sys/dev/char/{}:{}", major(file.st_rdev), minor(file.st_rdev)));
  const auto text = read_file(folder / "nowayout", 16);
  if (!text || text->empty()) return std::nullopt;
  return text->front() != '0';
}

/// /dev/watchdog. It is armed by opening and never disarmed: the magic 'V' is not written, so it stays armed
/// over a close even where the driver was not built or loaded with nowayout.
class WatchdogDevice : public Watchdog {
 public:
  WatchdogDevice(const std::string& uri, const path& device, seconds timeout)
      : device_(
            uri, [this, device, timeout] { return open(device, timeout); }, false) {}

  [[nodiscard]] Result<void, WatchdogError> feed() override {
    const int fd = device_.device();
    counters_.reopened = device_.reopened();
    if (fd >= 0 && ::ioctl(fd, WDIOC_KEEPALIVE, 0) == 0) {
      ++counters_.fed;
      return {};
    }
    if (fd >= 0) device_.lost("keep-alive: " + errno_text(errno));
    ++counters_.failed;
    return Err(WatchdogError::gone);
  }
  [[nodiscard]] Result<void, WatchdogError> disarm() override { return Err(WatchdogError::not_allowed); }
  [[nodiscard]] std::optional<seconds> timeout() const override {
    return device_.present() ? in_force_ : std::nullopt;
  }
  [[nodiscard]] const WatchdogFacts& facts() const override { return facts_; }
  [[nodiscard]] std::string reason() const override { return device_.reason(); }
  [[nodiscard]] const WatchdogCounters& counters() const override { return counters_; }

 private:
  Result<Fd, std::string> open(const path& device, seconds timeout) {
    Fd fd(::open(device.c_str(), O_WRONLY | O_CLOEXEC));
    if (!fd) return Err(fmt::format("{}: {}", device.string(), errno_text(errno)));
    // From here on the device runs, so a failure below must not keep us from feeding it.
    int wanted = static_cast<int>(timeout.count());
    const bool set = ::ioctl(fd.get(), WDIOC_SETTIMEOUT, &wanted) == 0;
    const std::string set_error = set ? "" : errno_text(errno);
    int actual = 0;
    in_force_.reset();
    if (::ioctl(fd.get(), WDIOC_GETTIMEOUT, &actual) == 0) in_force_ = seconds(actual);
    facts_ = read_facts(fd.get());
    log::info("{}: {}, time-out {} s, {}", device.string(), facts_.identity, in_force_ ? actual : -1,
              !facts_.nowayout   ? "nowayout unknown"
              : *facts_.nowayout ? "nowayout"
                                 : "WITHOUT nowayout: root can stop it");
    if (in_force_ != timeout)
      log::warn("{}: the requested time-out of {} s is not in force {}", device.string(), timeout.count(),
                set_error);
    return fd;
  }

  static WatchdogFacts read_facts(int fd) {
    WatchdogFacts facts;
    watchdog_info info{};
    if (::ioctl(fd, WDIOC_GETSUPPORT, &info) == 0) {
      const auto* text = reinterpret_cast<const char*>(info.identity);
      facts.identity = std::string(text, strnlen(text, sizeof info.identity));
      // Some drivers (i6300esb) tell it and do not list it among what they can tell.
      int status = 0;
      const bool told = ::ioctl(fd, WDIOC_GETBOOTSTATUS, &status) == 0;
      const bool was_it = (status & WDIOF_CARDRESET) != 0;
      if (told && (was_it || (info.options & WDIOF_CARDRESET) != 0)) facts.reset_by_watchdog = was_it;
    }
    facts.nowayout = read_nowayout(fd);
    return facts;
  }

  WatchdogFacts facts_;
  std::optional<seconds> in_force_;
  WatchdogCounters counters_;
  Reopening device_;  // last: it opens while it is constructed
};

}  // namespace

std::unique_ptr<Watchdog> make_watchdog_device(const std::string& uri, const path& device, seconds timeout) {
  return std::make_unique<WatchdogDevice>(uri, device, timeout);
}

}  // namespace srfs::hw
