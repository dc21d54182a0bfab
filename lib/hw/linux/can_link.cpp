// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw/linux/can_link.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <string_view>

#include <linux/can/netlink.h>
#include <linux/if_link.h>
#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <sys/socket.h>

#include "base/fd.hpp"
#include "base/text.hpp"

namespace srfs::hw {
namespace {

constexpr std::size_t alignment = 4;  // of messages and attributes

template <class T>
void put(Octets& out, const T& value) {
  const auto* octets = reinterpret_cast<const std::uint8_t*>(&value);
  out.insert(out.end(), octets, octets + sizeof value);
}
void pad(Octets& out) {
  while (out.size() % alignment != 0) out.push_back(0);
}

/// Begins an attribute; end_attribute() writes its length.
std::size_t begin_attribute(Octets& out, std::uint16_t type) {
  const std::size_t at = out.size();
  put(out, rtattr{.rta_len = 0, .rta_type = type});
  return at;
}
void end_attribute(Octets& out, std::size_t at) {
  const auto length = static_cast<std::uint16_t>(out.size() - at);
  std::memcpy(&out[at], &length, sizeof length);
  pad(out);
}

Octets begin_message(std::uint16_t type, std::uint16_t flags, std::uint32_t sequence, const ifinfomsg& body) {
  Octets out;
  put(out,
      nlmsghdr{
          .nlmsg_len = 0, .nlmsg_type = type, .nlmsg_flags = flags, .nlmsg_seq = sequence, .nlmsg_pid = 0});
  put(out, body);
  return out;
}
Octets end_message(Octets out) {
  const auto length = static_cast<std::uint32_t>(out.size());
  std::memcpy(out.data(), &length, sizeof length);
  return out;
}

ifinfomsg about(int interface) {
  ifinfomsg body{};
  body.ifi_family = AF_UNSPEC;
  body.ifi_index = interface;
  return body;
}

template <class T>
std::optional<T> take(OctetView from) {
  if (from.size() < sizeof(T)) return std::nullopt;
  T value;
  std::memcpy(&value, from.data(), sizeof value);
  return value;
}

/// The content of the first attribute of this type among those in @p list; empty: none.
OctetView find(OctetView list, std::uint16_t type) {
  while (const auto head = take<rtattr>(list)) {
    if (head->rta_len < sizeof(rtattr) || head->rta_len > list.size()) return {};
    if ((head->rta_type & NLA_TYPE_MASK) == type)
      return list.subspan(sizeof(rtattr), head->rta_len - sizeof(rtattr));
    const std::size_t whole = (head->rta_len + alignment - 1) / alignment * alignment;
    if (whole > list.size()) return {};
    list = list.subspan(whole);
  }
  return {};
}

/// The content of the one message in @p answer, if it is of @p type; else the errno.
Result<OctetView, int> content(OctetView answer, std::uint32_t sequence, std::uint16_t type) {
  const auto head = take<nlmsghdr>(answer);
  if (!head || head->nlmsg_len < sizeof(nlmsghdr) || head->nlmsg_len > answer.size() ||
      head->nlmsg_seq != sequence)
    return Err(EBADMSG);
  const OctetView body = answer.subspan(sizeof(nlmsghdr), head->nlmsg_len - sizeof(nlmsghdr));
  if (head->nlmsg_type == NLMSG_ERROR) {
    const auto error = take<int>(body);
    if (!error || *error > 0) return Err(EBADMSG);
    if (*error != 0) return Err(-*error);
  }
  if (head->nlmsg_type != type) return Err(EBADMSG);
  return body;
}

std::optional<CanBusState> state_of(std::uint32_t state) {
  switch (state) {
    case CAN_STATE_ERROR_ACTIVE:
      return CanBusState::active;
    case CAN_STATE_ERROR_WARNING:
      return CanBusState::warning;
    case CAN_STATE_ERROR_PASSIVE:
      return CanBusState::passive;
    case CAN_STATE_BUS_OFF:
      return CanBusState::bus_off;
    case CAN_STATE_STOPPED:
    case CAN_STATE_SLEEPING:
      return CanBusState::down;
    default:
      return std::nullopt;
  }
}

Result<Fd, int> say(const Octets& messages) {
  Fd socket(::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, NETLINK_ROUTE));
  if (!socket) return Err(errno);
  sockaddr_nl kernel{};
  kernel.nl_family = AF_NETLINK;
  if (::sendto(socket.get(), messages.data(), messages.size(), 0, reinterpret_cast<const sockaddr*>(&kernel),
               sizeof kernel) < 0)
    return Err(errno);
  return socket;
}

/// rtnetlink works within the call that says something, so the answer is there when that returns.
Result<Octets, int> hear(const Fd& socket) {
  Octets answer(16384);
  const ssize_t n = ::recv(socket.get(), answer.data(), answer.size(), 0);
  if (n < 0) return Err(errno);
  answer.resize(static_cast<std::size_t>(n));
  return answer;
}

Result<Octets, int> ask(const Octets& message) {
  const auto socket = say(message);
  if (!socket) return Err(socket.error());
  return hear(*socket);
}

Result<void, int> command(const Octets& message, std::uint32_t sequence) {
  const auto answer = ask(message);
  if (!answer) return Err(answer.error());
  return decode_acknowledgement(*answer, sequence);
}

}  // namespace

Octets encode_link_query(int interface, std::uint32_t sequence) {
  return end_message(begin_message(RTM_GETLINK, NLM_F_REQUEST, sequence, about(interface)));
}

Octets encode_can_restart(int interface, std::uint32_t sequence) {
  constexpr std::string_view kind = "can";
  Octets out = begin_message(RTM_NEWLINK, NLM_F_REQUEST | NLM_F_ACK, sequence, about(interface));
  const std::size_t info = begin_attribute(out, IFLA_LINKINFO);
  const std::size_t name = begin_attribute(out, IFLA_INFO_KIND);
  out.insert(out.end(), kind.begin(), kind.end());
  end_attribute(out, name);
  const std::size_t settings = begin_attribute(out, IFLA_INFO_DATA);
  const std::size_t restart = begin_attribute(out, IFLA_CAN_RESTART);
  put(out, std::uint32_t{1});
  end_attribute(out, restart);
  end_attribute(out, settings);
  end_attribute(out, info);
  return end_message(std::move(out));
}

Octets encode_link_up(int interface, bool up, std::uint32_t sequence) {
  ifinfomsg body = about(interface);
  body.ifi_flags = up ? IFF_UP : 0;
  body.ifi_change = IFF_UP;
  return end_message(begin_message(RTM_NEWLINK, NLM_F_REQUEST | NLM_F_ACK, sequence, body));
}

Result<CanLink, int> decode_link(OctetView answer, std::uint32_t sequence) {
  const auto body = content(answer, sequence, RTM_NEWLINK);
  if (!body) return Err(body.error());
  if (body->size() < sizeof(ifinfomsg)) return Err(EBADMSG);
  const OctetView attributes = body->subspan(sizeof(ifinfomsg));
  const OctetView info = find(attributes, IFLA_LINKINFO);
  const OctetView kind = find(info, IFLA_INFO_KIND);
  CanLink link;
  if (const auto carrier = take<std::uint8_t>(find(attributes, IFLA_CARRIER))) link.carrier = *carrier != 0;
  // Other kinds number their attributes otherwise. The kernel's strings end with NUL.
  if (as_text(kind).substr(0, 4) != std::string_view("can", 4)) return link;
  const OctetView can = find(info, IFLA_INFO_DATA);
  if (const auto state = take<std::uint32_t>(find(can, IFLA_CAN_STATE))) link.state = state_of(*state);
  link.restart_ms = take<std::uint32_t>(find(can, IFLA_CAN_RESTART_MS));
  const auto timing = take<can_bittiming>(find(can, IFLA_CAN_BITTIMING));
  if (timing && timing->bitrate > 0) link.bit_rate = timing->bitrate;
  if (const auto errors = take<can_berr_counter>(find(can, IFLA_CAN_BERR_COUNTER))) {
    link.transmit_errors = errors->txerr;
    link.receive_errors = errors->rxerr;
  }
  return link;
}

Result<void, int> decode_acknowledgement(OctetView answer, std::uint32_t sequence) {
  const auto body = content(answer, sequence, NLMSG_ERROR);
  if (!body) return Err(body.error());
  return {};
}

Result<CanLink, int> query_can_link(int interface) {
  const auto answer = ask(encode_link_query(interface, 1));
  if (!answer) return Err(answer.error());
  return decode_link(*answer, 1);
}

Result<void, int> restart_can_controller(int interface) {
  return command(encode_can_restart(interface, 1), 1);
}

LinkCycle cycle_can_link(int interface) {
  Octets both = encode_link_up(interface, false, 1);
  const Octets up = encode_link_up(interface, true, 2);
  both.insert(both.end(), up.begin(), up.end());
  const auto socket = say(both);
  if (!socket) return {Err(socket.error()), Err(socket.error())};
  const auto heard = [&](std::uint32_t sequence) -> Result<void, int> {
    const auto answer = hear(*socket);
    if (!answer) return Err(answer.error());
    return decode_acknowledgement(*answer, sequence);
  };
  Result<void, int> down = heard(1);
  return {std::move(down), heard(2)};
}

Result<void, int> set_can_link_up(int interface) {
  return command(encode_link_up(interface, true, 1), 1);
}

}  // namespace srfs::hw
