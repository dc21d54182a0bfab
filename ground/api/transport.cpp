// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/transport.hpp"

#include <algorithm>
#include <array>
#include <cerrno>

#include <fmt/format.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <poll.h>
#include <sys/socket.h>

namespace srfs::ground::api {
namespace {

constexpr std::size_t chunk_octets = 16'384;

/// @return false: the deadline has passed
bool wait_for(int socket, short events, MonotonicTime deadline) {
  const auto left = std::chrono::ceil<milliseconds>(deadline - monotonic_now()).count();
  if (left <= 0) return false;
  pollfd wait{socket, events, 0};
  return ::poll(&wait, 1, static_cast<int>(std::min<std::int64_t>(left, 60'000))) > 0;
}

bool peer_has_gone(int socket) {
  char octet = 0;
  const ssize_t got = ::recv(socket, &octet, 1, MSG_PEEK | MSG_DONTWAIT);
  return got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR);
}

class PlainTransport final : public Transport {
 public:
  explicit PlainTransport(int socket) : socket_(socket) {}
  bool open(MonotonicTime) override { return true; }

  bool read(std::string& into, MonotonicTime deadline) override {
    std::array<char, chunk_octets> chunk{};
    for (;;) {
      const ssize_t got = ::recv(socket_, chunk.data(), chunk.size(), 0);
      if (got > 0) {
        into.append(chunk.data(), static_cast<std::size_t>(got));
        return true;
      }
      if (got == 0 || (errno != EAGAIN && errno != EINTR)) return false;
      if (!wait_for(socket_, POLLIN, deadline)) return false;
    }
  }

  bool write(std::string_view octets, MonotonicTime deadline) override {
    while (!octets.empty()) {
      const ssize_t sent = ::send(socket_, octets.data(), octets.size(), MSG_NOSIGNAL);
      if (sent > 0) {
        octets.remove_prefix(static_cast<std::size_t>(sent));
        continue;
      }
      if (errno != EAGAIN && errno != EINTR) return false;
      if (!wait_for(socket_, POLLOUT, deadline)) return false;
    }
    return true;
  }

  bool has_gone() const override { return peer_has_gone(socket_); }

 private:
  int socket_;
};

template <auto release>
struct Release {
  template <class T>
  void operator()(T* object) const {
    release(object);
  }
};
using Ssl = std::unique_ptr<SSL, Release<SSL_free>>;

std::string tls_problem() {
  std::array<char, 256> text{};
  ERR_error_string_n(ERR_get_error(), text.data(), text.size());
  return text.data();
}

}  // namespace

struct TlsSettings::Context {
  std::unique_ptr<SSL_CTX, void (*)(SSL_CTX*)> context{nullptr, SSL_CTX_free};
};

namespace {

class TlsTransport final : public Transport {
 public:
  TlsTransport(int socket, std::shared_ptr<TlsSettings::Context> context)
      : socket_(socket), context_(std::move(context)), ssl_(SSL_new(context_->context.get())) {}

  bool open(MonotonicTime deadline) override {
    if (!ssl_ || SSL_set_fd(ssl_.get(), socket_) != 1) return false;
    return go_on([this] { return SSL_accept(ssl_.get()); }, deadline) > 0;
  }

  bool read(std::string& into, MonotonicTime deadline) override {
    std::array<char, chunk_octets> chunk{};
    const int got =
        go_on([&] { return SSL_read(ssl_.get(), chunk.data(), static_cast<int>(chunk.size())); }, deadline);
    if (got <= 0) return false;
    into.append(chunk.data(), static_cast<std::size_t>(got));
    return true;
  }

  bool write(std::string_view octets, MonotonicTime deadline) override {
    while (!octets.empty()) {
      const int part = static_cast<int>(std::min(octets.size(), chunk_octets));
      const int sent = go_on([&] { return SSL_write(ssl_.get(), octets.data(), part); }, deadline);
      if (sent <= 0) return false;
      octets.remove_prefix(static_cast<std::size_t>(sent));
    }
    return true;
  }

  bool has_gone() const override { return peer_has_gone(socket_); }

 private:
  template <class Step>
  int go_on(const Step& step, MonotonicTime deadline) {
    for (;;) {
      ERR_clear_error();
      const int result = step();
      if (result > 0) return result;
      const int why = SSL_get_error(ssl_.get(), result);
      if (why != SSL_ERROR_WANT_READ && why != SSL_ERROR_WANT_WRITE) return -1;
      if (!wait_for(socket_, static_cast<short>(why == SSL_ERROR_WANT_READ ? POLLIN : POLLOUT), deadline))
        return -1;
    }
  }

  int socket_;
  std::shared_ptr<TlsSettings::Context> context_;
  Ssl ssl_;
};

}  // namespace

Result<std::shared_ptr<const TlsSettings>, std::string> TlsSettings::load(
    const std::filesystem::path& certificate, const std::filesystem::path& key) {
  auto context = std::make_shared<Context>();
  context->context.reset(SSL_CTX_new(TLS_server_method()));
  SSL_CTX* const tls = context->context.get();
  if (tls == nullptr) return Err("no TLS: " + tls_problem());
  SSL_CTX_set_min_proto_version(tls, TLS1_2_VERSION);
  SSL_CTX_set_options(tls, SSL_OP_NO_RENEGOTIATION | SSL_OP_CIPHER_SERVER_PREFERENCE);
  SSL_CTX_set_mode(tls, SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER);
  if (SSL_CTX_use_certificate_chain_file(tls, certificate.c_str()) != 1)
    return Err(fmt::format("{}: not a certificate in PEM: {}", certificate.string(), tls_problem()));
  if (SSL_CTX_use_PrivateKey_file(tls, key.c_str(), SSL_FILETYPE_PEM) != 1 ||
      SSL_CTX_check_private_key(tls) != 1)
    return Err(fmt::format("{}: not the key of the certificate, in PEM: {}", key.string(), tls_problem()));
  return std::shared_ptr<const TlsSettings>(std::make_shared<TlsSettings>(std::move(context)));
}

bool TlsSettings::names(const std::string& name) const {
  X509* const certificate = SSL_CTX_get0_certificate(context_->context.get());
  return X509_check_host(certificate, name.data(), name.size(), 0, nullptr) == 1 ||
         X509_check_ip_asc(certificate, name.c_str(), 0) == 1;
}

std::unique_ptr<Transport> TlsSettings::transport(int socket) const {
  return std::make_unique<TlsTransport>(socket, context_);
}

std::unique_ptr<Transport> plain_transport(int socket) {
  return std::make_unique<PlainTransport>(socket);
}

}  // namespace srfs::ground::api
