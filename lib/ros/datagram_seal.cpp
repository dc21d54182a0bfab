// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/datagram_seal.hpp"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <utility>

#include <openssl/core_names.h>
#include <openssl/evp.h>
#include <openssl/params.h>

#include "base/sha256.hpp"
#include "ros/datagram_filter.hpp"

namespace srfs::ros {
namespace {

constexpr std::size_t rtps_header_octets = 20;
constexpr std::size_t mac_octets = 16;
constexpr std::size_t time_octets = 8;
constexpr std::uint8_t submessage_seal = 0xa5;
constexpr std::array<std::uint8_t, 4> submessage_header{submessage_seal, 0, 0, time_octets + mac_octets};
static_assert(submessage_header.size() + time_octets + mac_octets == DatagramSeal::octets);

std::shared_ptr<DatagramSeal>& seal_of_process() {
  static std::shared_ptr<DatagramSeal> seal;
  return seal;
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

bool is_sealed(OctetView datagram) {
  return datagram.size() >= rtps_header_octets + DatagramSeal::octets &&
         std::equal(submessage_header.begin(), submessage_header.end(),
                    datagram.begin() + rtps_header_octets);
}

bool contains(OctetView text, const GuidPrefix& prefix) {
  return memmem(text.data(), text.size(), prefix.data(), prefix.size()) != nullptr;
}

/// Discovery says within its samples whom they are about (the key hash in the inline QoS; the GUIDs of
/// participant and endpoint in the payload), and Fast DDS does not compare that with who sent them.
/// @return whether a sample of a built-in writer holds one of @p prefixes anywhere
bool discovery_is_about(OctetView datagram, const std::vector<GuidPrefix>& prefixes) {
  constexpr std::uint8_t data = 0x15;
  constexpr std::uint8_t data_frag = 0x16;
  constexpr std::uint8_t built_in = 0xc0;
  constexpr std::size_t kind_of_writer = 11;
  OctetView left = datagram.subspan(rtps_header_octets);
  while (left.size() >= submessage_header.size()) {
    const std::uint8_t kind = left[0];
    const bool little = (left[1] & 1U) != 0;
    const auto length = static_cast<std::size_t>(little ? left[3] << 8 | left[2] : left[2] << 8 | left[3]);
    left = left.subspan(submessage_header.size());
    // 0 is nothing, or all to the end of the message.
    const OctetView body = length == 0 || length > left.size() ? left : left.first(length);
    const bool is_sample = kind == data || kind == data_frag;
    const bool is_discovery =
        is_sample && body.size() > kind_of_writer && (body[kind_of_writer] & built_in) == built_in;
    if (is_discovery && std::any_of(prefixes.begin(), prefixes.end(),
                                    [&](const GuidPrefix& prefix) { return contains(body, prefix); }))
      return true;
    if (is_sample && length == 0) return false;
    left = left.subspan(std::min((length + 3) / 4 * 4, left.size()));
  }
  return false;
}

/// When the sender sealed it. @pre is_sealed()
OctetView time_of(OctetView datagram) {
  return datagram.subspan(rtps_header_octets + submessage_header.size(), time_octets);
}

}  // namespace

/// HMAC-SHA-256 whose key is taken up once: a third of the cost for a small message.
class DatagramSeal::Mac {
 public:
  explicit Mac(const SealKey& key) : key_(key) {
    EVP_MAC* mac = EVP_MAC_fetch(nullptr, "HMAC", nullptr);
    context_ = EVP_MAC_CTX_new(mac);
    EVP_MAC_free(mac);
    char digest[] = "SHA256";
    const std::array<OSSL_PARAM, 2> parameters{
        OSSL_PARAM_construct_utf8_string(OSSL_MAC_PARAM_DIGEST, digest, 0), OSSL_PARAM_construct_end()};
    // Fails for lack of memory only.
    if (EVP_MAC_init(context_, key.data(), key.size(), parameters.data()) != 1) std::abort();
  }
  ~Mac() { EVP_MAC_CTX_free(context_); }
  Mac(const Mac&) = delete;
  Mac& operator=(const Mac&) = delete;

  [[nodiscard]] const SealKey& key() const { return key_; }
  [[nodiscard]] std::array<std::uint8_t, mac_octets> of(OctetView header, OctetView time, OctetView rest) {
    Sha256::Digest digest{};
    std::size_t size = 0;
    const bool made = EVP_MAC_init(context_, nullptr, 0, nullptr) == 1 && update(header) && update(time) &&
                      update(rest) && EVP_MAC_final(context_, digest.data(), &size, digest.size()) == 1;
    if (!made) std::abort();
    std::array<std::uint8_t, mac_octets> mac{};
    std::copy_n(digest.begin(), mac.size(), mac.begin());
    return mac;
  }

 private:
  bool update(OctetView data) { return EVP_MAC_update(context_, data.data(), data.size()) == 1; }

  SealKey key_;
  EVP_MAC_CTX* context_ = nullptr;
};

namespace {

Octets octets_of(MonotonicTime time) {
  OctetWriter out;
  out.u64(static_cast<std::uint64_t>(time.ns()));
  return out.take();
}

}  // namespace

DatagramSeal::DatagramSeal(const SealKey& key, ReadKey read_key)
    : read_key_(std::move(read_key)), mac_(std::make_unique<Mac>(key)) {}

DatagramSeal::~DatagramSeal() = default;

void DatagramSeal::seal(OctetView message, MonotonicTime now, Octets& out) {
  out.assign(message.begin(), message.end());
  if (message.size() < rtps_header_octets) return;
  const Octets time = octets_of(now);
  const OctetView header = message.first(rtps_header_octets);
  const OctetView rest = message.subspan(rtps_header_octets);
  const auto mac = [&] {
    const std::lock_guard lock(mutex_);
    return mac_->of(header, time, sealed_part(rest));
  }();
  out.resize(rtps_header_octets);
  out.insert(out.end(), submessage_header.begin(), submessage_header.end());
  out.insert(out.end(), time.begin(), time.end());
  out.insert(out.end(), mac.begin(), mac.end());
  out.insert(out.end(), rest.begin(), rest.end());
}

/// @pre the mutex is held
bool DatagramSeal::holds(OctetView datagram) {
  const OctetView header = datagram.first(rtps_header_octets);
  const OctetView claimed =
      datagram.subspan(rtps_header_octets + submessage_header.size() + time_octets, mac_octets);
  const OctetView rest = sealed_part(datagram.subspan(rtps_header_octets + octets));
  const auto is_of = [&](Mac* mac) {
    return mac != nullptr && equal_secrets(claimed, mac->of(header, time_of(datagram), rest));
  };
  return is_of(mac_.get()) || is_of(before_.get());
}

DatagramSeal::Seal DatagramSeal::seal_of(OctetView datagram, MonotonicTime now) {
  if (!is_sealed(datagram)) return Seal::none;
  OctetReader in(time_of(datagram));
  const MonotonicTime sent{nanoseconds(static_cast<std::int64_t>(in.u64()))};
  if (sent < now - longest_age || sent > now + longest_age) return Seal::old;
  return is_genuine(datagram, now) ? Seal::good : Seal::wrong;
}

bool DatagramSeal::is_genuine(OctetView datagram, MonotonicTime now) {
  std::unique_lock lock(mutex_);
  if (!holds(datagram)) {
    if (now - key_read_ < between_readings) return false;
    key_read_ = now;
    lock.unlock();  // who sends does not wait for a file
    const auto key = read_key_();
    lock.lock();
    if (!key || *key == mac_->key()) return false;
    before_ = std::exchange(mac_, std::make_unique<Mac>(*key));
    if (!holds(datagram)) return false;
  }
  remember(RtpsDatagram(datagram).sender().value());
  return true;
}

DatagramSeal::Verdict DatagramSeal::judge(OctetView datagram, MonotonicTime now) {
  const RtpsDatagram message(datagram);
  if (!message.sender()) return Verdict::foreign;  // no RTPS message: nobody takes it
  const Seal seal = seal_of(datagram, now);
  if (seal == Seal::good) return Verdict::member;
  std::unique_lock lock(mutex_);
  bool claims = has(*message.sender());
  message.for_each([](const AnnouncedSample&) {},
                   [&](const GuidPrefix& other) { claims = claims || has(other); });
  std::vector<GuidPrefix> members = members_;
  members.insert(members.end(), own_.begin(), own_.end());
  lock.unlock();  // who sends waits for it
  if (claims) {
    return forge(seal == Seal::none    ? &ForgedDatagrams::unsealed
                 : seal == Seal::wrong ? &ForgedDatagrams::wrong_seal
                                       : &ForgedDatagrams::old);
  }
  return discovery_is_about(datagram, members) ? forge(&ForgedDatagrams::about) : Verdict::foreign;
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
bool DatagramSeal::has(const GuidPrefix& prefix) const {
  const auto is_in = [&](const std::vector<GuidPrefix>& known) {
    return std::find(known.begin(), known.end(), prefix) != known.end();
  };
  return is_in(own_) || is_in(members_);
}

void DatagramSeal::remember(const GuidPrefix& prefix) {
  auto found = std::find(members_.begin(), members_.end(), prefix);
  if (found == members_.end()) {
    if (members_.size() == most_members) members_.pop_back();
    found = members_.insert(members_.end(), prefix);
  }
  std::rotate(members_.begin(), found, found + 1);
}

void DatagramSeal::add_own(const GuidPrefix& prefix) {
  const std::lock_guard lock(mutex_);
  own_.push_back(prefix);
}

bool DatagramSeal::is_member(const GuidPrefix& prefix) const {
  const std::lock_guard lock(mutex_);
  return has(prefix);
}

void seal_datagrams(const SealKey& key, DatagramSeal::ReadKey read_key) {
  seal_of_process() = std::make_shared<DatagramSeal>(key, std::move(read_key));
}

const std::shared_ptr<DatagramSeal>& datagram_seal() {
  return seal_of_process();
}

}  // namespace srfs::ros
