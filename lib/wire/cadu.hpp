// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/octets.hpp"

namespace srfs::wire {

/// Attached synchronisation marker of uncoded, RS and convolutional links (CCSDS 131.0-B-3, 9.3.2).
inline constexpr std::array<std::uint8_t, 4> attached_sync_marker{0x1A, 0xCF, 0xFC, 0x1D};

/// What ground and spacecraft agreed on. With Reed-Solomon, rs_fits(frame_octets, interleave) must hold.
struct CaduFormat {
  std::size_t frame_octets = 223;  ///< the transfer frame, without parity and marker
  bool reed_solomon = true;
  unsigned interleave = 1;  ///< 1 to 8, ignored without Reed-Solomon
  bool randomize = true;
};
[[nodiscard]] bool is_valid(const CaduFormat& format);
/// Marker, frame and parity.
[[nodiscard]] std::size_t cadu_octets(const CaduFormat& format);

/// One transfer frame as a channel access data unit: RS codeblock, randomized, behind the marker (131.0-B-3,
/// clauses 4, 9, 10).
/// @param frame exactly format.frame_octets
[[nodiscard]] Octets encode_cadu(OctetView frame, const CaduFormat& format);

/// Finds the frames in the octets of the downlink line.
///
/// The marker is sought octet by octet without error tolerance. A candidate is believed when its Reed-Solomon
/// words can be decoded and the FECF at the end of the frame is right (the code is cyclic: a codeblock that
/// slipped by an octet can decode, to a wrong frame); otherwise only its marker is dropped and what stands
/// behind it is searched again. So after a lost or an extra octet the very next whole CADU is found. While
/// locked the next marker is expected right behind the last CADU; there it may have up to three wrong bits,
/// because the decoder confirms it. Memory: one CADU plus one piece of input. Not thread-safe. Never blocks.
class CaduSynchroniser {
 public:
  struct Frame {
    Octets frame;
    unsigned corrected_octets = 0;
  };
  struct Counters {
    std::uint64_t frames = 0;             ///< handed out
    std::uint64_t corrected_octets = 0;   ///< in them
    std::uint64_t rejected = 0;           ///< candidates that could not be decoded or had a wrong FECF
    std::uint64_t locks = 0;              ///< times the marker was found by search
    std::uint64_t losses_of_lock = 0;     ///< marker not where it should be, or candidate rejected
    std::uint64_t marker_bit_errors = 0;  ///< in markers that were accepted while locked
    std::uint64_t noise_octets = 0;       ///< octets that belong to no CADU handed out
    std::uint64_t shared_octets = 0;  ///< octets that belong to two: some were lost before the first's end
  };

  /// @param format is_valid(format) holds
  explicit CaduSynchroniser(CaduFormat format);

  /// @return the frames whose last octet is among @p octets
  [[nodiscard]] std::vector<Frame> push(OctetView octets);
  [[nodiscard]] bool locked() const { return state_ == State::locked; }
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  enum class State : std::uint8_t {
    searching,  // no idea where the next marker is
    candidate,  // buffer starts with a marker found by search
    locked,     // buffer starts where the next marker must be
  };
  enum class Step : std::uint8_t { progressed, needs_octets };

  void drain(std::vector<Frame>& frames);
  Step search();
  Step check_spacing();
  Step decode(std::vector<Frame>& frames);
  void drop_noise(std::size_t octets);
  [[nodiscard]] OctetView pending() const { return OctetView(buffer_).subspan(head_); }

  CaduFormat format_;
  Counters counters_;
  Octets buffer_;
  std::size_t head_ = 0;        // first octet not yet decided
  std::size_t look_back_ = 0;   // octets before it that are searched too if the next marker is missing
  std::size_t handed_out_ = 0;  // octets from head_ on that belong to the last CADU: they are searched again
  State state_ = State::searching;
  bool spacing_checked_ = false;    // locked: the marker at the front was checked
  unsigned marker_bit_errors_ = 0;  // of that marker
};

}  // namespace srfs::wire
