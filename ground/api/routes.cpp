// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/routes.hpp"

#include <array>

namespace srfs::ground::api {
namespace {

constexpr std::uint64_t order_octets_max = 65'536;
constexpr std::uint64_t file_octets_max = RequestReader::body_octets_max;

using enum Endpoint;
constexpr std::array table{
    Route{"GET", "dictionary", dictionary, Role::observer},
    Route{"GET", "station", station, Role::observer},
    Route{"GET", "latest", latest, Role::observer},
    Route{"GET", "stream", stream, Role::observer, 0, true},
    Route{"GET", "history", history, Role::observer},
    Route{"GET", "packets", packets, Role::observer},
    Route{"GET", "events", events, Role::observer},
    Route{"POST", "events/{}/acknowledge", acknowledge, Role::commander, order_octets_max},
    Route{"GET", "commands", commands, Role::observer},
    Route{"GET", "gaps", gaps, Role::observer},
    Route{"POST", "gaps/fill", fill_gaps, Role::commander, order_octets_max},
    Route{"GET", "passes", passes, Role::observer},
    Route{"GET", "transfers", transfers, Role::observer},
    Route{"POST", "transfers/{}", order_transfer, Role::commander, order_octets_max},
    Route{"GET", "files", files, Role::observer},
    Route{"GET", "files/{}", file, Role::observer, 0, true},
    Route{"GET", "schedule", schedule, Role::observer},
    Route{"POST", "telecommands", telecommand, Role::commander, order_octets_max},
    Route{"POST", "uplink", uplink, Role::commander, file_octets_max},
    Route{"POST", "retrieve", retrieve, Role::commander, order_octets_max},
    Route{"POST", "cop", order_cop, Role::commander, order_octets_max},
    Route{"POST", "keys", select_keys, Role::commander, order_octets_max},
};

constexpr std::size_t prefix_segments = 2;  // api, v1

/// Whether the segments behind the prefix are those of a route; its parameter is taken.
bool matches(std::string_view path, const std::vector<std::string>& segments, std::string& parameter) {
  std::size_t at = prefix_segments;
  for (std::size_t begin = 0; begin <= path.size(); ++at) {
    const std::size_t end = std::min(path.find('/', begin), path.size());
    const std::string_view part = path.substr(begin, end - begin);
    if (at >= segments.size()) return false;
    if (part == "{}") {
      if (segments[at].empty()) return false;
      parameter = segments[at];
    } else if (part != segments[at]) {
      return false;
    }
    begin = end + 1;
  }
  return at == segments.size();
}

}  // namespace

std::span<const Route> routes() {
  return table;
}

bool is_api(const Target& target) {
  return target.segments.front() == "api";
}

std::variant<Found, NotFound, WrongMethod> route_of(std::string_view method, const Target& target) {
  if (target.segments.size() < prefix_segments || target.segments[1] != "v1") return NotFound{};
  WrongMethod wrong;
  for (const Route& route : table) {
    Found found{&route, ""};
    if (!matches(route.path, target.segments, found.parameter)) continue;
    if (route.method == method) return found;
    wrong.allowed += (wrong.allowed.empty() ? "" : ", ") + std::string(route.method);
  }
  if (wrong.allowed.empty()) return NotFound{};
  return wrong;
}

}  // namespace srfs::ground::api
