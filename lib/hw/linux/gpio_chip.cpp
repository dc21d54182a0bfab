// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cerrno>
#include <utility>

#include <gpiod.h>

#include "base/fd.hpp"
#include "base/log.hpp"
#include "hw/backends.hpp"
#include "hw/reopening.hpp"

namespace srfs::hw {
namespace {

constexpr const char* consumer = "srfs";

bool is_power(std::uint8_t line) {
  return line < gpio_power_count;
}
bool is_input(std::uint8_t line) {
  return line >= gpio_first_input && line < gpio_first_input + gpio_input_count;
}

/// A GPIO character device through libgpiod 1.6. A line is requested on its first use, so that several
/// processes share a chip. The kernel gives a line to one process at a time; whether a level survives its
/// release is the chip driver's choice, to be checked on the board.
class GpioChip : public GpioLines {
 public:
  GpioChip(std::string uri, path device, std::map<std::uint8_t, unsigned> offsets)
      : uri_(std::move(uri)), device_(std::move(device)), offsets_(std::move(offsets)) {}

  [[nodiscard]] const GpioCounters& counters() const override { return counters_; }

  [[nodiscard]] Result<void, GpioError> set_line(std::uint8_t line, bool on) override {
    if (!is_power(line)) return error(GpioError::no_line);
    const auto handle = find(line);
    if (!handle) return error(handle.error());
    const int level = on ? 1 : 0;
    // A fresh line becomes an output at the wanted level in one step: no glitch.
    int result = 0;
    if (!gpiod_line_is_requested(*handle)) {
      result = gpiod_line_request_output(*handle, consumer, level);
    } else if (gpiod_line_direction(*handle) != GPIOD_LINE_DIRECTION_OUTPUT) {
      result = gpiod_line_set_direction_output(*handle, level);
    } else {
      result = gpiod_line_set_value(*handle, level);
    }
    if (result != 0) return failed();
    ++counters_.writes;
    return {};
  }

  [[nodiscard]] Result<bool, GpioError> read_line(std::uint8_t line) override {
    if (!is_power(line) && !is_input(line)) return error(GpioError::no_line);
    const auto handle = find(line);
    if (!handle) return error(handle.error());
    if (!gpiod_line_is_requested(*handle)) {
      // A power line is taken as it stands: asking for its level must not switch it.
      const gpiod_line_request_config as_is{
          .consumer = consumer, .request_type = GPIOD_LINE_REQUEST_DIRECTION_AS_IS, .flags = 0};
      const int result = is_power(line) ? gpiod_line_request(*handle, &as_is, 0)
                                        : gpiod_line_request_input(*handle, consumer);
      if (result != 0) return failed();
    }
    const int value = gpiod_line_get_value(*handle);
    if (value < 0) return failed();
    ++counters_.reads;
    return value != 0;
  }

  [[nodiscard]] Result<std::uint8_t, GpioError> read_bank() override {
    std::uint8_t bank = 0;
    for (std::uint8_t n = 0; n < gpio_input_count; ++n) {
      const auto level = read_line(static_cast<std::uint8_t>(gpio_first_input + n));
      if (!level) return Err(level.error());
      if (*level) bank = static_cast<std::uint8_t>(bank | 1U << n);
    }
    return bank;
  }

 private:
  struct Close {
    void operator()(gpiod_chip* chip) const { gpiod_chip_close(chip); }  // releases its lines too
  };

  Result<gpiod_line*, GpioError> find(std::uint8_t line) {
    if (!chip_ && !open_chip()) return Err(GpioError::gone);
    const auto mapped = offsets_.find(line);
    const unsigned offset = mapped == offsets_.end() ? line : mapped->second;
    gpiod_line* handle = gpiod_chip_get_line(chip_.get(), offset);
    if (handle == nullptr) return Err(errno == EINVAL ? GpioError::no_line : classify(errno));
    return handle;
  }

  bool open_chip() {
    const MonotonicTime now = monotonic_now();
    if (now < next_try_) return false;
    chip_.reset(gpiod_chip_open(device_.c_str()));
    if (!chip_) {
      if (!complained_) log::warn("{}: {}", uri_, errno_text(errno));
      complained_ = true;
      next_try_ = now + Reopening::retry_interval;
      return false;
    }
    if (was_there_) ++counters_.reopened;
    was_there_ = true;
    complained_ = false;
    return true;
  }

  GpioError classify(int why) {
    if (why == EBUSY) return GpioError::not_ours;
    if (why != ENODEV && why != ENXIO && why != EIO) return GpioError::refused;
    chip_.reset();
    log::warn("{}: {}", uri_, errno_text(why));
    next_try_ = monotonic_now() + Reopening::retry_interval;
    return GpioError::gone;
  }

  tl::unexpected<GpioError> failed() { return error(classify(errno)); }
  tl::unexpected<GpioError> error(GpioError e) {
    ++counters_.errors;
    return Err(e);
  }

  std::string uri_;
  path device_;
  std::map<std::uint8_t, unsigned> offsets_;
  std::unique_ptr<gpiod_chip, Close> chip_;
  MonotonicTime next_try_;
  bool was_there_ = false;
  bool complained_ = false;
  GpioCounters counters_;
};

}  // namespace

std::unique_ptr<GpioLines> make_gpio_chip(const std::string& uri, const path& chip,
                                          std::map<std::uint8_t, unsigned> offsets) {
  return std::make_unique<GpioChip>(uri, chip, std::move(offsets));
}

}  // namespace srfs::hw
