// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "ground/pass/pass_journal.hpp"

namespace srfs::ground::pass {

/// Text as it may stand in a table of Markdown, on a terminal too.
[[nodiscard]] std::string markdown_cell(std::string_view text);

/// A plan, what became of it, and what comes next.
struct PassReport {
  const PassPlan& plan;
  const std::vector<Item>& items;  ///< with their states
  const PassJournal& journal;
  std::vector<Forecast> coming = {};
  std::optional<UtcTime> orbit_unknown_from = {};
  LineRates rates = {};
  UtcTime now = {};
};

/// For people, in Markdown: coming passes with what each would carry, what came, what went, what is left and
/// why, passes flown.
[[nodiscard]] std::string to_markdown(const PassReport& report);
/// The coming passes alone.
[[nodiscard]] std::string plan_to_markdown(const PassReport& report);
/// {"type": "pass_report", plan, station {...}, elements_age_days | null, passes [...], items [...], flown
/// [...]}
[[nodiscard]] nlohmann::json to_json(const PassReport& report);
/// {"kind", "what", "state", "why", of a file "octets"}
[[nodiscard]] nlohmann::json to_json(const Item& item);

}  // namespace srfs::ground::pass
