// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.hpp"
#include "tests/simulation/coverage.hpp"

namespace srfs::simulation {

/// Random numbers for one purpose (SplitMix64). Each purpose has a generator of its own, seeded by the run's
/// seed and its name: what one draws changes nothing of what another draws.
class Random {
 public:
  Random(std::uint64_t seed, std::string_view purpose);
  std::uint64_t next();
  /// 0 to @p n - 1; n is 1 or more.
  std::uint64_t below(std::uint64_t n) { return next() % n; }
  bool one_in(std::uint64_t n) { return below(n) == 0; }
  /// From @p low to @p high, microseconds apart.
  nanoseconds between(nanoseconds low, nanoseconds high);

 private:
  std::uint64_t state_;
};

/// Who a step is of, or to: a column of the sequence diagram.
enum class Lane : std::uint8_t {
  timing,
  can_switcher,
  payload_adcs,
  payload_eps,
  payload_thermal,
  ttc,
  image_acquisition,
  image_processing,
  maintenance,
  bus,    ///< the CAN bus with its peripherals
  world,  ///< disk, power, kernel, faults
  ground,
};
inline constexpr std::size_t lane_count = 12;
[[nodiscard]] const char* to_text(Lane lane);

/// One step of the run. @p what is a literal: it lives as long as the program.
struct Step {
  MonotonicTime at;
  Lane from = Lane::world;
  Lane to = Lane::world;
  const char* what = "";
  std::uint64_t a = 0;
  std::uint64_t b = 0;
};

/// Thrown where an invariant does not hold; ends the run.
struct Violation {
  std::string requirement;  ///< of docs/evidence/requirements.md
  std::string text;         ///< which of its checks; after a colon what differs from case to case
  /// The same check failed.
  [[nodiscard]] bool is_like(const Violation& other) const {
    return requirement == other.requirement &&
           text.substr(0, text.find(':')) == other.text.substr(0, other.text.find(':'));
  }
};

/// Time, and what happens in it. Events happen one after the other, in the order of their time and, at the
/// same time, of their making: a run is a function of its seed. Every step goes into the trace's hash.
class Kernel {
 public:
  using Event = std::function<void()>;
  static constexpr std::size_t remembered_steps = 100;

  explicit Kernel(std::uint64_t seed) : seed_(seed) { slab_.reserve(4096); }

  [[nodiscard]] MonotonicTime now() const { return now_; }
  [[nodiscard]] Random random(std::string_view purpose) const { return {seed_, purpose}; }
  void at(MonotonicTime when, Event event);
  void later(nanoseconds delay, Event event) { at(now_ + delay, std::move(event)); }
  /// Until no event before @p end is left; then it is @p end.
  void run_until(MonotonicTime end);

  /// An invariant does not hold, seen where nothing may be thrown: it is thrown behind the event.
  void report(const Violation& violation) {
    if (!reported_) reported_ = violation;
  }
  void trace(Lane from, Lane to, const char* what, std::uint64_t a = 0, std::uint64_t b = 0);
  /// All steps go there, too.
  void set_trace_file(std::FILE* file) { file_ = file; }
  [[nodiscard]] Coverage& coverage() { return coverage_; }
  [[nodiscard]] std::uint64_t hash() const { return hash_; }
  [[nodiscard]] std::uint64_t steps() const { return step_count_; }
  [[nodiscard]] std::uint64_t events() const { return event_count_; }
  /// The last steps, as a sequence diagram in text.
  [[nodiscard]] std::string diagram() const;

 private:
  struct Entry {
    MonotonicTime at;
    std::uint64_t number;
    std::uint32_t place;                                      ///< in slab_
    [[nodiscard]] bool operator<(const Entry& other) const {  // the heap's top is the greatest
      return at != other.at ? at > other.at : number > other.number;
    }
  };

  std::uint64_t seed_;
  MonotonicTime now_{seconds(1000)};
  std::vector<Entry> heap_;
  std::vector<Event> slab_;
  std::vector<std::uint32_t> free_;
  std::uint64_t event_count_ = 0;
  std::optional<Violation> reported_;
  Coverage coverage_;
  std::array<Step, remembered_steps> last_{};
  std::uint64_t step_count_ = 0;
  std::uint64_t hash_ = 0xCBF29CE484222325;  // FNV-1a
  std::FILE* file_ = nullptr;
};

/// Line of the diagram, also of a trace file.
[[nodiscard]] std::string to_text(const Step& step);

/// One deadline that is set anew again and again. One that comes without end while hardly any time passes is
/// a violation: whoever sets it would use a whole CPU.
class Deadline {
 public:
  static constexpr std::uint64_t most_in_a_second = 20'000;
  /// @param in_time  runs the event, or keeps it from running: the process may have ended
  using Guard = std::function<void(nanoseconds delay, Kernel::Event event)>;
  Deadline(Kernel& kernel, Guard guard, Kernel::Event due)
      : kernel_(kernel), guard_(std::move(guard)), due_(std::move(due)) {}
  Deadline(const Deadline&) = delete;
  Deadline& operator=(const Deadline&) = delete;
  void arm(std::optional<MonotonicTime> at);
  [[nodiscard]] std::optional<MonotonicTime> armed() const { return armed_; }

 private:
  void count();

  Kernel& kernel_;
  Guard guard_;
  Kernel::Event due_;
  std::optional<MonotonicTime> armed_;
  std::uint64_t generation_ = 0;
  MonotonicTime second_begun_;
  std::uint64_t in_this_second_ = 0;
};

}  // namespace srfs::simulation
