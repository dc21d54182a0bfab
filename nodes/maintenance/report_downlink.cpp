// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/report_downlink.hpp"

#include <algorithm>
#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/fd.hpp"
#include "base/file.hpp"

namespace srfs {
namespace {

constexpr std::size_t largest_report = 1U << 20;  // one has 64 KiB of log, its backtrace and a header
constexpr std::string_view extension = ".report";
constexpr std::string_view copy_name = ".report";  // the file transfer passes over names with a dot in front

tl::unexpected<QueueFailure> failure(const std::filesystem::path& path, int error) {
  const QueueError kind = error == ENOENT ? QueueError::gone : QueueError::disk;
  return Err(QueueFailure{kind, fmt::format("{}: {}", path.string(), errno_text(error))});
}

/// Removes copies that were begun and not finished.
std::size_t count_reports(const std::filesystem::path& outbox, std::error_code& ec) {
  std::size_t count = 0;
  for (std::filesystem::directory_iterator it(outbox, ec), end; !ec && it != end; it.increment(ec)) {
    const std::string name = it->path().filename().string();
    std::error_code ignored;
    if (name.starts_with(copy_name)) {
      std::filesystem::remove(it->path(), ignored);
    } else if (name.ends_with(extension)) {
      ++count;
    }
  }
  return count;
}

/// As link(2) across file systems. @return 0 or errno
int copy_into(const std::filesystem::path& from, const std::filesystem::path& to) {
  const auto content = read_file(from, largest_report);
  if (!content) return EIO;
  const auto unfinished = to.parent_path() / copy_name;
  if (!write_file_atomically(unfinished, *content)) return EIO;
  return rename(unfinished.c_str(), to.c_str()) == 0 ? 0 : errno;
}

}  // namespace

const suite::CrashReport* choose_report(const std::vector<suite::CrashReport>& reports,
                                        std::optional<std::uint32_t> incarnation) {
  const auto found = std::find_if(reports.rbegin(), reports.rend(), [&](const suite::CrashReport& report) {
    return !incarnation || report.incarnation == *incarnation;
  });
  return found == reports.rend() ? nullptr : &*found;
}

Result<QueuedReport, QueueFailure> queue_report(const std::filesystem::path& outbox, const std::string& name,
                                                const std::filesystem::path& file) {
  std::error_code ec;
  std::filesystem::create_directories(outbox, ec);
  if (ec) return failure(outbox, ec.value());
  const Fd folder(open(outbox.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder) return failure(outbox, errno);

  QueuedReport queued{name + std::string(extension), 0};
  const auto place = outbox / queued.name;
  if (!std::filesystem::exists(place, ec)) {
    const std::size_t waiting = count_reports(outbox, ec);
    if (ec) return failure(outbox, ec.value());
    if (waiting >= queued_reports_max) {
      return Err(
          QueueFailure{QueueError::full, fmt::format("{} reports wait in {}", waiting, outbox.string())});
    }
    // What replaces the file leaves a link to it as it was.
    int error = link(file.c_str(), place.c_str()) == 0 ? 0 : errno;
    // EPERM: no links here, or none of another user's file (protected_hardlinks).
    if (error == EXDEV || error == EPERM) error = copy_into(file, place);
    if (error != 0 && error != EEXIST) return failure(file, error);
  }
  if (fsync(folder.get()) != 0) return failure(outbox, errno);
  struct stat status {};
  // 0 when the ground has it already: the transfer is that quick.
  if (stat(place.c_str(), &status) == 0) queued.octets = static_cast<std::uint64_t>(status.st_size);
  return queued;
}

}  // namespace srfs
