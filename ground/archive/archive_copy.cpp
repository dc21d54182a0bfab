// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/archive/archive_copy.hpp"

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "ground/archive/archive_database.hpp"
#include "ground/downlink.hpp"

namespace srfs::ground {
namespace {

constexpr int batch_rows = 256;  ///< read at once; a packet has 64 KiB at most
/// Of a transaction: a station waits 300 ms for its turn.
constexpr milliseconds turn_longest{100};
constexpr std::size_t minutes_known_max = 10'000;
constexpr auto filled = static_cast<std::int64_t>(GapState::filled);
constexpr std::string_view not_sent = " not sent ";  ///< in the token of a telecommand that did not go up
constexpr std::int64_t receiving_copies = added_by_copy - 1;  ///< of the bits of copies

/// A value of a row.
struct Value {
  enum class Kind : std::uint8_t { null, integer, real, text, octets };
  Kind kind = Kind::null;
  std::int64_t integer = 0;
  double real = 0;
  std::string text = {};
  Octets octets = {};
};
using Row = std::vector<Value>;

Value value_of(std::int64_t integer) {
  return {.kind = Value::Kind::integer, .integer = integer};
}

void bind(Statement& statement, const std::vector<const Value*>& values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    const int place = static_cast<int>(i) + 1;
    const Value& value = *values[i];
    switch (value.kind) {
      case Value::Kind::null:
        statement.bind_null(place);
        break;
      case Value::Kind::integer:
        statement.bind(place, value.integer);
        break;
      case Value::Kind::real:
        statement.bind(place, value.real);
        break;
      case Value::Kind::text:
        statement.bind(place, std::string_view(value.text));
        break;
      case Value::Kind::octets:
        statement.bind(place, OctetView(value.octets));
        break;
    }
  }
}

/// A database and its prepared statements, with errors that are ready to print.
class Side {
 public:
  Side(std::string address, std::unique_ptr<Database> database)
      : address_(std::move(address)), database_(std::move(database)) {}

  [[nodiscard]] bool is_shared() const { return database_->is_shared(); }
  /// All rows. @param kinds  of the columns: i integer, r real, t text, o octets
  [[nodiscard]] Result<std::vector<Row>, std::string> rows(const std::string& sql, std::string_view kinds,
                                                           const std::vector<const Value*>& values);
  /// @return whether the statement returns a row
  [[nodiscard]] Result<bool, std::string> write(const std::string& sql,
                                                const std::vector<const Value*>& values);
  /// From now on, rows are as they are now, whatever a server writes meanwhile.
  [[nodiscard]] Archive::Outcome hold() {
    return outcome_of(database_->run(is_shared() ? "SET idle_in_transaction_session_timeout=0; BEGIN "
                                                   "ISOLATION LEVEL REPEATABLE READ"
                                                 : "BEGIN"));
  }
  [[nodiscard]] Archive::Outcome begin() { return outcome_of(database_->begin()); }
  [[nodiscard]] Archive::Outcome commit() { return outcome_of(database_->commit()); }
  [[nodiscard]] Archive::Outcome sync() { return outcome_of(database_->sync()); }
  void roll_back() { database_->roll_back(); }

 private:
  [[nodiscard]] Result<Statement*, std::string> prepared(const std::string& sql);
  [[nodiscard]] std::string text_of(const DatabaseError& error) const {
    return fmt::format("{}: {}", address_, error.message);
  }
  [[nodiscard]] Archive::Outcome outcome_of(const Result<void, DatabaseError>& done) const {
    return done ? Archive::Outcome{} : Err(text_of(done.error()));
  }

  std::string address_;
  std::unique_ptr<Database> database_;
  PreparedStatements statements_;
};

Result<Statement*, std::string> Side::prepared(const std::string& sql) {
  const auto statement = statements_.of(*database_, sql);
  if (!statement) return Err(text_of(statement.error()));
  return *statement;
}

Value column_of(const Statement& row, int column, char kind) {
  if (row.is_null(column)) return {};
  switch (kind) {
    case 'r':
      return {.kind = Value::Kind::real, .real = row.real(column)};
    case 't':
      return {.kind = Value::Kind::text, .text = row.text(column)};
    case 'o':
      return {.kind = Value::Kind::octets, .octets = row.octets(column)};
    default:
      return value_of(row.integer(column));
  }
}

Result<std::vector<Row>, std::string> Side::rows(const std::string& sql, std::string_view kinds,
                                                 const std::vector<const Value*>& values) {
  const auto statement = prepared(sql);
  if (!statement) return Err(statement.error());
  bind(**statement, values);
  std::vector<Row> found;
  while (true) {
    const auto there = (*statement)->step();
    if (!there) {
      (*statement)->reset();
      return Err(text_of(there.error()));
    }
    if (!*there) break;
    Row row;
    for (std::size_t i = 0; i < kinds.size(); ++i)
      row.push_back(column_of(**statement, static_cast<int>(i), kinds[i]));
    found.push_back(std::move(row));
  }
  (*statement)->reset();
  return found;
}

Result<bool, std::string> Side::write(const std::string& sql, const std::vector<const Value*>& values) {
  const auto statement = prepared(sql);
  if (!statement) return Err(statement.error());
  bind(**statement, values);
  const auto step = (*statement)->step();
  const bool returned = step && *step;
  (*statement)->reset();
  if (!step) return Err(text_of(step.error()));
  return returned;
}

/// The values of a row, for the places of a statement.
std::vector<const Value*> all_of(const Row& row) {
  std::vector<const Value*> values;
  for (const Value& value : row) values.push_back(&value);
  return values;
}

class Copy {
 public:
  Copy(Side from, Side into, unsigned station, const CopyProgress& progress)
      : from_(std::move(from)),
        into_(std::move(into)),
        station_(value_of(station)),
        progress_(progress),
        station_column_(into_.is_shared() ? ", station" : ""),
        station_place_(into_.is_shared() ? ",?" : ""),
        source_station_(from_.is_shared() ? ", station" : "") {}

  [[nodiscard]] Result<std::vector<CopiedRows>, std::string> run();

 private:
  using Write = std::function<Result<bool, std::string>(const Row& row)>;
  using Prepare = std::function<Archive::Outcome(const std::vector<Row>& rows)>;
  /// All rows of a query, in batches of an order.
  /// @param keys  columns of the order, the first ones of the row, which are integers
  /// @param prepare  of a batch, before its transactions: what would make them long
  [[nodiscard]] Archive::Outcome each(Side& side, const char* table, const std::string& sql,
                                      std::string_view kinds, std::size_t keys, const Write& write,
                                      const Prepare& prepare = nullptr);
  [[nodiscard]] Archive::Outcome write_batch(const std::vector<Row>& rows, const Write& write,
                                             CopiedRows& copied);
  /// Of a row whose columns end with the station where the source has it.
  [[nodiscard]] const Value& station_of(const Row& row, std::size_t columns) const {
    return row.size() > columns ? row[columns] : station_;
  }
  [[nodiscard]] std::vector<const Value*> with_station(const Row& row, std::size_t first,
                                                       std::size_t columns) const;
  [[nodiscard]] std::string kinds(std::string_view of) const {
    return std::string(of) + (from_.is_shared() ? "i" : "");
  }

  [[nodiscard]] Archive::Outcome packets();
  [[nodiscard]] Result<bool, std::string> packet(const Row& row);
  /// Whether the target has packets of this minute that were not copied by this run.
  [[nodiscard]] Result<bool, std::string> has_minute(std::int64_t minute, std::int64_t structure);
  [[nodiscard]] Archive::Outcome telecommands();
  [[nodiscard]] Archive::Outcome reports();
  [[nodiscard]] Archive::Outcome link_to_later_telecommands();
  [[nodiscard]] Result<bool, std::string> link(const Row& packet);
  [[nodiscard]] Archive::Outcome files();
  [[nodiscard]] Archive::Outcome passes();
  [[nodiscard]] Archive::Outcome gaps();
  [[nodiscard]] Result<bool, std::string> gap(const Row& row);
  /// The target's row of a gap: id, count, end, missing, attempts, state; empty: it has none.
  [[nodiscard]] Result<std::vector<Row>, std::string> gap_there(const Row& gap);
  /// The target's gaps that a packet is missing in.
  [[nodiscard]] Result<bool, std::string> fill_gaps(const Row& packet);
  [[nodiscard]] Archive::Outcome count_received_elsewhere(const std::vector<Row>& gaps);
  /// @param since  for packets with a higher number alone
  [[nodiscard]] static Result<std::int64_t, std::string> received_of(
      Side& side, const Row& gap, const std::optional<std::int64_t>& since = std::nullopt);
  /// Packets of a gap that its target has not.
  [[nodiscard]] Result<std::int64_t, std::string> missing_of(const Row& gap);
  [[nodiscard]] Archive::Outcome sequences();
  [[nodiscard]] Archive::Outcome pruned();
  [[nodiscard]] Archive::Outcome minutes();
  [[nodiscard]] Archive::Outcome dirty();
  [[nodiscard]] Archive::Outcome acknowledgements();

  Side from_;
  Side into_;
  Value station_;
  const CopyProgress& progress_;
  std::string station_column_;
  std::string station_place_;
  std::string source_station_;
  std::vector<CopiedRows> copied_;
  /// Minute and structure: whether there were packets of it before. Bounded: forgotten, a minute is made anew
  /// once more than is needed.
  std::map<std::pair<std::int64_t, std::int64_t>, bool> minutes_known_;
  /// How many packets of a gap the target has, and the source not; by the source's number of the gap.
  std::map<std::int64_t, std::int64_t> received_elsewhere_;
  std::int64_t newest_counted_ = 0;  ///< packet of the target, when that was counted
};

std::vector<const Value*> Copy::with_station(const Row& row, std::size_t first, std::size_t columns) const {
  std::vector<const Value*> values;
  for (std::size_t i = first; i < columns; ++i) values.push_back(&row[i]);
  if (into_.is_shared()) values.push_back(&station_of(row, columns));
  return values;
}

Archive::Outcome Copy::write_batch(const std::vector<Row>& rows, const Write& write, CopiedRows& copied) {
  std::size_t next = 0;
  while (next < rows.size()) {
    if (auto begun = into_.begin(); !begun) return begun;
    const MonotonicTime end = monotonic_now() + turn_longest;
    do {
      const auto added = write(rows[next]);
      if (!added) {
        into_.roll_back();
        return Err(added.error());
      }
      ++copied.read;
      if (*added) ++copied.added;
    } while (++next < rows.size() && monotonic_now() < end);
    if (auto committed = into_.commit(); !committed) {
      into_.roll_back();
      return committed;
    }
  }
  return {};
}

Archive::Outcome Copy::each(Side& side, const char* table, const std::string& sql, std::string_view kinds,
                            std::size_t keys, const Write& write, const Prepare& prepare) {
  CopiedRows copied{.table = table};
  std::vector<Value> last(keys, value_of(INT64_MIN));
  while (true) {
    const auto rows = side.rows(fmt::format("{} LIMIT {}", sql, batch_rows), kinds, all_of(last));
    if (!rows) return Err(rows.error());
    if (auto prepared = prepare ? prepare(*rows) : Archive::Outcome{}; !prepared) return prepared;
    if (auto written = write_batch(*rows, write, copied); !written) return written;
    progress_(copied);
    if (rows->size() < batch_rows) break;
    last.assign(rows->back().begin(), rows->back().begin() + static_cast<std::ptrdiff_t>(keys));
  }
  const auto same = std::find_if(copied_.begin(), copied_.end(),
                                 [&](const CopiedRows& other) { return other.table == copied.table; });
  if (same == copied_.end())
    copied_.push_back(std::move(copied));
  else
    same->added += copied.added;
  return {};
}

Result<bool, std::string> Copy::has_minute(std::int64_t minute, std::int64_t structure) {
  const auto key = std::pair(minute, structure);
  if (const auto known = minutes_known_.find(key); known != minutes_known_.end()) return known->second;
  if (minutes_known_.size() >= minutes_known_max) minutes_known_.clear();
  const Value of = value_of(structure);
  const Value first = value_of(minute * minute_ns);
  const Value end = value_of((minute + 1) * minute_ns);
  const auto found =
      into_.rows("SELECT id FROM packets WHERE service=3 AND structure=? AND time>=? AND time<? LIMIT 1", "i",
                 {&of, &first, &end});
  if (!found) return Err(found.error());
  minutes_known_[key] = !found->empty();
  return !found->empty();
}

Result<bool, std::string> Copy::packet(const Row& row) {
  // id, time, received, apid, sequence, service, subtype, structure, copies, crc, raw
  constexpr std::size_t columns = 11;
  const Value& time = row[1];
  const Value& received = row[2];
  const bool aggregated = row[5].integer == 3 && row[7].kind == Value::Kind::integer;
  const Value minute = value_of(minute_of(time.integer));
  const Value copies = value_of(row[8].integer & receiving_copies);
  const auto mixed =
      aggregated ? has_minute(minute.integer, row[7].integer) : Result<bool, std::string>(false);
  if (!mixed) return mixed;
  const auto added = into_.write(
      fmt::format("INSERT INTO packets(time, received, apid, sequence, service, subtype, structure, copies, "
                  "crc, raw{}{}) VALUES(?,?,?,?,?,?,?,?|{},?,?{}{}) ON CONFLICT(apid, sequence, time, crc) "
                  "DO NOTHING RETURNING id",
                  station_column_, into_.is_shared() ? ", id" : "", added_by_copy, station_place_,
                  into_.is_shared() ? ",nextval('packet_numbers')" : ""),
      with_station(row, 1, columns));
  if (!added) return added;
  if (*added && *mixed) {
    // Also where packets were pruned: Archive::set_minute() keeps what is of more packets.
    const auto marked = into_.write("INSERT INTO dirty(minute, structure) VALUES(?,?) ON CONFLICT DO NOTHING",
                                    {&minute, &row[7]});
    if (!marked) return marked;
  }
  if (*added) return fill_gaps(row);
  std::vector<const Value*> values{&copies, &received, &received};
  if (into_.is_shared()) values.insert(values.end(), {&received, &station_of(row, columns)});
  values.insert(values.end(), {&row[3], &row[4], &time, &row[9], &copies, &received});
  const auto merged = into_.write(
      fmt::format("UPDATE packets SET copies=copies|?, received=CASE WHEN received>? THEN ? ELSE received "
                  "END{} WHERE apid=? AND sequence=? AND time=? AND crc=? AND ((copies|?)<>copies OR "
                  "received>?)",
                  into_.is_shared() ? ", station=CASE WHEN received>? THEN ? ELSE station END" : ""),
      values);
  return merged ? Result<bool, std::string>(false) : merged;
}

/// As a packet that comes, but also those that were given up.
Result<bool, std::string> Copy::fill_gaps(const Row& packet) {
  const std::int64_t slack = nanoseconds(gap_tolerance).count();
  const Value before = value_of(packet[1].integer + slack);
  const Value behind = value_of(packet[1].integer - slack);
  const Value oldest = value_of(behind.integer - nanoseconds(elsewhere_longest).count());
  const auto done = into_.write(
      "UPDATE gaps SET missing=missing-1, state=CASE WHEN missing=1 THEN 1 ELSE state END WHERE apid=? AND "
      "begin>=? AND begin<=? AND \"end\">=? AND state<>1 AND missing>0 AND count IS NOT NULL AND "
      "(?+16384-first)%16384<count",
      {&packet[3], &oldest, &before, &behind, &packet[4]});
  return done ? Result<bool, std::string>(true) : done;
}

Archive::Outcome Copy::packets() {
  return each(from_, "packets",
              fmt::format("SELECT id, time, received, apid, sequence, service, subtype, structure, copies, "
                          "crc, raw{} FROM packets WHERE id>? ORDER BY id",
                          source_station_),
              kinds("iiiiiiiiiio"), 1, [this](const Row& row) { return packet(row); });
}

Archive::Outcome Copy::telecommands() {
  constexpr std::size_t columns = 9;
  const std::string insert = fmt::format(
      "INSERT INTO telecommands(token, request, sent, who, name, arguments, ad, scheduled{}) "
      "VALUES(?,?,?,?,?,?,?,?{}) ON CONFLICT DO NOTHING RETURNING id",
      station_column_, station_place_);
  return each(
      from_, "telecommands",
      fmt::format("SELECT id, token, request, sent, who, name, arguments, ad, scheduled{} FROM telecommands "
                  "WHERE id>? ORDER BY id",
                  source_station_),
      kinds("itiitttii"), 1, [&](const Row& row) -> Result<bool, std::string> {
        // An earlier copy may have it as one that was sent.
        const std::size_t ending = row[1].text.rfind(not_sent);
        if (ending != std::string::npos) {
          const Value before{.kind = Value::Kind::text, .text = row[1].text.substr(0, ending)};
          const auto renamed = into_.write(
              "UPDATE telecommands SET token=? WHERE token=? AND request=? AND sent=? AND NOT EXISTS "
              "(SELECT 1 FROM telecommands WHERE token=?) RETURNING id",
              {&row[1], &before, &row[2], &row[3], &row[1]});
          if (!renamed || *renamed) return renamed ? Result<bool, std::string>(false) : renamed;
        }
        const auto same =
            into_.rows("SELECT token FROM telecommands WHERE request=? AND sent=?", "t", {&row[2], &row[3]});
        if (!same) return Err(same.error());
        const bool went_not_up = std::any_of(same->begin(), same->end(), [&](const Row& there) {
          return there[0].text.starts_with(row[1].text + std::string(not_sent));
        });
        if (went_not_up) return false;  // the target knows more
        return into_.write(insert, with_station(row, 1, columns));
      });
}

Archive::Outcome Copy::reports() {
  return each(from_, "reports",
              "SELECT reports.telecommand, reports.packet, telecommands.token, packets.apid, "
              "packets.sequence, packets.time, packets.crc FROM reports JOIN telecommands ON "
              "telecommands.id=reports.telecommand JOIN packets ON packets.id=reports.packet WHERE "
              "(reports.telecommand, reports.packet)>(?,?) ORDER BY reports.telecommand, reports.packet",
              "iitiiii", 2, [this](const Row& row) {
                return into_.write(
                    "INSERT INTO reports(telecommand, packet) SELECT telecommands.id, packets.id FROM "
                    "telecommands, packets WHERE token=? AND apid=? AND sequence=? AND time=? AND crc=? AND "
                    "NOT EXISTS (SELECT 1 FROM reports WHERE reports.packet=packets.id) ON CONFLICT DO "
                    "NOTHING RETURNING packet",
                    {&row[2], &row[3], &row[4], &row[5], &row[6]});
              });
}

/// A report of one archive may be of a telecommand that only the other one knows.
/// @param packet  received, id, raw, time, copies
Result<bool, std::string> Copy::link(const Row& packet) {
  // What was only retrieved was received long after the spacecraft made it.
  const bool live = (packet[4].integer & live_copy) != 0;
  const Value before = live ? packet[0] : value_of(std::min(packet[0].integer, packet[3].integer));
  const Value& number = packet[1];
  const auto telemetry = telemetry_in(packet[2].octets);
  if (!telemetry) return false;
  OctetReader in(telemetry->source);
  const wire::RequestId id{in.u16(), in.u16()};
  if (!in.ok()) return false;
  const Value request = value_of(number_of(id));
  const auto newest = into_.rows(
      "SELECT id, sent FROM telecommands WHERE request=? AND sent<=? ORDER BY sent DESC, id DESC LIMIT 1",
      "ii", {&request, &before});
  if (!newest || newest->empty()) return newest ? Result<bool, std::string>(false) : Err(newest.error());
  const auto present = into_.rows(
      "SELECT telecommands.id, sent FROM reports JOIN telecommands ON telecommands.id=reports.telecommand "
      "WHERE reports.packet=? ORDER BY sent DESC LIMIT 1",
      "ii", {&number});
  if (!present) return Err(present.error());
  const Row& best = newest->front();
  if (!present->empty() && present->front()[1].integer >= best[1].integer) return false;
  const auto removed = into_.write("DELETE FROM reports WHERE packet=?", {&number});
  if (!removed) return removed;
  const auto linked =
      into_.write("INSERT INTO reports(telecommand, packet) VALUES(?,?)", {&best[0], &number});
  return linked ? Result<bool, std::string>(true) : linked;
}

Archive::Outcome Copy::link_to_later_telecommands() {
  // In the order of the index packet_received.
  return each(into_, "reports",
              "SELECT received, id, raw, time, copies FROM packets WHERE service=1 AND structure IS NULL AND "
              "(received, id)>(?,?) ORDER BY received, id",
              "iioii", 2, [this](const Row& row) { return link(row); });
}

Archive::Outcome Copy::files() {
  constexpr std::size_t columns = 7;
  const std::string insert = fmt::format(
      "INSERT INTO files(time, txn, direction, name, event, octets{}) SELECT CAST(? AS BIGINT), CAST(? AS "
      "TEXT), CAST(? AS TEXT), CAST(? AS TEXT), CAST(? AS TEXT), CAST(? AS BIGINT){} WHERE NOT EXISTS "
      "(SELECT 1 FROM files WHERE time=? AND txn=? AND direction=? AND name=? AND event=? AND "
      "coalesce(octets,-1)=?) RETURNING id",
      station_column_, into_.is_shared() ? ", CAST(? AS BIGINT)" : "");
  return each(
      from_, "files",
      fmt::format("SELECT id, time, txn, direction, name, event, octets{} FROM files WHERE id>? ORDER "
                  "BY id",
                  source_station_),
      kinds("iitttti"), 1, [&](const Row& row) {
        const Value octets = row[6].kind == Value::Kind::null ? value_of(-1) : row[6];
        auto values = with_station(row, 1, columns);
        values.insert(values.end(), {&row[1], &row[2], &row[3], &row[4], &row[5], &octets});
        return into_.write(insert, values);
      });
}

Archive::Outcome Copy::passes() {
  constexpr std::size_t columns = 4;
  const std::string insert = fmt::format(
      "INSERT INTO passes(began, ended, packets{}) SELECT CAST(? AS BIGINT), CAST(? AS BIGINT), CAST(? AS "
      "BIGINT){} WHERE NOT EXISTS (SELECT 1 FROM passes WHERE began=?) RETURNING id",
      station_column_, into_.is_shared() ? ", CAST(? AS BIGINT)" : "");
  return each(
      from_, "passes",
      fmt::format("SELECT id, began, ended, packets{} FROM passes WHERE id>? ORDER BY id", source_station_),
      kinds("iiii"), 1, [&](const Row& row) -> Result<bool, std::string> {
        auto values = with_station(row, 1, columns);
        values.push_back(&row[1]);
        const auto added = into_.write(insert, values);
        if (!added || *added) return added;
        const auto grown = into_.write(  // it was not over when it was copied
            "UPDATE passes SET ended=?, packets=? WHERE began=? AND ended<?",
            {&row[2], &row[3], &row[1], &row[2]});
        return grown ? Result<bool, std::string>(false) : grown;
      });
}

Result<std::vector<Row>, std::string> Copy::gap_there(const Row& gap) {
  return into_.rows(
      "SELECT id, count, \"end\", missing, attempts, state FROM gaps WHERE apid=? AND begin=? AND first=? "
      "ORDER BY id LIMIT 1",
      "iiiiii", {&gap[1], &gap[4], &gap[2]});
}

Result<std::int64_t, std::string> Copy::received_of(Side& side, const Row& gap,
                                                    const std::optional<std::int64_t>& since) {
  const std::int64_t slack = nanoseconds(gap_tolerance).count();
  const Value begin = value_of(gap[4].integer - slack);
  const Value end = value_of(gap[5].integer + slack);
  const Value number = value_of(since.value_or(INT64_MIN));
  // + keeps an index out: that of the number is the one for the newest; an SQLite file has none of a process
  // and the time.
  const auto received = side.rows(
      fmt::format("SELECT count(DISTINCT sequence) FROM packets WHERE {}apid=? AND {}time>=? AND {}time<=? "
                  "AND (sequence+16384-?)%16384<? AND {}id>?",
                  since || !side.is_shared() ? "+" : "", since ? "+" : "", since ? "+" : "",
                  since ? "" : "+"),
      "i", {&gap[1], &begin, &end, &gap[2], &gap[3], &number});
  if (!received) return Err(received.error());
  return received->front()[0].integer;
}

Archive::Outcome Copy::count_received_elsewhere(const std::vector<Row>& gaps) {
  received_elsewhere_.clear();
  const auto newest = into_.rows("SELECT coalesce(max(id),0) FROM packets", "i", {});
  if (!newest) return Err(newest.error());
  newest_counted_ = newest->front()[0].integer;
  for (const Row& gap : gaps) {
    const bool is_counted = gap[3].kind == Value::Kind::integer && gap[8].integer != filled;
    if (!is_counted || nanoseconds(gap[5].integer - gap[4].integer) > elsewhere_longest) continue;
    const auto there = gap_there(gap);
    if (!there) return Err(there.error());
    if (!there->empty() && there->front()[2].integer >= gap[5].integer) continue;
    const auto here = received_of(into_, gap);
    const auto in_source = received_of(from_, gap);
    if (!here) return Err(here.error());
    if (!in_source) return Err(in_source.error());
    received_elsewhere_[gap[0].integer] = *here - *in_source;
  }
  return {};
}

Result<std::int64_t, std::string> Copy::missing_of(const Row& gap) {
  const auto counted = received_elsewhere_.find(gap[0].integer);
  if (counted == received_elsewhere_.end()) return gap[6].integer;
  const auto since = received_of(into_, gap, newest_counted_);  // from a server, few
  if (!since) return Err(since.error());
  return gap[6].integer - std::clamp<std::int64_t>(counted->second + *since, 0, gap[6].integer);
}

Result<bool, std::string> Copy::gap(const Row& row) {
  // id, apid, first, count, begin, end, missing, attempts, state
  constexpr std::size_t columns = 9;
  const auto found = gap_there(row);
  if (!found) return Err(found.error());
  const bool grown = !found->empty() && row[5].integer > found->front()[2].integer;
  const auto left = missing_of(row);
  if (!left) return Err(left.error());
  const auto left_state = *left == 0 && row[6].integer > 0 ? filled : row[8].integer;
  if (found->empty()) {
    Row fresh = row;
    fresh[6] = value_of(*left);
    fresh[8] = value_of(left_state);
    const auto added = into_.write(
        fmt::format("INSERT INTO gaps(apid, first, count, begin, \"end\", missing, attempts, state{}) "
                    "VALUES(?,?,?,?,?,?,?,?{})",
                    station_column_, station_place_),
        with_station(fresh, 1, columns));
    return added ? Result<bool, std::string>(true) : added;
  }
  const Row& there = found->front();
  if (row[5].integer < there[2].integer) return false;  // it has grown there
  const auto state_of = [&] {
    if (grown) return left_state;
    if (row[8].integer == filled || there[5].integer == filled) return filled;
    return std::max(row[8].integer, there[5].integer);
  };
  const Value state = value_of(state_of());
  const Value missing = value_of(grown ? *left : std::min(row[6].integer, there[3].integer));
  const Value attempts = value_of(std::max(row[7].integer, there[4].integer));
  if (!grown && state.integer == there[5].integer && missing.integer == there[3].integer &&
      attempts.integer == there[4].integer)
    return false;
  const auto changed =
      into_.write("UPDATE gaps SET count=?, \"end\"=?, missing=?, attempts=?, state=? WHERE id=?",
                  {&row[3], &row[5], &missing, &attempts, &state, &there[0]});
  return changed ? Result<bool, std::string>(false) : changed;
}

Archive::Outcome Copy::gaps() {
  return each(
      from_, "gaps",
      fmt::format("SELECT id, apid, first, count, begin, \"end\", missing, attempts, state{} FROM gaps "
                  "WHERE id>? ORDER BY id",
                  source_station_),
      kinds("iiiiiiiii"), 1, [this](const Row& row) { return gap(row); },
      [this](const std::vector<Row>& rows) { return count_received_elsewhere(rows); });
}

Archive::Outcome Copy::sequences() {
  // The newest of all stations, where the target is of one.
  const bool each_station = into_.is_shared();
  return each(
      from_, "sequences",
      from_.is_shared() ? "SELECT apid, station, sequence, time FROM sequences WHERE (apid, station)>(?,?) "
                          "ORDER BY apid, station"
                        : "SELECT apid, 0, sequence, time FROM sequences WHERE (apid, 0)>(?,?) ORDER BY apid",
      "iiii", 2, [&, each_station](const Row& row) -> Result<bool, std::string> {
        const Value& station = from_.is_shared() ? row[1] : station_;
        std::vector<const Value*> values{&row[0], &row[2], &row[3]};
        if (each_station) values.push_back(&station);
        return into_.write(
            fmt::format(
                "INSERT INTO sequences(apid, sequence, time{}) VALUES(?,?,?{}) ON CONFLICT({}apid) DO "
                "UPDATE SET sequence=excluded.sequence, time=excluded.time WHERE "
                "sequences.time<excluded.time RETURNING apid",
                station_column_, station_place_, each_station ? "station, " : ""),
            values);
      });
}

Archive::Outcome Copy::pruned() {
  return each(from_, "pruned", "SELECT one, minute FROM pruned WHERE one>?", "ii", 1, [this](const Row& row) {
    return into_.write(
        "INSERT INTO pruned(one, minute) VALUES(1,?) ON CONFLICT(one) DO UPDATE SET minute=excluded.minute "
        "WHERE pruned.minute<excluded.minute RETURNING one",
        {&row[1]});
  });
}

Archive::Outcome Copy::minutes() {
  std::map<std::int64_t, Value> numbers;  // of the target; the dictionary bounds them
  const auto named =
      each(from_, "parameters", "SELECT id, name FROM parameters WHERE id>? ORDER BY id", "it", 1,
           [&](const Row& row) -> Result<bool, std::string> {
             const auto added = into_.write(
                 "INSERT INTO parameters(name) VALUES(?) ON CONFLICT DO NOTHING RETURNING id", {&row[1]});
             if (!added) return added;
             const auto id = into_.rows("SELECT id FROM parameters WHERE name=?", "i", {&row[1]});
             if (!id) return Err(id.error());
             if (!id->empty()) numbers[row[0].integer] = id->front()[0];
             return added;
           });
  if (!named) return named;
  // The aggregate of more values is the better one; of minutes with values from both, the next server makes
  // it.
  return each(from_, "minutes",
              "SELECT parameter, minute, count, min, mean, max, worst FROM minutes WHERE (parameter, "
              "minute)>(?,?) ORDER BY parameter, minute",
              "iiirrri", 2, [&](const Row& row) -> Result<bool, std::string> {
                const auto parameter = numbers.find(row[0].integer);
                if (parameter == numbers.end()) return false;  // named since then: the next copy has it
                auto values = all_of(row);
                values[0] = &parameter->second;
                return into_.write(
                    "INSERT INTO minutes(parameter, minute, count, min, mean, max, worst) "
                    "VALUES(?,?,?,?,?,?,?) ON CONFLICT(parameter, minute) DO UPDATE SET "
                    "count=excluded.count, min=excluded.min, mean=excluded.mean, max=excluded.max, "
                    "worst=excluded.worst WHERE minutes.count<excluded.count RETURNING parameter",
                    values);
              });
}

Archive::Outcome Copy::dirty() {
  return each(
      from_, "dirty",
      "SELECT minute, structure FROM dirty WHERE (minute, structure)>(?,?) ORDER BY minute, structure", "ii",
      2, [this](const Row& row) {
        return into_.write(
            "INSERT INTO dirty(minute, structure) VALUES(?,?) ON CONFLICT DO NOTHING RETURNING minute",
            all_of(row));
      });
}

Archive::Outcome Copy::acknowledgements() {
  return each(from_, "acknowledgements",
              "SELECT acknowledgements.packet, acknowledgements.time, who, apid, sequence, packets.time, crc "
              "FROM acknowledgements JOIN packets ON packets.id=acknowledgements.packet WHERE "
              "acknowledgements.packet>? ORDER BY acknowledgements.packet",
              "iitiiii", 1, [this](const Row& row) {
                return into_.write(
                    "INSERT INTO acknowledgements(packet, time, who) SELECT id, CAST(? AS BIGINT), CAST(? AS "
                    "TEXT) FROM packets WHERE apid=? AND sequence=? AND time=? AND crc=? ON CONFLICT(packet) "
                    "DO UPDATE SET time=excluded.time, who=excluded.who WHERE "
                    "acknowledgements.time>excluded.time RETURNING packet",
                    {&row[1], &row[2], &row[3], &row[4], &row[5], &row[6]});
              });
}

Result<std::vector<CopiedRows>, std::string> Copy::run() {
  if (const auto held = from_.hold(); !held) return Err(held.error());
  // What refers to packets and telecommands is copied after them.
  for (const auto step :
       {&Copy::packets, &Copy::telecommands, &Copy::reports, &Copy::link_to_later_telecommands, &Copy::files,
        &Copy::passes, &Copy::gaps, &Copy::sequences, &Copy::pruned, &Copy::dirty, &Copy::minutes,
        &Copy::acknowledgements}) {
    if (const auto done = (this->*step)(); !done) return Err(done.error());
  }
  if (const auto synced = into_.sync(); !synced) return Err(synced.error());
  return copied_;
}

bool is_same(const ArchivePlace& one, const ArchivePlace& other) {
  if (one.address == other.address) return true;
  std::error_code error;
  return !is_shared(one) && !is_shared(other) &&
         std::filesystem::equivalent(one.address, other.address, error);
}

}  // namespace

Result<std::vector<CopiedRows>, std::string> copy_archive(const ArchivePlace& from, const ArchivePlace& into,
                                                          const CopyProgress& progress) {
  if (is_same(from, into)) return Err(fmt::format("{}: an archive is not copied into itself", into.address));
  auto source = open_archive_database(from, ArchiveUse::read);
  if (!source) return Err(source.error());
  auto target = open_archive_database(into, ArchiveUse::merge);
  if (!target) return Err(target.error());
  auto copied = Copy(Side(from.address, std::move(*source)), Side(into.address, std::move(*target)),
                     into.station, progress)
                    .run();
  if (!copied) return Err(copied.error() + "; what is copied stays, the same command completes it");
  return copied;
}

}  // namespace srfs::ground
