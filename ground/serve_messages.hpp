// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "ground/station_link.hpp"
#include "ground/station_status.hpp"

namespace srfs::ground {

/// Messages between `srfs-ground serve` and its clients: one JSON object a message, over a UNIX socket that
/// keeps messages apart (SOCK_SEQPACKET). ground/README.md lists them. The functions that read one throw
/// nlohmann::json::exception or std::invalid_argument; who reads from a socket catches them at the border.
namespace serve {

inline constexpr int protocol = 1;
/// A packet has at most 65542 octets, in hexadecimal; longer messages are rejected.
inline constexpr std::size_t message_octets_max = 160'000;
inline constexpr std::string_view socket_name = "serve.sock";  ///< in STATE

[[nodiscard]] nlohmann::json to_message(const ReceivedPacket& received);
[[nodiscard]] nlohmann::json to_message(const SeenTelecommand& seen);
[[nodiscard]] nlohmann::json to_message(const CopReport& report);
[[nodiscard]] nlohmann::json to_message(const DownlinkCounters& counters);
[[nodiscard]] nlohmann::json to_message(const cfdp::Report& report);
[[nodiscard]] nlohmann::json to_message(const cfdp::News& news);
[[nodiscard]] nlohmann::json to_message(const std::vector<cfdp::Report>& transfers);
[[nodiscard]] nlohmann::json to_message(wire::RequestId request);

[[nodiscard]] ReceivedPacket packet_of(const nlohmann::json& message);
[[nodiscard]] SeenTelecommand telecommand_of(const nlohmann::json& message);
[[nodiscard]] CopReport cop_of(const nlohmann::json& message);
[[nodiscard]] DownlinkCounters counters_of(const nlohmann::json& message);
[[nodiscard]] cfdp::News news_of(const nlohmann::json& message);
[[nodiscard]] std::vector<cfdp::Report> transfers_of(const nlohmann::json& message);
[[nodiscard]] wire::RequestId request_of(const nlohmann::json& message);
[[nodiscard]] Octets octets_of(const nlohmann::json& hexadecimal);
[[nodiscard]] AdProgress ad_progress_of(const nlohmann::json& message);
[[nodiscard]] std::string_view to_text(AdProgress progress);

/// What a welcome says of the server; nullopt: it is of another version.
[[nodiscard]] std::optional<ServerStatus> status_of(const nlohmann::json& welcome);

/// As it goes over the socket.
[[nodiscard]] std::string text_of(const nlohmann::json& message);

}  // namespace serve

}  // namespace srfs::ground
