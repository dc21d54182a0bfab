// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/downlink_scheduler.hpp"

#include <algorithm>
#include <cassert>

namespace srfs {
namespace {

constexpr MonotonicTime never = MonotonicTime(nanoseconds::max());
constexpr std::array all_channels{DownlinkChannel::live, DownlinkChannel::playback, DownlinkChannel::files};

nanoseconds flush_beside_others(const DownlinkConfig& config) {
  constexpr std::int64_t bit_ns = 1'000'000'000;
  const auto bits = static_cast<std::int64_t>(10 * wire::cadu_octets(config.cadu) * config.flush_after_cadus);
  const nanoseconds cadus(bits * bit_ns / static_cast<std::int64_t>(config.baud));
  return std::max<nanoseconds>(config.flush_after, std::min<nanoseconds>(cadus, seconds(1)));
}

}  // namespace

DownlinkScheduler::DownlinkScheduler(DownlinkConfig config, std::optional<wire::TmSeal> seal)
    : config_(config),
      sealed_(seal.has_value()),
      flush_beside_others_(flush_beside_others(config)),
      frames_({.spacecraft_id = config.spacecraft_id,
               .frame_octets = config.cadu.frame_octets,
               .queue_octets_max = std::max(
                   {config.live_queue_octets, config.playback_queue_octets, config.files_queue_octets}),
               .first = config.first_counts},
              std::move(seal)),
      pacer_(config.baud, wire::cadu_octets(config.cadu)) {
  channels_[vc(DownlinkChannel::live)].capacity = config.live_queue_octets;
  channels_[vc(DownlinkChannel::playback)].capacity = config.playback_queue_octets;
  channels_[vc(DownlinkChannel::files)].capacity = config.files_queue_octets;
}

bool DownlinkScheduler::push(DownlinkChannel channel, Octets packet, bool urgent, MonotonicTime now) {
  Channel& state = channels_[vc(channel)];
  const std::size_t octets = packet.size();
  const bool was_empty = empty(channel);
  if (octets > room_octets(channel) || !frames_.queue_packet(vc(channel), std::move(packet))) {
    ++state.dropped;
    return false;
  }
  state.pushed_octets += octets;
  if (was_empty) state.waits_since = now;
  if (urgent) state.urgent_end = state.pushed_octets;
  return true;
}

void DownlinkScheduler::want_control_word(MonotonicTime now) {
  if (!control_word_by_) control_word_by_ = now + config_.flush_after;
}

std::size_t DownlinkScheduler::room_octets(DownlinkChannel channel) const {
  const std::size_t capacity = channels_[vc(channel)].capacity;
  return capacity - std::min(capacity, frames_.queued_octets(vc(channel)));
}

bool DownlinkScheduler::empty(DownlinkChannel channel) const {
  return frames_.queued_octets(vc(channel)) == 0;
}

bool DownlinkScheduler::fills_a_frame(DownlinkChannel channel) const {
  return frames_.queued_octets(vc(channel)) >= field_octets();
}

MonotonicTime DownlinkScheduler::ready_at(DownlinkChannel channel) const {
  const std::size_t queued = frames_.queued_octets(vc(channel));
  if (queued == 0) return never;
  const Channel& state = channels_[vc(channel)];
  const bool urgent = state.pushed_octets - queued < state.urgent_end;
  if (urgent || fills_a_frame(channel)) return {};
  const bool others = std::any_of(all_channels.begin(), all_channels.end(),
                                  [&](DownlinkChannel c) { return c != channel && fills_a_frame(c); });
  return state.waits_since + (others ? flush_beside_others_ : nanoseconds(config_.flush_after));
}

std::optional<DownlinkChannel> DownlinkScheduler::choose(MonotonicTime now) {
  const bool live = ready_at(DownlinkChannel::live) <= now;
  const bool playback = ready_at(DownlinkChannel::playback) <= now;
  const bool files = ready_at(DownlinkChannel::files) <= now;
  const bool other = playback || files;
  if (!live && !other) return std::nullopt;
  if (live && (!other || live_in_a_row_ < config_.live_frames_per_other)) {
    live_in_a_row_ = other ? live_in_a_row_ + 1 : 0;
    return DownlinkChannel::live;
  }
  live_in_a_row_ = 0;
  const bool take_files = files && (!playback || files_next_);
  files_next_ = !take_files;
  return take_files ? DownlinkChannel::files : DownlinkChannel::playback;
}

std::optional<Octets> DownlinkScheduler::next(MonotonicTime now, const std::function<std::uint32_t()>& clcw,
                                              std::optional<UtcTime> utc) {
  if (!pacer_.has_room(now)) return std::nullopt;
  auto channel = choose(now);
  if (!channel && config_.continuous) channel = first_with_packets();
  const auto number = [&] { return sealed_ ? config_.numbers.take(utc) : 0; };
  Octets frame;
  if (channel) {
    frame = frames_.build(vc(*channel), clcw(), number());
    // What did not fit waits for company again, unless it is urgent.
    channels_[vc(*channel)].waits_since = now;
  } else if (config_.continuous || (control_word_by_ && *control_word_by_ <= now)) {
    frame = frames_.build_idle(clcw(), number());
    ++idle_frames_;
  } else {
    return std::nullopt;
  }
  control_word_by_.reset();
  ++frames_made_;
  Octets cadu = wire::encode_cadu(frame, config_.cadu);
  pacer_.on_written(cadu.size(), now);
  return cadu;
}

std::optional<DownlinkChannel> DownlinkScheduler::first_with_packets() const {
  const auto found =
      std::find_if(all_channels.begin(), all_channels.end(), [this](DownlinkChannel c) { return !empty(c); });
  return found == all_channels.end() ? std::nullopt : std::optional(*found);
}

std::optional<MonotonicTime> DownlinkScheduler::next_due(MonotonicTime now) const {
  if (config_.continuous) return std::max(pacer_.room_at(), now);
  MonotonicTime due = std::min({ready_at(DownlinkChannel::live), ready_at(DownlinkChannel::playback),
                                ready_at(DownlinkChannel::files)});
  if (control_word_by_) due = std::min(due, *control_word_by_);
  if (due == never) return std::nullopt;
  return std::max({due, pacer_.room_at(), now});
}

DownlinkCounters DownlinkScheduler::counters() const {
  DownlinkCounters counters;
  counters.frames = frames_made_;
  counters.idle_frames = idle_frames_;
  for (std::size_t i = 0; i < channels_.size(); ++i) {
    counters.packets[i] = frames_.counters(static_cast<std::uint8_t>(i)).packets;
    counters.dropped[i] = channels_[i].dropped;
  }
  return counters;
}

}  // namespace srfs
