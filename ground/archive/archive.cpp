// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/archive/archive.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <sqlite3.h>
#include <nlohmann/json.hpp>

#include "base/crc32c.hpp"
#include "ground/archive/archive_database.hpp"
#include "ground/archive/archive_schema.hpp"
#include "ground/archive/postgresql_database.hpp"
#include "ground/archive/sqlite_database.hpp"

namespace srfs::ground {
namespace {

static_assert(archive_schema == archive_steps.size());

constexpr std::int64_t application_id = 0x53524653;  // "SRFS"
constexpr seconds pass_silence{120};                 ///< without a packet, the next one begins another pass
constexpr seconds gap_longest{600};                  ///< of gaps that become one
constexpr seconds gap_distance{60};                  ///< between them
/// Nobody else writes an SQLite file; readers hold up nothing. The station's loop waits for no program that
/// does.
constexpr milliseconds writing_patience{50};
// Of a PostgreSQL.
constexpr milliseconds lock_patience{300};        ///< of a station, for the other ones
constexpr milliseconds command_patience{60'000};  ///< of a command, for an answer
constexpr milliseconds connecting_patience{5000};
/// To bring an older archive up to date, which takes as long as its size wants, or to wait for another
/// program that does it.
constexpr std::chrono::hours migration_patience{12};
constexpr milliseconds lock_kept_longest{5000};  ///< by a program that does nothing
constexpr std::int64_t batch_rows = 5000;        ///< of a shared archive, that are removed at once
constexpr std::int64_t batch_minutes = std::int64_t{24} * 60;  ///< likewise
constexpr int retrieved_copy = 2;
constexpr int verified_copy = 4;     ///< one of them came in frames that were verified
constexpr int open_gaps_max = 1000;  ///< of an application process; more give up the oldest

struct Table {
  const char* name;
  bool numbered;  ///< it has row numbers
};
constexpr std::array<Table, 12> tables{{{"packets", true},
                                        {"telecommands", true},
                                        {"reports", false},
                                        {"files", true},
                                        {"passes", true},
                                        {"gaps", true},
                                        {"sequences", true},
                                        {"parameters", true},
                                        {"minutes", false},
                                        {"dirty", false},
                                        {"pruned", true},
                                        {"acknowledgements", true}}};

wire::RequestId request_id_of(std::int64_t number) {
  return {static_cast<std::uint16_t>(number >> 16), static_cast<std::uint16_t>(number & 0xFFFF)};
}

UtcTime time_of(std::int64_t ns) {
  return UtcTime(nanoseconds(ns));
}

/// The number by which the dictionary knows a packet of service 3 or 5.
std::optional<std::uint16_t> structure_in(const wire::TmPacket& packet) {
  const bool housekeeping = packet.service == 3 && packet.subtype == 25;
  const bool event = packet.service == 5 && packet.subtype >= 1 && packet.subtype <= 4;
  if ((!housekeeping && !event) || packet.source.size() < 2) return std::nullopt;
  return OctetReader(packet.source).u16();
}

std::vector<std::string> strings_in(const std::string& text) {
  const auto json = nlohmann::json::parse(text, nullptr, false);
  std::vector<std::string> strings;
  if (!json.is_array()) return strings;
  for (const auto& entry : json) {
    if (entry.is_string()) strings.push_back(entry.get<std::string>());
  }
  return strings;
}

/// WHERE of a period on a column, with its values.
struct Where {
  std::string sql = " WHERE true";
  std::vector<std::int64_t> values;

  void is(const char* condition, std::int64_t value) {
    sql += fmt::format(" AND {}?", condition);
    values.push_back(value);
  }
  void in(const char* column, const Period& period) {
    if (period.from) is((std::string(column) + ">=").c_str(), period.from->ns());
    if (period.to) is((std::string(column) + "<").c_str(), period.to->ns());
  }
  void bind(Statement& statement) const {
    for (std::size_t i = 0; i < values.size(); ++i) statement.bind(static_cast<int>(i) + 1, values[i]);
  }
};

Where where_of(const PacketFilter& filter) {
  Where where;
  where.in("time", filter.period);
  if (filter.apid) where.is("apid=", *filter.apid);
  if (filter.service) where.is("service=", *filter.service);
  if (filter.subtype) where.is("subtype=", *filter.subtype);
  if (filter.structure) where.is("structure=", *filter.structure);
  if (filter.after_id) {
    where.is("id>", *filter.after_id);
    where.sql += fmt::format(" AND copies<{}", added_by_copy);  // as the index packet_news has it
  }
  if (filter.before_id) {
    where.is("(time,id)<(SELECT time, id FROM packets WHERE id=", *filter.before_id);
    where.sql += ")";
  }
  if (filter.latest_live) where.is("0<copies&", live_copy);
  return where;
}

class SqlArchive final : public Archive {
 public:
  using Prepare = std::function<Outcome(Database&)>;
  /// @param prepare  brings the tables up to date, at the beginning of each connection that writes
  SqlArchive(ArchivePlace place, std::unique_ptr<Database> database, Prepare prepare)
      : place_(std::move(place)), database_(std::move(database)), prepare_(std::move(prepare)) {
    if (database_->is_shared()) own_ = fmt::format(" AND station={}", place_.station);
  }

  /// What an earlier run saw, or others wrote since the last connection.
  [[nodiscard]] Outcome restore();
  /// For reading alone: nothing is to be taken up.
  void read() { known_ = database_->connection(); }
  /// Takes up what an earlier run saw.
  [[nodiscard]] Outcome take_up();

  Result<std::int64_t, std::string> add(const ReceivedPacket& packet, UtcTime received) override;
  Outcome add(const TelecommandEntry& telecommand) override;
  Outcome add(const FileEntry& file) override;
  Result<bool, std::string> commit() override;
  Outcome forget_token(const std::string& token) override;
  Result<std::optional<wire::RequestId>, std::string> request_of(const std::string& token) override;
  Outcome count_attempt(std::int64_t gap) override;
  Outcome close_gap(std::int64_t gap) override;
  Outcome give_up_gap(std::int64_t gap) override;
  Result<std::optional<DirtyMinute>, std::string> dirty_minute(UtcTime before) override;
  Outcome set_minute(const DirtyMinute& minute, const std::map<std::string, Aggregate>& aggregates) override;
  Outcome forget_minutes() override;
  Outcome packets(const PacketFilter& filter, const std::function<bool(const StoredPacket&)>& take) override;
  Result<std::uint64_t, std::string> count(const PacketFilter& filter) override;
  Result<std::optional<StoredTelecommand>, std::string> telecommand_of(const wire::RequestId& request,
                                                                       UtcTime before) override;
  Result<bool, std::string> acknowledge(std::int64_t packet, const Acknowledgement& acknowledgement) override;
  Result<std::optional<Acknowledgement>, std::string> acknowledgement_of(std::int64_t packet) override;
  Result<std::int64_t, std::string> newest_packet() override;
  Result<std::vector<StoredTelecommand>, std::string> telecommands(const Period& period,
                                                                   std::size_t most) override;
  Result<std::vector<Point>, std::string> minutes(const std::string& parameter,
                                                  const Period& period) override;
  Result<std::vector<std::int64_t>, std::string> dirty_minutes(std::uint16_t structure,
                                                               const Period& period) override;
  Result<std::vector<StoredGap>, std::string> gaps(const Period& period, bool open_alone) override;
  Result<std::vector<Pass>, std::string> passes(const Period& period) override;
  Result<std::vector<FileEntry>, std::string> files(const Period& period) override;
  Result<std::vector<std::string>, std::string> check() override;
  Result<std::uint64_t, std::string> prune(const std::string& table, UtcTime before) override;

 private:
  /// The statement, ready to bind; prepared once.
  [[nodiscard]] Result<Statement*, std::string> cached(const std::string& sql);
  using Bind = std::function<void(Statement&)>;
  /// Binds what @p bind does and runs it, in the transaction.
  [[nodiscard]] Outcome write(const std::string& sql, const Bind& bind);
  /// Likewise. @return the number that the statement returns; nullopt: no row
  [[nodiscard]] Result<std::optional<std::int64_t>, std::string> insert(const std::string& sql,
                                                                        const Bind& bind);
  [[nodiscard]] Outcome begin();
  [[nodiscard]] Outcome begin_connected();
  void roll_back();
  /// What add() and commit() rely on is as it is in the file.
  struct Memory {
    GapFinder finder;
    std::optional<Pass> pass;
  };
  [[nodiscard]] Outcome on_new(const ReceivedPacket& received, std::int64_t id, std::int64_t time,
                               const std::optional<std::uint16_t>& structure);
  [[nodiscard]] Outcome fill_gaps(const wire::TmPacket& packet, std::int64_t time);
  /// How many packets of a gap another station received.
  [[nodiscard]] Result<std::uint16_t, std::string> received_elsewhere(const Gap& gap);
  [[nodiscard]] Outcome add_gap(const Gap& gap);
  [[nodiscard]] Outcome link_report(const wire::TmPacket& packet, std::int64_t id);
  [[nodiscard]] Outcome write_pass();
  [[nodiscard]] Outcome write_sequence(std::uint16_t apid, const GapFinder::Last& last);
  void follow_pass(UtcTime received);
  /// Each row of a query to @p take; false: enough.
  [[nodiscard]] Outcome each(const std::string& sql, const Bind& bind,
                             const std::function<bool(const Statement&)>& take);
  [[nodiscard]] Outcome each(const std::string& sql, const Where& where,
                             const std::function<bool(const Statement&)>& take) {
    return each(
        sql, [&where](Statement& s) { where.bind(s); }, take);
  }
  [[nodiscard]] std::string text_of(const DatabaseError& error) const {
    return fmt::format("{}: {}", place_.address, error.message);
  }
  [[nodiscard]] Outcome outcome_of(const Result<void, DatabaseError>& done) const {
    return done ? Outcome{} : Err(text_of(done.error()));
  }
  [[nodiscard]] Outcome keep_minutes_before(std::int64_t minute);
  /// A number by a text.
  [[nodiscard]] Result<std::optional<std::int64_t>, std::string> number_of_text(const std::string& sql,
                                                                                const std::string& text);
  [[nodiscard]] Result<std::int64_t, std::string> parameter_id(const std::string& name);

  ArchivePlace place_;
  std::unique_ptr<Database> database_;
  Prepare prepare_;
  std::string own_;  ///< condition on what is each station's, where several write
  PreparedStatements statements_;
  int known_ = 0;  ///< connection of which the state here is
  bool in_transaction_ = false;
  bool must_sync_ = false;  ///< a telecommand is in it, which goes up behind the commit
  /// Why nothing can be written until the next commit(): what is away is waited for once in a turn.
  std::optional<std::string> away_;
  Memory now_;
  Memory committed_;                 ///< at the last commit
  std::set<std::uint16_t> changed_;  ///< application processes of which a packet came since then
  bool pass_changed_ = false;
  std::map<std::string, std::int64_t> parameters_;
  /// A number is given once, also when its packet is lost. nullopt: the database has other writers, too, and
  /// gives them.
  std::optional<std::int64_t> next_packet_;
};

Result<Statement*, std::string> SqlArchive::cached(const std::string& sql) {
  const auto statement = statements_.of(*database_, sql);
  if (!statement) return Err(text_of(statement.error()));
  return *statement;
}

Archive::Outcome SqlArchive::begin() {
  if (in_transaction_) return {};
  if (away_) return Err(*away_);
  auto begun = begin_connected();
  if (begun)
    in_transaction_ = true;
  else
    away_ = begun.error();
  return begun;
}

Archive::Outcome SqlArchive::begin_connected() {
  auto done = outcome_of(database_->begin());
  if (!done || known_ == database_->connection()) return done;
  if (prepare_) {
    done = prepare_(*database_);
    if (!done) done = Err(fmt::format("{}: {}", place_.address, done.error()));
    if (done) done = outcome_of(database_->commit());
    if (done) done = outcome_of(database_->begin());
  }
  if (done) done = restore();
  if (done) return done;
  database_->roll_back();
  known_ = 0;
  return done;
}

Archive::Outcome SqlArchive::take_up() {
  if (const auto begun = begin(); !begun) return begun;
  const auto committed = commit();
  return committed ? Outcome{} : Err(committed.error());
}

Archive::Outcome SqlArchive::write(const std::string& sql, const Bind& bind) {
  const auto done = insert(sql, bind);
  return done ? Outcome{} : Err(done.error());
}

Result<std::optional<std::int64_t>, std::string> SqlArchive::insert(const std::string& sql,
                                                                    const Bind& bind) {
  if (auto begun = begin(); !begun) return Err(begun.error());
  const auto statement = cached(sql);
  if (!statement) return Err(statement.error());
  bind(**statement);
  const auto row = (*statement)->step();
  std::optional<std::int64_t> number;
  if (row && *row) number = (*statement)->integer(0);
  (*statement)->reset();
  if (row) return number;
  roll_back();
  return Err(text_of(row.error()));
}

/// What of this transaction is not written yet is lost; the next one begins anew, with what is in the file.
void SqlArchive::roll_back() {
  database_->roll_back();
  in_transaction_ = false;
  must_sync_ = false;
  now_ = committed_;
  changed_.clear();
  pass_changed_ = false;
  parameters_.clear();
}

Archive::Outcome SqlArchive::each(const std::string& sql, const Bind& bind,
                                  const std::function<bool(const Statement&)>& take) {
  if (known_ == 0) {
    if (const auto begun = take_up(); !begun) return begun;
  }
  const auto statement = cached(sql);
  if (!statement) return Err(statement.error());
  bind(**statement);
  Outcome outcome;
  while (true) {
    const auto row = (*statement)->step();
    if (!row) outcome = Err(text_of(row.error()));
    if (!row || !*row || !take(**statement)) break;
  }
  (*statement)->reset();
  return outcome;
}

Archive::Outcome SqlArchive::restore() {
  known_ = database_->connection();
  now_ = {};
  auto done = each(
      "SELECT apid, sequence, time FROM sequences WHERE true" + own_, Where(), [&](const Statement& row) {
        now_.finder.restore(static_cast<std::uint16_t>(row.integer(0)),
                            {static_cast<std::uint16_t>(row.integer(1)), time_of(row.integer(2))});
        return true;
      });
  if (!done) return done;
  if (!database_->is_shared())
    done = each("SELECT coalesce(max(id),0)+1 FROM packets", Where(), [&](const Statement& row) {
      next_packet_ = row.integer(0);
      return true;
    });
  if (!done) return done;
  done = each("SELECT id, began, ended, packets FROM passes WHERE true" + own_ +
                  " ORDER BY began DESC, id DESC LIMIT 1",
              Where(), [&](const Statement& row) {
                now_.pass = Pass{row.integer(0), time_of(row.integer(1)), time_of(row.integer(2)),
                                 static_cast<std::uint64_t>(row.integer(3))};
                return true;
              });
  committed_ = now_;
  return done;
}

void SqlArchive::follow_pass(UtcTime received) {
  auto& pass = now_.pass;
  if (!pass || received - pass->ended > pass_silence || received < pass->began)
    pass = Pass{0, received, received, 0};
  pass->ended = std::max(pass->ended, received);
  ++pass->packets;
  pass_changed_ = true;
}

Result<std::int64_t, std::string> SqlArchive::add(const ReceivedPacket& received, UtcTime now) {
  const wire::TmPacket& packet = received.packet;
  const std::int64_t time = to_utc(packet.time).ns();
  const auto structure = structure_in(packet);
  const int copy = received.vc == tm_channel::playback ? retrieved_copy : live_copy;
  const int copies = received.authenticity == Authenticity::verified ? copy | verified_copy : copy;
  const std::int64_t crc = crc32c(received.raw);
  const auto added = insert(
      fmt::format("INSERT INTO packets(time, received, apid, sequence, service, subtype, structure, copies, "
                  "crc, raw, id) VALUES(?,?,?,?,?,?,?,?,?,?,{}) ON CONFLICT(apid, sequence, time, crc) DO "
                  "NOTHING RETURNING id",
                  database_->is_shared() ? "nextval('packet_numbers')"
                                         : "max(?,(SELECT coalesce(max(id),0)+1 FROM packets))"),
      [&](Statement& s) {
        s.bind(1, time).bind(2, now.ns()).bind(3, std::int64_t{packet.apid});
        s.bind(4, std::int64_t{packet.sequence_count}).bind(5, std::int64_t{packet.service});
        s.bind(6, std::int64_t{packet.subtype}).bind(8, std::int64_t{copies}).bind(9, crc);
        structure ? s.bind(7, std::int64_t{*structure}) : s.bind_null(7);
        s.bind(10, OctetView(received.raw));
        if (next_packet_) s.bind(11, *next_packet_);
      });
  if (!added) return Err(added.error());
  const bool is_new = added->has_value();
  const std::int64_t id = added->value_or(0);
  if (is_new && next_packet_) next_packet_ = id + 1;
  follow_pass(now);
  if (copy == live_copy && packet.apid != 0) {
    const auto gap = now_.finder.on_packet(packet.apid, packet.sequence_count, time_of(time));
    changed_.insert(packet.apid);
    if (gap) {
      if (const auto done = add_gap(*gap); !done) return Err(done.error());
    }
  }
  if (!is_new) {
    const auto marked =
        write("UPDATE packets SET copies=copies|? WHERE apid=? AND sequence=? AND time=? AND crc=?",
              [&](Statement& s) {
                s.bind(1, std::int64_t{copies}).bind(2, std::int64_t{packet.apid});
                s.bind(3, std::int64_t{packet.sequence_count}).bind(4, time).bind(5, crc);
              });
    if (!marked) return Err(marked.error());
    return 0;
  }
  const auto done = on_new(received, id, time, structure);
  if (!done) return Err(done.error());
  return id;
}

Archive::Outcome SqlArchive::on_new(const ReceivedPacket& received, std::int64_t id, std::int64_t time,
                                    const std::optional<std::uint16_t>& structure) {
  const wire::TmPacket& packet = received.packet;
  if (packet.service == 3 && structure) {
    const auto done = write(
        "INSERT INTO dirty(minute, structure) SELECT CAST(? AS BIGINT), CAST(? AS BIGINT) "
        "WHERE NOT EXISTS (SELECT 1 FROM pruned WHERE minute>?) ON CONFLICT DO NOTHING",
        [&](Statement& s) {
          s.bind(1, minute_of(time)).bind(2, std::int64_t{*structure}).bind(3, minute_of(time));
        });
    if (!done) return done;
  }
  if (packet.service == 1) {
    if (const auto done = link_report(packet, id); !done) return done;
  }
  return fill_gaps(packet, time);
}

Result<std::uint16_t, std::string> SqlArchive::received_elsewhere(const Gap& gap) {
  // A longer gap is a step of the spacecraft's clock, with all packets of the archive in between.
  if (!database_->is_shared() || !gap.count || gap.to - gap.from > elsewhere_longest) return 0;
  const std::int64_t slack = nanoseconds(gap_tolerance).count();
  Where where;
  where.is("apid=", gap.apid);
  where.is("time>=", gap.from.ns() - slack);
  where.is("time<=", gap.to.ns() + slack);
  where.is("(sequence+16384-?)%16384<", gap.first);
  where.values.push_back(*gap.count);
  std::uint16_t found = 0;
  const auto done =
      each("SELECT count(DISTINCT sequence) FROM packets" + where.sql, where, [&](const Statement& row) {
        found = static_cast<std::uint16_t>(row.integer(0));
        return true;
      });
  if (!done) return Err(done.error());
  return found;
}

/// Live telemetry may be thinned on purpose: then there is a gap every second. What follows closely on an
/// open gap of the same process is the same one.
Archive::Outcome SqlArchive::add_gap(const Gap& gap) {
  const auto elsewhere = received_elsewhere(gap);
  if (!elsewhere) return Err(elsewhere.error());
  const std::int64_t missing = gap.count.value_or(1) - *elsewhere;
  if (missing == 0) return {};
  if (gap.count) {
    const auto last = static_cast<std::int64_t>((gap.first + *gap.count - 1) % GapFinder::modulus);
    const auto merged = insert(
        fmt::format("UPDATE gaps SET count=(?+16384-first)%16384+1, \"end\"=?, missing=missing+? WHERE "
                    "id=(SELECT max(id) FROM gaps WHERE state=0 AND apid=?{}) AND count IS NOT NULL AND "
                    "attempts=0 AND ?>=begin AND ?-begin<? AND ?-\"end\"<? RETURNING id",
                    own_),
        [&](Statement& s) {
          s.bind(1, last).bind(2, gap.to.ns()).bind(3, missing).bind(4, std::int64_t{gap.apid});
          s.bind(5, gap.to.ns()).bind(6, gap.to.ns()).bind(7, nanoseconds(gap_longest).count());
          s.bind(8, gap.from.ns()).bind(9, nanoseconds(gap_distance).count());
        });
    if (!merged) return Err(merged.error());
    if (*merged) return {};
  }
  auto added = write(
      "INSERT INTO gaps(apid, first, count, begin, \"end\", missing, attempts, state) "
      "VALUES(?,?,?,?,?,?,0,0)",
      [&](Statement& s) {
        s.bind(1, std::int64_t{gap.apid}).bind(2, std::int64_t{gap.first});
        gap.count ? s.bind(3, std::int64_t{*gap.count}) : s.bind_null(3);
        s.bind(4, gap.from.ns()).bind(5, gap.to.ns()).bind(6, missing);
      });
  if (!added) return added;
  return write(
      fmt::format("UPDATE gaps SET state=2 WHERE id=(SELECT id FROM gaps WHERE state=0 AND apid=?{} ORDER BY "
                  "\"end\" DESC LIMIT 1 OFFSET ?)",
                  own_),
      [&](Statement& s) { s.bind(1, std::int64_t{gap.apid}).bind(2, std::int64_t{open_gaps_max}); });
}

/// A packet that was missing has come.
Archive::Outcome SqlArchive::fill_gaps(const wire::TmPacket& packet, std::int64_t time) {
  const std::int64_t slack = nanoseconds(gap_tolerance).count();
  return write(
      "UPDATE gaps SET missing=missing-1, state=CASE WHEN missing=1 THEN 1 ELSE 0 END WHERE state=0 AND "
      "apid=? AND "
      "count IS NOT NULL AND (?+16384-first)%16384<count AND begin<=? AND \"end\">=?",
      [&](Statement& s) {
        s.bind(1, std::int64_t{packet.apid}).bind(2, std::int64_t{packet.sequence_count});
        s.bind(3, time + slack).bind(4, time - slack);
      });
}

/// A verification report belongs to the newest telecommand with its request id.
Archive::Outcome SqlArchive::link_report(const wire::TmPacket& packet, std::int64_t id) {
  OctetReader in(packet.source);
  const wire::RequestId request{in.u16(), in.u16()};
  if (!in.ok()) return {};
  return write(
      "INSERT INTO reports(telecommand, packet) SELECT id, CAST(? AS BIGINT) FROM telecommands WHERE "
      "request=? ORDER BY sent DESC, id DESC LIMIT 1 ON CONFLICT DO NOTHING",
      [&](Statement& s) { s.bind(1, id).bind(2, number_of(request)); });
}

Archive::Outcome SqlArchive::add(const TelecommandEntry& telecommand) {
  const auto written = write(
      "INSERT INTO telecommands(token, request, sent, who, name, arguments, ad, scheduled) "
      "VALUES(?,?,?,?,?,?,?,?)",
      [&](Statement& s) {
        const std::string arguments = nlohmann::json(telecommand.arguments)
                                          .dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
        s.bind(1, telecommand.token).bind(2, number_of(telecommand.request)).bind(3, telecommand.sent.ns());
        s.bind(4, telecommand.who).bind(5, telecommand.name).bind(6, arguments);
        s.bind(7, std::int64_t{telecommand.ad}).bind(8, std::int64_t{telecommand.scheduled});
      });
  if (written) must_sync_ = true;
  return written;
}

Archive::Outcome SqlArchive::add(const FileEntry& file) {
  return write("INSERT INTO files(time, txn, direction, name, event, octets) VALUES(?,?,?,?,?,?)",
               [&](Statement& s) {
                 s.bind(1, file.time.ns()).bind(2, file.transaction).bind(3, file.direction);
                 s.bind(4, file.name).bind(5, file.event);
                 file.octets ? s.bind(6, static_cast<std::int64_t>(*file.octets)) : s.bind_null(6);
               });
}

Archive::Outcome SqlArchive::write_pass() {
  auto& pass = now_.pass;
  if (!pass || !std::exchange(pass_changed_, false)) return {};
  if (pass->id == 0) {
    const auto added =
        insert("INSERT INTO passes(began, ended, packets) VALUES(?,?,?) RETURNING id", [&](Statement& s) {
          s.bind(1, pass->began.ns()).bind(2, pass->ended.ns());
          s.bind(3, static_cast<std::int64_t>(pass->packets));
        });
    if (!added) return Err(added.error());
    pass->id = added->value_or(0);
    return {};
  }
  return write("UPDATE passes SET ended=?, packets=? WHERE id=?", [&](Statement& s) {
    s.bind(1, pass->ended.ns()).bind(2, static_cast<std::int64_t>(pass->packets)).bind(3, pass->id);
  });
}

Archive::Outcome SqlArchive::write_sequence(std::uint16_t apid, const GapFinder::Last& last) {
  const auto bind = [&](Statement& s) {
    s.bind(1, std::int64_t{last.sequence}).bind(2, last.time.ns()).bind(3, std::int64_t{apid});
  };
  const auto updated =
      insert("UPDATE sequences SET sequence=?, time=? WHERE apid=?" + own_ + " RETURNING apid", bind);
  if (!updated) return Err(updated.error());
  return *updated ? Outcome{} : write("INSERT INTO sequences(sequence, time, apid) VALUES(?,?,?)", bind);
}

Result<bool, std::string> SqlArchive::commit() {
  away_.reset();
  if (!in_transaction_) return false;
  for (const std::uint16_t apid : std::exchange(changed_, {})) {
    const auto last = now_.finder.last(apid);
    if (!last) continue;
    if (const auto done = write_sequence(apid, *last); !done) return Err(done.error());
  }
  if (const auto done = write_pass(); !done) return Err(done.error());
  if (const auto committed = database_->commit(); !committed) {
    roll_back();
    return Err(text_of(committed.error()));
  }
  in_transaction_ = false;
  committed_ = now_;
  if (!std::exchange(must_sync_, false)) return true;
  if (const auto synced = database_->sync(); !synced) return Err(text_of(synced.error()));
  return true;
}

Archive::Outcome SqlArchive::forget_token(const std::string& token) {
  return write("UPDATE telecommands SET token = token || ' not sent ' || id WHERE token=?",
               [&](Statement& s) { s.bind(1, token); });
}

Result<std::optional<std::int64_t>, std::string> SqlArchive::number_of_text(const std::string& sql,
                                                                            const std::string& text) {
  std::optional<std::int64_t> number;
  const auto done = each(
      sql, [&](Statement& s) { s.bind(1, text); },
      [&](const Statement& row) {
        number = row.integer(0);
        return false;
      });
  if (!done) return Err(done.error());
  return number;
}

Result<std::optional<wire::RequestId>, std::string> SqlArchive::request_of(const std::string& token) {
  const auto number = number_of_text("SELECT request FROM telecommands WHERE token=?", token);
  if (!number) return Err(number.error());
  return *number ? std::optional(request_id_of(**number)) : std::nullopt;
}

Archive::Outcome SqlArchive::count_attempt(std::int64_t gap) {
  return write("UPDATE gaps SET attempts=attempts+1 WHERE id=? AND state=0",
               [&](Statement& s) { s.bind(1, gap); });
}

Archive::Outcome SqlArchive::close_gap(std::int64_t gap) {
  // Of a gap without count nobody knows what was missing: the retrieval is all there is to have.
  return write(
      "UPDATE gaps SET state=CASE WHEN count IS NULL OR missing=0 THEN 1 ELSE 2 END, missing=CASE WHEN count "
      "IS NULL "
      "THEN 0 ELSE missing END WHERE id=? AND state=0",
      [&](Statement& s) { s.bind(1, gap); });
}

Archive::Outcome SqlArchive::give_up_gap(std::int64_t gap) {
  return write("UPDATE gaps SET state=2 WHERE id=? AND state=0", [&](Statement& s) { s.bind(1, gap); });
}

Result<std::optional<Archive::DirtyMinute>, std::string> SqlArchive::dirty_minute(UtcTime before) {
  Where where;
  where.is("minute<", minute_of(before.ns()));
  std::optional<DirtyMinute> found;
  const auto look = [&] {
    found.reset();
    return each("SELECT minute, structure FROM dirty" + where.sql + " ORDER BY minute LIMIT 1", where,
                [&](const Statement& row) {
                  found = DirtyMinute{static_cast<std::uint16_t>(row.integer(1)), row.integer(0)};
                  return false;
                });
  };
  auto done = look();
  if (done && found) {
    done = begin();
    if (done && database_->is_shared()) done = look();  // another server may have made it
  }
  if (!done) return Err(done.error());
  return found;
}

Result<std::int64_t, std::string> SqlArchive::parameter_id(const std::string& name) {
  if (const auto known = parameters_.find(name); known != parameters_.end()) return known->second;
  const auto added = write("INSERT INTO parameters(name) VALUES(?) ON CONFLICT DO NOTHING",
                           [&](Statement& s) { s.bind(1, name); });
  if (!added) return Err(added.error());
  const auto id = number_of_text("SELECT id FROM parameters WHERE name=?", name);
  if (!id) return Err(id.error());
  if (!*id) return Err(fmt::format("{}: parameter {} has no number", place_.address, name));
  parameters_[name] = **id;
  return **id;
}

Archive::Outcome SqlArchive::set_minute(const DirtyMinute& minute,
                                        const std::map<std::string, Aggregate>& aggregates) {
  for (const auto& [name, values] : aggregates) {
    const auto id = parameter_id(name);
    if (!id) return Err(id.error());
    const auto done = write(
        "INSERT INTO minutes(parameter, minute, count, min, mean, max, worst) VALUES(?,?,?,?,?,?,?) "
        "ON CONFLICT(parameter, minute) DO UPDATE SET count=excluded.count, min=excluded.min, "
        "mean=excluded.mean, max=excluded.max, worst=excluded.worst WHERE excluded.count>=minutes.count OR "
        "NOT EXISTS (SELECT 1 FROM pruned WHERE pruned.minute>excluded.minute)",
        [&, &of = values](Statement& s) {
          s.bind(1, *id).bind(2, minute.minute).bind(3, static_cast<std::int64_t>(of.count));
          s.bind(4, of.min).bind(5, of.mean).bind(6, of.max).bind(7, static_cast<std::int64_t>(of.worst));
        });
    if (!done) return done;
  }
  return write("DELETE FROM dirty WHERE minute=? AND structure=?",
               [&](Statement& s) { s.bind(1, minute.minute).bind(2, std::int64_t{minute.structure}); });
}

Archive::Outcome SqlArchive::forget_minutes() {
  // Of minutes whose packets were removed there is nothing to make them of.
  std::optional<std::int64_t> oldest;
  std::int64_t newest = 0;
  std::int64_t first = INT64_MIN;
  auto done = each("SELECT (SELECT min(time) FROM packets), (SELECT max(time) FROM packets)", Where(),
                   [&](const Statement& row) {
                     if (!row.is_null(0)) oldest = minute_of(row.integer(0));
                     newest = minute_of(row.integer(1));
                     return true;
                   });
  if (done)
    done = each("SELECT minute FROM pruned", Where(), [&](const Statement& row) {
      first = row.integer(0);
      return true;
    });
  if (!done || !oldest) return done;
  first = std::max(*oldest, first);
  // Other writers wait for a day of it at most.
  const std::int64_t span = database_->is_shared() ? batch_minutes : newest - first + 1;
  for (; done && first <= newest; first += span) {
    const std::int64_t end = first + span;
    done = write("DELETE FROM minutes WHERE minute>=? AND minute<?",
                 [&](Statement& s) { s.bind(1, first).bind(2, end); });
    if (!done) return done;
    done = write(
        "INSERT INTO dirty(minute, structure) SELECT DISTINCT time/60000000000, structure FROM packets "
        "WHERE service=3 AND structure IS NOT NULL AND time>=? AND time<? ON CONFLICT DO NOTHING",
        [&](Statement& s) { s.bind(1, first * minute_ns).bind(2, end * minute_ns); });
    if (!done) return done;
    if (const auto committed = commit(); !committed) return Err(committed.error());
  }
  return done;
}

Archive::Outcome SqlArchive::packets(const PacketFilter& filter,
                                     const std::function<bool(const StoredPacket&)>& take) {
  const Where where = where_of(filter);
  const char* const order = filter.latest_live    ? "received DESC, id DESC"
                            : filter.after_id     ? "id"
                            : filter.newest_first ? "time DESC, id DESC"
                                                  : "time, id";
  std::size_t left = filter.most;
  if (left == 0) return {};
  const std::string most = left == SIZE_MAX ? "" : fmt::format(" LIMIT {}", left);
  return each(
      fmt::format("SELECT id, received, copies, raw FROM packets{} ORDER BY {}{}", where.sql, order, most),
      where, [&](const Statement& row) {
        StoredPacket stored{.id = row.integer(0),
                            .received = time_of(row.integer(1)),
                            .live = (row.integer(2) & live_copy) != 0,
                            .retrieved = (row.integer(2) & retrieved_copy) != 0,
                            .packet = {}};
        stored.packet.vc = stored.live ? tm_channel::live : tm_channel::playback;
        if ((row.integer(2) & verified_copy) != 0) stored.packet.authenticity = Authenticity::verified;
        stored.packet.raw = row.octets(3);
        auto telemetry = telemetry_in(stored.packet.raw);
        if (!telemetry) return true;  // only what is a packet was added
        stored.packet.packet = std::move(*telemetry);
        return take(stored) && --left > 0;
      });
}

Result<std::uint64_t, std::string> SqlArchive::count(const PacketFilter& filter) {
  Where where = where_of(filter);
  if (filter.most != SIZE_MAX) {
    where.sql += " LIMIT ?";
    where.values.push_back(static_cast<std::int64_t>(filter.most));
  }
  std::uint64_t rows = 0;
  const auto done = each("SELECT count(*) FROM (SELECT 1 FROM packets" + where.sql + ") AS found", where,
                         [&](const Statement& row) {
                           rows = static_cast<std::uint64_t>(row.integer(0));
                           return false;
                         });
  if (!done) return Err(done.error());
  return rows;
}

/// Of a row of telecommand_columns.
StoredTelecommand telecommand_in(const Statement& row) {
  return {.id = row.integer(0),
          .entry = {.token = row.text(1),
                    .request = request_id_of(row.integer(2)),
                    .sent = time_of(row.integer(3)),
                    .who = row.text(4),
                    .name = row.text(5),
                    .arguments = strings_in(row.text(6)),
                    .ad = row.integer(7) != 0,
                    .scheduled = row.integer(8) != 0},
          .reports = {}};
}

constexpr std::string_view telecommand_columns =
    "SELECT id, token, request, sent, who, name, arguments, ad, scheduled FROM telecommands";

Result<std::optional<StoredTelecommand>, std::string> SqlArchive::telecommand_of(
    const wire::RequestId& request, UtcTime before) {
  Where where;
  where.is("request=", number_of(request));
  where.is("sent<", before.ns());
  std::optional<StoredTelecommand> found;
  const auto done =
      each(std::string(telecommand_columns) + where.sql + " ORDER BY sent DESC, id DESC LIMIT 1", where,
           [&](const Statement& row) {
             found = telecommand_in(row);
             return false;
           });
  if (!done) return Err(done.error());
  return found;
}

Result<bool, std::string> SqlArchive::acknowledge(std::int64_t packet,
                                                  const Acknowledgement& acknowledgement) {
  const auto done = insert(
      "INSERT INTO acknowledgements(packet, time, who) SELECT id, CAST(? AS BIGINT), CAST(? AS TEXT) FROM "
      "packets WHERE id=? AND service=5 ON CONFLICT DO NOTHING RETURNING packet",
      [&](Statement& s) {
        s.bind(1, acknowledgement.time.ns()).bind(2, acknowledgement.who).bind(3, packet);
      });
  if (!done) return Err(done.error());
  return done->has_value();
}

Result<std::optional<Acknowledgement>, std::string> SqlArchive::acknowledgement_of(std::int64_t packet) {
  Where where;
  where.is("packet=", packet);
  std::optional<Acknowledgement> found;
  const auto done =
      each("SELECT time, who FROM acknowledgements" + where.sql, where, [&](const Statement& row) {
        found = Acknowledgement{time_of(row.integer(0)), row.text(1)};
        return false;
      });
  if (!done) return Err(done.error());
  return found;
}

Result<std::int64_t, std::string> SqlArchive::newest_packet() {
  std::int64_t newest = 0;
  const auto done =
      each("SELECT id FROM packets ORDER BY id DESC LIMIT 1", Where(), [&](const Statement& row) {
        newest = row.integer(0);
        return false;
      });
  if (!done) return Err(done.error());
  return newest;
}

Result<std::vector<StoredTelecommand>, std::string> SqlArchive::telecommands(const Period& period,
                                                                             std::size_t most) {
  Where where;
  where.in("sent", period);
  std::vector<StoredTelecommand> found;
  const std::string limit = most == SIZE_MAX ? "" : fmt::format(" LIMIT {}", most);
  auto done = each(std::string(telecommand_columns) + where.sql + " ORDER BY sent DESC, id DESC" + limit,
                   where, [&](const Statement& row) {
                     found.push_back(telecommand_in(row));
                     return found.size() < most;
                   });
  std::reverse(found.begin(), found.end());
  for (StoredTelecommand& stored : found) {
    if (!done) break;
    Where of;
    of.is("telecommand=", stored.id);
    done = each("SELECT received, raw FROM reports JOIN packets ON packets.id=reports.packet" + of.sql +
                    " ORDER BY received, packets.id",
                of, [&](const Statement& row) {
                  const auto packet = telemetry_in(row.octets(1));
                  if (packet)
                    stored.reports.push_back(
                        {to_utc(packet->time), time_of(row.integer(0)), packet->subtype, packet->source});
                  return true;
                });
  }
  if (!done) return Err(done.error());
  return found;
}

Result<std::vector<Point>, std::string> SqlArchive::minutes(const std::string& parameter,
                                                            const Period& period) {
  const auto id = number_of_text("SELECT id FROM parameters WHERE name=?", parameter);
  if (!id) return Err(id.error());
  std::vector<Point> points;
  if (!*id) return points;
  Where where;
  where.is("parameter=", **id);
  if (period.from) where.is("minute>=", minute_of(period.from->ns()));
  if (period.to) where.is("minute<", minute_of(period.to->ns() + minute_ns - 1));
  const auto done =
      each("SELECT minute, count, min, mean, max, worst FROM minutes" + where.sql + " ORDER BY minute", where,
           [&](const Statement& r) {
             points.push_back({time_of(r.integer(0) * minute_ns),
                               {.count = static_cast<std::uint64_t>(r.integer(1)),
                                .min = r.real(2),
                                .mean = r.real(3),
                                .max = r.real(4),
                                .worst = static_cast<mission::LimitState>(r.integer(5) & 3)}});
             return true;
           });
  if (!done) return Err(done.error());
  return points;
}

Result<std::vector<std::int64_t>, std::string> SqlArchive::dirty_minutes(std::uint16_t structure,
                                                                         const Period& period) {
  Where where;
  where.is("structure=", structure);
  if (period.from) where.is("minute>=", minute_of(period.from->ns()));
  if (period.to) where.is("minute<", minute_of(period.to->ns() + minute_ns - 1));
  std::vector<std::int64_t> found;
  const auto done =
      each("SELECT minute FROM dirty" + where.sql + " ORDER BY minute", where, [&](const Statement& row) {
        found.push_back(row.integer(0));
        return true;
      });
  if (!done) return Err(done.error());
  return found;
}

Result<std::vector<StoredGap>, std::string> SqlArchive::gaps(const Period& period, bool open_alone) {
  Where where;
  if (period.from) where.is("\"end\">=", period.from->ns());
  if (period.to) where.is("begin<", period.to->ns());
  if (open_alone) where.is("state=", 0);
  std::vector<StoredGap> found;
  const auto done = each("SELECT id, apid, first, count, begin, \"end\", missing, attempts, state FROM gaps" +
                             where.sql + " ORDER BY begin, id",
                         where, [&](const Statement& row) {
                           StoredGap stored;
                           stored.id = row.integer(0);
                           stored.gap.apid = static_cast<std::uint16_t>(row.integer(1));
                           stored.gap.first = static_cast<std::uint16_t>(row.integer(2));
                           if (!row.is_null(3)) stored.gap.count = static_cast<std::uint16_t>(row.integer(3));
                           stored.gap.from = time_of(row.integer(4));
                           stored.gap.to = time_of(row.integer(5));
                           stored.missing = static_cast<std::uint32_t>(row.integer(6));
                           stored.attempts = static_cast<std::uint32_t>(row.integer(7));
                           stored.state =
                               static_cast<GapState>(std::clamp<std::int64_t>(row.integer(8), 0, 2));
                           found.push_back(stored);
                           return true;
                         });
  if (!done) return Err(done.error());
  return found;
}

Result<std::vector<Pass>, std::string> SqlArchive::passes(const Period& period) {
  Where where;
  if (period.from) where.is("ended>=", period.from->ns());
  if (period.to) where.is("began<", period.to->ns());
  std::vector<Pass> found;
  const auto done = each("SELECT id, began, ended, packets FROM passes" + where.sql + " ORDER BY began, id",
                         where, [&](const Statement& row) {
                           found.push_back({row.integer(0), time_of(row.integer(1)), time_of(row.integer(2)),
                                            static_cast<std::uint64_t>(row.integer(3))});
                           return true;
                         });
  if (!done) return Err(done.error());
  return found;
}

Result<std::vector<FileEntry>, std::string> SqlArchive::files(const Period& period) {
  Where where;
  where.in("time", period);
  std::vector<FileEntry> found;
  const auto done =
      each("SELECT time, txn, direction, name, event, octets FROM files" + where.sql + " ORDER BY time, id",
           where, [&](const Statement& row) {
             FileEntry file{
                 time_of(row.integer(0)), row.text(1), row.text(2), row.text(3), row.text(4), std::nullopt};
             if (!row.is_null(5)) file.octets = static_cast<std::uint64_t>(row.integer(5));
             found.push_back(std::move(file));
             return true;
           });
  if (!done) return Err(done.error());
  return found;
}

Result<std::vector<std::string>, std::string> SqlArchive::check() {
  std::vector<std::string> wrong;
  if (auto damage = database_->damage())
    wrong = std::move(*damage);
  else
    wrong.push_back(text_of(damage.error()));
  if (!wrong.empty()) return wrong;
  // A database does not see a changed octet of a row; the check of each packet does.
  const auto packets_read = each("SELECT id, crc, raw FROM packets", Where(), [&](const Statement& row) {
    if (row.integer(1) != std::int64_t{crc32c(row.octets(2))})
      wrong.push_back(fmt::format("packet {}: its octets have changed", row.integer(0)));
    constexpr std::size_t told_max = 20;
    return wrong.size() < told_max;
  });
  if (!packets_read) wrong.push_back(packets_read.error());
  return wrong;
}

Result<std::uint64_t, std::string> SqlArchive::prune(const std::string& table, UtcTime before) {
  struct Removed {
    const char* column;
    const char* key;
  };
  static const std::map<std::string, Removed> columns{
      {"packets", {"time", "id"}}, {"telecommands", {"sent", "id"}},
      {"files", {"time", "id"}},   {"passes", {"ended", "id"}},
      {"gaps", {"\"end\"", "id"}}, {"minutes", {"minute", "parameter, minute"}}};
  const auto found = columns.find(table);
  if (found == columns.end())
    return Err(fmt::format("'{}': expected packets, telecommands, files, passes, gaps or minutes", table));
  const auto& [column, key] = found->second;
  const std::int64_t limit = table == "minutes" ? minute_of(before.ns()) : before.ns();
  const bool of_packets = table == "packets";
  if (of_packets) {
    if (const auto kept = keep_minutes_before(minute_of(limit + minute_ns - 1)); !kept)
      return Err(kept.error());
  }
  const std::int64_t batch = database_->is_shared() ? batch_rows : INT64_MAX;
  std::uint64_t rows = 0;
  while (true) {
    const auto done =
        write(fmt::format("DELETE FROM {0} WHERE ({1}) IN (SELECT {1} FROM {0} WHERE {2}<?{3} LIMIT ?)",
                          table, key, column, of_packets ? " AND id<(SELECT max(id) FROM packets)" : ""),
              [&](Statement& s) { s.bind(1, limit).bind(2, batch); });
    if (!done) return Err(done.error());
    const std::int64_t removed = database_->changes();
    rows += static_cast<std::uint64_t>(removed);
    if (removed < batch) break;
    if (const auto committed = commit(); !committed) return Err(committed.error());
  }
  if (of_packets || table == "telecommands") {
    const auto orphans = write(
        "DELETE FROM reports WHERE NOT EXISTS (SELECT 1 FROM telecommands WHERE id=telecommand) OR NOT "
        "EXISTS "
        "(SELECT 1 FROM packets WHERE id=packet)",
        [](Statement&) {});
    if (!orphans) return Err(orphans.error());
  }
  if (const auto committed = commit(); !committed) return Err(committed.error());
  return rows;
}

/// Packets of these minutes are removed: their aggregates stay as they are.
Archive::Outcome SqlArchive::keep_minutes_before(std::int64_t minute) {
  const auto bind = [&](Statement& s) { s.bind(1, minute); };
  const auto kept = write(
      "INSERT INTO pruned(one, minute) VALUES(1,?) ON CONFLICT(one) DO UPDATE SET minute=excluded.minute "
      "WHERE "
      "pruned.minute<excluded.minute",
      bind);
  return kept ? write("DELETE FROM dirty WHERE minute<?", bind) : kept;
}

/// Whether steps are to be done. The error is ready to print.
Result<bool, std::string> is_older(std::int64_t version, std::int64_t newest, ArchiveUse use) {
  if (version > newest)
    return Err(fmt::format("written by a newer srfs-ground (schema {}, this one knows {}): use that one",
                           version, newest));
  const bool is_made = use == ArchiveUse::merge && version == 0;
  if (version < newest && !is_made && (use == ArchiveUse::read || use == ArchiveUse::merge))
    return Err(fmt::format("of schema {}, not {}: srfs-ground serve brings it up to date when it starts",
                           version, newest));
  return version < newest;
}

/// Which schema a file has. The error is ready to print.
Result<std::int64_t, std::string> version_of_file(Database& database) {
  const auto version = database.number("PRAGMA user_version");
  if (!version) return Err(version.error().message);
  const auto id = database.number("PRAGMA application_id");
  if (!id) return Err(id.error().message);
  if (*version != 0 && *id != application_id) return Err(std::string("not an archive of srfs-ground"));
  return *version;
}

/// Brings the schema of a file up to date, all of it or nothing. The error is ready to print.
Archive::Outcome migrate_sqlite(Database& database, ArchiveUse use) {
  const auto before = version_of_file(database);
  if (!before) return Err(before.error());
  const auto older = is_older(*before, archive_schema, use);
  if (!older) return Err(older.error());
  if (!*older) return {};
  if (const auto begun = database.begin(); !begun) return Err(begun.error().message);
  const auto version = version_of_file(database);  // another program may have done it meanwhile
  const auto still = version ? is_older(*version, archive_schema, use) : Err(version.error());
  if (!still || !*still) {
    database.roll_back();
    return still ? Archive::Outcome{} : Err(still.error());
  }
  std::string sql;
  for (auto step = static_cast<std::size_t>(*version); step < archive_steps.size(); ++step)
    sql += archive_steps.at(step);
  sql +=
      fmt::format("PRAGMA user_version={};PRAGMA application_id={};COMMIT", archive_schema, application_id);
  const auto done = database.run(sql);
  return done ? Archive::Outcome{} : Err(done.error().message);
}

/// Likewise of a PostgreSQL, in the transaction that is open. @param schema  that of the spacecraft
Archive::Outcome migrate_postgresql(Database& database, const std::string& schema, ArchiveUse use) {
  const auto there = database.number(fmt::format(
      "SELECT count(*) FROM pg_tables WHERE schemaname='{}' AND tablename='archive_version'", schema));
  if (!there) return Err(there.error().message);
  const auto version = *there == 0 ? 0 : database.number("SELECT version FROM archive_version");
  if (!version) return Err(version.error().message);
  if (*there == 0 && use == ArchiveUse::read)
    return Err(
        fmt::format("there is no archive of this spacecraft ({}); srfs-ground serve makes it", schema));
  const auto older = is_older(*version, std::int64_t{postgresql_steps.size()}, use);
  if (!older) return Err(older.error());
  if (!*older) return {};
  std::string sql;
  const auto has_schema =
      database.number(fmt::format("SELECT count(*) FROM pg_namespace WHERE nspname='{}'", schema));
  if (!has_schema) return Err(has_schema.error().message);
  if (*has_schema == 0) sql += fmt::format("CREATE SCHEMA {};", schema);
  for (auto step = static_cast<std::size_t>(*version); step < postgresql_steps.size(); ++step)
    sql += postgresql_steps.at(step);
  sql += fmt::format("UPDATE archive_version SET version={}", postgresql_steps.size());
  const auto done = database.run(sql);
  return done ? Archive::Outcome{} : Err(done.error().message);
}

}  // namespace

std::string_view to_text(GapState state) {
  switch (state) {
    case GapState::open:
      return "open";
    case GapState::filled:
      return "filled";
    case GapState::given_up:
      return "given up";
  }
  return "?";
}

namespace {

/// Where repair_archive() makes the new file.
std::filesystem::path repaired_of(std::filesystem::path file) {
  return file += ".repaired";
}

}  // namespace

namespace {

Result<std::unique_ptr<Database>, std::string> open_sqlite(const ArchivePlace& place, ArchiveUse use) {
  const std::filesystem::path file = place.address;
  std::error_code error;
  const bool there = std::filesystem::exists(file, error);
  if (!there && std::filesystem::exists(repaired_of(file), error))
    return Err(
        fmt::format("{}: a repair was interrupted: srfs-ground archive repair completes it", file.string()));
  if (use == ArchiveUse::read && !there)
    return Err(fmt::format("{}: there is no archive; srfs-ground serve makes it", file.string()));
  std::filesystem::create_directories(file.parent_path(), error);
  const auto access = use == ArchiveUse::read ? SqliteDatabase::Use::read : SqliteDatabase::Use::write;
  auto database = SqliteDatabase::open(file, access);
  if (!database) return Err(database.error().message);
  if (use != ArchiveUse::read) {
    std::filesystem::permissions(
        file, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write, error);
    // NORMAL: a process may be killed anywhere; a power failure may cost the last transactions, never the
    // file. The commit of a telecommand is synced by itself.
    const auto set =
        (*database)->run("PRAGMA journal_mode=WAL;PRAGMA synchronous=NORMAL;PRAGMA cache_size=-8000");
    if (!set)
      return Err(fmt::format("{}: {}; see srfs-ground archive repair", file.string(), set.error().message));
  }
  if (use != ArchiveUse::read) (*database)->set_patience(migration_patience);
  if (const auto migrated = migrate_sqlite(**database, use); !migrated)
    return Err(fmt::format("{}: {}", file.string(), migrated.error()));
  if (use != ArchiveUse::read)
    (*database)->set_patience(use == ArchiveUse::merge ? command_patience : writing_patience);
  return std::move(*database);
}

Result<std::unique_ptr<Archive>, std::string> open_file(const ArchivePlace& place, ArchiveUse use) {
  auto database = open_sqlite(place, use);
  if (!database) return Err(database.error());
  auto archive = std::make_unique<SqlArchive>(place, std::move(*database), nullptr);
  if (const auto restored = archive->restore(); !restored) return Err(restored.error());
  return archive;
}

/// What the station's loop waits for at most is a transaction's patience, and that of ending it. A program
/// that keeps the lock loses its connection.
PostgresqlDatabase::Settings settings_of(const ArchivePlace& place, ArchiveUse use) {
  constexpr int spacecraft_locks = 0x53524653;  // "SRFS"
  const bool station = use == ArchiveUse::write;
  PostgresqlDatabase::Settings settings;
  settings.address = place.address;
  settings.patience = command_patience;
  settings.connecting = connecting_patience;
  settings.prepare = fmt::format(
      "SET search_path=srfs_{}; SET srfs.station={}; SET lock_timeout={}; SET statement_timeout={}; "
      "SET idle_in_transaction_session_timeout={}",
      place.spacecraft, place.station, milliseconds(station ? lock_patience : command_patience).count(),
      milliseconds(command_patience).count(), milliseconds(lock_kept_longest).count());
  if (use == ArchiveUse::read) settings.prepare += "; SET default_transaction_read_only=on";
  settings.lock = fmt::format("SELECT pg_advisory_xact_lock({},{})", spacecraft_locks, place.spacecraft);
  return settings;
}

std::string schema_of(const ArchivePlace& place) {
  return fmt::format("srfs_{}", place.spacecraft);
}

/// Makes the tables or brings them up to date. Waits for another program that does it.
Result<void, DatabaseError> bring_up_to_date(PostgresqlDatabase& database, const ArchivePlace& place,
                                             ArchiveUse use) {
  const auto settings = settings_of(place, use);
  database.set_patience(migration_patience, settings.connecting);
  auto done = database.run("SET lock_timeout=0; SET statement_timeout=0");
  if (done) done = database.begin();
  if (!done) return done;
  if (const auto migrated = migrate_postgresql(database, schema_of(place), use); !migrated) {
    database.roll_back();
    return Err(DatabaseError{0, migrated.error()});
  }
  done = database.commit();
  database.set_patience(settings.patience, settings.connecting);
  return done ? database.run(settings.prepare) : done;
}

/// Connected, with the tables of this program; one for a station may be away.
Result<std::unique_ptr<PostgresqlDatabase>, std::string> open_postgresql_database(const ArchivePlace& place,
                                                                                  ArchiveUse use) {
  if (const auto wrong = wrong_postgresql(place.address)) return Err(*wrong);
  auto database = std::make_unique<PostgresqlDatabase>(settings_of(place, use));
  auto done = database->connect(connecting_patience);
  if (!done && use == ArchiveUse::write) return database;
  if (done) {
    const auto current = migrate_postgresql(*database, schema_of(place), ArchiveUse::read);
    if (!current && use == ArchiveUse::read) done = Err(DatabaseError{0, current.error()});
    if (!current && use != ArchiveUse::read) done = bring_up_to_date(*database, place, use);
  }
  if (!done) return Err(fmt::format("{}: {}", place.address, done.error().message));
  return database;
}

Result<std::unique_ptr<Archive>, std::string> open_postgresql(const ArchivePlace& place, ArchiveUse use) {
  auto opened = open_postgresql_database(place, use);
  if (!opened) return Err(opened.error());
  PostgresqlDatabase& database = **opened;
  // The loop of a station makes tables that are not there. It has no time for an older archive.
  auto archive =
      std::make_unique<SqlArchive>(place, std::move(*opened), [schema = schema_of(place)](Database& of) {
        return migrate_postgresql(of, schema, ArchiveUse::merge);
      });
  if (use == ArchiveUse::read) {
    archive->read();
  } else if (database.connection() != 0) {
    // A station that does not get its turn now gets it in its loop.
    if (const auto taken = archive->take_up(); !taken && use != ArchiveUse::write) return Err(taken.error());
  }
  if (use == ArchiveUse::write) database.set_patience(place.patience, place.patience / 5);
  return archive;
}

}  // namespace

bool is_shared(const ArchivePlace& place) {
  return is_postgresql(place.address);
}

std::optional<std::string> wrong_address(const ArchivePlace& place) {
  return is_shared(place) ? wrong_postgresql(place.address) : std::nullopt;
}

std::optional<std::int64_t> older_schema(const ArchivePlace& place) {
  std::error_code error;
  if (is_shared(place) || !std::filesystem::exists(place.address, error)) return std::nullopt;
  const auto database = SqliteDatabase::open(place.address, SqliteDatabase::Use::read);
  if (!database) return std::nullopt;
  const auto version = version_of_file(**database);
  return version && *version > 0 && *version < archive_schema ? std::optional(*version) : std::nullopt;
}

Result<std::unique_ptr<Archive>, std::string> open_archive(const ArchivePlace& place, ArchiveUse use) {
  return is_shared(place) ? open_postgresql(place, use) : open_file(place, use);
}

Result<std::unique_ptr<Database>, std::string> open_archive_database(const ArchivePlace& place,
                                                                     ArchiveUse use) {
  if (!is_shared(place)) return open_sqlite(place, use);
  auto database = open_postgresql_database(place, use);
  if (!database) return Err(database.error());
  return std::move(*database);
}

namespace {

struct Copied {
  std::uint64_t rows = 0;
  std::uint64_t lost = 0;
  bool complete = true;  ///< else more is lost than was counted
};

bool is_damage(const DatabaseError& error) {
  const int code = error.code & 0xFF;
  return code == SQLITE_CORRUPT || code == SQLITE_NOTADB;
}

/// Rows of one table by their numbers, in halves around what cannot be read.
Archive::Outcome copy_rows(Database& into, const char* table, std::int64_t last, Copied& copied) {
  // A damaged tree may claim any number of rows.
  constexpr int tries_max = 200'000;
  constexpr int tries_for_nothing = 20'000;
  std::vector<std::pair<std::int64_t, std::int64_t>> left{{1, last}};
  for (int tries = 0; !left.empty(); ++tries) {
    copied.complete = tries < (copied.rows == 0 ? tries_for_nothing : tries_max);
    if (!copied.complete) break;
    const auto [first, end] = left.back();
    left.pop_back();
    const auto done = into.run(fmt::format(
        "INSERT OR IGNORE INTO main.{0} SELECT * FROM damaged.{0} WHERE rowid BETWEEN {1} AND {2}", table,
        first, end));
    if (done) {
      copied.rows += static_cast<std::uint64_t>(into.changes());
    } else if (!is_damage(done.error())) {
      return Err(done.error().message);
    } else if (first == end) {
      ++copied.lost;
    } else {
      const std::int64_t middle = first + (end - first) / 2;
      left.emplace_back(middle + 1, end);
      left.emplace_back(first, middle);
    }
  }
  return {};
}

/// An error that is not damage ends the repair.
Result<Copied, std::string> copy_table(Database& into, const Table& table) {
  Copied copied;
  const auto there = into.number(
      fmt::format("SELECT count(*) FROM damaged.sqlite_master WHERE type='table' AND name='{}'", table.name));
  if (!there) return Err(there.error().message);
  if (*there == 0) {
    copied.complete = false;
    return copied;
  }
  const auto whole =
      into.run(fmt::format("INSERT OR IGNORE INTO main.{0} SELECT * FROM damaged.{0}", table.name));
  if (whole) {
    copied.rows = static_cast<std::uint64_t>(into.changes());
    return copied;
  }
  if (!is_damage(whole.error())) return Err(whole.error().message);
  copied.complete = false;
  if (!table.numbered) return copied;
  constexpr std::int64_t any = std::int64_t{1} << 62;
  const auto last = into.number(fmt::format("SELECT max(rowid) FROM damaged.{}", table.name));
  if (const auto done = copy_rows(into, table.name, last && *last > 0 ? *last : any, copied); !done)
    return Err(done.error());
  return copied;
}

/// All that can be read of @p file, in a new file that is closed and whole on the disk.
Archive::Outcome copy_readable(const std::filesystem::path& file, const std::filesystem::path& fresh,
                               Repaired& repaired) {
  if (const auto made = open_archive(fresh, ArchiveUse::write); !made) return Err(made.error());
  const auto opened = SqliteDatabase::open(fresh, SqliteDatabase::Use::write);
  if (!opened) return Err(opened.error().message);
  SqliteDatabase& into = **opened;
  const auto attach = into.prepare("ATTACH DATABASE ? AS damaged");
  if (!attach) return Err(attach.error().message);
  (*attach)->bind(1, file.string());
  if (const auto attached = (*attach)->run(); !attached) return Err(attached.error().message);
  bool remake = false;  // the aggregates of all packets that are here
  for (const Table& table : tables) {
    const auto copied = copy_table(into, table);
    if (!copied) return Err(copied.error());
    if (&table == &tables.front() && copied->rows == 0 && !copied->complete)
      return Err(std::string("no packet can be read"));
    repaired.rows += copied->rows;
    repaired.lost += copied->lost;
    if (!copied->complete) repaired.incomplete.emplace_back(table.name);
    const std::string_view name = table.name;
    const bool of_aggregates = name == "minutes" || name == "parameters" || name == "dirty";
    if (of_aggregates && (copied->lost > 0 || !copied->complete)) remake = true;
  }
  // The number of a lost name will be another's.
  auto done = into.run("DELETE FROM minutes WHERE parameter NOT IN (SELECT id FROM parameters)");
  if (done && remake)
    done = into.run(
        "INSERT OR IGNORE INTO dirty(minute, structure) SELECT DISTINCT time/60000000000, structure FROM "
        "packets WHERE service=3 AND structure IS NOT NULL AND time/60000000000>=coalesce((SELECT minute "
        "FROM pruned), (SELECT min(time)/60000000000 FROM packets))");
  if (done) done = into.run("PRAGMA main.wal_checkpoint(TRUNCATE)");
  if (!done) return Err(done.error().message);
  return {};
}

/// The damaged file aside, then the new one in its place.
Archive::Outcome exchange_files(const std::filesystem::path& file, const std::filesystem::path& fresh,
                                const std::filesystem::path& damaged) {
  std::error_code error;
  for (const char* suffix : {"", "-wal", "-shm"}) {
    if (!std::filesystem::exists(file.string() + suffix, error)) continue;
    std::filesystem::rename(file.string() + suffix, damaged.string() + suffix, error);
    if (error)
      return Err(fmt::format("{}{}: {}; run archive repair again", file.string(), suffix, error.message()));
  }
  std::filesystem::rename(fresh, file, error);
  if (error) return Err(fmt::format("{}: {}; run archive repair again", file.string(), error.message()));
  return {};
}

void remove_unfinished(const std::filesystem::path& fresh) {
  std::error_code error;
  for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(fresh.string() + suffix, error);
}

}  // namespace

Result<Repaired, std::string> repair_archive(const std::filesystem::path& file) {
  const std::filesystem::path fresh = repaired_of(file);
  std::error_code error;
  Repaired repaired;
  constexpr int nanosecond_digits = 9;
  repaired.damaged =
      fmt::format("{}.damaged-{}", file.string(), to_iso8601(system_utc_now(), nanosecond_digits));
  if (std::filesystem::exists(repaired.damaged, error))
    return Err(fmt::format("{}: it is there; try again", repaired.damaged.string()));
  repaired.completed = !std::filesystem::exists(file, error) && std::filesystem::exists(fresh, error);
  if (!repaired.completed) {
    if (!std::filesystem::exists(file, error))
      return Err(fmt::format("{}: there is no archive", file.string()));
    remove_unfinished(fresh);
    if (const auto copied = copy_readable(file, fresh, repaired); !copied) {
      remove_unfinished(fresh);
      return Err(fmt::format("{}: {}; nothing is changed", file.string(), copied.error()));
    }
  }
  if (const auto exchanged = exchange_files(file, fresh, repaired.damaged); !exchanged)
    return Err(exchanged.error());
  return repaired;
}

}  // namespace srfs::ground
