// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/cltu.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <optional>

#include "wire/crc16.hpp"
#include "wire/randomizer.hpp"

namespace srfs::wire {
namespace {

constexpr std::uint8_t fill_octet = 0x55;
constexpr std::size_t input_piece_octets = 1024;

/// Remainders of x^7+x^6+x^2+1, kept in the upper seven bits.
constexpr std::array<std::uint8_t, 256> make_remainders() {
  std::array<std::uint8_t, 256> table{};
  for (unsigned value = 0; value < 256; ++value) {
    unsigned remainder = value;
    for (int bit = 0; bit < 8; ++bit)
      remainder = (remainder & 0x80) != 0 ? remainder << 1 ^ 0x8A : remainder << 1;
    table[value] = static_cast<std::uint8_t>(remainder);
  }
  return table;
}
constexpr auto remainders = make_remainders();

template <class Range>
constexpr std::uint8_t bch_remainder(const Range& information) {
  std::uint8_t remainder = 0;
  for (const std::uint8_t octet : information) remainder = remainders[remainder ^ octet];
  return remainder;
}

constexpr std::uint8_t not_correctable = 0xFF;

/// Syndrome (shifted right by the filler bit) -> the single wrong bit of the codeblock, 0 the first on the
/// line.
constexpr std::array<std::uint8_t, 128> make_single_errors() {
  std::array<std::uint8_t, 128> table{};
  for (std::uint8_t& entry : table) entry = not_correctable;
  for (std::uint8_t bit = 0; bit < 56; ++bit) {
    std::array<std::uint8_t, bch_information_octets> error{};
    error[bit / 8] = static_cast<std::uint8_t>(0x80 >> bit % 8);
    table[bch_remainder(error) >> 1] = bit;
  }
  for (std::uint8_t bit = 56; bit < 63; ++bit) table[(0x80 >> (bit - 56)) >> 1] = bit;
  return table;
}
constexpr auto single_errors = make_single_errors();

std::size_t wrong_bits(std::uint8_t octet, std::uint8_t expected) {
  return static_cast<std::size_t>(std::popcount(static_cast<unsigned>(octet ^ expected)));
}

struct Block {
  std::array<std::uint8_t, bch_information_octets> information{};
  std::size_t corrected_bits = 0;
};

/// The filler bit is ignored: it protects nothing, and a hit on it is no reason to lose a frame.
std::optional<Block> decode_bch(OctetView octets, bool correct) {
  Block block;
  std::copy_n(octets.begin(), bch_information_octets, block.information.begin());
  const unsigned received = ~static_cast<unsigned>(octets[bch_information_octets]) & 0xFE;
  const unsigned syndrome = bch_remainder(block.information) ^ received;
  if (syndrome == 0) return block;
  if (!correct) return std::nullopt;
  const std::uint8_t bit = single_errors[syndrome >> 1];
  if (bit == not_correctable) return std::nullopt;
  if (bit < 56) block.information[bit / 8] ^= static_cast<std::uint8_t>(0x80 >> bit % 8);
  block.corrected_bits = 1;
  return block;
}

}  // namespace

std::uint8_t bch_parity(OctetView information) {
  assert(information.size() == bch_information_octets);
  return static_cast<std::uint8_t>(~bch_remainder(information) & 0xFE);
}

Octets encode_cltu(OctetView frame, bool randomize) {
  assert(!frame.empty() && frame.size() <= tc_frame_octets_max);
  Octets information(frame.begin(), frame.end());
  if (randomize) randomize_tc(information);
  const std::size_t blocks = (information.size() + bch_information_octets - 1) / bch_information_octets;
  information.resize(blocks * bch_information_octets, fill_octet);

  Octets cltu;
  cltu.reserve(cltu_start_sequence.size() + blocks * bch_block_octets + cltu_tail_sequence.size());
  cltu.insert(cltu.end(), cltu_start_sequence.begin(), cltu_start_sequence.end());
  for (std::size_t i = 0; i < blocks; ++i) {
    const OctetView block =
        OctetView(information).subspan(i * bch_information_octets, bch_information_octets);
    cltu.insert(cltu.end(), block.begin(), block.end());
    cltu.push_back(bch_parity(block));
  }
  cltu.insert(cltu.end(), cltu_tail_sequence.begin(), cltu_tail_sequence.end());
  return cltu;
}

CltuDecoder::CltuDecoder(Config config) : config_(config) {
  assert(config.frame_octets_max >= tc_frame_octets_min && config.frame_octets_max <= tc_frame_octets_max);
}

std::vector<Octets> CltuDecoder::push(OctetView octets, MonotonicTime now) {
  std::vector<Octets> frames;
  if (octets.empty()) return frames;
  last_octet_ = now;
  while (!octets.empty()) {
    const OctetView piece = octets.first(std::min(octets.size(), input_piece_octets));
    octets = octets.subspan(piece.size());
    buffer_.insert(buffer_.end(), piece.begin(), piece.end());
    drain(frames);
  }
  return frames;
}

std::vector<Octets> CltuDecoder::on_idle(MonotonicTime now) {
  std::vector<Octets> frames;
  if (!in_cltu_ || now < silence_deadline()) return frames;
  while (in_cltu_) {
    ++counters_.cut_short;
    give_up();
    drain(frames);
  }
  return frames;
}

void CltuDecoder::drain(std::vector<Octets>& frames) {
  while ((in_cltu_ ? decode_block(frames) : search()) == Step::progressed) {
  }
  buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(head_));
  head_ = 0;
}

std::optional<std::size_t> CltuDecoder::start_errors(OctetView octets) const {
  const std::size_t errors =
      wrong_bits(octets[0], cltu_start_sequence[0]) + wrong_bits(octets[1], cltu_start_sequence[1]);
  if (errors > (config_.correct_single_bits ? 1U : 0U)) return std::nullopt;
  return errors;
}

bool CltuDecoder::may_begin_start(std::uint8_t octet) const {
  return wrong_bits(octet, cltu_start_sequence[0]) <= (config_.correct_single_bits ? 1U : 0U);
}

CltuDecoder::Step CltuDecoder::search() {
  OctetView octets = pending();
  while (!octets.empty() && tail_matched_ < cltu_tail_sequence.size()) {
    if (octets[0] != cltu_tail_sequence[tail_matched_]) {
      tail_matched_ = cltu_tail_sequence.size();
      break;
    }
    ++tail_matched_;
    octets = octets.subspan(1);
    drop(1);
  }
  // EB and 90 differ in six bits, so a start sequence found never overlaps another one.
  std::size_t noise = 0;
  std::optional<std::size_t> errors;
  while (octets.size() - noise >= cltu_start_sequence.size()) {
    errors = start_errors(octets.subspan(noise));
    if (errors) break;
    ++noise;
  }
  // The last octet may be the first half of a start sequence.
  if (!errors && !octets.empty() && !may_begin_start(octets.back())) noise = octets.size();
  counters_.noise_octets += noise;
  drop(noise);
  if (!errors) return Step::needs_octets;
  ++counters_.start_sequences;
  tail_matched_ = cltu_tail_sequence.size();
  in_cltu_ = true;
  frame_.clear();
  frame_octets_ = 0;
  corrected_bits_ = *errors;
  return Step::progressed;
}

CltuDecoder::Step CltuDecoder::decode_block(std::vector<Octets>& frames) {
  const std::size_t at =
      cltu_start_sequence.size() + frame_.size() / bch_information_octets * bch_block_octets;
  if (pending().size() < at + bch_block_octets) return Step::needs_octets;
  const auto block = decode_bch(pending().subspan(at, bch_block_octets), config_.correct_single_bits);
  if (!block) {
    ++counters_.blocks_rejected;
    give_up();
    return Step::progressed;
  }
  const std::size_t decoded = frame_.size();
  corrected_bits_ += block->corrected_bits;
  frame_.insert(frame_.end(), block->information.begin(), block->information.end());
  if (config_.randomized) randomize_tc(std::span(frame_).subspan(decoded), decoded);
  if (decoded == 0) {
    frame_octets_ = tc_frame_octets(frame_);
    if (frame_octets_ < tc_frame_octets_min || frame_octets_ > config_.frame_octets_max) {
      ++counters_.bad_length;
      give_up();
      return Step::progressed;
    }
  }
  if (frame_.size() >= frame_octets_) finish(frames);
  return Step::progressed;
}

void CltuDecoder::finish(std::vector<Octets>& frames) {
  const std::size_t blocks = frame_.size() / bch_information_octets;
  const std::size_t fill_octets = frame_.size() - frame_octets_;
  frame_.resize(frame_octets_);
  if (crc16(frame_) != 0) {
    ++counters_.bad_fecf;
    give_up();
    return;
  }
  ++counters_.cltus_decoded;
  counters_.corrected_bits += corrected_bits_;
  frames.push_back(std::move(frame_));
  frame_ = {};
  in_cltu_ = false;
  tail_matched_ = 0;

  // A CLTU cut inside its last fill or parity can still be complete, corrected with the next one's start
  // sequence in their place. True fill and parity never hold one: fill is 55, the last bit of parity 0.
  const std::size_t end = cltu_start_sequence.size() + blocks * bch_block_octets;
  const std::size_t trailer = end - fill_octets - 1;
  drop(start_inside(trailer, end) ? trailer : end);
}

bool CltuDecoder::start_inside(std::size_t begin, std::size_t end) const {
  const OctetView octets = pending();
  for (std::size_t i = begin; i < end; ++i) {
    // Parity may differ from the first octet in one bit, so that alone says nothing.
    if (octets[i] == cltu_start_sequence[0]) return true;
    if (i + 1 < octets.size() && start_errors(octets.subspan(i))) return true;
  }
  return false;
}

void CltuDecoder::give_up() {
  in_cltu_ = false;
  counters_.noise_octets += cltu_start_sequence.size();
  drop(cltu_start_sequence.size());
}

}  // namespace srfs::wire
