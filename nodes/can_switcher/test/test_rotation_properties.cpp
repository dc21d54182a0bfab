#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "nodes/can_switcher/task_flag_rotation.hpp"

namespace srfs {
namespace {

/// A world of payload processes that take, release, hang, die, restart and leave, over a topic that delays,
/// loses, repeats and reorders their reports. It knows who could really write to the bus at any time.
class World {
 public:
  explicit World(std::uint64_t seed) : random_(seed), rotation_(slots(), 3, now_) {}

  void step() {
    now_ += microseconds(random_() % 30'000);
    deliver_due();
    switch (random_() % 10) {
      case 0:
      case 1:
      case 2:
        decide(rotation_.on_tick(now_, cycle_ += random_() % 8 == 0 ? random_() % 3 : 1, now_));
        break;
      case 3:
      case 4:
        decide(rotation_.on_deadline(now_));
        break;
      case 5:
        if (fencing_) {
          writers_[fencing_->payload_index].reset();
          known_[fencing_->payload_index] = false;  // the next process of it has not spoken yet
          rotation_.on_fenced(fencing_->id, now_);
          fencing_.reset();
        }
        break;
      case 6:
      case 7:
        holder_acts();
        break;
      case 8:
        noise();
        break;
      default:
        change_plan();
        break;
    }
  }

  [[nodiscard]] std::uint32_t grants() const { return grants_; }
  [[nodiscard]] std::uint32_t fences() const { return fences_; }
  [[nodiscard]] std::uint32_t resets() const { return resets_; }

 private:
  static const std::vector<Slot>& slots() {
    static const std::vector<Slot> plan{{"a", milliseconds(60), milliseconds(20), milliseconds(40)},
                                        {"b", milliseconds(30), milliseconds(0), milliseconds(10)},
                                        {"c", milliseconds(90), milliseconds(30), milliseconds(5)}};
    return plan;
  }
  struct Fencing {
    GrantId id;
    std::size_t payload_index;
  };
  struct Sent {
    MonotonicTime arrives;
    BusReport report;
  };

  void change_plan() {
    switch (random_() % 3) {
      case 0:
        rotation_.set_enabled(slots()[random_() % 3].payload, random_() % 4 != 0);
        break;
      case 1:
        rotation_.set_early_handover(random_() % 2 == 0);
        break;
      default: {
        std::vector<std::string> order{"a", "b", "c"};
        std::shuffle(order.begin(), order.end(), random_);
        order.resize(random_() % 4);
        rotation_.set_order(order);
        break;
      }
    }
  }

  void decide(const Decision& decision) {
    if (const auto* grant = std::get_if<Grant>(&decision)) on_grant(*grant);
    if (const auto* fence = std::get_if<Fence>(&decision)) {
      ASSERT_GE(now_, current_.lease_end);
      ASSERT_EQ(fence->id, current_.id);
      ++fences_;
      fencing_ = Fencing{fence->id, current_.slot};
    }
    if (const auto* reset = std::get_if<OrderReset>(&decision)) {
      ASSERT_EQ(reset->id, current_.id);
      ASSERT_LT(now_, current_.lease_end);
      ++resets_;
    }
  }

  void on_grant(const Grant& grant) {
    for (const auto& writer : writers_) ASSERT_FALSE(writer) << "granted while another payload may write";
    ASSERT_FALSE(fencing_);
    ASSERT_GT(grant.id, current_.id);
    ASSERT_EQ(grant.lease_end - grant.granted, slots()[grant.slot].lease());
    current_ = grant;
    ++grants_;
    if (random_() % 10 == 0) return;  // the flag never reaches it
    waiting_holder_ = true;
  }

  void holder_acts() {
    const std::size_t who = current_.slot;
    if (waiting_holder_ && now_ < current_.lease_end) {
      waiting_holder_ = false;
      if (random_() % 5 == 0) {  // nothing to say
        send(BusReport::Kind::released, current_, random_() % 20 != 0 || !known_[who], true);
        known_[who] = true;
        return;
      }
      writers_[who] = current_.id;  // TAKEN is on its way before the first frame
      send(BusReport::Kind::taken, current_, random_() % 20 != 0 || !known_[who]);
      known_[who] = true;
      return;
    }
    if (!writers_[who]) return;
    if (random_() % 8 == 0) return;  // it hangs for a while
    writers_[who].reset();
    send(random_() % 4 == 0 ? BusReport::Kind::failed : BusReport::Kind::released, current_,
         random_() % 20 != 0);
  }

  void send(BusReport::Kind kind, const Grant& grant, bool arrives, bool unused = false) {
    if (!arrives) return;
    const BusReport report{kind, grant.id, grant.payload, 1, unused};
    // The first TAKEN of a process must not be lost or late past the lease: a payload that cannot reach the
    // switcher takes nothing.
    const bool first = kind == BusReport::Kind::taken && !known_[grant.slot];
    const int copies = random_() % 10 == 0 ? 2 : 1;
    for (int i = 0; i < copies; ++i) {
      sent_.push_back({first ? now_ : now_ + microseconds(random_() % 3000), report});
    }
    if (first) deliver_due();
  }

  void deliver_due() {
    for (std::size_t i = sent_.size(); i-- > 0;) {
      if (sent_[i].arrives > now_) continue;
      const BusReport report = sent_[i].report;
      sent_.erase(sent_.begin() + static_cast<std::ptrdiff_t>(i));
      rotation_.on_bus_status(report);
      decide(rotation_.on_early_release(now_));
    }
  }

  void noise() {
    // Reports that must not free the bus: old grants, other payloads, grants never given, other processes.
    const auto kind = static_cast<BusReport::Kind>(1 + random_() % 3);
    BusReport report{kind, current_.id, current_.payload, 1};
    switch (random_() % 4) {
      case 0:
        report.grant.counter -= static_cast<std::uint32_t>(1 + random_() % 3);
        break;
      case 1:
        report.payload = slots()[(current_.slot + 1) % 3].payload;
        break;
      case 2:
        report.grant.counter += static_cast<std::uint32_t>(1 + random_() % 3);
        break;
      default:
        report.payload = "x";
        break;
    }
    if (report.grant == GrantId{}) return;
    rotation_.on_bus_status(report);
  }

  std::mt19937_64 random_;
  MonotonicTime now_{seconds(1)};
  MissionCycle cycle_ = 0;
  TaskFlagRotation rotation_;
  Grant current_;
  bool waiting_holder_ = false;
  std::array<std::optional<GrantId>, 3>
      writers_;  ///< who may write: took the flag, has not released, is not dead
  std::array<bool, 3> known_{};
  std::optional<Fencing> fencing_;
  std::vector<Sent> sent_;
  std::uint32_t grants_ = 0;
  std::uint32_t fences_ = 0;
  std::uint32_t resets_ = 0;
};

TEST(TaskFlagRotation, NeverLetsTwoPayloadsWriteInAMillionRandomSteps) {
  std::uint32_t grants = 0;
  std::uint32_t fences = 0;
  std::uint32_t resets = 0;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    World world(seed);
    for (int i = 0; i < 100'000; ++i) {
      world.step();
      if (::testing::Test::HasFatalFailure()) FAIL() << "seed " << seed << " step " << i;
    }
    grants += world.grants();
    fences += world.fences();
    resets += world.resets();
  }
  EXPECT_GT(grants, 10'000U);
  EXPECT_GT(fences, 1'000U);
  EXPECT_GT(resets, 1'000U);
}

}  // namespace
}  // namespace srfs
