// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/holder_record.hpp"

#include <atomic>
#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include "base/private_file.hpp"

namespace srfs {
namespace {

static_assert(std::atomic_ref<std::uint64_t>::is_always_lock_free);

constexpr std::uint64_t held = std::uint64_t{1} << 63U;  // then the slot (8 bits from 32 on) and the process

}  // namespace

Result<HolderRecord, std::string> HolderRecord::open(const std::filesystem::path& file) {
  const auto problem = [&] { return Err(fmt::format("{}: {}", file.string(), errno_text(errno))); };
  const auto opened = open_private(file, O_RDWR | O_CREAT);
  if (!opened) return Err(opened.error().message);
  const Fd& fd = *opened;
  // A longer file is cut; the octets of a new one are zero: no payload holds the bus.
  if (::ftruncate(fd.get(), sizeof(std::uint64_t)) != 0) return problem();
  // A store into a page without memory behind it would be a SIGBUS.
  errno = ::posix_fallocate(fd.get(), 0, sizeof(std::uint64_t));
  if (errno != 0) return problem();
  void* const page = ::mmap(nullptr, sizeof(std::uint64_t), PROT_READ | PROT_WRITE, MAP_SHARED, fd.get(), 0);
  if (page == MAP_FAILED) return problem();
  return HolderRecord(static_cast<std::uint64_t*>(page));
}

void HolderRecord::Unmap::operator()(std::uint64_t* word) const {
  ::munmap(word, sizeof *word);
}

void HolderRecord::write(const std::optional<Holder>& holder) {
  const std::uint64_t word =
      holder ? held | std::uint64_t{holder->slot & 0xFFU} << 32U | holder->process : std::uint64_t{0};
  std::atomic_ref(*word_).store(word);
}

std::optional<HolderRecord::Holder> HolderRecord::read() const {
  const std::uint64_t word = std::atomic_ref(*word_).load();
  if ((word & held) == 0) return std::nullopt;
  return Holder{word >> 32U & 0xFFU, static_cast<std::uint32_t>(word)};
}

}  // namespace srfs
