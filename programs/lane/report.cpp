// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cerrno>
#include <cstdio>
#include <span>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include "base/sha256.hpp"

#include "lane.hpp"

namespace srfs::lane {

using Json = nlohmann::ordered_json;

void say(std::string_view line) {
  (void)std::fwrite(line.data(), 1, line.size(), stdout);
  (void)std::fputc('\n', stdout);
  (void)std::fflush(stdout);
}

std::string to_json(const Report& report) {
  const update::Ended& ended = report.ended;
  Json json{{"format", "srfs lane report 1"}, {"outcome", report.outcome},
            {"reason", report.reason},        {"seconds", ended.seconds},
            {"cpu_s", ended.cpu_s},           {"peak_octets", ended.peak_octets}};
  if (report.octets) json["octets"] = *report.octets;
  if (!report.sha256.empty()) json["sha256"] = report.sha256;
  if (report.precompiled) json["precompiled_header"] = *report.precompiled;
  if (!report.last_lines.empty()) json["last_lines"] = report.last_lines;
  Json in_force = Json::array();
  for (std::size_t i = 0; i < update::layer_count; ++i)
    if (ended.layers.in_force.test(i)) in_force.push_back(to_text(static_cast<update::Layer>(i)));
  Json failures = Json::object();
  for (const auto& [layer, reason] : ended.layers.failures) failures[std::string(to_text(layer))] = reason;
  json["layers"] = {{"in_force", in_force}, {"failures", failures}};
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

Result<Copied, std::string> store(int from, const std::filesystem::path& to, bool executable) {
  // One name for all attempts: what a killed one left is written over.
  const std::string temporary = to.string() + ".tmp";
  const auto failure = [&](const std::string& path) {
    const std::string text = errno_text(errno);
    unlink(temporary.c_str());
    return Err(fmt::format("{}: {}", path, text));
  };
  const Fd out(open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, 0644));
  if (!out) return failure(temporary);
  Copied copied;
  Sha256 digest;
  std::uint8_t chunk[65536];
  while (true) {
    const ssize_t n = read(from, chunk, sizeof chunk);
    if (n == 0) break;
    if (n < 0 || write(out.get(), chunk, static_cast<std::size_t>(n)) != n) return failure(temporary);
    digest.update(std::span(chunk, static_cast<std::size_t>(n)));
    copied.octets += static_cast<std::uint64_t>(n);
  }
  if (fchmod(out.get(), executable ? 0755 : 0644) != 0 || fsync(out.get()) != 0) return failure(temporary);
  if (rename(temporary.c_str(), to.c_str()) != 0) return failure(to);
  const Fd folder(
      open(to.parent_path().empty() ? "." : to.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder || fsync(folder.get()) != 0) return failure(to.parent_path());
  copied.sha256 = to_digits(digest.finish());
  return copied;
}

}  // namespace srfs::lane
