// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/pass/pass_memory.hpp"

#include <algorithm>

namespace srfs::ground::pass {
namespace {

/// The stages that its reports say, as they were followed when they came.
std::vector<StageReport> stages_of(const StoredTelecommand& stored, const mission::Dictionary& dictionary) {
  std::vector<StageReport> stages;
  const mission::Command* const command = dictionary.command(stored.entry.name);
  if (command == nullptr) return stages;
  Commanding commanding(dictionary);
  static_cast<void>(commanding.sent(stored.entry.request, *command, milliseconds(1), 0, MonotonicTime{}));
  for (const auto& report : stored.reports) {
    wire::TmPacket packet;
    packet.service = 1;
    packet.subtype = report.subtype;
    packet.source = report.source;
    if (auto stage = commanding.on_packet(packet, MonotonicTime{})) stages.push_back(std::move(*stage));
  }
  return stages;
}

/// As how the telecommand must end.
ScriptStep wanted(const std::optional<ScriptStep>& step) {
  ScriptStep judging = step.value_or(ScriptStep{});
  // The insertion of a time-tagged telecommand is what was sent.
  if (judging.at) judging.expectation = Expectation::completed;
  return judging;
}

/// Nothing is sent before packets of the pass came: an archive that knows none from before is another one, or
/// was pruned.
LookedUp not_found(Archive& archive, UtcTime ordered) {
  const auto before = archive.passes({.from = std::nullopt, .to = ordered});
  if (!before) return {.what = LookedUp::What::cannot_tell, .why = before.error()};
  if (before->empty())
    return {.what = LookedUp::What::cannot_tell, .why = "the archive begins after it was ordered"};
  return {.what = LookedUp::What::not_recorded};
}

}  // namespace

LookedUp judge_recorded(const StoredTelecommand& stored, const std::optional<ScriptStep>& step,
                        const mission::Dictionary& dictionary) {
  const ScriptStep judging = wanted(step);
  for (const StageReport& stage : stages_of(stored, dictionary)) {
    const auto judged = judge(judging, stage);
    if (!judged) continue;
    return {.what = *judged ? LookedUp::What::as_wanted : LookedUp::What::otherwise,
            .why = stage.failure_text.empty() ? std::string(to_text(stage)) : stage.failure_text};
  }
  return {.what = LookedUp::What::open};
}

Result<Archive*, std::string> PassMemory::opened() {
  if (!archive_) {
    auto opened = open_archive(place_, ArchiveUse::read);
    if (!opened) return Err(opened.error());
    archive_ = std::move(*opened);
  }
  return archive_.get();
}

LookedUp PassMemory::look_up(const std::string& token, const std::optional<ScriptStep>& step,
                             UtcTime ordered) {
  const auto archive = opened();
  if (!archive) return {.what = LookedUp::What::cannot_tell, .why = archive.error()};
  const auto request = (*archive)->request_of(token);
  if (!request) return {.what = LookedUp::What::cannot_tell, .why = request.error()};
  if (!*request) return not_found(**archive, ordered);
  constexpr std::chrono::hours margin{1};  // the clock of this machine may be set meanwhile
  const auto recorded = (*archive)->telecommands({.from = ordered - margin, .to = std::nullopt}, SIZE_MAX);
  if (!recorded) return {.what = LookedUp::What::cannot_tell, .why = recorded.error()};
  const auto found = std::find_if(recorded->begin(), recorded->end(), [&](const StoredTelecommand& stored) {
    return stored.entry.token == token;
  });
  if (found == recorded->end())
    return {.what = LookedUp::What::cannot_tell, .why = "recorded at another time than it was ordered at"};
  return judge_recorded(*found, step, dictionary_);
}

std::optional<std::size_t> PassMemory::open_gaps() {
  const auto archive = opened();
  if (!archive) return std::nullopt;
  const auto gaps = (*archive)->gaps({}, true);
  return gaps ? std::optional(gaps->size()) : std::nullopt;
}

}  // namespace srfs::ground::pass
