// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/transport.hpp"

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cstring>
#include <span>

#include <arpa/inet.h>
#include <fastdds/rtps/transport/ChainingTransport.h>
#include <fastdds/rtps/transport/ChainingTransportDescriptor.h>
#include <fastdds/rtps/transport/TransportReceiverInterface.h>
#include <fastrtps/utils/IPLocator.h>
#include <netinet/in.h>
#include <sys/epoll.h>
#include <sys/socket.h>

#include "base/fd.hpp"
#include "base/log.hpp"
#include "ros/participant.hpp"

namespace srfs::ros {
namespace {

namespace rtps = eprosima::fastdds::rtps;
using eprosima::fastrtps::rtps::IPLocator;
using eprosima::fastrtps::rtps::Locator_t;

constexpr int receive_buffer_octets = 4 << 20;
constexpr int most_datagrams_a_turn = 16;
constexpr int most_datagrams_waiting = 4096;  // more than the socket holds of our messages
constexpr int datagrams_a_call = 2;

/// Ports of a participant (RTPS 2.2, 9.6.1.1): discovery has even ones, user traffic odd ones, whatever its
/// number.
bool is_user_unicast(const Locator_t& locator) {
  return !IPLocator::isMulticast(locator) && IPLocator::getPhysicalPort(locator) % 2 == 1;
}

Fd bind_socket(const in_addr& address, std::uint16_t port) {
  Fd fd(socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!fd) return fd;
  const int on = 1;
  setsockopt(fd.get(), SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  setsockopt(fd.get(), SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
  // Past net.core.rmem_max with the right to it, else up to that.
  if (setsockopt(fd.get(), SOL_SOCKET, SO_RCVBUFFORCE, &receive_buffer_octets,
                 sizeof receive_buffer_octets) != 0) {
    setsockopt(fd.get(), SOL_SOCKET, SO_RCVBUF, &receive_buffer_octets, sizeof receive_buffer_octets);
  }
  sockaddr_in me{};
  me.sin_family = AF_INET;
  me.sin_port = htons(port);
  me.sin_addr = address;
  if (bind(fd.get(), reinterpret_cast<const sockaddr*>(&me), sizeof me) != 0) return {};
  return fd;
}

/// One port of the participant's user traffic, on one address.
class Channel {
 public:
  Channel(Fd fd, const Locator_t& locator, rtps::TransportReceiverInterface& receiver, Executor& executor,
          std::shared_ptr<TransportState> state, std::span<std::uint8_t> buffer)
      : fd_(std::move(fd)),
        locator_(locator),
        receiver_(receiver),
        state_(std::move(state)),
        buffer_(buffer),
        watch_(executor.add_fd(
            fd_.get(), EPOLLIN, [this](std::uint32_t) { read(most_datagrams_a_turn); }, "DDS socket")) {}

  [[nodiscard]] std::uint32_t port() const { return IPLocator::getPhysicalPort(locator_); }

  void read(int most) {
    for (int i = 0; i < most && read_some(); i += datagrams_a_call) {
    }
  }

 private:
  struct Incoming {
    sockaddr_in from{};
    iovec part{};
    alignas(cmsghdr) std::array<std::uint8_t, 128> control{};
  };

  /// Reads what is there, at most datagrams_a_call. Asking for two shows in the same system call that there
  /// is no second one, which is the rule. @return whether there may be more
  bool read_some() {
    std::array<Incoming, datagrams_a_call> incoming;
    std::array<mmsghdr, datagrams_a_call> messages{};
    const std::size_t size = buffer_.size() / datagrams_a_call;
    for (std::size_t i = 0; i < messages.size(); ++i) {
      incoming[i].part = {buffer_.data() + i * size, size};
      msghdr& message = messages[i].msg_hdr;
      message.msg_name = &incoming[i].from;
      message.msg_namelen = sizeof incoming[i].from;
      message.msg_iov = &incoming[i].part;
      message.msg_iovlen = 1;
      message.msg_control = incoming[i].control.data();
      message.msg_controllen = incoming[i].control.size();
    }
    const MonotonicTime looked = monotonic_now();
    const int count = recvmmsg(fd_.get(), messages.data(), messages.size(), 0, nullptr);
    // A pending ICMP error (a peer that was killed) is reported once and is nothing to us.
    if (count < 0) {
      if (errno == ECONNREFUSED || errno == EINTR) return true;
      busy_since_.reset();
      return false;
    }
    const auto received = static_cast<std::size_t>(count);
    if (!busy_since_) busy_since_ = looked;
    for (std::size_t i = 0; i < received; ++i) {
      note(messages[i].msg_hdr, looked - empty_at_);
      state_->stats.last_datagram = looked;
      if (passes({static_cast<const std::uint8_t*>(incoming[i].part.iov_base), messages[i].msg_len}, looked))
        hand_over(incoming[i], messages[i].msg_len);
    }
    if (count == datagrams_a_call) return true;
    empty_at_ = looked;
    busy_since_.reset();
    return false;
  }

  bool passes(OctetView datagram, MonotonicTime now) {
    if (!state_->filter) return true;
    return state_->filter->judge(datagram, shedder_.shed(now, now - busy_since_.value_or(now)), now) ==
           DatagramFilter::Verdict::pass;
  }

  void hand_over(const Incoming& incoming, std::uint32_t length) {
    Locator_t remote;
    remote.kind = LOCATOR_KIND_UDPv4;
    IPLocator::setIPv4(remote, reinterpret_cast<const std::uint8_t*>(&incoming.from.sin_addr));
    IPLocator::setPhysicalPort(remote, ntohs(incoming.from.sin_port));
    receiver_.OnDataReceived(static_cast<const std::uint8_t*>(incoming.part.iov_base), length, locator_,
                             remote);
  }

  /// @param longest the datagram has not waited for longer
  void note(msghdr& message, nanoseconds longest) {
    const UtcTime now = system_utc_now();
    UtcTime arrived = now;
    for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr; c = CMSG_NXTHDR(&message, c)) {
      if (c->cmsg_level != SOL_SOCKET) continue;
      if (c->cmsg_type == SCM_TIMESTAMPNS) {
        timespec t{};
        std::memcpy(&t, CMSG_DATA(c), sizeof t);
        arrived = UtcTime(seconds(t.tv_sec) + nanoseconds(t.tv_nsec));
      } else if (c->cmsg_type == SO_RXQ_OVFL) {
        std::uint32_t dropped = 0;  // since the socket was made
        std::memcpy(&dropped, CMSG_DATA(c), sizeof dropped);
        state_->stats.overflowed += dropped - dropped_;
        dropped_ = dropped;
      }
    }
    ++state_->stats.datagrams;
    state_->arrivals.add(now, arrived, longest);
  }

  Fd fd_;
  Locator_t locator_;
  rtps::TransportReceiverInterface& receiver_;
  std::shared_ptr<TransportState> state_;
  std::span<std::uint8_t> buffer_;
  std::uint32_t dropped_ = 0;
  LoadShedder shedder_;
  std::optional<MonotonicTime> busy_since_;   ///< first read of those that left something in the socket
  MonotonicTime empty_at_ = monotonic_now();  ///< the socket was checked, and nothing was left in it
  Executor::Handle watch_;
};

/// What discovery's socket hands its datagrams to: they wait here, the others in the socket. No reader
/// of a node listens here. Discovery must hear of every participant, foreign ones too.
class HeldReceiver final : public rtps::TransportReceiverInterface {
 public:
  HeldReceiver(rtps::TransportReceiverInterface& receiver, std::shared_ptr<TransportState> state)
      : receiver_(receiver), state_(std::move(state)) {}
  void OnDataReceived(const eprosima::fastrtps::rtps::octet* data, std::uint32_t size, const Locator_t& local,
                      const Locator_t& remote) override {
    state_->discovery.pass();
    forget_stalled(local);
    const bool passes =
        !state_->filter || state_->filter->judge_discovery({data, size}) == DatagramFilter::Verdict::pass;
    if (passes) receiver_.OnDataReceived(data, size, local, remote);
  }

 private:
  /// On the thread that reads discovery: as if they had said goodbye themselves.
  void forget_stalled(const Locator_t& local) {
    if (!state_->filter) return;
    while (const auto who = state_->filter->next_stalled()) {
      log::warn(
          "participant {} outside the suite leaves a large sample unfinished while others wait for its "
          "room: forgotten until it announces itself again",
          to_hex(*who));
      const Octets goodbye = departure_message(*who);
      receiver_.OnDataReceived(goodbye.data(), static_cast<std::uint32_t>(goodbye.size()), local, local);
    }
  }

  rtps::TransportReceiverInterface& receiver_;
  std::shared_ptr<TransportState> state_;
};

struct Descriptor : rtps::ChainingTransportDescriptor {
  Descriptor(std::shared_ptr<rtps::TransportDescriptorInterface> udp, Executor& work_thread,
             std::vector<std::string> on_addresses, std::shared_ptr<TransportState> shared_state)
      : ChainingTransportDescriptor(std::move(udp)),
        executor(work_thread),
        addresses(std::move(on_addresses)),
        state(std::move(shared_state)) {}
  [[nodiscard]] rtps::TransportInterface* create_transport() const override;

  Executor& executor;
  std::vector<std::string> addresses;
  std::shared_ptr<TransportState> state;
};

class WorkThreadTransport final : public rtps::ChainingTransport {
 public:
  explicit WorkThreadTransport(const Descriptor& descriptor)
      : ChainingTransport(descriptor),
        descriptor_(descriptor),
        buffer_(std::make_unique_for_overwrite<std::uint8_t[]>(buffer_octets())) {
    descriptor_.state->receive_waiting = [this] {
      for (const auto& channel : channels_) channel->read(most_datagrams_waiting);
    };
  }
  ~WorkThreadTransport() override {
    descriptor_.state->receive_waiting = [] {};
    descriptor_.state->discovery.open();
    low_level_transport_.reset();  // its threads use the held receivers
  }
  WorkThreadTransport(const WorkThreadTransport&) = delete;
  WorkThreadTransport& operator=(const WorkThreadTransport&) = delete;

  rtps::TransportDescriptorInterface* get_configuration() override { return &descriptor_; }

  bool IsInputChannelOpen(const Locator_t& locator) const override {
    if (!is_user_unicast(locator)) return low_level_transport_->IsInputChannelOpen(locator);
    const std::lock_guard lock(mutex_);
    return std::any_of(channels_.begin(), channels_.end(),
                       [&](const auto& c) { return c->port() == IPLocator::getPhysicalPort(locator); });
  }

  bool OpenInputChannel(const Locator_t& locator, rtps::TransportReceiverInterface* receiver,
                        std::uint32_t max_message_octets) override {
    if (!is_user_unicast(locator)) {
      const std::lock_guard lock(mutex_);
      held_.push_back(std::make_unique<HeldReceiver>(*receiver, descriptor_.state));
      return low_level_transport_->OpenInputChannel(locator, held_.back().get(), max_message_octets);
    }
    if (IsInputChannelOpen(locator)) return true;
    std::vector<std::unique_ptr<Channel>> made;
    const std::vector<std::string> any{"0.0.0.0"};
    for (const std::string& text : descriptor_.addresses.empty() ? any : descriptor_.addresses) {
      in_addr address{};
      if (inet_pton(AF_INET, text.c_str(), &address) != 1) return false;
      Fd fd = bind_socket(address, static_cast<std::uint16_t>(IPLocator::getPhysicalPort(locator)));
      if (!fd) return false;  // taken: Fast DDS tries the next port
      made.push_back(std::make_unique<Channel>(std::move(fd), locator, *receiver, descriptor_.executor,
                                               descriptor_.state, std::span(buffer_.get(), buffer_octets())));
    }
    const std::lock_guard lock(mutex_);
    for (auto& channel : made) channels_.push_back(std::move(channel));
    return true;
  }

  bool CloseInputChannel(const Locator_t& locator) override {
    if (!is_user_unicast(locator)) {
      descriptor_.state->discovery.open();  // the receive thread may wait there
      return low_level_transport_->CloseInputChannel(locator);
    }
    const std::lock_guard lock(mutex_);
    std::erase_if(channels_, [&](const auto& c) { return c->port() == IPLocator::getPhysicalPort(locator); });
    return true;
  }

  // What goes out goes straight through the UDP transport: no link of a chain in the path of a sample.
  bool OpenOutputChannel(rtps::SendResourceList& list, const Locator_t& locator) override {
    return low_level_transport_->OpenOutputChannel(list, locator);
  }
  bool send(eprosima::fastrtps::rtps::SenderResource*, const eprosima::fastrtps::rtps::octet*, std::uint32_t,
            eprosima::fastrtps::rtps::LocatorsIterator*, eprosima::fastrtps::rtps::LocatorsIterator*,
            const std::chrono::steady_clock::time_point&) override {
    assert(false && "no sender of this transport goes through the chain");
    return false;
  }
  void receive(rtps::TransportReceiverInterface*, const eprosima::fastrtps::rtps::octet*, std::uint32_t,
               const Locator_t&, const Locator_t&) override {
    assert(false && "no receiver of this transport goes through the chain");
  }
  void shutdown() override { low_level_transport_->shutdown(); }

 private:
  [[nodiscard]] std::size_t buffer_octets() const {
    return std::size_t{datagrams_a_call} * descriptor_.max_message_size();
  }

  Descriptor descriptor_;
  // One for all channels: they are read one after another. Untouched pages of it cost no memory.
  std::unique_ptr<std::uint8_t[]> buffer_;
  mutable std::mutex mutex_;
  std::vector<std::unique_ptr<Channel>> channels_;
  std::vector<std::unique_ptr<HeldReceiver>> held_;
};

rtps::TransportInterface* Descriptor::create_transport() const {
  return new WorkThreadTransport(*this);
}

}  // namespace

void DiscoveryHold::open() {
  {
    const std::lock_guard lock(mutex_);
    open_ = true;
  }
  changed_.notify_all();
}

void DiscoveryHold::pass() {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, seconds(1), [this] { return open_; });
}

void ArrivalLog::add(UtcTime read, UtcTime arrived, nanoseconds longest) {
  entries_[next_++ % entries_.size()] = {read, std::max(arrived, read - longest)};
}

UtcTime ArrivalLog::arrival_of(UtcTime looked_at) const {
  const std::size_t known = std::min(next_, entries_.size());
  for (std::size_t back = 1; back <= known; ++back) {
    const Entry& entry = entries_[(next_ - back) % entries_.size()];
    if (entry.read <= looked_at) return std::min(entry.arrived, looked_at);
  }
  return looked_at;
}

std::shared_ptr<rtps::TransportDescriptorInterface> work_thread_transport(
    std::shared_ptr<rtps::TransportDescriptorInterface> udp, Executor& executor,
    std::vector<std::string> addresses, std::shared_ptr<TransportState> state) {
  return std::make_shared<Descriptor>(std::move(udp), executor, std::move(addresses), std::move(state));
}

}  // namespace srfs::ros
