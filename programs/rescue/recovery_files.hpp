// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <mission/structures.hpp>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "programs/rescue/link_store.hpp"
#include "suite/rescue_settings.hpp"
#include "suite/step_down.hpp"

namespace srfs::rescue {

/// Why an order about files failed: code of the dictionary, and the log's line.
struct FilesFailure {
  std::uint16_t code = 0;
  std::string text;
};
template <class T>
using FilesResult = Result<T, FilesFailure>;

struct MendCount {
  std::uint32_t files = 0;  ///< that have a golden copy
  std::uint32_t mended = 0;
  std::uint32_t left = 0;  ///< differ and have no good copy, or could not be written
};

enum class Mend : std::uint8_t {
  damage,      ///< what rotted; what was changed on purpose stays
  everything,  ///< whatever differs, by command
};

/// What is done to the files of a suite that is down. What goes out of the way is renamed into
/// VAR/set_aside/NUMBER, under its path below VAR; of these folders the oldest are deleted (make_room), and
/// nothing else is. Each call may be cut off anywhere and made again. What is on the disk is not trusted: any
/// file may hold any octets, be missing, or be a folder. Blocks on the disk.
class RecoveryFiles {
 public:
  /// @param on_progress  called between the files of work that may take long: feeds the watchdog. A disk that
  /// hangs makes none.
  explicit RecoveryFiles(
      const suite::RescueSettings& settings, std::function<void()> on_progress = [] {})
      : settings_(settings),
        on_progress_(std::move(on_progress)),
        var_(settings.var),
        prefix_(std::filesystem::path(settings.program).parent_path().parent_path()),
        deployment_(settings.deployment) {}

  /// @param number  of the folder that takes what is set aside; made when something is.
  /// @param link    the one of this process: the journal has the counters of the uplink
  /// @return how many files and folders went there
  [[nodiscard]] FilesResult<std::uint32_t> set_aside(mission::RescuePart part, std::uint32_t number,
                                                     LinkStore& link) const;
  /// What a step asks for before the suite starts. Does what it can. @return what could not be done; empty:
  /// nothing
  [[nodiscard]] std::string take_measures(suite::BootStep step, std::uint32_t number, LinkStore& link) const;
  /// Number of the next folder: higher than every one that was made, also when the record of the step is
  /// lost.
  /// @param recorded  the newest one by the record
  [[nodiscard]] std::uint32_t next_number(std::uint32_t recorded) const;
  enum class RoomFor : std::uint8_t {
    measures,  ///< the newest folder stays, whatever happens
    an_order,  ///< on a disk with less than last_mib it goes, too: nothing else on board could free the disk
  };
  /// Makes room in VAR/set_aside for one more folder: the oldest (of the lowest number) go until fewer than
  /// most_set_aside are left and the disk has free_floor_mib; a full disk gets the reserve back. Logged.
  /// @return how many folders went
  std::uint32_t make_room(RoomFor what) const;
  /// Keeps reserve_octets of the disk allocated, as many as there are: on a full disk not even a folder could
  /// be made. make_room() gives them up.
  void keep_reserve() const;
  /// Compares the files of the suite with their golden copies (VAR/golden).
  [[nodiscard]] FilesResult<MendCount> mend(Mend what) const;
  /// @param file    below VAR/files. @param target  relative: below VAR, where the suite keeps files of its
  /// own; absolute: of the installation, a text beside the deployment, or one with a golden copy. Keys and
  /// counters are in none of these places.
  [[nodiscard]] FilesResult<void> restore(const std::string& file, const std::string& target,
                                          std::uint32_t number) const;
  /// @return its name in VAR/files/outbox
  [[nodiscard]] FilesResult<std::string> fetch(const std::string& path) const;
  /// 64 objects at most, as source data of TM 23,13.
  [[nodiscard]] FilesResult<std::vector<Octets>> list(const std::string& folder) const;
  [[nodiscard]] std::uint32_t free_mib() const;

  static constexpr std::size_t most_listed = 64;
  static constexpr std::uint64_t largest_fetched = 64U << 20;
  static constexpr std::size_t most_set_aside = 8;  ///< folders
  static constexpr std::uint32_t free_floor_mib = 64;
  static constexpr std::uint32_t last_mib = 4;
  static constexpr off_t reserve_octets = 1 << 20;
  static constexpr std::uint32_t highest_number = 999'999;  ///< a folder with a higher one is not ours

 private:
  /// Of the folders in VAR/set_aside, the highest first.
  [[nodiscard]] std::vector<std::uint32_t> numbers_aside() const;
  [[nodiscard]] FilesResult<bool> move_aside(const std::filesystem::path& relative,
                                             std::uint32_t number) const;
  [[nodiscard]] std::string use_last_good_versions() const;
  [[nodiscard]] FilesResult<std::filesystem::path> target_path(const std::string& target) const;
  /// @param path  real, absolute
  [[nodiscard]] bool may_be_restored(const std::filesystem::path& path) const;
  [[nodiscard]] bool is_key(const std::filesystem::path& path) const;

  const suite::RescueSettings& settings_;
  std::function<void()> on_progress_;
  std::filesystem::path var_;
  std::filesystem::path prefix_;  ///< of the installation
  std::filesystem::path deployment_;
};

}  // namespace srfs::rescue
