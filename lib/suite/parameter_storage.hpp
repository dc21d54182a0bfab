// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/result.hpp"
#include "base/time.hpp"
#include "ros/parameters.hpp"
#include "suite/parameter_store.hpp"

namespace srfs::suite {

/// What became of the values of a node, for its events.
struct ParameterNews {
  enum class Kind : std::uint8_t {
    kept,       ///< `values` hold at the next starts
    on_trial,   ///< `values` go back unless they are confirmed
    confirmed,  ///< `values` are no longer on trial
    reverted,   ///< `values` are what it is back to
  };
  Kind kind;
  std::vector<ros::StoredParameter> values;
  std::uint32_t generation = 0;  ///< kept
  milliseconds time{0};          ///< on trial: until they go back
  std::string reason{};          ///< reverted
};

/// Keeps the values of one node over its restarts, and puts guarded ones on trial. Pure: what is to be on
/// disk goes out by to_write(), time comes in.
///
/// The file holds the last ten sets of values that were kept (generations); the newest holds. A guarded
/// parameter is on trial from when its value leaves the one that was confirmed last (at first: that of the
/// start) until confirm() or until the time is over; then all that is on trial goes back together. A value on
/// trial is in no generation, so a process that dies, whenever that is, starts without it.
class ParameterStorage {
 public:
  enum class Operation : std::uint8_t { keep, forget, confirm, restore, reset, report };
  /// As srfs_msgs/srv/SaveParameters.
  struct Request {
    Operation operation = Operation::keep;
    std::vector<std::string> names{};
    std::vector<std::pair<std::string, ros::ParameterValue>> values{};
    std::uint32_t generation = 0;
    std::string origin{};
  };

  /// @param parameters  outlive this; began with the history's values (ParameterSet::set_stored)
  /// @param history     what the disk has
  ParameterStorage(ros::ParameterSet& parameters, std::string node, ParameterHistory history)
      : set_(parameters), node_(std::move(node)), history_(std::move(history)) {}

  /// After the last declaration. What was set aside becomes a generation without it, a trial that an earlier
  /// process left is over: to_write() has something then.
  void begin(const std::string& saved);

  /// @param saved  now, UTC, for people
  /// @return why nothing was done; else it is done, but for what to_write() says: that is the caller's to end
  ///         with on_written(), and a failure there is the request's
  [[nodiscard]] Result<void, std::string> submit(const Request& request, MonotonicTime now,
                                                 milliseconds trial_time, const std::string& saved);
  /// After a change at run time.
  void on_changed(const std::vector<std::string>& names, MonotonicTime now, milliseconds trial_time);
  /// Ends a trial whose time is over; not while something is being written.
  void poll(MonotonicTime now);

  /// The file's content that is to be written; one at a time, until on_written().
  [[nodiscard]] const std::optional<std::string>& to_write() const { return text_; }
  void on_written(bool ok);

  [[nodiscard]] const ParameterHistory& history() const { return history_; }  ///< as on disk
  /// Present values of the parameters on trial.
  [[nodiscard]] std::vector<ros::StoredParameter> on_trial() const;
  /// When they go back; nullopt: nothing is on trial.
  [[nodiscard]] std::optional<MonotonicTime> deadline() const { return deadline_; }
  [[nodiscard]] std::vector<ParameterNews> take_news() { return std::exchange(news_, {}); }

 private:
  using Values = std::vector<ros::StoredParameter>;
  using Changes = std::vector<std::pair<std::string, ros::ParameterValue>>;

  Result<void, std::string> keep(const Request& request, MonotonicTime now, milliseconds trial_time,
                                 const std::string& saved);
  Result<void, std::string> forget(const Request& request, const std::string& saved);
  Result<void, std::string> confirm(const Request& request, const std::string& saved);
  Result<void, std::string> restore(const Request& request, MonotonicTime now, milliseconds trial_time,
                                    const std::string& saved);
  Result<void, std::string> reset(const Request& request, const std::string& saved);
  /// Has the history, with these values as its newest, written if it is another than that on disk.
  Result<void, std::string> store(Values values, const std::string& origin, const std::string& saved);
  void put_on_trial(MonotonicTime now, milliseconds trial_time);
  void revert(const std::string& reason);
  void settle(const std::map<std::string, ros::ParameterValue>& confirmed);
  [[nodiscard]] bool is_on_trial(const std::string& name) const;

  ros::ParameterSet& set_;
  std::string node_;
  ParameterHistory history_;
  std::map<std::string, ros::ParameterValue> settled_;  ///< guarded ones: what they go back to
  std::set<std::string> to_keep_;                       ///< those on trial that are kept once confirmed
  std::optional<MonotonicTime> deadline_;
  bool confirmed_ = false;    ///< so the last trial ended
  bool disk_failed_ = false;  ///< the last write: nothing is written by itself
  // A write in progress.
  std::optional<std::string> text_;
  ParameterHistory next_;
  std::map<std::string, ros::ParameterValue> confirms_;  ///< what it confirms
  std::vector<ParameterNews> news_;
};

}  // namespace srfs::suite
