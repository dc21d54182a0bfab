// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/name_hint.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

namespace srfs::ground {

std::size_t edit_distance(std::string_view a, std::string_view b) {
  // Rows of the table of optimal string alignment: two before, one before, this one.
  std::vector<std::size_t> before_last(b.size() + 1);
  std::vector<std::size_t> last(b.size() + 1);
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(last.begin(), last.end(), 0U);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t changed = last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, changed});
      const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (swapped) row[j] = std::min(row[j], before_last[j - 2] + 1);
    }
    before_last.swap(last);
    last.swap(row);
  }
  return last[b.size()];
}

std::string did_you_mean(std::string_view name, const std::vector<std::string>& known) {
  constexpr std::size_t most = 3;
  std::vector<std::pair<std::size_t, std::string>> near;
  for (const std::string& candidate : known) {
    const std::size_t distance = edit_distance(name, candidate);
    const bool is_part = name.size() > 2 && candidate.find(name) != std::string::npos;
    const std::size_t limit = std::max<std::size_t>(2, name.size() / 4);
    if (distance <= limit || is_part) near.emplace_back(distance, candidate);
  }
  std::sort(near.begin(), near.end());
  if (near.size() > most) near.resize(most);
  if (near.empty()) return "";
  std::string text = "; did you mean ";
  for (std::size_t i = 0; i < near.size(); ++i) {
    if (i > 0) text += i + 1 == near.size() ? " or " : ", ";
    text += "'" + near[i].second + "'";
  }
  return text + "?";
}

std::string explained(const mission::Dictionary& dictionary, const std::string& name,
                      const std::string& why) {
  if (dictionary.command(name) != nullptr) return why;
  std::vector<std::string> known;
  for (const auto& command : dictionary.commands()) known.push_back(command.name);
  return why + did_you_mean(name, known);
}

}  // namespace srfs::ground
