// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/http.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <boost/asio/buffer.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/status.hpp>
#include <boost/beast/http/string_body.hpp>

namespace srfs::ground::api {
namespace http = boost::beast::http;
namespace {

std::string text_of(boost::beast::string_view text) {
  return {text.data(), text.size()};
}

int digit_of(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

/// nullopt: not percent-encoded text without control characters.
std::optional<std::string> decoded(std::string_view text, bool query) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '%') {
      if (i + 2 >= text.size()) return std::nullopt;
      const int high = digit_of(text[i + 1]);
      const int low = digit_of(text[i + 2]);
      if (high < 0 || low < 0) return std::nullopt;
      c = static_cast<char>(high * 16 + low);
      i += 2;
    } else if (query && c == '+') {
      c = ' ';
    }
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) return std::nullopt;
    out += c;
  }
  return out;
}

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (std::size_t begin = 0;;) {
    const std::size_t end = text.find(separator, begin);
    parts.push_back(text.substr(begin, end - begin));
    if (end == std::string_view::npos) return parts;
    begin = end + 1;
  }
}

constexpr const char* key_field = "Idempotency-Key";

/// Of the fields that decide something a request has one at most.
constexpr std::array single_fields{
    http::field::host,           http::field::origin,           http::field::authorization,
    http::field::content_length, http::field::content_encoding, http::field::transfer_encoding};

}  // namespace

Result<Target, std::string> parse_target(std::string_view text) {
  Target target;
  const std::size_t question = text.find('?');
  const std::string_view path = text.substr(0, question);
  if (!path.starts_with('/')) return Err(std::string("the target begins with no slash"));
  const auto parts = split(path.substr(1), '/');
  for (const std::string_view& part : parts) {
    const auto segment = decoded(part, false);
    if (!segment) return Err(std::string("the path is not percent-encoded text"));
    const bool bad =
        *segment == "." || *segment == ".." || segment->find_first_of("/\\") != std::string::npos;
    if (bad || (segment->empty() && &part != &parts.back()))
      return Err(std::string("a part of the path is empty, '.', '..', or has a slash"));
    target.segments.push_back(*segment);
  }
  if (question == std::string_view::npos) return target;
  for (const std::string_view pair : split(text.substr(question + 1), '&')) {
    if (pair.empty()) continue;
    const std::size_t equals = std::min(pair.find('='), pair.size());
    const auto name = decoded(pair.substr(0, equals), true);
    const auto value = decoded(pair.substr(std::min(equals + 1, pair.size())), true);
    if (!name || !value) return Err(std::string("the query is not percent-encoded text"));
    target.query[*name] = *value;
  }
  return target;
}

HttpResponse json_response(int status, const nlohmann::json& json) {
  return {.status = status,
          .body = json.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace) + "\n"};
}

HttpResponse error_response(int status, const std::string& why) {
  return json_response(status, {{"error", why}});
}

HttpResponse unknown_response(const std::string& why) {
  return json_response(unknown_outcome, {{"error", why}, {"outcome", "unknown"}});
}

namespace {

std::string common_head(int status, std::string_view type) {
  const auto reason = text_of(http::obsolete_reason(static_cast<http::status>(status)));
  return fmt::format(
      "HTTP/1.1 {} {}\r\nContent-Type: {}\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: "
      "no-referrer\r\n"
      "X-Frame-Options: DENY\r\nContent-Security-Policy: default-src 'self'; frame-ancestors 'none'; "
      "base-uri "
      "'none'; form-action 'none'\r\nCross-Origin-Resource-Policy: same-origin\r\n",
      status, reason, type);
}

}  // namespace

std::string head_of(const HttpResponse& response, std::size_t octets, bool keep_alive) {
  std::string head = common_head(response.status, response.type);
  if (!response.headers.contains("Cache-Control")) head += "Cache-Control: no-store\r\n";
  for (const auto& [name, value] : response.headers) head += fmt::format("{}: {}\r\n", name, value);
  return head + fmt::format("Content-Length: {}\r\nConnection: {}\r\n\r\n", octets,
                            keep_alive ? "keep-alive" : "close");
}

std::string stream_head(std::string_view type) {
  return common_head(200, type) + "Cache-Control: no-store\r\nConnection: close\r\n\r\n";
}

struct RequestReader::Parser : http::request_parser<http::string_body> {};

RequestReader::RequestReader() : parser_(std::make_unique<Parser>()) {
  parser_->header_limit(head_octets_max);
  parser_->body_limit(body_octets_max);
}

RequestReader::~RequestReader() = default;

std::optional<HttpRefusal> RequestReader::read_head() {
  const auto& message = parser_->get();
  for (const auto field : single_fields) {
    if (message.count(field) > 1) return HttpRefusal{400, "a header field is there twice"};
  }
  if (message.count(key_field) > 1) return HttpRefusal{400, "a header field is there twice"};
  if (parser_->chunked() || message.count(http::field::transfer_encoding) != 0)
    return HttpRefusal{411, "a body needs Content-Length"};
  if (message.count(http::field::content_encoding) != 0)
    return HttpRefusal{415, "a body is sent as it is, without a content coding"};
  if (message.count(http::field::expect) != 0) return HttpRefusal{417, "Expect is not supported"};
  if (message.version() != 11 && message.version() != 10) return HttpRefusal{505, "HTTP/1.1 is spoken here"};
  const auto text = message.target();
  auto target = parse_target({text.data(), text.size()});
  if (!target) return HttpRefusal{400, target.error()};
  const auto value = [&message](auto name) { return text_of(message[name]); };
  request_ = {.method = text_of(message.method_string()),
              .target = std::move(*target),
              .host = value(http::field::host),
              .origin = value(http::field::origin),
              .authorization = value(http::field::authorization),
              .last_event_id = value("Last-Event-ID"),
              .idempotency_key = value(key_field),
              .content_octets = std::nullopt,
              .keep_alive = message.keep_alive(),
              .body = ""};
  if (const auto length = parser_->content_length()) request_.content_octets = *length;
  return std::nullopt;
}

Result<RequestReader::State, HttpRefusal> RequestReader::take(std::string& input) {
  while (!parser_->is_done()) {
    if (has_head_ && !body_admitted_) return State::admitted;
    const bool waits_for_head = !parser_->is_header_done();
    boost::beast::error_code error;
    const std::size_t used = parser_->put(boost::asio::const_buffer(input.data(), input.size()), error);
    input.erase(0, used);
    if (error == http::error::body_limit) return Err(HttpRefusal{413, "the body is too long"});
    if (error == http::error::header_limit) return Err(HttpRefusal{431, "the header is too long"});
    if (error && error != http::error::need_more) return Err(HttpRefusal{400, "not an HTTP request"});
    if (waits_for_head && parser_->is_header_done()) {
      has_head_ = true;
      if (const auto refusal = read_head()) return Err(*refusal);
      continue;
    }
    if (error == http::error::need_more || used == 0) break;
  }
  if (!parser_->is_done()) {
    if (!parser_->is_header_done()) {
      if (input.size() > head_octets_max) return Err(HttpRefusal{431, "the header is too long"});
      return State::head;
    }
    return body_admitted_ ? State::body : State::admitted;
  }
  if (!body_admitted_) return State::admitted;
  request_.body = std::move(parser_->get().body());
  return State::complete;
}

}  // namespace srfs::ground::api
