#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/watchdog.h>
#include <sys/ioctl.h>

#include "hw/backends.hpp"
#include "hw/reopening.hpp"

namespace srfs::hw {
namespace {

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
  [[nodiscard]] std::string reason() const override { return device_.reason(); }
  [[nodiscard]] const WatchdogCounters& counters() const override { return counters_; }

 private:
  Result<Fd, std::string> open(const path& device, seconds timeout) {
    Fd fd(::open(device.c_str(), O_WRONLY | O_CLOEXEC));
    if (!fd) return Err(fmt::format("{}: {}", device.string(), errno_text(errno)));
    // From here on the device runs, so a failure below must not keep us from feeding it.
    int wanted = static_cast<int>(timeout.count());
    ::ioctl(fd.get(), WDIOC_SETTIMEOUT, &wanted);
    int actual = 0;
    in_force_.reset();
    if (::ioctl(fd.get(), WDIOC_GETTIMEOUT, &actual) == 0) in_force_ = seconds(actual);
    return fd;
  }

  std::optional<seconds> in_force_;
  WatchdogCounters counters_;
  Reopening device_;  // last: it opens while it is constructed
};

}  // namespace

std::unique_ptr<Watchdog> make_watchdog_device(const std::string& uri, const path& device, seconds timeout) {
  return std::make_unique<WatchdogDevice>(uri, device, timeout);
}

}  // namespace srfs::hw
