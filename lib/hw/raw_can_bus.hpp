// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <linux/can.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hw/backends.hpp"
#include "hw/can_bus.hpp"
#include "hw/can_error_frame.hpp"
#include "hw/can_restart.hpp"
#include "hw/reopening.hpp"

namespace srfs::hw {

/// What the back-ends whose frames are `struct can_frame` have in common: translation, filters, the account
/// of own frames without echo, the controller's state and its way back from bus-off, over a device that may
/// vanish and come back.
class RawCanBus : public CanBus {
 public:
  [[nodiscard]] int fd() const override { return device_->fd(); }
  [[nodiscard]] std::size_t unconfirmed() const override { return unconfirmed_; }
  [[nodiscard]] std::string reason() const override { return device_->reason(); }
  [[nodiscard]] CanController controller() const override;
  [[nodiscard]] const CanCounters& counters() const override { return counters_; }

 protected:
  RawCanBus(std::string uri, std::vector<CanFilter> filters)
      : uri_(std::move(uri)), filters_(std::move(filters)) {}
  /// In the body of the derived constructor, once: the opener runs at once and may use all members. It says
  /// by opened_with() how it found the controller.
  void start(Reopening::Opener opener);
  void opened_with(const CanController& controller);
  /// One try to restart the controller, which is bus-off. Success shows by an error frame or on_report().
  virtual void try_restart(int device) = 0;
  /// The controller went bus-off with own frames that had no echo yet.
  virtual void on_bus_off_with_frames() { on_withdrawn(0); }
  /// What a device that is not there is: gone or down.
  [[nodiscard]] virtual CanBusState absent_state() const { return CanBusState::gone; }

  /// The device's descriptor, opened now if that is due; -1 while it is gone. A restart that is due is tried.
  int socket();
  void on_report(const CanErrorReport& report);
  [[nodiscard]] bool present() const { return device_->present(); }
  [[nodiscard]] static Result<can_frame, CanError> to_raw(const CanFrame& frame);
  /// Remote frames are wanted only where every frame is.
  [[nodiscard]] bool is_unwanted_remote(const can_frame& raw) const {
    return (raw.can_id & CAN_RTR_FLAG) != 0 && !filters_.empty();
  }
  /// Accounts for a frame that came; nothing for one that the filters keep out.
  std::optional<CanFrame> accept(const can_frame& raw, bool is_echo, MonotonicTime at);
  void note_sent();
  tl::unexpected<CanError> refuse_full();
  /// Own frames without echo are no longer more than @p left: the others were withdrawn.
  void on_withdrawn(std::size_t left);
  /// The device is gone, and with it what waited in its queue.
  void lost(std::string why, Reopening::Retry retry = Reopening::Retry::later);

  std::string uri_;
  std::vector<CanFilter> filters_;
  CanCounters counters_;

 private:
  void drop_unconfirmed() { on_withdrawn(0); }
  void wake_for_restart();

  CanController controller_;
  CanRestart restart_;
  std::optional<MonotonicTime> waking_at_;  // what the device's timer is set to
  std::size_t unconfirmed_ = 0;
  std::optional<Reopening> device_;  // from start() on
};

}  // namespace srfs::hw
