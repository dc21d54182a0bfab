// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <functional>
#include <map>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/text.hpp"
#include "ground/pass/pass_journal.hpp"
#include "ground/pass/pass_session.hpp"
#include "tests/build_kind.hpp"

namespace srfs::ground::pass {
namespace {

using ::testing::HasSubstr;
using Kind = PassAction::Kind;
using How = OrderEnd::How;

const UtcTime utc = *from_iso8601("2026-11-27T08:00:00Z");
const MonotonicTime start{seconds(1000)};

PassPlan plan_of(std::size_t lines, std::size_t files_up, bool down) {
  PassPlan plan;
  plan.name = "evening";
  plan.queries = {{"housekeeping.one_shot", {"structure=payload_eps"}}};
  for (std::size_t i = 0; i < lines; ++i) {
    ScriptStep step;
    step.name = "eps.switch_load";
    step.text = "tc line " + std::to_string(i);
    plan.script.push_back(step);
  }
  for (std::size_t i = 0; i < files_up; ++i)
    plan.up.push_back({.file = "x",
                       .name = "up" + std::to_string(i),
                       .octets = 3000 + 700 * i,
                       .sha256 = std::string(64, 'a')});
  if (down) plan.down = {{"images", "*.fits", 2}, {"", "*", 5}};
  return plan;
}

mission::DecodedField field(const std::string& name, const std::string& text) {
  mission::DecodedField decoded;
  decoded.name = name;
  decoded.text = text;
  if (const auto number = to_number<std::uint64_t>(text)) decoded.value = *number;
  return decoded;
}

std::string argument(const TelecommandText& telecommand, const std::string& name) {
  for (const std::string& text : telecommand.arguments) {
    if (text.starts_with(name + "=")) return text.substr(name.size() + 1);
  }
  return "";
}

/// What outlives a run: the spacecraft, the server with its archive, the disk. Nothing here sleeps.
struct World {
  std::mt19937 random;
  bool remembers = true;
  std::map<std::string, std::map<std::string, std::uint64_t>> folders;  // on board
  // Telecommands.
  std::map<std::string, int> executed;  // by token
  struct Recorded {
    bool reported = false;
  };
  std::map<std::string, Recorded> archive;
  // Files.
  struct Copy {
    std::string target;
    std::uint64_t octets = 0;
    std::uint64_t came = 0;
    bool ended = false;
  };
  std::map<std::string, Copy> copies;  // by operation
  bool copies_rest = false;
  std::map<std::string, std::uint64_t> arrived;   // targets, with the number of arrivals
  std::map<std::string, std::uint64_t> going_up;  // octets left
  std::map<std::string, int> received;
  std::string journal;

  [[nodiscard]] bool chance(double p) { return std::uniform_real_distribution<double>(0, 1)(random) < p; }
  [[nodiscard]] unsigned below(unsigned n) {
    return std::uniform_int_distribution<unsigned>(0, n - 1)(random);
  }
};

struct Faults {
  double killed = 0;       // at each instant at which the run could be
  double up_lost = 0;      // of a telecommand
  double report_lost = 0;  // of its end
  seconds open{0};         // the line is cut after this
};

/// One run of the plan: what the adapter does, with the program killed, the line cut and reports lost.
class FlownRun {
 public:
  FlownRun(World& world, const PassPlan& plan, const Faults& faults)
      : world_(world), plan_(plan), faults_(faults) {
    if (const auto read = decode_journal(world.journal)) journal_ = *read;
    journal_.plan = plan.name;
  }

  void fly(seconds length) {
    PassSession session(plan_, with_journal(items_of(plan_), journal_), journal_.suspended,
                        {.first_questions = {{"housekeeping.one_shot", {"structure=health"}}},
                         .remembers = world_.remembers,
                         .keep_going = true,
                         .rates = {.down_octets_s = rate, .up_octets_s = rate}},
                        start + length);
    for (MonotonicTime now = start; !session.over(now); now += milliseconds(500)) {
      carry_files(session, now);
      const auto action = session.next(now, utc);
      if (killed()) return;
      if (session.take_changed()) {
        take_items(journal_, session.items());
        journal_.suspended = session.suspended();
        if (killed()) return;
        world_.journal = encode_journal(journal_);
      }
      if (killed()) return;
      if (action && !carry_out(session, *action, now)) return;
    }
    if (!session.take_changed()) return;
    take_items(journal_, session.items());
    world_.journal = encode_journal(journal_);
  }

 private:
  static constexpr double rate = 1000;
  [[nodiscard]] bool killed() { return world_.chance(faults_.killed); }
  [[nodiscard]] bool is_open(MonotonicTime now) const { return now < start + faults_.open; }

  void carry_files(PassSession& session, MonotonicTime now) {
    for (const auto& item : session.items()) {  // as the adapter does before it orders
      const std::string target = PassSession::target_of(plan_, item);
      if (item.kind == ItemKind::down && world_.arrived.contains(target))
        session.on_down_ended(target, std::nullopt, utc);
    }
    if (!is_open(now)) return;
    std::uint64_t room = 500;
    for (auto& [operation, copy] : world_.copies) {
      if (world_.copies_rest || copy.ended || room == 0) continue;
      const std::uint64_t octets = std::min(room, copy.octets - copy.came);
      copy.came += octets;
      room -= octets;
      session.on_down_progress(copy.target, copy.came);
      if (copy.came == copy.octets) {
        copy.ended = true;
        ++world_.arrived[copy.target];
        session.on_down_ended(copy.target, std::nullopt, utc);
      }
    }
    for (auto& [name, left] : world_.going_up) {
      if (left == 0) continue;
      left -= std::min<std::uint64_t>(left, 500);
      if (left > 0) continue;
      ++world_.received[name];
      session.on_up_ended(name, std::nullopt, utc);
    }
    std::erase_if(world_.going_up, [](const auto& file) { return file.second == 0; });
  }

  /// @return false: the program was killed
  [[nodiscard]] bool carry_out(PassSession& session, const PassAction& action, MonotonicTime now) {
    if (action.kind == Kind::put) {
      world_.going_up.try_emplace(action.file.name, action.file.octets);  // what is under way goes on
      if (killed()) return false;
      session.on_put(action.tag, std::nullopt, utc);
      return true;
    }
    if (action.kind == Kind::look_up) {
      session.on_looked_up(action.tag, look_up(action.token), now, utc);
      return true;
    }
    if (action.kind != Kind::telecommand) return true;
    const OrderEnd end = send(action, now);
    if (killed()) return false;
    session.on_end(action.tag, end, now, utc);
    return true;
  }

  [[nodiscard]] LookedUp look_up(const std::string& token) const {
    const auto found = world_.archive.find(token);
    if (found == world_.archive.end()) return {.what = LookedUp::What::not_recorded};
    return {.what = found->second.reported ? LookedUp::What::as_wanted : LookedUp::What::open};
  }

  [[nodiscard]] OrderEnd send(const PassAction& action, MonotonicTime now) {
    if (!action.token.empty() && world_.remembers) {
      if (world_.archive.contains(action.token)) return {.how = How::lost};  // known: it is not sent again
      world_.archive[action.token];
    }
    if (!is_open(now) || world_.chance(faults_.up_lost)) return {.how = How::lost};
    OrderEnd end = execute(action);
    const bool reported = !world_.chance(faults_.report_lost);
    if (!action.token.empty() && world_.remembers) world_.archive[action.token].reported = reported;
    if (!reported) end = {.how = How::lost};
    return end;
  }

  [[nodiscard]] OrderEnd execute(const PassAction& action) {
    const TelecommandText& telecommand = action.telecommand;
    if (!action.token.empty()) ++world_.executed[action.token];
    if (telecommand.name == "file.suspend_all") world_.copies_rest = true;
    if (telecommand.name == "file.resume_all") world_.copies_rest = false;
    if (telecommand.name == "file.list") return list(telecommand);
    if (telecommand.name == "file.report") return report(argument(telecommand, "file"));
    if (telecommand.name == "file.copy") {
      const std::string folder = argument(telecommand, "source_repository");
      const std::string name = argument(telecommand, "source_file");
      const auto& files = world_.folders[folder];
      if (!files.contains(name)) return {.how = How::otherwise, .why = "no such file"};
      const std::string target =
          argument(telecommand, "target_repository").substr(7) + "/" + argument(telecommand, "target_file");
      world_.copies.try_emplace(argument(telecommand, "operation"), World::Copy{target, files.at(name)});
    }
    return {};
  }

  [[nodiscard]] OrderEnd list(const TelecommandText& telecommand) {
    OrderEnd end;
    const auto& files = world_.folders[argument(telecommand, "repository")];
    const std::string after = argument(telecommand, "after");
    const auto behind = static_cast<std::size_t>(
        std::count_if(files.begin(), files.end(), [&](const auto& file) { return file.first > after; }));
    std::size_t left = behind;
    for (const auto& [name, octets] : files) {
      constexpr std::size_t page = 3;
      if (name <= after || behind - left == page) continue;
      --left;
      TelemetryReport row;
      row.fields = {field("object", "file"),
                    field("object_name", name),
                    field("octets", std::to_string(octets)),
                    field("objects", "1"),
                    field("total", std::to_string(behind)),
                    field("left", std::to_string(left))};
      end.reports.push_back(row);
    }
    return end;
  }

  [[nodiscard]] OrderEnd report(const std::string& name) const {
    if (!world_.received.contains(name)) return {.how = How::otherwise, .why = "no such file"};
    TelemetryReport attributes;
    attributes.fields = {field("sha256", "0x" + std::string(64, 'a'))};
    return {.reports = {attributes}};
  }

  World& world_;
  const PassPlan& plan_;
  Faults faults_;
  PassJournal journal_;
};

std::vector<Item> items_in(const World& world, const PassPlan& plan) {
  return with_journal(items_of(plan), decode_journal(world.journal).value_or(PassJournal{}));
}

TEST(PassSession, CutAHundredTimesAnywhereDoesEverythingOnce) {
  constexpr unsigned seeds = testing_support::slow ? 10 : 100;
  std::size_t open = 0;
  for (unsigned seed = 0; seed < seeds; ++seed) {
    SCOPED_TRACE(seed);
    const PassPlan plan = plan_of(6, 3, true);
    World world;
    world.random.seed(seed);
    for (unsigned i = 0; i < 7; ++i)
      world.folders["images"]["strip_" + std::to_string(i) + ".fits"] = 500 + world.below(20'000);
    world.folders[""] = {{"log.txt", 1200}, {"empty.txt", 0}};
    const double up_lost = seed % 4 == 0 ? 0.05 : 0;

    for (unsigned pass = 0; pass < 12; ++pass) {
      FlownRun(world, plan,
               {.killed = 0.02, .up_lost = up_lost, .report_lost = 0.1, .open = seconds(world.below(60))})
          .fly(seconds(60));
    }
    for (unsigned pass = 0; pass < 40; ++pass) FlownRun(world, plan, {.open = seconds(100)}).fly(seconds(60));

    for (const auto& [token, times] : world.executed) EXPECT_EQ(times, 1) << token;
    for (const auto& [target, times] : world.arrived) EXPECT_EQ(times, 1U) << target;
    for (const auto& [name, times] : world.received) EXPECT_EQ(times, 1) << name;
    EXPECT_EQ(world.arrived.size(), 9U);
    EXPECT_EQ(world.received.size(), 3U);
    for (const Item& item : items_in(world, plan)) {
      if (item.kind == ItemKind::telecommand && item.state == ItemState::ordered) {
        // Its uplink or its report was lost: nothing but a report can tell.
        EXPECT_FALSE(world.archive.at(item.token).reported);
        EXPECT_THAT(item.detail, HasSubstr("no report of its end"));
        ++open;
        continue;
      }
      EXPECT_EQ(item.state, ItemState::done) << to_text(item.kind) << " " << item.text << ": " << item.detail;
      if (item.kind == ItemKind::telecommand) {
        EXPECT_EQ(world.executed[item.token], 1);
      }
    }
  }
  EXPECT_GT(open, 0U) << "the faults were too mild";
  EXPECT_LT(open, 150U);
}

/// Flies a plan a hundred times, with other faults each time, in a world whose archive remembers nothing.
/// @param fly  flies it and checks what it caused
/// @return items of which it is not known whether they were done
std::size_t unknown_in_a_hundred(const PassPlan& plan, const std::function<void(World& world)>& fly) {
  std::size_t unknown = 0;
  for (unsigned seed = 0; seed < 100; ++seed) {
    SCOPED_TRACE(seed);
    World world;
    world.random.seed(seed);
    world.remembers = false;
    fly(world);
    const auto items = items_in(world, plan);
    unknown += static_cast<std::size_t>(std::count_if(
        items.begin(), items.end(), [](const Item& item) { return item.state == ItemState::unknown; }));
  }
  return unknown;
}

TEST(PassSession, WithoutAMemorySendsNothingTwiceAndSaysWhatIsNotKnown) {
  const PassPlan plan = plan_of(6, 1, false);
  const std::size_t unknown = unknown_in_a_hundred(plan, [&](World& world) {
    for (unsigned pass = 0; pass < 12; ++pass)
      FlownRun(world, plan, {.killed = 0.03, .report_lost = 0.05, .open = seconds(world.below(60))})
          .fly(seconds(60));
    for (unsigned pass = 0; pass < 5; ++pass) FlownRun(world, plan, {.open = seconds(100)}).fly(seconds(60));

    for (const auto& [token, times] : world.executed) EXPECT_EQ(times, 1) << token;
    for (const Item& item : items_in(world, plan)) {
      EXPECT_TRUE(is_over(item.state)) << item.text << " " << to_text(item.state);
      if (item.kind == ItemKind::telecommand && item.state == ItemState::done) {
        EXPECT_EQ(world.executed[item.token], 1);
      }
    }
  });
  EXPECT_GT(unknown, 10U);
}

TEST(PassSession, SendsNoLineTwiceWhenEarlierRunsHadNoMemory) {
  const PassPlan plan = plan_of(6, 0, false);
  const std::size_t unknown = unknown_in_a_hundred(plan, [&](World& world) {
    for (unsigned pass = 0; pass < 3; ++pass)
      FlownRun(world, plan, {.killed = 0.05, .open = seconds(100)}).fly(seconds(60));
    world.remembers = true;
    for (unsigned pass = 0; pass < 5; ++pass) FlownRun(world, plan, {.open = seconds(100)}).fly(seconds(60));

    for (const Item& item : items_in(world, plan)) {
      if (item.kind != ItemKind::telecommand) continue;
      int times = 0;
      for (const auto& [token, executed] : world.executed) times += token.ends_with(item.key) ? executed : 0;
      EXPECT_LE(times, 1) << item.text;
      EXPECT_TRUE(is_over(item.state)) << item.text << " " << to_text(item.state);
    }
  });
  EXPECT_GT(unknown, 10U);
}

/// A session whose telecommands all end as wanted but those that a test answers itself.
class Steps : public ::testing::Test {
 protected:
  PassSession& session(const PassPlan& plan, PassSession::Settings settings = {},
                       seconds length = seconds(300)) {
    plan_ = plan;
    session_.emplace(plan_, with_journal(items_of(plan_), journal_), journal_.suspended, std::move(settings),
                     start + length);
    return *session_;
  }
  /// The next action, after pings and questions were answered.
  std::optional<PassAction> next(MonotonicTime now = start) {
    while (true) {
      auto action = session_->next(now, utc);
      if (!action || action->telecommand.name != "ttc.ping") return action;
      session_->on_end(action->tag, {}, now, utc);
    }
  }
  PassPlan plan_;
  PassJournal journal_;
  std::optional<PassSession> session_;
};

TEST_F(Steps, BeginWithContactAndGoOnWhenThereIsOne) {
  PassSession& s =
      session(plan_of(1, 0, false), {.first_questions = {{"housekeeping.one_shot", {"structure=health"}}}});
  const auto ping = s.next(start, utc);
  ASSERT_TRUE(ping);
  EXPECT_EQ(ping->telecommand.name, "ttc.ping");
  EXPECT_FALSE(s.next(start, utc)) << "one at a time";
  s.on_end(ping->tag, {.how = How::lost}, start, utc);
  EXPECT_FALSE(s.next(start + seconds(1), utc));
  const auto again = s.next(start + seconds(3), utc);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->telecommand.name, "ttc.ping");
  s.on_end(again->tag, {}, start + seconds(3), utc);
  EXPECT_TRUE(s.in_contact());
  EXPECT_EQ(argument(s.next(start + seconds(3), utc)->telecommand, "structure"), "health");
}

TEST_F(Steps, SayThatATelecommandIsOrderedBeforeItIsSent) {
  PassPlan plan = plan_of(1, 0, false);
  plan.queries.clear();
  PassSession& s = session(plan, {.remembers = true});
  const auto line = next();
  ASSERT_TRUE(line);
  EXPECT_TRUE(s.take_changed());
  EXPECT_EQ(s.items().front().state, ItemState::ordered);
  EXPECT_EQ(s.items().front().token, line->token);
  EXPECT_FALSE(line->again);
}

TEST_F(Steps, HoldTheScriptBackAfterALineThatDidNotEndAsWanted) {
  PassPlan plan = plan_of(2, 0, false);
  plan.queries.clear();
  PassSession& s = session(plan);
  s.on_end(next()->tag, {.how = How::otherwise, .why = "busy"}, start, utc);
  EXPECT_EQ(s.items()[0].state, ItemState::failed);
  EXPECT_FALSE(next());
  EXPECT_EQ(s.items()[1].state, ItemState::waiting);
  EXPECT_EQ(s.over(start), "nothing is left to do");

  PassSession& going = session(plan, {.keep_going = true});
  going.on_end(next()->tag, {.how = How::otherwise, .why = "busy"}, start, utc);
  EXPECT_EQ(next()->telecommand.name, "eps.switch_load");
}

TEST_F(Steps, NeverSendALineWhoseEndIsNotKnown) {
  PassPlan plan = plan_of(1, 0, false);
  plan.queries.clear();
  PassSession& s = session(plan);
  s.on_end(next()->tag, {.how = How::unknown, .why = "the server ended"}, start, utc);
  EXPECT_EQ(s.items()[0].state, ItemState::unknown);
  EXPECT_FALSE(next(start + seconds(10)));
}

TEST_F(Steps, EndInOrderBeforeTheSet) {
  PassPlan plan = plan_of(0, 0, true);
  plan.queries.clear();
  plan.down.resize(1);
  PassSession& s = session(plan, {.rates = {.down_octets_s = 1, .up_octets_s = 1}});
  const auto list = next();
  TelemetryReport row;
  row.fields = {field("object", "file"),   field("object_name", "a.fits"),
                field("octets", "900000"), field("objects", "1"),
                field("total", "1"),       field("left", "0")};
  s.on_end(list->tag, {.reports = {row}}, start, utc);
  const auto copy = next();
  EXPECT_EQ(copy->telecommand.name, "file.copy");
  s.on_end(copy->tag, {}, start, utc);
  EXPECT_FALSE(next());

  const MonotonicTime late = start + seconds(300) - PassSession::closing;
  const auto suspend = next(late);
  ASSERT_TRUE(suspend);
  EXPECT_EQ(suspend->telecommand.name, "file.suspend_all");
  EXPECT_TRUE(s.suspended()) << "on disk before it is sent";
  s.on_end(suspend->tag, {}, late, utc);
  EXPECT_EQ(s.over(late), "ended in order before the set");

  take_items(journal_, s.items());
  journal_.suspended = true;
  PassSession& later = session(plan);
  const auto resume = next();
  EXPECT_EQ(resume->telecommand.name, "file.resume_all");
  later.on_end(resume->tag, {}, start, utc);
  EXPECT_FALSE(later.suspended());
}

TEST_F(Steps, SuspendCopiesAlsoWhileATelecommandIsUnderWay) {
  PassPlan plan = plan_of(0, 0, true);
  plan.queries.clear();
  plan.down.resize(1);
  PassSession& s = session(plan, {.rates = {.down_octets_s = 1000, .up_octets_s = 1000}});
  const auto list = next();
  TelemetryReport row;
  row.fields = {field("object", "file"), field("object_name", "a.fits"),
                field("octets", "9000"), field("objects", "1"),
                field("total", "1"),     field("left", "0")};
  s.on_end(list->tag, {.reports = {row}}, start, utc);
  const auto copy = next();
  ASSERT_TRUE(copy);
  EXPECT_EQ(copy->telecommand.name, "file.copy");

  const MonotonicTime late = start + seconds(300) - PassSession::closing;
  EXPECT_FALSE(next(late - seconds(1))) << "the copy may have begun; its end is not known yet";
  const auto suspend = next(late);
  ASSERT_TRUE(suspend);
  EXPECT_EQ(suspend->telecommand.name, "file.suspend_all");
  s.on_end(copy->tag, {.how = How::lost}, late, utc);
  EXPECT_FALSE(next(late)) << "a late end is not that of the suspension";
  s.on_end(suspend->tag, {}, late, utc);
  EXPECT_EQ(s.over(late), "ended in order before the set");
  EXPECT_TRUE(s.suspended());
}

TEST_F(Steps, WaitForATelecommandToTheSetWhenNothingIsToBeSuspended) {
  PassPlan plan = plan_of(1, 0, false);
  plan.queries.clear();
  PassSession& s = session(plan);
  const auto line = next();
  ASSERT_TRUE(line);
  const MonotonicTime late = start + seconds(300) - PassSession::closing;
  EXPECT_FALSE(next(late));
  s.on_end(line->tag, {}, late, utc);
  EXPECT_EQ(s.items()[0].state, ItemState::done);
}

TEST_F(Steps, FetchTheMostUrgentFileThatFits) {
  PassPlan plan = plan_of(0, 0, true);
  plan.queries.clear();
  plan.down = {{"", "big", 1}, {"", "small", 9}};
  PassSession& s = session(plan, {.rates = {.down_octets_s = 10, .up_octets_s = 1}}, seconds(115));
  std::vector<TelemetryReport> rows(2);
  rows[0].fields = {field("object", "file"), field("object_name", "big"), field("octets", "5000"),
                    field("objects", "2"),   field("total", "2"),         field("left", "1")};
  rows[1].fields = {field("object", "file"), field("object_name", "small"), field("octets", "400"),
                    field("objects", "2"),   field("total", "2"),           field("left", "0")};
  s.on_end(next()->tag, {.reports = rows}, start, utc);
  const auto first = next();
  EXPECT_EQ(argument(first->telecommand, "source_file"), "small");
  s.on_end(first->tag, {}, start, utc);
  EXPECT_EQ(argument(next()->telecommand, "source_file"), "big") << "the rest of the pass is its";
}

TEST_F(Steps, FetchNoFileWithANameThatCannotBeWritten) {
  PassPlan plan = plan_of(0, 0, true);
  plan.queries.clear();
  plan.down = {{"", "*", 1}};
  PassSession& s = session(plan);
  TelemetryReport row;
  row.fields = {field("object", "file"), field("object_name", "a\x1b[31m"),
                field("octets", "5"),    field("objects", "1"),
                field("total", "1"),     field("left", "0")};
  s.on_end(next()->tag, {.reports = {row}}, start, utc);
  EXPECT_TRUE(s.items().empty());
  EXPECT_EQ(s.left_out(), 1U);
}

TEST_F(Steps, GiveAFileUpAfterSomeFailures) {
  PassPlan plan = plan_of(0, 1, false);
  plan.queries.clear();
  PassSession& s = session(plan);
  for (unsigned i = 0; i < PassSession::failures_max; ++i) {
    const auto put = next();
    ASSERT_TRUE(put);
    ASSERT_EQ(put->kind, Kind::put);
    s.on_put(put->tag, std::nullopt, utc);
    s.on_up_ended("up0", "no room", utc);
  }
  EXPECT_FALSE(next());
  EXPECT_EQ(s.items()[0].state, ItemState::failed);
  EXPECT_EQ(s.items()[0].detail, "no room");
}

TEST_F(Steps, AskTheServerToFillGapsOnceAndCountThem) {
  PassPlan plan = plan_of(0, 0, false);
  plan.queries.clear();
  plan.gaps = true;
  PassSession& s = session(plan, {.remembers = true});
  s.on_gaps(3, utc);
  EXPECT_EQ(next()->kind, Kind::fill_gaps);
  EXPECT_FALSE(next());
  EXPECT_EQ(s.items()[0].detail, "3 open");
  s.on_gaps(0, utc);
  EXPECT_EQ(s.items()[0].state, ItemState::done);
}

}  // namespace
}  // namespace srfs::ground::pass
