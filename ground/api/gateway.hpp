// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <deque>
#include <filesystem>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "base/fd.hpp"
#include "ground/api/stream_hub.hpp"
#include "ground/api/telecommand_request.hpp"
#include "ground/latest_values.hpp"
#include "ground/served_link.hpp"
#include "ground/station.hpp"

namespace srfs::ground::api {

/// What the API knows of the station at this moment.
struct Snapshot {
  bool line_open = false;
  bool locked = false;
  DownlinkCounters counters;
  CopReport cop;
  std::optional<std::uint32_t> clcw;
  std::uint64_t telecommands_sent = 0;
  std::string archive_problem;  ///< as ServerStatus
  std::string keys;             ///< of the last change that was seen; empty: none
  std::vector<cfdp::Report> transfers;
  std::int64_t newest_id = 0;  ///< in the archive
  LatestValues latest;
  std::vector<TelemetryReport> schedule;  ///< the newest report, which may come in several packets
  UtcTime schedule_received;
};

/// The API's one connection to the server: a client of its socket like any command. One thread runs it and
/// sends what others order; nothing that a browser does reaches the line but by its messages.
class Gateway {
 public:
  static constexpr std::size_t orders_max = 64;  ///< that wait; more are refused (429)
  static constexpr std::size_t armings_max = 16;
  static constexpr std::size_t followed_max = 1024;

  /// The error is ready to print.
  [[nodiscard]] static Result<std::unique_ptr<Gateway>, std::string> open(
      const mission::Dictionary& dictionary, const std::filesystem::path& state_dir,
      const ArchivePlace& archive);

  /// Runs until @p stop is readable. An error: the server has gone, and none came back.
  [[nodiscard]] Result<void, std::string> run(int stop);

  // From any thread.
  using Work = std::function<HttpResponse()>;
  /// Has @p work done by the thread that runs, and waits for it. 429, 503: it was not, and will not be.
  [[nodiscard]] HttpResponse order(Work work);
  [[nodiscard]] Snapshot snapshot();
  [[nodiscard]] StreamHub& stream() { return stream_; }
  /// Whether the server's archive knows each telecommand that was sent.
  [[nodiscard]] bool records_telecommands() const { return records_telecommands_; }
  [[nodiscard]] bool has_archive() const { return has_archive_; }

  // For Work alone.
  [[nodiscard]] HttpResponse send(const TelecommandRequest& order);
  [[nodiscard]] Station& station() { return *station_; }
  [[nodiscard]] ServedLink& link() { return *link_; }
  /// Telecommands in the hands of the AD service.
  [[nodiscard]] std::size_t in_ad() const { return station_->in_ad(); }
  /// The answer to an order without a result: the line is closed, not now, or not known.
  [[nodiscard]] HttpResponse failure(const OrderError& error);

 private:
  /// An order while it waits; who waits for it takes it back after its patience.
  struct Order {
    enum class State : std::uint8_t { waiting, begun, taken_back };
    std::atomic<State> state{State::waiting};
    Work work;
    std::promise<HttpResponse> answer;
  };

  Gateway(const mission::Dictionary& dictionary, Fd wake) : dictionary_(dictionary), wake_(std::move(wake)) {}
  [[nodiscard]] StationOutput output();
  void wait(int stop);
  void carry_out_orders();
  void send_armed();
  void read_link();
  void on_outcome(const Result<void, std::string>& outcome);
  void on_telemetry(const TelemetryReport& report);
  void on_stage(const StageReport& report);
  void set_line(bool open, const std::string& why);
  void tell_state(MonotonicTime now);
  [[nodiscard]] HttpResponse dispatch(const TelecommandRequest& order, const std::string& token);
  void publish(const nlohmann::json& json, std::int64_t id = 0);

  const mission::Dictionary& dictionary_;
  Fd wake_;
  std::unique_ptr<Station> station_;
  ServedLink* link_ = nullptr;  ///< the station's
  StreamHub stream_;
  std::mutex orders_mutex_;
  std::deque<std::shared_ptr<Order>> orders_;
  std::mutex snapshot_mutex_;
  Snapshot snapshot_;
  struct Arming {
    TelecommandRequest order;
    std::string token;
    std::optional<bool> succeeded;
  };
  std::map<std::uint64_t, Arming> armings_;        ///< by the tag of the arming telecommand
  std::map<std::uint64_t, std::string> followed_;  ///< token of a telecommand of the API, by its tag
  std::uint64_t next_tag_ = 1;
  std::string token_prefix_;
  MonotonicTime next_state_;
  std::string told_stats_;
  std::string told_transfers_;
  bool line_open_ = false;
  std::atomic<bool> records_telecommands_{false};
  std::atomic<bool> has_archive_{false};
};

/// The answer to an order without a result. @param refused  status when nothing was done
[[nodiscard]] HttpResponse failure_response(const OrderError& error, int refused);

/// {"type": "tc_stage", ...} of the stream: that of a session without its line, with token or who.
[[nodiscard]] nlohmann::json stage_json(const StageReport& report, const std::string& token);

}  // namespace srfs::ground::api
