#pragma once

#include <linux/can.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hw/backends.hpp"
#include "hw/can_bus.hpp"
#include "hw/reopening.hpp"

namespace srfs::hw {

/// What the back-ends whose frames are `struct can_frame` have in common: translation, filters, and the
/// account of own frames without echo, over a device that may vanish and come back.
class RawCanBus : public CanBus {
 public:
  [[nodiscard]] int fd() const override { return device_->fd(); }
  [[nodiscard]] std::size_t unconfirmed() const override { return unconfirmed_; }
  [[nodiscard]] std::string reason() const override { return device_->reason(); }
  [[nodiscard]] const CanCounters& counters() const override { return counters_; }

 protected:
  explicit RawCanBus(std::vector<CanFilter> filters) : filters_(std::move(filters)) {}
  /// In the body of the derived constructor, once: the opener runs at once and may use all members.
  void start(const std::string& uri, Reopening::Opener opener) { device_.emplace(uri, std::move(opener)); }

  /// The device's descriptor, opened now if that is due; -1 while it is gone.
  int socket();
  [[nodiscard]] bool present() const { return device_->present(); }
  [[nodiscard]] static Result<can_frame, CanError> to_raw(const CanFrame& frame);
  /// Accounts for a frame that came; nothing for one that the filters keep out.
  std::optional<CanFrame> accept(const can_frame& raw, bool is_echo, MonotonicTime at);
  void note_sent();
  tl::unexpected<CanError> refuse_full();
  /// The device is gone, and with it what waited in its queue.
  void lost(std::string why);
  void drop_unconfirmed();

  std::vector<CanFilter> filters_;
  CanCounters counters_;

 private:
  std::size_t unconfirmed_ = 0;
  std::optional<Reopening> device_;  // from start() on
};

}  // namespace srfs::hw
