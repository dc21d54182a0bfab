// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "msgs/mission/dictionary.hpp"
#include "suite/deployment.hpp"
#include "wire/pus.hpp"
#include "wire/sdls.hpp"
#include "wire/session_keys.hpp"
#include "wire/tc_uplink.hpp"

namespace srfs::ground {

[[nodiscard]] std::string_view to_text(suite::AssociationSet set);
/// "a", "b" or "contingency".
[[nodiscard]] std::optional<suite::AssociationSet> key_set_of(std::string_view text);

/// A key of the link: hexadecimal digits, a newline behind them allowed, in a file that its owner alone may
/// read. The error is ready to print.
[[nodiscard]] Result<wire::SdlsKey, std::string> read_link_key(const std::filesystem::path& file);

/// What the ground must not forget: the next security counter of each association, the sequence counts, the
/// keys in use. A file, replaced atomically.
class UplinkState {
 public:
  /// Every counter begins with the milliseconds of @p now, or where the file says when that is higher: higher
  /// than any that was used before the file was lost, or replaced by an older copy, and the spacecraft
  /// accepts any higher one. A damaged file is an error: guessing would hide it.
  /// @param one_order  a counter is higher than every one before it, whatever its association
  static Result<UplinkState, std::string> open(const std::filesystem::path& file, UtcTime now,
                                               bool one_order = false);

  /// No counter from now on is below the milliseconds of @p now.
  void on_time(UtcTime now);

  /// The next counter of an association. It is on disk when this returns, so none is used twice. Blocks on
  /// the disk.
  [[nodiscard]] Result<std::uint64_t, std::string> reserve_counter(std::uint16_t spi);
  /// The same for one of many: only each counters_ahead-th call writes. What a crash leaves unused is
  /// skipped.
  [[nodiscard]] Result<std::uint64_t, std::string> reserve_counter_ahead(std::uint16_t spi);
  static constexpr std::uint64_t counters_ahead = 4096;  ///< 4 s at least
  [[nodiscard]] Result<std::uint16_t, std::string> reserve_sequence_count(std::uint16_t apid);
  struct Reserved {
    std::uint16_t sequence_count = 0;
    std::uint64_t counter = 0;
  };
  /// Both, with one write.
  [[nodiscard]] Result<Reserved, std::string> reserve(std::uint16_t apid, std::uint16_t spi);
  /// The spacecraft has accepted @p counter: the next one is higher. Written when it grows; blocks on the
  /// disk. On an error it still holds for this run.
  Result<void, std::string> raise(std::uint16_t spi, std::uint64_t counter);
  /// @p counter was used by another state than this one: the file is an older copy, or there is another
  /// ground. Before raise().
  [[nodiscard]] bool is_foreign(std::uint16_t spi, std::uint64_t counter) const;
  /// A counter further ahead of clock and file than this is not the spacecraft's: a beacon is not authentic,
  /// and one that is forged must not use the counters up.
  static constexpr milliseconds believable_ahead{std::chrono::hours(24 * 30)};
  [[nodiscard]] bool is_believable(std::uint16_t spi, std::uint64_t counter) const;
  /// By how much the file's counters are ahead of the clock; nullopt: not by more than a minute.
  [[nodiscard]] std::optional<seconds> ahead_of_clock() const { return ahead_of_clock_; }
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }
  [[nodiscard]] std::uint64_t next_counter(std::uint16_t spi) const;

  [[nodiscard]] suite::AssociationSet key_set() const { return key_set_; }
  /// Blocks on the disk. On an error it still holds for this run.
  Result<void, std::string> set_key_set(suite::AssociationSet set);

 private:
  using SequenceCounts = std::map<std::uint16_t, std::uint16_t>;
  struct Counter {
    std::uint64_t next = 0;
    std::uint64_t saved = 0;  ///< the file's: none below it is used again after a crash
    std::uint64_t known = 0;  ///< the file's when it was opened: all used before are below it
    std::uint64_t first = 0;  ///< of this run
  };
  explicit UplinkState(std::filesystem::path file) : file_(std::move(file)) {}
  [[nodiscard]] Result<void, std::string> save();
  [[nodiscard]] Counter& counter(std::uint16_t spi);

  std::filesystem::path file_;
  std::uint64_t clock_floor_ = 0;  ///< milliseconds of the newest time
  bool one_order_ = false;
  std::uint64_t first_counter_ = 0;  ///< of an association that is not in the file
  std::optional<seconds> ahead_of_clock_;
  std::map<std::uint16_t, Counter> counters_;
  SequenceCounts next_sequence_;
  suite::AssociationSet key_set_ = suite::AssociationSet::a;
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
/// print. On a strict link (link.tc.sdls) the counters of all associations are one order, and the high 32
/// bits of the IV are the station's number (8 bits) and a number drawn at random by open() (24 bits): two
/// stations never share an IV, and two runs of one, with a copied or restored state, practically never.
class Uplink {
 public:
  /// Takes the first secured TC channel of the link, or the first if none is. Of two associations of a set
  /// the first secures BD frames and the second AD frames, as on board. Keys of sets that are not in use may
  /// be missing.
  /// @param var_dir where relative key files stand
  /// @param state_dir where the counters are kept
  /// @param forced the set of this run; nullopt: as remembered
  /// @return the error is ready to print
  static Result<Uplink, std::string> open(const suite::LinkSettings& link,
                                          const std::filesystem::path& var_dir,
                                          const std::filesystem::path& state_dir, UtcTime now,
                                          std::optional<suite::AssociationSet> forced = std::nullopt,
                                          std::uint8_t station = 0);

  /// To be called before what is made goes to the line: counters carry this time, or are above it.
  /// Keys that were replaced meanwhile (STATE/session_keys) are used from now on.
  void on_time(UtcTime now) {
    state_.on_time(now);
    follow_session_keys();
  }

  /// Blocks on the disk. All verification reports are asked for.
  /// @param set  of the keys; nullopt: those in use
  [[nodiscard]] Result<OutgoingTelecommand, std::string> make(
      const mission::EncodedCommand& command, std::optional<suite::AssociationSet> set = std::nullopt);
  /// A packet for the AD service. Blocks on the disk.
  [[nodiscard]] Result<TelecommandPacket, std::string> make_packet(const mission::EncodedCommand& command);
  /// One transmission of a packet as AD frame; every one is secured with a counter of its own. Blocks on the
  /// disk.
  [[nodiscard]] Result<Octets, std::string> make_ad_cltu(std::uint8_t sequence, OctetView packet);
  /// A packet of files as BD frame: what gets lost CFDP repeats. Blocks on the disk now and then.
  [[nodiscard]] Result<Octets, std::string> make_file_cltu(OctetView packet);
  [[nodiscard]] std::size_t packet_octets_max() const;
  /// A control command; secured on a strict link. Blocks on the disk then.
  [[nodiscard]] Result<Octets, std::string> make_bc_cltu(wire::ControlCommand command);
  [[nodiscard]] std::uint8_t vc() const { return channel_.vc; }
  /// What the spacecraft says about an association; an SPI whose key is not here is ignored.
  /// @return what the operator should know, once for each association: another sender used its counters, or
  /// it cannot be true
  std::optional<std::string> on_spacecraft_counter(std::uint16_t spi, std::uint64_t counter);
  /// What the operator should know of the counters at the start; empty: all is well.
  [[nodiscard]] std::string warning() const;
  /// The keys in use; those of a run with forced keys stay, what is selected counts from the next run on.
  [[nodiscard]] suite::AssociationSet key_set() const { return set_; }
  /// Blocks on the disk. @return whether the keys in use changed; the error is ready to print
  Result<bool, std::string> select(suite::AssociationSet set);
  /// The set that an SPI of this channel belongs to, if its key is here.
  [[nodiscard]] std::optional<suite::AssociationSet> set_of(std::uint16_t spi) const;
  [[nodiscard]] std::uint64_t sent() const { return sent_; }

 private:
  Uplink(wire::TcUplinkChannel channel, UplinkState state) : channel_(channel), state_(std::move(state)) {}
  wire::TcUplinkChannel channel_;
  UplinkState state_;
  struct Association {
    wire::SdlsKey key;
    std::uint16_t spi;
    suite::AssociationSet set;
    bool for_bd;
    bool for_ad;
  };
  [[nodiscard]] wire::TcPacket packet_of(const mission::EncodedCommand& command,
                                         std::uint16_t sequence_count) const;
  [[nodiscard]] bool has(suite::AssociationSet set) const;
  /// nullptr: a channel without security
  [[nodiscard]] const Association* association(wire::TcFrameType type, suite::AssociationSet set) const;
  void follow_session_keys();
  void use(const wire::SessionKeys& keys);
  std::vector<Association> associations_;  ///< those whose key is here
  std::filesystem::path session_keys_;     ///< of its copies
  std::string session_keys_seen_;          ///< which files they were
  std::set<std::uint16_t> foreign_told_;
  std::set<std::uint16_t> unbelievable_told_;
  [[nodiscard]] wire::SdlsSeal seal_of(const Association& used, std::uint64_t counter) const {
    return {.key = used.key, .spi = used.spi, .counter = counter, .sender = sender_};
  }
  std::uint32_t sender_ = 0;  ///< of the IV; 0 unless the link is strict
  bool secured_ = false;
  bool forced_ = false;
  suite::AssociationSet set_ = suite::AssociationSet::a;
  std::uint64_t sent_ = 0;
};

}  // namespace srfs::ground
