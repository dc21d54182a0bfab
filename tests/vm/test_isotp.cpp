// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// lib/wire/isotp over SocketCAN. The peer is Linux' ISO 15765-2 implementation (can-isotp) with its tools.

#include <linux/can/isotp.h>
#include <sys/time.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <thread>
#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/octets.hpp"
#include "hw/open.hpp"
#include "tests/isotp_over_can.hpp"
#include "tests/vm/tool.hpp"
#include "tests/vm/virtual_can.hpp"
#include "wire/isotp.hpp"

namespace srfs::wire {
namespace {

using ::testing::HasSubstr;
using vm::patience;
using vm::VirtualCan;

constexpr std::uint8_t ours = 0x01;
constexpr std::uint8_t linux_peer = 0x11;
constexpr std::uint8_t our_padding = 0xCC;

Octets message_of(std::size_t size) {
  Octets message(size);
  for (std::size_t i = 0; i < size; ++i) message[i] = static_cast<std::uint8_t>(i * 31 + size);
  return message;
}

/// Long time-outs: these tests do not cover time-outs, and the machine may be busy.
IsoTpSettings patient() {
  IsoTpSettings settings;
  settings.n_as = settings.n_bs = settings.n_cr = patience;
  return settings;
}

/// Our end: a channel on a SocketCAN handle, driven by serve().
class OurEnd {
 public:
  explicit OurEnd(const VirtualCan& can, IsoTpSettings settings = patient())
      : bus_(hw::open_can(can.uri(), "/", {hw::isotp_between(ours, linux_peer)}).value()),
        channel_({.target = linux_peer, .source = ours}, settings) {}

  bool serve(const std::function<bool()>& done) {
    MonotonicTime turn = monotonic_now();
    const MonotonicTime end = turn + patience;
    while (!done()) {
      const MonotonicTime now = monotonic_now();
      if (now > end) return false;
      if (now > turn + linux_patience) late_at_ = now;
      turn = now;
      testing_support::move_frames(*bus_, channel_);
      pollfd p{.fd = bus_->fd(), .events = POLLIN, .revents = 0};
      ::poll(&p, 1, channel_.next_deadline() ? 1 : 10);
    }
    return true;
  }
  /// Sends a message and waits for the end of the transfer.
  Result<void, IsoTpError> send(OctetView message) {
    EXPECT_TRUE(channel_.send(message, monotonic_now()));
    EXPECT_TRUE(serve([this] { return !channel_.sending(); }));
    return channel_.take_send_result().value_or(Err(IsoTpError::aborted));
  }
  Octets receive() {
    EXPECT_TRUE(serve([this] { return channel_.messages_waiting() > 0; }));
    const OctetView front = channel_.front_message();
    Octets message(front.begin(), front.end());
    channel_.pop_message();
    return message;
  }
  /// nullopt: this process had no CPU for so long that Linux gave the transfer up.
  std::optional<Octets> receive_unless_late() {
    const auto gave_up = [this] { return late_at_ && monotonic_now() > *late_at_ + 3 * linux_patience; };
    EXPECT_TRUE(serve([&] { return channel_.messages_waiting() > 0 || gave_up(); }));
    if (channel_.messages_waiting() == 0 && late_at_) return std::nullopt;
    return receive();
  }
  IsoTpChannel& channel() { return channel_; }

 private:
  /// ISO 15765-2, N_Bs: Linux waits so long for our flow control.
  static constexpr seconds linux_patience{1};
  std::unique_ptr<hw::CanBus> bus_;
  IsoTpChannel channel_;
  std::optional<MonotonicTime> late_at_;
};

struct LinuxSettings {
  std::uint8_t block_size = 0;
  std::uint8_t separation_code = 0;
  bool pads = true;             ///< pads its frames and requires padding in ours
  std::uint8_t padding = 0xAA;  ///< padding octet of Linux
};

/// One can-isotp socket; each read or write carries a message. Its time-outs are the standard's 1000 ms.
class LinuxEnd {
 public:
  explicit LinuxEnd(const VirtualCan& can, LinuxSettings settings = {}, std::uint8_t own = linux_peer,
                    std::uint8_t peer = ours)
      : socket_(::socket(PF_CAN, SOCK_DGRAM | SOCK_CLOEXEC, CAN_ISOTP)) {
    can_isotp_options options{};
    options.flags = CAN_ISOTP_WAIT_TX_DONE;
    if (settings.pads) {
      options.flags |=
          CAN_ISOTP_TX_PADDING | CAN_ISOTP_RX_PADDING | CAN_ISOTP_CHK_PAD_LEN | CAN_ISOTP_CHK_PAD_DATA;
    }
    options.txpad_content = settings.padding;
    options.rxpad_content = our_padding;
    can_isotp_fc_options flow{};
    flow.bs = settings.block_size;
    flow.stmin = settings.separation_code;
    set(CAN_ISOTP_OPTS, options);
    set(CAN_ISOTP_RECV_FC, flow);
    const timeval limit{.tv_sec = patience.count() / 1000, .tv_usec = 0};
    ::setsockopt(socket_.get(), SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(::if_nametoindex(can.name().c_str()));
    address.can_addr.tp.tx_id = CAN_EFF_FLAG | normal_fixed_id({.target = peer, .source = own});
    address.can_addr.tp.rx_id = CAN_EFF_FLAG | normal_fixed_id({.target = own, .source = peer});
    EXPECT_EQ(::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  }

  /// @return 0, or the errno of the failed transfer
  int send(OctetView message) {
    return ::write(socket_.get(), message.data(), message.size()) < 0 ? errno : 0;
  }
  Octets receive() {
    Octets message(isotp_max_message + 1);
    const auto size = ::read(socket_.get(), message.data(), message.size());
    message.resize(static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
    return message;
  }

 private:
  template <typename Option>
  void set(int name, const Option& option) {
    EXPECT_EQ(::setsockopt(socket_.get(), SOL_CAN_ISOTP, name, &option, sizeof option), 0);
  }
  Fd socket_;
};

constexpr std::array<std::size_t, 5> sizes{1, 7, 8, 100, 4095};
/// Whether a message is short enough for the test: with a separation time a long message takes seconds.
bool is_short(std::size_t size, std::uint8_t separation_code) {
  return size <= 1000 || separation_code == 0;
}

/// Block size, code of STmin, whether Linux pads.
using FlowControl = std::tuple<std::uint8_t, std::uint8_t, bool>;
class IsoTpWithLinux : public ::testing::TestWithParam<FlowControl> {};

TEST_P(IsoTpWithLinux, TakesWhatLinuxSendsAtTheBlockSizeAndSeparationItAskedFor) {
  const auto [block_size, code, pads] = GetParam();
  const VirtualCan can;
  IsoTpSettings settings = patient();
  settings.block_size = block_size;
  settings.separation = separation_time(code);
  for (const std::size_t size : sizes) {
    if (!is_short(size, code)) continue;
    OurEnd here(can, settings);
    LinuxEnd there(can, {.pads = pads});
    int error = -1;
    std::thread sender([&] { error = there.send(message_of(size)); });
    EXPECT_EQ(here.receive(), message_of(size)) << size << " octets";
    sender.join();
    EXPECT_EQ(error, 0) << size << " octets";
  }
}

TEST_P(IsoTpWithLinux, SendsWhatLinuxTakesAtTheBlockSizeAndSeparationLinuxAskedFor) {
  const auto [block_size, code, pads] = GetParam();
  const VirtualCan can;
  for (const std::size_t size : sizes) {
    if (!is_short(size, code)) continue;
    OurEnd here(can);
    LinuxEnd there(can, {.block_size = block_size, .separation_code = code, .pads = pads});
    const auto sent = here.send(message_of(size));
    EXPECT_TRUE(sent) << size << " octets: " << to_string(sent.error());
    EXPECT_EQ(there.receive(), message_of(size)) << size << " octets";
    EXPECT_EQ(here.channel().counters().ignored_pdus, 0U);
  }
}

std::string name_of(const ::testing::TestParamInfo<FlowControl>& test) {
  const auto [block_size, code, pads] = test.param;
  return fmt::format("{}_{:02X}_{}", block_size, code, pads ? "padded" : "unpadded");
}
INSTANTIATE_TEST_SUITE_P(BlockSizeStminPadding, IsoTpWithLinux,
                         ::testing::Values(FlowControl{0, 0, true}, FlowControl{1, 0, true},
                                           FlowControl{8, 0, false}, FlowControl{0, 0xF5, true},
                                           FlowControl{3, 2, true}, FlowControl{255, 20, false}),
                         name_of);

TEST(IsoTpAndLinux, TalkInBothDirectionsAtOnce) {
  const VirtualCan can;
  OurEnd here(can);
  LinuxEnd there(can);
  int error = -1;
  std::thread sender([&] { error = there.send(message_of(4095)); });
  EXPECT_TRUE(here.send(message_of(4000)));
  EXPECT_EQ(here.receive(), message_of(4095));
  sender.join();
  EXPECT_EQ(error, 0);
  EXPECT_EQ(there.receive(), message_of(4000));
}

TEST(IsoTpAndLinux, OverflowEndsTheTransferOfTheLinuxSender) {
  const VirtualCan can;
  IsoTpSettings settings = patient();
  settings.receive_queue = 1;
  OurEnd here(can, settings);
  LinuxEnd there(can);
  ASSERT_EQ(there.send(message_of(7)), 0);
  EXPECT_TRUE(here.serve([&] { return here.channel().messages_waiting() == 1; }));

  std::atomic<int> error = -1;
  std::thread sender([&] { error = there.send(message_of(100)); });
  EXPECT_TRUE(here.serve([&] { return error >= 0; }));
  sender.join();
  EXPECT_EQ(error, EMSGSIZE);
  EXPECT_EQ(here.channel().counters().receive_overflows, 1U);
  EXPECT_EQ(here.receive(), message_of(7)) << "the message that was there is untouched";
}

TEST(IsoTpAndLinux, WaitFramesHoldTheLinuxSenderUntilThereIsRoom) {
  const VirtualCan can;
  IsoTpSettings settings = patient();
  settings.receive_queue = 1;
  settings.wait_frames_when_full = 250;
  settings.wait_interval = milliseconds(100);
  OurEnd here(can, settings);
  LinuxEnd there(can);
  ASSERT_EQ(there.send(message_of(7)), 0);
  EXPECT_TRUE(here.serve([&] { return here.channel().messages_waiting() == 1; }));

  std::atomic<int> error = -1;
  std::thread sender([&] { error = there.send(message_of(100)); });
  EXPECT_TRUE(here.serve([&] { return here.channel().counters().frames_sent >= 3; }));
  EXPECT_EQ(error, -1) << "it waits";
  EXPECT_EQ(here.receive(), message_of(7));
  EXPECT_EQ(here.receive(), message_of(100));
  EXPECT_TRUE(here.serve([&] { return error >= 0; }));
  sender.join();
  EXPECT_EQ(error, 0);
}

// --- can-utils

constexpr std::uint32_t to_linux_id = normal_fixed_id({.target = linux_peer, .source = ours});
const std::string to_linux = fmt::format("{:08X}", to_linux_id);
const std::string from_linux = fmt::format("{:08X}", normal_fixed_id({.target = ours, .source = linux_peer}));

std::string as_hex(OctetView message) {
  std::string text;
  for (const std::uint8_t octet : message) text += fmt::format("{:02X} ", octet);
  return text;
}

bool has_line_end(const std::string& text) {
  return text.find('\n') != std::string::npos;
}

TEST(IsoTpAndCanUtils, IsotpsendIsUnderstood) {
  const VirtualCan can;
  for (const std::size_t size : sizes) {
    std::optional<Octets> received;
    for (int late = 0; !received && late < 5; ++late) {
      OurEnd here(can);
      vm::Tool tool({"isotpsend", "-s", from_linux, "-d", to_linux, "-p", "AA:CC", "-P", "a", can.name()});
      tool.type(as_hex(message_of(size)) + "\n");
      received = here.receive_unless_late();
    }
    EXPECT_EQ(received, message_of(size)) << size << " octets";
  }
}

TEST(IsoTpAndCanUtils, IsotprecvUnderstandsInBlocksWithSeparation) {
  const VirtualCan can;
  for (const std::size_t size : sizes) {
    vm::Tool tool({"isotprecv", "-s", from_linux, "-d", to_linux, "-p", "AA:CC", "-P", "a", "-b", "8", "-m",
                   "F1", can.name()});
    ASSERT_TRUE(vm::await_listener(can.name(), to_linux_id)) << "isotprecv does not listen";
    OurEnd here(can);
    const auto sent = here.send(message_of(size));
    EXPECT_TRUE(sent) << size << " octets: " << to_string(sent.error());
    EXPECT_EQ(tool.output(has_line_end), as_hex(message_of(size)) + "\n");
  }
}

TEST(IsoTpAndCanUtils, IsotpdumpReadsEveryFrameOfATransfer) {
  const VirtualCan can;
  vm::Tool dump({"stdbuf", "-oL", "isotpdump", "-s", to_linux, "-d", from_linux, can.name()});
  ASSERT_TRUE(vm::await_listener(can.name(), to_linux_id)) << "isotpdump does not listen";
  OurEnd here(can);
  LinuxEnd there(can, {.block_size = 8});
  EXPECT_TRUE(here.send(message_of(100)));
  const std::string last = "sn: E";  // 6 octets in the first frame, 7 in each of the next fourteen
  const std::string text =
      dump.output([&](const std::string& said) { return said.find(last) != std::string::npos; });
  EXPECT_THAT(text, HasSubstr("[FF] ln: 100"));
  EXPECT_THAT(text, HasSubstr("[FC] FC: 0 = CTS # BS: 8 # STmin: 0x00"));
  EXPECT_THAT(text, HasSubstr("[CF] " + last));
}

// --- throughput

/// Throughput in octets per second with messages of 4095 octets.
double octets_per_second(const std::function<void()>& one, int count) {
  const MonotonicTime begin = monotonic_now();
  for (int i = 0; i < count; ++i) one();
  return 4095.0 * count / std::chrono::duration<double>(monotonic_now() - begin).count();
}

// The test reports the throughput without a limit: scheduling on an emulated processor does not represent a
// board.
TEST(IsoTpAndLinux, ThroughputBesideLinuxsOwn) {
  const VirtualCan can;
  constexpr int count = 20;
  const Octets message = message_of(4095);
  double native = 0;
  {
    LinuxEnd sender(can, {.padding = our_padding}, ours, linux_peer);
    LinuxEnd receiver(can, {.padding = our_padding});
    std::thread reading([&] {
      for (int i = 0; i < count; ++i) EXPECT_EQ(receiver.receive(), message);
    });
    native = octets_per_second([&] { EXPECT_EQ(sender.send(message), 0); }, count);
    reading.join();
  }
  double sending = 0;
  {
    OurEnd here(can);
    LinuxEnd there(can);
    std::thread reading([&] {
      for (int i = 0; i < count; ++i) EXPECT_EQ(there.receive(), message);
    });
    sending = octets_per_second([&] { EXPECT_TRUE(here.send(message)); }, count);
    reading.join();
  }
  double receiving = 0;
  {
    // No bit rate slows Linux down here. A whole message sent at once would overflow the socket buffer while
    // this process waits for a processor.
    IsoTpSettings settings = patient();
    settings.block_size = 64;
    OurEnd here(can, settings);
    LinuxEnd there(can);
    // Linux aborts a transfer (ECOMM) when our flow control is a second late. On a busy machine this process
    // may wait that long for a processor, so the message is sent again.
    constexpr int attempts = 5;
    std::thread writing([&] {
      for (int i = 0; i < count; ++i)
        for (int attempt = 0; attempt < attempts && there.send(message) != 0; ++attempt) continue;
    });
    receiving = octets_per_second([&] { EXPECT_EQ(here.receive(), message); }, count);
    writing.join();
  }
  fmt::print(
      "ISO-TP throughput on vcan, messages of 4095 octets: Linux to Linux {:.0f} kB/s, "
      "SRFS to Linux {:.0f} kB/s (ratio {:.2f}), Linux to SRFS in blocks of 64 {:.0f} kB/s (ratio {:.2f})\n",
      native / 1e3, sending / 1e3, sending / native, receiving / 1e3, receiving / native);
  std::fflush(stdout);
}

}  // namespace
}  // namespace srfs::wire
