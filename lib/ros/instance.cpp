#include "ros/instance.hpp"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <sstream>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.hpp"
#include "base/time.hpp"

namespace srfs::ros {
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

}  // namespace

std::filesystem::path VarPaths::memory() const {
  // Below /dev/shm two deployments differ by the place of their folders.
  std::uint64_t hash = 0xCBF29CE484222325;  // FNV-1a
  for (const char c : (std::filesystem::absolute(root) / "").lexically_normal().string())
    hash = (hash ^ static_cast<std::uint8_t>(c)) * 0x100000001B3;
  return std::filesystem::path("/dev/shm") / fmt::format("srfs_{:016x}", hash);
}

Result<InstanceLock, std::string> InstanceLock::take(const VarPaths& var, const std::string& node) {
  std::error_code ec;
  std::filesystem::create_directories(var.run(), ec);
  const auto path = var.instance_lock(node);
  Fd fd(open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644));
  if (!fd) return Err(fmt::format("{}: {}", path.string(), errno_text(errno)));
  struct flock lock = whole_file(F_WRLCK);
  if (fcntl(fd.get(), F_SETLK, &lock) == 0) {
    own_instance() = {std::filesystem::absolute(path), read_text(fd.get()).incarnation, 0, "-"};
    return InstanceLock(std::move(fd));
  }
  fd.reset();
  const auto other = find_instance(var, node);
  return Err(fmt::format("{} runs already as pid {}", node, other ? other->pid : 0));
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
  const Fd fd(open(var.instance_lock(node).c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd) return std::nullopt;
  struct flock lock = whole_file(F_WRLCK);
  // F_GETLK names the holder.
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

const std::filesystem::path domain_folder = "/tmp/srfs_domains";

/// The lock file of a domain with the given flock, or why not (errno). The last holder removes the file, so a
/// lock on a removed file is no lock: then the file is opened anew.
Result<Fd, int> lock_domain(int domain, int operation) {
  std::error_code ec;
  if (std::filesystem::create_directories(domain_folder, ec)) {
    std::filesystem::permissions(domain_folder, std::filesystem::perms::all, ec);
  }
  while (true) {
    Fd fd(open((domain_folder / std::to_string(domain)).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666));
    if (!fd || flock(fd.get(), operation | LOCK_NB) != 0) return Err(errno);
    struct stat status {};
    if (fstat(fd.get(), &status) == 0 && status.st_nlink > 0) return fd;
  }
}

}  // namespace

Result<DomainLock, std::string> DomainLock::allocate(std::optional<int> wanted, int first) {
  for (int domain = wanted.value_or(first); domain <= wanted.value_or(101); ++domain) {
    if (auto fd = lock_domain(domain, LOCK_EX)) return DomainLock(domain, std::move(*fd));
  }
  return Err(
      wanted ? fmt::format("DDS domain {} is in use by another running suite", *wanted)
             : fmt::format("no free DDS domain from {} to 101 (locks in {})", first, domain_folder.string()));
}

Result<DomainLock, std::string> DomainLock::share(int domain) {
  auto fd = lock_domain(domain, LOCK_SH);
  if (fd) return DomainLock(domain, std::move(*fd));
  return Err(fmt::format("cannot share DDS domain {} (lock in {}): {}", domain, domain_folder.string(),
                         errno_text(fd.error())));
}

DomainLock::~DomainLock() {
  if (!fd_ || flock(fd_.get(), LOCK_EX | LOCK_NB) != 0) return;  // others still hold it
  std::error_code ec;
  std::filesystem::remove(domain_folder / std::to_string(domain_), ec);
}

void DomainLock::downgrade() {
  flock(fd_.get(), LOCK_SH | LOCK_NB);
}

}  // namespace srfs::ros
