// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/fd.hpp"
#include "base/result.hpp"
#include "ground/api/http.hpp"

namespace srfs::ground::api {

/// What a request may do. Each includes those before it.
enum class Role : std::uint8_t { stranger, observer, commander };

/// Bearer tokens: who has one may.
struct Tokens {
  std::string observe;
  std::string command;
};

/// The time it takes depends on the length of @p given alone.
[[nodiscard]] bool equal_in_constant_time(std::string_view given, std::string_view secret);

/// By "Authorization: Bearer TOKEN", or "?token=" where @p in_query (a browser's EventSource sends no
/// header).
[[nodiscard]] Role role_of(const HttpRequest& request, const Tokens& tokens, bool in_query);

/// Where the server listens, and by what names it may be asked: a page of another site that reaches it (DNS
/// rebinding, a form) is refused.
struct Site {
  std::string scheme = "http";
  std::uint16_t port = 0;
  /// Whether a name of a Host field, without its port, is one of this server.
  std::function<bool(const std::string& name)> is_own_name;
};
/// "127.0.0.1", "localhost", "::1"
[[nodiscard]] bool is_loopback_name(const std::string& name);
/// Why Host or Origin are not those of this site; nullopt: they are.
[[nodiscard]] std::optional<std::string> wrong_site(const HttpRequest& request, const Site& site);

inline constexpr std::string_view web_file = "web.json";  ///< in STATE
/// What STATE/web.json says; 0600. Tokens are made at the first start, and stay. The error is ready to print.
struct WebFile {
  std::string url;  ///< of the last start; empty: there was none
  Tokens tokens;
};
[[nodiscard]] Result<WebFile, std::string> open_web_file(const std::filesystem::path& state_dir);
[[nodiscard]] Result<void, std::string> write_web_file(const std::filesystem::path& state_dir,
                                                       const WebFile& content);
/// The right to write web.json: that of the first gateway of a folder, for as long as it runs (a lock on
/// STATE/web.lock). Invalid: another gateway has it. The error is ready to print.
[[nodiscard]] Result<Fd, std::string> lock_web_file(const std::filesystem::path& state_dir);
/// The right to be the gateway of the folder's server, for as long as it runs (a lock on
/// STATE/web_of_server.lock). Blocks while an earlier server's gateway has it: that one was killed with its
/// server, and keeps web.lock, too, until the kernel has ended all its threads.
[[nodiscard]] Result<Fd, std::string> await_web_of_server(const std::filesystem::path& state_dir);

}  // namespace srfs::ground::api
