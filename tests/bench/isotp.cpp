// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <csignal>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <poll.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include "base/file.hpp"
#include "base/signals.hpp"
#include "hw/open.hpp"
#include "hw_sim/seqpacket_server.hpp"
#include "tests/bench/can_measures.hpp"
#include "tests/isotp_over_can.hpp"
#include "tests/temporary_folder.hpp"
#include "wire/can_bits.hpp"

namespace srfs::bench {
namespace {

namespace fs = std::filesystem;

// Different from the addresses of the computer and of the simulator's peripherals.
constexpr std::uint8_t sender_address = 0x21;
constexpr std::uint8_t receiver_address = 0x22;
constexpr double bit_rate = 500e3;
constexpr const char* hub_uri = "sim:run/can_hub.sock";
constexpr milliseconds start_patience = seconds(20);

constexpr const char* deployment = R"(deployment: bench_can
devices:
  can: "sim:run/can_hub.sock"
  rs422: "serial:run/rs422_obc"
  gps_pulse: "sim:run/gps_pulse.sock"
  gps_serial: "serial:run/gps_tty"
  gpio: "sim:run/gpio.sock"
  watchdog: "sim:run/watchdog.sock"
nodes:
  - { name: timing, executable: timing_node }
)";

struct Bits {
  std::uint64_t frames = 0;
  std::uint64_t all = 0;
  std::uint64_t stuffed = 0;

  void add(const hw::CanFrame& frame) {
    // Bits from start of frame to intermission, for an extended data frame without stuff bits.
    const unsigned bare = 67U + 8U * frame.size;
    const unsigned real = wire::can_bits_on_wire(
        {.id = frame.id, .extended = true, .remote = false, .size = frame.size, .data = frame.view()});
    ++frames;
    all += real;
    stuffed += real - bare;
  }
  Bits& operator+=(const Bits& other) {
    frames += other.frames;
    all += other.all;
    stuffed += other.stuffed;
    return *this;
  }
};

Octets message_of(const IsoTpOptions& options, std::uint32_t number) {
  std::mt19937_64 random(options.seed * 1'000'003 + number);
  Octets message(static_cast<std::size_t>(options.octets));
  std::generate(message.begin(), message.end(), [&] { return static_cast<std::uint8_t>(random()); });
  for (std::size_t i = 0; i < 4; ++i) message.at(i) = static_cast<std::uint8_t>(number >> (24 - 8 * i));
  return message;
}

std::uint32_t number_of(OctetView message) {
  std::uint32_t number = 0;
  for (const std::uint8_t octet : message.first(4)) number = number << 8U | octet;
  return number;
}

wire::IsoTpSettings settings_of(const IsoTpOptions& options) {
  wire::IsoTpSettings settings;
  settings.block_size = static_cast<std::uint8_t>(options.block_size);
  if (options.frames_ahead > 0) settings.frames_ahead = static_cast<std::size_t>(options.frames_ahead);
  if (options.timeout > milliseconds(0)) settings.n_as = settings.n_bs = settings.n_cr = options.timeout;
  return settings;
}

std::unique_ptr<hw::CanBus> open_bus(const fs::path& var, std::uint8_t own, std::uint8_t peer) {
  auto bus = hw::open_can(hub_uri, var, {hw::isotp_between(own, peer)});
  if (!bus) throw std::runtime_error(bus.error().message);
  if ((*bus)->state() != hw::CanBusState::active)
    throw std::runtime_error(fmt::format("{}: {}", hub_uri, (*bus)->reason()));
  return std::move(*bus);
}

/// Sleeps until a frame arrives or the channel's next step is due, at most @p longest.
void await(const hw::CanBus& bus, const wire::IsoTpChannel& channel, int other_fd, nanoseconds longest) {
  nanoseconds pause = longest;
  if (const auto due = channel.next_deadline()) pause = std::min(pause, *due - monotonic_now());
  pause = std::max(pause, nanoseconds(0));
  const timespec limit{pause.count() / 1'000'000'000, pause.count() % 1'000'000'000};
  std::array<pollfd, 2> fds{
      {{.fd = bus.fd(), .events = POLLIN, .revents = 0}, {.fd = other_fd, .events = POLLIN, .revents = 0}}};
  ::ppoll(fds.data(), fds.size(), &limit, nullptr);
}

void await_file(const fs::path& file, const fs::path& log) {
  const MonotonicTime end = monotonic_now() + start_patience;
  while (!fs::exists(file)) {
    if (monotonic_now() > end) {
      std::ifstream in(log);
      throw std::runtime_error(fmt::format("{} never came: {}", file.string(),
                                           std::string(std::istreambuf_iterator<char>(in), {})));
    }
    usleep(1000);
  }
}

void write_file(const fs::path& file, std::string_view text) {
  if (const auto written = write_file_atomically(file, text); !written)
    throw std::runtime_error(written.error().message);
}

nanoseconds busy_of(const fs::path& var) {
  const auto reply = sim::ask_seqpacket(var / "run/sim_control.sock", R"({"query":"counters"})", seconds(5));
  if (!reply) throw std::runtime_error(reply.error());
  return microseconds(Json::parse(*reply).at("can").at("busy_us").get<std::int64_t>());
}

/// The sender's results: its frames as echoed, and the peer's flow control as received.
struct Sent {
  std::vector<double> message_ms;  ///< send() to the echo of the last frame
  int failed = 0;
  Bits bits;  ///< of the successful messages
  std::map<std::string, int> errors;
  nanoseconds time{0};
  nanoseconds processor{0};
  std::size_t most_waiting = 0;  ///< frames in the driver and the hub
};

Sent send_all(hw::CanBus& bus, const IsoTpOptions& options) {
  wire::IsoTpChannel channel({.target = receiver_address, .source = sender_address}, settings_of(options));
  Sent sent;
  const nanoseconds processor_before = cpu_time_of(::getpid());
  const MonotonicTime begin = monotonic_now();
  for (int i = 0; i < options.messages; ++i) {
    const Octets message = message_of(options, static_cast<std::uint32_t>(i));
    Bits bits;
    const MonotonicTime asked = monotonic_now();
    if (const auto started = channel.send(message, asked); !started)
      throw std::runtime_error(wire::to_string(started.error()));
    const auto step = [&] {
      testing_support::move_frames(bus, channel, [&](const hw::CanFrame& frame) { bits.add(frame); });
      sent.most_waiting = std::max(sent.most_waiting, bus.unconfirmed());
    };
    for (step(); channel.sending(); step()) await(bus, channel, -1, seconds(1));
    const auto result = channel.take_send_result().value();
    if (result) {
      sent.message_ms.push_back(std::chrono::duration<double, std::milli>(monotonic_now() - asked).count());
      sent.bits += bits;
    } else {
      ++sent.failed;
      ++sent.errors[wire::to_string(result.error())];
    }
  }
  sent.time = monotonic_now() - begin;
  sent.processor = cpu_time_of(::getpid()) - processor_before;
  return sent;
}

double seconds_of(nanoseconds time) {
  return std::chrono::duration<double>(time).count();
}

}  // namespace

Json receive_isotp(const fs::path& var, const IsoTpOptions& options) {
  const Fd signals = termination_signals();
  const auto bus = open_bus(var, receiver_address, sender_address);
  wire::IsoTpChannel channel({.target = sender_address, .source = receiver_address}, settings_of(options));
  write_file(var / "receiver.ready", "");
  std::int64_t right = 0;
  std::int64_t wrong = 0;
  std::int64_t failed = 0;
  std::optional<MonotonicTime> end;
  while (!end || monotonic_now() < *end) {
    await(*bus, channel, end ? -1 : signals.get(), milliseconds(100));
    testing_support::move_frames(*bus, channel, [&](const hw::CanFrame&) {
      if (end) end = monotonic_now() + milliseconds(200);
    });
    for (; channel.messages_waiting() > 0; channel.pop_message()) {
      const OctetView message = channel.front_message();
      const bool same = message.size() == static_cast<std::size_t>(options.octets) &&
                        std::ranges::equal(message, message_of(options, number_of(message)));
      ++(same ? right : wrong);
    }
    if (channel.take_receive_error()) ++failed;
    signalfd_siginfo info{};
    // The last frame may still be in flight.
    if (!end && ::read(signals.get(), &info, sizeof info) == static_cast<ssize_t>(sizeof info))
      end = monotonic_now() + milliseconds(200);
  }
  return {{"right", right}, {"wrong", wrong}, {"failed", failed}};
}

Json measure_isotp(const fs::path& bin, const IsoTpOptions& options) {
  const testing_support::TemporaryFolder folder;
  const std::string refused = options.fifo_priority > 0 ? set_fifo(options.fifo_priority) : "";
  const fs::path& var = folder.path();
  const fs::path deployment_file = var / "deployment.yaml";
  write_file(deployment_file, deployment);
  Child simulator({bin / "hw_sim", "--deployment", deployment_file, "--var", var}, var / "hw_sim.out");
  await_file(var / "run/hw_sim.ready", var / "hw_sim.out");
  Child receiver(
      {bin / "bench_can", "isotp-receiver", "--var", var, "--octets", std::to_string(options.octets),
       "--block-size", std::to_string(options.block_size), "--seed", std::to_string(options.seed),
       "--timeout-ms", std::to_string(options.timeout.count())},
      var / "receiver.out");
  await_file(var / "receiver.ready", var / "receiver.out");
  const auto bus = open_bus(var, sender_address, receiver_address);

  const nanoseconds busy_before = busy_of(var);
  const Sent sent = send_all(*bus, options);
  const nanoseconds busy = busy_of(var) - busy_before;

  receiver.end(SIGTERM);
  simulator.end(SIGTERM);
  std::ifstream in(var / "receiver.out");
  const Json received = Json::parse(in);
  const double octets = received.at("right").get<double>() * options.octets;
  const double time = seconds_of(sent.time);
  const double ideal_time = static_cast<double>(sent.bits.all) / bit_rate;
  const double ideal =
      sent.bits.all == 0 ? 0.0 : static_cast<double>(sent.message_ms.size()) * options.octets / ideal_time;
  Json out{{"payload_octets_per_s", octets / time},
           {"ideal_octets_per_s", ideal},
           {"ratio", ideal == 0 ? 0.0 : octets / time / ideal},
           {"stuff_share", sent.bits.all == 0
                               ? 0.0
                               : static_cast<double>(sent.bits.stuffed) / static_cast<double>(sent.bits.all)},
           {"messages", options.messages},
           {"failed", options.messages - received.at("right").get<int>()},
           {"octets", options.octets},
           {"block_size", options.block_size},
           {"frames_ahead", settings_of(options).frames_ahead},
           {"frames_per_s", static_cast<double>(sent.bits.frames) / time},
           {"bus_busy_share", seconds_of(busy) / time},
           {"fifo_priority", refused.empty() ? Json(options.fifo_priority) : Json(refused)},
           {"duration_s", time},
           {"message_ms", summary(sent.message_ms)},
           {"most_frames_waiting", sent.most_waiting},
           {"sender_processor_share", seconds_of(sent.processor) / time},
           {"receiver", received}};
  out["send_errors"] = Json::object();
  for (const auto& [error, count] : sent.errors) out["send_errors"][error] = count;
  return out;
}

}  // namespace srfs::bench
