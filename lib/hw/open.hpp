// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/result.hpp"
#include "base/time.hpp"
#include "hw/can_bus.hpp"
#include "hw/gpio.hpp"
#include "hw/hw_error.hpp"
#include "hw/kernel_clock.hpp"
#include "hw/pulse_source.hpp"
#include "hw/serial_port.hpp"
#include "hw/watchdog.hpp"

/// Opening of devices by URI, the only place that knows which back-ends exist.
///
/// An error means that the URI can never work: unknown scheme, no path, a number out of range; its message
/// names the URI and what was expected. A device that is absent *now* is no error: the object is made, says
/// so by `gone` and reason(), and opens the device as soon as it is there. Relative paths are relative to @p
/// var_dir. Everything opened is close-on-exec and non-blocking. None of these calls blocks for longer than
/// opening a device file takes.
namespace srfs::hw {

/// What a CAN process wants to hear: data frames with (id & mask) == (match & mask). The echoes of its own
/// frames have to be named too, because the kernel filters them like any other frame.
struct CanFilter {
  bool extended = true;  ///< identifiers of 29 bits, else of 11; both kinds of frames
  std::uint32_t match = 0;
  std::uint32_t mask = 0;
  std::uint32_t echo_match = 0;
  std::uint32_t echo_mask = 0;
};
/// Physical ISO-TP frames to @p own_address, 0x18DA<own>xx, and echoes of the frames from it, 0x18DAxx<own>.
[[nodiscard]] constexpr CanFilter isotp_to(std::uint8_t own_address) {
  return {.extended = true,
          .match = 0x18DA0000U | std::uint32_t{own_address} << 8U,
          .mask = 0x1FFFFF00U,
          .echo_match = 0x18DA0000U | own_address,
          .echo_mask = 0x1FFF00FFU};
}
/// As isotp_to(), from and to one peer only.
[[nodiscard]] constexpr CanFilter isotp_between(std::uint8_t own_address, std::uint8_t peer) {
  CanFilter filter = isotp_to(own_address);
  filter.match |= peer;
  filter.echo_match |= std::uint32_t{peer} << 8U;
  filter.mask = filter.echo_mask = 0x1FFFFFFFU;
  return filter;
}
/// The frames with @p heard, and the echoes of those with @p sent.
[[nodiscard]] constexpr CanFilter exactly(std::uint32_t heard, std::uint32_t sent, bool extended) {
  const std::uint32_t whole = extended ? 0x1FFFFFFFU : 0x7FFU;
  return {.extended = extended, .match = heard, .mask = whole, .echo_match = sent, .echo_mask = whole};
}

/// "socketcan:can0" (a network interface) or "sim:run/can_hub.sock" (the hub of hw_sim).
/// @param filters  frames that receive() gives; none = all
[[nodiscard]] Result<std::unique_ptr<CanBus>, HwError> open_can(std::string_view uri,
                                                                const std::filesystem::path& var_dir,
                                                                std::vector<CanFilter> filters = {});
/// "serial:/dev/ttyS3" (a tty or a pty). @param baud a standard rate from 1200 to 4000000
[[nodiscard]] Result<std::unique_ptr<SerialPort>, HwError> open_serial(std::string_view uri,
                                                                       std::uint32_t baud,
                                                                       const std::filesystem::path& var_dir);
/// "pps:/dev/pps0", "gpiochip:/dev/gpiochip0?line=17" (rising edges of that offset) or
/// "sim:run/gps_pulse.sock".
[[nodiscard]] Result<std::unique_ptr<PulseSource>, HwError> open_pulse(std::string_view uri,
                                                                       const std::filesystem::path& var_dir);
/// "gpiochip:/dev/gpiochip0", optionally with the chip's offsets "?0=17&1=18&2=27&8=5" (line=offset; default:
/// the same number), or "sim:run/gpio.sock".
[[nodiscard]] Result<std::unique_ptr<GpioLines>, HwError> open_gpio(std::string_view uri,
                                                                    const std::filesystem::path& var_dir);
/// "dev:/dev/watchdog" or "sim:run/watchdog.sock". Opening arms it.
/// @param timeout  asked of the device, 1-3600 s; the simulated one has its own
[[nodiscard]] Result<std::unique_ptr<Watchdog>, HwError> open_watchdog(std::string_view uri,
                                                                       const std::filesystem::path& var_dir,
                                                                       seconds timeout);

/// clock_adjtime(2) of this computer. Reading needs no permission.
[[nodiscard]] std::unique_ptr<KernelClock> open_kernel_clock();

/// "scheme:rest?key=value&key=value" taken apart.
struct DeviceUri {
  std::string scheme;
  std::string rest;
  std::vector<std::pair<std::string, std::string>> query;
};
/// @param expected  the schemes allowed, for the message, e.g. {"socketcan", "sim"}
[[nodiscard]] Result<DeviceUri, HwError> parse_device_uri(std::string_view uri,
                                                          const std::vector<std::string>& expected);
/// @p path itself if absolute, else below @p var_dir.
[[nodiscard]] std::filesystem::path below_var(const std::string& path, const std::filesystem::path& var_dir);

}  // namespace srfs::hw
