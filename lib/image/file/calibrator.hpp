// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "image/file/master_store.hpp"

namespace srfs::image {

/// Takes out of the frames of one run what their detector adds: of each kind the newest master that fits the
/// frame and whose file is whole. A flat only together with a dark: without it the division would spread the
/// bias by the flat's pattern. The store is listed once, a master is read when a frame needs it and kept
/// while it fits: 8 octets a pixel. Blocks on the disk.
class Calibrator {
 public:
  Calibrator(MasterStore store, MastersUsed wanted) : store_(std::move(store)), wanted_(wanted) {}

  struct Applied {
    std::optional<std::uint32_t> dark;  ///< generation; nothing: none fits
    std::optional<std::uint32_t> flat;
    std::vector<std::string> notes;  ///< why there is none, where there are others or one cannot be used
  };
  /// @return what was taken out of the frame, or why the method cannot use it
  [[nodiscard]] Result<Applied, Refusal> apply(Frame& frame);

  /// Each that was applied to a frame, in that order. At most 2 x MasterStore::masters_most.
  [[nodiscard]] const std::vector<StoredMaster>& used() const { return used_; }
  /// Files that are broken, each once: ready to print.
  [[nodiscard]] std::vector<std::string> take_problems() { return std::exchange(problems_, {}); }

 private:
  struct Choice {
    MasterKind kind;
    bool is_listed = false;
    std::vector<StoredMaster> masters;  ///< newest first, without those found to be broken
    std::optional<StoredMaster> current;
    Master master;  ///< of current
  };
  /// Finds the master for a frame. @return why there is none; empty: it is there, or there are none at all
  [[nodiscard]] std::string choose(Choice& choice, const DetectorSetting& frame);
  /// Whether one is listed, whole or not, that fits the frame.
  [[nodiscard]] bool has_fitting(Choice& choice, const DetectorSetting& frame);
  void list(Choice& choice);

  MasterStore store_;
  MastersUsed wanted_;
  Choice dark_{MasterKind::dark, false, {}, {}, {}};
  Choice flat_{MasterKind::flat, false, {}, {}, {}};
  std::vector<StoredMaster> used_;
  std::vector<std::string> problems_;
};

}  // namespace srfs::image
