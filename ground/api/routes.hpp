// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "ground/api/access.hpp"

namespace srfs::ground::api {

enum class Endpoint : std::uint8_t {
  dictionary,
  station,
  latest,
  stream,
  history,
  packets,
  events,
  commands,
  gaps,
  passes,
  transfers,
  files,
  file,
  schedule,
  telecommand,
  uplink,
  order_transfer,
  retrieve,
  fill_gaps,
  order_cop,
  select_keys,
  acknowledge,
};

/// What the API answers. ground/web/openapi.yaml describes the same; a test compares them.
struct Route {
  std::string_view method;
  std::string_view path;  ///< below /api/v1; "{}" is one segment, the route's parameter
  Endpoint endpoint;
  Role role;
  std::uint64_t body_max = 0;
  bool token_in_query = false;
};
[[nodiscard]] std::span<const Route> routes();

struct Found {
  const Route* route = nullptr;
  std::string parameter;
};
struct NotFound {};
struct WrongMethod {
  std::string allowed;  ///< "GET, POST"
};
/// The route of a target below /api/v1.
[[nodiscard]] std::variant<Found, NotFound, WrongMethod> route_of(std::string_view method,
                                                                  const Target& target);

/// Whether a target is one of the API, and not of the page.
[[nodiscard]] bool is_api(const Target& target);

}  // namespace srfs::ground::api
