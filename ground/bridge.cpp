// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/bridge.hpp"

#include <algorithm>
#include <array>
#include <cerrno>

#include <fmt/format.h>
#include <sys/socket.h>

#include "wire/cltu.hpp"
#include "wire/crc16.hpp"
#include "wire/tc_frame.hpp"

namespace srfs::ground {
namespace {

constexpr std::size_t longest_cltu = wire::cltu_start_sequence.size() +
                                     (wire::tc_frame_octets_max + wire::bch_information_octets - 1) /
                                         wire::bch_information_octets * wire::bch_block_octets +
                                     wire::cltu_tail_sequence.size();

}  // namespace

std::string_view to_text(DatagramError error) {
  switch (error) {
    case DatagramError::too_short:
      return "too short";
    case DatagramError::too_long:
      return "too long";
    case DatagramError::not_a_frame:
      return "neither a CLTU nor a TC transfer frame";
    case DatagramError::bad_fecf:
      return "frame error control is wrong";
  }
  return "?";
}

Result<Octets, DatagramError> uplink_octets(OctetView datagram, bool randomize) {
  if (datagram.size() < wire::tc_frame_octets_min) return Err(DatagramError::too_short);
  if (std::equal(wire::cltu_start_sequence.begin(), wire::cltu_start_sequence.end(), datagram.begin())) {
    if (datagram.size() > longest_cltu) return Err(DatagramError::too_long);
    return Octets(datagram.begin(), datagram.end());
  }
  if (datagram.size() > wire::tc_frame_octets_max) return Err(DatagramError::too_long);
  if (datagram[0] >> 6 != 0 || wire::tc_frame_octets(datagram) != datagram.size())
    return Err(DatagramError::not_a_frame);
  if (wire::crc16(datagram) != 0) return Err(DatagramError::bad_fecf);
  return wire::encode_cltu(datagram, randomize);
}

nlohmann::json to_json(const BridgeCounters& c) {
  return {{"type", "bridge"},        {"tm_frames", c.tm_frames},       {"tm_unsent", c.tm_unsent},
          {"tm_bad", c.tm_bad},      {"tc_datagrams", c.tc_datagrams}, {"tc_refused", c.tc_refused},
          {"tc_unsent", c.tc_unsent}};
}

Result<Bridge, std::string> Bridge::open(const suite::LinkSettings& link, std::unique_ptr<OctetLine> line,
                                         const sockaddr_in& tm, const sockaddr_in& tc) {
  Fd socket(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!socket) return Err(fmt::format("cannot create a socket: {}", errno_text(errno)));
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&tc), sizeof tc) != 0)
    return Err(fmt::format("{}: cannot receive the uplink there: {}", to_text(tc), errno_text(errno)));
  return Bridge(link, std::move(line), std::move(socket), tm);
}

Bridge::Bridge(const suite::LinkSettings& link, std::unique_ptr<OctetLine> line, Fd socket,
               const sockaddr_in& tm)
    : line_(std::move(line)),
      socket_(std::move(socket)),
      tm_(tm),
      randomize_uplink_(link.tc_randomizer),
      synchroniser_({.frame_octets = static_cast<std::size_t>(link.tm_frame_length),
                     .reed_solomon = link.tm_reed_solomon,
                     .interleave = static_cast<unsigned>(link.tm_interleave),
                     .randomize = link.tm_randomizer}),
      decoder_(static_cast<std::uint16_t>(link.spacecraft_id),
               static_cast<std::size_t>(link.tm_frame_length)) {}

Result<void, std::string> Bridge::on_line() {
  const auto octets = line_->read();
  if (!octets) return Err(octets.error());
  const std::uint64_t rejected = synchroniser_.counters().rejected;
  for (const auto& cadu : synchroniser_.push(*octets)) {
    if (!decoder_.decode(cadu.frame)) {
      ++counters_.tm_bad;
      continue;
    }
    const auto put = ::sendto(socket_.get(), cadu.frame.data(), cadu.frame.size(), MSG_NOSIGNAL,
                              reinterpret_cast<const sockaddr*>(&tm_), sizeof tm_);
    ++(put == static_cast<ssize_t>(cadu.frame.size()) ? counters_.tm_frames : counters_.tm_unsent);
  }
  counters_.tm_bad += synchroniser_.counters().rejected - rejected;
  return {};
}

void Bridge::on_socket() {
  std::array<std::uint8_t, 2048> buffer{};
  for (std::size_t turn = 0; turn < datagrams_a_turn; ++turn) {
    const ssize_t got = ::recv(socket_.get(), buffer.data(), buffer.size(), MSG_TRUNC);
    if (got < 0) return;  // none there
    const auto octets = static_cast<std::size_t>(got);
    if (octets > buffer.size()) {
      ++counters_.tc_refused;
      continue;
    }
    const auto line = uplink_octets(OctetView(buffer).first(octets), randomize_uplink_);
    if (!line) {
      ++counters_.tc_refused;
      continue;
    }
    ++(line_->write(*line, write_patience) ? counters_.tc_datagrams : counters_.tc_unsent);
  }
}

sockaddr_in Bridge::uplink_address() const {
  sockaddr_in address{};
  socklen_t length = sizeof address;
  ::getsockname(socket_.get(), reinterpret_cast<sockaddr*>(&address), &length);
  return address;
}

}  // namespace srfs::ground
