// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "ground/api/http.hpp"
#include "ground/time_tag.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs::ground::api {

/// A telecommand as the body of a request orders it; it can be encoded.
struct TelecommandRequest {
  std::string name;
  std::vector<std::string> arguments;  ///< key=value
  std::optional<TimeTag> at;
  bool arm = false;
  bool ad = false;
  bool check = false;  ///< encode alone
  std::string token;   ///< unique, of a request that may be repeated; empty: it is not
  Octets encoded;      ///< packet data after the PUS header
};

/// {name, arguments {name: text | number | bool | null}, at?, arm?, ad?, check?, confirm?}. Refused: what
/// encode() refuses, a hazardous telecommand that is not armed (409), one that is armed without its name
/// typed again in `confirm` (400). Pure.
[[nodiscard]] Result<TelecommandRequest, HttpResponse> read_telecommand(
    const std::string& body, const mission::Dictionary& dictionary);

/// An object of a request's body; the error is the answer.
[[nodiscard]] Result<nlohmann::json, HttpResponse> read_object(const std::string& body);

}  // namespace srfs::ground::api
