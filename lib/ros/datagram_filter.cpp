// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/datagram_filter.hpp"

#include <algorithm>

namespace srfs::ros {
namespace {

constexpr std::size_t header_octets = 20;
constexpr std::size_t submessage_header_octets = 4;
constexpr std::uint8_t submessage_pad = 0x01;
constexpr std::uint8_t submessage_info_ts = 0x09;
constexpr std::uint8_t submessage_info_src = 0x0c;
constexpr std::uint8_t submessage_data = 0x15;
constexpr std::uint8_t submessage_data_frag = 0x16;
constexpr std::uint8_t little_endian = 0x01;
constexpr std::uint8_t with_inline_qos = 0x02;
constexpr std::uint8_t key_fragment = 0x04;
// Octets of each before the inline QoS.
constexpr std::size_t info_src_octets = 20;
constexpr std::size_t data_octets = 20;
constexpr std::size_t data_frag_octets = 32;
constexpr std::uint64_t pid_sentinel = 1;
/// Fast DDS links the missing fragments in their own first octets.
constexpr std::uint64_t smallest_fragment = 4;
/// More different ones in a datagram are no writer's: each is larger than small_sample.
constexpr std::size_t most_large_in_a_datagram = 16;

std::uint64_t unsigned_number(OctetView octets, bool little) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < octets.size(); ++i)
    value = value << 8 | octets[little ? octets.size() - 1 - i : i];
  return value;
}

template <std::size_t n>
std::array<std::uint8_t, n> array_at(OctetView octets, std::size_t at) {
  std::array<std::uint8_t, n> out{};
  std::copy_n(octets.begin() + static_cast<std::ptrdiff_t>(at), n, out.begin());
  return out;
}

GuidPrefix prefix_of(const Gid& gid) {
  return array_at<12>(gid, 0);
}

std::size_t round_up(std::size_t octets) {
  return (octets + 3) / 4 * 4;
}

/// What follows the inline QoS in a DATA or DATA_FRAG submessage. nullopt: nothing of it does.
std::optional<OctetView> payload(OctetView body, std::size_t fixed_octets, std::uint8_t flags) {
  constexpr std::size_t counted_from = 4;
  const bool little = (flags & little_endian) != 0;
  const std::size_t begin = counted_from + unsigned_number(body.subspan(2, 2), little);
  if (begin < fixed_octets || begin > body.size()) return std::nullopt;
  OctetView left = body.subspan(begin);
  if ((flags & with_inline_qos) == 0) return left;
  while (left.size() >= 4) {
    const std::uint64_t id = unsigned_number(left.first(2), little);
    const std::size_t length = round_up(unsigned_number(left.subspan(2, 2), little));
    left = left.subspan(4);
    if (id == pid_sentinel) return left;
    if (length > left.size()) break;
    left = left.subspan(length);
  }
  return std::nullopt;
}

/// @pre body.size() >= data_octets
SampleId sample_id(const GuidPrefix& source, OctetView body, bool little) {
  SampleId id;
  std::copy(source.begin(), source.end(), id.writer.begin());
  std::copy_n(body.begin() + 8, 4, id.writer.begin() + source.size());
  const std::uint64_t high = unsigned_number(body.subspan(12, 4), little);
  id.sequence = static_cast<std::int64_t>(high << 32 | unsigned_number(body.subspan(16, 4), little));
  return id;
}

AnnouncedSample read_data(const GuidPrefix& source, OctetView body, std::uint8_t flags) {
  if (body.size() < data_octets) return {};
  const auto sample = payload(body, data_octets, flags);
  return {sample_id(source, body, (flags & little_endian) != 0), sample ? sample->size() : 0, false,
          sample.has_value()};
}

AnnouncedSample read_fragment(const GuidPrefix& source, OctetView body, std::uint8_t flags) {
  if (body.size() < data_frag_octets) return {};
  const bool little = (flags & little_endian) != 0;
  AnnouncedSample sample{sample_id(source, body, little), unsigned_number(body.subspan(28, 4), little), true,
                         false};
  const std::uint64_t number = unsigned_number(body.subspan(20, 4), little);
  const std::uint64_t count = unsigned_number(body.subspan(24, 2), little);
  const std::uint64_t octets = unsigned_number(body.subspan(26, 2), little);
  const auto held = payload(body, data_frag_octets, flags);
  if (!held || (flags & key_fragment) != 0) return sample;
  if (number == 0 || count == 0 || octets < smallest_fragment) return sample;
  const std::uint64_t begin = (number - 1) * octets;
  const std::uint64_t fragments = (sample.octets + octets - 1) / octets;
  if (number - 1 + count > fragments) return sample;
  sample.is_sound = held->size() >= std::min(begin + count * octets, sample.octets) - begin;
  return sample;
}

}  // namespace

RtpsDatagram::RtpsDatagram(OctetView datagram) : datagram_(datagram) {
  constexpr std::array<std::uint8_t, 4> protocol{'R', 'T', 'P', 'S'};
  if (datagram.size() >= header_octets && std::equal(protocol.begin(), protocol.end(), datagram.begin()))
    sender_ = array_at<12>(datagram, 8);
}

void RtpsDatagram::for_each(const std::function<void(const AnnouncedSample&)>& sample,
                            const std::function<void(const GuidPrefix&)>& speaks_for) const {
  if (!sender_) return;
  GuidPrefix source = *sender_;
  OctetView left = datagram_.subspan(header_octets);
  while (left.size() >= submessage_header_octets) {
    const std::uint8_t kind = left[0];
    const std::uint8_t flags = left[1];
    const auto length =
        static_cast<std::size_t>(unsigned_number(left.subspan(2, 2), (flags & little_endian) != 0));
    left = left.subspan(submessage_header_octets);
    if (length > left.size()) return;
    // 0: the last one, to the end of the message.
    const bool is_last = length == 0 && kind != submessage_info_ts && kind != submessage_pad;
    const OctetView body = is_last ? left : left.first(length);
    left = left.subspan(std::min(round_up(body.size()), left.size()));
    if (kind == submessage_info_src) {
      if (body.size() != info_src_octets) return;
      source = array_at<12>(body, 8);
      speaks_for(source);
    } else if (kind == submessage_data) {
      sample(read_data(source, body, flags));
    } else if (kind == submessage_data_frag) {
      sample(read_fragment(source, body, flags));
    }
  }
}

HeldSamples::Held* HeldSamples::find(const SampleId& id) {
  const auto found = std::find_if(held_.begin(), held_.end(), [&](const Held& h) { return h.id == id; });
  return found == held_.end() ? nullptr : &*found;
}

bool HeldSamples::admit(std::span<const AnnouncedSample> samples, MonotonicTime now) {
  std::uint64_t claimed = 0;
  for (const Held& held : held_) claimed += held.octets;
  std::uint64_t more = 0;
  std::size_t added = 0;
  for (const AnnouncedSample& sample : samples) {
    const Held* held = find(sample.id);
    added += held == nullptr ? 1 : 0;
    more += sample.octets - std::min(sample.octets, held == nullptr ? 0 : held->octets);
  }
  const bool is_alone = held_.empty() && added == 1;
  if (held_.size() + added > most || (more > 0 && claimed + more > most_octets && !is_alone)) return false;
  for (const AnnouncedSample& sample : samples) {
    Held* held = find(sample.id);
    if (held == nullptr) held = &held_.emplace_back(Held{sample.id, 0, now});
    held->octets = std::max(held->octets, sample.octets);
    held->touched = now;
  }
  return true;
}

std::optional<SampleId> HeldSamples::stalled(MonotonicTime now) const {
  const auto oldest = std::min_element(held_.begin(), held_.end(),
                                       [](const Held& a, const Held& b) { return a.touched < b.touched; });
  if (oldest == held_.end() || now - oldest->touched < longest_pause) return std::nullopt;
  return oldest->id;
}

void HeldSamples::be_patient_with(const SampleId& id, MonotonicTime now) {
  if (Held* held = find(id)) held->touched = now;
}

void HeldSamples::drop(const SampleId& id) {
  std::erase_if(held_, [&](const Held& h) { return h.id == id; });
}

void HeldSamples::release(const Gid& writer, std::int64_t up_to) {
  std::erase_if(held_, [&](const Held& h) { return h.id.writer == writer && h.id.sequence <= up_to; });
}

void DatagramFilter::matched(const Gid& writer, const Gid& reader, std::uint64_t octets,
                             std::shared_ptr<std::atomic<std::uint64_t>> refused) {
  const std::lock_guard lock(mutex_);
  std::erase_if(matches_, [&](const Match& m) { return m.writer == writer && m.reader == reader; });
  matches_.push_back({writer, reader, octets, std::move(refused)});
  matches_changed();
}

void DatagramFilter::unmatched(const Gid& writer, const Gid& reader) {
  const std::lock_guard lock(mutex_);
  std::erase_if(matches_, [&](const Match& m) { return m.writer == writer && m.reader == reader; });
  held_.release(writer, taken_by_all(writer));
  matches_changed();
}

void DatagramFilter::ended(const Gid& reader) {
  const std::lock_guard lock(mutex_);
  std::vector<Gid> writers;
  for (const Match& m : matches_) {
    if (m.reader == reader) writers.push_back(m.writer);
  }
  std::erase_if(matches_, [&](const Match& m) { return m.reader == reader; });
  for (const Gid& writer : writers) held_.release(writer, taken_by_all(writer));
  matches_changed();
}

void DatagramFilter::matches_changed() {
  std::uint64_t smallest = std::numeric_limits<std::uint64_t>::max();
  for (const Match& m : matches_) smallest = std::min(smallest, m.octets);
  smallest_ = smallest;
  holds_any_ = !held_.empty();
}

void DatagramFilter::taken(const SampleId& sample, const Gid& reader) {
  const std::lock_guard lock(mutex_);
  for (Match& m : matches_) {
    if (m.writer == sample.writer && m.reader == reader) m.taken = std::max(m.taken, sample.sequence);
  }
  if (is_matched(sample.writer)) held_.release(sample.writer, taken_by_all(sample.writer));
  holds_any_ = !held_.empty();
}

bool DatagramFilter::is_matched(const Gid& writer) const {
  return std::any_of(matches_.begin(), matches_.end(), [&](const Match& m) { return m.writer == writer; });
}

/// Newest sample of the writer that each of its readers has given to the node; all of them when it has none.
std::int64_t DatagramFilter::taken_by_all(const Gid& writer) const {
  std::int64_t taken = std::numeric_limits<std::int64_t>::max();
  for (const Match& m : matches_) {
    if (m.writer == writer) taken = std::min(taken, m.taken);
  }
  return taken;
}

/// Whether it is broken, or claims more than its reader takes; counts it.
bool DatagramFilter::refuses(const AnnouncedSample& sample) {
  if (sample.is_sound && sample.octets <= smallest_) return false;
  const std::lock_guard lock(mutex_);
  std::uint64_t most = 0;
  std::uint64_t most_of_all = 0;
  std::atomic<std::uint64_t>* refused = nullptr;
  for (const Match& m : matches_) {
    most_of_all = std::max(most_of_all, m.octets);
    if (m.writer != sample.id.writer) continue;
    most = std::max(most, m.octets);
    refused = m.refused.get();
  }
  // Of a writer that is just being matched the topic is not known yet.
  if (sample.is_sound && sample.octets <= (refused != nullptr ? most : most_of_all)) return false;
  if (refused != nullptr) ++*refused;
  return true;
}

DatagramFilter::Verdict DatagramFilter::judge(OctetView datagram, bool shedding, MonotonicTime now) {
  const RtpsDatagram message(datagram);
  if (drop_foreign_ || shedding) {
    if (const auto who = foreign_sender(message))
      return drop(*who, drop_foreign_ ? Verdict::foreign : Verdict::shed);
  }
  bool is_refused = false;
  bool has_large = false;
  message.for_each(
      [&](const AnnouncedSample& sample) {
        is_refused = is_refused || refuses(sample);
        has_large = has_large || sample.octets > small_sample;
      },
      [](const GuidPrefix&) {});
  if (is_refused) return Verdict::malformed;
  if (!has_large) return Verdict::pass;
  const auto who = foreign_sender(message);
  if (!who) return Verdict::pass;
  {
    const std::lock_guard lock(mutex_);
    if (has_room(message, now) && large_.take(datagram.size(), now)) return Verdict::pass;
  }
  return drop(*who, Verdict::shed);
}

bool DatagramFilter::has_room(const RtpsDatagram& datagram, MonotonicTime now) {
  std::array<AnnouncedSample, most_large_in_a_datagram> samples;
  std::size_t count = 0;
  bool are_too_many = false;
  datagram.for_each(
      [&](const AnnouncedSample& sample) {
        if (sample.octets <= small_sample) return;
        // What comes again after it was taken is ignored by Fast DDS.
        if (is_matched(sample.id.writer) && sample.id.sequence <= taken_by_all(sample.id.writer)) return;
        if (count > 0 && samples[count - 1].id == sample.id) {
          samples[count - 1].octets = std::max(samples[count - 1].octets, sample.octets);
        } else if (count < samples.size()) {
          samples[count++] = sample;
        } else {
          are_too_many = true;
        }
      },
      [](const GuidPrefix&) {});
  if (are_too_many) return false;
  while (!held_.admit(std::span(samples).first(count), now)) {
    if (!give_up_one(now)) return false;
  }
  holds_any_ = !held_.empty();
  return true;
}

/// @return false: all get what they wait for
bool DatagramFilter::give_up_one(MonotonicTime now) {
  const auto id = held_.stalled(now);
  if (!id) return false;
  const GuidPrefix who = prefix_of(id->writer);
  if (!is_matched(id->writer) || !is_foreign_(who)) {
    held_.drop(*id);  // no reader takes it; or it is not of him whose name it bears
    return true;
  }
  held_.be_patient_with(*id, now);  // the memory is free when he has been forgotten
  const bool is_known = std::find(stalled_.begin(), stalled_.end(), who) != stalled_.end();
  if (!is_known && stalled_.size() < HeldSamples::most) stalled_.push_back(who);
  return true;
}

std::optional<GuidPrefix> DatagramFilter::next_stalled() {
  const std::lock_guard lock(mutex_);
  if (stalled_.empty()) return std::nullopt;
  const GuidPrefix who = stalled_.back();
  stalled_.pop_back();
  return who;
}

DatagramFilter::Verdict DatagramFilter::judge_discovery(OctetView datagram) {
  const RtpsDatagram message(datagram);
  bool passes = true;
  message.for_each(
      [&](const AnnouncedSample& sample) { passes = passes && sample.is_sound && !sample.is_fragment; },
      [](const GuidPrefix&) {});
  if (passes) return Verdict::pass;
  const auto who = foreign_sender(message);
  return who ? drop(*who, Verdict::malformed) : Verdict::malformed;
}

DatagramFilter::Verdict DatagramFilter::drop(const GuidPrefix& who, Verdict verdict) {
  ++dropped_foreign_;
  const std::lock_guard lock(mutex_);
  last_dropped_ = who;
  return verdict;
}

std::optional<GuidPrefix> DatagramFilter::foreign_sender(const RtpsDatagram& datagram) const {
  if (!datagram.sender()) return std::nullopt;  // no RTPS: Fast DDS drops it
  if (is_foreign_(*datagram.sender())) return datagram.sender();
  std::optional<GuidPrefix> found;
  datagram.for_each([](const AnnouncedSample&) {},
                    [&](const GuidPrefix& source) {
                      if (!found && is_foreign_(source)) found = source;
                    });
  return found;
}

void DatagramFilter::unread(OctetView next, std::uint64_t count) {
  dropped_foreign_ += count;
  const auto who = RtpsDatagram(next).sender();
  const std::lock_guard lock(mutex_);
  if (who) last_dropped_ = who;
}

std::optional<GuidPrefix> DatagramFilter::last_dropped() const {
  const std::lock_guard lock(mutex_);
  return last_dropped_;
}

}  // namespace srfs::ros
