// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A stranger with a radio: hears every frame, keeps it from the spacecraft or not, and sends it later, out of
// order, more than once, with another header.
#include <array>
#include <cstdlib>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "nodes/ttc/link/refused_frames.hpp"
#include "nodes/ttc/link/uplink_chain.hpp"
#include "tests/build_kind.hpp"
#include "wire/cltu.hpp"
#include "wire/tc_uplink.hpp"

namespace srfs {
namespace {

constexpr std::uint16_t spacecraft = 0xAB;
constexpr std::uint16_t spi_bd = 1;
constexpr std::uint16_t spi_ad = 2;
constexpr std::uint16_t spi_contingency = 5;
constexpr milliseconds lifetime{600'000};

wire::SdlsKey key_of(std::uint16_t spi) {
  return wire::SdlsKey({static_cast<std::uint8_t>(spi)});
}

UplinkConfig config_of(bool strict) {
  UplinkConfig config;
  config.spacecraft_id = spacecraft;
  config.strict = strict;
  UplinkChannel channel{.vc = 0, .associations = {}};
  channel.associations.push_back({.spi = spi_bd, .key = key_of(spi_bd), .for_ad = false, .for_bd = true});
  channel.associations.push_back({.spi = spi_ad, .key = key_of(spi_ad), .for_ad = true, .for_bd = false});
  channel.associations.push_back(
      {.spi = spi_contingency, .key = key_of(spi_contingency), .set = std::nullopt});
  config.channels.push_back(std::move(channel));
  return config;
}

/// A frame as the ground made it. Its packet is its number.
struct Sent {
  wire::TcFrame frame;
  std::uint64_t counter = 0;  ///< milliseconds of UTC
};

/// The spacecraft's end of the line, the ground's, and a time.
class Line {
 public:
  explicit Line(bool strict = true, std::uint64_t seed = 0)
      : chain_(config_of(strict), {}),
        random_(seed),
        channel_{.spacecraft_id = spacecraft, .vc = 0, .randomize = false, .whole_header = strict} {}

  // ---- the ground; what it makes is heard by the stranger
  const Sent& make(wire::TcFrameType type, std::uint16_t spi, std::uint8_t sequence = 0) {
    const std::uint64_t counter = next_counter();
    const auto number = static_cast<std::uint32_t>(sent_.size());
    OctetWriter packet;
    packet.u32(number);
    const wire::SdlsKey key = key_of(spi);
    return keep(
        wire::make_uplink_cltu(channel_, type, sequence, &seal(key, spi, counter), packet.view()).value(),
        counter);
  }
  const Sent& make(wire::ControlCommand command) {
    const std::uint64_t counter = next_counter();
    const wire::SdlsKey key = key_of(spi_bd);
    return keep(wire::make_secured_control_cltu(channel_, command, seal(key, spi_bd, counter)).value(),
                counter);
  }

  // ---- the line
  /// @return numbers of the frames whose packets were handed out
  std::vector<std::size_t> deliver(const wire::TcFrame& frame) {
    chain_.set_age(lifetime, utc_ms());
    std::vector<std::size_t> executed;
    const auto at = MonotonicTime(milliseconds(static_cast<std::int64_t>(now_ms_)) + ground_clock_back);
    for (const UplinkedPacket& packet :
         chain_.push(wire::encode_cltu(wire::encode_tc_frame(frame), false), at)) {
      OctetReader in(packet.packet);
      executed.push_back(in.u32());
    }
    return executed;
  }
  [[nodiscard]] std::optional<std::uint64_t> utc_ms() const {
    if (!time_valid) return std::nullopt;
    return now_ms_ + static_cast<std::uint64_t>(clock_error.count());
  }
  bool time_valid = true;
  milliseconds clock_error{0};        ///< of the spacecraft's
  milliseconds ground_clock_back{0};  ///< real time that the ground's clock did not count
  void pass(milliseconds time) { now_ms_ += static_cast<std::uint64_t>(time.count()); }

  UplinkChain& chain() { return chain_; }
  [[nodiscard]] const std::vector<Sent>& sent() const { return sent_; }
  /// Below 0 when several were made in one millisecond.
  [[nodiscard]] std::int64_t age_ms(std::size_t number) const {
    return static_cast<std::int64_t>(now_ms_) - static_cast<std::int64_t>(sent_[number].counter);
  }
  [[nodiscard]] const wire::FarmState& farm() const { return chain_.farm(0); }
  std::size_t below(std::size_t n) { return random_() % n; }

 private:
  const wire::SdlsSeal& seal(const wire::SdlsKey& key, std::uint16_t spi, std::uint64_t counter) {
    return seal_.emplace(wire::SdlsSeal{
        .key = key, .spi = spi, .counter = counter, .sender = channel_.whole_header ? 0x01020304U : 0});
  }
  std::uint64_t next_counter() { return counter_ = std::max(counter_ + 1, now_ms_); }
  const Sent& keep(const Octets& cltu, std::uint64_t counter) {
    wire::CltuDecoder decoder({});
    const auto frames = decoder.push(cltu, MonotonicTime{});
    sent_.push_back({wire::decode_tc_frame(frames.at(0), spacecraft).value(), counter});
    return sent_.back();
  }

  UplinkChain chain_;
  std::minstd_rand random_;
  wire::TcUplinkChannel channel_;
  std::optional<wire::SdlsSeal> seal_;
  std::uint64_t now_ms_ = 1'795'000'000'000;
  std::uint64_t counter_ = 0;
  std::vector<Sent> sent_;
};

using Type = wire::TcFrameType;

TEST(Stranger, CannotMoveFarmWithAFrameWhoseHeaderIsRewritten) {
  Line line;
  wire::TcFrame taken = line.make(Type::ad, spi_ad, 0).frame;  // kept from the spacecraft
  taken.sequence = 100;

  EXPECT_TRUE(line.deliver(taken).empty());

  EXPECT_FALSE(line.farm().lockout);
  EXPECT_EQ(line.chain().counters().not_authentic, 1U);
  EXPECT_EQ(line.deliver(line.make(Type::ad, spi_ad, 0).frame).size(), 1U);
}

TEST(Stranger, LocksFarmOutWhereTheDeploymentKeepsToTheStandard) {
  Line line(false);
  wire::TcFrame taken = line.make(Type::ad, spi_ad, 0).frame;
  taken.sequence = 100;

  EXPECT_TRUE(line.deliver(taken).empty());

  EXPECT_TRUE(line.farm().lockout) << "the mask of 355.0-B leaves N(S) out";
}

TEST(Stranger, CannotGiveAFrameAnotherTypeOrChannel) {
  Line line;
  wire::TcFrame taken = line.make(Type::ad, spi_contingency, 0).frame;  // its key would do for both types
  taken.type = Type::bd;
  EXPECT_TRUE(line.deliver(taken).empty());
  wire::TcFrame unlock = line.make(wire::ControlCommand{.kind = wire::ControlCommand::Kind::unlock}).frame;
  unlock.type = Type::bd;
  EXPECT_TRUE(line.deliver(unlock).empty()) << "a control command is no packet";
  EXPECT_EQ(line.chain().counters().not_authentic, 2U);
}

TEST(Stranger, CommandsNoFarmWithoutAKey) {
  Line line;
  const auto before = line.chain().state();
  for (const auto command : {wire::ControlCommand{.kind = wire::ControlCommand::Kind::set_vr, .vr = 77},
                             wire::ControlCommand{.kind = wire::ControlCommand::Kind::unlock}}) {
    line.deliver({.type = Type::bc,
                  .spacecraft_id = spacecraft,
                  .vc = 0,
                  .data = wire::encode_control_command(command)});
  }
  EXPECT_EQ(line.chain().state(), before);
  EXPECT_EQ(line.chain().counters().not_authentic, 2U);

  const Sent set = line.make(wire::ControlCommand{.kind = wire::ControlCommand::Kind::set_vr, .vr = 77});
  line.deliver(set.frame);
  EXPECT_EQ(line.farm().vr, 77);
  EXPECT_GT(line.chain().state().generation, before.generation) << "the ground's goes to the disk";
  EXPECT_EQ(line.deliver(line.make(Type::ad, spi_ad, 77).frame).size(), 1U);
  line.deliver(set.frame);
  EXPECT_EQ(line.farm().vr, 78) << "a recorded one is a replay";
}

TEST(Stranger, CannotDelayATelecommandPastALaterOneOfAnyAssociation) {
  Line line;
  const wire::TcFrame jammed = line.make(Type::bd, spi_bd).frame;
  for (std::uint8_t i = 0; i < 3; ++i)
    EXPECT_EQ(line.deliver(line.make(Type::ad, spi_ad, i).frame).size(), 1U);

  EXPECT_TRUE(line.deliver(jammed).empty());

  EXPECT_EQ(line.chain().counters().replayed, 1U);
  const wire::TcFrame second = line.make(Type::ad, spi_ad, 3).frame;
  EXPECT_EQ(line.deliver(line.make(Type::bd, spi_contingency).frame).size(), 1U);
  EXPECT_TRUE(line.deliver(second).empty());
}

TEST(Stranger, CannotKeepATelecommandForLongerThanItLives) {
  Line line;
  const wire::TcFrame kept = line.make(Type::bd, spi_bd).frame;
  const wire::TcFrame in_time = line.make(Type::bd, spi_bd).frame;
  line.pass(lifetime);
  EXPECT_EQ(line.deliver(in_time).size(), 1U);
  const wire::TcFrame late = line.make(Type::bd, spi_bd).frame;
  line.pass(lifetime + milliseconds(2));
  EXPECT_TRUE(line.deliver(kept).empty());
  EXPECT_TRUE(line.deliver(late).empty());
  EXPECT_EQ(line.chain().counters().replayed, 1U);
  EXPECT_EQ(line.chain().counters().too_old, 1U);
  EXPECT_EQ(line.deliver(line.make(Type::bd, spi_bd).frame).size(), 1U);
}

TEST(Stranger, WithoutAValidTimeTheNewestCounterIsTheClock) {
  Line line;
  line.time_valid = false;
  EXPECT_EQ(line.deliver(line.make(Type::bd, spi_bd).frame).size(), 1U);
  const wire::TcFrame kept = line.make(Type::bd, spi_bd).frame;
  line.pass(lifetime + milliseconds(2));
  EXPECT_TRUE(line.deliver(kept).empty());
  EXPECT_EQ(line.chain().counters().too_old, 1U);
}

TEST(Stranger, AClockThatIsSetWronglyLocksNobodyOut) {
  for (const milliseconds wrong :
       {milliseconds(-86'400'000), milliseconds(3'600'000), milliseconds(86'400'000)}) {
    Line line;
    EXPECT_EQ(line.deliver(line.make(Type::bd, spi_bd).frame).size(), 1U);
    line.clock_error = wrong;
    line.pass(milliseconds(5000));
    EXPECT_EQ(line.deliver(line.make(Type::bd, spi_bd).frame).size(), 1U) << wrong.count();
  }
}

TEST(Stranger, AGroundWhoseClockWasAheadIsNotLockedOutWhenItIsCorrected) {
  Line line;
  line.pass(milliseconds(86'400'000));
  const wire::TcFrame ahead = line.make(Type::bd, spi_bd).frame;
  line.clock_error = milliseconds(-86'400'000);  // the spacecraft's was right
  EXPECT_EQ(line.deliver(ahead).size(), 1U);
  for (int minute = 0; minute < 60; ++minute) {  // counters stand still, one above the other
    line.clock_error += milliseconds(60'000);
    line.ground_clock_back += milliseconds(60'000);
    const Sent& next = line.make(Type::bd, spi_bd);
    EXPECT_EQ(line.deliver(next.frame).size(), 1U) << minute;
  }
}

/// One schedule of a ground that commands by AD, BD, contingency keys and control commands, and a stranger.
class Attack {
 public:
  explicit Attack(std::uint64_t seed) : line_(true, seed) { line_.time_valid = seed % 4 != 0; }

  void run() {
    for (int i = 0; i < 12 && !testing::Test::HasFailure(); ++i) {
      line_.pass(milliseconds(line_.below(static_cast<std::size_t>(lifetime.count()) / 3)));
      line_.below(2) == 0 || line_.sent().empty() ? command() : meddle();
      EXPECT_FALSE(line_.farm().lockout);
    }
    // Whatever was done: the ground reads the control word, and both services work.
    expect_executed(line_.make(Type::bd, spi_bd).frame);
    expect_executed(line_.make(Type::ad, spi_ad, line_.farm().vr).frame);
  }
  [[nodiscard]] int executed() const { return executed_; }

 private:
  void command() {
    const bool jammed = line_.below(2) == 0;
    if (line_.below(3) == 0 || ahead_ > 8) {  // reads the control word
      next_ = line_.farm().vr;
      ahead_ = 0;
    }
    switch (line_.below(5)) {
      case 0:
        return pass_on(line_.make(Type::bd, spi_bd).frame, jammed);
      case 1:
        return pass_on(line_.make(Type::bd, spi_contingency).frame, jammed);
      case 2:
        return pass_on(line_.make(wire::ControlCommand{.kind = wire::ControlCommand::Kind::unlock}).frame,
                       jammed);
      case 3: {
        const auto vr = static_cast<std::uint8_t>(line_.farm().vr + line_.below(4));
        return pass_on(
            line_.make(wire::ControlCommand{.kind = wire::ControlCommand::Kind::set_vr, .vr = vr}).frame,
            jammed);
      }
      default:
        ++ahead_;
        return pass_on(line_.make(Type::ad, line_.below(3) == 0 ? spi_contingency : spi_ad, next_++).frame,
                       jammed);
    }
  }
  void pass_on(const wire::TcFrame& frame, bool jammed) {
    if (!jammed) deliver(frame, line_.sent().size() - 1);
  }

  /// Sends something recorded, as it was or with another header.
  void meddle() {
    const std::size_t number = line_.below(line_.sent().size());
    wire::TcFrame frame = line_.sent()[number].frame;
    const wire::TcFrame original = frame;
    switch (line_.below(6)) {
      case 0:
        frame.sequence = static_cast<std::uint8_t>(line_.below(256));
        break;
      case 1:
        frame.type = static_cast<Type>(line_.below(3));
        break;
      case 2:
        frame.data[line_.below(frame.data.size())] ^= static_cast<std::uint8_t>(1 + line_.below(255));
        break;
      case 3:
        frame.type = Type::bc;
        frame.data = wire::encode_control_command(
            {.kind = wire::ControlCommand::Kind::set_vr, .vr = static_cast<std::uint8_t>(line_.below(256))});
        break;
      default:
        break;
    }
    if (frame == original) return deliver(frame, number);
    const LinkState before = line_.chain().state();
    EXPECT_TRUE(line_.deliver(frame).empty());
    EXPECT_EQ(line_.chain().state(), before) << "an altered frame moved something";
  }

  void deliver(const wire::TcFrame& frame, std::size_t number) {
    const std::uint64_t before = line_.chain().state().generation;
    const auto executed = line_.deliver(frame);
    // Without a valid time the first frame says what time it is; it may have been held back.
    if (!first_age_ && line_.chain().state().generation != before) first_age_ = line_.age_ms(number);
    check(executed);
  }
  void check(const std::vector<std::size_t>& executed) {
    for (const std::size_t number : executed) {
      ++executed_;
      EXPECT_TRUE(!last_ || number > *last_) << number << " was executed again, or behind a later one";
      last_ = number;
      const std::int64_t more = line_.time_valid ? 0 : first_age_.value_or(0);
      EXPECT_LE(line_.age_ms(number), lifetime.count() + more);
    }
  }
  void expect_executed(const wire::TcFrame& frame) {
    const auto executed = line_.deliver(frame);
    EXPECT_EQ(executed.size(), 1U) << "the ground is locked out";
    check(executed);
  }

  Line line_;
  std::uint8_t next_ = 0;  ///< N(S)
  int ahead_ = 0;
  int executed_ = 0;
  std::optional<std::size_t> last_;
  std::optional<std::int64_t> first_age_;
};

TEST(StrangerProperties, NothingIsExecutedOutOfOrderOrTooLateAndNobodyIsLockedOut) {
  const char* const wanted = std::getenv("SRFS_SCHEDULES");
  const std::uint64_t schedules = wanted != nullptr       ? std::strtoull(wanted, nullptr, 10)
                                  : testing_support::slow ? 500
                                                          : 10'000;
  int executed = 0;
  for (std::uint64_t seed = 1; seed <= schedules && !HasFailure(); ++seed) {
    SCOPED_TRACE(testing::Message() << "schedule " << seed);
    Attack attack(seed);
    attack.run();
    executed += attack.executed();
  }
  EXPECT_GT(executed, static_cast<int>(2 * schedules));
}

TEST(RefusedFrames, AreReportedAtOnceAndThenSummedUpOnceInAPeriod) {
  RefusedFrames frames;
  UplinkCounters counters;
  const MonotonicTime begun(seconds(1000));
  EXPECT_FALSE(frames.take_due(counters, begun));
  counters.not_authentic = 1;
  const auto first = frames.take_due(counters, begun);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->not_authentic, 1U);
  EXPECT_EQ(first->since, seconds(0));

  int reports = 0;
  std::uint32_t told = 0;
  for (int second = 1; second <= 600; ++second) {
    counters.not_authentic += 1300;
    counters.replayed += 7;
    counters.refused_counter = 4711;
    const auto sum = frames.take_due(counters, begun + seconds(second));
    if (!sum) continue;
    ++reports;
    told += sum->not_authentic;
    EXPECT_EQ(sum->since, RefusedFrames::period);
    EXPECT_EQ(sum->newest_counter, 4711U);
  }
  EXPECT_EQ(reports, 10);
  EXPECT_EQ(told + 1, counters.not_authentic) << "none is left out";
}

}  // namespace
}  // namespace srfs
