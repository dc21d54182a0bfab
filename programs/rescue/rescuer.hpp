// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "base/result.hpp"
#include "base/state_file.hpp"
#include "base/time.hpp"
#include "cfdp/transfer_folders.hpp"
#include "hw/serial_port.hpp"
#include "hw/watchdog.hpp"
#include "nodes/ttc/files/file_exchange.hpp"
#include "nodes/ttc/files/file_manager.hpp"
#include "nodes/ttc/link/downlink_scheduler.hpp"
#include "nodes/ttc/link/frame_count_file.hpp"
#include "nodes/ttc/link/key_selection.hpp"
#include "nodes/ttc/link/packet_maker.hpp"
#include "nodes/ttc/link/session_key_store.hpp"
#include "nodes/ttc/link/transmitter_switch.hpp"
#include "nodes/ttc/link/uplink_chain.hpp"
#include "programs/rescue/link_store.hpp"
#include "programs/rescue/recovery_files.hpp"
#include "programs/rescue/rescue_order.hpp"

namespace srfs::rescue {

/// How serving ends.
struct RescueEnd {
  enum class Kind : std::uint8_t { start_suite, reboot, no_contact };
  Kind kind = Kind::no_contact;
  suite::BootStep step = suite::BootStep::golden;  ///< start_suite
};

/// Stands on the line in the place of ttc: answers, repairs files, and ends when the suite is to be started.
/// One thread; the disk may delay it, and a disk that hangs starves the watchdog, which resets the computer.
class Rescuer {
 public:
  /// @return why the line cannot be opened: the settings name no device
  [[nodiscard]] static Result<std::unique_ptr<Rescuer>, std::string> create(
      const suite::RescueSettings& settings, suite::StepRecord step);
  [[nodiscard]] RescueEnd serve();
  /// As orders left it.
  [[nodiscard]] const suite::StepRecord& step() const { return step_; }

 private:
  struct Devices {
    std::unique_ptr<hw::SerialPort> line;
    std::unique_ptr<hw::Watchdog> watchdog;
  };
  Rescuer(const suite::RescueSettings& settings, suite::StepRecord step, Devices devices, MonotonicTime now);

  void read_line(MonotonicTime now);
  void take(std::vector<UplinkedPacket> packets, MonotonicTime now);
  void take_order(const UplinkedPacket& uplinked, MonotonicTime now);
  void store_link(const LinkState& link);
  void store_confirmed_keys();
  void pump(MonotonicTime now);
  /// Counters and numbers of the frames to come.
  void reserve_frames();
  void wait(MonotonicTime now);
  /// Before the end: everything acknowledged is on the disk.
  [[nodiscard]] RescueEnd finish(RescueEnd end);
  void turn_transmitter(MonotonicTime now);
  [[nodiscard]] bool store_transmitter() const;
  void feed(MonotonicTime now);
  void turn_files(MonotonicTime now);
  void go_on_with_file_order(MonotonicTime now);

  void send(const Report& report, MonotonicTime now);
  void send_step(MonotonicTime now);
  /// What `srfs-ground status` asks for: why there is no suite, and what comes next.
  void send_health(MonotonicTime now);
  template <class Structure>
  void send_structure(const Structure& h, MonotonicTime now);
  void done(const TelecommandOrigin& origin, MonotonicTime now);
  void failed(const TelecommandOrigin& origin, const FilesFailure& failure, MonotonicTime now);
  /// Number of a new folder for what is set aside; on disk before something is put there.
  [[nodiscard]] std::uint32_t next_set_aside();

  void execute(const TelecommandOrigin& origin, const Ping& order, MonotonicTime now);
  void execute(const TelecommandOrigin& origin, const OneShot& order, MonotonicTime now);
  void execute(const TelecommandOrigin& origin, const mission::TtcSelectKeys& order, MonotonicTime now);
  void execute(const TelecommandOrigin& origin, const mission::TtcTransmitterOn& order, MonotonicTime now);
  void execute(const TelecommandOrigin& origin, const mission::RescueReport& order, MonotonicTime now);
  void execute(const TelecommandOrigin& origin, const mission::RescueStartSuite& order, MonotonicTime now);
  void execute(const TelecommandOrigin& origin, const mission::RescueReboot& order, MonotonicTime now);
  void execute(const TelecommandOrigin& origin, const mission::RescueReset& order, MonotonicTime now);
  void execute(const TelecommandOrigin& origin, const mission::RescueMend& order, MonotonicTime now);
  void execute(const TelecommandOrigin& origin, const mission::RescueRestore& order, MonotonicTime now);
  void execute(const TelecommandOrigin& origin, const mission::RescueFetch& order, MonotonicTime now);
  void execute(const TelecommandOrigin& origin, const mission::RescueList& order, MonotonicTime now);
  void execute(const TelecommandOrigin& origin, const FileOrder& order, MonotonicTime now);

  const suite::RescueSettings& settings_;
  suite::StepRecord step_;
  Devices devices_;
  RecoveryFiles files_;
  LinkStore link_store_;
  wire::SessionKeys session_keys_;
  UplinkChain uplink_;
  TransmitterSwitch transmitter_;
  FrameCountFile frame_count_file_;
  FrameCountReserve frame_count_reserve_;
  StateFile<std::uint64_t> frame_number_file_;
  DownlinkScheduler downlink_;
  PacketMaker packets_;
  SpacecraftClock clock_;
  FileExchange exchange_;
  std::unique_ptr<cfdp::TransferFolders> folders_;
  FileManager file_manager_;
  struct FileRequest {
    TelecommandOrigin origin;
    FileOrder order;
  };
  std::optional<FileRequest> file_request_;  ///< goes on with each turn
  std::uint64_t next_file_order_ = 1;
  Octets outgoing_;  ///< of a frame, what the line has not taken yet
  std::optional<RescueEnd> end_;
  MonotonicTime end_by_;
  const MonotonicTime begun_;
  MonotonicTime contact_;
  MonotonicTime beacon_at_;
  MonotonicTime feed_at_;
  bool storage_writable_ = true;
  std::uint32_t telecommands_ = 0;
  std::uint32_t telecommands_failed_ = 0;
};

}  // namespace srfs::rescue
