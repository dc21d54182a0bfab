// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cerrno>
#include <cmath>
#include <memory>

#include <sys/timex.h>

#include "hw/open.hpp"

namespace srfs::hw {
namespace {

constexpr double frequency_unit_per_ppm = 65'536;  // timex: ppm with a 16-bit fraction

/// clock_adjtime(2). The kernel's own servo (STA_PLL) is switched off with the first setting.
class LinuxKernelClock : public KernelClock {
 public:
  LinuxKernelClock() {
    timex now{};  // modes = 0 reads only
    if (::clock_adjtime(CLOCK_REALTIME, &now) >= 0)
      frequency_ppm_ = static_cast<double>(now.freq) / frequency_unit_per_ppm;
  }

  [[nodiscard]] UtcTime utc_at(MonotonicTime t) const override {
    const MonotonicTime before = monotonic_now();
    const UtcTime utc = system_utc_now();
    const MonotonicTime after = monotonic_now();
    const nanoseconds offset = utc.since_epoch() - (before + (after - before) / 2).since_epoch();
    // The two differ by a constant between steps: of several readings the tightest is the truest.
    if (after - before <= tightest_ || offset - offset_ > (after - before) ||
        offset_ - offset > (after - before)) {
      offset_ = offset;
      tightest_ = after - before;
    }
    return UtcTime(t.since_epoch() + offset_);
  }
  [[nodiscard]] double frequency_ppm() const override { return frequency_ppm_; }

  [[nodiscard]] Result<void, KernelClockError> set_frequency(double ppm) override {
    timex change{};
    change.modes = ADJ_FREQUENCY | ADJ_STATUS;
    change.freq = std::lround(ppm * frequency_unit_per_ppm);
    change.status = 0;
    auto done = adjust(change);
    if (done) frequency_ppm_ = ppm;
    return done;
  }

  [[nodiscard]] Result<void, KernelClockError> step(nanoseconds by) override {
    timex change{};
    change.modes = ADJ_SETOFFSET | ADJ_NANO;
    const auto whole = std::chrono::floor<seconds>(by);
    change.time.tv_sec = whole.count();
    change.time.tv_usec = (by - whole).count();  // nanoseconds with ADJ_NANO
    tightest_ = nanoseconds::max();
    return adjust(change);
  }

 private:
  static Result<void, KernelClockError> adjust(timex& change) {
    if (::clock_adjtime(CLOCK_REALTIME, &change) >= 0) return {};
    return Err(errno == EPERM ? KernelClockError::not_permitted : KernelClockError::refused);
  }

  double frequency_ppm_ = 0;
  mutable nanoseconds offset_{0};
  mutable nanoseconds tightest_ = nanoseconds::max();
};

}  // namespace

const char* to_string(KernelClockError error) {
  switch (error) {
    case KernelClockError::not_permitted:
      return "not permitted (CAP_SYS_TIME)";
    case KernelClockError::refused:
      return "refused by the kernel";
  }
  return "?";
}

std::unique_ptr<KernelClock> open_kernel_clock() {
  return std::make_unique<LinuxKernelClock>();
}

}  // namespace srfs::hw
