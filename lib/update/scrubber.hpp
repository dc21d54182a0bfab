// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/fd.hpp"
#include "base/result.hpp"
#include "base/sha256.hpp"
#include "base/time.hpp"
#include "update/golden_manifest.hpp"

namespace srfs::update {

/// A file that must not rot.
struct ScrubFile {
  std::filesystem::path path;  ///< absolute, no link
  ScrubKind kind = ScrubKind::text;
  std::string sha256;  ///< of a version, which itself states the required value; else empty
};

enum class ScrubMode : std::uint8_t {
  watch,   ///< what was changed on purpose is reported, and left as it is
  start,   ///< the first round of a process: what was changed on purpose is good from now on
  retake,  ///< everything is good as it is now, by command
};

struct ScrubFinding {
  enum class What : std::uint8_t {
    damaged,  ///< found
    mended,
    left,  ///< not repaired: no good copy, not possible, or changed on purpose
  };
  What what = What::damaged;
  std::string path;
  std::string why;  ///< for people
};

struct ScrubStatus {
  std::uint32_t rounds = 0;  ///< whole ones of this process
  bool running = false;
  std::size_t files = 0;
  std::size_t checked = 0;  ///< of this round
  std::uint64_t octets = 0;
  std::uint32_t damaged = 0;  ///< since the start of this process
  std::uint32_t mended = 0;
  std::uint32_t taken = 0;     ///< files taken for good in the round that ended last
  std::uint32_t lost = 0;      ///< without a good copy, in the round that ended last
  std::uint32_t unmended = 0;  ///< with one, and yet not repaired, in the round that ended last
  UtcTime last_round;
  std::string build;
  std::string last_damaged;
};

/// Compares files with the digests that were taken of them once, and repairs rotten ones from a good copy.
/// The folder holds the copies, named by their SHA-256, and the manifest in two copies, manifest_a and
/// manifest_b, each replaced atomically; after a power loss at any instant the next round goes on from what
/// is there. What is damaged in both places is reported and left. A round works in slices, so that nothing
/// else waits for it. One thread; blocks on the disk.
class Scrubber {
 public:
  struct Settings {
    std::filesystem::path folder;
    std::size_t slice_octets = 131072;
    nanoseconds settled_after = std::chrono::minutes(2);  ///< without a write
    std::uint64_t keep_free_octets = 64U << 20U;          ///< of the disk: no copy is taken that leaves less
  };
  explicit Scrubber(Settings settings);
  ~Scrubber();
  Scrubber(const Scrubber&) = delete;
  Scrubber& operator=(const Scrubber&) = delete;

  /// A round begins; nothing while one is under way. What is watched and not among @p files is watched on:
  /// it is gone by damage, unless another build was installed or the mode is retake. Versions that are not
  /// among them are given up.
  void begin(std::vector<ScrubFile> files, ScrubMode mode, UtcTime now);
  /// The next slice: reads, or copies, slice_octets at most. @return false: the round has ended
  bool step(UtcTime now);

  [[nodiscard]] const ScrubStatus& status() const { return status_; }
  /// Since the last call, in order.
  [[nodiscard]] std::vector<ScrubFinding> take_findings() { return std::exchange(findings_, {}); }

 private:
  class Pass;
  enum class Phase : std::uint8_t { read_file, read_copy, take, mend_file, mend_copy };

  void read_manifest();
  [[nodiscard]] Result<void, std::string> save_manifest();
  void next_file(UtcTime now);
  void finish_round(UtcTime now);
  void after_file();
  void after_copy(bool good);
  void after_take();
  void after_mend();
  void begin_copy(Phase phase, const std::filesystem::path& from, const std::filesystem::path& to);
  [[nodiscard]] Result<void, std::string> place_copy();
  void say(ScrubFinding::What what, std::string why);
  void lose(std::string why);
  void leave(std::string why);
  [[nodiscard]] std::filesystem::path copy_of(const GoldenFile& file) const {
    return settings_.folder / file.sha256;
  }

  const Settings settings_;
  GoldenManifest manifest_;
  bool manifest_read_ = false;
  bool manifest_changed_ = false;
  bool manifest_damaged_ = false;  ///< one copy was
  ScrubMode mode_ = ScrubMode::watch;
  bool other_build_ = false;  ///< another build was installed than the one in the manifest
  std::vector<ScrubFile> files_;
  std::size_t next_ = 0;
  // The file of this moment.
  ScrubFile file_;
  std::optional<FoundFile> found_;
  std::uint32_t found_mode_ = 0;
  GoldenFile golden_;
  Phase phase_ = Phase::read_file;
  std::unique_ptr<Pass> pass_;
  std::filesystem::path target_;
  ScrubStatus status_;
  std::uint32_t taken_ = 0;
  std::uint32_t lost_ = 0;
  std::uint32_t unmended_ = 0;
  std::vector<ScrubFinding> findings_;
};

}  // namespace srfs::update
