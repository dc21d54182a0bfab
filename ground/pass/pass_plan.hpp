// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "ground/commanding.hpp"
#include "ground/pass/pass_finder.hpp"
#include "ground/script.hpp"
#include "msgs/mission/dictionary.hpp"
#include "suite/deployment.hpp"

namespace srfs::ground::pass {

/// A ground station as a plan has it.
struct Site {
  std::string name;
  Geodetic place;
  double lowest_elevation_deg = 10;
};

/// What a line carries, in octets a second.
struct LineRates {
  double down_octets_s = 0;
  double up_octets_s = 0;
};

/// A file to send.
struct FileUp {
  std::filesystem::path file = {};
  std::string name = {};  ///< on board
  unsigned priority = 0;
  std::uint64_t octets = 0;
  std::string sha256 = {};  ///< 64 lower-case digits
};

/// Files on board to fetch: those of a folder whose names match a pattern.
struct FilesDown {
  std::string folder;   ///< empty: the folder of files
  std::string pattern;  ///< '*' stands for any text, '?' for one character
  unsigned priority = 0;
};

/// What an operator wants of passes, from a file in YAML (docs/how-to/plan_a_pass.md). It stays as it is over
/// all the passes that it takes.
struct PassPlan {
  static constexpr std::size_t wishes_max = 64;  ///< of each kind; lines of the script likewise
  static constexpr unsigned lowest_priority = 99;

  std::filesystem::path file;
  std::string name;  ///< of the journal too
  Site site;
  std::optional<TwoLineElements> elements;  ///< or times
  std::vector<PassTimes> times;
  LineRates line;  ///< of the line itself; 0: that of the deployment
  std::vector<TelecommandText> queries;
  std::vector<ScriptStep> script;
  bool gaps = false;
  std::vector<FileUp> up;
  std::vector<FilesDown> down;

  /// Reads and checks the whole plan. Files that it names are relative to its folder. Throws ConfigError that
  /// names file, key and what was expected. Blocks on the disk.
  [[nodiscard]] static PassPlan load(const std::filesystem::path& file,
                                     const mission::Dictionary& dictionary);
  /// By the elements, or of the list. The error is ready to print.
  [[nodiscard]] Result<FoundPasses, std::string> passes(UtcTime from, UtcTime to) const;
};

/// Whether all of @p text is as @p pattern says: '*' any text, '?' one character.
[[nodiscard]] bool matches(std::string_view pattern, std::string_view text);

/// What is left for orders: of the line, less its coding and, downwards, the live telemetry of the
/// dictionary.
[[nodiscard]] LineRates useful_rates(const PassPlan& plan, const suite::LinkSettings& link,
                                     const mission::Dictionary& dictionary);

}  // namespace srfs::ground::pass
