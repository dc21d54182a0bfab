// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/link_state_file.hpp"

#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/text.hpp"

namespace srfs {
namespace {

// The copies stand in different blocks of the medium: one torn block cannot take both.
constexpr std::size_t copy_distance = 4096;

}  // namespace

LinkStateFile::Found LinkStateFile::load() {
  Found found;
  const auto content = read_file(path_, 4 * copy_distance);
  if (!content || content->empty()) {
    std::error_code ec;
    found.existed = std::filesystem::exists(path_, ec);
    if (found.existed) found.damaged_copies = 2;
    return found;
  }
  found.existed = true;
  const OctetView octets = as_octets(*content);
  for (const unsigned slot : {0U, 1U}) {
    const std::size_t at = slot * copy_distance;
    std::optional<LinkState> copy;
    if (octets.size() >= at + link_state_octets)
      copy = decode_link_state(octets.subspan(at, link_state_octets));
    if (!copy) {
      ++found.damaged_copies;
    } else if (copy->generation >= found.state.generation) {
      found.state = *copy;
      newest_slot_ = slot;
    }
  }
  return found;
}

Result<void, FileError> LinkStateFile::open_file() {
  if (fd_) return {};
  std::error_code ec;
  std::filesystem::create_directories(path_.parent_path(), ec);
  fd_ = Fd(open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  if (!fd_) return Err(FileError{fmt::format("{}: cannot open: {}", path_.string(), errno_text(errno))});
  const Fd folder(open(path_.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (folder) (void)fsync(folder.get());
  return {};
}

Result<void, FileError> LinkStateFile::store(const LinkState& state) {
  if (auto opened = open_file(); !opened) return opened;
  const Octets copy = encode_link_state(state);
  const unsigned slot = 1 - newest_slot_;
  const auto at = static_cast<off_t>(slot * copy_distance);
  const ssize_t written = pwrite(fd_.get(), copy.data(), copy.size(), at);
  if (written != static_cast<ssize_t>(copy.size()) || fdatasync(fd_.get()) != 0) {
    const int error = written >= 0 && written != static_cast<ssize_t>(copy.size()) ? ENOSPC : errno;
    fd_.reset();
    return Err(FileError{fmt::format("{}: cannot write: {}", path_.string(), errno_text(error))});
  }
  newest_slot_ = slot;
  return {};
}

}  // namespace srfs
