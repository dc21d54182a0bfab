// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Starts the suite, and answers the ground in its place when it does not become healthy.

#include <cstdio>
#include <span>
#include <string_view>

#include <fmt/format.h>
#include <unistd.h>

#include "base/file.hpp"
#include "base/log.hpp"
#include "base/version.hpp"
#include "programs/rescue/starter.hpp"

namespace srfs::rescue {
namespace {

constexpr int usage_exit_code = 2;
constexpr int no_settings_exit_code = 3;
constexpr std::string_view usage =
    "srfs_rescue start|serve|answer|check --settings FILE [--settings FILE] [-- COMMAND ...]\n"
    "  start   start the suite; after starts that did not become healthy a step lower, at last serve\n"
    "  serve   answer the ground at once\n"
    "  answer  the same where no suite is (initramfs): exit code 75, the computer is to be restarted\n"
    "  check   say whether the settings can be read; exit code 3: none can\n"
    "  --settings FILE  as `srfs rescue prepare` wrote it; the first that is whole counts\n"
    "  -- COMMAND       executed by start when no settings can be read\n";

struct Arguments {
  std::string_view verb;
  std::vector<std::string> settings;
  std::vector<char*> fallback;
};

std::optional<Arguments> read_arguments(std::span<char*> words) {
  Arguments a;
  for (std::size_t i = 1; i < words.size(); ++i) {
    const std::string_view word = words[i];
    if (word == "--") {
      a.fallback.assign(words.begin() + static_cast<std::ptrdiff_t>(i) + 1, words.end());
      break;
    }
    if (word == "--settings" && i + 1 < words.size()) {
      a.settings.emplace_back(words[++i]);
    } else if (a.verb.empty() && !word.starts_with('-')) {
      a.verb = word;
    } else {
      return std::nullopt;
    }
  }
  const bool known = a.verb == "start" || a.verb == "serve" || a.verb == "answer" || a.verb == "check";
  return known && !a.settings.empty() ? std::optional(std::move(a)) : std::nullopt;
}

std::optional<suite::RescueSettings> read_settings(const std::vector<std::string>& files) {
  for (const std::string& file : files) {
    const auto text = read_file(file, suite::RescueSettings::largest_octets);
    auto settings = text ? suite::decode_rescue_settings(*text) : Err(text.error().message);
    if (settings) return std::move(*settings);
    log::error("{}: {}", file, settings.error());
  }
  return std::nullopt;
}

int run(std::span<char*> words) {
  if (words.size() == 2 && std::string_view(words[1]) == "--help") {
    fmt::print("{}", usage);
    return 0;
  }
  if (words.size() == 2 && std::string_view(words[1]) == "--version") {
    fmt::print("{}\n", version());
    return 0;
  }
  auto arguments = read_arguments(words);
  if (!arguments) {
    fmt::print(stderr, "{}", usage);
    return usage_exit_code;
  }
  const auto settings = read_settings(arguments->settings);
  if (settings && arguments->verb == "check") return 0;
  if (settings) {
    Starter starter(*settings);
    if (arguments->verb == "answer") return starter.answer();
    return arguments->verb == "serve" ? starter.serve() : starter.start();
  }
  log::error("no settings can be read: make them with `srfs rescue prepare`");
  if (arguments->verb == "start" && !arguments->fallback.empty()) {
    arguments->fallback.push_back(nullptr);
    execv(arguments->fallback.front(), arguments->fallback.data());
  }
  return no_settings_exit_code;
}

}  // namespace
}  // namespace srfs::rescue

int main(int argc, char** argv) {
  srfs::log::set_name("srfs_rescue");
  try {
    return srfs::rescue::run({argv, static_cast<std::size_t>(argc)});
  } catch (const std::exception& e) {
    srfs::log::fatal("{}", e.what());
    return 1;
  }
}
