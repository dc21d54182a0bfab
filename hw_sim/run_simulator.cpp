// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/run_simulator.hpp"

#include <array>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <system_error>

#include <dlfcn.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/epoll.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include "base/config.hpp"
#include "base/file.hpp"
#include "base/log.hpp"
#include "base/private_file.hpp"
#include "base/random_octets.hpp"
#include "base/signals.hpp"
#include "base/version.hpp"
#include "hw_sim/cpu_priority.hpp"
#include "hw_sim/event_loop.hpp"
#include "hw_sim/seqpacket_server.hpp"
#include "hw_sim/settings.hpp"
#include "hw_sim/simulator.hpp"
#include "suite/added_nodes.hpp"
#include "suite/instance.hpp"
#include "update/package_keys.hpp"

namespace srfs::sim {
namespace {

using std::filesystem::path;

/// Removes a file of this run at the end, whatever the way out.
class RunFile {
 public:
  RunFile(path file, std::string_view content) : file_(std::move(file)) {
    if (const auto written = write_file_atomically(file_, content); !written)
      throw std::runtime_error(written.error().message);
  }
  ~RunFile() { unlink(file_.c_str()); }
  RunFile(const RunFile&) = delete;
  RunFile& operator=(const RunFile&) = delete;

 private:
  path file_;
};

/// Holds the one place of a simulator in this VAR. The lock ends with the process, however it ends.
class InstanceLock {
 public:
  explicit InstanceLock(path file) : file_(std::move(file)) {
    // A predecessor removes the file on its way out: the lock counts only if the file is still the one at its
    // path.
    for (int attempt = 0; attempt < 10; ++attempt) {
      fd_ = open_lock_file(file_);
      if (!fd_)
        throw std::runtime_error(fmt::format("{}: cannot open: {}", file_.string(), errno_text(errno)));
      if (flock(fd_.get(), LOCK_EX | LOCK_NB) != 0) {
        throw std::runtime_error(
            fmt::format("{} is locked: another hw_sim is running there", file_.string()));
      }
      struct stat held {};
      struct stat found {};
      if (fstat(fd_.get(), &held) == 0 && stat(file_.c_str(), &found) == 0 && held.st_ino == found.st_ino)
        return;
    }
    throw std::runtime_error(fmt::format("{}: cannot lock", file_.string()));
  }
  ~InstanceLock() { unlink(file_.c_str()); }
  InstanceLock(const InstanceLock&) = delete;
  InstanceLock& operator=(const InstanceLock&) = delete;

 private:
  path file_;
  Fd fd_;
};

/// A random AES-256 key for the uplink, unless there is one. Flight keys never come from here.
void create_test_key(const path& file) {
  if (std::filesystem::exists(file)) return;
  std::filesystem::create_directories(file.parent_path());
  std::array<std::uint8_t, 32> key{};
  if (!fill_random(key)) throw std::runtime_error("cannot get random numbers");
  const Fd fd(open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  const std::string text = to_hex(key) + '\n';
  if (!fd || write(fd.get(), text.data(), text.size()) != static_cast<ssize_t>(text.size())) {
    throw std::runtime_error(fmt::format("{}: cannot create: {}", file.string(), errno_text(errno)));
  }
  log::info("created the TEST key {} (random, for the simulation only)", file.string());
}

/// The pair that signs packages of sources, unless there is a public key: with one of its own an operator has
/// the seed elsewhere.
void create_package_test_keys(const path& var) {
  const path public_file = var / update::public_key_file;
  const path seed_file = var / "ground" / "package_test.seed";
  if (std::filesystem::exists(public_file)) return;
  std::filesystem::create_directories(public_file.parent_path());
  std::filesystem::create_directories(seed_file.parent_path());
  const auto made = [](const auto& result) {
    if (!result) throw std::runtime_error(result.error().message);
  };
  if (!std::filesystem::exists(seed_file)) made(update::save_new_seed(seed_file, update::new_seed()));
  const auto seed = update::load_seed(seed_file);
  made(seed);
  made(update::save_new_public_key(public_file, update::public_key_of(*seed)));
  log::info("created the TEST key {} (its seed: {}; for the simulation only)", public_file.string(),
            seed_file.string());
}

/// Beside this program; that of a mission outside the tree is elsewhere: in bin beside this library's folder.
path srfs_program() {
  const path beside = std::filesystem::read_symlink("/proc/self/exe").parent_path() / "srfs";
  Dl_info self{};
  if (std::filesystem::exists(beside) || dladdr(reinterpret_cast<const void*>(&run_simulator), &self) == 0 ||
      self.dli_fname == nullptr)
    return beside;
  const path prefix = std::filesystem::absolute(self.dli_fname).parent_path().parent_path();
  for (const path& each : {prefix, prefix.parent_path()}) {  // lib may have a folder for the architecture
    if (std::filesystem::exists(each / "bin" / "srfs")) return each / "bin" / "srfs";
  }
  return beside;
}

void kill_all_nodes(const path& deployment_file, const path& var) {
  const suite::VarPaths paths{var};
  for (const auto& node : suite::load_deployment(deployment_file, paths).deployment.nodes) {
    if (const auto process = suite::open_instance(paths, node.name)) process->signal(SIGKILL);
  }
}

int simulate(const PeripheralModels& models, const path& deployment_file, const path& var) {
  SimulationSettings settings = read_settings(ConfigSection::load(deployment_file));
  settings.peripherals = suite::load_deployment(deployment_file, {var}).deployment.peripherals;
  const path run = var / "run";
  std::filesystem::create_directories(var);
  (void)open_private_folder(run, true);  // what fails, fails again at the lock
  const InstanceLock lock(run / "hw_sim.lock");
  unlink((run / "hw_sim.ready").c_str());  // of a predecessor that was killed
  for (const std::string& key : settings.key_files)
    create_test_key(path(key).is_absolute() ? path(key) : var / key);
  create_package_test_keys(var);

  if (const int error = put_before_the_tested(); error != 0)
    log::info("cannot raise the priority, hw_sim may have to wait for a CPU: {}", errno_text(error));
  EventLoop loop;
  const Fd signals = termination_signals();
  ignore_broken_pipes();
  loop.watch(signals.get(), EPOLLIN, [&](std::uint32_t, MonotonicTime) { loop.stop(); });

  const std::vector<std::string> restart_command{srfs_program().string(),
                                                 "restart",
                                                 "--deployment",
                                                 deployment_file.string(),
                                                 "--var",
                                                 var.string(),
                                                 "--if-up"};
  const auto kill_computer = [&] { kill_all_nodes(deployment_file, var); };
  const auto simulator = Simulator::create(loop, settings, models, var, restart_command, kill_computer);
  if (!simulator) throw std::runtime_error(simulator.error());
  const RunFile pid(run / "hw_sim.pid", fmt::format("{}\n", getpid()));
  const RunFile ready(run / "hw_sim.ready", fmt::format("{}\n", getpid()));
  log::info("ready: {} in {}, operator's port {}", deployment_file.string(), var.string(),
            (var / "rs422").string());
  loop.run();
  log::info("stopped");
  return 0;
}

int control(const std::string& request, const path& var) {
  const auto reply = ask_seqpacket(var / "run" / "sim_control.sock", request, seconds(5));
  if (!reply) {
    std::cerr << reply.error() << '\n';
    return 2;
  }
  std::cout << *reply << '\n';
  return reply->find("\"ok\":true") != std::string::npos ? 0 : 1;
}

}  // namespace

int run_simulator(int argc, char** argv, const PeripheralModels& models) {
  CLI::App app{
      "The simulated world around the on-board computer: CAN bus with its peripherals, GPS, RS422, GPIO, "
      "watchdog."};
  std::string deployment;
  std::string var = "var";
  std::string request;
  auto* deployment_option =
      app.add_option("--deployment", deployment, "Deployment file (launch_config/NAME.yaml)");
  app.add_option("--var", var, "Folder of the running deployment")->capture_default_str();
  auto* control_option = app.add_option(
      "--control", request, "Send one JSON request to the running simulator, print its reply, exit");
  control_option->excludes(deployment_option);
  app.set_version_flag("--version", version());
  CLI11_PARSE(app, argc, argv);

  log::set_name("hw_sim");
  try {
    const path absolute_var = std::filesystem::absolute(var).lexically_normal();
    if (!request.empty()) return control(request, absolute_var);
    if (deployment.empty()) throw std::runtime_error("--deployment is required (see --help)");
    return simulate(models, std::filesystem::absolute(deployment), absolute_var);
  } catch (const ConfigError& e) {
    log::fatal("{}", e.what());
    return 2;
  } catch (const std::exception& e) {  // start-up errors end here, with their message
    log::fatal("{}", e.what());
    return 1;
  }
}

}  // namespace srfs::sim
