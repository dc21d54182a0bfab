// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string_view>

#include "base/fd.hpp"

namespace srfs::log {

/// A descriptor that lines are written to (stderr) without ever waiting for the reader. A pipe, a terminal or
/// a socket that is full loses the line, counted; a regular file takes it (the page cache does; what the
/// kernel does when memory for it is short is the disk's matter). The descriptor's own flags are
/// not touched: other processes share them. Not thread-safe.
class Output {
 public:
  /// @param fd  stays the caller's; may be redirected at any time
  explicit Output(int fd) : fd_(fd) {}

  /// At most longest_line octets, with the newline. @return false when the line was lost
  bool write(std::string_view line);
  /// The journal reads this descriptor: systemd states it in JOURNAL_STREAM (systemd.exec(5)),
  /// "device:inode".
  [[nodiscard]] bool is_journal();
  /// Lines lost since the start.
  [[nodiscard]] std::uint64_t lost() const { return lost_; }

  /// Below PIPE_BUF: a pipe takes such a line whole or not at all (pipe(7)).
  static constexpr std::size_t longest_line = 2048;

 private:
  enum class Kind : std::uint8_t { none, regular, socket, own, polled };
  void look();
  [[nodiscard]] ssize_t write_some(std::string_view text) const;

  int fd_;
  Kind kind_ = Kind::none;
  Fd own_;  ///< the same pipe or terminal, opened again without blocking
  dev_t device_ = 0;
  ino_t inode_ = 0;
  bool journal_ = false;
  bool line_open_ = false;  ///< only a part of the last line was taken
  std::uint64_t lost_ = 0;
};

}  // namespace srfs::log
