// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/can_bits.hpp"

#include <cassert>

namespace srfs::wire {
namespace {

constexpr unsigned tail_bits = 1 + 2 + 7 + 3;  // CRC delimiter, acknowledgement, end of frame, intermission

/// Counts the bits from start of frame to CRC sequence, stuff bits included, and runs the CRC-15 of ISO
/// 11898-1 on the way.
class BitCounter {
 public:
  void put(std::uint32_t value, unsigned width) {
    for (unsigned i = width; i-- > 0;) bit((value >> i & 1U) != 0, true);
  }
  void put_crc() {
    const std::uint16_t crc = crc_;
    for (unsigned i = 15; i-- > 0;) bit((crc >> i & 1U) != 0, false);
  }
  [[nodiscard]] unsigned count() const { return count_; }

 private:
  void bit(bool value, bool in_crc) {
    if (in_crc) {
      const bool invert = value != ((crc_ >> 14U & 1U) != 0);
      crc_ = static_cast<std::uint16_t>(crc_ << 1U & 0x7FFFU);
      if (invert) crc_ ^= 0x4599U;
    }
    ++count_;
    run_ = value == last_ ? run_ + 1 : 1;
    last_ = value;
    if (run_ == 5) {  // a stuff bit of the other value follows, and counts as the first of the next run
      ++count_;
      last_ = !value;
      run_ = 1;
    }
  }
  std::uint16_t crc_ = 0;
  unsigned count_ = 0;
  unsigned run_ = 0;
  bool last_ = true;  // the bus is recessive before the start of frame
};

}  // namespace

unsigned can_bits_on_wire(const CanFrameContent& frame) {
  assert(frame.size <= 8 && (frame.remote || frame.data.size() >= frame.size));
  BitCounter bits;
  bits.put(0, 1);  // start of frame
  if (frame.extended) {
    bits.put(frame.id >> 18U, 11);
    bits.put(0b11, 2);  // SRR, IDE
    bits.put(frame.id & 0x3FFFFU, 18);
    bits.put(frame.remote ? 1 : 0, 1);
    bits.put(0, 2);  // r1, r0
  } else {
    bits.put(frame.id, 11);
    bits.put(frame.remote ? 1 : 0, 1);
    bits.put(0, 2);  // IDE, r0
  }
  bits.put(frame.size, 4);
  if (!frame.remote) {
    for (std::size_t i = 0; i < frame.size; ++i) bits.put(frame.data[i], 8);
  }
  bits.put_crc();
  return bits.count() + tail_bits;
}

}  // namespace srfs::wire
