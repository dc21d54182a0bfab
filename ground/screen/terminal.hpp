// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "base/fd.hpp"
#include "base/result.hpp"
#include "ground/screen/line_editor.hpp"
#include "ground/screen/operator_screen.hpp"

namespace srfs::ground::screen {

/// The terminal of this process (ncurses): keys in, frames out. From its beginning to its end SIGINT,
/// SIGTERM, SIGHUP and SIGWINCH come by a descriptor. Its end gives the terminal back as it was. One at a
/// time.
class Terminal {
 public:
  /// The error is ready to print.
  [[nodiscard]] static Result<std::unique_ptr<Terminal>, std::string> open();
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  [[nodiscard]] Size size() const { return size_; }
  /// @param anew  all of it: something else wrote to the terminal
  void show(const Frame& frame, bool anew);

  /// For poll(2): keys, signals.
  [[nodiscard]] int keys() const;
  [[nodiscard]] int signals() const { return signals_.get(); }
  /// nullopt: none waits.
  [[nodiscard]] std::optional<Input> next_input();
  enum class Signal : std::uint8_t { none, resized, end };
  /// What has come; the new size counts from now on.
  [[nodiscard]] Signal take_signals();
  /// The other end is gone.
  [[nodiscard]] bool has_gone() const { return gone_; }

 private:
  struct Screen;
  explicit Terminal(Fd signals);
  void read_size();
  Fd signals_;
  std::unique_ptr<Screen> screen_;
  Size size_;
  bool colours_ = false;
  bool gone_ = false;
};

}  // namespace srfs::ground::screen
