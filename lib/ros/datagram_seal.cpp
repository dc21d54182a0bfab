// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/datagram_seal.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "base/text.hpp"
#include "ros/datagram_filter.hpp"

namespace srfs::ros {
namespace {

constexpr std::size_t rtps_header_octets = 20;
constexpr std::size_t submessage_header_octets = 4;
constexpr std::size_t fixed_octets = 12;  // time, number of tags, length of the name, two that are 0
constexpr std::uint8_t submessage_seal = 0xa5;
constexpr nanoseconds between_participants = seconds(1);  // of one limited member
static_assert(DatagramSeal::most_octets == submessage_header_octets + fixed_octets +
                                               (1 + DatagramSeal::most_limited) * DatagramSeal::tag_octets);

using Tag = std::array<std::uint8_t, DatagramSeal::tag_octets>;

std::shared_ptr<DatagramSeal>& seal_of_process() {
  static std::shared_ptr<DatagramSeal> seal;
  return seal;
}

constexpr std::size_t round_up(std::size_t octets) {
  return (octets + 3) / 4 * 4;
}

/// Without what Fast DDS' UDP transport still writes into a message: the content of its own last submessage,
/// which counts what was sent (FASTDDS_STATISTICS_NETWORK_SUBMESSAGE), and which nobody reads.
OctetView sealed_part(OctetView rest) {
  constexpr std::array<std::uint8_t, 4> statistics{0x80, 1, 56, 0};
  constexpr std::size_t content = 56;
  if (rest.size() < statistics.size() + content) return rest;
  const OctetView last = rest.last(statistics.size() + content);
  return std::equal(statistics.begin(), statistics.end(), last.begin()) ? rest.first(rest.size() - content)
                                                                        : rest;
}

/// Finds any of some prefixes in octets in one pass.
class PrefixSearch {
 public:
  explicit PrefixSearch(std::vector<GuidPrefix> prefixes) : prefixes_(std::move(prefixes)) {
    std::sort(prefixes_.begin(), prefixes_.end());
    // All begin with the vendor, those of one host with that, too.
    while (!prefixes_.empty() && stem_ < longest_stem && prefixes_.front()[stem_] == prefixes_.back()[stem_])
      ++stem_;
  }
  [[nodiscard]] bool is_in(OctetView text) const {
    GuidPrefix candidate{};
    while (!prefixes_.empty() && text.size() >= candidate.size()) {
      const auto* found =
          static_cast<const std::uint8_t*>(memmem(text.data(), text.size(), prefixes_.front().data(), stem_));
      if (found == nullptr) return false;
      text = text.subspan(static_cast<std::size_t>(found - text.data()));
      if (text.size() < candidate.size()) return false;
      std::copy_n(text.begin(), candidate.size(), candidate.begin());
      if (std::binary_search(prefixes_.begin(), prefixes_.end(), candidate)) return true;
      text = text.subspan(1);
    }
    return false;
  }

 private:
  static constexpr std::size_t longest_stem = 4;
  std::vector<GuidPrefix> prefixes_;
  std::size_t stem_ = 0;
};

/// The samples of built-in writers. Discovery says within them whom they are about (the key hash in the
/// inline QoS; the GUIDs of participant and endpoint in the payload), and Fast DDS does not compare that with
/// who sent them.
std::vector<OctetView> discovery_samples(OctetView datagram) {
  constexpr std::uint8_t data = 0x15;
  constexpr std::uint8_t data_frag = 0x16;
  constexpr std::uint8_t built_in = 0xc0;
  constexpr std::size_t kind_of_writer = 11;
  std::vector<OctetView> samples;
  OctetView left = datagram.subspan(rtps_header_octets);
  while (left.size() >= submessage_header_octets) {
    const std::uint8_t kind = left[0];
    const bool little = (left[1] & 1U) != 0;
    const auto length = static_cast<std::size_t>(little ? left[3] << 8 | left[2] : left[2] << 8 | left[3]);
    left = left.subspan(submessage_header_octets);
    // 0 is nothing, or all to the end of the message.
    const OctetView body = length == 0 || length > left.size() ? left : left.first(length);
    const bool is_sample = kind == data || kind == data_frag;
    if (is_sample && body.size() > kind_of_writer && (body[kind_of_writer] & built_in) == built_in)
      samples.push_back(body);
    if (is_sample && length == 0) break;
    left = left.subspan(std::min(round_up(length), left.size()));
  }
  return samples;
}

/// Whether one holds any of these anywhere.
bool are_about(const std::vector<OctetView>& samples, std::vector<GuidPrefix> prefixes) {
  const PrefixSearch search(std::move(prefixes));
  return std::any_of(samples.begin(), samples.end(), [&](OctetView sample) { return search.is_in(sample); });
}

SealKey derived(const SealKey& suite_key, std::string_view purpose, std::string_view name) {
  const std::string text = std::string(purpose) + std::string(name);
  return hmac_sha256(suite_key, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

constexpr std::size_t mark_at = 8;          // in the GUID prefix of a limited member's participant
constexpr std::uint8_t end_of_mark = 0x4c;  // where Fast DDS' own prefixes have 0
using Mark = std::array<std::uint8_t, 4>;

Mark mark_of(std::string_view name) {
  const Sha256::Digest digest = sha256_of(as_octets(name));
  return {digest[0], digest[1], digest[2], end_of_mark};
}

bool bears_mark_of(const GuidPrefix& prefix, std::string_view name) {
  const Mark mark = mark_of(name);
  return std::equal(mark.begin(), mark.end(), prefix.begin() + mark_at);
}

bool is_of_a_limited_one(const GuidPrefix& prefix) {
  return prefix.back() == end_of_mark;
}

}  // namespace

SealKey limited_seal_key(const SealKey& suite_key, std::string_view name) {
  return derived(suite_key, "srfs seal of ", name);
}

SealKey seal_key_among_limited(const SealKey& suite_key) {
  return derived(suite_key, "srfs seal among limited members", {});
}

GuidPrefix limited_prefix(std::string_view name, const std::array<std::uint8_t, 6>& random) {
  GuidPrefix prefix{1, 15};
  std::copy(random.begin(), random.end(), prefix.begin() + 2);
  const Mark mark = mark_of(name);
  std::copy(mark.begin(), mark.end(), prefix.begin() + mark_at);
  return prefix;
}

/// A datagram that bears a seal, in its parts.
struct DatagramSeal::Parts {
  MonotonicTime sealed;
  std::string_view name;
  OctetView header;  ///< of the RTPS message, and of the seal up to the tags
  OctetView tags;
  OctetView rest;

  [[nodiscard]] OctetView tag(std::size_t i) const {
    return (i + 1) * tag_octets <= tags.size() ? tags.subspan(i * tag_octets, tag_octets) : OctetView{};
  }
};

struct DatagramSeal::KeyRing {
  explicit KeyRing(SealKeys all)
      : keys(std::move(all)),
        mac(keys.key),
        among(keys.limited_to.empty() ? seal_key_among_limited(keys.key) : keys.among_limited) {}
  SealKeys keys;
  HmacSha256 mac;
  HmacSha256 among;
};

/// What a seal of this process consists of.
struct DatagramSeal::Tags {
  std::string name;
  std::vector<HmacSha256> macs;
};

namespace {

Tag tag_of(const HmacSha256& mac, OctetView header, const Sha256::Digest& content) {
  const Sha256::Digest digest = mac.of({header, content});
  Tag tag{};
  std::copy_n(digest.begin(), tag.size(), tag.begin());
  return tag;
}

/// The seal up to its tags, behind @p out.
void write_head(MonotonicTime time, const std::string& name, std::size_t tags, Octets& out) {
  const auto put = [&](std::uint64_t value, std::size_t octets) {
    for (std::size_t i = octets; i-- > 0;) out.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
  };
  out.push_back(submessage_seal);
  out.push_back(0);
  put(fixed_octets + round_up(name.size()) + tags * DatagramSeal::tag_octets, 2);
  put(static_cast<std::uint64_t>(time.ns()), 8);
  out.push_back(static_cast<std::uint8_t>(tags));
  out.push_back(static_cast<std::uint8_t>(name.size()));
  put(0, 2);
  out.insert(out.end(), name.begin(), name.end());
  out.resize(out.size() + round_up(name.size()) - name.size());
}

}  // namespace

DatagramSeal::DatagramSeal(SealKeys keys, ReadKeys read_keys)
    : read_keys_(std::move(read_keys)), ring_(std::make_shared<const KeyRing>(std::move(keys))) {
  make_tags();
}

DatagramSeal::~DatagramSeal() = default;

/// @pre the mutex is held, but in the constructor
void DatagramSeal::make_tags() {
  Tags tags{ring_->keys.limited_to, {ring_->mac}};
  if (!tags.name.empty()) {
    tags.macs.push_back(ring_->among);
  } else {
    for (const Limited& one : limited_) tags.macs.push_back(one.mac);
  }
  tags_ = std::make_shared<const Tags>(std::move(tags));
}

/// No two datagrams have one time. @pre the mutex is held
MonotonicTime DatagramSeal::next_time(MonotonicTime now) {
  last_sealed_ = std::max<std::int64_t>(now.ns(), last_sealed_ + 1);
  return MonotonicTime(nanoseconds(last_sealed_));
}

void DatagramSeal::seal(OctetView message, MonotonicTime now, Octets& out) {
  out.assign(message.begin(), message.end());
  if (message.size() < rtps_header_octets) return;
  // Together: what has no tag for a limited member is older than all that has one.
  std::unique_lock lock(mutex_);
  const MonotonicTime time = next_time(now);
  const auto tags = tags_;
  lock.unlock();
  const OctetView rest = message.subspan(rtps_header_octets);
  out.resize(rtps_header_octets);
  out.reserve(message.size() + most_octets);
  write_head(time, tags->name, tags->macs.size(), out);
  const std::size_t header_octets = out.size();
  const Sha256::Digest content = sha256_of(sealed_part(rest));
  for (const HmacSha256& mac : tags->macs) {
    const Tag tag = tag_of(mac, OctetView(out).first(header_octets), content);
    out.insert(out.end(), tag.begin(), tag.end());
  }
  out.insert(out.end(), rest.begin(), rest.end());
}

std::optional<DatagramSeal::Parts> DatagramSeal::parts_of(OctetView datagram) {
  OctetReader in(datagram.subspan(std::min(rtps_header_octets, datagram.size())));
  const bool is_seal = in.u8() == submessage_seal && in.u8() == 0;
  const std::size_t length = in.u16();
  const auto time = static_cast<std::int64_t>(in.u64());
  const std::size_t tags = in.u8();
  const std::size_t name_octets = in.u8();
  const std::uint16_t zero = in.u16();
  const OctetView name = in.bytes(name_octets);
  (void)in.bytes(round_up(name_octets) - name_octets);
  const std::size_t head = submessage_header_octets + fixed_octets + round_up(name_octets);
  const OctetView all_tags = in.bytes(tags * tag_octets);
  const bool is_whole = in.ok() && length == head - submessage_header_octets + all_tags.size();
  if (!is_seal || !is_whole || zero != 0 || tags == 0 || tags > 1 + most_limited ||
      name_octets > longest_name)
    return std::nullopt;
  return Parts{MonotonicTime(nanoseconds(time)),
               {reinterpret_cast<const char*>(name.data()), name.size()},
               datagram.first(rtps_header_octets + head),
               all_tags,
               datagram.subspan(rtps_header_octets + head + all_tags.size())};
}

/// Who sealed it by a key of the ring.
std::optional<DatagramSeal::Proven> DatagramSeal::prove_with(const KeyRing& ring, const Parts& parts,
                                                             const Sha256::Digest& content) const {
  const auto is_of = [&](const HmacSha256& mac, OctetView tag) {
    return equal_secrets(tag, tag_of(mac, parts.header, content));
  };
  if (!ring.keys.limited_to.empty()) {
    if (!parts.name.empty())
      return is_of(ring.among, parts.tag(1)) ? std::optional(Proven{std::string(parts.name)}) : std::nullopt;
    const Tag ours = tag_of(ring.mac, parts.header, content);
    for (std::size_t i = 1; !parts.tag(i).empty(); ++i) {
      if (equal_secrets(parts.tag(i), ours)) return Proven{};
    }
    return std::nullopt;
  }
  if (parts.name.empty()) return is_of(ring.mac, parts.tag(0)) ? std::optional(Proven{}) : std::nullopt;
  const HmacSha256 mac(limited_seal_key(ring.keys.key, parts.name));
  if (!is_of(mac, parts.tag(0))) return std::nullopt;
  return Proven{std::string(parts.name), mac};
}

std::optional<DatagramSeal::Proven> DatagramSeal::prove(const Parts& parts, MonotonicTime now) {
  const Sha256::Digest content = sha256_of(sealed_part(parts.rest));
  const auto by_those_known = [&]() -> std::optional<Proven> {
    std::unique_lock lock(mutex_);
    const auto ring = ring_;
    const auto before = before_;
    const auto known = std::find_if(limited_.begin(), limited_.end(),
                                    [&](const Limited& one) { return one.name == parts.name; });
    const bool is_limited = !ring->keys.limited_to.empty();
    const auto mac = known != limited_.end() && !is_limited ? std::optional(known->mac) : std::nullopt;
    lock.unlock();
    if (mac && equal_secrets(parts.tag(0), tag_of(*mac, parts.header, content)))
      return Proven{std::string(parts.name), mac, true};
    auto who = prove_with(*ring, parts, content);
    if (!who && before) who = prove_with(*before, parts, content);
    return who;
  };
  auto who = by_those_known();
  if (!who && read_again(now)) who = by_those_known();
  return who;
}

/// @return whether there is another key now
bool DatagramSeal::read_again(MonotonicTime now) {
  {
    const std::lock_guard lock(mutex_);
    if (now - key_read_ < between_readings) return false;
    key_read_ = now;
  }
  const auto keys = read_keys_();  // who sends does not wait for a file
  const std::lock_guard lock(mutex_);
  if (!keys || *keys == ring_->keys) return false;
  before_ = std::exchange(ring_, std::make_shared<const KeyRing>(*keys));
  make_tags();
  return true;
}

DatagramSeal::Verdict DatagramSeal::judge(OctetView datagram, MonotonicTime now, HeardTimes& heard) {
  const RtpsDatagram message(datagram);
  if (!message.sender()) return Verdict::foreign;  // no RTPS message: nobody takes it
  const auto parts = parts_of(datagram);
  if (!parts) return judge_unproven(message, datagram, parts);
  // What is cheap comes first: before anything is hashed.
  if (heard.look(*message.sender(), parts->sealed) == HeardTimes::Verdict::again)
    return forge(&ForgedDatagrams::repeated);
  const bool may_be_one = datagram.size() <= longest_of_unknown || is_member(*message.sender());
  auto who = may_be_one && parts->sealed <= now + longest_ahead ? prove(*parts, now) : std::nullopt;
  if (!who) return judge_unproven(message, datagram, parts);
  if (oversteps(*who, message, datagram)) return forge(&ForgedDatagrams::beyond);
  return admit(*message.sender(), std::move(*who), parts->sealed, now, heard);
}

/// A limited member speaks for itself alone.
bool DatagramSeal::oversteps(const Proven& who, const RtpsDatagram& message, OctetView datagram) const {
  if (who.name.empty()) return false;
  const GuidPrefix& sender = *message.sender();
  if (!bears_mark_of(sender, who.name)) return true;
  bool speaks_for_others = false;
  message.for_each([](const AnnouncedSample&) {},
                   [&](const GuidPrefix& other) { speaks_for_others |= other != sender; });
  if (speaks_for_others) return true;
  const auto discovery = discovery_samples(datagram);
  std::unique_lock lock(mutex_);
  const bool is_own = std::find(own_.begin(), own_.end(), sender) != own_.end();
  const Member* known = find(sender);
  const std::string& bearer = is_own             ? ring_->keys.limited_to
                              : known != nullptr ? known->limited_to
                                                 : who.name;
  if (bearer != who.name) return true;
  if (discovery.empty()) return false;
  std::vector<GuidPrefix> others = others_than(sender);
  lock.unlock();
  return are_about(discovery, std::move(others));
}

DatagramSeal::Verdict DatagramSeal::admit(const GuidPrefix& sender, Proven who, MonotonicTime sealed,
                                          MonotonicTime now, HeardTimes& heard) {
  const std::string name = who.name;
  const std::lock_guard lock(mutex_);
  const bool is_new = sealed >= now - longest_age && heard.look(sender, sealed) == HeardTimes::Verdict::first;
  if (!is_new || (!name.empty() && !remember_limited(sender, std::move(who), sealed))) {
    ++stale_;
    return Verdict::stale;
  }
  (void)heard.add(sender, sealed);
  // Who says goodbye for a limited member does not make its participant one that all believe.
  if (!name.empty() || !is_of_a_limited_one(sender)) remember(sender, name, sealed);
  return Verdict::member;
}

/// Without a seal that shows a member.
DatagramSeal::Verdict DatagramSeal::judge_unproven(const RtpsDatagram& message, OctetView datagram,
                                                   const std::optional<Parts>& parts) {
  std::unique_lock lock(mutex_);
  bool claims = has(*message.sender());
  message.for_each([](const AnnouncedSample&) {},
                   [&](const GuidPrefix& other) { claims = claims || has(other); });
  const Member* known = find(*message.sender());
  // To a limited member all seals are wrong that were made before their sender had heard of it.
  const bool is_from_before = parts && known != nullptr && !ring_->keys.limited_to.empty() &&
                              parts->name.empty() && parts->sealed < known->since;
  if (is_from_before) {
    ++stale_;
    return Verdict::stale;
  }
  lock.unlock();
  if (claims) return forge(parts ? &ForgedDatagrams::wrong_seal : &ForgedDatagrams::unsealed);
  const auto discovery = discovery_samples(datagram);
  if (discovery.empty()) return Verdict::foreign;
  lock.lock();
  std::vector<GuidPrefix> members = others_than({});
  lock.unlock();  // who sends waits for it
  return are_about(discovery, std::move(members)) ? forge(&ForgedDatagrams::about) : Verdict::foreign;
}

DatagramSeal::Verdict DatagramSeal::forge(std::uint64_t ForgedDatagrams::*reason) {
  const std::lock_guard lock(mutex_);
  ++(forged_.*reason);
  return Verdict::forged;
}

ForgedDatagrams DatagramSeal::forged() const {
  const std::lock_guard lock(mutex_);
  return forged_;
}

/// @pre the mutex is held
const DatagramSeal::Member* DatagramSeal::find(const GuidPrefix& prefix) const {
  const auto found = std::find_if(members_.begin(), members_.end(),
                                  [&](const Member& member) { return member.prefix == prefix; });
  return found != members_.end() ? &*found : nullptr;
}

/// @pre the mutex is held
bool DatagramSeal::has(const GuidPrefix& prefix) const {
  return std::find(own_.begin(), own_.end(), prefix) != own_.end() || find(prefix) != nullptr;
}

/// All members, those of this process too. @pre the mutex is held
std::vector<GuidPrefix> DatagramSeal::others_than(const GuidPrefix& prefix) const {
  std::vector<GuidPrefix> others = own_;
  for (const Member& member : members_) others.push_back(member.prefix);
  std::erase(others, prefix);
  return others;
}

/// @pre the mutex is held
void DatagramSeal::remember(const GuidPrefix& prefix, const std::string& limited_to, MonotonicTime sealed) {
  auto found = std::find_if(members_.begin(), members_.end(),
                            [&](const Member& member) { return member.prefix == prefix; });
  if (found == members_.end()) {
    if (members_.size() == most_members) members_.pop_back();
    found = members_.insert(members_.end(), {prefix, limited_to, sealed});
    ++revision_;
  }
  std::rotate(members_.begin(), found, found + 1);
}

/// @return false: its participant is another one. @pre the mutex is held
bool DatagramSeal::remember_limited(const GuidPrefix& prefix, Proven who, MonotonicTime sealed) {
  auto found = std::find_if(limited_.begin(), limited_.end(),
                            [&](const Limited& one) { return one.name == who.name; });
  const HmacSha256 mac = who.mac.value_or(ring_->among);
  if (found == limited_.end()) {
    if (limited_.size() == most_limited) limited_.pop_back();
    found = limited_.insert(limited_.end(), {who.name, prefix, mac});
  } else if (found->prefix != prefix) {
    const Member* before = find(found->prefix);
    if (before != nullptr && sealed < before->since + between_participants) return false;
    std::erase_if(members_, [&](const Member& member) { return member.prefix == found->prefix; });
    found->prefix = prefix;
  }
  found->mac = mac;
  std::rotate(limited_.begin(), found, found + 1);
  if (!who.is_known) make_tags();
  return true;
}

void DatagramSeal::add_own(const GuidPrefix& prefix) {
  const std::lock_guard lock(mutex_);
  own_.push_back(prefix);
}

bool DatagramSeal::is_member(const GuidPrefix& prefix) const {
  const std::lock_guard lock(mutex_);
  return has(prefix);
}

std::optional<std::string> DatagramSeal::limit_of(const GuidPrefix& prefix) const {
  const std::lock_guard lock(mutex_);
  if (std::find(own_.begin(), own_.end(), prefix) != own_.end()) return std::string();
  const Member* member = find(prefix);
  return member != nullptr ? std::optional(member->limited_to) : std::nullopt;
}

bool DatagramSeal::is_limited() const {
  return !keys().limited_to.empty();
}

SealKeys DatagramSeal::keys() const {
  const std::lock_guard lock(mutex_);
  return ring_->keys;
}

void seal_datagrams(SealKeys keys, DatagramSeal::ReadKeys read_keys) {
  seal_of_process() = std::make_shared<DatagramSeal>(std::move(keys), std::move(read_keys));
}

const std::shared_ptr<DatagramSeal>& datagram_seal() {
  return seal_of_process();
}

}  // namespace srfs::ros
