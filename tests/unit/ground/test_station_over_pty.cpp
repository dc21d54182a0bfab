// The station and the program over a real pseudo terminal.
#include <array>
#include <cstdio>
#include <fstream>
#include <thread>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>
#include <mission/structures.hpp>
#include <nlohmann/json.hpp>

#include "fake_spacecraft.hpp"
#include "ground/link.hpp"

namespace srfs::ground {
namespace {

using ::testing::HasSubstr;

/// A pseudo terminal whose operator's end stands at VAR/rs422.
class Pty {
 public:
  explicit Pty(const std::filesystem::path& var) : master_(posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC)) {
    grantpt(master_.get());
    unlockpt(master_.get());
    const std::string slave_name = ptsname(master_.get());
    slave_ = Fd(open(slave_name.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC));  // kept: no hang-up between runs
    termios settings{};
    tcgetattr(slave_.get(), &settings);
    cfmakeraw(&settings);
    tcsetattr(slave_.get(), TCSANOW, &settings);
    std::filesystem::create_symlink(slave_name, var / "rs422");
  }
  [[nodiscard]] int fd() const { return master_.get(); }

 private:
  Fd master_;
  Fd slave_;
};

/// Answers every telecommand until the program under test has ended.
void serve(const Pty& pty, FakeSpacecraft& spacecraft, const std::atomic<bool>& over) {
  const auto put = [&](const Octets& octets) {
    static_cast<void>(!write(pty.fd(), octets.data(), octets.size()));
  };
  put(spacecraft.idle());
  while (!over) {
    pollfd wait{pty.fd(), POLLIN, 0};
    if (poll(&wait, 1, 20) <= 0) continue;
    std::array<std::uint8_t, 4096> buffer{};
    const ssize_t got = read(pty.fd(), buffer.data(), buffer.size());
    if (got <= 0) return;
    for (const auto& packet : spacecraft.receive({buffer.data(), static_cast<std::size_t>(got)})) {
      if (packet.service == 8 && packet.application.at(2) == 3) {
        put(spacecraft.verify(packet, 2, *from_hex("0017")));
        continue;
      }
      put(spacecraft.verify(packet, 1));
      put(spacecraft.verify(packet, 3));
      if (packet.service == 17) put(spacecraft.send(1, 17, 2, {}));
      if (packet.service == 15) {
        OctetWriter event;
        event.u16(mission::event::ttc_retrieval_done);
        mission::TtcRetrievalDoneEvent{mission::store::housekeeping, 1, 40}.encode(event);
        OctetWriter stored;
        stored.u16(mission::structure::timing);
        mission::TimingHousekeeping{}.encode(stored);
        put(spacecraft.send(1, 5, 1, event.take()));
        put(spacecraft.send(2, 3, 25, stored.take(), 1));
      }
      put(spacecraft.verify(packet, 7));
    }
  }
}

class GroundProgram : public ::testing::Test {
 protected:
  struct Run {
    int exit_code = -1;
    std::string output;
  };
  /// Runs srfs-ground to its end. @param input its standard input
  Run run(const std::string& arguments, const std::string& input = "") {
    const auto file = var_.path() / "input";
    std::ofstream(file) << input;
    const std::string command = std::string(SRFS_BINARY_DIR) + "/bin/srfs-ground --port " +
                                (var_.path() / "rs422").string() + " " + arguments + " 2>&1 < " +
                                file.string();
    std::atomic<bool> over = false;
    std::thread answering([&] { serve(pty_, spacecraft_, over); });
    Run result;
    FILE* pipe = popen(command.c_str(), "r");
    std::array<char, 4096> chunk{};
    while (pipe != nullptr && fgets(chunk.data(), chunk.size(), pipe) != nullptr)
      result.output += chunk.data();
    if (pipe != nullptr) result.exit_code = WEXITSTATUS(pclose(pipe));
    over = true;
    answering.join();
    return result;
  }
  VarFolder var_;
  Pty pty_{var_.path()};
  FakeSpacecraft spacecraft_{secured_link()};
};

TEST_F(GroundProgram, Pings) {
  const Run ping = run("ping");
  EXPECT_EQ(ping.exit_code, 0) << ping.output;
  EXPECT_THAT(ping.output, HasSubstr("alive, answer after"));
}

TEST_F(GroundProgram, ShowsTheStagesOfATelecommand) {
  const Run tc = run("tc eps.switch_load load=1 state=on --wait");
  EXPECT_EQ(tc.exit_code, 0) << tc.output;
  EXPECT_THAT(tc.output, HasSubstr("eps.switch_load accepted"));
  EXPECT_THAT(tc.output, HasSubstr("eps.switch_load started"));
  EXPECT_THAT(tc.output, HasSubstr("eps.switch_load completed"));
}

TEST_F(GroundProgram, EndsWithOneWhenTheSpacecraftRefuses) {
  const Run tc = run("tc eps.switch_load load=3 state=on --wait");
  EXPECT_EQ(tc.exit_code, 1);
  EXPECT_THAT(tc.output, HasSubstr("rejected: code 23 busy"));
}

TEST_F(GroundProgram, RefusesAnArgumentOutOfRangeBeforeSending) {
  const Run tc = run("tc eps.switch_load load=7 state=on");
  EXPECT_EQ(tc.exit_code, 2);
  EXPECT_THAT(tc.output, HasSubstr("eps.switch_load: argument 'load': 7 is out of range 0..3"));
  EXPECT_FALSE(spacecraft_.last_counter);
}

TEST_F(GroundProgram, RetrievesStoredPackets) {
  const Run retrieve = run("retrieve --from 2026-11-21T08:00:00Z --to 2026-11-21T08:10:00Z");
  EXPECT_EQ(retrieve.exit_code, 0) << retrieve.output;
  EXPECT_THAT(retrieve.output, HasSubstr("timing (stored)"));
  EXPECT_THAT(retrieve.output, HasSubstr("1 of 1 packets received, complete"));
}

TEST_F(GroundProgram, TellsASessionAsJsonLines) {
  const Run session = run(
      "session",
      "ping\ntc eps.switch_load load=2 state=off --wait\ntc eps.switch_load load=9 state=off\nnonsense\n");
  EXPECT_EQ(session.exit_code, 0) << session.output;
  std::map<std::string, int> types;
  int completed = 0;
  std::istringstream lines(session.output);
  for (std::string line; std::getline(lines, line);) {
    const auto json = nlohmann::json::parse(line, nullptr, false);
    ASSERT_TRUE(json.is_object()) << line;
    ++types[json["type"]];
    if (json["type"] == "tc_stage" && json["stage"] == "completed") ++completed;
  }
  EXPECT_EQ(completed, 2) << session.output;
  EXPECT_EQ(types["pong"], 1);
  EXPECT_EQ(types["error"], 2);
  EXPECT_GE(types["stats"], 1);
}

TEST_F(GroundProgram, SaysThatThePortIsBusy) {
  const auto held = Port::open(var_.path() / "rs422", 921600);
  ASSERT_TRUE(held) << held.error();
  const Run ping = run("ping");
  EXPECT_EQ(ping.exit_code, 2);
  EXPECT_THAT(ping.output, HasSubstr("in use by another ground tool"));
}

TEST_F(GroundProgram, SaysHowToMakeAMissingPort) {
  std::filesystem::remove(var_.path() / "rs422");
  const Run ping = run("ping");
  EXPECT_EQ(ping.exit_code, 2);
  EXPECT_THAT(ping.output, HasSubstr("./run sim"));
}

}  // namespace
}  // namespace srfs::ground
