// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/cadu.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <iterator>
#include <optional>
#include <utility>

#include "wire/crc16.hpp"
#include "wire/randomizer.hpp"
#include "wire/reed_solomon.hpp"

namespace srfs::wire {
namespace {

constexpr std::size_t input_piece_octets = 4096;
constexpr unsigned marker_bit_errors_max = 3;

unsigned marker_bit_errors(OctetView octets) {
  unsigned errors = 0;
  for (std::size_t i = 0; i < attached_sync_marker.size(); ++i) {
    errors +=
        static_cast<unsigned>(std::popcount(static_cast<unsigned>(octets[i] ^ attached_sync_marker[i])));
  }
  return errors;
}

std::optional<CaduSynchroniser::Frame> decode_block(OctetView block, const CaduFormat& format) {
  Octets octets(block.begin(), block.end());
  if (format.randomize) randomize_tm(octets);
  if (format.reed_solomon) {
    auto decoded = rs_decode(octets, format.interleave);
    if (!decoded) return std::nullopt;
    // The code is cyclic, and so nearly is the random sequence: a codeblock taken one octet early or late
    // decodes to a wrong frame. Only the FECF shows it.
    if (crc16(decoded->data) != 0) return std::nullopt;
    return CaduSynchroniser::Frame{std::move(decoded->data), decoded->corrected_octets};
  }
  if (crc16(octets) != 0) return std::nullopt;
  return CaduSynchroniser::Frame{std::move(octets), 0};
}

}  // namespace

bool is_valid(const CaduFormat& format) {
  return format.reed_solomon ? rs_fits(format.frame_octets, format.interleave) : format.frame_octets > 0;
}

std::size_t cadu_octets(const CaduFormat& format) {
  return attached_sync_marker.size() + format.frame_octets +
         (format.reed_solomon ? rs_parity_octets * format.interleave : 0);
}

Octets encode_cadu(OctetView frame, const CaduFormat& format) {
  assert(is_valid(format) && frame.size() == format.frame_octets);
  Octets block =
      format.reed_solomon ? rs_encode(frame, format.interleave) : Octets(frame.begin(), frame.end());
  if (format.randomize) randomize_tm(block);
  Octets cadu(attached_sync_marker.size() + block.size());
  const auto behind_marker =
      std::copy(attached_sync_marker.begin(), attached_sync_marker.end(), cadu.begin());
  std::copy(block.begin(), block.end(), behind_marker);
  return cadu;
}

CaduSynchroniser::CaduSynchroniser(CaduFormat format) : format_(format) {
  assert(is_valid(format));
}

std::vector<CaduSynchroniser::Frame> CaduSynchroniser::push(OctetView octets) {
  std::vector<Frame> frames;
  while (!octets.empty()) {
    const OctetView piece = octets.first(std::min(octets.size(), input_piece_octets));
    octets = octets.subspan(piece.size());
    buffer_.insert(buffer_.end(), piece.begin(), piece.end());
    drain(frames);
  }
  return frames;
}

void CaduSynchroniser::drain(std::vector<Frame>& frames) {
  const auto step = [this, &frames] {
    if (state_ == State::searching) return search();
    if (state_ == State::locked && !spacing_checked_) return check_spacing();
    return decode(frames);
  };
  while (step() == Step::progressed) {
  }
  buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(head_ - look_back_));
  head_ = look_back_;
}

CaduSynchroniser::Step CaduSynchroniser::search() {
  const OctetView octets = pending();
  const auto marker =
      std::search(octets.begin(), octets.end(), attached_sync_marker.begin(), attached_sync_marker.end());
  if (marker == octets.end()) {
    // The last three octets may be the beginning of a marker.
    drop_noise(octets.size() - std::min(octets.size(), attached_sync_marker.size() - 1));
    return Step::needs_octets;
  }
  drop_noise(static_cast<std::size_t>(std::distance(octets.begin(), marker)));
  ++counters_.locks;
  marker_bit_errors_ = 0;
  state_ = State::candidate;
  return Step::progressed;
}

CaduSynchroniser::Step CaduSynchroniser::check_spacing() {
  if (pending().size() < attached_sync_marker.size()) return Step::needs_octets;
  marker_bit_errors_ = marker_bit_errors(pending());
  if (marker_bit_errors_ <= marker_bit_errors_max) {
    spacing_checked_ = true;
    return Step::progressed;
  }
  ++counters_.losses_of_lock;
  state_ = State::searching;
  head_ -= look_back_;
  handed_out_ = std::exchange(look_back_, 0);
  return Step::progressed;
}

CaduSynchroniser::Step CaduSynchroniser::decode(std::vector<Frame>& frames) {
  const std::size_t octets = cadu_octets(format_);
  if (pending().size() < octets) return Step::needs_octets;
  auto frame = decode_block(
      pending().subspan(attached_sync_marker.size(), octets - attached_sync_marker.size()), format_);
  spacing_checked_ = false;
  look_back_ = 0;
  if (!frame) {
    ++counters_.rejected;
    if (state_ == State::locked) ++counters_.losses_of_lock;
    state_ = State::searching;
    drop_noise(1);
    return Step::progressed;
  }
  ++counters_.frames;
  counters_.corrected_octets += frame->corrected_octets;
  counters_.marker_bit_errors += marker_bit_errors_;
  counters_.shared_octets += std::exchange(handed_out_, 0);
  frames.push_back(std::move(*frame));
  head_ += octets;
  // Octets lost shortly before the end: the block was corrected, but the next marker begins inside it.
  look_back_ = frames.back().corrected_octets > 0 ? rs_correctable_octets * format_.interleave : 0;
  state_ = State::locked;
  return Step::progressed;
}

void CaduSynchroniser::drop_noise(std::size_t octets) {
  const std::size_t counted = std::min(octets, handed_out_);
  handed_out_ -= counted;
  counters_.noise_octets += octets - counted;
  head_ += octets;
}

}  // namespace srfs::wire
