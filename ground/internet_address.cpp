// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/internet_address.hpp"

#include <array>
#include <cstdint>

#include <arpa/inet.h>
#include <fmt/format.h>

#include "base/text.hpp"

namespace srfs::ground {

std::optional<sockaddr_in> parse_internet_address(std::string_view text) {
  const std::size_t colon = text.rfind(':');
  const std::string host(colon == std::string_view::npos ? "127.0.0.1" : text.substr(0, colon));
  const std::string_view port = colon == std::string_view::npos ? text : text.substr(colon + 1);
  const auto number = to_number<std::uint16_t>(port);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  if (!number || inet_pton(AF_INET, host.c_str(), &address.sin_addr) != 1) return std::nullopt;
  address.sin_port = htons(*number);
  return address;
}

std::string to_text(const sockaddr_in& address) {
  std::array<char, INET_ADDRSTRLEN> host{};
  inet_ntop(AF_INET, &address.sin_addr, host.data(), host.size());
  return fmt::format("{}:{}", host.data(), ntohs(address.sin_port));
}

}  // namespace srfs::ground
