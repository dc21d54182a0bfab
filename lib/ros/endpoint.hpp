// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>

#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>

#include "base/time.hpp"
#include "ros/executor.hpp"
#include "ros/participant.hpp"
#include "ros/type_support.hpp"

namespace srfs::ros {

using eprosima::fastrtps::rtps::GUID_t;
using eprosima::fastrtps::rtps::SampleIdentity;
using eprosima::fastrtps::rtps::WriteParams;

/// What came in at one reader since it was made.
struct InputStats {
  std::uint64_t received = 0;   ///< well-formed samples handed to the callback
  std::uint64_t malformed = 0;  ///< octets that were no such message, or claimed to be too many; dropped
  std::uint64_t lost =
      0;  ///< gaps in writers' sequence numbers: overwritten before they were taken, or never arrived
  /// From participants outside the suite, or of a limited member in another's name, on a guarded reader;
  /// part of the others.
  std::uint64_t foreign = 0;
  // Of a service:
  std::uint64_t repeats = 0;  ///< requests that came again: answered again, not executed again
  std::uint64_t refused = 0;  ///< requests dropped because too many were waiting
  std::uint64_t unanswered =
      0;  ///< the client vanished, its reader never matched, or the reply broke a bound
};

/// What a callback may know of the sample beside its content.
struct MessageInfo {
  MonotonicTime received;  ///< when the kernel had it; without a work-thread transport, when Fast DDS read it
  SampleIdentity identity;
  SampleIdentity related;
};

/// QosEvents as they are reported on the middleware's threads.
class QosEventCounter {
 public:
  [[nodiscard]] QosEvents events() const;
  /// Called on a middleware thread after each event; an empty function: no call.
  void on_event(std::function<void()> callback);

  void deadline_missed(std::int32_t count);
  void liveliness_lost(std::int32_t count);
  void liveliness_changed(std::int32_t alive, std::int32_t lost);
  void incompatible(std::uint32_t policy, std::uint32_t count);

 private:
  void change(const std::function<void(QosEvents&)>& change);
  mutable std::mutex mutex_;
  QosEvents events_;
  std::function<void()> callback_;
};

/// A DDS writer with the set of readers matched now.
class WriterEndpoint : public dds::DataWriterListener {
 public:
  /// @throws std::runtime_error when Fast DDS refuses (configuring only)
  WriterEndpoint(Participant& participant, const std::string& dds_topic, dds::TypeSupport type,
                 const Qos& qos);
  ~WriterEndpoint() override;

  /// Synchronous; bounded by one pass through the kernel. @return false when the message breaks a bound of
  /// its type or DDS refuses
  bool write(const void* message, WriteParams* params = nullptr);
  [[nodiscard]] bool matched(const GUID_t& reader) const;
  /// A reader in the same participant as @p other (any endpoint of that process) is matched.
  [[nodiscard]] bool matched_in_participant_of(const GUID_t& other) const;
  [[nodiscard]] std::size_t matched_count() const;
  /// Called on a middleware thread at every change of the matches; set before others can match.
  void on_match_change(std::function<void()> callback);
  [[nodiscard]] std::uint64_t refused() const { return refused_; }
  [[nodiscard]] GUID_t guid() const { return writer_->guid(); }
  [[nodiscard]] QosEventCounter& qos_events() { return qos_events_; }
  [[nodiscard]] const QosEventCounter& qos_events() const { return qos_events_; }

  void on_publication_matched(dds::DataWriter*, const dds::PublicationMatchedStatus& status) override;
  void on_offered_deadline_missed(dds::DataWriter*, const dds::OfferedDeadlineMissedStatus& status) override;
  void on_offered_incompatible_qos(dds::DataWriter*,
                                   const dds::OfferedIncompatibleQosStatus& status) override;
  void on_liveliness_lost(dds::DataWriter*, const dds::LivelinessLostStatus& status) override;

 private:
  Participant& participant_;
  dds::DataWriter* writer_ = nullptr;
  mutable std::mutex mutex_;
  std::set<GUID_t> readers_;
  std::function<void()> match_change_;
  std::atomic<std::uint64_t> refused_{0};
  QosEventCounter qos_events_;
};

/// A DDS reader whose samples are taken on the work thread. Reception only marks the source as ready; the
/// reader's KEEP_LAST history is the bounded queue (oldest dropped, counted as lost).
class ReaderEndpoint : public Source,
                       public dds::DataReaderListener,
                       public std::enable_shared_from_this<ReaderEndpoint> {
 public:
  ReaderEndpoint(Executor& executor, Priority priority) : executor_(executor), priority_(priority) {}
  ~ReaderEndpoint() override;

  /// Ends the DDS reader. By the owner, on the work thread: the last reference may be dropped by a middleware
  /// thread that was just announcing data, and a reader must not be deleted inside its own callback.
  void close();
  /// What the kernel holds already reaches this reader's history now.
  void receive_waiting() const { participant_->receive_waiting(); }
  [[nodiscard]] InputStats stats() const;
  /// An owner that knows more than the reader (a service) adds it at every stats(). It must outlive the DDS
  /// reader.
  void add_to_stats(std::function<void(InputStats&)> fill) { fill_ = std::move(fill); }
  [[nodiscard]] std::size_t matched_count() const;
  /// The writers matched now.
  [[nodiscard]] std::set<GUID_t> matched_writers() const;
  [[nodiscard]] GUID_t guid() const { return reader_->guid(); }
  void on_match_change(std::function<void()> callback);
  /// From now on samples of participants outside the suite are counted, and dropped where the participant's
  /// options require it; those of limited members are dropped where they speak for another one.
  void guard() { guarded_ = true; }
  /// The last one whose sample was not its to send, for people; empty: none so far.
  [[nodiscard]] std::string last_foreign() const;
  [[nodiscard]] QosEventCounter& qos_events() { return qos_events_; }
  [[nodiscard]] const QosEventCounter& qos_events() const { return qos_events_; }

  void on_data_available(dds::DataReader*) override;
  void on_subscription_matched(dds::DataReader*, const dds::SubscriptionMatchedStatus& status) override;
  void on_requested_deadline_missed(dds::DataReader*,
                                    const eprosima::fastrtps::RequestedDeadlineMissedStatus& status) override;
  void on_requested_incompatible_qos(dds::DataReader*,
                                     const dds::RequestedIncompatibleQosStatus& status) override;
  void on_liveliness_changed(dds::DataReader*,
                             const eprosima::fastrtps::LivelinessChangedStatus& status) override;

 protected:
  /// @param largest_octets samples that claim to be larger are dropped and counted as malformed
  void open(Participant& participant, const std::string& dds_topic, dds::TypeSupport type, const Qos& qos,
            std::size_t largest_octets);
  /// Samples of one writer that never came, or that made room before they were taken.
  struct Gap {
    std::int64_t first;
    std::int64_t last;
  };
  /// Counts the sample's gap to the one before from the same writer. @return it
  std::optional<Gap> count_gap(const SampleIdentity& identity);
  /// @param shared  a limited member may speak here, at least for itself
  /// @return false when the sample is foreign, or of a limited member that may not, and to be dropped
  [[nodiscard]] bool admit(const SampleIdentity& identity, bool shared);
  /// The limited member whose sample was admitted last; empty: of another one.
  [[nodiscard]] const std::string& limited() const { return limited_; }
  void count_foreign(const SampleIdentity& identity);

  Executor& executor_;
  Priority priority_;
  dds::DataReader* reader_ = nullptr;
  InputStats stats_;
  Participant* participant_ = nullptr;
  std::size_t largest_octets_ = 0;

 private:
  [[nodiscard]] bool is_below(const std::string& name) const;

  bool guarded_ = false;
  std::string dds_topic_;
  std::string limited_;
  std::shared_ptr<std::atomic<std::uint64_t>> too_large_ = std::make_shared<std::atomic<std::uint64_t>>(0);
  std::function<void(InputStats&)> fill_;
  std::optional<GUID_t> last_foreign_;
  mutable std::mutex mutex_;
  std::set<GUID_t> writers_;
  std::function<void()> match_change_;
  QosEventCounter qos_events_;
  struct WriterPosition {
    GUID_t writer;
    std::int64_t sequence;
  };
  std::vector<WriterPosition> positions_;  // bounded; the least recently seen writer makes room
};

/// What a reader of a topic takes at most.
template <class M>
[[nodiscard]] std::size_t largest_octets(const Qos& qos) {
  return qos.largest_octets != 0 ? qos.largest_octets : largest_sample<M>();
}

/// A reader of messages of type M.
template <class M>
class TypedReader final : public ReaderEndpoint {
 public:
  using Callback = std::function<void(const M&, const MessageInfo&)>;

  static std::shared_ptr<TypedReader> create(Executor& executor, Participant& participant,
                                             const std::string& dds_topic, const Qos& qos, Priority priority,
                                             Callback callback) {
    std::shared_ptr<TypedReader> self(new TypedReader(executor, priority, std::move(callback)));
    self->open(participant, dds_topic, dds::TypeSupport(new TypeSupport<M>), qos, largest_octets<M>(qos));
    return self;
  }

  using ReaderEndpoint::guard;
  void guard(const OfLimited<M>& of_limited) {
    guard();
    of_limited_ = of_limited;
  }
  /// Called before the callback with the sample that shows that those before it are lost.
  void on_gap(std::function<void(const MessageInfo&, std::int64_t first, std::int64_t last)> callback) {
    gap_callback_ = std::move(callback);
  }

  bool dispatch_one(MonotonicTime now) override {
    if (reader_ == nullptr) return false;
    dds::SampleInfo info;
    if (reader_->take_next_sample(&sample_, &info) != ReturnCode_t::RETCODE_OK) return false;
    participant_->on_taken(info.sample_identity, reader_->guid());
    handle(info, now);
    if (!keeps_memory(largest_octets_)) sample_ = {};
    return true;
  }

 private:
  void handle(const dds::SampleInfo& info, MonotonicTime now) {
    if (!info.valid_data) return;
    const auto gap = count_gap(info.sample_identity);
    const bool shared = of_limited_.all || of_limited_.author != nullptr;
    if (!admit(info.sample_identity, shared)) return;
    if (gap && gap_callback_)
      gap_callback_({now, info.sample_identity, info.related_sample_identity}, gap->first, gap->last);
    if (!sample_.well_formed) {
      ++stats_.malformed;
      return;
    }
    if (!limited().empty() && of_limited_.author != nullptr &&
        sample_.message.*of_limited_.author != limited()) {
      count_foreign(info.sample_identity);
      return;
    }
    ++stats_.received;
    callback_(sample_.message,
              {participant_->received_at(info, now), info.sample_identity, info.related_sample_identity});
  }

  TypedReader(Executor& executor, Priority priority, Callback callback)
      : ReaderEndpoint(executor, priority), callback_(std::move(callback)) {}
  Callback callback_;
  OfLimited<M> of_limited_;
  std::function<void(const MessageInfo&, std::int64_t, std::int64_t)> gap_callback_;
  Sample<M> sample_;  // reused, unless it may be large: no allocation for messages of a steady size
};

/// "/timing/tick" -> "rt/timing/tick" and so on, as rmw_fastrtps names them.
[[nodiscard]] std::string topic_dds_name(const std::string& ros_name);
[[nodiscard]] std::string request_dds_name(const std::string& service);
[[nodiscard]] std::string reply_dds_name(const std::string& service);

}  // namespace srfs::ros
