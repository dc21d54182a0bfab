// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/ttc_core.hpp"

#include <algorithm>
#include <deque>
#include <map>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "nodes/ttc/test/simulated_medium.hpp"
#include "tests/build_kind.hpp"
#include "tests/mission_dictionary.hpp"
#include "wire/cadu.hpp"
#include "wire/tc_uplink.hpp"

namespace srfs {
namespace {

using testing_support::SimulatedMedium;

constexpr std::uint16_t spacecraft = 0x0A5;
constexpr std::uint8_t channel = 1;
constexpr std::uint64_t worlds = testing_support::slow ? 60 : 1000;

DownlinkConfig downlink_config() {
  DownlinkConfig config;
  config.spacecraft_id = spacecraft;
  return config;
}

/// Everything around TtcCore: the ground with its line, the disk, the nodes that execute telecommands, and a
/// hand that ends the process between any two actions. What is asked for happens later, in the order of its
/// worker, or fails.
class World {
 public:
  /// @param disk_fails  now and then, and is slow; else every wait for it is as long as it takes
  World(const mission::Dictionary& dictionary, std::uint64_t seed, bool disk_fails)
      : dictionary_(dictionary), disk_fails_(disk_fails), random_(seed), medium_(seed) {
    start();
  }

  void step() {
    now_ += milliseconds(below(400));
    switch (below(10)) {
      case 0:
        return send();
      case 1:
      case 2:
        return carry_out(journal_);
      case 3:
        return carry_out(below(3) == 0 ? others_ : publications_);
      case 4:
        return report();
      case 5:
        listen();
        return;
      case 6:
        core_->on_deadline(now_);
        core_->on_line_idle(now_);
        return go_on();
      case 7:
        if (below(12) == 0) return kill();
        core_->commit_stores(true, now_);
        return go_on();
      case 8:
        return raise();
      default:
        if (disk_fails_ && below(10) == 0) medium_.failing = !medium_.failing;
        return;
    }
  }
  /// No fault any more, and everybody answers.
  void come_to_rest() {
    medium_.failing = false;
    int end = 400;
    for (int i = 0; i < end; ++i) {
      if (core_->has_waiting_actions()) end = i + 400;
      now_ += milliseconds(200);
      while (!journal_.empty()) carry_out(journal_);
      while (!others_.empty()) carry_out(others_);
      while (!publications_.empty()) carry_out(publications_);
      while (!reports_.empty()) report();
      core_->on_deadline(now_);
      core_->on_line_idle(now_);
      if (i % 5 == 0) core_->commit_stores(true, now_);
      go_on();
      listen();
    }
  }

  [[nodiscard]] const TtcCore& core() const { return *core_; }
  [[nodiscard]] const std::map<std::uint64_t, int>& executions() const { return executions_; }
  [[nodiscard]] const std::map<std::uint16_t, std::set<std::uint64_t>>& ids() const { return ids_; }
  [[nodiscard]] const std::map<std::uint16_t, std::set<int>>& ends() const { return ends_; }
  [[nodiscard]] const std::set<std::uint16_t>& accepted() const { return accepted_; }
  [[nodiscard]] int kills() const { return kills_; }
  /// Packets that an event released: those of the ground have another source.
  [[nodiscard]] std::size_t released() const {
    return static_cast<std::size_t>(std::count_if(
        ids_.begin(), ids_.end(), [](const auto& entry) { return (entry.first & on_board) != 0; }));
  }

 private:
  static constexpr std::uint16_t on_board = 0x8000;  ///< in a sequence count: its source is on board
  static std::uint16_t name_of(std::uint16_t sequence, std::uint16_t source) {
    return static_cast<std::uint16_t>((sequence & 0x3FFF) |
                                      (source == EventActionService::on_board_source ? on_board : 0));
  }
  std::size_t below(std::size_t n) { return random_() % n; }
  /// A node raises an event that has an action.
  void raise() {
    mission::EpsLoadsChangedEvent event;
    core_->on_event("payload_eps", event.event_id, static_cast<std::uint8_t>(event.severity), event.encoded(),
                    now_);
    go_on();
  }
  /// An action on that event, as it stands on disk.
  [[nodiscard]] StoredTable actions() const {
    const auto added = dictionary_.encode(
        "event_action.add", {"event=eps.loads_changed", "request=eps.switch_load load=1 state=off"});
    EXPECT_TRUE(added);
    OctetWriter out;
    out.u8(1);   // version
    out.u16(0);  // requests that changed it
    out.u8(1);   // the function is enabled
    out.u16(1);
    out.u8(1);
    out.bytes(OctetView(added->data).subspan(2));
    return {.generation = 1, .content = out.take()};
  }
  void start() {
    AcceptanceJournal journal("boot", seconds(60));
    log_ = std::make_unique<JournalLog>(medium_);
    for (const JournalRecord& record : log_->load().records) EXPECT_TRUE(journal.apply(record));
    journal.begin({}, 1, now_);
    UplinkConfig uplink;
    uplink.spacecraft_id = spacecraft;
    uplink.cltu.randomized = false;
    uplink.channels.push_back(UplinkChannel{.vc = channel, .associations = {}});
    core_.emplace(TtcCore::Setup{
        .dictionary = dictionary_,
        .node = "ttc",
        .journal = std::move(journal),
        .uplink = std::move(uplink),
        .downlink = downlink_config(),
        .mode = ModeManager(mode_.empty() ? StoredModeState::first_start : StoredModeState::present, mode_,
                            MissionMode::nominal),
        .transmitter = TransmitterSwitch("boot", "", now_),
        .command_loss = CommandLossTimer("boot", "", seconds(259'200), now_),
        .stores = "",
        .event_actions = {.table = actions()},
        .keys = {},
        .boot = {.count = 1},
        .clock = SpacecraftClock(UtcTime(seconds(1'795'000'000)), now_),
        .persist_deadline = disk_fails_ ? seconds(1) : seconds(3600)});
    frames_.emplace(spacecraft, downlink_config().cadu.frame_octets);
    ground_.emplace(downlink_config().cadu);
    packets_ = wire::TmPacketReassembly();
    for (const mission::Event& event : dictionary_.events()) core_->events().add_event(event.id);
    core_->restore(now_);
    core_->activate(now_);
    go_on();
  }
  /// The process ends. The actions that wait never happen, but what a worker has begun may.
  void kill() {
    ++kills_;
    if (below(2) == 0) carry_out(journal_, false);
    journal_.clear();
    others_.clear();
    publications_.clear();
    start();
  }

  /// The ground sends one telecommand, or the last one once more, soon enough to be a repeat.
  void send() {
    constexpr milliseconds repeat_time{900};
    if (below(3) != 0 || last_.empty() || now_ - sent_ > repeat_time) {
      static const std::vector<std::pair<const char*, std::vector<std::string>>> commands{
          {"eps.switch_load", {"load=2", "state=on"}},
          {"ttc.set_mode", {"mode=nominal"}},
          {"ttc.disarm", {}},
          {"eps.switch_load", {"load=3", "state=off"}}};
      const auto& [name, arguments] = commands[below(commands.size())];
      const auto encoded = dictionary_.encode(name, arguments);
      ASSERT_TRUE(encoded) << encoded.error().message;
      wire::TcPacket packet;
      packet.apid = encoded->command->apid;
      packet.sequence_count = ++sequence_;
      packet.ack_flags = wire::ack::all;
      packet.service = encoded->command->service;
      packet.subtype = encoded->command->subtype;
      packet.application = encoded->data;
      last_ = wire::make_tc_packet(packet);
      sent_ = now_;
    }
    const auto cltu = wire::make_uplink_cltu({.spacecraft_id = spacecraft, .vc = channel},
                                             wire::TcFrameType::bd, 0, nullptr, last_);
    ASSERT_TRUE(cltu);
    core_->on_octets(*cltu, now_);
    go_on();
  }

  void go_on() {
    take(core_->settle(now_));
    core_->fill_downlink(now_);
    take(core_->take_actions());
  }
  void take(TtcCore::Actions actions) {
    for (TtcAction& action : actions) {
      if (std::holds_alternative<WriteJournal>(action)) {
        journal_.push_back(std::move(action));
      } else if (std::holds_alternative<PublishTelecommand>(action)) {
        publications_.push_back(std::move(action));
      } else {
        others_.push_back(std::move(action));
      }
    }
  }

  /// A node gets a telecommand: it is on the disk, unless its record could not be written in time.
  void arrive(const Telecommand& telecommand) {
    const std::uint64_t id = telecommand.origin.id;
    if (!executions_.contains(id) && now_ >= telecommand.expiry) return;  // it begins nothing any more
    const bool known = !executions_.emplace(id, 1).second;
    if (!known) {
      const auto packet = recorded(id);
      EXPECT_TRUE(packet || disk_has_failed_) << id << " is executed and not on the disk";
      if (packet) ids_[*packet].insert(id);
    }
    // A node that knows it says again how far it got; a report may be lost.
    const auto say = [&](Stage stage) {
      if (below(5) != 0)
        reports_.emplace_back(telecommand.command->node, StageReached{.id = id, .stage = stage});
    };
    if (!known) say(Stage::acceptance);
    if (known || below(3) != 0) {
      say(Stage::acceptance);
      say(Stage::start);
      say(Stage::completion);
    }
  }
  /// Sequence count of the packet that the journal on the disk has under this id.
  std::optional<std::uint16_t> recorded(std::uint64_t id) {
    AcceptanceJournal journal("boot", seconds(60));
    JournalLog log(medium_);
    for (const JournalRecord& record : log.load().records) journal.apply(record);
    for (const AcceptedTelecommand* t : journal.known()) {
      if (t->origin.id == id) return name_of(t->origin.request.packet_sequence_control, t->origin.source_id);
    }
    return std::nullopt;
  }

  void report() {
    if (reports_.empty()) return;
    const std::size_t at = below(2) == 0 ? 0 : below(reports_.size());
    const auto [node, one] = reports_[at];
    reports_.erase(reports_.begin() + static_cast<std::ptrdiff_t>(at));
    core_->on_telecommand_report(node, one, now_);
    go_on();
  }

  void carry_out(std::deque<TtcAction>& queue, bool answered = true) {
    if (queue.empty()) return;
    const TtcAction action = std::move(queue.front());
    queue.pop_front();
    if (const auto* published = std::get_if<PublishTelecommand>(&action)) {
      arrive(published->telecommand);
      answered = false;
    } else if (const auto* write = std::get_if<WriteJournal>(&action)) {
      const auto written = write->batch.snapshot ? log_->snapshot(*write->batch.snapshot)
                                                 : log_->append(write->batch.records, write->batch.sync);
      if (!written) disk_has_failed_ = true;
      if (answered) core_->on_journal_written(write->batch, written, log_->used_octets(), now_);
    } else if (const auto* state = std::get_if<WriteState>(&action)) {
      if (!medium_.failing && state->name == "mode") mode_ = state->text;
      core_->on_state_written(state->change, !medium_.failing);
    } else if (const auto* commit = std::get_if<CommitStores>(&action)) {
      core_->on_committed(*commit, {}, {});
    } else if (std::holds_alternative<TakeFilesTurn>(action)) {
      core_->on_files_turn_refused(now_);
    }
    if (answered) go_on();
  }

  /// The ground takes the frames on the line.
  void listen() {
    for (int i = 0; i < 20; ++i) {
      const auto cadu = core_->next_cadu(now_);
      if (!cadu) {
        now_ += milliseconds(60);
        continue;
      }
      for (const auto& found : ground_->push(*cadu)) {
        const auto frame = frames_->decode(found.frame);
        if (!frame || frame->vc != 0) continue;
        for (const Octets& octets : packets_.push(*frame)) hear(octets);
      }
    }
  }
  void hear(const Octets& octets) {
    const auto packet = wire::parse_tm_packet(octets);
    ASSERT_TRUE(packet);
    if (packet->service != 1) return;
    OctetReader in(packet->source);
    in.u16();
    const std::uint16_t sequence = name_of(in.u16(), packet->destination_id);
    if (packet->subtype == 1) accepted_.insert(sequence);
    if (packet->subtype == 4 || packet->subtype >= 7) ends_[sequence].insert(packet->subtype);
  }

  const mission::Dictionary& dictionary_;
  bool disk_fails_;
  std::mt19937_64 random_;
  SimulatedMedium medium_;
  std::string mode_;
  MonotonicTime now_{seconds(100)};
  std::unique_ptr<JournalLog> log_;
  std::optional<TtcCore> core_;
  std::deque<TtcAction> journal_;  ///< for its worker
  std::deque<TtcAction> others_;
  std::deque<TtcAction> publications_;
  bool disk_has_failed_ = false;
  int kills_ = 0;
  // The ground
  std::optional<wire::CaduSynchroniser> ground_;
  std::optional<wire::TmFrameDecoder> frames_;
  wire::TmPacketReassembly packets_;
  std::uint16_t sequence_ = 0;
  Octets last_;
  MonotonicTime sent_;
  std::set<std::uint16_t> accepted_;             ///< sequence counts with 1,1
  std::map<std::uint16_t, std::set<int>> ends_;  ///< subtypes of service 1, per sequence count
  // The nodes
  std::map<std::uint64_t, int> executions_;                    ///< by id
  std::map<std::uint16_t, std::set<std::uint64_t>> ids_;       ///< under which a packet was executed
  std::vector<std::pair<std::string, StageReached>> reports_;  ///< with the node
};

TEST(TtcCoreProperties, WhereverItIsKilledEachTelecommandRunsOnceAndItsEndReachesTheGround) {
  const auto& dictionary = testing_support::dictionary();
  int kills = 0;
  std::size_t executed = 0;
  std::size_t released = 0;
  for (std::uint64_t seed = 1; seed <= worlds; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    World world(dictionary, seed, false);
    for (int i = 0; i < 400; ++i) world.step();
    world.come_to_rest();
    EXPECT_EQ(world.core().journal().open(), 0U);
    for (const auto& [sequence, ids] : world.ids())
      EXPECT_EQ(ids.size(), 1U) << "packet " << sequence << " was executed more than once";
    for (const std::uint16_t sequence : world.accepted())
      EXPECT_TRUE(world.ends().contains(sequence)) << "packet " << sequence << " has no end";
    for (const auto& [sequence, ends] : world.ends())
      EXPECT_EQ(ends.size(), 1U) << "packet " << sequence << " has ends " << *ends.begin() << " and "
                                 << *ends.rbegin();
    kills += world.kills();
    executed += world.executions().size();
    released += world.released();
    if (HasFailure()) return;
  }
  EXPECT_GT(released, worlds);
  EXPECT_GT(kills, 2 * static_cast<int>(worlds));
  EXPECT_GT(executed, 3 * worlds);
}

TEST(TtcCoreProperties, WithADiskThatFailsNowAndThenNothingIsStuckAndNothingRunsTwice) {
  const auto& dictionary = testing_support::dictionary();
  for (std::uint64_t seed = 1; seed <= worlds; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    World world(dictionary, seed, true);
    for (int i = 0; i < 400; ++i) world.step();
    world.come_to_rest();
    EXPECT_EQ(world.core().journal().open(), 0U);
    for (const auto& [sequence, ids] : world.ids())
      EXPECT_EQ(ids.size(), 1U) << "packet " << sequence << " was executed more than once";
    if (HasFailure()) return;
  }
}

/// A core that no telecommand reaches, with two sets of keys.
class CommandLoss : public testing::Test {
 protected:
  static constexpr seconds patience{86'400};
  static constexpr seconds step{3600};

  CommandLoss() { fly({}); }

  /// Anew, with these modes.
  void fly(suite::ModeSettings modes) {
    UplinkConfig uplink;
    uplink.spacecraft_id = spacecraft;
    uplink.cltu.randomized = false;
    uplink.channels.push_back(UplinkChannel{.vc = channel, .associations = {}});
    std::uint16_t spi = 0;
    for (const KeySet set : {KeySet::a, KeySet::b}) {
      auto key = wire::SdlsKey::from_hex(std::string(63, '1') + std::to_string(++spi));
      EXPECT_TRUE(key);
      uplink.channels.back().associations.push_back(
          UplinkAssociation{.spi = spi, .key = std::move(*key), .for_ad = true, .for_bd = true, .set = set});
    }
    AcceptanceJournal journal("boot", seconds(60));
    journal.begin({}, 1, now_);
    core_.emplace(TtcCore::Setup{.dictionary = dictionary_,
                                 .node = "ttc",
                                 .journal = std::move(journal),
                                 .uplink = std::move(uplink),
                                 .downlink = downlink_config(),
                                 .mode = ModeManager(StoredModeState::first_start, "", MissionMode::nominal),
                                 .transmitter = TransmitterSwitch("boot", "", now_),
                                 .command_loss = CommandLossTimer("boot", "", patience, now_),
                                 .stores = "",
                                 .keys = {},
                                 .boot = {.count = 1},
                                 .clock = SpacecraftClock(UtcTime(seconds(1'795'000'000)), now_),
                                 .modes = std::move(modes)});
    core_->activate(now_);
    (void)core_->settle(now_);
  }

  TtcCore::Actions after(nanoseconds time) {
    now_ = now_ + time;
    return core_->settle(now_);
  }
  template <class Action>
  static const Action* find(const TtcCore::Actions& actions) {
    for (const TtcAction& action : actions) {
      if (const auto* found = std::get_if<Action>(&action)) return found;
    }
    return nullptr;
  }
  static std::vector<std::uint16_t> events(const TtcCore::Actions& actions) {
    std::vector<std::uint16_t> ids;
    for (const TtcAction& action : actions) {
      if (const auto* event = std::get_if<RaiseEvent>(&action)) ids.push_back(event->event_id);
    }
    return ids;
  }
  static const WriteState* stored(const TtcCore::Actions& actions) {
    for (const TtcAction& action : actions) {
      const auto* state = std::get_if<WriteState>(&action);
      if (state != nullptr && state->name == "command_loss") return state;
    }
    return nullptr;
  }

  const mission::Dictionary& dictionary_ = testing_support::dictionary();
  MonotonicTime now_{seconds(100)};
  std::optional<TtcCore> core_;
};

TEST_F(CommandLoss, LeadsToModeSafeThenToTheLineTheKeysAndARestartOfTheComputer) {
  (void)after(patience - seconds(1));
  const auto safe = after(seconds(1));
  EXPECT_EQ(events(safe), (std::vector{mission::event::ttc_command_loss, mission::event::ttc_mode_changed}));
  ASSERT_NE(find<PublishMode>(safe), nullptr);
  EXPECT_EQ(find<PublishMode>(safe)->mode, MissionMode::safe);
  EXPECT_NE(stored(safe), nullptr);

  const auto line = after(step);
  EXPECT_NE(find<ReopenLine>(line), nullptr);
  EXPECT_NE(stored(line), nullptr);

  const auto keys = after(step);
  const auto* selection = find<WriteKeys>(keys);
  ASSERT_NE(selection, nullptr);
  EXPECT_EQ(selection->change.vc, channel);
  EXPECT_EQ(selection->change.set, KeySet::b);
  core_->on_keys_written(selection->change, true, now_);
  EXPECT_EQ(core_->journal().open(), 0U) << "nobody waits for an end";

  const auto restart = after(step);
  EXPECT_EQ(find<RestartComputer>(restart), nullptr) << "not before its record is on disk";
  const auto* record = stored(restart);
  ASSERT_NE(record, nullptr);
  core_->on_state_written(record->change, true);
  const auto then = after(nanoseconds(0));
  EXPECT_NE(find<RestartComputer>(then), nullptr);

  (void)after(std::chrono::hours(22));
  const auto again = after(step);
  ASSERT_NE(find<WriteKeys>(again), nullptr);
  EXPECT_EQ(find<WriteKeys>(again)->change.set, KeySet::a) << "in turn";
}

TEST_F(CommandLoss, IsSavedAndSaysWhenItActsNext) {
  const auto saved = after(seconds(5));
  ASSERT_NE(stored(saved), nullptr);
  EXPECT_LE(core_->next_due(now_).value_or(now_ + std::chrono::hours(1)), now_ + seconds(60));
  const CommandLossTimer next("other boot", stored(saved)->text, patience, MonotonicTime{});
  EXPECT_EQ(next.until_next({}), nanoseconds(patience - seconds(5)));
}

/// A file that waits for the budget of a mode does not keep ttc busy.
TEST_F(CommandLoss, FilesBeyondTheBudgetOfAModeAreTriedAtTheScansAlone) {
  suite::ModeSettings modes;
  modes.table["nominal"]["ttc"].downlink_octets_s = 1;
  fly(std::move(modes));
  int turns = 0;
  for (int wake = 0; wake < 10; ++wake) {
    core_->fill_downlink(now_);
    for (const TtcAction& action : core_->take_actions()) {
      if (!std::holds_alternative<TakeFilesTurn>(action)) continue;
      ++turns;
      Result<cfdp::TransferTurnResult, std::string> result{cfdp::TransferTurnResult{.next_due = now_}};
      core_->on_files_turn(result, now_);
    }
    const auto due = core_->next_due(now_);
    ASSERT_TRUE(due);
    ASSERT_GT(*due, now_) << "at once again";
    (void)after(*due - now_);
  }
  EXPECT_GT(turns, 0);
}

}  // namespace
}  // namespace srfs
