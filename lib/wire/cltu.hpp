// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "wire/tc_frame.hpp"

namespace srfs::wire {

/// Start sequence of a CLTU (CCSDS 231.0-B-4, 5.2.2).
inline constexpr std::array<std::uint8_t, 2> cltu_start_sequence{0xEB, 0x90};
/// Tail sequence of a BCH CLTU (5.2.4): built to be no codeword.
inline constexpr std::array<std::uint8_t, 8> cltu_tail_sequence{0xC5, 0xC5, 0xC5, 0xC5,
                                                                0xC5, 0xC5, 0xC5, 0x79};
/// Information octets and octets of a BCH(63,56) codeblock (3.2).
inline constexpr std::size_t bch_information_octets = 7;
inline constexpr std::size_t bch_block_octets = 8;

/// Last octet of the codeblock of @p information (7 octets): seven inverted parity bits of x^7+x^6+x^2+1,
/// then the filler bit 0 (CCSDS 231.0-B-4, 3.3).
[[nodiscard]] std::uint8_t bch_parity(OctetView information);

/// One frame as a CLTU: start sequence, codeblocks (the last one filled with 55), tail (CCSDS 231.0-B-4,
/// clauses 3, 5).
/// @param frame      1 to tc_frame_octets_max octets
/// @param randomize  the TC randomizer over the frame, not over the fill (6.2)
[[nodiscard]] Octets encode_cltu(OctetView frame, bool randomize);

/// Finds the frames in the octets of the uplink line.
///
/// The line is octet-aligned (a UART), so the start sequence is sought at octet borders. With error
/// correction one of its bits may be wrong, as in a block; else none. Blocks are decoded one by one and the
/// end is known from the frame's length field; the tail is never sought. A candidate is believed only when
/// all its blocks, its length and its FECF are right. Otherwise only its start sequence is dropped and
/// everything behind it is searched again, so a CLTU cut short, or a start sequence imitated by noise, never
/// takes a good CLTU with it: the good one comes out as soon as the candidate fails, or at the latest when
/// the line is silent.
///
/// Memory is bounded by the longest CLTU plus one piece of input. Not thread-safe. Never blocks.
class CltuDecoder {
 public:
  struct Config {
    bool randomized = false;
    /// One wrong bit in a block, and in the start sequence; else any wrong bit rejects them (231.0-B-4, 3.4:
    /// SEC or TED).
    bool correct_single_bits = false;
    std::size_t frame_octets_max = tc_frame_octets_max;
    std::chrono::milliseconds silence{200};  ///< no octet for this long inside a CLTU: it was cut short
  };

  struct Counters {
    std::uint64_t start_sequences =
        0;  ///< seen, imitations and those found again while searching behind a failure included
    std::uint64_t cltus_decoded = 0;    ///< frames handed out
    std::uint64_t blocks_rejected = 0;  ///< wrong parity that could not be corrected
    std::uint64_t corrected_bits = 0;   ///< in frames handed out and their start sequences
    std::uint64_t bad_length = 0;       ///< length field below the shortest or above the longest frame
    std::uint64_t bad_fecf = 0;         ///< all blocks right, frame error control wrong
    std::uint64_t cut_short = 0;        ///< given up because the line was silent
    std::uint64_t noise_octets = 0;     ///< octets that belong to no frame handed out and are not its tail
  };

  explicit CltuDecoder(Config config);

  /// Judges no gap: when these octets were on the line is not known, only when they were read. A reader that
  /// was held up for longer than the silence loses nothing.
  /// @param octets  any number, as they came from the line
  /// @param now     when they were read; not before the previous call
  /// @return the frames that end in these octets, FECF tested and still at the end; derandomized
  [[nodiscard]] std::vector<Octets> push(OctetView octets, MonotonicTime now);

  /// The line is empty: everything that had arrived by @p now was pushed. To be called from time to time, and
  /// only after looking. When the line has been silent for the configured time inside a CLTU, gives that one
  /// up and searches what it had taken.
  /// @return the frames found in it
  [[nodiscard]] std::vector<Octets> on_idle(MonotonicTime now);

  /// From when on on_idle has something to do, while in_cltu().
  [[nodiscard]] MonotonicTime silence_deadline() const { return last_octet_ + config_.silence; }
  /// A start sequence was seen and its frame has not ended yet.
  [[nodiscard]] bool in_cltu() const { return in_cltu_; }
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  enum class Step { progressed, needs_octets };

  void drain(std::vector<Octets>& frames);
  Step search();
  /// Wrong bits of the start sequence that may stand at @p octets (two at least); nullopt: it does not.
  [[nodiscard]] std::optional<std::size_t> start_errors(OctetView octets) const;
  /// Whether the next octet may make @p octet the begin of a start sequence.
  [[nodiscard]] bool may_begin_start(std::uint8_t octet) const;
  [[nodiscard]] bool start_inside(std::size_t begin, std::size_t end) const;
  Step decode_block(std::vector<Octets>& frames);
  void finish(std::vector<Octets>& frames);
  void give_up();
  void drop(std::size_t octets) { head_ += octets; }
  [[nodiscard]] OctetView pending() const { return OctetView(buffer_).subspan(head_); }

  Config config_;
  Counters counters_;
  Octets buffer_;         // raw octets not yet decided; from the start sequence on while in a CLTU
  std::size_t head_ = 0;  // first of them
  bool in_cltu_ = false;
  Octets frame_;                  // decoded information of the candidate
  std::size_t frame_octets_ = 0;  // its length, known after the first block
  std::size_t corrected_bits_ = 0;
  std::size_t tail_matched_ = cltu_tail_sequence.size();  // octets of the expected tail seen after a frame
  MonotonicTime last_octet_;
};

}  // namespace srfs::wire
