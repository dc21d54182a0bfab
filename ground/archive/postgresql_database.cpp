// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/archive/postgresql_database.hpp"

#include <algorithm>
#include <array>
#include <climits>
#include <utility>

#include <dlfcn.h>
#include <fmt/format.h>
#include <libpq-fe.h>
#include <poll.h>

#include "base/text.hpp"
#include "ground/terminal_text.hpp"

namespace srfs::ground {
namespace {

/// The functions of libpq that are used here. It is loaded when an archive needs it: with all that it brings
/// (LDAP, Kerberos) it would take a good part of the time that a short command has, and the computer on
/// board has no use for it.
class Libpq {
 public:
  [[nodiscard]] bool is_whole() const { return whole_; }

 private:
  bool whole_ = true;
  void* library_ = ::dlopen("libpq.so.5", RTLD_NOW | RTLD_LOCAL);
  template <class Function>
  Function find(const char* name) {
    void* const found = library_ == nullptr ? nullptr : ::dlsym(library_, name);
    whole_ = whole_ && found != nullptr;
    return reinterpret_cast<Function>(found);
  }

 public:
  decltype(&::PQcancel) cancel = find<decltype(&::PQcancel)>("PQcancel");
  decltype(&::PQclear) clear = find<decltype(&::PQclear)>("PQclear");
  decltype(&::PQcmdStatus) cmd_status = find<decltype(&::PQcmdStatus)>("PQcmdStatus");
  decltype(&::PQcmdTuples) cmd_tuples = find<decltype(&::PQcmdTuples)>("PQcmdTuples");
  decltype(&::PQconnectPoll) connect_poll = find<decltype(&::PQconnectPoll)>("PQconnectPoll");
  decltype(&::PQconnectStartParams) connect_start_params =
      find<decltype(&::PQconnectStartParams)>("PQconnectStartParams");
  decltype(&::PQconninfoFree) conninfo_free = find<decltype(&::PQconninfoFree)>("PQconninfoFree");
  decltype(&::PQconninfoParse) conninfo_parse = find<decltype(&::PQconninfoParse)>("PQconninfoParse");
  decltype(&::PQconsumeInput) consume_input = find<decltype(&::PQconsumeInput)>("PQconsumeInput");
  decltype(&::PQerrorMessage) error_message = find<decltype(&::PQerrorMessage)>("PQerrorMessage");
  decltype(&::PQfinish) finish = find<decltype(&::PQfinish)>("PQfinish");
  decltype(&::PQflush) flush = find<decltype(&::PQflush)>("PQflush");
  decltype(&::PQfreeCancel) free_cancel = find<decltype(&::PQfreeCancel)>("PQfreeCancel");
  decltype(&::PQfreemem) freemem = find<decltype(&::PQfreemem)>("PQfreemem");
  decltype(&::PQgetCancel) get_cancel = find<decltype(&::PQgetCancel)>("PQgetCancel");
  decltype(&::PQgetResult) get_result = find<decltype(&::PQgetResult)>("PQgetResult");
  decltype(&::PQgetisnull) getisnull = find<decltype(&::PQgetisnull)>("PQgetisnull");
  decltype(&::PQgetlength) getlength = find<decltype(&::PQgetlength)>("PQgetlength");
  decltype(&::PQgetvalue) getvalue = find<decltype(&::PQgetvalue)>("PQgetvalue");
  decltype(&::PQisBusy) is_busy = find<decltype(&::PQisBusy)>("PQisBusy");
  decltype(&::PQresultErrorField) result_error_field =
      find<decltype(&::PQresultErrorField)>("PQresultErrorField");
  decltype(&::PQresultErrorMessage) result_error_message =
      find<decltype(&::PQresultErrorMessage)>("PQresultErrorMessage");
  decltype(&::PQresultStatus) result_status = find<decltype(&::PQresultStatus)>("PQresultStatus");
  decltype(&::PQsendPrepare) send_prepare = find<decltype(&::PQsendPrepare)>("PQsendPrepare");
  decltype(&::PQsendQuery) send_query = find<decltype(&::PQsendQuery)>("PQsendQuery");
  decltype(&::PQsendQueryPrepared) send_query_prepared =
      find<decltype(&::PQsendQueryPrepared)>("PQsendQueryPrepared");
  decltype(&::PQsetSingleRowMode) set_single_row_mode =
      find<decltype(&::PQsetSingleRowMode)>("PQsetSingleRowMode");
  decltype(&::PQsetnonblocking) setnonblocking = find<decltype(&::PQsetnonblocking)>("PQsetnonblocking");
  decltype(&::PQsocket) socket = find<decltype(&::PQsocket)>("PQsocket");
  decltype(&::PQstatus) status = find<decltype(&::PQstatus)>("PQstatus");
};

const Libpq& pq() {
  static const Libpq loaded;
  return loaded;
}

std::string trimmed(const char* text) {
  std::string one_line = text == nullptr ? "" : text;
  std::replace(one_line.begin(), one_line.end(), '\n', ' ');
  one_line.erase(one_line.find_last_not_of(' ') + 1);
  return one_line;
}

/// With $1, $2, ... for each ?.
std::pair<std::string, std::size_t> numbered(std::string_view sql) {
  std::string text;
  std::size_t values = 0;
  for (const char c : sql) {
    if (c == '?')
      text += fmt::format("${}", ++values);
    else
      text += c;
  }
  return {text, values};
}

struct FreeOptions {
  void operator()(PQconninfoOption* options) const { pq().conninfo_free(options); }
};

}  // namespace

bool is_postgresql(std::string_view address) {
  return address.starts_with("postgresql://") || address.starts_with("postgres://");
}

std::optional<std::string> wrong_postgresql(const std::string& address) {
  if (!pq().is_whole()) return "PostgreSQL's library is not installed here: libpq.so.5 (Debian's libpq5)";
  char* error = nullptr;
  const std::unique_ptr<PQconninfoOption, FreeOptions> options(pq().conninfo_parse(address.c_str(), &error));
  pq().freemem(error);  // it may show all of the address
  if (!options)
    return "--archive: expected postgresql://[USER@]HOST[:PORT]/DATABASE[?PARAMETER=VALUE...], as libpq "
           "reads it";
  for (const PQconninfoOption* option = options.get(); option->keyword != nullptr; ++option) {
    if (option->dispchar[0] == '*' && option->val != nullptr)
      return fmt::format(
          "--archive: an address with a {} is seen by all users of the computer; ~/.pgpass (PGPASSFILE) or a "
          "service (PGSERVICE) has it",
          option->keyword);
  }
  return std::nullopt;
}

/// Values go as text (numbers) or octets (all others), rows come as octets (binary), one at a time.
class PostgresqlStatement final : public Statement {
 public:
  PostgresqlStatement(PostgresqlDatabase& database, std::string name, std::string sql, std::size_t values)
      : database_(database), name_(std::move(name)), sql_(std::move(sql)), values_(values) {}
  PostgresqlStatement(const PostgresqlStatement&) = delete;
  PostgresqlStatement& operator=(const PostgresqlStatement&) = delete;
  ~PostgresqlStatement() override { end(); }

  Statement& bind(int place, std::int64_t value) override { return set(place, fmt::format("{}", value), 0); }
  Statement& bind(int place, double value) override { return set(place, fmt::format("{}", value), 0); }
  Statement& bind(int place, std::string_view text) override { return set(place, valid_utf8(text), 1); }
  Statement& bind(int place, OctetView octets) override {
    return set(place, std::string(octets.begin(), octets.end()), 1);
  }
  Statement& bind_null(int place) override {
    values_.at(static_cast<std::size_t>(place) - 1) = {};
    return *this;
  }

  Result<bool, DatabaseError> step() override {
    if (!running_) {
      if (const auto sent = send(); !sent) return Err(sent.error());
    }
    auto result = database_.next_result();
    if (result && *result && pq().result_status(result->get()) == PGRES_SINGLE_TUPLE) {
      row_ = std::move(*result);
      return true;
    }
    row_.reset();
    running_ = false;
    if (!result) return Err(result.error());
    if (const auto done = database_.finish(); !done) return Err(done.error());
    return false;
  }

  void reset() override {
    end();
    values_.assign(values_.size(), {});
  }

  std::int64_t integer(int column) const override {
    if (is_null(column)) return 0;
    OctetReader in(view(column));
    switch (pq().getlength(row_.get(), 0, column)) {
      case 2:
        return static_cast<std::int16_t>(in.u16());
      case 4:
        return static_cast<std::int32_t>(in.u32());
      default:
        return static_cast<std::int64_t>(in.u64());
    }
  }
  double real(int column) const override { return OctetReader(view(column)).f64(); }
  std::string text(int column) const override {
    const OctetView octets = view(column);
    return {octets.begin(), octets.end()};
  }
  Octets octets(int column) const override {
    const OctetView octets = view(column);
    return {octets.begin(), octets.end()};
  }
  bool is_null(int column) const override { return pq().getisnull(row_.get(), 0, column) != 0; }

 private:
  struct Value {
    std::string octets = {};
    int format = 0;  ///< 0: text, 1: octets
    bool null = true;
  };
  Statement& set(int place, std::string octets, int format) {
    values_.at(static_cast<std::size_t>(place) - 1) = {std::move(octets), format, false};
    return *this;
  }
  OctetView view(int column) const {
    return {reinterpret_cast<const std::uint8_t*>(pq().getvalue(row_.get(), 0, column)),
            static_cast<std::size_t>(pq().getlength(row_.get(), 0, column))};
  }
  /// In this connection.
  Result<void, DatabaseError> prepare() {
    if (prepared_in_ == database_.connection()) return {};
    database_.start_waiting();
    if (pq().send_prepare(database_.connection_.get(), name_.c_str(), sql_.c_str(), 0, nullptr) == 0)
      return Err(database_.lose(trimmed(pq().error_message(database_.connection_.get()))));
    if (const auto done = database_.finish(); !done) return Err(done.error());
    prepared_in_ = database_.connection();
    return {};
  }
  Result<void, DatabaseError> send() {
    // Never outside of the transaction that it belongs to.
    if (database_.in_transaction_ && !database_.aborted_.empty())
      return Err(DatabaseError{0, database_.aborted_});
    if (const auto connected = database_.connect(database_.settings_.connecting); !connected)
      return Err(connected.error());
    if (const auto prepared = prepare(); !prepared) return Err(prepared.error());
    std::vector<const char*> values;
    std::vector<int> lengths;
    std::vector<int> formats;
    for (const Value& value : values_) {
      values.push_back(value.null ? nullptr : value.octets.c_str());
      lengths.push_back(static_cast<int>(value.octets.size()));
      formats.push_back(value.format);
    }
    pg_conn* const connection = database_.connection_.get();
    database_.start_waiting();
    if (pq().send_query_prepared(connection, name_.c_str(), static_cast<int>(values.size()), values.data(),
                                 lengths.data(), formats.data(), 1) == 0)
      return Err(database_.lose(trimmed(pq().error_message(connection))));
    pq().set_single_row_mode(connection);
    running_ = true;
    running_in_ = database_.connection();
    return {};
  }
  void end() {
    row_.reset();
    if (std::exchange(running_, false) && running_in_ == database_.connection()) database_.skip();
  }

  PostgresqlDatabase& database_;
  std::string name_;
  std::string sql_;
  std::vector<Value> values_;
  int prepared_in_ = 0;
  int running_in_ = 0;
  bool running_ = false;
  PostgresqlDatabase::ResultRows row_;
};

void PostgresqlDatabase::Finish::operator()(pg_conn* connection) const {
  pq().finish(connection);
}

void PostgresqlDatabase::Clear::operator()(pg_result* result) const {
  pq().clear(result);
}

bool PostgresqlDatabase::wait(bool writes, MonotonicTime until) const {
  const auto left = std::chrono::ceil<milliseconds>(until - monotonic_now()).count();
  pollfd socket{pq().socket(connection_.get()), static_cast<short>(writes ? POLLIN | POLLOUT : POLLIN), 0};
  // A signal is no reason to give up: the caller looks again.
  return ::poll(&socket, 1, static_cast<int>(std::clamp<std::int64_t>(left, 0, INT_MAX))) != 0;
}

/// Each statement has the patience, those of one transaction have it together.
void PostgresqlDatabase::start_waiting() {
  if (!in_transaction_) deadline_ = monotonic_now() + settings_.patience;
}

DatabaseError PostgresqlDatabase::lose(const std::string& why) {
  if (!why.empty()) problem_ = why;
  connection_.reset();
  connected_ = false;
  if (in_transaction_ && aborted_.empty()) aborted_ = problem_;
  return {0, problem_};
}

DatabaseError PostgresqlDatabase::error_of(const pg_result* result) {
  const char* const primary = pq().result_error_field(result, PG_DIAG_MESSAGE_PRIMARY);
  std::string message = trimmed(primary != nullptr ? primary : pq().result_error_message(result));
  if (pq().status(connection_.get()) == CONNECTION_BAD) return lose(message);
  const char* const state = pq().result_error_field(result, PG_DIAG_SQLSTATE);
  const std::string_view code = state == nullptr ? "" : state;
  // The server ends, or has ended this connection.
  if (code.starts_with("57P0") || code == "25P03") return lose(message);
  if (in_transaction_ && aborted_.empty()) aborted_ = message;
  return {0, message};
}

Result<PostgresqlDatabase::ResultRows, DatabaseError> PostgresqlDatabase::next_result() {
  pg_conn* const connection = connection_.get();
  while (true) {
    const int left = pq().flush(connection);
    if (left < 0) return Err(lose(trimmed(pq().error_message(connection))));
    if (left == 0 && pq().is_busy(connection) == 0) break;
    if (!wait(left > 0, deadline_))
      return Err(lose(fmt::format("no answer within {} ms", settings_.patience.count())));
    if (pq().consume_input(connection) == 0) return Err(lose(trimmed(pq().error_message(connection))));
  }
  ResultRows result(pq().get_result(connection));
  if (!result) return result;
  const auto status = pq().result_status(result.get());
  const bool good = status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK || status == PGRES_SINGLE_TUPLE ||
                    status == PGRES_EMPTY_QUERY;
  if (!good) {
    const DatabaseError error = error_of(result.get());
    if (connected_) static_cast<void>(finish());
    return Err(error);
  }
  if (status == PGRES_SINGLE_TUPLE) {
    // The next row has the time of this one, while other rows may follow for hours.
    start_waiting();
    return result;
  }
  const std::string_view rows = pq().cmd_tuples(result.get());
  changes_ = to_number<std::int64_t>(rows).value_or(0);
  command_ = pq().cmd_status(result.get());
  return result;
}

Result<void, DatabaseError> PostgresqlDatabase::finish() {
  while (true) {
    const auto result = next_result();
    if (!result) return Err(result.error());
    if (!*result) return {};
  }
}

/// Rows that nobody wants.
void PostgresqlDatabase::skip() {
  constexpr int cheap = 64;
  for (int rows = 0; connected_; ++rows) {
    if (rows == cheap) {
      PGcancel* const cancel = pq().get_cancel(connection_.get());
      std::array<char, 256> error{};
      static_cast<void>(pq().cancel(cancel, error.data(), error.size()));  // else it is read to its end
      pq().free_cancel(cancel);
    }
    const auto result = next_result();
    if (!result || !*result) return;
  }
}

Result<void, DatabaseError> PostgresqlDatabase::start_connecting(milliseconds patience) {
  const MonotonicTime now = monotonic_now();
  if (now < next_try_) return Err(DatabaseError{0, problem_});
  next_try_ = now + settings_.retry;
  given_up_ = now + std::max(patience, settings_.given_up);
  const std::array<const char*, 4> names{"dbname", "client_encoding", "fallback_application_name", nullptr};
  const std::array<const char*, 4> values{settings_.address.c_str(), "UTF8", "srfs-ground", nullptr};
  connection_.reset(pq().connect_start_params(names.data(), values.data(), 1));
  if (!connection_) return Err(lose("no memory for a connection"));
  if (pq().status(connection_.get()) == CONNECTION_BAD)
    return Err(lose(trimmed(pq().error_message(connection_.get()))));
  connects_by_writing_ = true;  // as libpq's PQconnectPoll() is described
  return {};
}

Result<void, DatabaseError> PostgresqlDatabase::connect(milliseconds patience) {
  if (connected_) return {};
  const MonotonicTime began = monotonic_now();
  // A connection that was begun earlier goes on without waiting.
  const MonotonicTime until = connection_ ? began : began + patience;
  if (!connection_) {
    if (const auto started = start_connecting(patience); !started) return started;
  }
  while (true) {
    if (!wait(connects_by_writing_, until)) {
      if (began >= given_up_) return Err(lose("no connection in time"));
      return Err(DatabaseError{0, "connecting"});
    }
    const auto state = pq().connect_poll(connection_.get());
    if (state == PGRES_POLLING_FAILED) return Err(lose(trimmed(pq().error_message(connection_.get()))));
    if (state == PGRES_POLLING_OK) break;
    connects_by_writing_ = state == PGRES_POLLING_WRITING;
  }
  pq().setnonblocking(connection_.get(), 1);
  connected_ = true;
  next_try_ = began;  // when it is lost, the first try is made at once
  ++connection_number_;
  const auto prepared = run(settings_.prepare);
  if (!prepared) return Err(lose(prepared.error().message));
  return {};
}

Result<void, DatabaseError> PostgresqlDatabase::run(const std::string& sql) {
  if (const auto connected = connect(settings_.connecting); !connected) return connected;
  start_waiting();
  if (pq().send_query(connection_.get(), sql.c_str()) == 0)
    return Err(lose(trimmed(pq().error_message(connection_.get()))));
  return finish();
}

Result<std::unique_ptr<Statement>, DatabaseError> PostgresqlDatabase::prepare(std::string_view sql) {
  auto [text, values] = numbered(sql);
  return std::make_unique<PostgresqlStatement>(*this, fmt::format("s{}", ++statements_), std::move(text),
                                               values);
}

Result<void, DatabaseError> PostgresqlDatabase::begin() {
  auto begun = begin_once();
  // The server was restarted since the last transaction: nothing of this one is lost.
  if (!begun && !connected_) begun = begin_once();
  return begun;
}

Result<void, DatabaseError> PostgresqlDatabase::begin_once() {
  if (const auto connected = connect(settings_.connecting); !connected) return connected;
  const auto begun = run("BEGIN;" + settings_.lock);
  if (!begun) {
    roll_back();
    return begun;
  }
  deadline_ = monotonic_now() + settings_.patience;
  aborted_.clear();
  in_transaction_ = true;
  return {};
}

Result<void, DatabaseError> PostgresqlDatabase::commit() {
  auto committed = aborted_.empty() ? run("COMMIT") : Err(DatabaseError{0, aborted_});
  // A transaction with an error ends, but not by being committed.
  if (committed && command_ != "COMMIT") committed = Err(DatabaseError{0, "the transaction was rolled back"});
  if (committed) in_transaction_ = false;
  return committed;
}

void PostgresqlDatabase::roll_back() {
  in_transaction_ = false;
  aborted_.clear();
  if (connected_) static_cast<void>(run("ROLLBACK"));
}

}  // namespace srfs::ground
