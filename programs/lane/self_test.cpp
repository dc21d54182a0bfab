// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "base/config.hpp"
#include "base/file.hpp"
#include "lane.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs::lane {

using namespace update;

namespace {

namespace fs = std::filesystem;

constexpr std::size_t deployment_octets = 1U << 20;

std::optional<std::string> put_file(const WorkFolder& work, const fs::path& from, const fs::path& to) {
  const auto text = read_file(from, deployment_octets);
  if (!text) return text.error().message;
  return work.put(to, *text);
}

/// The file, those that it extends, and the mission's part of the dictionary, if it names one. @return why
/// not
std::optional<std::string> put_deployment(const WorkFolder& work, const fs::path& file) {
  try {
    const ConfigSection deployment = ConfigSection::load(file);
    for (const fs::path each : deployment.files())
      if (auto error = put_file(work, each, "deployment" / each.filename())) return error;
    if (!deployment.has("dictionary")) return std::nullopt;
    const fs::path dictionary = deployment.text("dictionary");
    const fs::path there = ("deployment" / dictionary).lexically_normal();
    if (dictionary.is_absolute() || there.native().starts_with(".."))
      return fmt::format("{}: 'dictionary': expected a folder at or one above the deployment, not '{}'",
                         file.string(), dictionary.string());
    const fs::path here = (file.parent_path() / dictionary).lexically_normal();
    for (const fs::path& each : mission::Dictionary::files(here)) {
      const fs::path inside = each.lexically_relative(here);
      if (inside.native().starts_with("..")) continue;  // SRFS' own, which is readable there
      if (auto error = put_file(work, each, there / inside)) return error;
    }
  } catch (const ConfigError& error) {
    return error.what();
  }
  return std::nullopt;
}

}  // namespace

LaneExit self_test(const Lane& lane, const SelfTestOrder& order, Report& report) {
  constexpr std::size_t told_octets = 2048;
  const auto conclude = [&](SelfTestOutcome outcome, std::string reason) {
    report.outcome = to_text(outcome);
    report.reason = std::move(reason);
    return exit_of(outcome);
  };
  const auto program = read_file(order.program, lane.confinement.limits.file_octets);
  if (!program) return conclude(SelfTestOutcome::sandbox_failed, program.error().message);

  const auto work = WorkFolder::make(lane.job(), lane.confinement);
  if (!work) return conclude(SelfTestOutcome::sandbox_failed, work.error());
  if (const auto error = work->put("program", *program, true))
    return conclude(SelfTestOutcome::sandbox_failed, *error);
  if (const auto error = put_deployment(*work, order.deployment))
    return conclude(SelfTestOutcome::sandbox_failed, *error);

  const std::filesystem::path& folder = work->path();
  std::vector<std::string> command{folder / "program",
                                   "--self-test",
                                   "--name",
                                   order.node,
                                   "--deployment",
                                   folder / "deployment" / order.deployment.filename(),
                                   "--var",
                                   folder / "var",
                                   "--domain",
                                   std::to_string(order.domain)};
  if (!order.added_nodes.empty()) {
    const auto added = read_file(order.added_nodes, deployment_octets);
    if (!added) return conclude(SelfTestOutcome::sandbox_failed, added.error().message);
    if (const auto error = work->put("deployment/added_nodes", *added))
      return conclude(SelfTestOutcome::sandbox_failed, *error);
    command.insert(command.end(), {"--added-nodes", folder / "deployment/added_nodes"});
  }
  HeadAndTail log(order.log_octets);
  const auto listen = [&](std::string_view text) { log.append(text); };
  const auto ended = run_confined(lane.confinement, *work, [&] { return execute(command, folder); },
                                  {.output = listen, .log = listen, .cancel_fd = lane.cancel_fd});
  report.last_lines = last_lines(log.text(), told_octets);
  if (!order.log.empty()) {
    if (const auto written = write_file_atomically(order.log, log.text()); !written)
      return conclude(SelfTestOutcome::sandbox_failed, written.error().message);
  }
  if (!ended) {
    report.ended.layers = ended.error().layers;
    return conclude(SelfTestOutcome::sandbox_failed, ended.error().message);
  }
  report.ended = *ended;
  const SelfTestOutcome outcome = judge_self_test(*ended, lane.confinement.limits);
  return conclude(outcome, outcome == SelfTestOutcome::passed ? "" : describe(*ended));
}

}  // namespace srfs::lane
