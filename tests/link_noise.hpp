// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <chrono>
#include <optional>
#include <string_view>
#include <vector>

#include "tests/noisy_line.hpp"
#include "wire/cadu.hpp"
#include "wire/cltu.hpp"
#include "wire/sdls.hpp"
#include "wire/tc_frame.hpp"
#include "wire/tm_frame.hpp"

/// How the two directions of the ground link come back after a disturbance, and what gets through noise: for
/// the unit test, which holds the bounds, and for the bench, which prints the table.
namespace srfs::testing_support {

/// What happens to a clean line. Lengths are in octets of the line.
enum class Disturbance : std::uint8_t {
  jam,         ///< 5000 octets of somebody else
  burst,       ///< 20 of them
  half_frame,  ///< some octets are missing, less than a frame
  drop_out,    ///< 5000 octets are missing: no carrier
};
inline constexpr std::array all_disturbances{Disturbance::jam, Disturbance::burst, Disturbance::half_frame,
                                             Disturbance::drop_out};
[[nodiscard]] inline std::string_view to_text(Disturbance disturbance) {
  constexpr std::array texts{"jam of 5000 octets", "burst of 20 octets", "half a frame missing",
                             "carrier out for 5000 octets"};
  return texts.at(static_cast<std::size_t>(disturbance));
}

/// One direction: units of the line (CADUs, CLTUs) in order, and the receiver that takes them.
class Downlink {
 public:
  static constexpr std::size_t frame_octets = 223;
  static constexpr std::uint16_t spi = 16;
  Downlink() { builder_.emplace(config(), seal()); }

  [[nodiscard]] Octets next_unit() { return wire::encode_cadu(builder_->build_idle(0, ++sent_), format()); }
  /// @return whether a frame was accepted that is newer than all before
  bool take(OctetView octets) {
    bool accepted = false;
    for (const auto& found : synchroniser_.push(octets)) {
      auto frame = wire::decode_tm_frame(found.frame, spacecraft, frame_octets);
      if (!frame) continue;
      const auto number = wire::tm_sdls_open(found.frame, *frame, spi, authenticator_);
      if (!number || *number > sent_ || *number <= last_) continue;
      last_ = *number;
      ++accepted_;
      accepted = true;
    }
    return accepted;
  }
  [[nodiscard]] static std::size_t unit_octets() { return wire::cadu_octets(format()); }
  [[nodiscard]] std::uint64_t sent() const { return sent_; }
  [[nodiscard]] std::uint64_t accepted() const { return accepted_; }
  [[nodiscard]] std::uint64_t corrected() const { return synchroniser_.counters().corrected_octets; }

 private:
  static constexpr std::uint16_t spacecraft = 0xAB;
  static wire::CaduFormat format() { return {.frame_octets = frame_octets}; }
  static wire::TmFrameBuilder::Config config() {
    return {.spacecraft_id = spacecraft, .frame_octets = frame_octets};
  }
  static wire::TmAuthenticator authenticator() {
    return std::move(
        *wire::TmAuthenticator::create(wire::SdlsKey(std::array<std::uint8_t, wire::sdls_key_octets>{5})));
  }
  static wire::TmSeal seal() { return {.spi = spi, .authenticator = authenticator()}; }

  std::optional<wire::TmFrameBuilder> builder_;
  wire::CaduSynchroniser synchroniser_{format()};
  wire::TmAuthenticator authenticator_ = authenticator();
  std::uint64_t sent_ = 0;
  std::uint64_t last_ = 0;
  std::uint64_t accepted_ = 0;
};

class Uplink {
 public:
  static constexpr std::uint16_t spi = 4;
  explicit Uplink(std::size_t packet_octets = 13) : packet_(packet_octets, 0x2A) {}

  [[nodiscard]] Octets next_unit() {
    auto data = wire::sdls_apply({.key = key_, .spi = spi, .counter = ++sent_}, 0, 0xC0, packet_);
    return wire::encode_cltu(
        wire::encode_tc_frame({.type = wire::TcFrameType::bd, .spacecraft_id = spacecraft, .data = *data}),
        false);
  }
  bool take(OctetView octets) { return take_all(decoder_.push(octets, MonotonicTime{})); }
  /// The line is silent until a CLTU that was cut short is given up.
  bool silence() { return take_all(decoder_.on_idle(MonotonicTime{} + std::chrono::seconds(1))); }
  [[nodiscard]] std::size_t unit_octets() const { return Uplink(packet_.size()).next_unit().size(); }
  [[nodiscard]] std::uint64_t sent() const { return sent_; }
  [[nodiscard]] std::uint64_t accepted() const { return accepted_; }
  [[nodiscard]] std::uint64_t corrected() const { return decoder_.counters().corrected_bits; }

 private:
  static constexpr std::uint16_t spacecraft = 0xAB;
  bool take_all(const std::vector<Octets>& frames) {
    bool accepted = false;
    for (const Octets& octets : frames) {
      const auto frame = wire::decode_tc_frame(octets, spacecraft);
      const auto opened = frame ? wire::sdls_open(key_, spi, frame->vc, frame->data)
                                : Result<wire::SdlsOpened, wire::SdlsError>(Err(wire::SdlsError::too_short));
      if (!opened || opened->counter > sent_ || opened->counter <= last_ || opened->packet != packet_)
        continue;
      last_ = opened->counter;
      ++accepted_;
      accepted = true;
    }
    return accepted;
  }

  Octets packet_;
  wire::SdlsKey key_{std::array<std::uint8_t, wire::sdls_key_octets>{5}};
  wire::CltuDecoder decoder_{{.correct_single_bits = true}};
  std::uint64_t sent_ = 0;
  std::uint64_t last_ = 0;
  std::uint64_t accepted_ = 0;
};

/// Octets of a clean line, units back to back, from the end of a disturbance that comes anywhere in a unit
/// until a unit is accepted. nullopt: not within @p patience octets.
template <class Direction>
std::optional<std::size_t> octets_to_acquire(Direction direction, Disturbance disturbance, NoisyLine& noise,
                                             std::size_t patience = 10'000) {
  constexpr std::size_t long_time = 5000;
  Octets line;
  const auto need = [&](std::size_t octets) {
    while (line.size() < octets) {
      const Octets unit = direction.next_unit();
      line.insert(line.end(), unit.begin(), unit.end());
    }
  };
  const std::size_t unit = direction.unit_octets();
  const std::size_t clean = 3 * unit + noise.number(unit);
  const bool is_long = disturbance == Disturbance::jam || disturbance == Disturbance::drop_out;
  const std::size_t lasts = is_long                             ? long_time
                            : disturbance == Disturbance::burst ? 20
                                                                : 1 + noise.number(unit - 1);
  need(clean + lasts + 1);
  direction.take(OctetView(line).first(clean));
  const bool is_heard = disturbance == Disturbance::jam || disturbance == Disturbance::burst;
  if (is_heard) direction.take(noise.jam(lasts));
  std::size_t at = clean + lasts;
  for (std::size_t octets = 1; octets <= patience; ++octets, ++at) {
    need(at + 1);
    if (direction.take(OctetView(line).subspan(at, 1))) return octets;
  }
  return std::nullopt;
}

}  // namespace srfs::testing_support
