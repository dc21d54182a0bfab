// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "ground/pass/pass_item.hpp"
#include "ground/telemetry.hpp"

namespace srfs::ground::pass {

/// What a pass wants done next.
struct PassAction {
  enum class Kind : std::uint8_t {
    telecommand,  ///< sent and followed to its end; ends with on_end()
    look_up,      ///< what the archive knows of the telecommand with this token; ends with on_looked_up()
    put,          ///< a file goes up; ends with on_put()
    fill_gaps,    ///< the server is to retrieve what the archive misses
  };
  Kind kind = Kind::telecommand;
  std::uint64_t tag = 0;  ///< comes back with the end
  TelecommandText telecommand = {};
  std::optional<ScriptStep> step = {};  ///< judges its end; nullopt: it must complete
  std::string token = {};               ///< empty: it may be repeated
  bool again = false;                   ///< an earlier run may have sent it with this token
  UtcTime ordered = {};                 ///< look_up: when it was
  FileUp file = {};
};

/// How a telecommand ended.
struct OrderEnd {
  enum class How : std::uint8_t {
    as_wanted,
    otherwise,  ///< it ended, but not so
    not_sent,   ///< for certain
    lost,       ///< no report of its end came
    unknown,    ///< whether it was sent is not known
  };
  How how = How::as_wanted;
  std::string why = {};                       ///< for people
  std::vector<TelemetryReport> reports = {};  ///< that it ordered
};

/// What an archive knows of a telecommand by its token.
struct LookedUp {
  enum class What : std::uint8_t {
    not_recorded,  ///< it was not sent
    as_wanted,
    otherwise,
    open,  ///< it was sent, and no report of its end has come yet
    cannot_tell,
  };
  What what = What::cannot_tell;
  std::string why = {};
};

/// One run of a plan over one pass: contact, questions, script, files in both directions, an end in order
/// before the spacecraft sets. Says one thing after the other that is to be done, and learns how it ended.
/// Before anything is done that may not be done twice, the item says so, and that must be on disk before the
/// action is carried out (take_changed). A run may be cut anywhere; the next one goes on with the same items.
/// Pure.
class PassSession {
 public:
  static constexpr seconds closing{15};         ///< before the set: nothing new is begun
  static constexpr seconds rest{2};             ///< after what was lost, before it is tried again
  static constexpr seconds look_up_period{15};  ///< of a telecommand whose end is open
  static constexpr unsigned failures_max = 3;   ///< of an item, until it has failed
  static constexpr unsigned tries_max = 6;      ///< of what has no answer, in one pass
  static constexpr std::size_t copies_max = 2;  ///< under way at a time, likewise files that go up
  static constexpr std::size_t name_octets_max = 100;

  struct Settings {
    std::vector<TelecommandText> first_questions = {};  ///< asked in each pass when there is contact
    bool remembers = false;                             ///< an archive knows telecommands by their tokens
    bool keep_going = false;  ///< the script goes on after a line that did not end as wanted
    LineRates rates = {};
  };
  /// @param items  with their states (with_journal)
  /// @param suspended  copies on board rest since the last pass
  PassSession(const PassPlan& plan, std::vector<Item> items, bool suspended, Settings settings,
              MonotonicTime set);

  /// nullopt: nothing now. At most one telecommand is under way.
  [[nodiscard]] std::optional<PassAction> next(MonotonicTime now, UtcTime utc);
  void on_end(std::uint64_t tag, const OrderEnd& end, MonotonicTime now, UtcTime utc);
  void on_looked_up(std::uint64_t tag, const LookedUp& found, MonotonicTime now, UtcTime utc);
  /// @param why  nullopt: it goes up
  void on_put(std::uint64_t tag, const std::optional<std::string>& why, UtcTime utc);
  /// A file of the plan that went up has arrived, or will not. @param why  nullopt: it arrived
  void on_up_ended(const std::string& name, const std::optional<std::string>& why, UtcTime utc);
  /// A file of the plan is here, or its transfer ended without it. @param target  as target_of()
  void on_down_ended(const std::string& target, const std::optional<std::string>& why, UtcTime utc);
  void on_down_progress(const std::string& target, std::uint64_t octets);
  /// How many gaps of the archive are open.
  void on_gaps(std::size_t open, UtcTime utc);

  /// An item, or what suspended() says, has changed since the last call: it goes to the disk before the next
  /// action is carried out.
  [[nodiscard]] bool take_changed() { return std::exchange(changed_, false); }
  [[nodiscard]] const std::vector<Item>& items() const { return items_; }
  [[nodiscard]] bool suspended() const { return suspended_; }
  /// Files on board that the plan wants, and that do not fit into the journal.
  [[nodiscard]] std::uint32_t left_out() const { return left_out_; }
  /// What an operator should know, once each.
  [[nodiscard]] std::vector<std::string> take_notes() { return std::exchange(notes_, {}); }
  [[nodiscard]] bool in_contact() const { return contact_; }

  /// Why it is over; nullopt: it is not.
  [[nodiscard]] std::optional<std::string> over(MonotonicTime now) const;
  /// When next() may have something to do without any news.
  [[nodiscard]] MonotonicTime next_deadline(MonotonicTime now) const;

  /// Where the files of a plan arrive, below STATE/files.
  [[nodiscard]] static std::string folder_of(const PassPlan& plan);
  /// Where a file of the plan arrives, below STATE/files.
  [[nodiscard]] static std::string target_of(const PassPlan& plan, const Item& item);

 private:
  enum class Purpose : std::uint8_t {
    contact,
    resume,
    suspend,
    question,
    query,
    script,
    list,
    check_up,
    copy
  };
  struct Current {
    std::uint64_t tag = 0;
    Purpose purpose = Purpose::contact;
    std::size_t item = 0;  ///< of what has one
  };
  struct Listing {
    std::string folder;
    std::string after = {};                  ///< the last name of the page before
    std::optional<std::uint64_t> left = {};  ///< behind it
    unsigned failures = 0;
  };

  [[nodiscard]] PassAction order(Purpose purpose, TelecommandText telecommand, std::size_t item = 0);
  [[nodiscard]] PassAction next_of_contact();
  [[nodiscard]] std::optional<PassAction> next_put(UtcTime utc);
  [[nodiscard]] std::optional<PassAction> next_query();
  [[nodiscard]] std::optional<PassAction> next_of_script(MonotonicTime now, UtcTime utc);
  [[nodiscard]] std::optional<PassAction> next_of_line(std::size_t item, MonotonicTime now, UtcTime utc);
  [[nodiscard]] std::optional<PassAction> send_line(std::size_t item, UtcTime utc);
  [[nodiscard]] bool may_try(std::size_t item) const;
  [[nodiscard]] std::optional<PassAction> next_gaps();
  [[nodiscard]] std::optional<PassAction> next_listing();
  [[nodiscard]] std::optional<PassAction> next_copy(MonotonicTime now, UtcTime utc);
  void stop_following();
  [[nodiscard]] std::optional<PassAction> close();
  void on_lost(MonotonicTime now);
  void end_query(std::size_t item, const OrderEnd& end, UtcTime utc);
  void end_line(std::size_t item, const OrderEnd& end, MonotonicTime now, UtcTime utc);
  void end_listing(const OrderEnd& end, UtcTime utc);
  void end_check(std::size_t item, const OrderEnd& end, UtcTime utc);
  void end_copy(std::size_t item, const OrderEnd& end, UtcTime utc);
  void take_found(const std::string& folder, const std::vector<TelemetryReport>& reports);
  void set(Item& item, ItemState state, std::string why, UtcTime utc);
  /// Back to waiting, or failed when that was too often.
  void fail_once(Item& item, const std::string& why, UtcTime utc);
  [[nodiscard]] double octets_left(MonotonicTime now) const;
  [[nodiscard]] std::size_t files_found() const;
  [[nodiscard]] std::optional<std::size_t> find(ItemKind kind,
                                                const std::function<bool(const Item&)>& is) const;

  const PassPlan& plan_;
  std::vector<Item> items_;
  bool suspended_;
  Settings settings_;
  MonotonicTime set_;
  bool changed_ = false;
  bool contact_ = false;
  bool closed_ = false;
  bool must_suspend_ = true;
  unsigned losses_ = 0;  ///< in a row
  std::optional<MonotonicTime> resting_until_;
  std::optional<Current> current_;
  std::uint64_t next_tag_ = 1;
  std::size_t questions_asked_ = 0;
  unsigned question_losses_ = 0;                ///< of the next one
  std::map<std::size_t, unsigned> tries_;       ///< without an answer
  std::optional<MonotonicTime> waiting_until_;  ///< of the script
  std::map<std::size_t, MonotonicTime> look_again_;
  std::set<std::size_t> from_before_;  ///< ordered by an earlier run
  std::set<std::size_t> putting_;
  std::map<std::size_t, std::uint64_t> copying_;  ///< octets that came
  std::vector<Listing> listings_;                 ///< to be done; the last one is next
  bool gaps_ordered_ = false;
  std::uint32_t last_operation_ = 0;
  std::uint32_t left_out_ = 0;
  std::vector<std::string> notes_;
};

}  // namespace srfs::ground::pass
