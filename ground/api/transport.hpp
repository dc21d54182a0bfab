// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "base/fd.hpp"
#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs::ground::api {

/// Octets of one connection, with deadlines. Its socket does not block.
class Transport {
 public:
  Transport() = default;
  virtual ~Transport() = default;
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;

  /// Before anything else. @return false: it failed, or not in time
  [[nodiscard]] virtual bool open(MonotonicTime deadline) = 0;
  /// Appends what is there, waiting for something. @return false: closed, or nothing came in time
  [[nodiscard]] virtual bool read(std::string& into, MonotonicTime deadline) = 0;
  /// All of it. @return false: closed, or not in time
  [[nodiscard]] virtual bool write(std::string_view octets, MonotonicTime deadline) = 0;
  /// The other end has closed, or the connection broke.
  [[nodiscard]] virtual bool has_gone() const = 0;
};

/// A certificate with its key, for TLS 1.2 and above.
class TlsSettings {
 public:
  /// Reads PEM files. The error is ready to print. Blocks on the disk.
  [[nodiscard]] static Result<std::shared_ptr<const TlsSettings>, std::string> load(
      const std::filesystem::path& certificate, const std::filesystem::path& key);
  /// Whether the certificate is for this host name or address.
  [[nodiscard]] bool names(const std::string& name) const;
  [[nodiscard]] std::unique_ptr<Transport> transport(int socket) const;

  struct Context;
  explicit TlsSettings(std::shared_ptr<Context> context) : context_(std::move(context)) {}

 private:
  std::shared_ptr<Context> context_;
};

[[nodiscard]] std::unique_ptr<Transport> plain_transport(int socket);

}  // namespace srfs::ground::api
