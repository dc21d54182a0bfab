// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/archive/gap_filler.hpp"

#include <algorithm>
#include <utility>

namespace srfs::ground {
namespace {

constexpr std::uint64_t tag = 1;
constexpr milliseconds news_patience{15'000};  ///< without a packet of the retrieval

/// What is to be fetched of a gap. Over a step of the spacecraft's clock: what was shortly before its end.
Period period_of(const Gap& gap) {
  const bool stepped = gap.to - gap.from > GapFiller::longest;
  return {stepped ? gap.to - GapFiller::rest : gap.from - GapFiller::margin, gap.to + GapFiller::margin};
}

}  // namespace

std::vector<StoredGap> GapFiller::to_try(std::vector<StoredGap> open, UtcTime now) {
  // Thinned telemetry makes one gap after the other: they are fetched together.
  std::erase_if(open, [&](const StoredGap& stored) {
    return stored.gap.from > now - settles || is_exhausted(stored) || is_undated(stored);
  });
  std::stable_sort(open.begin(), open.end(),
                   [](const auto& a, const auto& b) { return a.attempts < b.attempts; });
  return open;
}

void GapFiller::take(const StageReport& report, MonotonicTime now) {
  if (retrieval_ && !report.late) retrieval_->on_stage(report, now);  // of one that was given up: same tag
}

void GapFiller::on_packet(const ReceivedPacket& received, MonotonicTime now) {
  const bool playback = received.vc == tm_channel::playback;
  if (!playback) last_live_ = now;
  if (!retrieval_) return;
  if (playback) commanding_.extend(tag, now);
  retrieval_->on_packet(received, now);
  if (playback) return;
  if (const auto report = commanding_.on_packet(received.packet, now)) take(*report, now);
}

bool GapFiller::is_ready(MonotonicTime now) const {
  return !retrieval_ && last_live_ && now - *last_live_ < contact &&
         (!resting_until_ || now >= *resting_until_);
}

std::optional<TelecommandText> GapFiller::next(const std::vector<StoredGap>& open, MonotonicTime now) {
  if (!is_ready(now)) return std::nullopt;
  if (gaps_.empty()) {
    if (open.empty()) return std::nullopt;
    period_ = period_of(open.front().gap);
    for (const StoredGap& stored : open) {
      const Period other = period_of(stored.gap);
      const bool first = &stored == &open.front();
      if (!first && (*other.from < *period_.from || *other.from > *period_.to)) continue;
      period_.to = std::max(*period_.to, *other.to);  // what overlaps is fetched with it
      gaps_.push_back(stored.id);
    }
    store_ = 0;
  }
  const mission::PacketStore& store = dictionary_.stores().at(store_);
  return TelecommandText{
      "storage.retrieve",
      {"store=" + store.name, "from=" + to_iso8601(*period_.from), "to=" + to_iso8601(*period_.to)}};
}

void GapFiller::on_sent(const std::optional<wire::RequestId>& request, const mission::Command& command,
                        MonotonicTime now) {
  if (!request) {
    resting_until_ = now + rest;
    return;
  }
  retrieval_.emplace(tag, dictionary_.stores().at(store_).id);
  take(commanding_.sent(*request, command, news_patience, tag, now), now);
}

std::vector<std::int64_t> GapFiller::give_up() {
  return std::exchange(gaps_, {});
}

std::vector<std::int64_t> GapFiller::on_time(MonotonicTime now) {
  for (const StageReport& report : commanding_.on_time(now)) take(report, now);
  if (!retrieval_ || !retrieval_->is_over(now)) return {};
  const bool complete = std::exchange(retrieval_, std::nullopt)->is_complete();
  if (!complete) {
    resting_until_ = now + rest;
    gaps_.clear();
    return {};
  }
  if (++store_ < dictionary_.stores().size()) return {};
  return std::exchange(gaps_, {});
}

}  // namespace srfs::ground
