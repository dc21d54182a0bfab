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

constexpr seconds lock_patience{10};

int fail(const std::string& message) {
  fmt::print(stderr, "srfs-lane: {}\n", message);
  return static_cast<int>(LaneExit::environment);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Builds and tests nodes in a sandbox");
  app.require_subcommand(1);
  app.set_version_flag("--version", version());
  Arguments a;
  BuildOrder order;
  SelfTestOrder test;
  unsigned log_kib = 256;
  std::string added_nodes;
  std::string sources, out, log, program, deployment;

  CLI::App* const build_app =
      app.add_subcommand("build", "Compiles all *.cpp below a folder into one program");
  add_common(*build_app, a);
  build_app->add_option("--sources", sources, "Folder of the sources; build rules in it are ignored")
      ->required()
      ->check(CLI::ExistingDirectory);
  build_app->add_option("--name", order.node, "Name of the node")->required();
  build_app->add_option("--option", order.options, "Option of the compiler")
      ->check(CLI::IsMember(update::allowed_options()));
  build_app->add_option("--out", out, "The program, stripped; replaced atomically")->required();
  build_app->add_option("--log", log, "File for the output of the compiler")->required();
  build_app->add_option("--log-kib", log_kib, "Limit of the log; its head and tail are kept")
      ->capture_default_str()
      ->check(CLI::Range(1, 65536));
  build_app->add_option("--jobs", order.jobs, "Compilers in parallel")
      ->capture_default_str()
      ->check(CLI::Range(1, 64));
  build_app->add_option("--seconds", a.wall_s, "Time limit of the build")
      ->capture_default_str()
      ->check(CLI::Range(1, 86400));
  bool without_header = false;
  build_app->add_flag("--no-precompiled-header", without_header);

  CLI::App* const test_app =
      app.add_subcommand("self-test", "Runs a program with --self-test and judges its end");
  add_common(*test_app, a);
  test_app->add_option("--program", program)->required()->check(CLI::ExistingFile);
  test_app->add_option("--name", test.node)->required();
  test_app->add_option("--deployment", deployment)->required()->check(CLI::ExistingFile);
  test_app->add_option("--seconds", a.wall_s)->required()->check(CLI::Range(1, 86400));
  test_app
      ->add_option("--domain", test.domain,
                   "DDS domain; must be unused where the program sees the host's loopback interface")
      ->capture_default_str()
      ->check(CLI::Range(0, 232));
  test_app->add_option("--added-nodes", added_nodes,
                       "List of added nodes for the program (lib/ros/added_nodes)");
  test_app->add_option("--log", log, "File for the output of the program, 64 KiB");
  test.domain = 232;

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : static_cast<int>(LaneExit::environment);
  }

  umask(022);  // what the confined user must read
  if (a.caller != 0 && (prctl(PR_SET_PDEATHSIG, SIGKILL) != 0 || getppid() != a.caller))
    return fail("the caller has ended");
  const Fd termination = termination_signals();
  ignore_broken_pipes();
  Lane lane;
  lane.prefix = fs::absolute(a.prefix).lexically_normal();
  lane.work = fs::absolute(a.work).lexically_normal();
  lane.cancel_fd = termination.get();
  lane.confinement = a.confinement;
  lane.confinement.namespaces = !a.no_namespaces;
  lane.confinement.network = test_app->parsed();
  update::Limits& limits = lane.confinement.limits;
  limits.memory_octets = a.memory_mib << 20U;
  limits.work_octets = a.work_mib << 20U;
  limits.file_octets = a.file_mib << 20U;
  limits.wall = seconds(a.wall_s);
  limits.cpu = seconds(a.cpu_s);
  limits.lowest_priority = !a.normal_priority;
  for (const std::string& name : a.required)
    lane.confinement.required |= update::set_of({*update::layer_of(name)});

  const fs::path settings = lane.prefix / "share/srfs/node_build.json";
  const auto text = read_file(settings, 1U << 20);
  if (!text) return fail(text.error().message);
  const auto installation = update::decode_node_build(*text, lane.prefix);
  if (!installation) return fail(fmt::format("{}: {}", settings.string(), installation.error()));
  lane.installation = *installation;
  lane.confinement.readable = installation->readable;

  std::error_code ec;
  fs::create_directories(lane.work, ec);
  const Fd lock(open((lane.work / "lock").c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0600));
  if (!lock) return fail(fmt::format("{}: {}", lane.work.string(), errno_text(errno)));
  // One that was killed with its caller may be on its way out.
  const MonotonicTime give_up = monotonic_now() + (a.caller != 0 ? lock_patience : seconds(0));
  while (flock(lock.get(), LOCK_EX | LOCK_NB) != 0) {
    if (monotonic_now() >= give_up) return fail(lane.work.string() + ": another srfs-lane is using it");
    poll(nullptr, 0, 20);
  }
  update::ControlGroup::remove_abandoned();

  Report report;
  LaneExit exit = LaneExit::environment;
  if (build_app->parsed()) {
    order.sources = fs::absolute(sources);
    order.out = fs::absolute(out);
    order.log = fs::absolute(log);
    order.log_octets = std::size_t{log_kib} << 10U;
    order.program_octets = limits.file_octets;
    order.precompile = !without_header;
    exit = build(lane, order, report);
  } else {
    test.program = fs::absolute(program);
    test.deployment = fs::absolute(deployment);
    if (!added_nodes.empty()) test.added_nodes = fs::absolute(added_nodes);
    if (!log.empty()) test.log = fs::absolute(log);
    exit = self_test(lane, test, report);
  }
  say(fmt::format("{}{}{}", report.outcome, report.reason.empty() ? "" : ": ", report.reason));
  if (!a.report.empty()) {
    if (const auto written = write_file_atomically(a.report, to_json(report)); !written)
      return fail(written.error().message);
  }
  return static_cast<int>(exit);
}
