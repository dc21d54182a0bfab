// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/file/calibrator.hpp"

#include <algorithm>

#include <fmt/format.h>

namespace srfs::image {

void Calibrator::list(Choice& choice) {
  if (std::exchange(choice.is_listed, true)) return;
  auto listed = store_.list(choice.kind);
  choice.masters = std::move(listed.masters);
  problems_.insert(problems_.end(), listed.problems.begin(), listed.problems.end());
}

std::string Calibrator::choose(Choice& choice, const DetectorSetting& frame) {
  const auto is_fit = [&](const StoredMaster& m) { return fits(choice.kind, m.setting, frame); };
  if (choice.current && is_fit(*choice.current)) return {};
  list(choice);
  choice.current.reset();
  choice.master = {};  // before the next one takes its memory
  for (auto it = choice.masters.begin();
       (it = std::find_if(it, choice.masters.end(), is_fit)) != choice.masters.end();) {
    auto read = store_.read(*it);
    if (!read) {
      problems_.push_back(read.error().reason);
      it = choice.masters.erase(it);
      continue;
    }
    it->sha256 = std::move(read->sha256);
    choice.current = *it;
    choice.master = std::move(read->master);
    return {};
  }
  if (choice.masters.empty()) return {};
  return fmt::format("no {} fits {}; the newest is of {}", to_text(choice.kind), to_text(frame),
                     to_text(choice.masters.front().setting));
}

bool Calibrator::has_fitting(Choice& choice, const DetectorSetting& frame) {
  list(choice);
  return std::any_of(choice.masters.begin(), choice.masters.end(),
                     [&](const StoredMaster& m) { return fits(choice.kind, m.setting, frame); });
}

Result<Calibrator::Applied, Refusal> Calibrator::apply(Frame& frame) {
  Applied applied;
  const DetectorSetting setting = setting_of(frame);
  const auto chosen = [&](Choice& choice, bool is_wanted) -> const Master* {
    if (!is_wanted) return nullptr;
    if (std::string why = choose(choice, setting); !why.empty()) applied.notes.push_back(std::move(why));
    if (!choice.current) return nullptr;
    const auto is_current = [&](const StoredMaster& m) {
      return m.kind == choice.kind && m.generation == choice.current->generation;
    };
    if (std::none_of(used_.begin(), used_.end(), is_current)) used_.push_back(*choice.current);
    (choice.kind == MasterKind::dark ? applied.dark : applied.flat) = choice.current->generation;
    return &choice.master;
  };
  const Master* const dark = chosen(dark_, wanted_.dark);
  if (wanted_.needs_dark && dark == nullptr) {
    return Err(Refusal{applied.notes.empty()
                           ? fmt::format("there is no dark of {}: make one first", to_text(setting))
                           : applied.notes.front() + ": make one first"});
  }
  const Master* flat = nullptr;
  if (dark != nullptr)
    flat = chosen(flat_, wanted_.flat);
  else if (wanted_.flat && has_fitting(flat_, setting))
    applied.notes.emplace_back("the flat is not used without a dark");
  calibrate(dark, flat, frame);
  return applied;
}

}  // namespace srfs::image
