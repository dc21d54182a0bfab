// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/reed_solomon.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <optional>
#include <span>

namespace srfs::wire {
namespace {

// The field: F(x) = x^8+x^7+x^2+x+1, alpha its root. The code: roots beta^j, beta = alpha^11, j = 112 to 143
// (4.2).
constexpr unsigned field_polynomial = 0x187;
constexpr unsigned field_order = 255;  // of the multiplicative group
constexpr unsigned root_step = 11;
constexpr unsigned first_root = 112;

struct Field {
  // alpha^i, twice, so that a sum of two logarithms needs no modulo
  std::array<std::uint8_t, std::size_t{2} * field_order> power{};
  std::array<std::uint8_t, 256> log{};
};

constexpr Field make_field() {
  Field field;
  unsigned value = 1;
  for (unsigned i = 0; i < field_order; ++i) {
    field.power[i] = field.power[i + field_order] = static_cast<std::uint8_t>(value);
    field.log[value] = static_cast<std::uint8_t>(i);
    value <<= 1;
    if ((value & 0x100) != 0) value ^= field_polynomial;
  }
  return field;
}
constexpr Field field = make_field();

constexpr std::uint8_t multiply(std::uint8_t a, std::uint8_t b) {
  return a == 0 || b == 0 ? std::uint8_t{0} : field.power[field.log[a] + field.log[b]];
}
constexpr std::uint8_t divide(std::uint8_t a, std::uint8_t b) {
  return a == 0 ? std::uint8_t{0} : field.power[field.log[a] + field_order - field.log[b]];
}
/// beta^exponent
constexpr std::uint8_t beta(unsigned exponent) {
  return field.power[root_step * (exponent % field_order) % field_order];
}

struct Bases {
  std::array<std::uint8_t, 256> to_dual{};
  std::array<std::uint8_t, 256> from_dual{};
};

/// The change of basis is linear; these are the dual forms of alpha^7 down to alpha^0 (annex F, the matrix
/// T_alpha_l).
constexpr std::array<std::uint8_t, 8> dual_of_powers{0x8D, 0xEF, 0xEC, 0x86, 0xFA, 0x99, 0xAF, 0x7B};

constexpr Bases make_bases() {
  Bases bases;
  for (unsigned value = 0; value < 256; ++value) {
    std::uint8_t dual = 0;
    for (unsigned bit = 0; bit < 8; ++bit) {
      if ((value >> bit & 1) != 0) dual ^= dual_of_powers[7 - bit];
    }
    bases.to_dual[value] = dual;
    bases.from_dual[dual] = static_cast<std::uint8_t>(value);
  }
  return bases;
}
constexpr Bases bases = make_bases();

using Parity = std::array<std::uint8_t, rs_parity_octets>;

/// Row f: what the feedback octet f adds to the division register, both in dual basis. Because the change of
/// basis is linear, the whole encoder can stay in dual basis.
using FeedbackTable = std::array<Parity, 256>;

constexpr FeedbackTable make_feedback_table() {
  std::array<std::uint8_t, rs_parity_octets + 1> generator{1};  // coefficient of x^i
  for (unsigned root = 0; root < rs_parity_octets; ++root) {
    for (unsigned i = root + 1; i > 0; --i) {
      generator[i] = generator[i - 1] ^ multiply(generator[i], beta(first_root + root));
    }
    generator[0] = multiply(generator[0], beta(first_root + root));
  }
  FeedbackTable table{};
  for (unsigned value = 0; value < 256; ++value) {
    for (unsigned i = 0; i < rs_parity_octets; ++i) {
      table[value][i] = bases.to_dual[multiply(bases.from_dual[value], generator[rs_parity_octets - 1 - i])];
    }
  }
  return table;
}
constexpr FeedbackTable feedback_table = make_feedback_table();

/// Parity of the octets first, first + stride, ... of @p data.
Parity parity_of(OctetView data, std::size_t first, std::size_t stride) {
  Parity parity{};
  for (std::size_t at = first; at < data.size(); at += stride) {
    const Parity& row = feedback_table[data[at] ^ parity[0]];
    for (std::size_t i = 0; i + 1 < rs_parity_octets; ++i) parity[i] = parity[i + 1] ^ row[i];
    parity[rs_parity_octets - 1] = row[rs_parity_octets - 1];
  }
  return parity;
}

using Syndromes = std::array<std::uint8_t, rs_parity_octets>;
/// Coefficient of x^i at i.
using Polynomial = std::array<std::uint8_t, rs_parity_octets + 1>;

/// A word and its remainder modulo the generator have the same value at the roots of the generator.
/// @param remainder conventional basis, highest power first
Syndromes syndromes_of(const Parity& remainder) {
  Syndromes syndromes{};
  for (unsigned j = 0; j < rs_parity_octets; ++j) {
    const std::uint8_t root = beta(first_root + j);
    std::uint8_t sum = 0;
    for (const std::uint8_t octet : remainder) sum = multiply(sum, root) ^ octet;
    syndromes[j] = sum;
  }
  return syndromes;
}

struct Locator {
  Polynomial coefficients{1};
  unsigned degree = 0;
};

/// Berlekamp-Massey: the shortest feedback register that produces the syndromes.
Locator locate(const Syndromes& syndromes) {
  Locator locator;
  Polynomial previous{1};
  unsigned shift = 1;
  std::uint8_t previous_discrepancy = 1;
  for (unsigned n = 0; n < rs_parity_octets; ++n) {
    std::uint8_t discrepancy = syndromes[n];
    for (unsigned i = 1; i <= locator.degree; ++i) {
      discrepancy ^= multiply(locator.coefficients[i], syndromes[n - i]);
    }
    if (discrepancy == 0) {
      ++shift;
      continue;
    }
    const Polynomial before = locator.coefficients;
    const std::uint8_t factor = divide(discrepancy, previous_discrepancy);
    for (unsigned i = shift; i < before.size(); ++i) {
      locator.coefficients[i] ^= multiply(factor, previous[i - shift]);
    }
    if (2 * locator.degree > n) {
      ++shift;
      continue;
    }
    locator.degree = n + 1 - locator.degree;
    previous = before;
    previous_discrepancy = discrepancy;
    shift = 1;
  }
  return locator;
}

/// Omega(x) = S(x) Lambda(x) mod x^32
Polynomial evaluator(const Syndromes& syndromes, const Locator& locator) {
  Polynomial omega{};
  for (unsigned i = 0; i < rs_parity_octets; ++i) {
    for (unsigned k = 0; k <= std::min(i, locator.degree); ++k) {
      omega[i] ^= multiply(locator.coefficients[k], syndromes[i - k]);
    }
  }
  return omega;
}

std::uint8_t evaluate(const Polynomial& polynomial, std::uint8_t x) {
  std::uint8_t sum = 0;
  for (std::size_t i = polynomial.size(); i-- > 0;) sum = multiply(sum, x) ^ polynomial[i];
  return sum;
}

/// Lambda'(x): in characteristic 2 only the odd powers remain.
std::uint8_t evaluate_derivative(const Polynomial& polynomial, std::uint8_t x) {
  const std::uint8_t square = multiply(x, x);
  std::uint8_t sum = 0;
  for (std::size_t i = rs_parity_octets - 1; i < polynomial.size(); i -= 2)
    sum = multiply(sum, square) ^ polynomial[i];
  return sum;
}

/// Corrects @p word (conventional basis, highest power first) in place; nullopt if it has too many errors.
/// @param remainder of the word, not zero
std::optional<unsigned> correct(std::span<std::uint8_t> word, const Parity& remainder) {
  const Syndromes syndromes = syndromes_of(remainder);
  const Locator locator = locate(syndromes);
  if (locator.degree > rs_correctable_octets) return std::nullopt;
  const Polynomial omega = evaluator(syndromes, locator);

  // Chien search over the places that exist; a root in the virtual fill leaves the count short and so is a
  // failure.
  struct Correction {
    std::size_t index;
    std::uint8_t value;
  };
  std::array<Correction, rs_correctable_octets> corrections{};
  unsigned found = 0;
  for (std::size_t index = 0; index < word.size() && found < locator.degree; ++index) {
    const auto power = static_cast<unsigned>(word.size() - 1 - index);
    const std::uint8_t inverse = beta(field_order - power);
    if (evaluate(locator.coefficients, inverse) != 0) continue;
    const std::uint8_t slope = evaluate_derivative(locator.coefficients, inverse);
    if (slope == 0) return std::nullopt;
    // Forney: X^(1 - first_root) Omega(1/X) / Lambda'(1/X)
    const std::uint8_t scale = beta((first_root - 1) * (field_order - power));
    corrections[found++] = {index, multiply(scale, divide(evaluate(omega, inverse), slope))};
  }
  if (found != locator.degree) return std::nullopt;
  for (unsigned i = 0; i < found; ++i) word[corrections[i].index] ^= corrections[i].value;
  return found;
}

}  // namespace

std::string_view to_string(RsError error) {
  switch (error) {
    case RsError::uncorrectable:
      return "more errors than the code can correct";
  }
  return "?";
}

Octets rs_encode(OctetView data, unsigned interleave) {
  assert(rs_fits(data.size(), interleave));
  Octets codeblock(data.begin(), data.end());
  codeblock.resize(data.size() + rs_parity_octets * interleave);
  for (unsigned codeword = 0; codeword < interleave; ++codeword) {
    const Parity parity = parity_of(data, codeword, interleave);
    for (std::size_t i = 0; i < rs_parity_octets; ++i)
      codeblock[data.size() + i * interleave + codeword] = parity[i];
  }
  return codeblock;
}

Result<RsDecoded, RsError> rs_decode(OctetView codeblock, unsigned interleave) {
  assert(codeblock.size() > rs_parity_octets * interleave);
  const std::size_t data_octets = codeblock.size() - rs_parity_octets * interleave;
  assert(rs_fits(data_octets, interleave));
  const OctetView data = codeblock.first(data_octets);
  RsDecoded decoded{.data = Octets(data.begin(), data.end())};

  for (unsigned codeword = 0; codeword < interleave; ++codeword) {
    // Most words arrive unharmed; encoding again is much cheaper than 32 syndromes.
    Parity remainder = parity_of(data, codeword, interleave);
    bool unharmed = true;
    for (std::size_t i = 0; i < rs_parity_octets; ++i) {
      remainder[i] = bases.from_dual[remainder[i] ^ codeblock[data_octets + i * interleave + codeword]];
      unharmed = unharmed && remainder[i] == 0;
    }
    if (unharmed) continue;

    std::array<std::uint8_t, rs_codeword_octets> buffer{};
    const auto word = std::span(buffer).first(codeblock.size() / interleave);
    for (std::size_t i = 0; i < word.size(); ++i)
      word[i] = bases.from_dual[codeblock[i * interleave + codeword]];
    const auto corrected = correct(word, remainder);
    if (!corrected) return Err(RsError::uncorrectable);
    decoded.corrected_octets += *corrected;
    for (std::size_t i = 0; i < data_octets / interleave; ++i) {
      decoded.data[i * interleave + codeword] = bases.to_dual[word[i]];
    }
  }
  return decoded;
}

}  // namespace srfs::wire
