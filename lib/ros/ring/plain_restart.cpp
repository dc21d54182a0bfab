#include "ros/ring/plain_restart.hpp"

#include <csignal>

#include <poll.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "base/fd.hpp"
#include "ros/launcher.hpp"

namespace srfs::ros {
namespace {

using What = RestartOutcome::What;
constexpr int kill_patience_ms = 500;

RestartOutcome outcome(What what, pid_t pid = 0, std::string reason = {}) {
  return {what, pid, std::nullopt, std::move(reason)};
}

}  // namespace

RestartOutcome plain_restart(const Deployment& deployment, const VarPaths& var,
                             const Accusation& accusation) {
  const NodeEntry* entry = deployment.find(accusation.subject);
  if (entry == nullptr) return outcome(What::not_believed);
  if (const auto holder = find_instance(var, accusation.subject)) {
    if (holder->pid != accusation.pid) return outcome(What::renewed, holder->pid);
    const Fd process(static_cast<int>(syscall(SYS_pidfd_open, holder->pid, 0)));
    const auto again = find_instance(var, accusation.subject);
    if (process && again && again->pid == holder->pid) {
      syscall(SYS_pidfd_send_signal, process.get(), SIGKILL, nullptr, 0);
      pollfd exit{process.get(), POLLIN, 0};
      if (poll(&exit, 1, kill_patience_ms) != 1) return outcome(What::unkillable);
    }
  }
  const auto pid = launch({deployment, var, own_bin_folder(), to_text(accusation.fault)}, *entry);
  return pid ? outcome(What::restarted, *pid) : outcome(What::cannot_start, 0, pid.error());
}

}  // namespace srfs::ros
