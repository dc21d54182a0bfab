// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The station and the srfs-ground program over a real pseudo terminal.
#include <array>
#include <cstdio>
#include <fstream>
#include <functional>
#include <numeric>
#include <thread>
#include <utility>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>
#include <mission/structures.hpp>
#include <nlohmann/json.hpp>

#include "base/child_process.hpp"
#include "base/file.hpp"
#include "fake_server.hpp"
#include "fake_spacecraft.hpp"
#include "ground/bridge.hpp"
#include "ground/link.hpp"

namespace srfs::ground {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

/// A pseudo terminal whose operator end is VAR/rs422.
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

/// The spacecraft's side of an installation: receives the file and reports the outcome the test selects.
class Board {
 public:
  enum class Ending : std::uint8_t { installed, candidate, failed, refused, only_when_asked };

  explicit Board(const std::filesystem::path& var) {
    std::filesystem::create_directories(var / "board");
    auto opened = cfdp::TransferFolders::open(var / "board/files", var / "board/cfdp",
                                              {.own_entity = 2, .peer_entity = 1}, 1, monotonic_now());
    if (opened) files_ = std::move(*opened);
  }

  void take_files(FakeSpacecraft& spacecraft, const std::function<void(const Octets&)>& put) {
    for (const Octets& pdu : std::exchange(spacecraft.pdus, {})) files_->on_pdu(pdu, monotonic_now());
    while (const auto pdu = files_->next_pdu(200, monotonic_now())) put(spacecraft.send_pdu(*pdu));
    files_->entity().advance(monotonic_now());
    static_cast<void>(files_->take_news());
  }

  void answer(const wire::TcPacket& packet, FakeSpacecraft& spacecraft,
              const std::function<void(const Octets&)>& put) {
    OctetReader in(packet.application);
    const unsigned function = in.u16();
    put(spacecraft.verify(packet, 1));
    put(spacecraft.verify(packet, 3));
    if (function == mission::PackageReport::function_id) {
      mission::UpdateStatusHousekeeping status;
      status.file = file;
      status.step = mission::UpdateStep::installed;
      put(spacecraft.send(mission::apid::maintenance, 3, 25,
                          with_id(mission::structure::update_status, status)));
      put(spacecraft.verify(packet, 7));
      return;
    }
    if (ending == Ending::refused) {
      mission::UpdateRefusedEvent event;
      event.file = file;
      event.reason = "signed with another key";
      put(spacecraft.verify(packet, 8, *from_hex("008d")));
      put(tell(spacecraft, event));
      return;
    }
    mission::UpdateStepEvent step;
    step.file = file;
    step.step = mission::UpdateStep::build;
    put(tell(spacecraft, step));
    put(spacecraft.verify(packet, 7));
    if (ending == Ending::installed) {
      mission::UpdateInstalledEvent event;
      event.file = file;
      event.node = "payload_eps";
      event.version = 3;
      put(tell(spacecraft, event));
    } else if (ending == Ending::candidate) {
      mission::UpdateCandidateEvent event;
      event.file = file;
      put(tell(spacecraft, event));
    } else if (ending == Ending::failed) {
      mission::UpdateFailedEvent event;
      event.file = file;
      event.step = mission::UpdateStep::build;
      event.reason = "main.cpp:1: error";
      put(tell(spacecraft, event));
    }
  }

  Ending ending = Ending::installed;
  std::string file;

 private:
  template <class Fields>
  static Octets with_id(std::uint16_t id, const Fields& fields) {
    OctetWriter out;
    out.u16(id);
    fields.encode(out);
    return out.take();
  }
  template <class Event>
  static Octets tell(FakeSpacecraft& spacecraft, const Event& event) {
    return spacecraft.send(mission::apid::maintenance, 5, 1, with_id(Event::event_id, event));
  }
  std::unique_ptr<cfdp::TransferFolders> files_;
};

/// The function id of a telecommand (8,1).
unsigned in_function(const wire::TcPacket& packet) {
  OctetReader in(packet.application);
  return in.u16();
}

/// Answers every telecommand until the program under test has ended.
void serve(const Pty& pty, FakeSpacecraft& spacecraft, const std::atomic<bool>& over,
           Board* board = nullptr) {
  const auto put = [&](const Octets& octets) {
    static_cast<void>(!write(pty.fd(), octets.data(), octets.size()));
  };
  put(spacecraft.idle());
  static Octets schedule;  // kept from one run of the tool to the next
  while (!over) {
    pollfd wait{pty.fd(), POLLIN, 0};
    if (board != nullptr) board->take_files(spacecraft, put);
    if (poll(&wait, 1, 20) <= 0) continue;
    std::array<std::uint8_t, 4096> buffer{};
    const ssize_t got = read(pty.fd(), buffer.data(), buffer.size());
    if (got <= 0) return;
    const auto packets = spacecraft.receive({buffer.data(), static_cast<std::size_t>(got)});
    put(spacecraft.idle());  // the CLCW
    for (const auto& packet : packets) {
      if (board != nullptr && packet.apid == mission::apid::maintenance) {
        board->answer(packet, spacecraft, put);
        continue;
      }
      if (packet.service == 8 && packet.application.size() > 2 && packet.application.at(2) == 3) {
        put(spacecraft.verify(packet, 2, *from_hex("0017")));
        continue;
      }
      put(spacecraft.verify(packet, 1));
      put(spacecraft.verify(packet, 3));
      if (packet.service == 3 && packet.subtype == 27 && !spacecraft.structures.empty()) {
        OctetReader asked(packet.application);
        static_cast<void>(asked.u16());
        const auto report = spacecraft.report_of(asked.u16());
        if (report) put(*report);
        put(report ? spacecraft.verify(packet, 7) : spacecraft.verify(packet, 8, *from_hex("0017")));
        continue;
      }
      if (packet.service == 17) put(spacecraft.send(1, 17, 2, {}));
      if (packet.service == 15 && packet.subtype == 12 && spacecraft.reports) {
        for (std::uint16_t store = 1; store <= 3; ++store)
          put(spacecraft.send(1, 15, 13, mission::PacketStoreSummary{.stores = 1, .store = store}.encoded()));
      }
      if (packet.apid == mission::apid::maintenance &&
          in_function(packet) == mission::PackageReport::function_id && spacecraft.reports) {
        OctetWriter status;
        status.u16(mission::structure::update_status);
        mission::UpdateStatusHousekeeping{.build_ms = UINT32_MAX}.encode(status);
        put(spacecraft.verify(packet, 7));
        put(spacecraft.send(mission::apid::maintenance, 3, 25, status.take()));
        continue;
      }
      if (packet.service == 11 && packet.subtype == 26)
        put(spacecraft.send(1, 11, 27, *from_hex("00010101")));
      if (packet.service == 15 && packet.subtype == 9) {
        OctetWriter event;
        event.u16(mission::event::ttc_retrieval_done);
        mission::TtcRetrievalDoneEvent{mission::store::housekeeping, 1, 40}.encode(event);
        OctetWriter stored;
        stored.u16(mission::structure::timing);
        mission::TimingHousekeeping{}.encode(stored);
        put(spacecraft.send(1, 5, 1, event.take()));
        put(spacecraft.send(2, 3, 25, stored.take(), 1));
      }
      if (packet.service == 11 && packet.subtype == 16) put(spacecraft.send(1, 11, 10, schedule));
      put(spacecraft.verify(packet, 7));
      if (packet.service == 11 && packet.subtype == 4) {
        schedule = packet.application;  // same layout as the detail report
        const auto request = wire::parse_tc_packet(OctetView(packet.application).subspan(2 + 1 + 8));
        if (!request) continue;
        for (const int subtype : {1, 3, 7})
          put(spacecraft.verify(*request, static_cast<std::uint8_t>(subtype)));
      }
    }
  }
}

enum class Way : std::uint8_t { direct, served };

class ProgramOverPty : public ::testing::Test {
 protected:
  void start_server() {
    auto started = ChildProcess::start({std::string(SRFS_BINARY_DIR) + "/bin/srfs-ground", "--port",
                                        (var_.path() / "rs422").string(), "--t1", "0.2", "--transmissions",
                                        "200", "serve"});
    ASSERT_TRUE(started) << started.error();
    server_.emplace(std::move(*started));
    // Its first line says that it listens.
    std::array<char, 512> line{};
    pollfd wait{server_->output(), POLLIN, 0};
    ASSERT_EQ(poll(&wait, 1, 30'000), 1);
    ASSERT_GT(read(server_->output(), line.data(), line.size()), 0);
  }
  struct Run {
    int exit_code = -1;
    std::string output;
  };
  /// Runs srfs-ground until it exits. @param input its standard input
  Run run(const std::string& arguments, const std::string& input = "", Board* board = nullptr) {
    const auto file = var_.path() / "input";
    std::ofstream(file) << input;
    return run_with(file, arguments, board);
  }
  /// The same, with a terminal as standard input.
  Run run_at_terminal(const std::string& arguments, const std::string& typed) {
    const Fd terminal(posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC));
    grantpt(terminal.get());
    unlockpt(terminal.get());
    const std::string name = ptsname(terminal.get());
    const Fd kept(open(name.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC));
    EXPECT_EQ(write(terminal.get(), typed.data(), typed.size()), static_cast<ssize_t>(typed.size()));
    return run_with(name, arguments, nullptr);
  }
  Run run_with(const std::filesystem::path& input, const std::string& arguments, Board* board) {
    const std::string command = std::string(SRFS_BINARY_DIR) + "/bin/srfs-ground --port " +
                                (var_.path() / "rs422").string() + " " + arguments + " 2>&1 < " +
                                input.string();
    std::atomic<bool> over = false;
    std::thread answering([&] { serve(pty_, spacecraft_, over, board); });
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
  FakeSpacecraft spacecraft_{sealed_link()};
  std::optional<ChildProcess> server_;
};

/// Every test runs twice: the program owns the line, and a server does.
class GroundProgram : public ProgramOverPty, public ::testing::WithParamInterface<Way> {
 protected:
  void SetUp() override {
    if (GetParam() == Way::served) start_server();
  }
};
INSTANTIATE_TEST_SUITE_P(Program, GroundProgram, ::testing::Values(Way::direct, Way::served),
                         [](const auto& way) { return way.param == Way::direct ? "Direct" : "Served"; });

TEST_P(GroundProgram, Pings) {
  const Run ping = run("ping");
  EXPECT_EQ(ping.exit_code, 0) << ping.output;
  EXPECT_THAT(ping.output, HasSubstr("alive, answer after"));
}

TEST_P(GroundProgram, ShowsTheStagesOfATelecommand) {
  const Run tc = run("tc eps.switch_load load=1 state=on --wait");
  EXPECT_EQ(tc.exit_code, 0) << tc.output;
  EXPECT_THAT(tc.output, HasSubstr("eps.switch_load accepted"));
  EXPECT_THAT(tc.output, HasSubstr("eps.switch_load started"));
  EXPECT_THAT(tc.output, HasSubstr("eps.switch_load completed"));
}

TEST_P(GroundProgram, SchedulesATimeTaggedTelecommandAndFollowsItToItsEnd) {
  const Run scheduled = run("tc eps.switch_load load=1 state=on --at 2030-01-01T00:00:00Z");
  EXPECT_EQ(scheduled.exit_code, 0) << scheduled.output;
  EXPECT_THAT(scheduled.output, HasSubstr("schedule.insert completed"));
  EXPECT_THAT(scheduled.output, HasSubstr("eps.switch_load scheduled"));

  const Run waited = run("tc eps.switch_load load=1 state=on --at +1s --wait");
  EXPECT_EQ(waited.exit_code, 0) << waited.output;
  EXPECT_THAT(waited.output, HasSubstr("eps.switch_load completed"));
  EXPECT_EQ(run("tc eps.switch_load load=1 state=on --at tomorrow").exit_code, 2);

  const Run bad = run("tc eps.switch_load load=1 state=on --at 2100-01-01T00:00:00Z");
  EXPECT_EQ(bad.exit_code, 2) << bad.output;
  EXPECT_THAT(bad.output, HasSubstr("outside the link's time"));
}

TEST_P(GroundProgram, ListsTheScheduleAndChangesIt) {
  ASSERT_EQ(run("tc eps.switch_load load=1 state=on --at 2030-01-01T00:00:00Z").exit_code, 0);
  const Run list = run("schedule");
  EXPECT_EQ(list.exit_code, 0) << list.output;
  EXPECT_THAT(list.output, HasSubstr("schedule: 1 activities"));
  EXPECT_THAT(list.output, HasSubstr("2030-01-01T00:00:00.000Z"));
  EXPECT_THAT(list.output, HasSubstr("apid 17"));
  EXPECT_THAT(list.output, HasSubstr("eps.switch_load load=1 state=on"));
  for (const char* action : {"enable", "disable", "reset", "delete 17 3", "delete 17 3 0", "shift 60",
                             "shift -60 17 3", "groups"}) {
    const Run done = run(std::string("schedule ") + action);
    EXPECT_EQ(done.exit_code, 0) << action << ": " << done.output;
  }
  for (const char* action : {"delete", "delete 17", "shift", "shift 1 2", "list 4", "sort"})
    EXPECT_EQ(run(std::string("schedule ") + action).exit_code, 2) << action;
}

TEST_P(GroundProgram, ShowsTheReportThatATelecommandOrders) {
  const Run summary = run("tc storage.summary");
  EXPECT_EQ(summary.exit_code, 0) << summary.output;
  EXPECT_THAT(summary.output, HasSubstr("storage.summary completed"));
  for (const char* store : {"housekeeping", "events", "verification"})
    EXPECT_THAT(summary.output, ContainsRegex(std::string("store +") + store)) << "every one of them";
  EXPECT_THAT(summary.output, ContainsRegex("open_start +unknown")) << "not a date of 1957";

  const Run status = run("tc package.report");
  EXPECT_EQ(status.exit_code, 0) << status.output;
  EXPECT_THAT(status.output, ContainsRegex("build_ms +unknown\n"))
      << "also when it comes after the completion";

  const Run json = run("--json tc package.report");
  EXPECT_EQ(json.exit_code, 0) << json.output;
  std::optional<nlohmann::json> told;
  std::istringstream lines(json.output);
  for (std::string line; std::getline(lines, line);) {
    auto one = nlohmann::json::parse(line);
    if (one.value("structure", "") == "update_status") told = one;
  }
  ASSERT_TRUE(told) << json.output;
  EXPECT_TRUE((*told)["fields"]["build_ms"].is_null());

  EXPECT_THAT(run("tc ttc.ping").output, HasSubstr("are-you-alive report"));
}

TEST_P(GroundProgram, SaysThatAnOrderedReportDidNotCome) {
  spacecraft_.reports = false;
  const Run summary = run("tc storage.summary");
  EXPECT_EQ(summary.exit_code, 1) << summary.output;
  EXPECT_THAT(summary.output,
              HasSubstr("completed, but no packet of structure packet_store_summary received within 5 s"));
  EXPECT_EQ(run("tc storage.summary --no-report").exit_code, 0);
  const Run faults = run("tc ring.report_faults");
  EXPECT_EQ(faults.exit_code, 0) << faults.output;
  EXPECT_THAT(faults.output, HasSubstr("nothing to report, or lost on the link"));
}

TEST_P(GroundProgram, ShowsOrderedReportsInAScriptAndMissesThem) {
  const auto script = var_.path() / "script";
  std::ofstream(script) << "tc package.report\n";
  const Run shown = run("script " + script.string());
  EXPECT_EQ(shown.exit_code, 0) << shown.output;
  EXPECT_THAT(shown.output, HasSubstr("update_status (count"));
  spacecraft_.reports = false;
  const Run missed = run("script " + script.string());
  EXPECT_EQ(missed.exit_code, 1) << missed.output;
  EXPECT_THAT(missed.output, HasSubstr("NOT as expected"));
}

TEST_P(GroundProgram, EndsWithOneWhenTheSpacecraftRefuses) {
  const Run tc = run("tc eps.switch_load load=3 state=on --wait");
  EXPECT_EQ(tc.exit_code, 1);
  EXPECT_THAT(tc.output, HasSubstr("rejected: code 23 busy"));
}

TEST_P(GroundProgram, ChecksWhatItIsToSendBeforeItOpensThePort) {
  std::filesystem::remove(var_.path() / "rs422");
  std::ofstream(var_.path() / "file") << "content";
  const std::string file = (var_.path() / "file").string();
  const std::vector<std::pair<std::string, std::string>> wrong{
      {"tc eps.switch_load load=7 state=on", "out of range 0..3"},
      {"tc eps.switch_lode", "no telecommand is called"},
      {"arm eps.power_cycle_peripheral off_ms=x", "not a whole number"},
      {"retrieve --from yesterday --to 2026-11-21T08:00:00Z", "not a UTC time"},
      {"retrieve --store attic --from 2026-11-21T08:00:00Z --to 2026-11-21T08:00:00Z", "no packet store"},
      {"param set timing.late_tick_ms", "expected NODE.PARAMETER=VALUE"},
      {"param set timing.late_tick_ms=0", "out of range"},
      {"param restore ttc 0", "out of range"},
      {"remote ls " + std::string(101, 'x'), "at most 100"},
      {"schedule delete 17 99999", "out of range"},
      {"put " + file + " a/b", "a name on board contains no '/'"},
      {"bridge --tm nonsense", "expected [HOST:]PORT"}};
  for (const auto& [arguments, message] : wrong) {
    const Run refused = run(arguments);
    EXPECT_EQ(refused.exit_code, 2) << arguments << ": " << refused.output;
    EXPECT_THAT(refused.output, HasSubstr(message)) << arguments;
    EXPECT_THAT(refused.output, Not(HasSubstr("rs422"))) << arguments;
  }
}

TEST_P(GroundProgram, AsksAtATerminalBeforeAHazardousTelecommandAndSaysWhatBecameOfIt) {
  for (const char* answer : {"y\n", "yes\n", "YES\n"}) {
    const Run sent = run_at_terminal("tc eps.power_cycle_peripheral --wait", answer);
    EXPECT_EQ(sent.exit_code, 0) << answer << sent.output;
    EXPECT_THAT(sent.output, HasSubstr("is hazardous. Arm it and send it?"));
    EXPECT_THAT(sent.output, HasSubstr("ttc.arm completed"));
    EXPECT_THAT(sent.output, HasSubstr("eps.power_cycle_peripheral completed"));
  }
  spacecraft_.last_counter.reset();
  for (const char* answer : {"n\n", "\n", "yesterday\n"}) {
    const Run refused = run_at_terminal("tc eps.power_cycle_peripheral --wait", answer);
    EXPECT_EQ(refused.exit_code, 1) << answer << refused.output;
    EXPECT_THAT(refused.output, HasSubstr("nothing was sent: the answer was not yes"));
  }
  EXPECT_FALSE(spacecraft_.last_counter);
}

TEST_P(GroundProgram, TellsOfTheAdServiceOnlyWhenItIsUsedOrAskedFor) {
  const Run tc = run("tc eps.switch_load load=1 state=on --wait");
  EXPECT_EQ(tc.exit_code, 0) << tc.output;
  EXPECT_THAT(tc.output, Not(HasSubstr("AD service")));
  EXPECT_THAT(run("clcw").output, HasSubstr("AD service off: FOP-1"));
  EXPECT_THAT(run("--ad --t1 0.2 --transmissions 200 tc eps.switch_load load=1 state=on --wait").output,
              HasSubstr("AD service on: FOP-1"));
}

TEST_P(GroundProgram, ListsRangesWithAllTheirDigits) {
  const Run list = run("list image.capture");
  EXPECT_EQ(list.exit_code, 0) << list.output;
  EXPECT_THAT(list.output, HasSubstr(", 1 to 4294967295\n"));
  EXPECT_THAT(list.output, HasSubstr(", 0 to 60 dB [0]"));
  EXPECT_THAT(run("list").output, Not(ContainsRegex("[0-9]e[+-][0-9]")));
  EXPECT_THAT(run("param list").output, Not(ContainsRegex("[0-9]e[+-][0-9]")));
}

TEST_P(GroundProgram, RefusesAnArgumentOutOfRangeBeforeSending) {
  const Run tc = run("tc eps.switch_load load=7 state=on");
  EXPECT_EQ(tc.exit_code, 2);
  EXPECT_THAT(tc.output, HasSubstr("eps.switch_load: argument 'load': 7 is out of range 0..3"));
  EXPECT_FALSE(spacecraft_.last_counter);
}

TEST_P(GroundProgram, RetrievesStoredPackets) {
  const Run retrieve = run("retrieve --from 2026-11-21T08:00:00Z --to 2026-11-21T08:10:00Z");
  EXPECT_EQ(retrieve.exit_code, 0) << retrieve.output;
  EXPECT_THAT(retrieve.output, HasSubstr("timing (stored)"));
  EXPECT_THAT(retrieve.output, HasSubstr("1 of 1 packets received, complete"));
}

TEST_P(GroundProgram, TellsASessionAsJsonLines) {
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

TEST_P(GroundProgram, RepeatsLostFramesUntilEachTelecommandArrivedOnce) {
  spacecraft_.farm.vr = 250;
  spacecraft_.lose_ad_frames = 3;
  std::string lines = "ad on\n";
  for (int i = 0; i < 12; ++i) lines += "tc eps.switch_load load=2 state=off\n";
  const Run session = run("--t1 0.2 --transmissions 200 session", lines);
  EXPECT_EQ(session.exit_code, 0) << session.output;
  std::vector<std::uint64_t> completed;
  nlohmann::json cop;
  std::istringstream out(session.output);
  for (std::string line; std::getline(out, line);) {
    const auto json = nlohmann::json::parse(line);
    if (json["type"] == "tc_stage" && json["stage"] == "completed") completed.push_back(json["line"]);
    if (json["type"] == "stats") cop = json["cop"];
  }
  std::vector<std::uint64_t> all(12);
  std::iota(all.begin(), all.end(), 2U);
  EXPECT_EQ(completed, all) << "in order, each once";
  EXPECT_EQ(spacecraft_.farm.vr, (250 + 12) % 256);
  EXPECT_TRUE(spacecraft_.last_ad_counter) << "AD frames have their own association";
  EXPECT_GE(cop["repeated"], 3);
  EXPECT_EQ(cop["service"], "on");
}

TEST_P(GroundProgram, SendsASingleTelecommandByTheAdService) {
  spacecraft_.lose_ad_frames = 1;
  const Run tc = run("--ad --t1 0.2 --transmissions 200 tc eps.switch_load load=1 state=on --wait");
  EXPECT_EQ(tc.exit_code, 0) << tc.output;
  EXPECT_THAT(tc.output, HasSubstr("AD service on"));
  EXPECT_EQ(spacecraft_.farm.vr, 1);
}

TEST_P(GroundProgram, SaysThatTheFarmIsLockedOutAndUnlocksIt) {
  spacecraft_.farm = {.mode = wire::FarmMode::lockout, .vr = 77, .lockout = true};
  const Run refused = run("--ad --t1 0.2 --transmissions 200 tc eps.switch_load load=1 state=on --wait");
  EXPECT_EQ(refused.exit_code, 1) << refused.output;
  EXPECT_THAT(refused.output, HasSubstr("locked out: unlock"));
  EXPECT_THAT(refused.output, HasSubstr("not_sent"));

  const Run clcw = run("--json clcw");
  EXPECT_EQ(clcw.exit_code, 0) << clcw.output;
  EXPECT_THAT(clcw.output, HasSubstr("\"lockout\":true"));

  const Run unlock = run("--t1 0.2 --transmissions 200 unlock");
  EXPECT_EQ(unlock.exit_code, 0) << unlock.output;
  EXPECT_FALSE(spacecraft_.farm.lockout);
  EXPECT_EQ(spacecraft_.farm.vr, 77);

  const Run set_vr = run("--t1 0.2 --transmissions 200 setvr 5");
  EXPECT_EQ(set_vr.exit_code, 0) << set_vr.output;
  EXPECT_EQ(spacecraft_.farm.vr, 5);
  EXPECT_EQ(run("--ad --t1 0.2 --transmissions 200 tc eps.switch_load load=1 state=on --wait").exit_code, 0);
}

TEST_P(GroundProgram, RunsAScriptToItsEnd) {
  const auto script = var_.path() / "script";
  std::ofstream(script) << "# comment\n"
                           "ping\n"
                           "tc eps.switch_load load=2 state=on   # must complete\n"
                           "tc eps.switch_load load=3 state=on\n"
                           "  expect rejected busy\n"
                           "wait 10ms\n"
                           "wait until 2020-01-01T00:00:00Z\n"
                           "ad on\n"
                           "tc eps.switch_load load=2 state=off\n"
                           "expect accepted\n"
                           "ad off\n";
  const Run done = run("--t1 0.2 --transmissions 200 script " + script.string());
  EXPECT_EQ(done.exit_code, 0) << done.output;
  EXPECT_THAT(done.output, HasSubstr("8 of 8 lines run, 0 not as expected"));
}

TEST_P(GroundProgram, StopsAScriptAtTheFirstSurpriseUnlessToldOtherwise) {
  const auto script = var_.path() / "script";
  std::ofstream(script) << "tc eps.switch_load load=2 state=on\n"
                           "expect rejected\n"
                           "ping\n";
  const Run stopped = run("script " + script.string());
  EXPECT_EQ(stopped.exit_code, 1) << stopped.output;
  EXPECT_THAT(stopped.output, HasSubstr("line 1: tc eps.switch_load load=2 state=on: NOT as expected"));
  EXPECT_THAT(stopped.output, HasSubstr("1 of 2 lines run, 1 not as expected"));
  const Run all = run("--json script --keep-going " + script.string());
  EXPECT_EQ(all.exit_code, 1) << all.output;
  EXPECT_THAT(all.output, HasSubstr(R"({"failed":1,"run":2,"steps":2,"type":"script_done"})"));
}

TEST_P(GroundProgram, SendsNothingOfAScriptWithAnError) {
  const auto script = var_.path() / "script";
  std::ofstream(script) << "ping\ntc eps.switch_load load=77 state=on\n";
  const Run wrong = run("script " + script.string());
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.output, HasSubstr("script:2: eps.switch_load: argument 'load'"));
  EXPECT_FALSE(spacecraft_.last_counter);
}

/// A UDP socket of a ground station.
class Udp {
 public:
  Udp() : fd_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in any = *parse_internet_address("127.0.0.1:0");
    EXPECT_EQ(bind(fd_.get(), reinterpret_cast<sockaddr*>(&any), sizeof any), 0);
    socklen_t length = sizeof address;
    getsockname(fd_.get(), reinterpret_cast<sockaddr*>(&address), &length);
  }
  void send(const Octets& datagram, const sockaddr_in& to) const {
    EXPECT_EQ(sendto(fd_.get(), datagram.data(), datagram.size(), 0, reinterpret_cast<const sockaddr*>(&to),
                     sizeof to),
              static_cast<ssize_t>(datagram.size()));
  }
  /// The next datagram; empty after 20 s.
  [[nodiscard]] Octets receive() const {
    pollfd wait{fd_.get(), POLLIN, 0};
    Octets octets(4096);
    if (poll(&wait, 1, 20000) != 1) return {};
    octets.resize(static_cast<std::size_t>(recv(fd_.get(), octets.data(), octets.size(), 0)));
    return octets;
  }
  sockaddr_in address{};

 private:
  Fd fd_;
};

TEST_F(ProgramOverPty, BridgesFramesBetweenTheLineAndPlainUdpSockets) {
  auto link = secured_link();
  auto port = Port::open(var_.path() / "rs422", link.baud);
  ASSERT_TRUE(port) << port.error();
  const Udp station;
  auto bridge = Bridge::open(link, std::make_unique<Port>(std::move(*port)), station.address,
                             *parse_internet_address("0"));
  ASSERT_TRUE(bridge) << bridge.error();
  ASSERT_NE(bridge->uplink_address().sin_port, 0);
  const auto down = [&](const Octets& octets) {
    ASSERT_EQ(write(pty_.fd(), octets.data(), octets.size()), static_cast<ssize_t>(octets.size()));
    pollfd wait{bridge->line_fd(), POLLIN, 0};
    while (poll(&wait, 1, 1000) == 1) {
      ASSERT_TRUE(bridge->on_line());
      if (poll(&wait, 1, 0) == 0) break;
    }
  };

  // Downlink: passes on the uncoded frame and drops a damaged CADU.
  down(spacecraft_.idle());
  Octets damaged = spacecraft_.idle();
  for (std::size_t i = 20; i < 120; ++i) damaged[i] ^= 0x5A;
  down(damaged);
  down(spacecraft_.idle());
  for (const int count : {0, 2}) {
    const Octets datagram = station.receive();
    const auto frame = wire::decode_tm_frame(datagram, 0xAB, 223);
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->master_count, count);
    EXPECT_EQ(frame->vc, wire::tm_idle_vc);
  }
  EXPECT_EQ(bridge->counters().tm_frames, 2U);

  // Uplink: codes frames, passes CLTUs unchanged, refuses anything else.
  const Octets frame = wire::encode_tc_frame(
      {.type = wire::TcFrameType::bc, .spacecraft_id = 0xAB, .data = wire::encode_control_command({})});
  const Octets cltu = wire::encode_cltu(frame, false);
  Octets bad = frame;
  bad.back() ^= 1;
  const auto up = [&](const Octets& datagram) {
    station.send(datagram, bridge->uplink_address());
    pollfd wait{bridge->socket_fd(), POLLIN, 0};
    ASSERT_EQ(poll(&wait, 1, 20000), 1);
    bridge->on_socket();
  };
  for (const Octets& datagram : {frame, bad, Octets{}, Octets(3000, 0), cltu}) up(datagram);
  EXPECT_EQ(bridge->counters().tc_datagrams, 2U);
  EXPECT_EQ(bridge->counters().tc_refused, 3U);
  Octets line(2 * cltu.size());
  std::size_t got = 0;
  for (pollfd wait{pty_.fd(), POLLIN, 0}; got < line.size() && poll(&wait, 1, 20000) == 1;) {
    const ssize_t part = read(pty_.fd(), line.data() + got, line.size() - got);
    ASSERT_GT(part, 0);
    got += static_cast<std::size_t>(part);
  }
  EXPECT_EQ(to_hex(line), to_hex(cltu) + to_hex(cltu));
}

TEST_P(GroundProgram, BridgesWithoutALinkKeyAndRefusesAddressesItCannotRead) {
  EXPECT_EQ(run("bridge --tm nowhere:1").exit_code, 2);
  EXPECT_EQ(run("bridge --tm 0").exit_code, 2);
  EXPECT_EQ(run("bridge --tc 127.0.0.1:99999").exit_code, 2);
}

/// A package for payload_eps with counter 7, signed with the test's key pair.
class PackageInstallation : public ProgramOverPty {
 protected:
  PackageInstallation() {
    const std::string folder = var_.path().string();
    std::ofstream(folder + "/main.cpp") << "int main() {}\n";
    for (const std::string& command :
         {"keygen " + folder + "/a.seed " + folder + "/a.pub",
          "make --node payload_eps --kind replace --counter 7 --sources " + folder + "/main.cpp --root " +
              folder + " --key " + folder + "/a.seed -o " + folder + "/any.pkg"}) {
      const Run made = run("package " + command);
      EXPECT_EQ(made.exit_code, 0) << made.output;
    }
    board_.file = "payload_eps_7.pkg";
  }
  Run install(const std::string& more = "") {
    return run("package install " + (var_.path() / "any.pkg").string() + " --timeout 30 " + more, "",
               &board_);
  }
  Board board_{var_.path()};
};

TEST_F(PackageInstallation, PutsThePackageUpAndTellsTheStagesUntilTheNodeRunsIt) {
  const Run done = install();
  EXPECT_EQ(done.exit_code, 0) << done.output;
  EXPECT_THAT(done.output, HasSubstr("payload_eps_7.pkg     arrived"));
  EXPECT_THAT(done.output, HasSubstr("package.install completed"));
  EXPECT_THAT(done.output, HasSubstr(" s  payload_eps_7.pkg: build"));
  EXPECT_THAT(done.output, HasSubstr("payload_eps runs version 3"));
  const auto sent = read_file(var_.path() / "any.pkg");
  EXPECT_EQ(*read_file(var_.path() / "board/files/payload_eps_7.pkg"), *sent);

  board_.ending = Board::Ending::candidate;
  EXPECT_EQ(install("--no-activate").exit_code, 0);
  EXPECT_EQ(install().exit_code, 1) << "it was to be started";
}

TEST_F(PackageInstallation, EndsWithOneAndTheReasonWhenItFailsOrIsRefused) {
  board_.ending = Board::Ending::failed;
  const Run failed = install();
  EXPECT_EQ(failed.exit_code, 1) << failed.output;
  EXPECT_THAT(failed.output, HasSubstr("failed in build: main.cpp:1: error"));

  board_.ending = Board::Ending::refused;
  const Run refused = install();
  EXPECT_EQ(refused.exit_code, 1) << refused.output;
  EXPECT_THAT(refused.output, HasSubstr("package_refused"));
  EXPECT_THAT(refused.output, HasSubstr("is refused: signed with another key"));
}

TEST_F(PackageInstallation, AsksForTheOutcomeThatWasLostOnTheWay) {
  board_.ending = Board::Ending::only_when_asked;
  const Run done = install();
  EXPECT_EQ(done.exit_code, 0) << done.output;
  EXPECT_THAT(done.output, HasSubstr("update_status"));
  EXPECT_THAT(done.output, HasSubstr("installed"));
}

TEST_F(PackageInstallation, IsRefusedBeforeAnythingGoesUpWhenItWasNotSignedForThisSpacecraft) {
  std::ofstream(var_.path() / "keys/package.pub")
      << "b7d3e0912c4fa85d6e7710f3c98a24be51d06f3a8c27e94b10fd5a6c83e2974f\n";
  const Run refused = install();
  EXPECT_EQ(refused.exit_code, 2) << refused.output;
  EXPECT_THAT(refused.output, HasSubstr("refused: signed with another key"));
  EXPECT_FALSE(std::filesystem::exists(var_.path() / "board/files/payload_eps_7.pkg"));
}

/// A server without an archive that takes each order, and ends before it answers.
FakeServer::Answer ends_with_each_order(std::atomic<int>& orders) {
  return [&orders](int, const nlohmann::json& message) -> std::optional<Messages> {
    if (message["type"] == "hello") return Messages{welcome(AdPhase::off, {}, 0, false)};
    ++orders;
    return std::nullopt;
  };
}

TEST_F(ProgramOverPty, SaysThatItIsNotKnownWhetherATelecommandWasSent) {
  std::filesystem::create_directories(var_.path() / "ground");
  std::atomic<int> orders{0};
  const FakeServer server(var_.path() / "ground/serve.sock", ends_with_each_order(orders));

  const Run tc = run("tc eps.switch_load load=1 state=on");
  EXPECT_EQ(tc.exit_code, 4) << tc.output;
  EXPECT_THAT(tc.output, HasSubstr("eps.switch_load: it is not known whether it was sent"));
  const Run json = run("--json tc eps.switch_load load=1 state=on");
  EXPECT_EQ(json.exit_code, 4) << json.output;
  EXPECT_THAT(json.output, HasSubstr(R"("outcome":"unknown")"));
  EXPECT_EQ(run("ping").exit_code, 4);
  EXPECT_EQ(run("put " + (var_.path() / "input").string()).exit_code, 4);
  EXPECT_EQ(orders, 4);
}

TEST_F(ProgramOverPty, ScriptStopsWhereItIsNotKnownWhetherATelecommandWasSent) {
  std::filesystem::create_directories(var_.path() / "ground");
  std::atomic<int> orders{0};
  const FakeServer server(var_.path() / "ground/serve.sock", ends_with_each_order(orders));
  std::ofstream(var_.path() / "pass.txt") << "tc eps.switch_load load=1 state=on\nping\n";

  const Run script = run("script --keep-going " + (var_.path() / "pass.txt").string());

  EXPECT_EQ(script.exit_code, 4) << script.output;
  EXPECT_THAT(script.output, HasSubstr("NOT KNOWN whether it was sent"));
  EXPECT_THAT(script.output, HasSubstr("1 of 2 lines run"));
  EXPECT_EQ(orders, 1);
}

TEST_F(ProgramOverPty, SaysThatThePortIsBusy) {
  const auto held = Port::open(var_.path() / "rs422", 921600);
  ASSERT_TRUE(held) << held.error();
  const Run ping = run("ping");
  EXPECT_EQ(ping.exit_code, 2);
  EXPECT_THAT(ping.output, HasSubstr("in use by another ground tool"));
}

TEST_F(ProgramOverPty, SaysHowToMakeAMissingPort) {
  std::filesystem::remove(var_.path() / "rs422");
  const Run ping = run("ping");
  EXPECT_EQ(ping.exit_code, 2);
  EXPECT_THAT(ping.output, HasSubstr("./run sim"));
}

/// The structures of a spacecraft that is well, but for what @p change does to its beacon.
std::map<std::uint16_t, Octets> structures_with(const std::function<void(mission::Beacon&)>& change) {
  mission::Beacon beacon;
  beacon.boot_count = 3;
  beacon.mode = mission::MissionMode::nominal;
  beacon.time_valid = true;
  change(beacon);
  mission::HealthHousekeeping health;
  health.mode = beacon.mode;
  health.reason = beacon.mode_reason;
  mission::PayloadAdcsHousekeeping attitude;
  attitude.rate_deg_s = 14;
  return {{mission::structure::beacon, beacon.encoded()},
          {mission::structure::health, health.encoded()},
          {mission::structure::boot_step, mission::BootStepHousekeeping{}.encoded()},
          {mission::structure::timing, mission::TimingHousekeeping{}.encoded()},
          {mission::structure::ttc, mission::TtcHousekeeping{}.encoded()},
          {mission::structure::payload_adcs, attitude.encoded()}};
}

TEST_P(GroundProgram, MakesFirstContactInEachBootState) {
  struct State {
    std::function<void(mission::Beacon&)> change;
    std::string said;
  };
  const std::vector<State> states{
      {[](auto& beacon) { beacon.boot_count = 1; },
       "boot 1, reset cause power_on: it was never started before"},
      {[](auto& beacon) { beacon.reset_cause = mission::ResetCause::watchdog; },
       "boot 3, reset cause watchdog"},
      {[](auto& beacon) { beacon.reset_cause = mission::ResetCause::crash; }, "boot 3, reset cause crash"},
      {[](auto& beacon) { beacon.time_valid = false; }, "its clock was never set"},
      {[](auto& beacon) { beacon.farm_lockout = true; }, "FARM-1 is locked out"},
      {[](auto& beacon) {
         beacon.mode = mission::MissionMode::safe;
         beacon.mode_reason = "battery low";
       },
       "mode safe: battery low"},
  };
  for (const State& state : states) {
    spacecraft_.structures = structures_with(state.change);
    const Run contact = run("first-contact --duration 60");
    EXPECT_EQ(contact.exit_code, 0) << contact.output;
    EXPECT_THAT(contact.output, HasSubstr(state.said));
    EXPECT_THAT(contact.output, HasSubstr("it turns by 14.0 deg/s"));
  }
}

TEST_P(GroundProgram, MakesFirstContactWithSrfsRescue) {
  mission::BootStepHousekeeping step;
  step.in_rescue = true;
  step.unhealthy_starts = 4;
  spacecraft_.structures = {{mission::structure::boot_step, step.encoded()}};
  const Run contact = run("first-contact --duration 60");
  EXPECT_EQ(contact.exit_code, 0) << contact.output;
  EXPECT_THAT(contact.output, HasSubstr("srfs_rescue answers, the suite is down: 4 unhealthy starts"));
}

TEST_F(ProgramOverPty, SetsTheClockOfAFirstContactOnce) {
  spacecraft_.structures = structures_with([](auto& beacon) { beacon.time_valid = false; });
  const Run contact = run("--json first-contact --set-time --duration 60");
  EXPECT_EQ(contact.exit_code, 0) << contact.output;
  EXPECT_THAT(contact.output, HasSubstr("its clock was set to that of the ground"));
}

TEST_F(ProgramOverPty, SaysHowFarAFirstContactCame) {
  auto link = sealed_link();
  link.tc_strict = false;  // no telecommand of a strict link is authentic there
  FakeSpacecraft other(link);
  std::swap(spacecraft_, other);
  const Run contact = run("first-contact --duration 3");
  EXPECT_EQ(contact.exit_code, 1);
  EXPECT_THAT(contact.output, HasSubstr("neither a beacon nor an answer"));
}

TEST_P(GroundProgram, FliesAPlanAndGoesOnWhereItEnded) {
  std::ofstream(var_.path() / "times.txt") << "2026-11-27T08:00:00Z 2026-11-27T08:09:30Z\n";
  std::ofstream(var_.path() / "lines.txt") << "tc eps.switch_load load=1 state=on\n"
                                              "tc eps.switch_load load=3 state=on\n"
                                              "  expect rejected\n";
  std::ofstream(var_.path() / "plan.yaml") << "plan: short\n"
                                              "station: { name: here, latitude_deg: 1, longitude_deg: 2 }\n"
                                              "orbit: { times: times.txt }\n"
                                              "queries: [storage.summary]\n"
                                              "script: lines.txt\n";
  spacecraft_.structures = structures_with([](auto&) {});
  const std::string plan = (var_.path() / "plan.yaml").string();

  const Run first = run("pass run " + plan + " --duration 60");

  EXPECT_EQ(first.exit_code, 0) << first.output;
  EXPECT_THAT(first.output, HasSubstr("nothing is left to do"));
  EXPECT_THAT(first.output, HasSubstr("## Done"));
  EXPECT_THAT(first.output, Not(HasSubstr("## Left")));
  const auto sent = spacecraft_.last_counter;

  const Run second = run("--json pass run " + plan + " --duration 60");
  EXPECT_EQ(second.exit_code, 0) << second.output;
  EXPECT_GT(spacecraft_.last_counter, sent) << "its questions";
  const Run report = run("--json pass report " + plan);
  const auto json = nlohmann::json::parse(report.output);
  EXPECT_EQ(json["flown"].size(), 2U);
  for (const auto& item : json["items"]) EXPECT_EQ(item["state"], "done") << item;
  EXPECT_EQ(json["flown"][0]["items_done"], 3);
  EXPECT_EQ(json["flown"][1]["items_done"], 0) << "nothing twice";
}

}  // namespace
}  // namespace srfs::ground
