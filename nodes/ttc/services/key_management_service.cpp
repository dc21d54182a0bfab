// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/key_management_service.hpp"

#include <algorithm>

#include <mission/structures.hpp>

#include "base/known_key.hpp"
#include "wire/sdls_procedures.hpp"

namespace srfs {
namespace {

namespace failure = mission::failure;

std::uint16_t code_of(wire::KeyRefusal refusal) {
  switch (refusal) {
    case wire::KeyRefusal::unknown_key:
      return failure::unknown_key;
    case wire::KeyRefusal::wrong_state:
      return failure::wrong_key_state;
    case wire::KeyRefusal::key_in_use:
      return failure::key_in_use;
    case wire::KeyRefusal::table_full:
      return failure::table_full;
    case wire::KeyRefusal::not_a_new_key:
      return failure::not_a_new_key;
  }
  return failure::unknown_key;
}

}  // namespace

KeyManagementService::Failure KeyManagementService::failure_of(wire::KeyRefusal refusal, std::uint16_t id) {
  if (refusal == wire::KeyRefusal::table_full) return {.code = failure::table_full};
  return {code_of(refusal), id};
}

// ---- requests

void KeyManagementService::execute(const Telecommand& telecommand, MonotonicTime /*now*/) {
  if (!writing_ && !wanted_) return begin(telecommand);
  if (waiting_.size() == max_waiting) return fail(telecommand.origin, {.code = failure::busy});
  waiting_.push_back(telecommand);
}

void KeyManagementService::begin(const Telecommand& telecommand) {
  const TelecommandOrigin& origin = telecommand.origin;
  const std::uint8_t subtype = telecommand.command->subtype;
  OctetReader in(telecommand.arguments);
  in.bytes(wire::procedure_header_octets);  // the dictionary has checked it
  switch (subtype) {
    case mission::KeysVerify::subtype:
      return verify(origin, in);
    case mission::KeysInventory::subtype:
      return report_inventory(origin, in);
    case mission::KeysReadArsn::subtype:
      return report_arsn(origin, in.u16());
    case mission::KeysSetArsn::subtype:
      return set_arsn(origin, in);
    default:
      break;
  }
  OctetReader content = in;
  auto after = change(subtype, content);
  if (!after) return fail(origin, after.error());
  if (after->generation() == keys_.generation()) return report_queue_.done(origin);
  report_queue_.success(origin, Stage::start);
  wanted_ = SessionKeyChange{.origin = origin, .keys = std::move(*after)};
  if (subtype == mission::KeysRekey::subtype) wanted_->rekeyed = in.u16();
}

Result<wire::SessionKeys, KeyManagementService::Failure> KeyManagementService::change(std::uint8_t subtype,
                                                                                      OctetReader& in) const {
  if (subtype == mission::KeysOtar::subtype) return upload(in);
  const std::uint16_t first = in.u16();
  if (subtype == mission::KeysRekey::subtype) return rekey(first, in.u16());
  if (subtype != mission::KeysActivate::subtype && confirmed_by(first))
    return Err(Failure{failure::key_in_use, first});
  auto after = subtype == mission::KeysActivate::subtype     ? keys_.activated(first)
               : subtype == mission::KeysDeactivate::subtype ? keys_.deactivated(first)
                                                             : keys_.destroyed(first);
  if (!after) return Err(failure_of(after.error(), first));
  return std::move(*after);
}

Result<wire::SessionKeys, KeyManagementService::Failure> KeyManagementService::upload(OctetReader& in) const {
  const std::uint16_t master = in.u16();
  const auto found = std::find_if(masters_.begin(), masters_.end(),
                                  [master](const KeyEncryptionKey& k) { return k.id == master; });
  if (found == masters_.end()) return Err(Failure{failure::unknown_key, master});
  const auto uploaded = wire::open_key(found->key, in.rest());
  if (!uploaded) return Err(Failure{failure::key_not_authentic, master});
  const auto& octets = uploaded->key.octets();
  const bool is_master = std::any_of(masters_.begin(), masters_.end(),
                                     [&](const KeyEncryptionKey& k) { return k.key.octets() == octets; });
  const auto* known = keys_.find(uploaded->id);
  const bool repeated = known != nullptr && known->octets == wire::KeyOctets(uploaded->key);
  if (!repeated && (is_master || uplink_.has_key(octets) || why_known(octets)))
    return Err(Failure{failure::not_a_new_key, uploaded->id});
  auto after = keys_.uploaded(uploaded->id, uploaded->key);
  if (!after) return Err(failure_of(after.error(), uploaded->id));
  return std::move(*after);
}

Result<wire::SessionKeys, KeyManagementService::Failure> KeyManagementService::rekey(std::uint16_t spi,
                                                                                     std::uint16_t id) const {
  if (std::find(rekeyable_.begin(), rekeyable_.end(), spi) == rekeyable_.end())
    return Err(Failure{failure::unknown_key, spi});
  if (confirmed_by(id).value_or(spi) != spi) return Err(Failure{failure::key_in_use, id});
  auto after = keys_.rekeyed(spi, id);
  if (!after) return Err(failure_of(after.error(), id));
  return std::move(*after);
}

std::optional<std::uint16_t> KeyManagementService::confirmed_by(std::uint16_t id) const {
  const auto found = std::find_if(confirmed_.begin(), confirmed_.end(),
                                  [id](const UplinkChain::KeyConfirmed& c) { return c.key == id; });
  if (found == confirmed_.end()) return std::nullopt;
  return found->spi;
}

void KeyManagementService::verify(const TelecommandOrigin& origin, OctetReader& in) {
  const std::uint16_t id = in.u16();
  const auto* key = keys_.find(id);
  if (key == nullptr) return fail(origin, {failure::unknown_key, id});
  if (key->state != wire::KeyState::active) return fail(origin, {failure::wrong_key_state, id});
  wire::Challenge challenge{};
  const OctetView octets = in.bytes(challenge.size());
  std::copy(octets.begin(), octets.end(), challenge.begin());
  const auto answer = wire::answer_challenge(key->octets.key(), origin.id, challenge);
  if (!answer) return fail(origin, {failure::not_done, {}});
  OctetWriter content;
  content.u16(id);
  content.bytes(answer->iv_answer_mac);
  put(origin, mission::KeyVerification::subtype, content.view());
  report_queue_.done(origin);
}

void KeyManagementService::report_inventory(const TelecommandOrigin& origin, OctetReader& in) {
  const std::uint16_t first = in.u16();
  const std::uint16_t last = in.u16();
  for (const auto& key : keys_.keys()) {
    if (key.id < first || key.id > last) continue;
    OctetWriter content;
    content.u16(1);
    content.u16(key.id);
    content.u8(static_cast<std::uint8_t>(key.state));
    put(origin, mission::KeyInventory::subtype, content.view());
  }
  report_queue_.done(origin);
}

void KeyManagementService::report_arsn(const TelecommandOrigin& origin, std::uint16_t spi) {
  if (!uplink_.has_association(spi)) return fail(origin, {failure::unknown_key, spi});
  OctetWriter content;
  content.u16(spi);
  content.u64(uplink_.counter(spi).value_or(0));
  put(origin, mission::AssociationArsn::subtype, content.view());
  report_queue_.done(origin);
}

void KeyManagementService::set_arsn(const TelecommandOrigin& origin, OctetReader& in) {
  const std::uint16_t spi = in.u16();
  const std::uint64_t wanted = in.u64();
  if (!uplink_.has_association(spi)) return fail(origin, {failure::unknown_key, spi});
  const std::uint64_t now = uplink_.newest_counter(spi).value_or(0);
  if (wanted < now || wanted - now > max_arsn_step) return fail(origin, {failure::arsn_out_of_range, spi});
  uplink_.raise_counter(spi, wanted);
  report_queue_.done(origin);
}

// ---- storing

void KeyManagementService::on_confirmed(const std::vector<UplinkChain::KeyConfirmed>& confirmed) {
  confirmed_.insert(confirmed_.end(), confirmed.begin(), confirmed.end());
}

std::optional<SessionKeyChange> KeyManagementService::take_change() {
  if (writing_) return std::nullopt;
  if (!wanted_ && !confirmed_.empty()) {
    SessionKeyChange change{.origin = std::nullopt, .keys = keys_};
    for (const auto& [spi, key] : std::exchange(confirmed_, {}))
      change.keys = change.keys.confirmed(spi, key);
    if (change.keys.generation() != keys_.generation()) wanted_ = std::move(change);
  }
  writing_ = wanted_.has_value();
  return std::exchange(wanted_, std::nullopt);
}

/// That a key was confirmed holds in any case: only after a restart the key before it is taken too.
void KeyManagementService::on_stored(const SessionKeyChange& change, bool stored) {
  writing_ = false;
  if (stored || !change.origin) keys_ = change.keys;
  if (stored && change.rekeyed) {
    const auto use = keys_.use_of(*change.rekeyed);
    const auto* next = use && use->next ? keys_.find(*use->next) : nullptr;
    std::optional<UplinkAssociation::NextKey> key;
    if (next != nullptr) key = UplinkAssociation::NextKey{.id = next->id, .key = next->octets.key()};
    uplink_.set_next_key(*change.rekeyed, std::move(key));
  }
  if (change.origin && stored) report_queue_.success(*change.origin, Stage::completion);
  if (change.origin && !stored)
    report_queue_.failure(*change.origin, Stage::completion, failure::storage_unavailable);
  while (!waiting_.empty() && !wanted_) {
    const Telecommand next = std::move(waiting_.front());
    waiting_.pop_front();
    begin(next);
  }
}

// ---- reports

void KeyManagementService::fail(const TelecommandOrigin& origin, const Failure& failure) {
  report_queue_.failure(origin, Stage::start, failure.code,
                        failure.parameter ? octets_of_u16(*failure.parameter) : Octets{});
}

/// The content of a PDU: tag and length are put before it. Not stored: it answers a request.
void KeyManagementService::put(const TelecommandOrigin& origin, std::uint8_t subtype, OctetView content) {
  OctetWriter pdu;
  pdu.u8(subtype);
  pdu.u16(static_cast<std::uint16_t>(content.size()));
  pdu.bytes(content);
  report_queue_.put(Report{.apid = origin.apid,
                           .service = service_type,
                           .subtype = subtype,
                           .destination_id = origin.source_id,
                           .data = pdu.take(),
                           .stored = false});
}

}  // namespace srfs
