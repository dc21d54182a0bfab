// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/frame_count_file.hpp"

#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "base/crc32c.hpp"
#include "base/fd.hpp"
#include "base/octets.hpp"
#include "base/text.hpp"
#include "nodes/ttc/link/frame_count_page.hpp"

namespace srfs {
namespace {

constexpr std::size_t check_octets = 4;
constexpr std::size_t file_octets = sizeof(std::uint64_t) + check_octets;

}  // namespace

std::optional<wire::TmFrameCounts> FrameCountReserve::wanted(const wire::TmFrameCounts& next) const {
  if (stored_) {
    const auto left = static_cast<std::uint8_t>(stored_->master - next.master);
    if (left > frames_ahead - frames_used && left <= frames_ahead) return std::nullopt;
  }
  wire::TmFrameCounts ahead = next;
  ahead.master = static_cast<std::uint8_t>(next.master + frames_ahead);
  for (std::uint8_t& count : ahead.vc) count = static_cast<std::uint8_t>(count + frames_ahead);
  return ahead;
}

std::optional<wire::TmFrameCounts> FrameCountFile::load() const {
  const auto content = read_file(path_, file_octets);
  if (!content || content->size() != file_octets) return std::nullopt;
  const OctetView octets = as_octets(*content);
  OctetReader reader(octets);
  const std::uint64_t word = reader.u64();
  if (reader.u32() != crc32c(octets.first(file_octets - check_octets))) return std::nullopt;
  return unpack_frame_counts(word);
}

Result<void, FileError> FrameCountFile::store(const wire::TmFrameCounts& next) const {
  OctetWriter writer(file_octets);
  writer.u64(pack_frame_counts(next));
  writer.u32(crc32c(writer.view()));
  const Octets octets = writer.take();
  const auto failed = [&](int error) {
    return Err(FileError{fmt::format("{}: cannot write: {}", path_.string(), errno_text(error))});
  };
  const Fd fd(open(path_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600));
  if (!fd) return failed(errno);
  const ssize_t written = pwrite(fd.get(), octets.data(), octets.size(), 0);
  if (written >= 0 && written != static_cast<ssize_t>(octets.size())) return failed(ENOSPC);
  if (written < 0 || fdatasync(fd.get()) != 0) return failed(errno);
  return {};
}

}  // namespace srfs
