#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "msgs/mission/dictionary.hpp"
#include "ros/deployment.hpp"
#include "wire/pus.hpp"
#include "wire/sdls.hpp"
#include "wire/tc_uplink.hpp"

namespace srfs::ground {

/// What the ground must not forget: the next security counter and the sequence counts. A file, replaced
/// atomically.
class UplinkState {
 public:
  /// A missing file begins with the milliseconds of @p now as counter: higher than any counter that was used
  /// before the file was lost, and the spacecraft accepts any higher one. A damaged file is an error:
  /// guessing would hide it.
  static Result<UplinkState, std::string> open(const std::filesystem::path& file, UtcTime now);

  struct Reserved {
    std::uint64_t counter = 0;
    std::uint16_t sequence_count = 0;
  };
  /// The counters of the next telecommand. They are on disk when this returns, so none is used twice. Blocks
  /// on the disk.
  [[nodiscard]] Result<Reserved, std::string> reserve(std::uint16_t apid);
  /// The same for a packet without a frame yet, and for one more frame of a packet.
  [[nodiscard]] Result<std::uint16_t, std::string> reserve_sequence_count(std::uint16_t apid);
  [[nodiscard]] Result<std::uint64_t, std::string> reserve_counter();
  /// The same for one of many: only each counters_ahead-th call writes. What a crash leaves unused is
  /// skipped.
  [[nodiscard]] Result<std::uint64_t, std::string> reserve_counter_ahead();
  static constexpr std::uint64_t counters_ahead = 256;
  /// The spacecraft has accepted @p counter: the next one is higher. Written when it grows; blocks on the
  /// disk. On an error it still holds for this run.
  Result<void, std::string> raise(std::uint64_t counter);
  [[nodiscard]] std::uint64_t next_counter() const { return next_counter_; }

 private:
  using SequenceCounts = std::map<std::uint16_t, std::uint16_t>;
  [[nodiscard]] Result<void, std::string> save(std::uint64_t next_counter,
                                               const SequenceCounts& next_sequence);
  UplinkState(std::filesystem::path file, std::uint64_t next)
      : file_(std::move(file)), next_counter_(next), saved_counter_(next) {}
  std::filesystem::path file_;
  std::uint64_t next_counter_;
  std::uint64_t saved_counter_;  ///< the file's: none below it is used again after a crash
  SequenceCounts next_sequence_;
};

struct OutgoingTelecommand {
  wire::RequestId request;
  std::optional<std::uint64_t> security_counter;
  Octets cltu;
};

/// A telecommand before it is framed.
struct TelecommandPacket {
  wire::RequestId request;
  Octets packet;
};

/// Telecommands to octets for the line: PUS packet, SDLS, BD or AD frame, CLTU. All errors are ready to
/// print.
class Uplink {
 public:
  /// Takes the first secured TC channel of the link, or the first if none is. Of two associations the first
  /// secures BD frames and the second AD frames, as on board.
  /// @param var_dir where relative key files stand
  /// @param state_dir where the counters are kept
  /// @return the error is ready to print
  static Result<Uplink, std::string> open(const ros::LinkSettings& link, const std::filesystem::path& var_dir,
                                          const std::filesystem::path& state_dir, UtcTime now);

  /// Blocks on the disk. All verification reports are asked for.
  [[nodiscard]] Result<OutgoingTelecommand, std::string> make(const mission::EncodedCommand& command);
  /// A packet for the AD service. Blocks on the disk.
  [[nodiscard]] Result<TelecommandPacket, std::string> make_packet(const mission::EncodedCommand& command);
  /// One transmission of a packet as AD frame; every one is secured with a counter of its own. Blocks on the
  /// disk.
  [[nodiscard]] Result<Octets, std::string> make_ad_cltu(std::uint8_t sequence, OctetView packet);
  /// A packet of files as BD frame: what gets lost CFDP repeats. Blocks on the disk now and then.
  [[nodiscard]] Result<Octets, std::string> make_file_cltu(OctetView packet);
  [[nodiscard]] std::size_t packet_octets_max() const;
  [[nodiscard]] Octets make_bc_cltu(wire::ControlCommand command) const;
  [[nodiscard]] std::uint8_t vc() const { return channel_.vc; }
  /// What the beacon says about an association; another SPI than ours is ignored. One counter serves all
  /// associations.
  void on_spacecraft_counter(std::uint16_t spi, std::uint64_t counter);
  [[nodiscard]] std::uint64_t sent() const { return sent_; }

 private:
  Uplink(wire::TcUplinkChannel channel, UplinkState state) : channel_(channel), state_(std::move(state)) {}
  wire::TcUplinkChannel channel_;
  UplinkState state_;
  struct Association {
    wire::SdlsKey key;
    std::uint16_t spi;
  };
  [[nodiscard]] wire::TcPacket packet_of(const mission::EncodedCommand& command,
                                         std::uint16_t sequence_count) const;
  [[nodiscard]] const Association& ad_association() const { return ad_ ? *ad_ : *bd_; }
  std::optional<Association> bd_;  ///< nullopt: a channel without security
  std::optional<Association> ad_;  ///< nullopt: bd_ serves both
  std::uint64_t sent_ = 0;
};

}  // namespace srfs::ground
