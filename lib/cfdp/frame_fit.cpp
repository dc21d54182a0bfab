// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/frame_fit.hpp"

#include <algorithm>
#include <cmath>

namespace srfs::cfdp {
namespace {

constexpr double memory_octets = 32'768;
/// A PDU is not begun in a rest of a frame that is shorter than its headers and this.
constexpr std::size_t file_octets_min = 64;

}  // namespace

void FrameFit::on_sent(const FrameFill& frame, std::size_t pdu_octets, std::size_t file_octets) {
  if (frame.octets == 0) return;
  if (sent_octets_ > memory_octets) {
    for (double* sum : {&sent_octets_, &lost_octets_, &pdus_, &frames_}) *sum /= 2;
  }
  sent_octets_ += static_cast<double>(file_octets);
  pdus_ += 1;
  frames_ += std::ceil(static_cast<double>(frame.filled + pdu_octets + frame.overhead) /
                       static_cast<double>(frame.octets));
}

double FrameFit::frame_loss() const {
  if (lost_octets_ <= 0 || pdus_ <= 0) return 0;
  // What was asked for may have been sent before these.
  const double pdu_loss = std::min(lost_octets_ / sent_octets_, 0.95);
  return 1 - std::pow(1 - pdu_loss, pdus_ / frames_);
}

std::size_t FrameFit::file_octets(const FrameFill& frame, std::size_t header_octets, std::size_t most) const {
  if (frame.octets == 0) return most;
  const double arrives = 1 - frame_loss();
  const std::size_t headers = header_octets + frame.overhead;
  const double longest = static_cast<double>(most + headers);
  const auto field = static_cast<double>(frame.octets);
  // Octets of the file that arrive for an octet sent. The longest begins anywhere in a frame.
  double best = static_cast<double>(most) / longest * std::pow(arrives, longest / field + 1);
  std::size_t frames = 0;
  for (std::size_t k = 1; k * frame.octets <= most + headers; ++k) {
    if (k * frame.octets < headers + file_octets_min) continue;
    const double octets = static_cast<double>(k) * field;
    const double yield = (octets - static_cast<double>(headers)) / octets * std::pow(arrives, k);
    if (yield <= best) continue;
    best = yield;
    frames = k;
  }
  if (frames == 0) return most;
  const std::size_t rest = frame.octets - frame.filled;
  const std::size_t octets =
      rest + (rest >= headers + file_octets_min ? frames - 1 : frames) * frame.octets - headers;
  return std::min(octets, most);
}

}  // namespace srfs::cfdp
