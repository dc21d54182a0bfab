// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/endpoint.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "ros/datagram_seal.hpp"

namespace srfs::ros {
namespace {

/// What the statistics call a reader: "rt/x" the topic /x, "rq/xRequest" and "rr/xReply" the service /x.
std::pair<CallbackKind, std::string_view> callback_name(std::string_view dds_topic) {
  constexpr std::string_view request = "Request";
  constexpr std::string_view reply = "Reply";
  const std::string_view name = dds_topic.substr(std::min<std::size_t>(dds_topic.find('/'), 2));
  if (dds_topic.starts_with("rq/") && name.ends_with(request))
    return {CallbackKind::service, name.substr(0, name.size() - request.size())};
  if (dds_topic.starts_with("rr/") && name.ends_with(reply))
    return {CallbackKind::client, name.substr(0, name.size() - reply.size())};
  return {CallbackKind::subscription, dds_topic.starts_with("rt/") ? name : dds_topic};
}

std::string policy_name(std::uint32_t policy) {
  switch (policy) {
    case dds::DURABILITY_QOS_POLICY_ID:
      return "durability";
    case dds::DEADLINE_QOS_POLICY_ID:
      return "deadline";
    case dds::LIVELINESS_QOS_POLICY_ID:
      return "liveliness";
    case dds::RELIABILITY_QOS_POLICY_ID:
      return "reliability";
    default:
      return "policy " + std::to_string(policy);
  }
}

}  // namespace

QosEvents QosEventCounter::events() const {
  const std::lock_guard lock(mutex_);
  return events_;
}

void QosEventCounter::on_event(std::function<void()> callback) {
  const std::lock_guard lock(mutex_);
  callback_ = std::move(callback);
}

void QosEventCounter::change(const std::function<void(QosEvents&)>& change) {
  std::function<void()> callback;
  {
    const std::lock_guard lock(mutex_);
    change(events_);
    callback = callback_;
  }
  if (callback) callback();
}

void QosEventCounter::deadline_missed(std::int32_t count) {
  change([&](QosEvents& e) { e.deadlines_missed += static_cast<std::uint32_t>(count); });
}

void QosEventCounter::liveliness_lost(std::int32_t count) {
  change([&](QosEvents& e) { e.liveliness_lost += static_cast<std::uint32_t>(count); });
}

void QosEventCounter::liveliness_changed(std::int32_t alive, std::int32_t lost) {
  change([&](QosEvents& e) {
    e.alive = alive;
    e.liveliness_lost += static_cast<std::uint32_t>(std::max(lost, 0));
  });
}

void QosEventCounter::incompatible(std::uint32_t policy, std::uint32_t count) {
  change([&](QosEvents& e) {
    e.incompatible += count;
    e.incompatible_policy = policy_name(policy);
  });
}

WriterEndpoint::WriterEndpoint(Participant& participant, const std::string& dds_topic, dds::TypeSupport type,
                               const Qos& qos)
    : participant_(participant) {
  // The listener goes in with the creation: readers that are known already match inside it.
  writer_ = participant.create_writer(dds_topic, std::move(type), qos, this);
  if (writer_ == nullptr) throw std::runtime_error("DDS refused a writer for " + dds_topic);
}

WriterEndpoint::~WriterEndpoint() {
  participant_.destroy(writer_);
}

bool WriterEndpoint::write(const void* message, WriteParams* params) {
  // Fast DDS takes a mutable pointer and passes it to our serialize(), which does not write to it.
  auto* data = const_cast<void*>(message);
  const bool written = params != nullptr ? writer_->write(data, *params) : writer_->write(data);
  if (!written) ++refused_;
  return written;
}

bool WriterEndpoint::matched(const GUID_t& reader) const {
  const std::lock_guard lock(mutex_);
  return readers_.contains(reader);
}

bool WriterEndpoint::matched_in_participant_of(const GUID_t& other) const {
  const std::lock_guard lock(mutex_);
  return std::any_of(readers_.begin(), readers_.end(),
                     [&](const GUID_t& reader) { return reader.guidPrefix == other.guidPrefix; });
}

std::size_t WriterEndpoint::matched_count() const {
  const std::lock_guard lock(mutex_);
  return readers_.size();
}

void WriterEndpoint::on_match_change(std::function<void()> callback) {
  const std::lock_guard lock(mutex_);
  match_change_ = std::move(callback);
}

void WriterEndpoint::on_publication_matched(dds::DataWriter*, const dds::PublicationMatchedStatus& status) {
  std::function<void()> callback;
  {
    const std::lock_guard lock(mutex_);
    const auto reader = static_cast<GUID_t>(status.last_subscription_handle);
    if (status.current_count_change > 0) {
      readers_.insert(reader);
    } else {
      readers_.erase(reader);
    }
    callback = match_change_;
  }
  if (callback) callback();
}

void WriterEndpoint::on_offered_deadline_missed(dds::DataWriter*,
                                                const dds::OfferedDeadlineMissedStatus& status) {
  qos_events_.deadline_missed(status.total_count_change);
}

void WriterEndpoint::on_offered_incompatible_qos(dds::DataWriter*,
                                                 const dds::OfferedIncompatibleQosStatus& status) {
  qos_events_.incompatible(status.last_policy_id, status.total_count_change);
}

void WriterEndpoint::on_liveliness_lost(dds::DataWriter*, const dds::LivelinessLostStatus& status) {
  qos_events_.liveliness_lost(status.total_count_change);
}

/// What a client hears from the server that it called: a reply of a service, feedback and status of an
/// action.
static bool is_answer(const std::string& dds_topic) {
  return dds_topic.starts_with("rr/") ||
         (dds_topic.starts_with("rt/") && dds_topic.find("/_action/") != std::string::npos);
}

ReaderEndpoint::~ReaderEndpoint() {
  close();
}

void ReaderEndpoint::close() {
  if (participant_ != nullptr) participant_->destroy(std::exchange(reader_, nullptr));
}

void ReaderEndpoint::open(Participant& participant, const std::string& dds_topic, dds::TypeSupport type,
                          const Qos& qos, std::size_t largest_octets) {
  participant_ = &participant;
  largest_octets_ = largest_octets;
  dds_topic_ = dds_topic;
  const auto [kind, name] = callback_name(dds_topic);
  executor_.name_source(shared_from_this(), kind, name);
  Qos bounded = qos;
  bounded.largest_octets = largest_octets;
  if (datagram_seal() && is_answer(dds_topic)) guard();
  reader_ = participant.create_reader(dds_topic, std::move(type), bounded, this);
  if (reader_ == nullptr) throw std::runtime_error("DDS refused a reader for " + dds_topic);
}

void ReaderEndpoint::on_data_available(dds::DataReader*) {
  // Nothing to lock when the owner is just dropping us on the work thread.
  if (const auto self = weak_from_this().lock()) executor_.notify(self, priority_);
}

InputStats ReaderEndpoint::stats() const {
  InputStats stats = stats_;
  stats.malformed += *too_large_;
  if (fill_ && reader_ != nullptr) fill_(stats);
  return stats;
}

std::size_t ReaderEndpoint::matched_count() const {
  const std::lock_guard lock(mutex_);
  return writers_.size();
}

std::set<GUID_t> ReaderEndpoint::matched_writers() const {
  const std::lock_guard lock(mutex_);
  return writers_;
}

void ReaderEndpoint::on_match_change(std::function<void()> callback) {
  const std::lock_guard lock(mutex_);
  match_change_ = std::move(callback);
}

void ReaderEndpoint::on_subscription_matched(dds::DataReader* dds_reader,
                                             const dds::SubscriptionMatchedStatus& status) {
  std::function<void()> callback;
  {
    const std::lock_guard lock(mutex_);
    const auto writer = static_cast<GUID_t>(status.last_publication_handle);
    // Not reader_: a writer that is known already matches while the reader is being made.
    const Gid reader = to_gid(dds_reader->guid());
    if (status.current_count_change > 0) {
      participant_->on_writer_matched(to_gid(writer), reader, largest_octets_, too_large_);
      writers_.insert(writer);
    } else {
      participant_->on_writer_unmatched(to_gid(writer), reader);
      writers_.erase(writer);
    }
    callback = match_change_;
  }
  if (callback) callback();
}

void ReaderEndpoint::on_requested_deadline_missed(
    dds::DataReader*, const eprosima::fastrtps::RequestedDeadlineMissedStatus& status) {
  qos_events_.deadline_missed(status.total_count_change);
}

void ReaderEndpoint::on_requested_incompatible_qos(dds::DataReader*,
                                                   const dds::RequestedIncompatibleQosStatus& status) {
  qos_events_.incompatible(status.last_policy_id, status.total_count_change);
}

void ReaderEndpoint::on_liveliness_changed(dds::DataReader*,
                                           const eprosima::fastrtps::LivelinessChangedStatus& status) {
  qos_events_.liveliness_changed(status.alive_count, status.not_alive_count_change);
}

std::optional<ReaderEndpoint::Gap> ReaderEndpoint::count_gap(const SampleIdentity& identity) {
  constexpr std::size_t most_writers = 64;
  const std::int64_t sequence = identity.sequence_number().to64long();
  const auto found = std::find_if(positions_.begin(), positions_.end(), [&](const WriterPosition& p) {
    return p.writer == identity.writer_guid();
  });
  if (found == positions_.end()) {
    if (positions_.size() == most_writers) positions_.pop_back();
    positions_.insert(positions_.begin(), {identity.writer_guid(), sequence});
    return std::nullopt;
  }
  std::optional<Gap> gap;
  if (sequence > found->sequence + 1) {
    gap = {found->sequence + 1, sequence - 1};
    stats_.lost += static_cast<std::uint64_t>(sequence - found->sequence - 1);
  }
  found->sequence = std::max(found->sequence, sequence);
  std::rotate(positions_.begin(), found, found + 1);
  return gap;
}

void ReaderEndpoint::count_foreign(const SampleIdentity& identity) {
  ++stats_.foreign;
  last_foreign_ = identity.writer_guid();
}

bool ReaderEndpoint::admit(const SampleIdentity& identity, bool shared) {
  limited_.clear();
  if (!guarded_) return true;
  if (participant_->is_foreign(identity.writer_guid())) {
    count_foreign(identity);
    return !participant_->drops_foreign() && !datagram_seal();
  }
  limited_ = participant_->limited_name(identity.writer_guid());
  if (limited_.empty() || shared || is_below(limited_)) return true;
  count_foreign(identity);
  return false;
}

/// Topics and services of a node begin with its name. Those of an action may also begin with the first word
/// of it: /image/capture is image_acquisition's.
bool ReaderEndpoint::is_below(const std::string& name) const {
  const std::string_view path =
      std::string_view(dds_topic_).substr(std::min<std::size_t>(dds_topic_.size(), 3));
  const std::string_view first = path.substr(0, path.find('/'));
  return first == name ||
         (path.find("/_action/") != std::string_view::npos && name.starts_with(std::string(first) + "_"));
}

std::string ReaderEndpoint::last_foreign() const {
  if (!last_foreign_) return {};
  const std::string limited = participant_->limited_name(*last_foreign_);
  if (!limited.empty()) return limited + ", which speaks for itself alone";
  GuidPrefix prefix{};
  std::copy_n(last_foreign_->guidPrefix.value, prefix.size(), prefix.begin());
  return participant_->known_participants().describe(prefix);
}

std::string topic_dds_name(const std::string& ros_name) {
  return "rt" + ros_name;
}

std::string request_dds_name(const std::string& service) {
  return "rq" + service + "Request";
}

std::string reply_dds_name(const std::string& service) {
  return "rr" + service + "Reply";
}

}  // namespace srfs::ros
