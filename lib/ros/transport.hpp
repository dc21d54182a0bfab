// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <fastdds/rtps/transport/TransportDescriptorInterface.h>

#include "base/fd.hpp"
#include "base/time.hpp"
#include "ros/datagram_filter.hpp"
#include "ros/executor.hpp"
#include "ros/isolation.hpp"

namespace srfs::ros {

/// When the kernel had the datagram that a sample came in, found again by the time at which Fast DDS looked
/// at it. Keeps the last 64 datagrams; older ones are forgotten and count as having arrived when they were
/// read. One thread.
class ArrivalLog {
 public:
  /// @param read when the datagram is handed to Fast DDS; not before that of the call before
  /// @param arrived when the kernel had it whole, by a clock that may have been set since
  /// @param longest since the socket was last found empty, by a clock that is never set: it has not waited
  ///                for longer
  void add(UtcTime read, UtcTime arrived, nanoseconds longest);
  /// @param looked_at Fast DDS' reception time stamp of the sample
  [[nodiscard]] UtcTime arrival_of(UtcTime looked_at) const;

 private:
  struct Entry {
    UtcTime read;
    UtcTime arrived;
  };
  std::array<Entry, 64> entries_{};
  std::size_t next_ = 0;
};

/// What the transport counts.
struct TransportStats {
  std::uint64_t datagrams = 0;
  MonotonicTime last_datagram;   ///< when the newest one was read
  std::uint64_t overflowed = 0;  ///< dropped by the kernel because the socket's buffer was full
  std::uint64_t foreign = 0;     ///< of participants outside the suite, dropped unread (DatagramFilter)
};

/// Keeps discovery's input in the socket until the participant is ready for it. Fast DDS 2.9 announces a new
/// participant before its receivers can pass on a datagram. Answers that come in between, as they do on one
/// host, are dropped, and the next announcement is a period away. Any thread.
class DiscoveryHold {
 public:
  void open();
  /// Returns when it is open, but after 1 s in any case.
  void pass();

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool open_ = false;
};

/// Two sockets of one port: the kernel sorts its datagrams by their sender, those of the suite into one, all
/// others into the other. So a flood from outside fills its own socket alone, and what finds it full costs
/// the sender the time, not this process. By the GUID prefix in the RTPS header, a claim as everywhere in
/// RTPS.
struct SortedSockets {
  Fd foreign;
  Fd ours;

  /// @param address in network order. @return nullopt: the port is taken, or this kernel cannot sort
  [[nodiscard]] static std::optional<SortedSockets> bind(std::uint32_t address, std::uint16_t port);
};

/// From now on the suite's datagrams are those of these participants. Any thread.
/// @param socket one of SortedSockets. @return false: the kernel refuses
bool sort_by_sender(int socket, std::span<const GuidPrefix> ours);

/// Shared by a participant and its transport, which Fast DDS owns.
class TransportState {
 public:
  DiscoveryHold discovery;  ///< opened by the participant when it has been made
  ArrivalLog arrivals;
  TransportStats stats;
  std::shared_ptr<DatagramFilter> filter;  ///< nullptr: everything passes
  /// Hands what the kernel holds already to Fast DDS, at most 4096 datagrams a socket. On the work thread.
  std::function<void()> receive_waiting = [] {};
  /// The participants of the suite; nullptr: a process that belongs to no suite, to which nobody is foreign.
  const KnownParticipants* known = nullptr;

  /// To be called when `known` has changed. Any thread.
  void tell_members_changed();
  /// @param callback empty: no call. When it returns, the callback before it is not being called
  void on_members_changed(std::function<void()> callback);

 private:
  std::mutex members_mutex_;
  std::function<void()> members_changed_;
};

/// A UDPv4 transport of Fast DDS whose user traffic is read by the executor's work thread instead of a
/// receive thread of its own: a sample reaches its callback without a change of thread (the larger part of
/// rclcpp's and of our earlier latency), with one thread less, and Fast DDS' locks are free again when the
/// callback runs. Discovery stays on Fast DDS' threads, so that a long callback costs no participant its
/// lease.
///
/// The DatagramFilter of the state decides what passes to Fast DDS, of discovery's datagrams, too: Fast DDS
/// takes memory for a sample as large as its first fragment claims.
///
/// Reading is bounded to 16 datagrams a turn of the loop; what comes meanwhile waits in the socket's buffer
/// (4 MiB where the system allows it), what finds that full is dropped by the kernel, counted, and sent again
/// by reliable writers. Datagrams of participants outside the suite wait in a socket of their own of 1 MiB
/// (SortedSockets), of which 8 or 64 KiB are read at a time, and after them none for 10 ms while more wait.
/// Where the kernel cannot sort, all wait in one socket, and foreign ones are dropped while the work thread
/// is behind (LoadShedder).
/// @param addresses transports are confined to these; none: all interfaces
/// @param executor outlives the participant; the participant is made and deleted on its work thread
[[nodiscard]] std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> work_thread_transport(
    std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> udp, Executor& executor,
    std::vector<std::string> addresses, std::shared_ptr<TransportState> state);

}  // namespace srfs::ros
