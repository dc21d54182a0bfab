// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "base/time.hpp"

namespace srfs::log {

/// Where in the source a line comes from. The file's name is compared by address: it is a literal.
struct Site {
  const char* file = "";
  std::uint32_t line = 0;
  friend bool operator==(const Site&, const Site&) = default;
};

/// Decides which lines are written, so that no fault can fill the disk or the bus with its own report. A call
/// site may write 10 lines at once and then one a second; all sites together 200 at once and then 50 a
/// second. Lines held back are counted per site and reported with its next line, or by take_due() once the
/// site is quiet. Pure: time passed in. Memory: 6 KiB for 128 sites; of further ones the site that wrote
/// longest ago is forgotten, and its count goes to forgotten(). Not thread-safe.
class RateLimit {
 public:
  static constexpr int site_burst = 10;
  static constexpr nanoseconds site_interval = seconds(1);
  static constexpr int all_burst = 200;
  static constexpr nanoseconds all_interval = milliseconds(20);

  struct Verdict {
    bool write = false;
    std::uint32_t held_back = 0;  ///< lines of this site since the last one written; reported with this one
  };
  /// @param now  not before the previous call
  [[nodiscard]] Verdict on_line(Site site, MonotonicTime now);

  /// What one quiet site held back.
  struct Due {
    Site site;
    std::uint32_t held_back = 0;
  };
  /// A site that may write again and has lines to tell of; nullopt when there is none (now). Call until then.
  [[nodiscard]] std::optional<Due> take_due(MonotonicTime now);

  /// Lines held back since the start.
  [[nodiscard]] std::uint64_t held_back() const { return held_back_; }
  /// Of these, those that no line ever reported by site.
  [[nodiscard]] std::uint64_t forgotten() const { return forgotten_; }

 private:
  /// A token bucket as one time (the generic cell rate algorithm): when it will be full again.
  struct Bucket {
    MonotonicTime full_at;
    bool take(MonotonicTime now, int burst, nanoseconds interval);
    [[nodiscard]] bool has_room(MonotonicTime now, int burst, nanoseconds interval) const;
  };
  struct Entry {
    Site site;
    Bucket bucket;
    std::uint32_t held_back = 0;
  };
  static constexpr std::size_t ways = 4;
  static constexpr std::size_t sets = 32;

  Entry& entry_of(Site site);

  std::array<std::array<Entry, ways>, sets> entries_{};
  Bucket all_;
  std::uint64_t held_back_ = 0;
  std::uint64_t forgotten_ = 0;
};

}  // namespace srfs::log
