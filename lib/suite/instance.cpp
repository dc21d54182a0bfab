// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/instance.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <fstream>
#include <sstream>
#include <thread>

#include <fcntl.h>
#include <fmt/format.h>
#include <pwd.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.hpp"
#include "base/log.hpp"
#include "base/private_file.hpp"
#include "base/time.hpp"

namespace srfs::suite {
namespace {

struct flock whole_file(short type) {
  struct flock lock {};
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  return lock;
}

// Closing any descriptor of a file drops this process' record lock on it, so one's own lock file is never
// opened again.
struct OwnInstance {
  std::filesystem::path lock_file;
  std::uint32_t predecessor = 0;
  std::uint32_t incarnation = 0;
  std::string version = "-";
};
OwnInstance& own_instance() {
  static OwnInstance instance;
  return instance;
}

/// What the holder of a lock file wrote into it, or an earlier holder.
struct LockText {
  pid_t writer = 0;
  std::uint32_t incarnation = 0;
  std::string version;
};

LockText read_text(int fd) {
  char buffer[128] = {};
  if (pread(fd, buffer, sizeof buffer - 1, 0) <= 0) return {};
  std::istringstream in(buffer);
  LockText text;
  if (!(in >> text.writer >> text.incarnation >> text.version)) return {};
  return text;
}

std::optional<std::uint32_t> read_number(const std::filesystem::path& file) {
  const auto text = read_file(file, 64);
  if (!text) return std::nullopt;
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), value);
  return error == std::errc() ? std::optional(value) : std::nullopt;
}

/// Whether the folder is this user's alone to write to. This user's process makes a missing one, if it may.
bool is_own_folder(const std::filesystem::path& folder, uid_t user) {
  struct stat status {};
  if (lstat(folder.c_str(), &status) != 0) {
    if (user != geteuid() || mkdir(folder.c_str(), S_IRWXU) != 0 || lstat(folder.c_str(), &status) != 0)
      return false;
  }
  return S_ISDIR(status.st_mode) && status.st_uid == user && (status.st_mode & (S_IWGRP | S_IWOTH)) == 0;
}

}  // namespace

VarPaths VarPaths::at(const std::filesystem::path& var) {
  std::error_code ec;
  auto real = std::filesystem::weakly_canonical(std::filesystem::absolute(var), ec);
  if (ec) real = std::filesystem::absolute(var).lexically_normal();
  return {real.has_filename() ? real : real.parent_path()};
}

std::vector<std::filesystem::path> runtime_folders(uid_t user) {
  return {"/run/srfs", fmt::format("/run/user/{}/srfs", user)};
}

std::optional<std::filesystem::path> runtime_folder(uid_t user) {
  for (const auto& folder : runtime_folders(user)) {
    if (is_own_folder(folder, user)) return folder;
  }
  return std::nullopt;
}

std::string VarPaths::memory_name() const {
  std::uint64_t hash = 0xCBF29CE484222325;  // FNV-1a
  for (const char c : (std::filesystem::absolute(root) / "").lexically_normal().string())
    hash = (hash ^ static_cast<std::uint8_t>(c)) * 0x100000001B3;
  return fmt::format("{:016x}", hash);
}

std::filesystem::path VarPaths::memory() const {
  const uid_t user = owner().value_or(geteuid());
  std::error_code ec;
  const auto recorded = std::filesystem::read_symlink(memory_link(), ec);
  // The link only chooses: whoever could write it gets no other folder used, or emptied.
  for (const auto& folder : runtime_folders(user)) {
    if (!ec && recorded == folder / memory_name() && is_own_folder(folder, user)) return recorded;
  }
  const auto folder = runtime_folder(user);
  return folder ? *folder / memory_name() : memory_link();
}

std::optional<uid_t> VarPaths::owner() const {
  struct stat status {};
  return stat(root.c_str(), &status) == 0 ? std::optional(status.st_uid) : std::nullopt;
}

bool VarPaths::may_name(pid_t pid) const {
  struct stat status {};
  const auto of_record = owner();
  return of_record && stat(fmt::format("/proc/{}", pid).c_str(), &status) == 0 &&
         (*of_record == 0 || status.st_uid == *of_record);
}

Result<void, std::string> VarPaths::make_run_folder() const {
  std::error_code ec;
  std::filesystem::create_directories(root, ec);
  if (const auto made = open_private_folder(run(), true, owner()); !made) return Err(made.error().message);
  const auto chosen = memory();
  // A link to a runtime folder that is gone (its user has logged out) is in the way of the folder itself.
  if (chosen == memory_link() && std::filesystem::is_symlink(chosen, ec)) std::filesystem::remove(chosen, ec);
  if (chosen == memory_link() || std::filesystem::read_symlink(memory_link(), ec) == chosen) return {};
  // An older choice is gone with its folder. One that cannot be noted is made again, equally.
  std::filesystem::remove(memory_link(), ec);
  std::filesystem::create_symlink(chosen, memory_link(), ec);
  return {};
}

Result<InstanceLock, std::string> InstanceLock::take(const VarPaths& var, const std::string& node) {
  if (const auto made = var.make_run_folder(); !made) return Err(made.error());
  const auto path = var.instance_lock(node);
  Fd fd = open_lock_file(path);
  if (!fd) return Err(fmt::format("{}: {}", path.string(), errno_text(errno)));
  struct flock lock = whole_file(F_WRLCK);
  if (fcntl(fd.get(), F_SETLK, &lock) == 0) {
    own_instance() = {std::filesystem::absolute(path), read_text(fd.get()).incarnation, 0, "-"};
    return InstanceLock(std::move(fd));
  }
  fd.reset();
  const auto other = find_instance(var, node);
  return Err(fmt::format("{} is already running as pid {}", node, other ? other->pid : 0));
}

std::optional<Process> open_instance(const VarPaths& var, const std::string& node) {
  const auto instance = find_instance(var, node);
  if (!instance) return std::nullopt;
  auto process = Process::open(instance->pid);
  // Still the lock's holder: then the descriptor names it, and no later process of that number.
  const auto again = find_instance(var, node);
  if (!process || !again || again->pid != instance->pid) return std::nullopt;
  return process;
}

std::optional<RunningInstance> find_instance(const VarPaths& var, const std::string& node) {
  if (std::filesystem::absolute(var.instance_lock(node)) == own_instance().lock_file) {
    return RunningInstance{getpid(), own_instance().incarnation, own_instance().version};
  }
  const Fd fd(open(var.instance_lock(node).c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC));
  if (!fd) return std::nullopt;
  struct flock lock = whole_file(F_RDLCK);
  // F_GETLK names the holder: of an exclusive lock, which a shared one would conflict with.
  if (fcntl(fd.get(), F_GETLK, &lock) != 0 || lock.l_type == F_UNLCK) return std::nullopt;
  RunningInstance instance{lock.l_pid, 0, "-"};
  // The text may still be the predecessor's: it counts only when it names the lock's holder.
  if (const LockText text = read_text(fd.get()); text.writer == lock.l_pid) {
    instance.incarnation = text.incarnation;
    instance.version = text.version;
  }
  return instance;
}

void InstanceLock::publish(std::uint32_t incarnation, const std::string& version) {
  own_instance().incarnation = incarnation;
  own_instance().version = version;
  const std::string text = fmt::format("{:<126}\n", fmt::format("{} {} {}", getpid(), incarnation, version));
  [[maybe_unused]] const ssize_t ignored = pwrite(fd_.get(), text.data(), text.size(), 0);
}

Incarnation next_incarnation(const VarPaths& var, const std::string& node) {
  const auto file = var.state(node) / "incarnation";
  Incarnation next;
  std::error_code ec;
  if (std::filesystem::exists(file, ec)) {
    const auto last = read_number(file);
    // Seconds since 2020 are above every honest count, so a lost count still goes up.
    next.number =
        last ? *last + 1 : static_cast<std::uint32_t>(system_utc_now().ns() / 1'000'000'000 - 1'577'836'800);
  }
  // The predecessor wrote its number into the lock file in place, which a full disk does not prevent.
  const bool own = own_instance().lock_file == std::filesystem::absolute(var.instance_lock(node));
  const std::uint32_t predecessor = own ? own_instance().predecessor : 0;
  next.number = std::max(next.number, predecessor + 1);
  if (const auto written = write_file_atomically(file, fmt::format("{}\n", next.number)); !written) {
    // The next start may read the same old number: without a predecessor's word the seconds since boot keep
    // the two apart.
    if (predecessor == 0) next.number += static_cast<std::uint32_t>(monotonic_now().ns() / 1'000'000'000);
    next.not_durable_because = written.error().message;
  }
  return next;
}

StartRecord read_start_record(const VarPaths& var, const std::string& node) {
  StartRecord record;
  if (const auto text = read_file(var.state(node) / "starts", 4096)) {
    std::istringstream in(*text);
    StartRecord read;
    if (in >> read.starts >> read.restarts && std::getline(in >> std::ws, read.last_cause)) record = read;
  }
  return record;
}

void write_start_record(const VarPaths& var, const std::string& node, const StartRecord& record) {
  std::string cause = record.last_cause.substr(0, 200);
  std::replace(cause.begin(), cause.end(), '\n', ' ');
  (void)write_file_atomically(var.state(node) / "starts",
                              fmt::format("{} {} {}\n", record.starts, record.restarts, cause));
}

namespace {

constexpr int highest_domain = 101;
constexpr unsigned first_dds_port = 7400;  // OMG DDSI-RTPS 9.6.1.1
constexpr unsigned dds_ports_of_a_domain = 250;
constexpr int share_attempts = 20;
constexpr milliseconds share_pause{5};

/// Where this user's suites hold their domains.
struct DomainFolder {
  std::filesystem::path path;
  bool of_all_suites;  ///< of this user; false: the suite's own, other suites do not see it
};

DomainFolder domain_folder(const std::string& suite) {
  if (const auto folder = runtime_folder(geteuid())) return {*folder / "domains", true};
  const passwd* entry = getpwuid(geteuid());
  const std::filesystem::path home = entry != nullptr ? entry->pw_dir : "";
  if (!home.empty() && is_own_folder(home, geteuid())) {
    (void)is_own_folder(home / ".cache", geteuid());  // made
    return {home / ".cache" / "srfs" / "domains", true};
  }
  return {std::filesystem::path(suite) / "run" / "domains", false};
}

struct DomainRefusal {
  bool held;
  std::string text;
};

/// The lock file of a domain with the given flock, or why not. The last holder removes the file, so a lock on
/// a removed file is no lock: then the file is opened anew.
Result<Fd, DomainRefusal> lock_domain(const std::filesystem::path& file, int operation) {
  while (true) {
    auto fd = open_private(file, O_RDWR | O_CREAT);
    if (!fd) return Err(DomainRefusal{false, fd.error().message});
    if (flock(fd->get(), operation | LOCK_NB) != 0) {
      const int error = errno;
      return Err(DomainRefusal{error == EWOULDBLOCK,
                               fmt::format("{}: cannot lock: {}", file.string(), errno_text(error))});
    }
    struct stat status {};
    if (fstat(fd->get(), &status) == 0 && status.st_nlink > 0) return std::move(*fd);
  }
}

}  // namespace

std::set<int> domains_of_other_users(std::istream& udp_sockets, std::optional<uid_t> own) {
  std::set<int> domains;
  std::string line;
  std::getline(udp_sockets, line);  // the heading
  while (std::getline(udp_sockets, line)) {
    std::istringstream in(line);
    std::string number, local, remote, state, queues, timer, retransmissions;
    uid_t user = 0;
    if (!(in >> number >> local >> remote >> state >> queues >> timer >> retransmissions >> user)) continue;
    unsigned port = 0;
    const char* const end = local.data() + local.size();
    const auto colon = local.rfind(':');
    if (user == own || colon == std::string::npos ||
        std::from_chars(local.data() + colon + 1, end, port, 16).ec != std::errc() || port < first_dds_port)
      continue;
    const auto domain = static_cast<int>((port - first_dds_port) / dds_ports_of_a_domain);
    if (domain <= highest_domain) domains.insert(domain);
  }
  return domains;
}

Result<DomainLock, std::string> DomainLock::allocate(std::optional<int> wanted, int first,
                                                     const std::string& suite) {
  const DomainFolder folder = domain_folder(suite);
  std::set<int> of_others;
  if (!wanted) {
    std::ifstream udp_sockets("/proc/net/udp");
    of_others =
        domains_of_other_users(udp_sockets, folder.of_all_suites ? std::optional(geteuid()) : std::nullopt);
  }
  for (int domain = wanted.value_or(first); domain <= wanted.value_or(highest_domain); ++domain) {
    if (of_others.contains(domain)) continue;
    const auto file = folder.path / std::to_string(domain);
    auto fd = lock_domain(file, LOCK_EX);
    if (fd) {
      DomainLock lock(domain, std::move(*fd), file);
      lock.sign(suite);
      return lock;
    }
    if (!fd.error().held) return Err(fmt::format("cannot hold a DDS domain: {}", fd.error().text));
  }
  return Err(wanted ? fmt::format("DDS domain {} is in use by another running suite", *wanted)
                    : fmt::format("no free DDS domain from {} to {} (locks in {})", first, highest_domain,
                                  folder.path.string()));
}

Result<DomainLock, std::string> DomainLock::share(int domain, const std::string& suite) {
  const auto file = domain_folder(suite).path / std::to_string(domain);
  std::string problem;
  // A holder that has it alone is signing it, or another suite is about to fly in it: asked a few times.
  for (int attempt = 0; attempt < share_attempts; ++attempt) {
    if (attempt > 0) std::this_thread::sleep_for(share_pause);
    auto fd = lock_domain(file, LOCK_SH);
    if (fd) {
      DomainLock lock(domain, std::move(*fd), file);
      const std::string other = lock.signature();
      if (other == suite) return lock;
      problem = fmt::format("DDS domain {} is in use by another suite, {}", domain, other);
    } else {
      problem = fmt::format("cannot share DDS domain {}: {}", domain, fd.error().text);
      if (!fd.error().held) break;
    }
    // A domain that has no holder any more is taken, not shared.
    if (auto free = lock_domain(file, LOCK_EX)) {
      DomainLock lock(domain, std::move(*free), file);
      lock.sign(suite);
      lock.downgrade();
      return lock;
    }
  }
  return Err(problem);
}

void DomainLock::sign(const std::string& suite) {
  if (ftruncate(fd_.get(), 0) != 0 || pwrite(fd_.get(), suite.data(), suite.size(), 0) < 0)
    log::warn("{}: {}", file_.string(), errno_text(errno));
}

std::string DomainLock::signature() const {
  std::array<char, 4096> text{};
  const ssize_t octets = pread(fd_.get(), text.data(), text.size(), 0);
  return {text.data(), static_cast<std::size_t>(std::max<ssize_t>(octets, 0))};
}

DomainLock::~DomainLock() {
  if (!fd_ || flock(fd_.get(), LOCK_EX | LOCK_NB) != 0) return;  // others still hold it
  std::error_code ec;
  std::filesystem::remove(file_, ec);
}

void DomainLock::downgrade() {
  flock(fd_.get(), LOCK_SH | LOCK_NB);
}

}  // namespace srfs::suite
