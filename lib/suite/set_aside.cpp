// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/set_aside.hpp"

#include <array>
#include <sstream>

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "base/checked_text.hpp"
#include "base/fd.hpp"
#include "base/file.hpp"
#include "base/log.hpp"
#include "base/time.hpp"
#include "suite/boot_store.hpp"
#include "suite/parameter_store.hpp"
#include "suite/step_down.hpp"

namespace srfs::suite {
namespace {

constexpr const char* hold_name = "hold";
constexpr const char* desired_state_name = "desired_state";
constexpr const char* parameters_name = "parameters.yaml";
constexpr const char* aside = ".set_aside";
constexpr std::size_t longest_note = 4096;

std::filesystem::path count_file(const VarPaths& var) {
  return var.boot() / "starts";
}

std::filesystem::path note_file(const VarPaths& var) {
  return var.boot() / "set_aside";
}

std::filesystem::path order_file(const VarPaths& var, const std::string& node, Leftover::Kind kind) {
  return var.state(node) / (kind == Leftover::Kind::hold ? hold_name : desired_state_name);
}

/// The new name is on disk when this returns.
Result<void, std::string> rename_durably(const std::filesystem::path& from, const std::filesystem::path& to) {
  std::error_code ec;
  std::filesystem::rename(from, to, ec);
  if (ec) return Err(fmt::format("{}: cannot be renamed: {}", from.string(), ec.message()));
  const Fd folder(open(to.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder || fsync(folder.get()) != 0) return Err(to.parent_path().string() + ": cannot be synced");
  return {};
}

/// nullopt: none, or one that its node sets aside itself at its start.
std::optional<ParameterHistory> read_history(const VarPaths& var, const std::string& node) {
  const auto text = read_file(var.state(node) / parameters_name, largest_parameter_file);
  auto stored = text ? read_stored(*text) : Err(text.error().message);
  return stored ? std::optional(std::move(stored->history)) : std::nullopt;
}

/// The deployment's values become the newest set; those before stay in the history.
Result<void, std::string> set_parameters_aside(const VarPaths& var, const std::string& node,
                                               const std::string& saved) {
  auto history = read_history(var, node);
  if (!history || history->values().empty()) return {};
  history->add({}, "set aside: the suite did not become healthy", saved);
  history->trial.clear();
  const auto text = write_stored(node, *history);
  if (!text) return Err(text.error());
  const auto written = write_file_atomically(var.state(node) / parameters_name, *text);
  return written ? Result<void, std::string>() : Err(written.error().message);
}

/// "payload_eps (hold, kept values), ttc (kept values)"
std::string describe(const std::vector<Leftover>& leftovers) {
  std::string text;
  std::string node;
  for (const Leftover& leftover : leftovers) {
    if (leftover.node == node) {
      text += fmt::format(", {}", to_text(leftover.kind));
      continue;
    }
    text += fmt::format("{}{} ({}", node.empty() ? "" : "), ", leftover.node, to_text(leftover.kind));
    node = leftover.node;
  }
  return text.empty() ? text : text + ")";
}

void set_all_aside(const VarPaths& var, const Deployment& deployment, std::uint32_t starts) {
  const auto leftovers = find_leftovers(var, deployment);
  if (leftovers.empty()) return;
  std::string what = describe(leftovers);
  // Of one that was cut off, or that nobody has heard of yet.
  if (const auto before = read_set_aside_note(var))
    what = before->what.substr(0, longest_note / 2) + "; " + what;
  // Before they are: a power loss in between must not hide them.
  if (const auto written = write_file_atomically(note_file(var), fmt::format("{} {}\n", starts, what));
      !written)
    log::error("{}", written.error().message);
  log::error("{} starts in a row did not become healthy, set aside: {}", starts, what);
  const std::string saved = to_iso8601(system_utc_now());
  for (const Leftover& leftover : leftovers) {
    if (const auto done = set_aside(var, leftover, saved); !done) log::error("{}", done.error());
  }
}

}  // namespace

StartCount next_start(StartCount before, const std::optional<wire::BootRecord>& last) {
  if (last && last->healthy && last->count != before.healthy_boot) before = {0, last->count};
  if (before.starts < UINT32_MAX) ++before.starts;
  return before;
}

std::string encode(const StartCount& count) {
  return with_check(fmt::format("starts1 {} {}", count.starts, count.healthy_boot));
}

std::optional<StartCount> decode_start_count(std::string_view text) {
  std::istringstream in{std::string(text)};
  std::string magic;
  StartCount count;
  if (!(in >> magic >> count.starts >> count.healthy_boot) || encode(count) != text) return std::nullopt;
  return count;
}

std::string_view to_text(Leftover::Kind kind) {
  switch (kind) {
    case Leftover::Kind::hold:
      return "hold";
    case Leftover::Kind::desired_state:
      return "desired state";
    case Leftover::Kind::parameters:
      break;
  }
  return "kept values";
}

std::vector<Leftover> find_leftovers(const VarPaths& var, const Deployment& deployment) {
  std::vector<Leftover> found;
  for (const NodeEntry& node : deployment.nodes) {
    std::error_code ec;
    for (const auto kind : {Leftover::Kind::hold, Leftover::Kind::desired_state}) {
      if (std::filesystem::exists(order_file(var, node.name, kind), ec)) found.push_back({node.name, kind});
    }
    const auto history = read_history(var, node.name);
    if (history && !history->values().empty()) found.push_back({node.name, Leftover::Kind::parameters});
  }
  return found;
}

Result<void, std::string> set_aside(const VarPaths& var, const Leftover& leftover, const std::string& saved) {
  if (leftover.kind == Leftover::Kind::parameters) return set_parameters_aside(var, leftover.node, saved);
  const auto file = order_file(var, leftover.node, leftover.kind);
  std::error_code ec;
  if (!std::filesystem::exists(file, ec)) return {};
  return rename_durably(file, file.string() + aside);
}

Result<bool, std::string> restore_orders(const VarPaths& var, const std::string& node) {
  bool restored = false;
  for (const auto kind : {Leftover::Kind::hold, Leftover::Kind::desired_state}) {
    const auto file = order_file(var, node, kind);
    std::error_code ec;
    if (!std::filesystem::exists(file.string() + aside, ec) || std::filesystem::exists(file, ec)) continue;
    if (const auto done = rename_durably(file.string() + aside, file); !done) return Err(done.error());
    restored = true;
  }
  return restored;
}

std::optional<SetAsideNote> read_set_aside_note(const VarPaths& var) {
  std::istringstream in(read_file(note_file(var), longest_note).value_or(""));
  SetAsideNote note;
  if (!(in >> note.starts) || !std::getline(in >> std::ws, note.what)) return std::nullopt;
  return note;
}

Result<void, std::string> remove_set_aside_note(const VarPaths& var) {
  const auto removed = remove_durably(note_file(var));
  return removed ? Result<void, std::string>() : Err(removed.error().message);
}

void begin_suite_start(const VarPaths& var, const Deployment& deployment) {
  const auto text = read_file(count_file(var), 256);
  const auto before = text ? decode_start_count(*text) : std::nullopt;
  const StartCount count = next_start(before.value_or(StartCount{}), BootStore(var.boot()).load().state);
  if (const auto written = write_file_atomically(count_file(var), encode(count)); !written)
    log::error("starts of the suite are not counted: {}", written.error().message);
  if (count.starts > static_cast<std::uint32_t>(deployment.ring.unhealthy_starts))
    set_all_aside(var, deployment, count.starts - 1);
}

void forget_suite_starts(const VarPaths& var) {
  if (const auto removed = remove_durably(count_file(var)); !removed)
    log::error("{}", removed.error().message);
  if (const auto problem = StepStore(var.boot()).change(on_healthy); !problem.empty())
    log::error("the starts of the suite are still counted: {}", problem);
}

}  // namespace srfs::suite
