// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/file/rice.hpp"

#include <algorithm>
#include <array>
#include <bit>

namespace srfs::image {
namespace {

// A block begins with four bits: 0, all differences are zero; 15, they follow as they are; else one more than
// the number of low bits that each difference has behind its unary part.
constexpr int mode_bits = 4;
constexpr int value_bits = 16;
constexpr int split_as_they_are = 14;

/// The highest bit first.
class BitWriter {
 public:
  explicit BitWriter(Octets& out) : out_(out) {}
  /// @param n  up to 32
  void put(std::uint32_t value, int n) {
    bits_ = bits_ << n | value;
    count_ += n;
    while (count_ >= 8) {
      count_ -= 8;
      out_.push_back(static_cast<std::uint8_t>(bits_ >> count_));
    }
  }
  /// So many zeros and a one.
  void unary(std::uint32_t zeros) {
    for (; zeros > 31; zeros -= 31) put(0, 31);
    put(1, static_cast<int>(zeros) + 1);
  }
  void end() {
    if (count_ > 0) put(0, 8 - count_);
  }

 private:
  Octets& out_;
  std::uint64_t bits_ = 0;
  int count_ = 0;  ///< of the lowest bits, not written yet
};

/// Past the end every read gives zero and ok() turns false.
class BitReader {
 public:
  explicit BitReader(OctetView in) : in_(in) {}
  /// @param n  up to 32
  std::uint32_t take(int n) {
    if (n == 0) return 0;
    fill();
    ok_ = ok_ && count_ >= n;
    if (!ok_) return 0;
    const auto value = static_cast<std::uint32_t>(bits_ >> (64 - n));
    drop(n);
    return value;
  }
  /// Zeros before the next one, which is taken too. More than a number has values: damage.
  std::uint32_t unary() {
    constexpr std::uint32_t most = 65536 + 64;
    std::uint32_t zeros = 0;
    for (fill(); ok_ && bits_ == 0; fill()) {
      zeros += static_cast<std::uint32_t>(count_);
      ok_ = count_ > 0 && zeros <= most;
      count_ = 0;
    }
    if (!ok_) return 0;
    const int here = std::countl_zero(bits_);
    drop(here + 1);
    return zeros + static_cast<std::uint32_t>(here);
  }
  [[nodiscard]] bool ok() const { return ok_; }

 private:
  void fill() {
    for (; count_ <= 56 && !in_.empty(); in_ = in_.subspan(1), count_ += 8)
      bits_ |= std::uint64_t{in_.front()} << (56 - count_);
  }
  void drop(int n) {
    bits_ = n < 64 ? bits_ << n : 0;
    count_ -= n;
  }

  OctetView in_;
  std::uint64_t bits_ = 0;  ///< from the highest on; zeros behind them
  int count_ = 0;
  bool ok_ = true;
};

/// Differences around zero as small numbers: 0, -1, 1, -2... are 0, 1, 2, 3...
std::uint16_t folded(std::uint16_t difference) {
  const std::uint32_t twice = std::uint32_t{difference} << 1;
  return static_cast<std::uint16_t>(difference < 0x8000 ? twice : ~twice);
}

std::uint16_t unfolded(std::uint32_t number) {
  return static_cast<std::uint16_t>((number & 1) != 0 ? ~(number >> 1) : number >> 1);
}

/// Low bits of each number, so that the unary parts are short: cfitsio's rule.
int split_of(std::uint32_t sum, std::uint32_t count) {
  const std::uint32_t off = count / 2 + 1;
  return static_cast<int>(std::bit_width((sum > off ? (sum - off) / count : 0) >> 1));
}

void pack_block(std::span<const std::uint16_t> numbers, BitWriter& out) {
  std::uint32_t sum = 0;
  for (const std::uint16_t v : numbers) sum += v;
  if (sum == 0) return out.put(0, mode_bits);
  const int split = std::min(split_of(sum, static_cast<std::uint32_t>(numbers.size())), split_as_they_are);
  out.put(static_cast<std::uint32_t>(split + 1), mode_bits);
  for (const std::uint32_t v : numbers) {
    if (split == split_as_they_are) {
      out.put(v, value_bits);
    } else {
      out.unary(v >> split);
      out.put(v & ((1U << split) - 1), split);
    }
  }
}

}  // namespace

void pack_rice(std::span<const std::uint16_t> row, Octets& out) {
  BitWriter bits(out);
  std::uint16_t last = row.front();
  bits.put(last, value_bits);
  std::array<std::uint16_t, rice_block> numbers{};
  for (std::size_t begin = 0; begin < row.size(); begin += rice_block) {
    const auto block = row.subspan(begin, std::min(rice_block, row.size() - begin));
    for (std::size_t i = 0; i < block.size(); ++i) {
      numbers[i] = folded(static_cast<std::uint16_t>(block[i] - last));
      last = block[i];
    }
    pack_block(std::span(numbers).first(block.size()), bits);
  }
  bits.end();
}

bool unpack_rice(OctetView packed, std::span<std::uint16_t> row) {
  BitReader bits(packed);
  auto last = static_cast<std::uint16_t>(bits.take(value_bits));
  for (std::size_t begin = 0; begin < row.size() && bits.ok(); begin += rice_block) {
    const int split = static_cast<int>(bits.take(mode_bits)) - 1;
    for (std::uint16_t& value : row.subspan(begin, std::min(rice_block, row.size() - begin))) {
      std::uint32_t number = 0;
      if (split == split_as_they_are) {
        number = bits.take(value_bits);
      } else if (split >= 0) {
        number = bits.unary() << split;
        number |= bits.take(split);
      }
      last = static_cast<std::uint16_t>(last + unfolded(number));
      value = last;
    }
  }
  return bits.ok();
}

}  // namespace srfs::image
