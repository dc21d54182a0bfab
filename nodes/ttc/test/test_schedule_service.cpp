// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/schedule_service.hpp"

#include <gtest/gtest.h>

#include "nodes/ttc/report/beacon_builder.hpp"
#include "nodes/ttc/services/time_reporter.hpp"
#include "nodes/ttc/test/router_with_parts.hpp"
#include "wire/cuc.hpp"

namespace srfs {
namespace {

const TaiTime day = to_tai(UtcTime(seconds(1'795'000'000)));

TaiTime at(int s) {
  return day + seconds(s);
}

/// Service 11 behind the router, as commanded by the ground. The test controls the speed of the disk.
class Schedule : public RouterWithParts {
 protected:
  Schedule() { schedule_.on_time(day, true); }

  Octets packet_of(const std::string& name, const std::vector<std::string>& arguments) {
    const auto encoded = dictionary_.encode(name, arguments);
    EXPECT_TRUE(encoded) << (encoded ? "" : encoded.error().message);
    if (!encoded) return {};
    wire::TcPacket packet;
    packet.apid = encoded->command->apid;
    packet.sequence_count = sequence_++;
    packet.service = encoded->command->service;
    packet.subtype = encoded->command->subtype;
    packet.source_id = 5;
    packet.application = encoded->data;
    return wire::make_tc_packet(packet);
  }
  /// @return service,subtype of the reports it caused, in order
  std::vector<std::string> send(const Octets& packet, bool on_disk = true) {
    JudgedTelecommand judged = router_.judge(packet, MonotonicTime{});
    judged.telecommand.origin.id = ++id_;
    router_.carry_out(judged, MonotonicTime{});
    if (on_disk) schedule_.on_written(journal_.revision(), true);
    return taken();
  }
  std::vector<std::string> send(const std::string& name, const std::vector<std::string>& arguments = {}) {
    return send(packet_of(name, arguments));
  }
  std::vector<std::string> taken() {
    reports_ = report_queue_.take();
    std::vector<std::string> names;
    for (const Report& report : reports_)
      names.push_back(std::to_string(report.service) + "," + std::to_string(report.subtype));
    return names;
  }
  /// Inserts a request of one of the payloads for @p release s. @return its packet
  Octets insert(int release, int group = 0) {
    Octets request = packet_of("eps.switch_load", {"load=2", "state=on"});
    EXPECT_EQ(send("schedule.insert", {"group_id=" + std::to_string(group), "release=" + iso(release),
                                       "request=" + to_hex(request)}),
              completed_);
    return request;
  }
  static std::string iso(int s) { return to_iso8601(to_utc(at(s))); }
  static std::vector<std::string> id_of(const Octets& packet) {
    const auto parsed = wire::parse_tc_packet(packet);
    return {"request_source=" + std::to_string(parsed->source_id),
            "request_apid=" + std::to_string(parsed->apid),
            "request_sequence=" + std::to_string(parsed->sequence_count)};
  }
  std::vector<std::string> send_by_id(const std::string& name, const Octets& packet,
                                      std::vector<std::string> arguments = {}) {
    for (const std::string& word : id_of(packet)) arguments.push_back(word);
    return send(name, arguments);
  }
  /// Failure code and following data of the last report.
  [[nodiscard]] Octets failure() const {
    return reports_.empty() ? Octets{} : Octets(reports_.back().data.begin() + 4, reports_.back().data.end());
  }
  static Octets code(std::uint16_t code, const Octets& parameter = {}) {
    Octets octets{static_cast<std::uint8_t>(code >> 8), static_cast<std::uint8_t>(code)};
    octets.insert(octets.end(), parameter.begin(), parameter.end());
    return octets;
  }
  /// Like the node, releases the requests due at @p s. @return their packets
  std::vector<Octets> release(int s, bool valid = true) {
    schedule_.on_time(at(s), valid);
    schedule_.drop_overdue();
    std::vector<Octets> released;
    while (const ScheduledActivity* activity = schedule_.due()) {
      released.push_back(activity->packet);
      UplinkedPacket packet;
      packet.packet = activity->packet;
      journal_.accept({.origin = {}, .command = dictionary_.command("eps.switch_load")}, packet, {},
                      activity->id);
      schedule_.on_released();
    }
    return released;
  }
  [[nodiscard]] std::size_t size() const { return schedule_.schedule().activities().size(); }

  using Names = std::vector<std::string>;
  const Names completed_{"1,1", "1,3", "1,7"};
  const Names start_failed_{"1,1", "1,4"};

  std::vector<Report> reports_;
  std::uint16_t sequence_ = 100;
  std::uint64_t id_ = 0;
};

TEST_F(Schedule, ReleasesARequestWhenItsTimeHasComeAndOnce) {
  const Octets later = insert(20);
  const Octets sooner = insert(10);

  EXPECT_TRUE(release(9).empty());
  EXPECT_EQ(schedule_.next_due_in(), seconds(1));
  EXPECT_EQ(release(10), std::vector<Octets>{sooner});
  EXPECT_TRUE(release(10).empty());
  EXPECT_EQ(release(25), std::vector<Octets>{later});
  EXPECT_EQ(size(), 0U);
  EXPECT_EQ(schedule_.counters().released, 2U);
  EXPECT_EQ(schedule_.next_due_in(), std::nullopt);
}

TEST_F(Schedule, CompletesAChangeWhenItIsOnDiskAndReleasesNothingBefore) {
  const Octets request = packet_of("eps.switch_load", {"load=2", "state=on"});
  const Octets insertion = packet_of("schedule.insert", {"release=" + iso(1), "request=" + to_hex(request)});
  EXPECT_EQ(send(insertion, false), (Names{"1,1", "1,3"}));
  EXPECT_TRUE(release(2).empty());

  schedule_.on_written(journal_.revision() - 1, true);
  EXPECT_TRUE(taken().empty());
  schedule_.on_written(journal_.revision(), true);
  EXPECT_EQ(taken(), Names{"1,7"});
  EXPECT_EQ(release(2).size(), 1U);

  const Octets disable = packet_of("schedule.disable", {});
  send(disable, false);
  schedule_.on_written(journal_.revision(), false);
  EXPECT_EQ(taken(), Names{"1,8"});
  EXPECT_EQ(failure(), code(mission::failure::storage_unavailable));
}

TEST_F(Schedule, RefusesAnInsertionWhoseRequestCouldNotBeAcceptedAndNamesItsArgument) {
  Octets good = packet_of("eps.switch_load", {"load=2", "state=on"});
  const auto insertion = [&](const Octets& second) {
    wire::TcPacket packet;
    packet.apid = 1;
    packet.service = 11;
    packet.subtype = 4;
    OctetWriter data;
    data.u16(2);
    for (const Octets* request : {static_cast<const Octets*>(&good), &second}) {
      data.u8(0);
      data.bytes(wire::encode_cuc(at(5)));
      data.bytes(*request);
    }
    packet.application = data.take();
    return send(wire::make_tc_packet(packet));
  };
  const auto request = [](std::uint16_t apid, std::uint8_t service, std::uint8_t subtype, Octets data) {
    wire::TcPacket packet;
    packet.apid = apid;
    packet.service = service;
    packet.subtype = subtype;
    packet.application = std::move(data);
    return wire::make_tc_packet(packet);
  };
  const auto refused = [](std::uint8_t inner, std::uint8_t argument) {
    return code(60, {2, 0, inner, argument});
  };
  insertion(request(17, 8, 1, {0, 1, 99, 1}));
  EXPECT_EQ(failure(), refused(6, 1)) << "no such load";
  insertion(request(17, 8, 1, {0, 1, 2}));
  EXPECT_EQ(failure(), refused(13, 0)) << "too short";
  insertion(request(17, 8, 1, {0xFF, 0xFF}));
  EXPECT_EQ(failure(), refused(7, 0)) << "no such function";
  insertion(request(99, 8, 1, {0, 1, 2, 1}));
  EXPECT_EQ(failure(), refused(1, 0)) << "no such APID";
  Octets damaged = good;
  damaged.back() ^= 1;
  insertion(damaged);
  EXPECT_EQ(failure(), refused(3, 0)) << "its checksum is wrong";
  EXPECT_EQ(insertion(packet_of("schedule.insert", {"release=" + iso(9), "request=" + to_hex(good)})),
            Names{"1,2"});
  EXPECT_EQ(failure(), refused(61, 0)) << "an insertion in an insertion";
  EXPECT_EQ(size(), 0U) << "all of a request or nothing";

  EXPECT_EQ(insertion(packet_of("schedule.disable", {})), completed_)
      << "other requests of the service may be";
  EXPECT_EQ(size(), 2U);
}

TEST_F(Schedule, AHazardousRequestIsInsertedAndTakenAtItsReleaseOnlyIfItIsArmedThen) {
  const Octets hazard = packet_of("eps.power_cycle_peripheral", {"off_ms=200"});
  EXPECT_EQ(send("schedule.insert", {"release=" + iso(10), "request=" + to_hex(hazard)}), completed_);
  ASSERT_EQ(release(10), std::vector<Octets>{hazard});

  EXPECT_EQ(send(hazard), Names{"1,2"});
  EXPECT_EQ(failure(), code(mission::failure::not_armed));
  hazards_.arm(hazard_name(router_.judge(hazard, MonotonicTime{}).telecommand), MonotonicTime{});
  EXPECT_EQ(send(hazard), Names{"1,1"});
}

TEST_F(Schedule, RefusesWhatIsPastThereAlreadyOfNoGroupOrTooMuch) {
  const Octets request = packet_of("eps.switch_load", {"load=2", "state=on"});
  const auto insert_with = [&](const std::string& release, const std::string& group) {
    return send("schedule.insert", {"group_id=" + group, "release=" + release, "request=" + to_hex(request)});
  };
  EXPECT_EQ(insert_with(iso(0), "0"), start_failed_);
  EXPECT_EQ(failure(), code(63));
  EXPECT_EQ(insert_with(iso(1), "4"), start_failed_);
  EXPECT_EQ(failure(), code(12, {0, 4}));
  EXPECT_EQ(insert_with(iso(1), "0"), completed_);
  EXPECT_EQ(insert_with(iso(2), "0"), start_failed_);
  EXPECT_EQ(failure(), code(64, {0, 1}));

  while (size() < TimeSchedule::max_activities) insert(100);
  const Octets one_more = packet_of("eps.switch_load", {"load=2", "state=on"});
  EXPECT_EQ(send("schedule.insert", {"release=" + iso(3), "request=" + to_hex(one_more)}), start_failed_);
  EXPECT_EQ(failure(), code(62));
  EXPECT_EQ(size(), TimeSchedule::max_activities);
}

TEST_F(Schedule, BoundsTheOctetsOfItsRequests) {
  wire::TcPacket big;
  big.apid = 1;
  big.service = 3;
  big.subtype = 5;
  OctetWriter data;
  data.u16(16);
  for (int i = 0; i < 16; ++i) data.u16(mission::structure::ttc);
  big.application = data.take();
  const std::size_t octets = wire::make_tc_packet(big).size();
  std::size_t inserted = 0;
  for (Names outcome = completed_; outcome == completed_; ++inserted) {
    big.sequence_count = static_cast<std::uint16_t>(inserted);
    outcome = send("schedule.insert", {"release=" + iso(9), "request=" + to_hex(wire::make_tc_packet(big))});
  }
  EXPECT_EQ(failure(), code(62));
  EXPECT_EQ(inserted - 1, std::min(TimeSchedule::max_activities, TimeSchedule::max_octets / octets));
  EXPECT_LE(schedule_.schedule().octets(), TimeSchedule::max_octets);
}

TEST_F(Schedule, WaitsForValidTimeAndDropsWhatIsTooLateThen) {
  const Octets soon = insert(10);
  insert(5);
  EXPECT_TRUE(release(1000, false).empty());
  EXPECT_EQ(schedule_.next_due_in(), std::nullopt) << "time alone changes nothing";
  EXPECT_TRUE(taken().empty());

  EXPECT_TRUE(release(66, true).empty()) << "the drop is not on disk yet";
  schedule_.on_written(journal_.revision(), true);
  EXPECT_EQ(release(66), std::vector<Octets>{soon}) << "56 s late is not too late";
  EXPECT_EQ(taken(), Names{"1,2"});
  EXPECT_EQ(failure(), code(20));
  const auto dropped = schedule_.take_dropped();
  ASSERT_EQ(dropped.size(), 1U);
  EXPECT_EQ(dropped[0].release, at(5));
  EXPECT_EQ(dropped[0].reason, mission::ScheduleDrop::late);
  EXPECT_EQ(schedule_.counters().late, 1U);
}

TEST_F(Schedule, LooksAtReleaseTimesAnewAfterAStepOfTheClock) {
  const Octets request = insert(100);
  EXPECT_TRUE(release(-500).empty());
  EXPECT_EQ(schedule_.next_due_in(), seconds(600));
  EXPECT_EQ(release(101), std::vector<Octets>{request});
  EXPECT_TRUE(release(50).empty()) << "back again: it is gone";
  EXPECT_TRUE(release(100).empty());
}

TEST_F(Schedule, DropsWhatBecomesDueWhileItIsDisabled) {
  EXPECT_EQ(send("schedule.create_group", {"group_id=3"}), completed_);
  insert(10);
  insert(20, 3);
  const Octets free = insert(30);
  EXPECT_EQ(send("schedule.disable"), completed_);
  EXPECT_TRUE(release(10).empty());
  schedule_.on_written(journal_.revision(), true);
  EXPECT_EQ(taken(), Names{"1,2"});
  EXPECT_EQ(failure(), code(65));
  EXPECT_EQ(send("schedule.enable"), completed_);

  EXPECT_EQ(send("schedule.disable_group", {"group_id=3"}), completed_);
  EXPECT_EQ(schedule_.next()->activity->packet, free) << "the next one that will be released";
  EXPECT_TRUE(release(20).empty());
  schedule_.on_written(journal_.revision(), true);
  EXPECT_EQ(release(30), std::vector<Octets>{free});
  EXPECT_EQ(schedule_.take_dropped().size(), 2U);
  EXPECT_EQ(schedule_.counters().disabled, 2U);
}

TEST_F(Schedule, DeletesByRequestAndByFilter) {
  EXPECT_EQ(send("schedule.create_group", {"group_id=1"}), completed_);
  const Octets a = insert(10);
  insert(20, 1);
  insert(30);
  insert(40, 1);
  EXPECT_EQ(send_by_id("schedule.delete", a), completed_);
  EXPECT_EQ(send_by_id("schedule.delete", a), start_failed_);
  EXPECT_EQ(failure(), code(12, {0, a[3]}));
  EXPECT_EQ(send("schedule.delete_filter", {"from=" + iso(40), "to=" + iso(20)}), start_failed_);
  EXPECT_EQ(failure(), code(24));
  EXPECT_EQ(send("schedule.delete_filter", {"from=" + iso(20), "to=" + iso(30), "group_id=1"}), completed_);
  EXPECT_EQ(size(), 2U) << "those at 30 and 40";
  EXPECT_EQ(send("schedule.delete_filter", {"group_id=0"}), completed_);
  EXPECT_EQ(size(), 1U) << "those without a group";
  EXPECT_EQ(send("schedule.delete_filter"), completed_);
  EXPECT_EQ(size(), 0U);
}

TEST_F(Schedule, MovesReleaseTimesAllOrNone) {
  const Octets a = insert(10);
  const Octets b = insert(20);
  EXPECT_EQ(send_by_id("schedule.shift", a, {"offset_s=15"}), completed_);
  EXPECT_EQ(schedule_.next()->activity->packet, b);
  EXPECT_EQ(send("schedule.shift_all", {"offset_s=-20"}), start_failed_);
  EXPECT_EQ(failure(), code(63));
  EXPECT_EQ(schedule_.next_due_in(), seconds(20)) << "nothing has moved";
  EXPECT_EQ(send("schedule.shift_filter", {"offset_s=-19", "to=" + iso(20)}), completed_);
  EXPECT_EQ(schedule_.next_due_in(), seconds(1));
  EXPECT_EQ(send("schedule.shift_all", {"offset_s=2147483647"}), start_failed_);
  EXPECT_EQ(failure(), code(63)) << "beyond what CUC can say";
  EXPECT_EQ(release(25), (std::vector<Octets>{b, a}));
}

TEST_F(Schedule, ReportsActivitiesInSummaryAndInDetail) {
  EXPECT_EQ(send("schedule.create_group", {"group_id=7"}), completed_);
  const Octets late = insert(40);
  const Octets soon = insert(30, 7);
  EXPECT_EQ(send("schedule.summary_all"), (Names{"1,1", "1,3", "11,13", "1,7"}));
  OctetWriter summary;
  summary.u16(2);
  for (const auto& [group, s, packet] : {std::tuple(7, 30, soon), std::tuple(0, 40, late)}) {
    const auto parsed = wire::parse_tc_packet(packet);
    summary.u8(static_cast<std::uint8_t>(group));
    summary.bytes(wire::encode_cuc(at(s)));
    summary.u16(5);
    summary.u16(17);
    summary.u16(parsed->sequence_count);
  }
  EXPECT_EQ(reports_[2].data, summary.take());
  EXPECT_EQ(reports_[2].destination_id, 5);

  EXPECT_EQ(send_by_id("schedule.detail", soon), (Names{"1,1", "1,3", "11,10", "1,7"}));
  OctetWriter detail;
  detail.u16(1);
  detail.u8(7);
  detail.bytes(wire::encode_cuc(at(30)));
  detail.bytes(soon);
  EXPECT_EQ(reports_[2].data, detail.take());

  EXPECT_EQ(send("schedule.summary_filter", {"to=" + iso(10)}), (Names{"1,1", "1,3", "11,13", "1,7"}));
  EXPECT_EQ(reports_[2].data, (Octets{0, 0}));
  EXPECT_EQ(send("schedule.report_groups"), (Names{"1,1", "1,3", "11,27", "1,7"}));
  EXPECT_EQ(reports_[2].data, (Octets{0, 1, 7, 1}));
}

TEST_F(Schedule, ALongListComesInSeveralReportsOfBoundedSize) {
  for (int i = 0; i < 200; ++i) insert(100 + i);
  send("schedule.detail_all");
  std::size_t listed = 0;
  for (const Report& report : reports_) {
    if (report.subtype != 10) continue;
    EXPECT_LE(report.data.size(), ScheduleService::report_octets);
    listed += OctetReader(report.data).u16();
  }
  EXPECT_EQ(listed, 200U);
}

TEST_F(Schedule, KeepsGroupsThatHaveActivitiesAndResetEnablesAll) {
  EXPECT_EQ(send("schedule.create_group", {"group_id=1", "status=disabled"}), completed_);
  EXPECT_EQ(send("schedule.create_group", {"group_id=1"}), start_failed_);
  EXPECT_EQ(failure(), code(64, {0, 1}));
  EXPECT_EQ(send("schedule.create_group", {"group_id=2"}), completed_);
  insert(10, 1);
  EXPECT_EQ(send("schedule.delete_group", {"group_id=1"}), start_failed_);
  EXPECT_EQ(failure(), code(66, {0, 1}));
  EXPECT_EQ(send("schedule.delete_group", {"group_id=2"}), completed_);
  EXPECT_EQ(send("schedule.enable_group", {"group_id=2"}), start_failed_);
  EXPECT_EQ(failure(), code(12, {0, 2}));

  EXPECT_EQ(send("schedule.reset"), completed_);
  EXPECT_EQ(size(), 0U);
  EXPECT_FALSE(schedule_.schedule().enabled());
  EXPECT_TRUE(schedule_.schedule().groups().at(1));
  EXPECT_EQ(send("schedule.delete_group"), completed_) << "all of them";
  EXPECT_TRUE(schedule_.schedule().groups().empty());
}

TEST_F(Schedule, ARequestThatWasCarriedOutBeforeAKillIsNotCarriedOutAgain) {
  const Octets request = insert(10);
  const Octets shift = packet_of("schedule.shift_all", {"offset_s=100"});
  EXPECT_EQ(send(shift), completed_);
  const std::uint64_t shifted_by = id_;

  TelecommandOrigin origin;
  origin.ack_flags = wire::ack::all;
  origin.id = shifted_by;
  router_.restore({.origin = origin, .expiry = MonotonicTime(seconds(10)), .packet = shift, .progress = {}},
                  {});
  EXPECT_EQ(taken(), (Names{"1,3", "1,7"}));
  EXPECT_EQ(schedule_.next_due_in(), seconds(110));

  origin.id = shifted_by + 1;  // accepted, but not carried out before the kill
  router_.restore({.origin = origin, .expiry = MonotonicTime(seconds(10)), .packet = shift, .progress = {}},
                  {});
  schedule_.on_written(journal_.revision(), true);
  EXPECT_EQ(taken(), (Names{"1,3", "1,7"}));
  EXPECT_EQ(release(210), std::vector<Octets>{request});
}

TEST(TimeReports, ComeEveryTwoToTheRateFramesWithTheTimeOfTheFrame) {
  ReportQueue report_queue;
  TimeReporter reporter{report_queue};
  reporter.set_rate(2);
  std::vector<std::uint64_t> reported;
  for (std::uint64_t frames = 1; frames <= 12; ++frames) {
    const auto packet = reporter.on_frames(frames, at(static_cast<int>(frames)));
    EXPECT_FALSE(reporter.on_frames(frames, at(99))) << "an idle frame changes nothing";
    if (!packet) continue;
    reported.push_back(frames);
    const auto report = wire::parse_time_packet(*packet);
    ASSERT_TRUE(report);
    EXPECT_EQ(report->time, at(static_cast<int>(frames)));
    EXPECT_EQ(report->rate, 2);
    EXPECT_EQ(report->sequence_count, reported.size() - 1);
    Octets damaged = *packet;
    damaged[8] ^= 1;
    EXPECT_FALSE(wire::parse_time_packet(damaged));
  }
  EXPECT_EQ(reported, (std::vector<std::uint64_t>{4, 8, 12}));
}

TEST_F(Schedule, TakesTheRateOfTheTimeReport) {
  EXPECT_EQ(send("time.set_report_rate", {"rate=0"}), completed_);
  EXPECT_TRUE(time_reports_.on_frames(1, day));
  EXPECT_TRUE(time_reports_.on_frames(2, day));
}

}  // namespace
}  // namespace srfs
