// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/frame_count_page.hpp"

#include <array>
#include <atomic>
#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include "base/private_file.hpp"
#include "nodes/ttc/link/downlink_scheduler.hpp"

namespace srfs {
namespace {

static_assert(std::atomic_ref<std::uint64_t>::is_always_lock_free);

// One word, so that a kill at any instruction leaves all counters of one moment.
constexpr std::uint64_t frame_count_marker = 0x5446;   // "TF", in the two highest octets
constexpr std::uint64_t frame_number_marker = 0x544E;  // "TN", likewise
constexpr std::array<std::uint8_t, downlink_channels + 1> frame_count_channels{0, 1, 2, wire::tm_idle_vc};

}  // namespace

std::uint64_t pack_frame_counts(const wire::TmFrameCounts& counts) {
  std::uint64_t word = frame_count_marker << 48U | counts.master;
  for (std::size_t i = 0; i < frame_count_channels.size(); ++i)
    word |= std::uint64_t{counts.vc.at(frame_count_channels.at(i))} << (8 * (i + 1));
  return word;
}

std::optional<wire::TmFrameCounts> unpack_frame_counts(std::uint64_t word) {
  if (word >> 48U != frame_count_marker) return std::nullopt;
  wire::TmFrameCounts counts;
  counts.master = static_cast<std::uint8_t>(word);
  for (std::size_t i = 0; i < frame_count_channels.size(); ++i)
    counts.vc.at(frame_count_channels.at(i)) = static_cast<std::uint8_t>(word >> (8 * (i + 1)));
  return counts;
}

Result<FrameCountPage, std::string> FrameCountPage::open(const std::filesystem::path& file,
                                                         std::optional<uid_t> owner) {
  const auto opened = open_private(file, O_RDWR | O_CREAT, owner);
  if (!opened) return Err(opened.error().message);
  const auto failed = [&](int error) { return Err(fmt::format("{}: {}", file.string(), errno_text(error))); };
  // A store into a page without memory behind it would be a SIGBUS.
  if (const int error = posix_fallocate(opened->get(), 0, sizeof(Words)); error != 0) return failed(error);
  void* const page = mmap(nullptr, sizeof(Words), PROT_READ | PROT_WRITE, MAP_SHARED, opened->get(), 0);
  if (page == MAP_FAILED) return failed(errno);
  return FrameCountPage(static_cast<Words*>(page));
}

void FrameCountPage::Unmap::operator()(Words* words) const {
  munmap(words, sizeof *words);
}

void FrameCountPage::write(const wire::TmFrameCounts& next) {
  std::atomic_ref(words_->counts).store(pack_frame_counts(next));
}

std::optional<wire::TmFrameCounts> FrameCountPage::read() const {
  return unpack_frame_counts(std::atomic_ref(words_->counts).load());
}

void FrameCountPage::write_number(std::uint64_t next) {
  std::atomic_ref(words_->number).store(frame_number_marker << 48U | next);
}

std::optional<std::uint64_t> FrameCountPage::read_number() const {
  const std::uint64_t word = std::atomic_ref(words_->number).load();
  if (word >> 48U != frame_number_marker) return std::nullopt;
  return word & wire::tm_sdls_number_max;
}

}  // namespace srfs
