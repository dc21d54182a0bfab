// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "base/fd.hpp"
#include "ground/link.hpp"
#include "ground/station_link.hpp"
#include "ground/telemetry.hpp"
#include "ground/uplink.hpp"

namespace srfs::ground {

/// The line itself: port, security counters, COP-1 and file transfers of one process.
class DirectLink final : public StationLink {
 public:
  static constexpr milliseconds write_patience{5000};

  /// @param trust  open_frame_trust()
  DirectLink(const mission::Dictionary& dictionary, const suite::LinkSettings& link, Port port, Uplink uplink,
             wire::FopSettings fop = {}, FrameTrust trust = {});

  /// The lock of its folder (lock_state()), until its end.
  void hold_state(Fd lock) { state_lock_ = std::move(lock); }
  /// From now on files are carried in both directions; they go up at the line's rate, telecommands between
  /// them. Blocks on the disk, as all that follows.
  void carry_files(std::unique_ptr<cfdp::TransferFolders> transfer_folders);
  /// The octets of the line as they come, before anything is decoded.
  void set_octets_output(std::function<void(OctetView)> octets) { octets_ = std::move(octets); }
  /// Each telecommand, before it is written or handed to the AD service; of make_packet() with scheduled.
  /// @return false: it was not recorded and is not sent without
  using Made = std::function<bool(const TelecommandOrder&, const wire::RequestId&, bool scheduled)>;
  void set_made_output(Made made) { made_ = std::move(made); }
  /// Each of them that was refused then or behind that: nothing of it went up. Also when it was not recorded:
  /// a database whose answer was late may have recorded it.
  using Unsent = std::function<void(const TelecommandOrder&)>;
  void set_unsent_output(Unsent unsent) { unsent_ = std::move(unsent); }
  /// Octets for the line as they are.
  [[nodiscard]] Result<void, std::string> write(OctetView octets);
  /// From now on nothing waits for the line: see Port::queue(). What waits is written in on_time(), when the
  /// line takes it.
  void queue_for_line() { queues_ = true; }
  [[nodiscard]] bool has_waiting() const { return port_.has_waiting(); }
  /// The line was closed and is there again.
  void replace_port(Port port);
  [[nodiscard]] suite::AssociationSet key_set() const { return uplink_.key_set(); }

  [[nodiscard]] Result<wire::RequestId, OrderError> send(const TelecommandOrder& order) override;
  [[nodiscard]] Result<TelecommandPacket, OrderError> make_packet(const TelecommandOrder& order) override;
  void settle() override { handle_ad(); }
  [[nodiscard]] Result<void, OrderError> start_ad() override;
  [[nodiscard]] Result<void, OrderError> stop_ad() override;
  [[nodiscard]] Result<void, OrderError> unlock() override;
  [[nodiscard]] Result<void, OrderError> set_vr(std::uint8_t vr) override;
  [[nodiscard]] CopReport cop() const override { return ad_.report(); }
  [[nodiscard]] Result<void, OrderError> select_keys(suite::AssociationSet set,
                                                     const std::string& why) override;
  [[nodiscard]] std::uint8_t vc() const override { return uplink_.vc(); }
  [[nodiscard]] bool carries_files() const override { return files_ != nullptr; }
  [[nodiscard]] Result<cfdp::TransactionId, OrderError> put(const std::filesystem::path& file,
                                                            const std::string& name, bool resume) override;
  [[nodiscard]] std::vector<cfdp::Report> transfers() const override;
  [[nodiscard]] Result<bool, OrderError> order_transfer(cfdp::TransactionId id, TransferOrder order) override;
  [[nodiscard]] int fd() const override { return port_.fd(); }
  [[nodiscard]] Result<void, std::string> on_readable() override;
  [[nodiscard]] Result<void, std::string> on_time() override;
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const override;
  [[nodiscard]] DownlinkCounters counters() const override { return downlink_.counters(); }
  [[nodiscard]] bool locked() const override { return downlink_.locked(); }
  [[nodiscard]] std::optional<std::uint32_t> clcw() const override { return downlink_.clcw(); }
  [[nodiscard]] std::uint64_t telecommands_sent() const override { return uplink_.sent(); }

 private:
  [[nodiscard]] Result<void, std::string> write_line(OctetView octets);
  /// For the next frame, whose counter carries the present time.
  [[nodiscard]] Uplink& uplink_now();
  void handle_ad();
  void transmit_ad(const AdSignal& signal);
  void on_packet(const ReceivedPacket& received);
  /// Of the frames that came: their floor is kept, and the operator told of those that were refused.
  void note_frames(MonotonicTime now);
  /// The spacecraft reports its associations in the beacon.
  void follow_counters(const TelemetryReport& beacon);
  void move_files(MonotonicTime now);
  [[nodiscard]] bool send_pdu(OctetView pdu);

  Fd state_lock_;  // released when all else has ended
  const mission::Dictionary& dictionary_;
  Port port_;
  bool queues_ = false;
  Downlink downlink_;
  std::optional<FrameFloorFile> floor_file_;
  std::uint64_t stored_floor_ = 0;
  bool floor_fails_ = false;
  RefusedFrameNews refused_frames_;
  Uplink uplink_;
  AdService ad_;
  std::unique_ptr<cfdp::TransferFolders> files_;
  double octet_time_ns_;
  MonotonicTime line_free_at_;  ///< of file data; a pty would take it at any rate
  std::uint16_t file_sequence_count_ = 0;
  std::function<void(OctetView)> octets_;
  Made made_;
  Unsent unsent_ = [](const TelecommandOrder&) {};
};

}  // namespace srfs::ground
