// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "nodes/ttc/link/key_selection.hpp"
#include "nodes/ttc/link/link_state.hpp"
#include "nodes/ttc/link/telecommand_age.hpp"
#include "wire/cltu.hpp"
#include "wire/farm1.hpp"
#include "wire/sdls.hpp"
#include "wire/session_keys.hpp"
#include "wire/tc_frame.hpp"

namespace srfs {

/// One SDLS security association of the uplink.
struct UplinkAssociation {
  std::uint16_t spi = 0;
  wire::SdlsKey key;
  bool for_ad = true;  ///< AD frames may use it
  bool for_bd = true;
  std::optional<KeySet> set = KeySet::a;  ///< nullopt: the contingency association, which always takes frames
  bool key_lost = false;                  ///< @p key takes no frame
  /// Also takes frames, and from the first one on alone.
  struct NextKey {
    std::uint16_t id = 0;
    wire::SdlsKey key;
  };
  std::optional<NextKey> next = {};
};

/// One TC virtual channel in use.
struct UplinkChannel {
  std::uint8_t vc = 0;
  std::vector<UplinkAssociation> associations;  ///< empty: no security (test deployments only)
  KeySet selected = KeySet::a;                  ///< whose frames are taken beside the contingency's
};

struct UplinkConfig {
  std::uint16_t spacecraft_id = 0;
  /// On secured channels the MAC covers the whole header, control commands (BC) are secured too, one order
  /// holds for all associations of a channel, and counters are UTC milliseconds. Else 355.0-B and 232.1-B as
  /// they stand: N(S), bypass flag and control commands need no key.
  bool strict = false;
  wire::CltuDecoder::Config cltu;
  std::uint8_t farm_window = wire::farm_window_default;
  std::vector<UplinkChannel> channels;
};

/// Two associations under one key would use an IV twice, which breaks AES-GCM.
/// @return the SPIs of the first two that share one
[[nodiscard]] std::optional<std::pair<std::uint16_t, std::uint16_t>> associations_with_one_key(
    const UplinkConfig& config);
/// Whether a key is that of an association.
[[nodiscard]] bool is_key_of(const UplinkConfig& config, const wire::SdlsKey& key);

/// Gives the associations the session keys that they use; the contingency association has none.
void use_session_keys(UplinkConfig& config, const wire::SessionKeys& keys);
/// SPIs that can be rekeyed: all but the contingency's.
[[nodiscard]] std::vector<std::uint16_t> rekeyable_associations(const UplinkConfig& config);

/// One count per reason; every octet that came and every frame that did not get through is in one of them.
struct UplinkCounters {
  std::uint64_t octets = 0;
  std::uint32_t wrong_scid = 0;
  std::uint32_t wrong_header = 0;  ///< version, spare bits, reserved type, length
  std::uint32_t wrong_vc = 0;
  std::uint32_t not_authentic = 0;         ///< too short, unknown or unfit association, wrong MAC
  std::uint32_t replayed = 0;              ///< authentic, and its counter is not above the last accepted one
  std::uint32_t too_old = 0;               ///< authentic, in order, and older than a telecommand may be
  std::uint32_t counter_out_of_range = 0;  ///< authentic, with a counter that no sender gets to
  std::uint64_t refused_counter = 0;       ///< of the newest of the last three
  std::uint32_t farm_discarded = 0;
  std::uint32_t bad_control_command = 0;
  std::uint32_t bad_segment = 0;
  std::uint32_t control_commands = 0;  ///< BC frames executed
  std::uint32_t packets = 0;           ///< handed out
};

/// The frame that brought a packet, by which its repeat is known.
struct UplinkFrame {
  std::uint8_t vc = 0;
  wire::TcFrameType type = wire::TcFrameType::bd;
  std::optional<std::uint16_t> spi = {};  ///< nullopt: channel without security
  std::uint64_t counter = 0;              ///< of the association: the IV
  std::uint8_t sequence = 0;              ///< N(S) of an AD frame
};

/// A space packet that came up, and on which way.
struct UplinkedPacket {
  UplinkFrame frame;
  Octets packet;     ///< not judged yet
  LinkState link{};  ///< as its frame left it; of a refused one empty
};

/// The uplink from octets of the line to space packets: CLTU, TC frame, virtual channel, SDLS (MAC, then
/// counter), FARM-1, segment header. Never blocks. A frame advances its association's counter only when
/// FARM-1 accepted it. The control word acknowledges a frame with data only when what it left is stored.
///
/// The state gets a new generation, which goes to the disk, by accepted frames alone: what needs no key
/// (control commands without security, frames that FARM-1 discards) costs no write.
class UplinkChain {
 public:
  static constexpr std::size_t max_refused = 16;
  /// No clock shows more milliseconds; one frame must not use all counters up. On a standard link a counter
  /// has 64 bits.
  static constexpr std::uint64_t max_strict_counter = std::uint64_t{1} << 62U;

  /// @param stored what was remembered. Channels and associations that are not configured are carried along
  /// while there is room, so that they keep their counters when they come back
  UplinkChain(UplinkConfig config, const LinkState& stored);

  /// @param now not before the previous call. @return packets in order of arrival
  [[nodiscard]] std::vector<UplinkedPacket> push(OctetView octets, MonotonicTime now);
  /// Ends a CLTU that was cut short. To be called from idle_deadline() on, when the line was found empty.
  [[nodiscard]] std::vector<UplinkedPacket> on_idle(MonotonicTime now);
  [[nodiscard]] std::optional<MonotonicTime> idle_deadline() const;

  /// Strict: how old a frame may be; see TelecommandAge::set(). To be told before each push.
  void set_age(std::optional<milliseconds> lifetime, std::optional<std::uint64_t> utc_ms) {
    age_.set(config_.strict ? lifetime : std::nullopt, utc_ms);
  }
  [[nodiscard]] std::optional<std::uint64_t> oldest_counter(MonotonicTime now) const {
    return age_.oldest(now);
  }

  /// Whether a channel has security: then frames without any prove nothing.
  [[nodiscard]] bool authenticates() const;
  /// From now on the channel takes frames of this set. @return false: it has no association of it
  bool select(std::uint8_t vc, KeySet set);
  /// From now on the association takes frames under this key too; nullopt: under its own alone. @return
  /// false: there is no such association
  bool set_next_key(std::uint16_t spi, std::optional<UplinkAssociation::NextKey> next);
  /// Associations whose next key is their only one since the last call: a frame under it was accepted.
  struct KeyConfirmed {
    std::uint16_t spi = 0;
    std::uint16_t key = 0;
    friend bool operator==(const KeyConfirmed&, const KeyConfirmed&) = default;
  };
  [[nodiscard]] std::vector<KeyConfirmed> take_confirmed() { return std::exchange(confirmed_, {}); }
  /// Whether an association has these octets as key.
  [[nodiscard]] bool has_key(OctetView key) const;
  [[nodiscard]] bool has_association(std::uint16_t spi) const;
  /// SPIs of the first secured channel's associations in use, 0: none.
  struct Associations {
    std::uint16_t bd = 0;
    std::uint16_t ad = 0;
    std::uint16_t contingency = 0;
  };
  [[nodiscard]] Associations associations() const;

  /// Whether AD frames can be taken now; false makes FARM-1 wait. Turning true ends the wait.
  void set_buffer_available(bool available);

  /// The control word for the next TM frame; the channels take turns. What is not stored is not acknowledged;
  /// that data must wait is reported at once.
  [[nodiscard]] std::uint32_t next_clcw();

  /// What must be on disk before the packets handed out so far may be executed.
  [[nodiscard]] const LinkState& state() const { return state_; }
  /// Before an orderly end: what control commands and flags of FARM-1 changed gets a generation of its own.
  void keep_flags();
  /// @p stored is on disk, or cannot be brought there. @return whether more is acknowledged now
  bool on_stored(const LinkState& stored);
  /// No configured association takes @p floor or a lower counter from now on.
  void raise_counters(std::uint64_t floor);
  /// The same for one association.
  void raise_counter(std::uint16_t spi, std::uint64_t floor);
  /// The newest state that no restart takes back.
  [[nodiscard]] const LinkState& stored_state() const { return stored_; }
  [[nodiscard]] const wire::FarmState& farm(std::uint8_t vc) const;
  /// The counter that the next one of an association must be above; nullopt: any is taken.
  [[nodiscard]] std::optional<std::uint64_t> newest_counter(std::uint16_t spi) const;
  /// Last accepted counter of an association; nullopt: none yet.
  [[nodiscard]] std::optional<std::uint64_t> counter(std::uint16_t spi) const;
  [[nodiscard]] const UplinkCounters& counters() const { return counters_; }
  [[nodiscard]] const wire::CltuDecoder::Counters& cltu_counters() const { return decoder_.counters(); }
  /// Packets whose frame was whole (and authentic, where the channel is secured) but came before: its counter
  /// was used, or FARM-1 discarded it. The sender may have missed the reports. The newest, at most
  /// max_refused.
  [[nodiscard]] std::vector<UplinkedPacket> take_refused() { return std::exchange(refused_, {}); }

 private:
  [[nodiscard]] std::vector<UplinkedPacket> on_frames(const std::vector<Octets>& frames);
  [[nodiscard]] std::optional<UplinkedPacket> on_frame(OctetView octets);
  [[nodiscard]] std::optional<UplinkedPacket> on_data_frame(const UplinkChannel& channel,
                                                            const wire::TcFrame& frame);
  struct Opened : wire::SdlsOpened {
    bool with_next = false;  ///< under the next key
  };
  /// @return the opened field of a secured channel; nullopt: refused and counted, and kept if it is authentic
  [[nodiscard]] std::optional<Opened> open_secured(const UplinkChannel& channel, const wire::TcFrame& frame);
  [[nodiscard]] static std::optional<Opened> open_with_keys_of(const UplinkAssociation& association,
                                                               const wire::SdlsHeader& header,
                                                               OctetView data);
  /// Counter and key of the frame count from now on.
  void on_accepted(const Opened& opened);
  [[nodiscard]] UplinkAssociation* find(std::uint16_t spi);
  void on_control_frame(const UplinkChannel& channel, const wire::TcFrame& frame);
  /// Strict, on a secured channel.
  void on_secured_control_frame(const UplinkChannel& channel, const wire::TcFrame& frame);
  void count_control(wire::FarmVerdict verdict);
  [[nodiscard]] bool is_strict(const UplinkChannel& channel) const {
    return config_.strict && !channel.associations.empty();
  }
  /// The counter that the next one of @p association must be above.
  [[nodiscard]] std::optional<std::uint64_t> last_counter(const UplinkChannel& channel,
                                                          const UplinkAssociation& association) const;
  [[nodiscard]] const UplinkChannel* channel_of(std::uint8_t vc) const;
  [[nodiscard]] LinkState::Channel& channel_state(std::uint8_t vc);
  /// Without a generation of its own.
  void set_farm(std::uint8_t vc, const wire::FarmState& farm);
  /// The change that set_farm() made waits for no disk: it is acknowledged when nothing before it waits.
  void acknowledge_flags();
  void set_counter(std::uint16_t spi, std::uint64_t counter);
  void keep_refused(UplinkedPacket packet);
  void carry_along(const LinkState& stored);

  UplinkConfig config_;
  wire::CltuDecoder decoder_;
  LinkState state_;             ///< the configured channels first, in their order
  LinkState stored_;            ///< what the control word reports, in the same order
  bool flags_changed_ = false;  ///< since the last generation
  TelecommandAge age_;
  MonotonicTime now_;  ///< of the octets
  bool buffer_available_ = true;
  std::size_t clcw_turn_ = 0;
  UplinkCounters counters_;
  std::vector<UplinkedPacket> refused_;
  std::vector<KeyConfirmed> confirmed_;  ///< at most one for each association
};

}  // namespace srfs
