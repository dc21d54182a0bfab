// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/transport.hpp"

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cstring>
#include <mutex>
#include <span>

#include <arpa/inet.h>
#include <fastdds/rtps/network/SenderResource.h>
#include <fastdds/rtps/transport/ChainingTransport.h>
#include <fastdds/rtps/transport/ChainingTransportDescriptor.h>
#include <fastdds/rtps/transport/TransportReceiverInterface.h>
#include <fastrtps/utils/IPLocator.h>
#include <linux/filter.h>
#include <netinet/in.h>
#include <sys/epoll.h>
#include <sys/socket.h>

#include "base/fd.hpp"
#include "base/log.hpp"
#include "ros/datagram_seal.hpp"
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

constexpr int foreign_buffer_octets = 1 << 20;
constexpr int most_foreign_at_a_time = 8;
constexpr std::uint64_t foreign_octets_at_a_time = 64U << 10;
constexpr nanoseconds foreign_pause = milliseconds(10);

/// @param shared further sockets may be bound to the port; if one is already, it must have been shared, too
Fd bind_socket(const in_addr& address, std::uint16_t port, int buffer_octets, bool shared) {
  Fd fd(socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!fd) return fd;
  const int on = 1;
  if (shared && setsockopt(fd.get(), SOL_SOCKET, SO_REUSEPORT, &on, sizeof on) != 0) return {};
  setsockopt(fd.get(), SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  setsockopt(fd.get(), SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
  // Past net.core.rmem_max with the right to it, else up to that.
  if (setsockopt(fd.get(), SOL_SOCKET, SO_RCVBUFFORCE, &buffer_octets, sizeof buffer_octets) != 0) {
    setsockopt(fd.get(), SOL_SOCKET, SO_RCVBUF, &buffer_octets, sizeof buffer_octets);
  }
  sockaddr_in me{};
  me.sin_family = AF_INET;
  me.sin_port = htons(port);
  me.sin_addr = address;
  if (bind(fd.get(), reinterpret_cast<const sockaddr*>(&me), sizeof me) != 0) return {};
  return fd;
}

/// Lets through what no seal speaks against, at one port.
class SealGate {
 public:
  explicit SealGate(TransportState& state) : state_(state) {}

  /// By one thread at a time.
  [[nodiscard]] bool passes(OctetView datagram, MonotonicTime now) {
    const auto& seal = datagram_seal();
    if (!seal) return true;
    const auto verdict = seal->judge(datagram, now, heard_);
    if (const auto revision = seal->revision(); revision != revision_) {
      revision_ = revision;
      state_.tell_members_changed();
    }
    return verdict == DatagramSeal::Verdict::member || verdict == DatagramSeal::Verdict::foreign;
  }

 private:
  TransportState& state_;
  HeardTimes heard_{monotonic_now()};
  std::uint64_t revision_ = 0;
};

/// Whose datagrams a socket has.
enum class Senders : std::uint8_t { all, ours, foreign };

/// One socket of the participant's user traffic.
class Channel {
 public:
  Channel(Fd fd, Senders senders, const Locator_t& locator, rtps::TransportReceiverInterface& receiver,
          Executor& executor, std::shared_ptr<TransportState> state, std::shared_ptr<SealGate> gate,
          std::span<std::uint8_t> buffer)
      : fd_(std::move(fd)),
        senders_(senders),
        locator_(locator),
        receiver_(receiver),
        executor_(executor),
        state_(std::move(state)),
        gate_(std::move(gate)),
        buffer_(buffer) {
    watch();
  }

  [[nodiscard]] std::uint32_t port() const { return IPLocator::getPhysicalPort(locator_); }
  /// Any thread, one at a time.
  void sort(const std::vector<GuidPrefix>& ours) {
    if (senders_ != Senders::ours || ours == sorted_) return;
    if (sort_by_sender(fd_.get(), ours)) sorted_ = ours;
  }

  /// What is there already.
  void read_waiting() {
    if (senders_ == Senders::foreign) {
      read_foreign();
    } else {
      read(most_datagrams_waiting);
    }
  }

 private:
  void watch() {
    watch_ = executor_.add_fd(
        fd_.get(), EPOLLIN,
        [this](std::uint32_t) {
          if (senders_ == Senders::foreign) {
            read_foreign();
          } else {
            read(most_datagrams_a_turn);
          }
        },
        "DDS socket");
  }

  void read(int most) {
    for (int i = 0; i < most && read_some(); i += datagrams_a_call) {
    }
  }

  /// Further ones wait for foreign_pause: meanwhile the socket wakes nobody, and the kernel drops what finds
  /// it full.
  void read_foreign() {
    if (!watch_) return;
    const std::uint64_t enough = octets_read_ + foreign_octets_at_a_time;
    bool more = true;
    for (int i = 0; i < most_foreign_at_a_time && more && octets_read_ < enough; i += datagrams_a_call)
      more = read_some();
    if (!more) return;
    watch_.reset();
    resume_ = executor_.add_timer(
        monotonic_now() + foreign_pause, nanoseconds(0), [this] { watch(); }, "DDS socket");
  }

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
      const OctetView datagram(static_cast<const std::uint8_t*>(incoming[i].part.iov_base),
                               messages[i].msg_len);
      note(messages[i].msg_hdr, datagram, looked - empty_at_);
      state_->stats.last_datagram = looked;
      octets_read_ += messages[i].msg_len;
      if (passes(datagram, looked)) hand_over(incoming[i], messages[i].msg_len);
    }
    if (count == datagrams_a_call) return true;
    empty_at_ = looked;
    busy_since_.reset();
    return false;
  }

  bool passes(OctetView datagram, MonotonicTime now) {
    if (!gate_->passes(datagram, now)) return false;
    if (!state_->filter) return true;
    const bool sheds = senders_ == Senders::all && shedder_.shed(now, now - busy_since_.value_or(now));
    return state_->filter->judge(datagram, sheds, now) == DatagramFilter::Verdict::pass;
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
  void note(msghdr& message, OctetView datagram, nanoseconds longest) {
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
        if (dropped != dropped_) count_overflow(datagram, dropped - dropped_);
        dropped_ = dropped;
      }
    }
    ++state_->stats.datagrams;
    state_->arrivals.add(now, arrived, longest);
  }

  void count_overflow(OctetView next, std::uint32_t count) {
    if (senders_ == Senders::foreign) {
      state_->filter->unread(next, count);
    } else {
      state_->stats.overflowed += count;
    }
  }

  Fd fd_;
  const Senders senders_;
  Locator_t locator_;
  rtps::TransportReceiverInterface& receiver_;
  Executor& executor_;
  std::shared_ptr<TransportState> state_;
  std::shared_ptr<SealGate> gate_;  ///< of the port's sockets together
  std::span<std::uint8_t> buffer_;
  std::uint32_t dropped_ = 0;
  std::uint64_t octets_read_ = 0;
  LoadShedder shedder_;
  std::optional<MonotonicTime> busy_since_;   ///< first read of those that left something in the socket
  MonotonicTime empty_at_ = monotonic_now();  ///< the socket was checked, and nothing was left in it
  std::vector<GuidPrefix> sorted_;            ///< whose datagrams come here
  Executor::Handle watch_;                    ///< nullptr: foreign datagrams wait for resume_
  Timer resume_;
};

/// What discovery's socket hands its datagrams to: they wait here, the others in the socket. No reader
/// of a node listens here. Discovery must hear of every participant, foreign ones too.
class HeldReceiver final : public rtps::TransportReceiverInterface {
 public:
  HeldReceiver(rtps::TransportReceiverInterface& receiver, std::shared_ptr<TransportState> state)
      : receiver_(receiver), state_(std::move(state)), gate_(*state_) {}
  void OnDataReceived(const eprosima::fastrtps::rtps::octet* data, std::uint32_t size, const Locator_t& local,
                      const Locator_t& remote) override {
    state_->discovery.pass();
    forget_stalled(local);
    // The filter first, which hashes nothing.
    const bool is_sound =
        !state_->filter || state_->filter->judge_discovery({data, size}) == DatagramFilter::Verdict::pass;
    if (is_sound && passes_seal({data, size})) receiver_.OnDataReceived(data, size, local, remote);
  }

 private:
  /// Each interface of the white list has a thread that reads it.
  bool passes_seal(OctetView datagram) {
    const std::lock_guard lock(gate_mutex_);
    return gate_.passes(datagram, monotonic_now());
  }

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
  std::mutex gate_mutex_;
  SealGate gate_;
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

/// Sends by a sender of the UDP transport, which outlives it, with the suite's seal.
class SealingSender final : public eprosima::fastrtps::rtps::SenderResource {
 public:
  explicit SealingSender(SenderResource& udp) : SenderResource(udp.kind()), udp_(udp) {
    send_lambda_ = [&udp](const eprosima::fastrtps::rtps::octet* data, std::uint32_t size, auto* begin,
                          auto* end, const std::chrono::steady_clock::time_point& deadline) {
      thread_local Octets sealed;  // grows to the longest message
      datagram_seal()->seal({data, size}, monotonic_now(), sealed);
      return udp.send(sealed.data(), static_cast<std::uint32_t>(sealed.size()), begin, end, deadline);
    };
  }
  void add_locators_to_list(eprosima::fastrtps::rtps::LocatorList_t& locators) const override {
    udp_.add_locators_to_list(locators);
  }

 private:
  SenderResource& udp_;
};

class WorkThreadTransport final : public rtps::ChainingTransport {
 public:
  explicit WorkThreadTransport(const Descriptor& descriptor)
      : ChainingTransport(descriptor),
        descriptor_(descriptor),
        buffer_(std::make_unique_for_overwrite<std::uint8_t[]>(buffer_octets())) {
    descriptor_.state->receive_waiting = [this] {
      for (const auto& channel : channels_) channel->read_waiting();
    };
    descriptor_.state->on_members_changed([this] { sort_again(); });
  }
  ~WorkThreadTransport() override {
    descriptor_.state->on_members_changed({});
    descriptor_.state->receive_waiting = [] {};
    descriptor_.state->discovery.open();
    udp_senders_.clear();
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
      return low_level_transport_->OpenInputChannel(
          locator, held_.back().get(),
          max_message_octets + static_cast<std::uint32_t>(DatagramSeal::most_octets));
    }
    if (IsInputChannelOpen(locator)) return true;
    std::vector<std::unique_ptr<Channel>> made;
    const std::vector<std::string> any{"0.0.0.0"};
    for (const std::string& text : descriptor_.addresses.empty() ? any : descriptor_.addresses) {
      in_addr address{};
      if (inet_pton(AF_INET, text.c_str(), &address) != 1) return false;
      if (!open_sockets(address, locator, *receiver, made))
        return false;  // taken: Fast DDS tries the next port
    }
    {
      const std::lock_guard lock(mutex_);
      for (auto& channel : made) channels_.push_back(std::move(channel));
    }
    sort_again();
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

  // What goes out goes straight through the UDP transport: no link of a chain in the path of a sample. Where
  // it is sealed, the UDP transport finds its own senders again among themselves.
  bool OpenOutputChannel(rtps::SendResourceList& list, const Locator_t& locator) override {
    if (!datagram_seal()) return low_level_transport_->OpenOutputChannel(list, locator);
    const std::size_t before = udp_senders_.size();
    if (!low_level_transport_->OpenOutputChannel(udp_senders_, locator)) return false;
    for (std::size_t i = before; i < udp_senders_.size(); ++i)
      list.push_back(std::make_unique<SealingSender>(*udp_senders_[i]));
    return true;
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
  /// @return false: the port is taken
  bool open_sockets(const in_addr& address, const Locator_t& locator,
                    rtps::TransportReceiverInterface& receiver, std::vector<std::unique_ptr<Channel>>& made) {
    const auto port = static_cast<std::uint16_t>(IPLocator::getPhysicalPort(locator));
    const auto gate = std::make_shared<SealGate>(*descriptor_.state);  // before there is a socket
    const auto add = [&](Fd fd, Senders senders) {
      made.push_back(std::make_unique<Channel>(std::move(fd), senders, locator, receiver,
                                               descriptor_.executor, descriptor_.state, gate,
                                               std::span(buffer_.get(), buffer_octets())));
    };
    if (descriptor_.state->known != nullptr) {
      if (auto sorted = SortedSockets::bind(address.s_addr, port)) {
        add(std::move(sorted->foreign), Senders::foreign);
        add(std::move(sorted->ours), Senders::ours);
        return true;
      }
    }
    Fd fd = bind_socket(address, port, receive_buffer_octets, false);
    if (!fd) return false;
    add(std::move(fd), Senders::all);
    return true;
  }

  void sort_again() {
    if (descriptor_.state->known == nullptr) return;
    std::vector<GuidPrefix> ours = descriptor_.state->known->ours();
    if (const auto& seal = datagram_seal())  // another suite of this name is foreign
      std::erase_if(ours, [&](const GuidPrefix& prefix) { return !seal->is_member(prefix); });
    const std::lock_guard lock(mutex_);
    for (const auto& channel : channels_) channel->sort(ours);
  }

  [[nodiscard]] std::size_t buffer_octets() const {
    return datagrams_a_call * (std::size_t{descriptor_.max_message_size()} + DatagramSeal::most_octets);
  }

  Descriptor descriptor_;
  // One for all channels: they are read one after another. Untouched pages of it cost no memory.
  std::unique_ptr<std::uint8_t[]> buffer_;
  mutable std::mutex mutex_;
  std::vector<std::unique_ptr<Channel>> channels_;
  std::vector<std::unique_ptr<HeldReceiver>> held_;
  rtps::SendResourceList udp_senders_;  ///< of which sealing ones are given out
};

rtps::TransportInterface* Descriptor::create_transport() const {
  return new WorkThreadTransport(*this);
}

}  // namespace

void TransportState::tell_members_changed() {
  const std::lock_guard lock(members_mutex_);
  if (members_changed_) members_changed_();
}

void TransportState::on_members_changed(std::function<void()> callback) {
  const std::lock_guard lock(members_mutex_);
  members_changed_ = std::move(callback);
}

std::optional<SortedSockets> SortedSockets::bind(std::uint32_t address, std::uint16_t port) {
  const in_addr where{address};
  SortedSockets sockets;
  // The first one is not shared: so two processes never have one port.
  sockets.foreign = bind_socket(where, port, foreign_buffer_octets, false);
  const int on = 1;
  if (!sockets.foreign || setsockopt(sockets.foreign.get(), SOL_SOCKET, SO_REUSEPORT, &on, sizeof on) != 0)
    return std::nullopt;
  sockets.ours = bind_socket(where, port, receive_buffer_octets, true);
  if (!sockets.ours || !sort_by_sender(sockets.ours.get(), {})) return std::nullopt;
  return sockets;
}

bool sort_by_sender(int socket, std::span<const GuidPrefix> ours) {
  // The program returns a number in the order in which the sockets were bound. A datagram that is too short
  // for its GUID prefix (octets 8 to 19 of the RTPS header) ends it with 0.
  constexpr std::uint32_t to_foreign = 0;
  constexpr std::uint32_t to_ours = 1;
  std::vector<sock_filter> program;
  for (const GuidPrefix& prefix : ours) {
    const auto word = [&](std::size_t i) {
      return std::uint32_t{prefix[i]} << 24 | std::uint32_t{prefix[i + 1]} << 16 |
             std::uint32_t{prefix[i + 2]} << 8 | prefix[i + 3];
    };
    std::uint8_t to_the_next = 5;
    for (const std::size_t i : {4U, 8U, 0U}) {  // the octets that differ first
      program.push_back(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(8 + i)));
      program.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, word(i), 0, to_the_next));
      to_the_next = static_cast<std::uint8_t>(to_the_next - 2);
    }
    program.push_back(BPF_STMT(BPF_RET | BPF_K, to_ours));
  }
  program.push_back(BPF_STMT(BPF_RET | BPF_K, to_foreign));
  const sock_fprog filter{static_cast<unsigned short>(program.size()), program.data()};
  return setsockopt(socket, SOL_SOCKET, SO_ATTACH_REUSEPORT_CBPF, &filter, sizeof filter) == 0;
}

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
