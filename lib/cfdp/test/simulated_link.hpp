// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <random>

#include "cfdp/entity.hpp"
#include "lib/cfdp/test/memory_file_store.hpp"

namespace srfs::cfdp {

inline constexpr std::uint64_t ground = 1;
inline constexpr std::uint64_t satellite = 2;

inline Octets random_file(std::size_t octets, unsigned seed) {
  std::mt19937 random(seed);
  Octets file(octets);
  for (auto& octet : file) octet = static_cast<std::uint8_t>(random());
  return file;
}

struct LinkFaults {
  double loss = 0;
  double duplication = 0;
  double octet_flips = 0;  ///< a flipped octet loses its PDU, because frames have a CRC
  milliseconds jitter{0};  ///< PDUs overtake one another
  double frame_loss = 0;   ///< loses all PDUs that have octets in the frame
};

/// Two entities with disks, joined by a line with a rate and a delay. Time is simulated.
class SimulatedLink {
 public:
  struct End {
    std::uint64_t id = 0;
    Settings settings;
    MemoryFileStore files;
    std::unique_ptr<Entity> entity;  ///< null: killed
    std::vector<Event> events;
    MonotonicTime line_free_at;
    MonotonicTime alive_again_at;
    std::uint64_t pdus = 0;  ///< PDUs handed to the line
    FrameFill frame;
    bool frame_lost = false;  ///< whether the frame being filled will be lost
    Counters counters_before;
  };

  explicit SimulatedLink(LinkFaults faults_ = {}, unsigned seed = 1) : faults(faults_), random_(seed) {
    for (const std::size_t i : {0U, 1U}) {
      ends[i].id = i == 0 ? ground : satellite;
      ends[i].settings.own_entity = ends[i].id;
      ends[i].settings.peer_entity = i == 0 ? satellite : ground;
    }
  }
  void start() {
    for (End& end : ends) boot(end);
  }
  End& at(std::uint64_t id) { return ends[id == ground ? 0 : 1]; }
  Entity& entity(std::uint64_t id) { return *at(id).entity; }

  /// Kills an end. It returns after @p pause with the contents of its disk.
  void kill(End& end, nanoseconds pause) {
    if (!end.entity) return;
    take_events(end);
    end.entity.reset();
    end.files.lose_unsynced();
    end.alive_again_at = now + pause;
  }

  /// Runs until nothing is left to do, but not beyond @p until.
  /// @return false: not finished by then
  bool run(MonotonicTime until) {
    while (true) {
      const auto next = next_time();
      if (!next) return true;
      if (*next > until) {
        now = until;
        return false;
      }
      now = std::max(now, *next);
      step();
    }
  }
  /// Runs for @p time.
  void run_for(milliseconds time) {
    const MonotonicTime until = now + time;
    (void)run(until);
    now = until;
  }
  [[nodiscard]] bool idle() const {
    return std::all_of(ends.begin(), ends.end(),
                       [](const End& e) { return e.entity && e.entity->transactions().empty(); });
  }
  std::vector<Event> events_of(std::uint64_t id, EventKind kind) {
    End& end = at(id);
    if (end.entity) take_events(end);
    std::vector<Event> found;
    std::copy_if(end.events.begin(), end.events.end(), std::back_inserter(found),
                 [&](const Event& e) { return e.kind == kind; });
    return found;
  }

  std::array<End, 2> ends;
  LinkFaults faults;
  MonotonicTime now{seconds(1000)};
  double octets_per_second = 20'000;
  milliseconds delay{40};
  std::size_t pdu_octets_max = 980;
  /// The satellite packs its PDUs into frames of @p field_octets; each frame takes @p octets_on_line on the
  /// line. The ground sends one frame per PDU.
  void use_frames(std::size_t field_octets, std::size_t octets_on_line) {
    at(satellite).frame = {.octets = field_octets, .filled = 0, .overhead = 6};
    frame_octets_on_line_ = octets_on_line;
  }
  /// Called for every PDU handed to the line; false loses the PDU.
  std::function<bool(std::uint64_t from, OctetView pdu)> on_line = [](std::uint64_t, OctetView) {
    return true;
  };

 private:
  void boot(End& end) {
    end.entity = std::make_unique<Entity>(end.settings, end.files, 1);
    try {
      (void)end.entity->restore(end.files.checkpoint, now);
    } catch (const Killed&) {
      kill(end, milliseconds(10));
    }
  }
  void take_events(End& end) {
    const auto events = end.entity->take_events();
    end.events.insert(end.events.end(), events.begin(), events.end());
  }
  std::optional<MonotonicTime> next_time() const {
    std::optional<MonotonicTime> next;
    const auto consider = [&](MonotonicTime t) {
      if (!next || t < *next) next = t;
    };
    if (!flying_.empty()) consider(flying_.begin()->first);
    for (const End& end : ends) {
      if (!end.entity) {
        consider(end.alive_again_at);
      } else if (const auto due = end.entity->next_due(now)) {
        consider(std::max(*due, end.line_free_at));
      }
    }
    return next;
  }
  void step() {
    for (End& end : ends) {
      if (!end.entity && now >= end.alive_again_at) boot(end);
    }
    while (!flying_.empty() && flying_.begin()->first <= now) {
      const auto [to, pdu] = flying_.begin()->second;
      flying_.erase(flying_.begin());
      if (ends[to].entity) guarded(ends[to], [&] { ends[to].entity->on_pdu(pdu, now); });
    }
    for (std::size_t i = 0; i < ends.size(); ++i) {
      End& end = ends[i];
      if (!end.entity || end.line_free_at > now) continue;
      if (now > end.line_free_at + milliseconds(50)) end.frame.filled = 0;  // the frame left partly empty
      std::optional<Octets> pdu;
      guarded(end, [&] { pdu = end.entity->next_pdu(pdu_octets_max, now, end.frame); });
      if (end.entity) take_events(end);
      if (pdu) transmit(end, 1 - i, *pdu);
    }
  }
  template <class F>
  void guarded(End& end, F&& call) {
    try {
      call();
    } catch (const Killed&) {
      kill(end, milliseconds(10));
    }
  }
  void transmit(End& from, std::size_t to, const Octets& pdu) {
    ++from.pdus;
    const double octets_on_line =
        from.frame.octets == 0
            ? static_cast<double>(pdu.size())
            : static_cast<double>((pdu.size() + from.frame.overhead) * frame_octets_on_line_) /
                  static_cast<double>(from.frame.octets);
    from.line_free_at =
        now + nanoseconds(static_cast<std::int64_t>(1e9 * octets_on_line / octets_per_second));
    const bool spoiled =
        from.frame.octets > 0 ? is_in_a_lost_frame(from, pdu.size()) : chance(faults.frame_loss);
    if (!on_line(from.id, pdu) || spoiled) return;
    const double survives = std::pow(1 - faults.octet_flips, static_cast<double>(pdu.size()));
    for (int copies = chance(faults.duplication) ? 2 : 1; copies > 0; --copies) {
      if (chance(faults.loss) || !chance(survives)) continue;
      const milliseconds late(
          faults.jitter.count() == 0
              ? 0
              : static_cast<std::int64_t>(random_() % static_cast<std::uint64_t>(faults.jitter.count())));
      flying_.emplace(from.line_free_at + delay + late, std::pair(to, pdu));
    }
  }
  bool is_in_a_lost_frame(End& from, std::size_t pdu_octets) {
    bool lost = from.frame.filled > 0 && from.frame_lost;
    if (from.frame.filled == 0) lost = from.frame_lost = chance(faults.frame_loss);
    const std::size_t frames_after =
        (from.frame.filled + pdu_octets + from.frame.overhead - 1) / from.frame.octets;
    for (std::size_t i = 0; i < frames_after; ++i) {
      from.frame_lost = chance(faults.frame_loss);
      lost = lost || from.frame_lost;
    }
    from.frame = from.frame.behind(pdu_octets);
    return lost;
  }
  bool chance(double p) { return std::uniform_real_distribution<double>(0, 1)(random_) < p; }

  std::mt19937_64 random_;
  std::size_t frame_octets_on_line_ = 0;
  std::multimap<MonotonicTime, std::pair<std::size_t, Octets>> flying_;
};

}  // namespace srfs::cfdp
