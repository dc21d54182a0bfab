// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A key change from the ground's files to the spacecraft's and back, cut at every point.
#include "ground/key_change.hpp"

#include <gtest/gtest.h>

#include <array>
#include <random>
#include <utility>

#include "nodes/ttc/services/key_management_service.hpp"
#include "tests/mission_dictionary.hpp"
#include "wire/tc_uplink.hpp"

namespace srfs::ground {
namespace {

using testing_support::dictionary;

constexpr std::uint16_t spi = 1;
constexpr std::uint16_t contingency_spi = 5;
constexpr std::uint16_t spacecraft_id = 0xAB;

wire::SdlsKey key(std::uint8_t first) {
  return wire::SdlsKey({first, 0x5A, 0x17});
}

/// What is cut, at the point with the number of the cut.
enum class Cut : std::uint8_t { nothing, ground, spacecraft, telecommand, report, disk };
struct GroundCut {};
struct SpacecraftCut {};

/// Both copies of the session keys of one end. A write that is cut leaves one copy torn.
class Disk {
 public:
  [[nodiscard]] wire::SessionKeys load() const {
    wire::SessionKeys newest;
    for (const std::string& copy : copies_) {
      const auto keys = wire::decode_session_keys(copy);
      if (keys && keys->generation() >= newest.generation()) newest = *keys;
    }
    return newest;
  }
  /// As StateFile: the older copy first. @param cut_at  octets that come on the medium
  void write_copy(std::size_t which, const wire::SessionKeys& keys, std::size_t cut_at = std::string::npos) {
    copies_.at(which) = wire::encode_session_keys(keys).substr(0, cut_at);
  }
  std::size_t older() const {
    const auto first = wire::decode_session_keys(copies_[0]);
    const auto second = wire::decode_session_keys(copies_[1]);
    return first && (!second || first->generation() > second->generation()) ? 1 : 0;
  }

 private:
  std::array<std::string, 2> copies_;
};

class World {
 public:
  World(Cut cut, int at, std::uint32_t seed) : cut_(cut), at_(at), random_(seed) { start_spacecraft(); }

  /// One run of `srfs-ground keys replace`.
  Exit replace() {
    KeyChange change(ground_.load(), KeyChange::Master{.id = 1, .key = key(0xEE)},
                     {.ask = [this](const TelecommandText& text) { return ask(text); },
                      .answers = [this]() -> const std::vector<TelemetryReport>& { return answers_; },
                      .store = [this](const auto& keys) { return store_on_ground(keys); },
                      .random = [this](std::size_t octets) { return drawn(octets); },
                      .tell = [](const std::string&) {},
                      .fail = [](const std::string&) {}});
    try {
      return change.replace(spi);
    } catch (const GroundCut&) {
      return Exit::unknown;
    }
  }
  /// As it is, and as it is after a loss of power on board.
  [[nodiscard]] bool ground_is_heard() {
    const wire::SdlsKey now = ground_key();
    UplinkChain after_power_loss(config(), link_);
    return uplink_->has_key(now.octets()) && after_power_loss.has_key(now.octets());
  }
  void cut_next(Cut cut, int at) {
    cut_ = cut;
    at_ = at;
  }
  void end_cuts() { cut_ = Cut::nothing; }
  void restart_spacecraft() { start_spacecraft(); }
  [[nodiscard]] int points() const { return points_; }
  [[nodiscard]] int cuts() const { return cuts_; }
  [[nodiscard]] Exit ping() { return ask(inventory_command()); }
  [[nodiscard]] wire::SessionKeys on_board() const { return board_.load(); }
  [[nodiscard]] wire::SessionKeys on_ground() const { return ground_.load(); }
  [[nodiscard]] wire::SdlsKey ground_key() const {
    const auto keys = ground_.load();
    const auto use = keys.use_of(spi);
    const auto* current = use ? keys.find(use->current) : nullptr;
    return current != nullptr ? current->octets.key() : key(1);
  }
  /// Whether frames under @p old are taken still.
  [[nodiscard]] bool takes(const wire::SdlsKey& old) const { return uplink_->has_key(old.octets()); }

 private:
  bool is_cut(Cut what) {
    const bool now = points_++ == at_ && cut_ == what;
    cuts_ += now ? 1 : 0;
    return now;
  }
  Octets drawn(std::size_t octets) {
    Octets random(octets);
    for (std::uint8_t& octet : random) octet = static_cast<std::uint8_t>(random_());
    return random;
  }

  // ---- disks

  template <class Interrupted>
  void store(Disk& disk, const wire::SessionKeys& keys, Cut end) {
    const std::size_t first = disk.older();
    for (const std::size_t which : {first, 1 - first}) {
      if (is_cut(end)) throw Interrupted{};
      if (is_cut(end)) {
        disk.write_copy(which, keys, random_() % wire::encode_session_keys(keys).size());
        throw Interrupted{};
      }
      disk.write_copy(which, keys);
    }
    if (is_cut(end)) throw Interrupted{};
  }
  Result<void, std::string> store_on_ground(const wire::SessionKeys& keys) {
    store<GroundCut>(ground_, keys, Cut::ground);
    return {};
  }

  // ---- line

  Exit ask(const TelecommandText& text) {
    answers_.clear();
    if (is_cut(Cut::ground)) throw GroundCut{};
    const auto encoded = dictionary().encode(text.name, text.arguments);
    EXPECT_TRUE(encoded) << (encoded ? "" : encoded.error().message);
    const Octets packet = wire::make_tc_packet({.apid = encoded->command->apid,
                                                .service = encoded->command->service,
                                                .subtype = encoded->command->subtype,
                                                .application = encoded->data});
    const wire::SdlsKey used = ground_key();
    const wire::SdlsSeal seal{.key = used, .spi = spi, .counter = ++counter_, .sender = 7};
    const auto cltu = wire::make_uplink_cltu({.spacecraft_id = spacecraft_id, .vc = 0, .whole_header = true},
                                             wire::TcFrameType::bd, 0, &seal, packet);
    if (is_cut(Cut::telecommand)) return Exit::refused;
    try {
      receive(*cltu);
    } catch (const SpacecraftCut&) {
      start_spacecraft();
    }
    const std::vector<Report> reports = reports_.take();
    if (is_cut(Cut::ground)) throw GroundCut{};
    if (is_cut(Cut::report)) return Exit::refused;
    return judge(reports);
  }
  Exit judge(const std::vector<Report>& reports) {
    bool completed = false;
    for (const Report& report : reports) {
      completed = completed || (report.service == 1 && report.subtype == 7);
      const wire::TmPacket packet{
          .apid = report.apid, .service = report.service, .subtype = report.subtype, .source = report.data};
      if (report.service != 1) answers_.push_back(decode_telemetry(dictionary(), {.packet = packet}));
    }
    return completed ? Exit::done : Exit::refused;
  }

  // ---- spacecraft

  [[nodiscard]] UplinkConfig config() const {
    UplinkConfig config;
    config.spacecraft_id = spacecraft_id;
    config.strict = true;
    UplinkChannel channel;
    channel.associations.push_back({.spi = spi, .key = key(1)});
    channel.associations.push_back({.spi = contingency_spi, .key = key(5), .set = std::nullopt});
    config.channels.push_back(std::move(channel));
    use_session_keys(config, board_.load());
    return config;
  }
  void start_spacecraft() {
    service_.reset();
    UplinkConfig fresh = config();
    const auto rekeyable = rekeyable_associations(fresh);
    uplink_.emplace(std::move(fresh), link_);
    reports_ = {};
    std::vector<KeyEncryptionKey> masters;
    masters.push_back({.id = 1, .key = key(0xEE)});
    service_.emplace(board_.load(), std::move(masters), rekeyable, *uplink_, reports_);
  }
  void receive(OctetView cltu) {
    for (UplinkedPacket& packet : uplink_->push(cltu, now_)) {
      link_ = packet.link;
      service_->on_confirmed(uplink_->take_confirmed());
      if (is_cut(Cut::spacecraft)) throw SpacecraftCut{};
      store_what_is_to_be();
      execute(packet.packet);
      store_what_is_to_be();
      if (is_cut(Cut::spacecraft)) throw SpacecraftCut{};
    }
  }
  void execute(OctetView packet) {
    const auto parsed = wire::parse_tc_packet(packet);
    ASSERT_TRUE(parsed);
    const auto* command = dictionary().request(parsed->apid, parsed->service, parsed->subtype);
    ASSERT_NE(command, nullptr);
    ASSERT_TRUE(dictionary().check_arguments(*command, parsed->application));
    service_->execute({.origin = {.apid = 1, .ack_flags = wire::ack::all, .id = ++telecommand_id_},
                       .command = command,
                       .arguments = parsed->application},
                      now_);
  }
  void store_what_is_to_be() {
    while (auto change = service_->take_change()) {
      const bool works = !is_cut(Cut::disk);
      if (works) store<SpacecraftCut>(board_, change->keys, Cut::spacecraft);
      service_->on_stored(*change, works);
    }
  }

  Cut cut_;
  int at_;
  int points_ = 0;
  int cuts_ = 0;
  std::mt19937 random_;
  MonotonicTime now_;
  Disk ground_;
  Disk board_;
  LinkState link_;
  std::optional<UplinkChain> uplink_;
  ReportQueue reports_;
  std::optional<KeyManagementService> service_;
  std::vector<TelemetryReport> answers_;
  std::uint64_t counter_ = lowest_clock_counter;
  std::uint64_t telecommand_id_ = 0;
};

TEST(KeyChange, ReplacesAKeyAndEndsTheOldOneWithTheFirstFrameUnderTheNew) {
  World world(Cut::nothing, -1, 1);
  ASSERT_EQ(world.replace(), Exit::done);
  EXPECT_FALSE(world.takes(key(1))) << "the file's key";
  EXPECT_EQ(world.on_board().use_of(spi), (wire::SessionKeys::Use{.spi = spi, .current = 128}));
  EXPECT_EQ(world.on_ground().use_of(spi), (wire::SessionKeys::Use{.spi = spi, .current = 128}));

  const auto first = world.ground_key();
  ASSERT_EQ(world.replace(), Exit::done);
  EXPECT_FALSE(world.takes(first));
  EXPECT_EQ(world.on_board().keys().size(), 1U) << "the old one is destroyed";
  EXPECT_EQ(world.on_ground().keys().size(), 1U);
}

TEST(KeyChange, TheOldKeyWorksUntilTheFirstFrameUnderTheNewOne) {
  for (int at = 0;; ++at) {
    World world(Cut::ground, at, 2);
    if (world.replace() == Exit::done) break;  // behind the last point
    const bool switched = world.ground_key().octets() != key(1).octets();
    EXPECT_TRUE(switched || world.takes(key(1))) << "cut " << at;
  }
}

/// Cut once at every point there is, at either end, on the line and on the disk: the ground is heard at once,
/// also if the spacecraft lost its power then, and the change is completed by doing it again.
TEST(KeyChangeProperty, CutAtAnyPointBothEndsHaveAWorkingKeyAndTheNextRunCompletesIt) {
  int cuts = 0;
  for (const Cut cut : {Cut::ground, Cut::spacecraft, Cut::telecommand, Cut::report, Cut::disk}) {
    for (int round : {0, 1}) {  // the first key after the file's, and another one
      for (int at = 0;; ++at) {
        World world(cut, -1, static_cast<std::uint32_t>(at));
        if (round == 1) {
          ASSERT_EQ(world.replace(), Exit::done);
        }
        const int begun = world.points();
        world.cut_next(cut, begun + at);
        const auto before = world.ground_key();
        const Exit exit = world.replace();
        const bool over = world.points() - begun <= at;
        SCOPED_TRACE(testing::Message() << "cut " << static_cast<int>(cut) << " at " << at);
        ASSERT_TRUE(world.ground_is_heard());
        if (over) break;
        cuts += world.cuts();
        world.end_cuts();
        if (at % 2 == 0) world.restart_spacecraft();
        ASSERT_TRUE(world.ground_is_heard());
        ASSERT_EQ(world.ping(), Exit::done);
        if (exit != Exit::done) {
          ASSERT_EQ(world.replace(), Exit::done);
        }
        EXPECT_NE(world.ground_key().octets(), before.octets());
        ASSERT_EQ(world.ping(), Exit::done);
        EXPECT_FALSE(world.takes(before)) << "the old one has ended";
      }
    }
  }
  EXPECT_GT(cuts, 100);
}

/// Many cuts in many runs.
TEST(KeyChangeProperty, ManyCutsInARowLeaveAWorkingKey) {
  for (std::uint32_t seed = 1; seed <= 300; ++seed) {
    std::mt19937 random(seed);
    World world(Cut::nothing, -1, seed);
    for (int run = 0; run < 12; ++run) {
      world.cut_next(static_cast<Cut>(1 + random() % 5), world.points() + static_cast<int>(random() % 60));
      (void)world.replace();
      if (random() % 3 == 0) world.restart_spacecraft();
      ASSERT_TRUE(world.ground_is_heard()) << "seed " << seed << ", run " << run;
    }
    world.end_cuts();
    ASSERT_EQ(world.replace(), Exit::done) << "seed " << seed;
    EXPECT_LE(world.on_board().keys().size(), 2U);
  }
}

}  // namespace
}  // namespace srfs::ground
