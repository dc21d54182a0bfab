// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/result.hpp"

namespace srfs::ground::api {

/// What a request is refused for, before its route sees it.
struct HttpRefusal {
  int status = 400;
  std::string why;  ///< for people; becomes {"error": why}
};

/// A request's target, decoded.
struct Target {
  std::vector<std::string> segments;         ///< of the path; none is empty but the last, "." or ".."
  std::map<std::string, std::string> query;  ///< of several with a name, the last
};
/// The error: why it is none. What is decoded holds no control characters, and no segment a slash.
[[nodiscard]] Result<Target, std::string> parse_target(std::string_view target);

struct HttpRequest {
  std::string method;
  Target target;
  std::string host;
  std::string origin;  ///< empty: none
  std::string authorization;
  std::string last_event_id;
  std::string idempotency_key;  ///< empty: none
  std::optional<std::uint64_t> content_octets;
  bool keep_alive = true;
  std::string body;
};

struct HttpResponse {
  int status = 200;
  std::string type = "application/json";
  std::string body;
  std::map<std::string, std::string> headers = {};
};
[[nodiscard]] HttpResponse json_response(int status, const nlohmann::json& json);
/// {"error": why}
[[nodiscard]] HttpResponse error_response(int status, const std::string& why);
/// {"error": why, "outcome": "unknown"}: whether the order was carried out is not known.
inline constexpr int unknown_outcome = 504;
[[nodiscard]] HttpResponse unknown_response(const std::string& why);
/// Status line and header fields, with those that protect a browser.
[[nodiscard]] std::string head_of(const HttpResponse& response, std::size_t octets, bool keep_alive);
/// The head of a response whose end is that of the connection.
[[nodiscard]] std::string stream_head(std::string_view type);

/// Reads one request of a connection, octets as they come (HTTP/1.1, Boost.Beast). Bounds: the head has at
/// most head_octets_max; the body has a stated length, at most what admit() allows. Chunked bodies, content
/// codings and repeated fields that matter are refused. Pure.
class RequestReader {
 public:
  static constexpr std::size_t head_octets_max = 16'384;
  static constexpr std::uint64_t body_octets_max = 64U << 20;

  RequestReader();
  ~RequestReader();
  RequestReader(const RequestReader&) = delete;
  RequestReader& operator=(const RequestReader&) = delete;

  enum class State : std::uint8_t {
    head,      ///< more octets are needed
    admitted,  ///< the head is there; body() has not been allowed yet
    body,      ///< more octets of the body are needed
    complete
  };
  /// Takes octets from the front of @p input, which keeps the others. An error ends the connection.
  [[nodiscard]] Result<State, HttpRefusal> take(std::string& input);
  /// The head, from State::admitted on; with State::complete the body is in it.
  [[nodiscard]] HttpRequest& request() { return request_; }
  /// After State::admitted: the body may come. take() goes on.
  void admit_body() { body_admitted_ = true; }

 private:
  struct Parser;
  [[nodiscard]] std::optional<HttpRefusal> read_head();
  std::unique_ptr<Parser> parser_;
  HttpRequest request_;
  bool has_head_ = false;
  bool body_admitted_ = false;
};

}  // namespace srfs::ground::api
