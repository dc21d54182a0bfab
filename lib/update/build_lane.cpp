// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/build_lane.hpp"

#include <algorithm>
#include <array>
#include <csignal>

#include <fmt/format.h>
#include <string.h>
#include <nlohmann/json.hpp>

namespace srfs::update {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr std::array<std::string_view, 10> build_names{
    "built",         "compiler_failed", "time_limit",       "cpu_limit",      "memory_limit",
    "process_limit", "quota",           "output_too_large", "sandbox_failed", "cancelled"};
constexpr std::array<std::string_view, 10> self_test_names{
    "passed",       "failed",        "crashed", "hung",           "cpu_limit",
    "memory_limit", "process_limit", "quota",   "sandbox_failed", "cancelled"};

std::vector<std::string> texts(const Json& json) {
  return json.get<std::vector<std::string>>();
}

std::vector<fs::path> paths(const Json& json, const fs::path& prefix) {
  std::vector<fs::path> result;
  for (const std::string& path : texts(json)) result.push_back(prefix / path);  // an absolute one stays
  return result;
}

/// The last -O counts; without one the compiler does not optimise.
bool optimises(const std::vector<std::string>& options) {
  const auto last = std::find_if(options.rbegin(), options.rend(),
                                 [](const std::string& option) { return option.starts_with("-O"); });
  return last != options.rend() && *last != "-O0";
}

/// Of header and sources alike: the header is of use for the same only.
std::vector<std::string> compiler_command(const NodeBuild& build, const std::vector<std::string>& options,
                                          const fs::path& work) {
  std::vector<std::string> words{compiler};
  words.insert(words.end(), build.flags.begin(), build.flags.end());
  words.insert(words.end(), options.begin(), options.end());
  if (!optimises(options)) words.emplace_back("-U_FORTIFY_SOURCE");  // it would only warn
  // Bounded messages; the same program wherever it is built.
  for (const char* word :
       {"-fPIE", "-pipe", "-Winvalid-pch", "-fmax-errors=20", "-fno-diagnostics-show-caret"})
    words.emplace_back(word);
  words.push_back(fmt::format("-ffile-prefix-map={}/src/=", work.string()));
  words.push_back("-I" + (work / "src").string());
  if (!build.structures.empty()) words.insert(words.end(), {"-isystem", build.structures});
  for (const fs::path& folder : build.include) {
    words.emplace_back("-isystem");
    words.push_back(folder);
  }
  return words;
}

bool used_up_cpu(const Ended& ended, const Limits& limits) {
  return ended.cpu_s >= static_cast<double>(limits.cpu.count());
}

bool says(std::string_view log, std::string_view words) {
  return log.find(words) != std::string_view::npos;
}

}  // namespace

Result<NodeBuild, std::string> decode_node_build(std::string_view json, const fs::path& prefix) {
  try {
    const Json root = Json::parse(json);
    if (root.at("format") != "srfs node build 1") return Err(std::string("another format"));
    return NodeBuild{.flags = texts(root.at("flags")),
                     .include = paths(root.at("include"), prefix),
                     .readable = paths(root.at("readable"), prefix),
                     .library_folder = prefix / root.at("library_folder").get<std::string>(),
                     .libraries = texts(root.at("libraries")),
                     .where_installed = paths(root.value("where_installed", Json::array()), prefix)};
  } catch (const Json::exception& e) {
    return Err(std::string(e.what()));
  }
}

BuildPlan plan_build(const NodeBuild& build, const std::vector<std::string>& sources,
                     const std::vector<std::string>& options, const fs::path& work,
                     const std::optional<fs::path>& header) {
  std::vector<std::string> compiled;
  for (const std::string& source : sources)
    if (fs::path(source).extension() == ".cpp") compiled.push_back(source);
  if (!build.structures.empty() && !compiled.empty())
    compiled.push_back(build.structures / "mission/structures.cpp");

  BuildPlan plan;
  std::vector<std::string> link{compiler};
  link.insert(link.end(), build.flags.begin(), build.flags.end());
  for (const char* word : {"-pie", "-s", "-o"}) link.emplace_back(word);
  link.push_back(work / built_program);
  for (std::size_t i = 0; i < compiled.size(); ++i) {
    const std::string object = work / fmt::format("{}.o", i);
    Command command{fmt::format("compile {}/{} {}", i + 1, compiled.size(), compiled[i]),
                    compiler_command(build, options, work)};
    if (header) command.words.insert(command.words.end(), {"-include", *header});
    command.words.insert(command.words.end(), {"-c", fs::path(".") / compiled[i], "-o", object});
    plan.compile.push_back(std::move(command));
    link.push_back(object);
  }
  link.push_back("-L" + build.library_folder.string());
  link.push_back("-Wl,--as-needed,-rpath," + build.library_folder.string());
  for (const std::string& library : build.libraries) link.push_back("-l" + library);
  for (const fs::path& library : build.where_installed) link.push_back(library);
  link.emplace_back("-pthread");
  plan.link = {"link", std::move(link)};
  return plan;
}

Command plan_header(const NodeBuild& build, const std::vector<std::string>& options, const fs::path& work) {
  Command command{"precompile", compiler_command(build, options, work)};
  const std::string header = work / "node.hpp";
  // -c: with flags for the linker the compiler would link otherwise.
  command.words.insert(command.words.end(), {"-c", "-x", "c++-header", header, "-o", header + ".gch", "-MD",
                                             "-MF", work / "node.d"});
  return command;
}

std::string header_text() {
  return "#include <nodes/payload/payload_node.hpp>\n#include <suite/node.hpp>\n#include "
         "<suite/run_node.hpp>\n";
}

std::vector<std::string> files_of_rule(std::string_view rule) {
  std::vector<std::string> files;
  rule.remove_prefix(std::min(rule.size(), rule.find(": ") + 1));
  std::string file;
  for (std::size_t i = 0; i <= rule.size(); ++i) {
    const char c = i < rule.size() ? rule[i] : '\n';
    if (c == '\\' && i + 1 < rule.size() && rule[i + 1] == ' ') {
      file += rule[++i];
    } else if (c != ' ' && c != '\n' && c != '\\') {
      file += c;
    } else if (!file.empty()) {
      files.push_back(std::move(file));
      file.clear();
    }
  }
  return files;
}

std::string_view to_text(BuildOutcome outcome) {
  return build_names[static_cast<std::size_t>(outcome)];
}

BuildOutcome judge_build(const Ended& ended, std::string_view log, const Limits& limits) {
  switch (ended.stop) {
    case Ended::Stop::cancelled:
      return BuildOutcome::cancelled;
    case Ended::Stop::wall_time:
      return BuildOutcome::time_limit;
    case Ended::Stop::quota:
      return BuildOutcome::quota;
    case Ended::Stop::none:
      break;
  }
  if (ended.exit_code == 0) return BuildOutcome::built;
  if (ended.out_of_memory || says(log, "out of memory allocating") || says(log, "virtual memory exhausted") ||
      says(log, "std::bad_alloc"))
    return BuildOutcome::memory_limit;
  if (ended.signal == SIGXCPU || says(log, "CPU time limit exceeded") || used_up_cpu(ended, limits))
    return BuildOutcome::cpu_limit;
  if (ended.signal == SIGXFSZ || says(log, "File size limit exceeded") || says(log, "File too large"))
    return BuildOutcome::output_too_large;
  if (says(log, "No space left on device")) return BuildOutcome::quota;
  if (ended.too_many_processes) return BuildOutcome::process_limit;
  return BuildOutcome::compiler_failed;
}

std::string_view to_text(SelfTestOutcome outcome) {
  return self_test_names[static_cast<std::size_t>(outcome)];
}

SelfTestOutcome judge_self_test(const Ended& ended, const Limits& limits) {
  switch (ended.stop) {
    case Ended::Stop::cancelled:
      return SelfTestOutcome::cancelled;
    case Ended::Stop::quota:
      return SelfTestOutcome::quota;
    case Ended::Stop::wall_time:
      return ended.too_many_processes ? SelfTestOutcome::process_limit : SelfTestOutcome::hung;
    case Ended::Stop::none:
      break;
  }
  if (ended.exit_code == 0) return SelfTestOutcome::passed;
  // Processes that were refused count as memory until the kernel gets round to freeing them.
  if (ended.out_of_memory && !ended.too_many_processes) return SelfTestOutcome::memory_limit;
  if (ended.signal == SIGXCPU || (ended.signal == SIGKILL && used_up_cpu(ended, limits)))
    return SelfTestOutcome::cpu_limit;
  if (ended.too_many_processes) return SelfTestOutcome::process_limit;
  return ended.exit_code == self_test_failed ? SelfTestOutcome::failed : SelfTestOutcome::crashed;
}

std::string describe(const Ended& ended) {
  switch (ended.stop) {
    case Ended::Stop::cancelled:
      return "cancelled";
    case Ended::Stop::quota:
      return "its work folder was full";
    case Ended::Stop::wall_time:
      return fmt::format("still running after {:.0f} s", ended.seconds);
    case Ended::Stop::none:
      break;
  }
  if (ended.exit_code) return fmt::format("exit code {}", *ended.exit_code);
  return fmt::format("signal {} ({})", ended.signal, strsignal(ended.signal));
}

LaneExit exit_of(BuildOutcome outcome) {
  switch (outcome) {
    case BuildOutcome::built:
      return LaneExit::done;
    case BuildOutcome::compiler_failed:
      return LaneExit::to_blame;
    case BuildOutcome::sandbox_failed:
      return LaneExit::environment;
    case BuildOutcome::cancelled:
      return LaneExit::cancelled;
    default:
      return LaneExit::limit;
  }
}

LaneExit exit_of(SelfTestOutcome outcome) {
  switch (outcome) {
    case SelfTestOutcome::passed:
      return LaneExit::done;
    case SelfTestOutcome::failed:
    case SelfTestOutcome::crashed:
    case SelfTestOutcome::hung:
      return LaneExit::to_blame;
    case SelfTestOutcome::sandbox_failed:
      return LaneExit::environment;
    case SelfTestOutcome::cancelled:
      return LaneExit::cancelled;
    default:
      return LaneExit::limit;
  }
}

void HeadAndTail::append(std::string_view text) {
  const std::size_t room = std::min(text.size(), half_ - head_.size());
  head_.append(text.substr(0, room));
  tail_.append(text.substr(room));
  if (tail_.size() <= 2 * half_) return;
  const std::size_t surplus = tail_.size() - half_;
  tail_.erase(0, surplus);
  left_out_ += surplus;
}

std::string HeadAndTail::text() const {
  const std::size_t surplus = tail_.size() - std::min(tail_.size(), half_);
  const std::uint64_t left_out = left_out_ + surplus;
  if (left_out == 0) return head_ + tail_;
  return fmt::format("{}\n[... {} octets left out ...]\n{}", head_, left_out, tail_.substr(surplus));
}

std::string last_lines(std::string_view text, std::size_t octets) {
  if (text.size() <= octets) return std::string(text);
  text.remove_prefix(text.size() - octets);
  const std::size_t line = text.find('\n');
  return std::string(line == std::string_view::npos ? text : text.substr(line + 1));
}

}  // namespace srfs::update
