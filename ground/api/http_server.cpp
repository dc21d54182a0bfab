// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/http_server.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <exception>
#include <utility>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "base/text.hpp"

namespace srfs::ground::api {
namespace {

constexpr int backlog = 64;
constexpr int send_buffer_octets = 32'768;  ///< so that a reader that stalls is noticed
constexpr milliseconds exhausted_pause{100};
constexpr seconds place_patience{10};

/// What a refused request still sends is taken and dropped: a connection that is closed before loses the
/// answer.
void drain(Transport& transport) {
  constexpr std::size_t octets_max = 1U << 20;
  const MonotonicTime deadline = monotonic_now() + seconds(1);
  std::string dropped;
  for (std::size_t octets = 0; octets < octets_max && transport.read(dropped, deadline);) {
    octets += dropped.size();
    dropped.clear();
  }
}

/// For so many octets.
MonotonicTime deadline_for(std::size_t octets) {
  return monotonic_now() + HttpServer::write_patience + seconds(octets / HttpServer::octets_a_second_min);
}

void set_port(Address& address, std::uint16_t port) {
  if (address.storage.ss_family == AF_INET6)
    reinterpret_cast<sockaddr_in6*>(&address.storage)->sin6_port = htons(port);
  else
    reinterpret_cast<sockaddr_in*>(&address.storage)->sin_port = htons(port);
}

std::uint16_t port_of(const sockaddr_storage& storage) {
  return ntohs(storage.ss_family == AF_INET6 ? reinterpret_cast<const sockaddr_in6&>(storage).sin6_port
                                             : reinterpret_cast<const sockaddr_in&>(storage).sin_port);
}

Result<Fd, std::string> listen_on(const Address& address) {
  Fd socket(::socket(address.storage.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!socket) return Err(errno_text(errno));
  const int on = 1;
  static_cast<void>(::setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on));
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address.storage), address.octets) != 0 ||
      ::listen(socket.get(), backlog) != 0)
    return Err(errno_text(errno));
  return socket;
}

}  // namespace

bool Address::is_loopback() const {
  if (storage.ss_family == AF_INET6)
    return IN6_IS_ADDR_LOOPBACK(&reinterpret_cast<const sockaddr_in6&>(storage).sin6_addr);
  constexpr std::uint32_t network = 0xFF000000;
  return (ntohl(reinterpret_cast<const sockaddr_in&>(storage).sin_addr.s_addr) & network) == 0x7F000000;
}

Result<Address, std::string> parse_address(const std::string& text) {
  const auto wrong =
      fmt::format("'{}': expected [ADDRESS:]PORT, as in 8190, 127.0.0.1:8190, [::1]:8190", text);
  const std::size_t colon = text.rfind(':');
  const auto port = to_number<std::uint16_t>(colon == std::string::npos ? text : text.substr(colon + 1));
  if (!port) return Err(wrong);
  Address address;
  address.name = colon == std::string::npos ? "127.0.0.1" : text.substr(0, colon);
  if (address.name == "localhost") address.name = "127.0.0.1";
  auto& v4 = reinterpret_cast<sockaddr_in&>(address.storage);
  auto& v6 = reinterpret_cast<sockaddr_in6&>(address.storage);
  if (::inet_pton(AF_INET, address.name.c_str(), &v4.sin_addr) == 1) {
    address.storage.ss_family = AF_INET;
    address.octets = sizeof v4;
  } else {
    if (!address.name.starts_with('[') || !address.name.ends_with(']')) return Err(wrong);
    const std::string bare = address.name.substr(1, address.name.size() - 2);
    if (::inet_pton(AF_INET6, bare.c_str(), &v6.sin6_addr) != 1) return Err(wrong);
    address.storage.ss_family = AF_INET6;
    address.octets = sizeof v6;
  }
  set_port(address, *port);
  return address;
}

Result<std::unique_ptr<HttpServer>, std::string> HttpServer::open(Address address, std::uint16_t wanted_port,
                                                                  std::shared_ptr<const TlsSettings> tls) {
  Result<Fd, std::string> listener = Err(std::string());
  const std::uint16_t port = port_of(address.storage);
  if (port == 0 && wanted_port != 0) {
    Address wanted = address;
    set_port(wanted, wanted_port);
    listener = listen_on(wanted);
  }
  if (!listener) listener = listen_on(address);
  if (!listener)
    return Err(fmt::format("cannot listen at {}:{}: {}; choose another port: --web [ADDRESS:]PORT",
                           address.name, port, listener.error()));
  sockaddr_storage bound{};
  socklen_t octets = sizeof bound;
  static_cast<void>(::getsockname(listener->get(), reinterpret_cast<sockaddr*>(&bound), &octets));
  Fd stop(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (!stop) return Err(fmt::format("no eventfd: {}", errno_text(errno)));
  return std::unique_ptr<HttpServer>(
      new HttpServer(std::move(*listener), std::move(stop), port_of(bound), std::move(tls)));
}

HttpServer::~HttpServer() {
  stop();
}

void HttpServer::start(HttpApplication& application) {
  application_ = &application;
  acceptor_ = std::thread([this] { accept_all(); });
}

void HttpServer::stop() {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto told = ::write(stop_.get(), &one, sizeof one);
  std::unique_lock lock(mutex_);
  stopped_ = true;
  ended_.notify_all();
  lock.unlock();
  if (acceptor_.joinable()) acceptor_.join();
  lock.lock();
  for (const auto& [number, connection] : connections_)
    static_cast<void>(::shutdown(connection.socket, SHUT_RDWR));
  ended_.wait(lock, [this] { return connections_.empty(); });
}

void HttpServer::accept_all() {
  for (;;) {
    std::array<pollfd, 2> fds{{{listener_.get(), POLLIN, 0}, {stop_.get(), POLLIN, 0}}};
    static_cast<void>(::poll(fds.data(), fds.size(), -1));
    if (fds[1].revents != 0) return;
    Fd socket(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (socket) {
      take(std::move(socket));
    } else if (errno != EAGAIN && errno != EINTR && errno != ECONNABORTED) {
      static_cast<void>(::poll(&fds[1], 1, exhausted_pause.count()));  // no descriptors now
    }
  }
}

/// @param lock  of mutex_. Waits only when threads_max are there, most of which are about to end.
bool HttpServer::make_place(std::unique_lock<std::mutex>& lock) {
  const auto leaving =
      std::count_if(connections_.begin(), connections_.end(), [](const auto& c) { return c.second.leaves; });
  if (connections_.size() - static_cast<std::size_t>(leaving) >= connections_max) {
    const auto stranger = std::find_if(connections_.begin(), connections_.end(),
                                       [](const auto& c) { return !c.second.known && !c.second.leaves; });
    if (stranger == connections_.end()) return false;
    stranger->second.leaves = true;
    static_cast<void>(::shutdown(stranger->second.socket, SHUT_RDWR));
  }
  return ended_.wait_for(lock, place_patience,
                         [this] { return stopped_ || connections_.size() < threads_max; });
}

void HttpServer::take(Fd socket) {
  const int on = 1;
  static_cast<void>(::setsockopt(socket.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on));
  static_cast<void>(
      ::setsockopt(socket.get(), SOL_SOCKET, SO_SNDBUF, &send_buffer_octets, sizeof send_buffer_octets));
  std::unique_lock lock(mutex_);
  if (!make_place(lock) || stopped_) return;  // closed
  const std::uint64_t number = next_number_++;
  connections_[number] = {socket.get(), false};
  try {
    std::thread([this, number, own = std::make_shared<Fd>(std::move(socket))] {
      serve(number, *own);
    }).detach();
  } catch (const std::exception&) {
    connections_.erase(number);  // no threads now
  }
}

void HttpServer::serve(std::uint64_t number, const Fd& socket) {
  try {
    const auto transport = tls_ ? tls_->transport(socket.get()) : plain_transport(socket.get());
    std::string input;
    if (transport->open(monotonic_now() + head_patience)) {
      while (serve_request(number, *transport, input)) continue;
    }
  } catch (const std::exception&) {
    // no memory: this connection ends
  }
  const std::lock_guard lock(mutex_);
  connections_.erase(number);
  ended_.notify_all();
}

bool HttpServer::serve_request(std::uint64_t number, Transport& transport, std::string& input) {
  RequestReader reader;
  const auto respond = [&transport](const HttpResponse& response, bool keep_alive) {
    const std::string head = head_of(response, response.body.size(), keep_alive);
    const MonotonicTime deadline = deadline_for(head.size() + response.body.size());
    return transport.write(head, deadline) && transport.write(response.body, deadline) && keep_alive;
  };
  const auto refuse = [&](const HttpResponse& response) {
    static_cast<void>(respond(response, false));
    drain(transport);
    return false;
  };
  MonotonicTime deadline = monotonic_now() + head_patience;
  for (;;) {
    const auto state = reader.take(input);
    if (!state) return refuse(error_response(state.error().status, state.error().why));
    if (*state == RequestReader::State::complete) break;
    if (*state == RequestReader::State::admitted) {
      const auto admission = application_->admit(reader.request());
      const std::uint64_t octets = reader.request().content_octets.value_or(0);
      if (admission.refusal) return refuse(*admission.refusal);
      if (octets > admission.body_max) return refuse(error_response(413, "the body is too long"));
      if (admission.known) {
        const std::lock_guard lock(mutex_);
        connections_[number].known = true;
      }
      deadline = deadline_for(octets);
      reader.admit_body();
      continue;
    }
    if (!transport.read(input, deadline)) return false;
  }
  if (application_->stream(reader.request(), transport)) return false;
  return respond(application_->answer(reader.request()), reader.request().keep_alive);
}

}  // namespace srfs::ground::api
