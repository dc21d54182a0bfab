// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <set>

#include "ros/endpoint.hpp"

namespace srfs::ros {

template <class M>
class Subscription;

/// Publishes messages of type M on one topic.
template <class M>
class Publisher {
 public:
  Publisher(Participant& participant, const Topic<M>& topic)
      : name_(topic.name),
        writer_(participant, topic_dds_name(topic.name), dds::TypeSupport(new TypeSupport<M>), topic.qos) {}

  /// Never waits for a reader. @return false when the message breaks a bound of its type (counted)
  bool publish(const M& message) { return writer_.write(&message); }
  /// A reader in the process that sent this message listens here.
  [[nodiscard]] bool is_heard_by_sender_of(const MessageInfo& message) const {
    return writer_.matched_in_participant_of(message.identity.writer_guid());
  }
  /// A publisher of what @p other receives listens here: the peer, not a recorder that only listens.
  template <class Other>
  [[nodiscard]] bool is_heard_by_a_publisher_of(const Subscription<Other>& other) const {
    for (const GUID_t& writer : other.publishers()) {
      if (writer_.matched_in_participant_of(writer)) return true;
    }
    return false;
  }
  [[nodiscard]] std::size_t subscription_count() const { return writer_.matched_count(); }
  /// Publications refused so far.
  [[nodiscard]] std::uint64_t refused() const { return writer_.refused(); }
  [[nodiscard]] QosEvents qos_events() const { return writer_.qos_events().events(); }
  /// Called after each event, on a middleware thread: post from there to the work thread.
  void on_qos_event(std::function<void()> callback) { writer_.qos_events().on_event(std::move(callback)); }
  [[nodiscard]] const std::string& topic_name() const { return name_; }
  [[nodiscard]] GUID_t guid() const { return writer_.guid(); }

 private:
  std::string name_;
  WriterEndpoint writer_;
};

/// Receives messages of type M; dropping it ends the subscription. Topics are the suite's own business:
/// what others publish there is counted, or dropped (ParticipantOptions::drop_foreign). So is what a limited
/// member publishes there that it may not (OfLimited). Services are open to the whole domain.
template <class M>
class Subscription {
 public:
  using Callback = typename TypedReader<M>::Callback;

  Subscription(Executor& executor, Participant& participant, const Topic<M>& topic, Callback callback)
      : name_(topic.name),
        reader_(TypedReader<M>::create(executor, participant, topic_dds_name(topic.name), topic.qos,
                                       topic.priority, std::move(callback))) {
    reader_->guard(topic.of_limited);
  }

  ~Subscription() { reader_->close(); }
  Subscription(const Subscription&) = delete;
  Subscription& operator=(const Subscription&) = delete;

  /// Handles what has arrived already, now. For callbacks that must not decide before it, on the work thread.
  void take_waiting() {
    reader_->receive_waiting();
    while (reader_->dispatch_one(monotonic_now())) {
    }
  }
  /// Called before the message that shows that those before it are lost, with when it came and their count.
  void on_lost(std::function<void(MonotonicTime received, std::uint64_t messages)> callback) {
    reader_->on_gap(
        [callback = std::move(callback)](const MessageInfo& info, std::int64_t first, std::int64_t last) {
          callback(info.received, static_cast<std::uint64_t>(last - first + 1));
        });
  }
  [[nodiscard]] InputStats stats() const { return reader_->stats(); }
  [[nodiscard]] QosEvents qos_events() const { return reader_->qos_events().events(); }
  /// Called after each event, on a middleware thread: post from there to the work thread.
  void on_qos_event(std::function<void()> callback) { reader_->qos_events().on_event(std::move(callback)); }
  [[nodiscard]] std::weak_ptr<const ReaderEndpoint> reader() const { return reader_; }
  /// The writers matched now.
  [[nodiscard]] std::set<GUID_t> publishers() const { return reader_->matched_writers(); }
  [[nodiscard]] std::size_t publisher_count() const { return reader_->matched_count(); }
  [[nodiscard]] const std::string& topic_name() const { return name_; }
  [[nodiscard]] GUID_t guid() const { return reader_->guid(); }

 private:
  std::string name_;
  std::shared_ptr<TypedReader<M>> reader_;
};

}  // namespace srfs::ros
