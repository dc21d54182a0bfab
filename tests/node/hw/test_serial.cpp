// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <numeric>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include "base/fd.hpp"
#include "hw/open.hpp"
#include "tests/node/hw/poll_until.hpp"

namespace srfs::hw {
namespace {

/// The far end of a line: a pty whose slave is linked at @p link.
class FarEnd {
 public:
  explicit FarEnd(const std::filesystem::path& link)
      : master_(::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK)) {
    EXPECT_EQ(::grantpt(master_.get()), 0);
    EXPECT_EQ(::unlockpt(master_.get()), 0);
    std::array<char, 64> name{};
    EXPECT_EQ(::ptsname_r(master_.get(), name.data(), name.size()), 0);
    slave_ = name.data();
    std::filesystem::remove(link);
    std::filesystem::create_symlink(slave_, link);
  }
  void write(OctetView octets) {
    EXPECT_EQ(::write(master_.get(), octets.data(), octets.size()), static_cast<ssize_t>(octets.size()));
  }
  Octets read(std::size_t wanted) {
    Octets all;
    poll_until(master_.get(), [&] {
      std::array<std::uint8_t, 4096> buffer{};
      const ssize_t n = ::read(master_.get(), buffer.data(), buffer.size());
      if (n > 0) all.insert(all.end(), buffer.begin(), buffer.begin() + n);
      return all.size() >= wanted;
    });
    return all;
  }
  [[nodiscard]] termios settings() const {
    termios t{};
    ::tcgetattr(master_.get(), &t);
    return t;
  }

 private:
  Fd master_;
  std::string slave_;
};

Octets every_octet() {
  Octets all(256);
  std::iota(all.begin(), all.end(), std::uint8_t{0});
  return all;
}

Octets read_all(SerialPort& port, std::size_t wanted) {
  Octets all;
  poll_until(port.fd(), [&] {
    std::array<std::uint8_t, 100> buffer{};
    const auto n = port.read(buffer);
    if (n) all.insert(all.end(), buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(*n));
    return all.size() >= wanted;
  });
  return all;
}

TEST(SerialLine, CarriesEveryOctetUnchangedBothWays) {
  const TemporaryFolder folder;
  FarEnd far(folder.path() / "tty");
  const auto port = open_serial("serial:tty", 921600, folder.path()).value();
  ASSERT_EQ(port->reason(), "");
  EXPECT_EQ(port->write(every_octet()), 256U);
  EXPECT_EQ(far.read(256), every_octet());
  far.write(every_octet());
  EXPECT_EQ(read_all(*port, 256), every_octet());
  EXPECT_EQ(port->counters().octets_read, 256U);
}

TEST(SerialLine, IsRawEightBitsWithoutFlowControlAtTheSpeedAskedFor) {
  const TemporaryFolder folder;
  const FarEnd far(folder.path() / "tty");
  const auto port = open_serial("serial:tty", 921600, folder.path()).value();
  const termios t = far.settings();
  EXPECT_EQ(::cfgetospeed(&t), static_cast<speed_t>(B921600));
  EXPECT_EQ(t.c_cflag & static_cast<tcflag_t>(CSIZE | CSTOPB | PARENB | CRTSCTS), static_cast<tcflag_t>(CS8));
  EXPECT_EQ(t.c_iflag & static_cast<tcflag_t>(IXON | IXOFF | ICRNL | ISTRIP), 0U);
  EXPECT_EQ(t.c_lflag & static_cast<tcflag_t>(ICANON | ECHO | ISIG), 0U);
  EXPECT_EQ(t.c_oflag & static_cast<tcflag_t>(OPOST), 0U);
}

TEST(SerialLine, WritesOnlyWhatFits) {
  const TemporaryFolder folder;
  const FarEnd far(folder.path() / "tty");
  const auto port = open_serial("serial:tty", 115200, folder.path()).value();
  const Octets much(1 << 20);
  const auto first = port->write(much);
  ASSERT_TRUE(first);
  // The kernel moves accepted octets to the other end at any time, so there may be room again after a
  // refusal.
  std::size_t taken = *first;
  for (int refusals = 0; refusals < 100 && taken < much.size();) {
    const std::size_t more = port->write(much).value();
    taken += more;
    refusals += more == 0 ? 1 : 0;
  }
  EXPECT_LT(taken, much.size()) << "nobody reads";
}

TEST(SerialLine, IsHeldByOneProcessHandleAtATime) {
  const TemporaryFolder folder;
  const FarEnd far(folder.path() / "tty");
  const auto first = open_serial("serial:tty", 115200, folder.path()).value();
  const auto second = open_serial("serial:tty", 115200, folder.path()).value();
  EXPECT_EQ(first->reason(), "");
  EXPECT_THAT(second->reason(), ::testing::AnyOf(::testing::HasSubstr("used by another process"),
                                                 ::testing::HasSubstr("EBUSY")));
}

TEST(SerialLine, OutlivesARestartOfTheOtherEnd) {
  const TemporaryFolder folder;
  auto far = std::make_unique<FarEnd>(folder.path() / "tty");
  const auto port = open_serial("serial:tty", 115200, folder.path()).value();
  const int fd = port->fd();
  far.reset();
  std::array<std::uint8_t, 8> buffer{};
  EXPECT_TRUE(poll_until(fd, [&] { return !port->read(buffer); }));
  EXPECT_NE(port->reason(), "");

  FarEnd again(folder.path() / "tty");
  EXPECT_TRUE(poll_until(fd, [&] { return port->read(buffer).has_value(); }));
  EXPECT_EQ(port->counters().reopened, 1U);
  again.write(every_octet());
  EXPECT_EQ(read_all(*port, 256), every_octet());
}

TEST(SerialLine, IsNoOrdinaryFile) {
  const auto port = open_serial("serial:/dev/null", 115200, "/").value();
  EXPECT_THAT(port->reason(), ::testing::HasSubstr("not a serial line"));
}

}  // namespace
}  // namespace srfs::hw
