// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/screen/history_file.hpp"

#include <cerrno>
#include <sstream>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/file.h>

#include "base/fd.hpp"
#include "base/file.hpp"
#include "base/text.hpp"
#include "ground/screen/line_editor.hpp"

namespace srfs::ground::screen {
namespace {

using Lines = std::vector<std::string>;

/// The lock of a file that is replaced whole: a file of its own.
Result<Fd, std::string> lock(const std::filesystem::path& file) {
  constexpr mode_t owner_alone = 0600;
  constexpr int pause_ms = 5;
  Fd lock(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, owner_alone));
  if (!lock) return Err(fmt::format("{}: cannot open: {}", file.string(), errno_text(errno)));
  const MonotonicTime deadline = monotonic_now() + HistoryFile::lock_patience;
  while (::flock(lock.get(), LOCK_EX | LOCK_NB) != 0) {
    if (monotonic_now() >= deadline) return Err(fmt::format("{}: another console holds it", file.string()));
    static_cast<void>(::poll(nullptr, 0, pause_ms));
  }
  return lock;
}

/// The newest lines that fit the bounds, as text.
std::string bounded(Lines& lines) {
  std::size_t first = lines.size();
  std::size_t octets = 0;
  while (first > 0 && lines.size() - first < LineEditor::history_max) {
    octets += lines[first - 1].size() + 1;
    if (octets > HistoryFile::octets_max) break;
    --first;
  }
  lines.erase(lines.begin(), lines.begin() + static_cast<std::ptrdiff_t>(first));
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

}  // namespace

Result<Lines, std::string> HistoryFile::lines() const {
  std::error_code error;
  if (!std::filesystem::exists(file_, error)) return Lines();
  const auto text = read_file(file_, 2 * octets_max);
  if (!text) return Err(text.error().message);
  Lines lines;
  std::istringstream in(*text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

Result<Lines, std::string> HistoryFile::add(const std::string& line) const {
  auto lock_file = file_;
  lock_file += ".lock";
  const auto held = lock(lock_file);
  if (!held) return Err(held.error());
  auto known = lines();
  if (!known) return Err(known.error());
  if (!remember(*known, line)) return known;
  if (const auto written = write_file_atomically(file_, bounded(*known)); !written)
    return Err(written.error().message);
  return known;
}

}  // namespace srfs::ground::screen
