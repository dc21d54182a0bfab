// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/kernel.hpp"

#include <algorithm>

#include <fmt/format.h>

namespace srfs::simulation {
namespace {

constexpr std::uint64_t fnv_prime = 0x100000001B3;

std::uint64_t mixed(std::uint64_t hash, std::uint64_t value) {
  hash = (hash ^ value) * fnv_prime;
  return hash ^ hash >> 29U;
}

std::uint64_t hash_of(std::string_view text, std::uint64_t hash) {
  for (const char c : text) hash = (hash ^ static_cast<std::uint8_t>(c)) * fnv_prime;
  return hash;
}

}  // namespace

Random::Random(std::uint64_t seed, std::string_view purpose) : state_(mixed(hash_of(purpose, 1), seed)) {
  (void)next();
}

std::uint64_t Random::next() {
  std::uint64_t z = (state_ += 0x9E3779B97F4A7C15);
  z = (z ^ z >> 30U) * 0xBF58476D1CE4E5B9;
  z = (z ^ z >> 27U) * 0x94D049BB133111EB;
  return z ^ z >> 31U;
}

nanoseconds Random::between(nanoseconds low, nanoseconds high) {
  const auto span = static_cast<std::uint64_t>((high - low) / microseconds(1));
  return low + microseconds(below(span + 1));
}

const char* to_text(Lane lane) {
  static constexpr std::array<const char*, lane_count> names{"timing",
                                                             "can_switcher",
                                                             "payload_adcs",
                                                             "payload_eps",
                                                             "payload_thermal",
                                                             "ttc",
                                                             "image_acquisition",
                                                             "image_processing",
                                                             "maintenance",
                                                             "bus",
                                                             "world",
                                                             "ground"};
  return names[static_cast<std::size_t>(lane)];
}

void Kernel::at(MonotonicTime when, Event event) {
  std::uint32_t place = 0;
  if (free_.empty()) {
    place = static_cast<std::uint32_t>(slab_.size());
    slab_.push_back(std::move(event));
  } else {
    place = free_.back();
    free_.pop_back();
    slab_[place] = std::move(event);
  }
  heap_.push_back({std::max(when, now_), event_count_++, place});
  std::push_heap(heap_.begin(), heap_.end());
}

void Kernel::run_until(MonotonicTime end) {
  while (!heap_.empty() && heap_.front().at <= end) {
    const Entry entry = heap_.front();
    std::pop_heap(heap_.begin(), heap_.end());
    heap_.pop_back();
    now_ = entry.at;
    hash_ = mixed(hash_, static_cast<std::uint64_t>(now_.ns()) ^ entry.number << 40U);
    const Event event = std::move(slab_[entry.place]);
    slab_[entry.place] = nullptr;
    free_.push_back(entry.place);
    event();
    if (reported_) throw Violation(*std::exchange(reported_, std::nullopt));
  }
  now_ = end;
}

void Kernel::trace(Lane from, Lane to, const char* what, std::uint64_t a, std::uint64_t b) {
  const Step step{now_, from, to, what, a, b};
  last_[step_count_++ % remembered_steps] = step;
  hash_ = mixed(hash_, static_cast<std::uint64_t>(now_.ns()));
  hash_ = mixed(hash_, static_cast<std::uint64_t>(from) << 8U | static_cast<std::uint64_t>(to));
  hash_ = mixed(mixed(hash_of(what, hash_), a), b);
  if (file_ != nullptr) fmt::print(file_, "{}\n", to_text(step));
}

std::string to_text(const Step& step) {
  const std::string who = step.from == step.to
                              ? std::string(to_text(step.from))
                              : fmt::format("{} -> {}", to_text(step.from), to_text(step.to));
  return fmt::format("{:14.6f} s  {:36} {} {} {}", static_cast<double>(step.at.ns()) / 1e9, who, step.what,
                     step.a, step.b);
}

/// A column a lane: `o` is the one that acts, `>` or `<` the one that it acts on.
std::string Kernel::diagram() const {
  static constexpr std::array<const char*, lane_count> heads{
      "timing", "switch", "adcs", "eps", "therm", "ttc", "img_a", "img_p", "maint", "bus", "world", "ground"};
  constexpr std::size_t width = 7;
  std::string text = fmt::format("{:14}  ", "s");
  for (const char* head : heads) text += fmt::format("{:<{}}", head, width);
  text += '\n';
  const std::uint64_t first = step_count_ > remembered_steps ? step_count_ - remembered_steps : 0;
  for (std::uint64_t i = first; i < step_count_; ++i) {
    const Step& step = last_[i % remembered_steps];
    std::string line;
    for (std::size_t lane = 0; lane < lane_count; ++lane) line += "|" + std::string(width - 1, ' ');
    const auto from = static_cast<std::size_t>(step.from) * width;
    const auto to = static_cast<std::size_t>(step.to) * width;
    if (from < to)
      std::fill(line.begin() + static_cast<std::ptrdiff_t>(from),
                line.begin() + static_cast<std::ptrdiff_t>(to), '-');
    if (to < from)
      std::fill(line.begin() + static_cast<std::ptrdiff_t>(to),
                line.begin() + static_cast<std::ptrdiff_t>(from), '-');
    line[from] = 'o';
    if (from != to) line[to] = from < to ? '>' : '<';
    text += fmt::format("{:14.6f}  {} {} {} {}\n", static_cast<double>(step.at.ns()) / 1e9, line, step.what,
                        step.a, step.b);
  }
  return text;
}

void Deadline::arm(std::optional<MonotonicTime> at) {
  if (at == armed_) return;
  armed_ = at;
  ++generation_;
  if (!at) return;
  guard_(std::max(*at - kernel_.now(), nanoseconds(0)), [this, generation = generation_] {
    if (generation != generation_) return;
    armed_.reset();
    count();
    due_();
  });
}

void Deadline::count() {
  if (kernel_.now() - second_begun_ >= seconds(1)) {
    second_begun_ = kernel_.now();
    in_this_second_ = 0;
  }
  if (++in_this_second_ > most_in_a_second) throw Violation{"no busy loop", "a deadline comes without end"};
}

}  // namespace srfs::simulation
