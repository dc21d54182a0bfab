// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/access.hpp"

#include <cerrno>
#include <cstdio>

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/crypto.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.hpp"
#include "base/octets.hpp"
#include "base/random_octets.hpp"
#include "base/sha256.hpp"

namespace srfs::ground::api {
namespace {

constexpr std::string_view bearer = "Bearer ";
constexpr std::size_t token_octets = 32;
constexpr std::size_t web_file_octets_max = 4096;
constexpr std::size_t token_text_min = 32;

/// A name and its port, as Host has them: "a:1", "[::1]:1". The port is that of the scheme when there is
/// none.
struct HostName {
  std::string name;
  std::string port;
};
HostName host_name_of(std::string_view host) {
  const std::size_t bracket = host.starts_with('[') ? host.find(']') : 0;
  const std::size_t colon = bracket == std::string_view::npos ? bracket : host.find(':', bracket);
  HostName found{std::string(host.substr(0, colon)), ""};
  if (colon != std::string_view::npos) found.port = host.substr(colon + 1);
  if (found.name.starts_with('[') && found.name.ends_with(']'))
    found.name = found.name.substr(1, found.name.size() - 2);
  return found;
}

Result<std::string, std::string> new_token() {
  Octets random(token_octets);
  if (!fill_random(random)) return Err(fmt::format("no random octets: {}", errno_text(errno)));
  return to_hex(random);
}

Result<Fd, std::string> open_lock(const std::filesystem::path& path) {
  constexpr mode_t owner_alone = 0600;
  Fd lock(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, owner_alone));
  if (!lock) return Err(fmt::format("{}: cannot open: {}", path.string(), errno_text(errno)));
  return lock;
}

}  // namespace

bool equal_in_constant_time(std::string_view given, std::string_view secret) {
  // Digests have one length, whatever was given.
  const auto of_given = sha256_of({reinterpret_cast<const std::uint8_t*>(given.data()), given.size()});
  const auto of_secret = sha256_of({reinterpret_cast<const std::uint8_t*>(secret.data()), secret.size()});
  return CRYPTO_memcmp(of_given.data(), of_secret.data(), of_secret.size()) == 0;
}

Role role_of(const HttpRequest& request, const Tokens& tokens, bool in_query) {
  std::string_view given = request.authorization;
  if (given.starts_with(bearer)) {
    given.remove_prefix(bearer.size());
  } else if (const auto token = request.target.query.find("token");
             in_query && given.empty() && token != request.target.query.end()) {
    given = token->second;
  } else {
    return Role::stranger;
  }
  const bool commands = equal_in_constant_time(given, tokens.command);
  const bool observes = equal_in_constant_time(given, tokens.observe);
  return commands ? Role::commander : observes ? Role::observer : Role::stranger;
}

bool is_loopback_name(const std::string& name) {
  return name == "127.0.0.1" || name == "localhost" || name == "::1";
}

std::optional<std::string> wrong_site(const HttpRequest& request, const Site& site) {
  const HostName host = host_name_of(request.host);
  const std::string own_port = std::to_string(site.port);
  const std::string usual_port = site.scheme == "https" ? "443" : "80";
  if (!site.is_own_name(host.name) || (host.port.empty() ? usual_port : host.port) != own_port)
    return "this server has another name than the Host field says";
  if (!request.origin.empty() && request.origin != site.scheme + "://" + request.host)
    return "a page of another site asks";
  return std::nullopt;
}

Result<Fd, std::string> lock_web_file(const std::filesystem::path& state_dir) {
  auto lock = open_lock(state_dir / "web.lock");
  if (lock && ::flock(lock->get(), LOCK_EX | LOCK_NB) != 0) lock->reset();
  return lock;
}

Result<Fd, std::string> await_web_of_server(const std::filesystem::path& state_dir) {
  const auto path = state_dir / "web_of_server.lock";
  auto lock = open_lock(path);
  if (!lock) return lock;
  if (::flock(lock->get(), LOCK_EX | LOCK_NB) == 0) return lock;
  std::fprintf(stderr, "srfs-ground: the page comes when the gateway of the server before has ended\n");
  while (::flock(lock->get(), LOCK_EX) != 0) {
    if (errno != EINTR) return Err(fmt::format("{}: cannot lock: {}", path.string(), errno_text(errno)));
  }
  return lock;
}

Result<WebFile, std::string> open_web_file(const std::filesystem::path& state_dir) {
  const auto path = state_dir / web_file;
  std::error_code error;
  if (std::filesystem::exists(path, error)) {
    const auto text = read_file(path, web_file_octets_max);
    if (!text) return Err(text.error().message);
    const auto json = nlohmann::json::parse(*text, nullptr, false);
    const auto member = [&json](const char* name) {
      return json.is_object() && json.contains(name) && json[name].is_string() ? json[name].get<std::string>()
                                                                               : std::string();
    };
    WebFile content{member("url"), {member("observe"), member("command")}};
    if (content.tokens.observe.size() < token_text_min || content.tokens.command.size() < token_text_min)
      return Err(fmt::format("{}: not the file of the web gateway; remove it, then new tokens are made",
                             path.string()));
    return content;
  }
  auto observe = new_token();
  auto command = new_token();
  if (!observe || !command) return Err(observe ? command.error() : observe.error());
  return WebFile{"", {std::move(*observe), std::move(*command)}};
}

Result<void, std::string> write_web_file(const std::filesystem::path& state_dir, const WebFile& content) {
  const auto path = state_dir / web_file;
  const nlohmann::json json{
      {"url", content.url}, {"observe", content.tokens.observe}, {"command", content.tokens.command}};
  constexpr mode_t others = 0077;
  const mode_t before = ::umask(others);
  const auto written = write_file_atomically(path, json.dump() + "\n");
  ::umask(before);
  if (!written) return Err(written.error().message);
  constexpr mode_t owner_alone = 0600;
  if (::chmod(path.c_str(), owner_alone) != 0)
    return Err(fmt::format("{}: {}", path.string(), errno_text(errno)));
  return {};
}

}  // namespace srfs::ground::api
