// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// srfs-lane: compiles a node from untrusted sources, and tries the program out, within bounds (README.md).

#include <poll.h>
#include <sys/file.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <filesystem>
#include <string>

#include <fcntl.h>
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "base/file.hpp"
#include "base/signals.hpp"
#include "base/version.hpp"
#include "lane.hpp"
#include "update/control_group.hpp"
#include "update/package.hpp"

namespace {

namespace fs = std::filesystem;
using namespace srfs;
using namespace srfs::lane;
using update::LaneExit;

struct Arguments {
  LaneExit exit =
      LaneExit::environment;  // of the subcommand, which CLI11 runs when it has read all arguments
  std::string prefix = fs::read_symlink("/proc/self/exe").parent_path().parent_path();
  std::string work;
  std::string report;
  std::vector<std::string> required;
  bool no_namespaces = false;
  bool normal_priority = false;
  pid_t caller = 0;
  std::uint64_t memory_mib = 1536;
  std::uint64_t work_mib = 256;
  std::uint64_t file_mib = 128;
  std::int64_t wall_s = 600;
  std::int64_t cpu_s = 300;
  update::Confinement confinement;
  // build
  BuildOrder order;
  std::string sources, out, log, structures;
  unsigned log_kib = 256;
  bool without_header = false;
  // self-test; log too
  SelfTestOrder test;
  std::string program, deployment, added_nodes;
};

void add_common(CLI::App& app, Arguments& a) {
  app.add_option("--prefix", a.prefix, "Installation to build nodes against (default: this program's)");
  app.add_option("--work", a.work, "Work folder of srfs-lane alone; one run at a time")->required();
  app.add_option("--report", a.report, "File for the outcome as JSON");
  app.add_option("--memory-mib", a.memory_mib)->capture_default_str()->check(CLI::Range(16, 1 << 20));
  app.add_option("--work-mib", a.work_mib,
                 "Size of all files; they count as memory where the work folder is in memory")
      ->capture_default_str()
      ->check(CLI::Range(1, 1 << 20));
  app.add_option("--file-mib", a.file_mib, "Size of one file")
      ->capture_default_str()
      ->check(CLI::Range(1, 1 << 20));
  app.add_option("--files", a.confinement.limits.files)
      ->capture_default_str()
      ->check(CLI::Range(16, 1 << 20));
  app.add_option("--cpu-s", a.cpu_s, "CPU time of one process")
      ->capture_default_str()
      ->check(CLI::Range(1, 86400));
  app.add_option("--processes", a.confinement.limits.processes, "Processes; threads count")
      ->capture_default_str()
      ->check(CLI::Range(1, 4096));
  app.add_option("--uid", a.confinement.user, "User of the sandbox, where srfs-lane runs as root")
      ->capture_default_str()
      ->check(CLI::Range(1U, 0x7fff'ffffU));
  app.add_option("--gid", a.confinement.group)->capture_default_str()->check(CLI::Range(1U, 0x7fff'ffffU));
  app.add_option("--require", a.required, "Layers of the sandbox without which nothing runs (README.md)")
      ->check([](const std::string& name) {
        return update::layer_of(name) ? std::string() : "no layer: " + name;
      });
  app.add_flag("--no-namespaces", a.no_namespaces, "Run as if the kernel had no namespaces");
  app.add_option("--caller", a.caller, "End at once (SIGKILL) with this process, the parent");
  app.add_flag("--normal-priority", a.normal_priority, "Run without SCHED_IDLE");
}

LaneExit fail(const std::string& message) {
  fmt::print(stderr, "srfs-lane: {}\n", message);
  return LaneExit::environment;
}

Lane lane_of(const Arguments& a) {
  Lane lane;
  lane.prefix = fs::absolute(a.prefix).lexically_normal();
  lane.work = fs::absolute(a.work).lexically_normal();
  lane.confinement = a.confinement;
  lane.confinement.namespaces = !a.no_namespaces;
  update::Limits& limits = lane.confinement.limits;
  limits.memory_octets = a.memory_mib << 20U;
  limits.work_octets = a.work_mib << 20U;
  limits.file_octets = a.file_mib << 20U;
  limits.wall = seconds(a.wall_s);
  limits.cpu = seconds(a.cpu_s);
  limits.lowest_priority = !a.normal_priority;
  for (const std::string& name : a.required)
    lane.confinement.required |= update::set_of({*update::layer_of(name)});
  return lane;
}

/// What the installation says of how nodes are built. @return why not
std::optional<std::string> read_installation(Lane& lane) {
  const fs::path settings = lane.prefix / "share/srfs/node_build.json";
  const auto text = read_file(settings, 1U << 20);
  if (!text) return text.error().message;
  const auto installation = update::decode_node_build(*text, lane.prefix);
  if (!installation) return fmt::format("{}: {}", settings.string(), installation.error());
  lane.installation = *installation;
  std::erase_if(lane.installation.where_installed, [](const fs::path& library) {
    std::error_code error;
    return !fs::exists(library, error);
  });
  lane.confinement.readable = installation->readable;
  return std::nullopt;
}

/// One run at a time in a work folder.
Result<Fd, std::string> lock(const fs::path& work, seconds patience) {
  std::error_code ec;
  fs::create_directories(work, ec);
  Fd lock(open((work / "lock").c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0600));
  if (!lock) return Err(fmt::format("{}: {}", work.string(), errno_text(errno)));
  const MonotonicTime give_up = monotonic_now() + patience;
  while (flock(lock.get(), LOCK_EX | LOCK_NB) != 0) {
    if (monotonic_now() >= give_up) return Err(work.string() + ": another srfs-lane is using it");
    poll(nullptr, 0, 20);
  }
  return lock;
}

using Use = LaneExit (*)(Lane& lane, Arguments& a, Report& report);

/// Sets the lane up, uses it, reports.
LaneExit run(Arguments& a, Use use) {
  constexpr seconds lock_patience{10};  // one that was killed with its caller may be on its way out
  umask(022);                           // what the confined user must read
  if (a.caller != 0 && (prctl(PR_SET_PDEATHSIG, SIGKILL) != 0 || getppid() != a.caller))
    return fail("the caller has ended");
  const Fd termination = termination_signals();
  ignore_broken_pipes();
  Lane lane = lane_of(a);
  lane.cancel_fd = termination.get();
  if (const auto wrong = read_installation(lane)) return fail(*wrong);
  const auto locked = lock(lane.work, a.caller != 0 ? lock_patience : seconds(0));
  if (!locked) return fail(locked.error());
  update::ControlGroup::remove_abandoned();

  Report report;
  const LaneExit exit = use(lane, a, report);
  say(fmt::format("{}{}{}", report.outcome, report.reason.empty() ? "" : ": ", report.reason));
  if (!a.report.empty()) {
    if (const auto written = write_file_atomically(a.report, to_json(report)); !written)
      return fail(written.error().message);
  }
  return exit;
}

LaneExit run_build(Lane& lane, Arguments& a, Report& report) {
  a.order.sources = fs::absolute(a.sources);
  a.order.out = fs::absolute(a.out);
  a.order.log = fs::absolute(a.log);
  a.order.log_octets = std::size_t{a.log_kib} << 10U;
  a.order.program_octets = lane.confinement.limits.file_octets;
  a.order.precompile = !a.without_header;
  if (!a.structures.empty()) {
    lane.installation.structures = fs::absolute(a.structures).lexically_normal();
    lane.confinement.readable.push_back(lane.installation.structures);
  }
  return build(lane, a.order, report);
}

LaneExit run_self_test(Lane& lane, Arguments& a, Report& report) {
  lane.confinement.network = true;
  a.test.program = fs::absolute(a.program);
  a.test.deployment = fs::absolute(a.deployment);
  if (!a.added_nodes.empty()) a.test.added_nodes = fs::absolute(a.added_nodes);
  if (!a.log.empty()) a.test.log = fs::absolute(a.log);
  return self_test(lane, a.test, report);
}

void add_build(CLI::App& app, Arguments& a) {
  CLI::App& sub = *app.add_subcommand("build", "Compiles all *.cpp below a folder into one program");
  add_common(sub, a);
  sub.add_option("--sources", a.sources, "Folder of the sources; build rules in it are ignored")
      ->required()
      ->check(CLI::ExistingDirectory);
  sub.add_option("--name", a.order.node, "Name of the node")->required();
  sub.add_option("--structures", a.structures,
                 "Folder of mission/structures.hpp and .cpp of the mission that flies (default: the "
                 "installation's mission)")
      ->check(CLI::ExistingDirectory);
  sub.add_option("--option", a.order.options, "Option of the compiler")
      ->check(CLI::IsMember(update::allowed_options()));
  sub.add_option("--out", a.out, "The program, stripped; replaced atomically")->required();
  sub.add_option("--log", a.log, "File for the output of the compiler")->required();
  sub.add_option("--log-kib", a.log_kib, "Limit of the log; its head and tail are kept")
      ->capture_default_str()
      ->check(CLI::Range(1, 65536));
  sub.add_option("--jobs", a.order.jobs, "Compilers in parallel")
      ->capture_default_str()
      ->check(CLI::Range(1, 64));
  sub.add_option("--seconds", a.wall_s, "Time limit of the build")
      ->capture_default_str()
      ->check(CLI::Range(1, 86400));
  sub.add_flag("--no-precompiled-header", a.without_header);
  sub.final_callback([&a] { a.exit = run(a, run_build); });
}

void add_self_test(CLI::App& app, Arguments& a) {
  CLI::App& sub = *app.add_subcommand("self-test", "Runs a program with --self-test and judges its end");
  add_common(sub, a);
  sub.add_option("--program", a.program)->required()->check(CLI::ExistingFile);
  sub.add_option("--name", a.test.node)->required();
  sub.add_option("--deployment", a.deployment)->required()->check(CLI::ExistingFile);
  sub.add_option("--seconds", a.wall_s)->required()->check(CLI::Range(1, 86400));
  sub.add_option("--domain", a.test.domain,
                 "DDS domain; must be unused where the program sees the host's loopback interface")
      ->capture_default_str()
      ->check(CLI::Range(0, 232));
  sub.add_option("--added-nodes", a.added_nodes,
                 "List of added nodes for the program (lib/suite/added_nodes)");
  sub.add_option("--log", a.log, "File for the output of the program, 64 KiB");
  sub.final_callback([&a] { a.exit = run(a, run_self_test); });
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Builds and tests nodes in a sandbox");
  app.require_subcommand(1);
  app.set_version_flag("--version", version());
  Arguments arguments;
  add_build(app, arguments);
  add_self_test(app, arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : static_cast<int>(LaneExit::environment);
  }
  return static_cast<int>(arguments.exit);
}
