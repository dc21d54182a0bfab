// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <vector>

#include "hw/open.hpp"
#include "hw_sim/bus_arbiter.hpp"
#include "tests/simulation/process.hpp"

namespace srfs::simulation {

class CanHandle;

/// The CAN bus over hw_sim's arbiter, with real bit times. All processes of the computer share one controller
/// with one queue, as behind an interface of SocketCAN: frames leave in the order in which they were written,
/// also those of a process that has ended since.
class CanLine {
 public:
  explicit CanLine(Kernel& kernel);

  /// For a process; nothing of it hears after its end. @param filters  as hw::open_can
  [[nodiscard]] std::unique_ptr<CanHandle> open(Host& host, std::vector<hw::CanFilter> filters,
                                                std::function<void()> on_input);
  /// For a device with a controller of its own.
  [[nodiscard]] std::unique_ptr<CanHandle> open_device(std::function<void()> on_input);

  void set_faults(const sim::BusFaults& faults) { arbiter_.set_faults(faults); }
  void force_bus_off();
  [[nodiscard]] const sim::BusArbiter& arbiter() const { return arbiter_; }
  /// Frames of the computer that wait, or are on the wire, of all processes that the node had.
  [[nodiscard]] std::size_t waiting_of(Lane node) const;
  /// Sees each frame of the computer where it is queued.
  void set_tap(std::function<void(Lane writer)> tap) { tap_ = std::move(tap); }
  /// The computer lost its power: what waits in its controller is gone.
  void lose_computer();

 private:
  friend class CanHandle;
  struct Owner {
    CanHandle* handle = nullptr;  ///< nullptr: closed since
    Lane node = Lane::world;
    pid_t pid = 0;
  };
  [[nodiscard]] Result<void, hw::CanError> submit(CanHandle& handle, const hw::CanFrame& frame);
  bool withdraw(CanHandle& handle);
  void close(CanHandle& handle);
  void advance();
  void deliver(const sim::BusDelivery& delivery);
  void take_reports();
  void forget_own(std::size_t left);

  Kernel& kernel_;
  sim::BusArbiter arbiter_;
  sim::BusStation computer_;
  sim::BusClient computer_client_;
  std::deque<Owner> owners_;  ///< of the frames of the computer, in their order
  std::vector<CanHandle*> handles_;
  Deadline deadline_;
  std::function<void(Lane writer)> tap_;
};

/// hw::CanBus over the played line.
class CanHandle final : public hw::CanBus {
 public:
  CanHandle(CanLine& line, Host* host, std::vector<hw::CanFilter> filters, std::function<void()> on_input);
  ~CanHandle() override;
  CanHandle(const CanHandle&) = delete;
  CanHandle& operator=(const CanHandle&) = delete;

  [[nodiscard]] int fd() const override { return -1; }
  [[nodiscard]] Result<void, hw::CanError> send(const hw::CanFrame& frame) override;
  [[nodiscard]] std::optional<hw::CanFrame> receive() override;
  [[nodiscard]] std::size_t unconfirmed() const override { return unconfirmed_; }
  bool withdraw() override;
  [[nodiscard]] hw::CanController controller() const override;
  [[nodiscard]] std::string reason() const override { return {}; }
  [[nodiscard]] const hw::CanCounters& counters() const override { return counters_; }

 private:
  friend class CanLine;
  static constexpr std::size_t queue_frames = 256;
  void push(hw::CanFrame frame, bool is_echo);
  void notify();

  CanLine& line_;
  Host* host_;  ///< nullptr: a device
  pid_t pid_;
  sim::BusClient client_ = 0;
  std::vector<hw::CanFilter> filters_;
  std::function<void()> on_input_;
  std::deque<hw::CanFrame> incoming_;
  bool notified_ = false;
  std::size_t unconfirmed_ = 0;
  hw::CanCounters counters_;
  std::shared_ptr<CanHandle*> self_ = std::make_shared<CanHandle*>(this);  ///< for what comes later
};

}  // namespace srfs::simulation
