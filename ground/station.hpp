#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/fd.hpp"
#include "ground/commanding.hpp"
#include "ground/downlink.hpp"
#include "ground/link.hpp"
#include "ground/telemetry.hpp"
#include "ground/uplink.hpp"

namespace srfs::ground {

/// Where everything that happens is told. Functions that are not set are not called.
struct StationOutput {
  std::function<void(const TelemetryReport&)> telemetry;
  std::function<void(const StageReport&)> stage;
  std::function<void(const Retrieval&)> retrieval_over;
};

/// The operator's end of the link: sends telecommands, decodes telemetry, follows verification. One thread.
class Station {
 public:
  static constexpr milliseconds write_patience{5000};
  /// Waited beyond a telecommand's own timeout: its last report must still come down.
  static constexpr milliseconds report_margin{2000};
  static constexpr std::size_t max_retrievals = 16;

  Station(const mission::Dictionary& dictionary, const ros::LinkSettings& link, Port port, Uplink uplink,
          StationOutput output);

  /// Checks, secures and writes one telecommand; its stages come through the output. Blocks until the octets
  /// are written.
  /// @param patience until the final report, of a retrieval anew with every packet; nullopt: as the
  /// dictionary says, and report_margin
  /// @param tag the caller's own, comes back in every report
  [[nodiscard]] Result<wire::RequestId, std::string> send(const std::string& command,
                                                          const std::vector<std::string>& arguments,
                                                          std::optional<milliseconds> patience,
                                                          std::uint64_t tag);
  /// Reads what is there and tells what it means. An error: the link is gone.
  [[nodiscard]] Result<void, std::string> on_readable();
  /// Ends what is overdue.
  void on_time();
  /// When on_time has something to do, at the latest.
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const;

  [[nodiscard]] int fd() const { return port_.fd(); }
  [[nodiscard]] DownlinkCounters counters() const { return downlink_.counters(); }
  [[nodiscard]] bool locked() const { return downlink_.locked(); }
  [[nodiscard]] std::optional<std::uint32_t> clcw() const { return downlink_.clcw(); }
  [[nodiscard]] std::uint64_t telecommands_sent() const { return uplink_.sent(); }
  /// No telecommand and no retrieval is under way.
  [[nodiscard]] bool idle() const { return commanding_.outstanding() == 0 && retrievals_.empty(); }

 private:
  void on_packet(const ReceivedPacket& received, MonotonicTime now);
  void on_stage(const StageReport& report, MonotonicTime now);
  void end_retrievals(MonotonicTime now);

  const mission::Dictionary& dictionary_;
  Port port_;
  Downlink downlink_;
  Uplink uplink_;
  Commanding commanding_;
  std::vector<Retrieval> retrievals_;
  StationOutput output_;
};

}  // namespace srfs::ground
