// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <atomic>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <sys/eventfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/fd.hpp"
#include "hw/open.hpp"
#include "hw_sim/can_hub.hpp"
#include "tests/can_bus_checks.hpp"
#include "tests/isotp_over_can.hpp"
#include "tests/node/hw/poll_until.hpp"
#include "wire/isotp.hpp"

namespace srfs::hw {
namespace {

/// The hub on a separate thread, which stands in for its process.
class RunningHub {
 public:
  explicit RunningHub(const std::filesystem::path& socket, sim::BusFaults faults = {})
      : hub_(sim::CanHub::create(socket, sim::BusArbiter()).value()),
        stop_(::eventfd(0, EFD_CLOEXEC)),
        wake_(::eventfd(0, EFD_CLOEXEC)) {
    hub_->set_faults(std::move(faults));
    hub_->set_tap([this](const sim::BusDelivery& d) {
      if (first_start_ == MonotonicTime{}) first_start_ = d.start;
      last_end_ = d.end;
    });
    thread_ = std::thread([this] { run(); });
  }
  ~RunningHub() { stop(); }
  RunningHub(const RunningHub&) = delete;
  RunningHub& operator=(const RunningHub&) = delete;

  void stop() {
    if (!thread_.joinable()) return;
    const std::uint64_t one = 1;
    EXPECT_EQ(::write(stop_.get(), &one, sizeof one), 8);
    thread_.join();
  }
  /// Runs @p change on the hub's thread and waits until it has finished.
  void change(const std::function<void(sim::CanHub&)>& change) {
    std::promise<void> done;
    {
      const std::lock_guard lock(mutex_);
      change_ = [&] {
        change(*hub_);
        done.set_value();
      };
    }
    const std::uint64_t one = 1;
    EXPECT_EQ(::write(wake_.get(), &one, sizeof one), 8);
    done.get_future().wait();
  }
  /// Call only after stop().
  [[nodiscard]] const sim::CanHub& hub() const { return *hub_; }
  [[nodiscard]] nanoseconds span() const { return last_end_ - first_start_; }

 private:
  void run() {
    while (true) {
      std::array<pollfd, 3> fds{
          {{hub_->fd(), POLLIN, 0}, {stop_.get(), POLLIN, 0}, {wake_.get(), POLLIN, 0}}};
      ::poll(fds.data(), fds.size(), -1);
      if (fds[1].revents != 0) return;
      if (fds[2].revents != 0) {
        std::uint64_t times = 0;
        EXPECT_EQ(::read(wake_.get(), &times, sizeof times), 8);
        const std::lock_guard lock(mutex_);
        change_();
      }
      hub_->on_readable(monotonic_now());
    }
  }
  std::unique_ptr<sim::CanHub> hub_;
  Fd stop_;
  Fd wake_;
  std::mutex mutex_;
  std::function<void()> change_;
  MonotonicTime first_start_;
  MonotonicTime last_end_;
  std::thread thread_;
};

class SimCan : public ::testing::Test {
 protected:
  std::unique_ptr<CanBus> connect(std::vector<CanFilter> filters = {}) {
    return open_can("sim:hub.sock", folder_.path(), std::move(filters)).value();
  }
  TemporaryFolder folder_;
};

TEST_F(SimCan, CarriesAFrameToTheOthersAndEchoesItToItsSender) {
  const RunningHub hub(folder_.path() / "hub.sock");
  const auto a = connect();
  const auto b = connect();
  expect_a_frame_and_its_echo(*a, *b);
}

TEST_F(SimCan, GivesOnlyTheFramesAskedForAndItsOwnEchoes) {
  const RunningHub hub(folder_.path() / "hub.sock");
  const auto computer = connect({isotp_to(0x01)});
  const auto peripheral = connect();
  ASSERT_TRUE(peripheral->send(frame(0x18DA0212)));
  ASSERT_TRUE(peripheral->send(frame(0x18DA0111)));
  EXPECT_EQ(await_frame(*computer)->id, 0x18DA0111U);
  ASSERT_TRUE(computer->send(frame(0x18DA1101)));
  EXPECT_TRUE(await_frame(*computer)->is_echo);
  EXPECT_EQ(computer->counters().received, 1U);
}

TEST_F(SimCan, TellsStandardFromExtendedIdentifiers) {
  const RunningHub hub(folder_.path() / "hub.sock");
  const auto computer = connect({exactly(0x3A1, 0x321, false)});
  const auto peripheral = connect();
  ASSERT_TRUE(peripheral->send(frame(0x3A1)));
  CanFrame standard = frame(0x3A1);
  standard.extended = false;
  ASSERT_TRUE(peripheral->send(standard));
  const auto heard = await_frame(*computer);
  ASSERT_TRUE(heard);
  EXPECT_FALSE(heard->extended);
  EXPECT_EQ(computer->counters().received, 1U);
}

TEST_F(SimCan, RefusesTheSixtyFifthUnconfirmedFrame) {
  const RunningHub hub(folder_.path() / "hub.sock", {.extra_delay = seconds(10)});
  const auto a = connect();
  for (int i = 0; i < 64; ++i) ASSERT_TRUE(a->send(frame(1)));
  EXPECT_EQ(a->send(frame(1)).error(), CanError::queue_full);
  EXPECT_EQ(a->counters().refused_full, 1U);
}

TEST_F(SimCan, OutlivesARestartOfTheHub) {
  auto hub =
      std::make_unique<RunningHub>(folder_.path() / "hub.sock", sim::BusFaults{.extra_delay = seconds(10)});
  const auto a = connect();
  const int fd = a->fd();
  ASSERT_TRUE(a->send(frame(1)));

  hub.reset();
  EXPECT_TRUE(poll_until(fd, [&] {
    (void)a->receive();
    return a->state() == CanBusState::gone;
  }));
  EXPECT_EQ(a->send(frame(1)).error(), CanError::gone);
  EXPECT_EQ(a->unconfirmed(), 0U);
  EXPECT_EQ(a->counters().lost_in_queue, 1U);

  hub = std::make_unique<RunningHub>(folder_.path() / "hub.sock");
  EXPECT_TRUE(poll_until(fd, [&] {
    (void)a->receive();
    return a->state() == CanBusState::active;
  }));
  EXPECT_EQ(a->fd(), fd);
  EXPECT_EQ(a->counters().reopened, 1U);
  EXPECT_TRUE(a->send(frame(1)));
  EXPECT_TRUE(await_frame(*a)->is_echo);
}

/// Receives until @p bus is in this state.
bool await_state(CanBus& bus, CanBusState state) {
  return poll_until(bus.fd(), [&] {
    while (bus.receive()) {
    }
    return bus.state() == state;
  });
}

/// Sends a frame, from which the hub learns that the station belongs to this process.
void introduce(CanBus& bus) {
  ASSERT_TRUE(bus.send(frame(0x18DA1101)));
  ASSERT_TRUE(poll_until(bus.fd(), [&] { return bus.receive().has_value(); }));
}

TEST_F(SimCan, SeesBusOffAsSocketCanShowsItAndIsBackAfterTheRestartTime) {
  RunningHub hub(folder_.path() / "hub.sock");
  hub.change([](sim::CanHub& h) { h.set_automatic_restart(milliseconds(20)); });
  const auto a = connect();
  introduce(*a);
  // The delay keeps frames from leaving: frames sent now are lost with the bus-off.
  hub.change([](sim::CanHub& h) { h.set_faults({.extra_delay = seconds(10)}); });
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(a->send(frame(0x18DA1101)));
  hub.change([now = monotonic_now()](sim::CanHub& h) {
    h.on_readable(now);
    EXPECT_TRUE(h.force_bus_off(0x01, monotonic_now()));
  });
  // The restart may come before the state is read, so check the counters.
  EXPECT_TRUE(poll_until(a->fd(), [&] {
    (void)a->receive();
    return a->counters().bus_off == 1;
  }));
  EXPECT_EQ(a->unconfirmed(), 0U);
  EXPECT_EQ(a->counters().lost_in_queue, 3U);
  EXPECT_TRUE(await_state(*a, CanBusState::active));
  EXPECT_EQ(a->counters().restarts, 1U);
  EXPECT_EQ(a->controller().transmit_errors, 0);

  hub.change([](sim::CanHub& h) { h.set_faults({}); });
  ASSERT_TRUE(a->send(frame(0x18DA1101)));
  hub.stop();
}

TEST_F(SimCan, WithoutAutomaticRestartTheDriverRestartsTheControllerItself) {
  RunningHub hub(folder_.path() / "hub.sock");
  const auto a = connect();
  introduce(*a);
  hub.change([](sim::CanHub& h) { EXPECT_TRUE(h.force_bus_off(0x01, monotonic_now())); });
  EXPECT_TRUE(await_state(*a, CanBusState::bus_off));
  EXPECT_EQ(a->send(frame(1)).error(), CanError::bus_off);
  EXPECT_EQ(a->unconfirmed(), 0U);
  EXPECT_TRUE(await_state(*a, CanBusState::active)) << "nothing but its own descriptor woke the owner";
  ASSERT_TRUE(a->send(frame(0x18DA1101)));
  EXPECT_TRUE(await_frame(*a)->is_echo);
  EXPECT_EQ(a->counters().restarts, 1U);
}

TEST_F(SimCan, GoesBusOffByBitErrorsAndHearsOfEach) {
  RunningHub hub(folder_.path() / "hub.sock");
  const auto a = connect();
  introduce(*a);
  hub.change([](sim::CanHub& h) { h.set_faults({.bit_error_probability = 1}); });
  ASSERT_TRUE(a->send(frame(0x18DA1101)));
  EXPECT_TRUE(await_state(*a, CanBusState::bus_off));
  EXPECT_EQ(a->counters().bus_errors, 32U);
  EXPECT_EQ(a->controller().transmit_errors, 248) << "as told with the last error before";
}

/// The hub recognises the computer's handles by their pid, which differs from its own.
TEST_F(SimCan, EveryHandleOfTheComputerSharesItsControllerAndANewOneIsToldItsState) {
  const pid_t child = ::fork();  // before a second thread exists
  if (child == 0) {
    const auto first = connect();
    if (!await_state(*first, CanBusState::bus_off)) ::_exit(1);
    const auto second = connect();
    if (!await_state(*second, CanBusState::bus_off)) ::_exit(2);
    if (!await_state(*first, CanBusState::active)) ::_exit(3);
    ::_exit(await_state(*second, CanBusState::active) ? 0 : 4);
  }
  RunningHub hub(folder_.path() / "hub.sock");
  hub.change([](sim::CanHub& h) { EXPECT_TRUE(h.force_bus_off(0x01, monotonic_now())); });
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
  hub.stop();
  EXPECT_EQ(hub.hub().bus_counters().restarts, 1U) << "one controller";
}

TEST_F(SimCan, TakesBackFramesThatDoNotGetTheBus) {
  RunningHub hub(folder_.path() / "hub.sock");
  const auto a = connect();
  hub.change([](sim::CanHub& h) {
    h.set_babble(sim::Babble{.frame = {.id = 0, .extended = false, .size = 8}}, monotonic_now());
  });
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(a->send(frame(0x18DA1101)));
  EXPECT_TRUE(poll_until(a->fd(), [&] {  // another station occupies the bus
    const auto f = a->receive();
    return f && f->id == 0;
  }));
  EXPECT_TRUE(a->withdraw());
  EXPECT_TRUE(poll_until(a->fd(), [&] {
    while (a->receive()) {
    }
    return a->unconfirmed() == 0;
  }));
  hub.stop();
  EXPECT_EQ(a->counters().lost_in_queue + a->counters().echoed, 3U);
}

TEST_F(SimCan, SaysThatItWasTooSlowToHearEverything) {
  RunningHub hub(folder_.path() / "hub.sock");
  const auto listener = connect();
  hub.change([](sim::CanHub& h) {
    h.set_babble(sim::Babble{.frame = {.id = 0, .extended = false, .size = 8}}, monotonic_now());
  });
  // The listener does not read until the hub can deliver no more frames.
  const MonotonicTime limit = monotonic_now() + seconds(20);
  std::uint64_t lost = 0;
  while (lost == 0 && monotonic_now() < limit) {
    hub.change([&lost](sim::CanHub& h) { lost = h.counters().receive_overruns; });
    std::this_thread::yield();
  }
  ASSERT_GT(lost, 0U);
  EXPECT_TRUE(poll_until(
      listener->fd(),
      [&] {
        while (listener->receive()) {
        }
        return listener->counters().receive_overruns > 0;
      },
      seconds(20)));
}

TEST_F(SimCan, LosesItsQueuedFramesWhenItsProcessEnds) {
  RunningHub hub(folder_.path() / "hub.sock", {.extra_delay = milliseconds(200)});
  auto victim = connect();
  const auto witness = connect();
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(victim->send(frame(0x500)));
  ASSERT_TRUE(await_frame(*witness));  // one was on the wire
  victim.reset();
  ASSERT_TRUE(witness->send(frame(0x600)));
  std::size_t of_victim = 0;
  EXPECT_TRUE(poll_until(witness->fd(), [&] {
    while (const auto f = witness->receive()) {
      if (f->is_echo) return true;
      ++of_victim;
    }
    return false;
  }));
  EXPECT_LE(of_victim, 1U);
  hub.stop();
  EXPECT_GE(hub.hub().bus_counters().discarded, 8U);
}

TEST_F(SimCan, SaturatedCarriesMoreThan95PercentOfTheBitTime) {
  constexpr int most_tries =
      40;  // a machine that stops this process for 10 ms leaves the bus without frames to send
  double share = 0;
  for (int i = 0; i < most_tries && share < 0.95; ++i) {
    RunningHub hub(folder_.path() / "hub.sock");
    const auto a = connect();
    const auto b = connect();
    const MonotonicTime end = monotonic_now() + milliseconds(500);
    std::uint8_t n = 0;
    const auto feed = [&n](CanBus& bus, std::uint32_t id) {
      while (bus.receive()) {
      }
      while (bus.unconfirmed() < 32) {
        if (!bus.send(frame(id, n++))) break;
      }
    };
    poll_until(a->fd(), [&] {
      feed(*a, 0x18DA1101);
      feed(*b, 0x18DA0111);
      return monotonic_now() >= end;
    });
    hub.stop();
    ASSERT_EQ(hub.hub().bus_counters().refused_full, 0U);
    if (hub.span() < milliseconds(300)) continue;
    share =
        static_cast<double>(hub.hub().bus_counters().busy.count()) / static_cast<double>(hub.span().count());
  }
  EXPECT_GE(share, 0.95);
}

/// Moves frames between a bus and a channel until @p done.
bool serve(CanBus& bus, wire::IsoTpChannel& channel, const std::function<bool()>& done, milliseconds limit) {
  const MonotonicTime end = monotonic_now() + limit;
  while (!done() && monotonic_now() < end) {
    testing_support::move_frames(bus, channel);
    pollfd p{.fd = bus.fd(), .events = POLLIN, .revents = 0};
    ::poll(&p, 1, 1);
  }
  return done();
}

TEST_F(SimCan, CarriesTheLongestIsoTpMessageAndItsAnswer) {
  const RunningHub hub(folder_.path() / "hub.sock");
  wire::IsoTpSettings settings;
  settings.block_size = 8;
  settings.n_as = settings.n_bs = settings.n_cr = seconds(1);  // the machine may be busy
  std::atomic<bool> answered = false;

  std::thread peripheral([&] {
    const auto bus = connect({isotp_to(0x11)});
    wire::IsoTpChannel channel({.target = 0x01, .source = 0x11}, settings);
    EXPECT_TRUE(serve(
        *bus, channel, [&] { return channel.messages_waiting() > 0; }, seconds(20)));
    EXPECT_EQ(channel.front_message().size(), 4095U);
    EXPECT_TRUE(channel.send(channel.front_message(), monotonic_now()));
    EXPECT_TRUE(serve(
        *bus, channel, [&] { return answered.load(); }, seconds(20)));
  });

  const auto bus = connect({isotp_to(0x01)});
  wire::IsoTpChannel channel({.target = 0x11, .source = 0x01}, settings);
  Octets message(4095);
  for (std::size_t i = 0; i < message.size(); ++i) message[i] = static_cast<std::uint8_t>(i * 31);
  // Repeat the message: before the peripheral has connected, no station answers.
  EXPECT_TRUE(serve(
      *bus, channel,
      [&] {
        if (!channel.sending()) {
          const auto result = channel.take_send_result();
          if (!result || !*result) (void)channel.send(message, monotonic_now());
        }
        return channel.messages_waiting() > 0;
      },
      seconds(20)));
  answered = true;
  peripheral.join();
  EXPECT_TRUE(std::ranges::equal(channel.front_message(), message));
}

TEST(CanHub, CarriesFramesFromTheTimesTheyWereWrittenHoweverLateItIsWoken) {
  const TemporaryFolder folder;
  const auto hub = std::move(sim::CanHub::create(folder.path() / "hub.sock", sim::BusArbiter()).value());
  std::vector<sim::BusDelivery> carried;
  hub->set_tap([&](const sim::BusDelivery& d) { carried.push_back(d); });
  const auto first = open_can("sim:hub.sock", folder.path()).value();
  const auto second = open_can("sim:hub.sock", folder.path()).value();
  hub->on_readable(monotonic_now());  // accepts the connections

  constexpr milliseconds late(200);
  // Repeat on a busy machine: the clocks are read one after the other, so a delay spoils the comparison.
  for (int attempt = 0; attempt < 20; ++attempt) {
    carried.clear();
    ASSERT_TRUE(second->send(frame(0x18DA0111)));
    ASSERT_TRUE(first->send(frame(0x100)));  // higher priority, but later
    const MonotonicTime written = monotonic_now();
    std::this_thread::sleep_for(late);
    hub->on_readable(monotonic_now());
    ASSERT_EQ(carried.size(), 2U);
    EXPECT_EQ(carried[0].frame.id, 0x18DA0111U);
    EXPECT_GE(carried[1].start, carried[0].end);
    if (carried[0].start < written + late / 2) return;
  }
  FAIL() << "every frame begins when the hub is woken";
}

TEST(CanHub, RefusesASecondHubAtTheSameSocketAndReplacesADeadOne) {
  const TemporaryFolder folder;
  const auto socket = folder.path() / "hub.sock";
  auto first = sim::CanHub::create(socket, sim::BusArbiter());
  ASSERT_TRUE(first);
  EXPECT_EQ(std::filesystem::status(socket).permissions(),
            std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  EXPECT_FALSE(sim::CanHub::create(socket, sim::BusArbiter()));
  first->reset();
  EXPECT_FALSE(std::filesystem::exists(socket));
  EXPECT_TRUE(sim::CanHub::create(socket, sim::BusArbiter()));
}

}  // namespace
}  // namespace srfs::hw
