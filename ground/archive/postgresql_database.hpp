// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.hpp"
#include "ground/archive/database.hpp"

struct pg_conn;
struct pg_result;

namespace srfs::ground {

/// Whether an archive's address is one of PostgreSQL: postgresql://... or postgres://...
[[nodiscard]] bool is_postgresql(std::string_view address);
/// Why libpq does not take it, or why it should not be given; nullopt: nothing. Ready to print, and without
/// a password that may be in it.
[[nodiscard]] std::optional<std::string> wrong_postgresql(const std::string& address);

/// A connection to a PostgreSQL, that is made when it is needed, and again after it was lost. No call takes
/// longer than the patience, whatever server and network do; but names of hosts are looked up by the
/// system's resolver.
class PostgresqlDatabase final : public Database {
 public:
  struct Settings {
    std::string address;
    /// Of an answer; of a whole transaction. Of a connection, at its first try.
    milliseconds patience{1000};
    milliseconds connecting{200};  ///< waited at once, when a connection is begun; it goes on meanwhile
    milliseconds given_up{5000};   ///< a try to connect
    milliseconds retry{1000};      ///< between two tries
    /// Done with each new connection, as one text.
    std::string prepare;
    std::string lock;  ///< takes the archive for one writer, until the transaction's end
  };
  explicit PostgresqlDatabase(Settings settings) : settings_(std::move(settings)) {}

  /// @param connecting  waited at once, when a connection is begun
  void set_patience(milliseconds patience, milliseconds connecting) {
    settings_.patience = patience;
    settings_.connecting = connecting;
  }
  /// Waits until it is connected. @return an error when it is not, within this time
  [[nodiscard]] Result<void, DatabaseError> connect(milliseconds patience);

  Result<void, DatabaseError> run(const std::string& sql) override;
  Result<std::unique_ptr<Statement>, DatabaseError> prepare(std::string_view sql) override;
  std::int64_t changes() const override { return changes_; }
  Result<void, DatabaseError> begin() override;
  Result<void, DatabaseError> commit() override;
  void roll_back() override;
  int connection() const override { return connection_number_; }
  bool is_shared() const override { return true; }
  Result<std::vector<std::string>, DatabaseError> damage() override { return std::vector<std::string>(); }

 private:
  friend class PostgresqlStatement;
  struct Finish {
    void operator()(pg_conn* connection) const;
  };
  struct Clear {
    void operator()(pg_result* result) const;
  };
  using ResultRows = std::unique_ptr<pg_result, Clear>;

  [[nodiscard]] Result<void, DatabaseError> begin_once();
  /// The connection is used no more.
  DatabaseError lose(const std::string& why);
  [[nodiscard]] DatabaseError error_of(const pg_result* result);
  /// What was sent is on its way, then the next result; nullptr: there are no more.
  [[nodiscard]] Result<ResultRows, DatabaseError> next_result();
  /// All results of what was sent.
  [[nodiscard]] Result<void, DatabaseError> finish();
  /// Waits until the socket is readable, or writable. @return false: the time is over
  [[nodiscard]] bool wait(bool writes, MonotonicTime until) const;
  void start_waiting();
  void skip();
  [[nodiscard]] Result<void, DatabaseError> start_connecting(milliseconds patience);

  Settings settings_;
  std::unique_ptr<pg_conn, Finish> connection_;
  bool connected_ = false;
  int connection_number_ = 0;
  bool connects_by_writing_ = false;
  MonotonicTime next_try_;
  MonotonicTime given_up_;
  std::string problem_ = "not connected";
  bool in_transaction_ = false;
  std::string aborted_;  ///< why this transaction cannot be committed
  MonotonicTime deadline_;
  std::int64_t changes_ = 0;
  std::string command_;  ///< that the server did last, as it names it
  int statements_ = 0;   ///< prepared ones, for their names
};

}  // namespace srfs::ground
