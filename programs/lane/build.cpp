// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cerrno>
#include <cstdio>

#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/file.hpp"
#include "lane.hpp"
#include "update/package.hpp"

namespace srfs::lane {
namespace {

namespace fs = std::filesystem;
using namespace update;

struct Source {
  std::string path;  ///< relative
  std::string content;
};

/// Ordinary files only, within the limits of a package; a link is refused.
Result<std::vector<Source>, std::string> read_sources(const fs::path& folder) {
  std::vector<Source> sources;
  std::size_t octets = 0;
  std::error_code ec;
  fs::recursive_directory_iterator entry(folder, ec);
  for (; !ec && entry != fs::recursive_directory_iterator(); entry.increment(ec)) {
    const fs::file_status status = entry->symlink_status(ec);
    if (fs::is_directory(status) && entry.depth() < static_cast<int>(PackageLimits::path_parts)) continue;
    if (!fs::is_regular_file(status))
      return Err(fmt::format("{}: not a regular file", entry->path().string()));
    auto content = read_file(entry->path(), PackageLimits::file_octets);
    if (!content) return Err(content.error().message);
    octets += content->size();
    sources.push_back({entry->path().lexically_relative(folder), std::move(*content)});
    if (octets > PackageLimits::package_octets || sources.size() > PackageLimits::files)
      return Err(std::string("more sources than a package can hold"));
  }
  if (ec) return Err(fmt::format("{}: {}", folder.string(), ec.message()));
  std::sort(sources.begin(), sources.end(), [](const Source& a, const Source& b) { return a.path < b.path; });
  return sources;
}

/// A header of the installation that the package brings its own of: the precompiled one would be the other.
bool brings_own_headers(const std::vector<Source>& sources, const NodeBuild& build) {
  const auto is_installed = [&build](const fs::path& header) {
    const auto holds = [&header](const fs::path& folder) {
      return header.native().starts_with(folder.native() + "/");
    };
    return fs::exists(header) && std::any_of(build.readable.begin(), build.readable.end(), holds);
  };
  return std::any_of(sources.begin(), sources.end(), [&](const Source& source) {
    // In the build tree a node's own headers lie there, too.
    const bool of_a_node = source.path.starts_with("nodes/") && !source.path.starts_with("nodes/payload/");
    return fs::path(source.path).extension() == ".hpp" && !of_a_node &&
           std::any_of(build.include.begin(), build.include.end(),
                       [&](const fs::path& folder) { return is_installed(folder / source.path); });
  });
}

/// Runs in the sandbox: several compilers side by side, then the linker. @return exit code
int carry_out(const BuildPlan& plan, const fs::path& work, unsigned jobs) {
  if (chdir((work / "src").c_str()) != 0) return 1;
  const auto start = [&](const Command& command) {
    say(command.title);
    const pid_t pid = fork();
    if (pid == 0) {
      dup2(STDERR_FILENO, STDOUT_FILENO);
      _exit(execute(command.words, work));
    }
    return pid;
  };
  unsigned running = 0;
  bool failed = false;
  const auto wait_for_one = [&] {
    int status = 0;
    if (wait(&status) < 0) return false;
    --running;
    failed = failed || !WIFEXITED(status) || WEXITSTATUS(status) != 0;
    return true;
  };
  for (const Command& command : plan.compile) {
    while (running >= jobs && wait_for_one()) {
    }
    if (failed) break;
    if (start(command) < 0) return 1;
    ++running;
  }
  while (running > 0 && wait_for_one()) {
  }
  if (failed) return 1;
  if (start(plan.link) < 0) return 1;
  ++running;
  (void)wait_for_one();
  return failed ? 1 : 0;
}

}  // namespace

LaneExit build(const Lane& lane, const BuildOrder& order, Report& report) {
  const auto conclude = [&](BuildOutcome outcome, std::string reason) {
    report.outcome = to_text(outcome);
    report.reason = std::move(reason);
    return exit_of(outcome);
  };
  const auto sources = read_sources(order.sources);
  if (!sources) return conclude(BuildOutcome::sandbox_failed, sources.error());
  std::vector<std::string> names;
  for (const Source& source : *sources) names.push_back(source.path);

  std::optional<fs::path> header;
  if (order.precompile && !brings_own_headers(*sources, lane.installation))
    header = precompiled_header(lane, order.options);
  report.precompiled = header.has_value();

  const BuildPlan plan = plan_build(lane.installation, names, order.options, lane.job(), header);
  if (plan.compile.empty()) return conclude(BuildOutcome::compiler_failed, "no source file ends in .cpp");
  Confinement confinement = lane.confinement;
  if (header) confinement.readable.push_back(header->parent_path());
  const auto work = WorkFolder::make(lane.job(), confinement);
  if (!work) return conclude(BuildOutcome::sandbox_failed, work.error());
  for (const Source& source : *sources)
    if (const auto error = work->put("src/" + source.path, source.content))
      return conclude(BuildOutcome::sandbox_failed, *error);

  HeadAndTail log(order.log_octets);
  const auto ended =
      run_confined(confinement, *work, [&] { return carry_out(plan, work->path(), order.jobs); },
                   {.output =
                        [](std::string_view text) {
                          (void)std::fwrite(text.data(), 1, text.size(), stdout);
                          (void)std::fflush(stdout);
                        },
                    .log = [&](std::string_view text) { log.append(text); },
                    .cancel_fd = lane.cancel_fd});
  const std::string log_text = log.text();
  if (const auto written = write_file_atomically(order.log, log_text); !written)
    return conclude(BuildOutcome::sandbox_failed, written.error().message);
  if (!ended) {
    report.ended.layers = ended.error().layers;
    return conclude(BuildOutcome::sandbox_failed, ended.error().message);
  }
  report.ended = *ended;
  const BuildOutcome outcome = judge_build(*ended, log_text, confinement.limits);
  if (outcome != BuildOutcome::built) return conclude(outcome, describe(*ended));

  const auto program = work->take(built_program, order.program_octets);
  if (!program) return conclude(BuildOutcome::output_too_large, program.error());
  const auto stored = store(program->get(), order.out, true);
  if (!stored) return conclude(BuildOutcome::sandbox_failed, stored.error());
  report.octets = stored->octets;
  report.sha256 = stored->sha256;
  return conclude(outcome, "");
}

}  // namespace srfs::lane
