#pragma once

#include <string>

#include "base/octets.hpp"

namespace srfs::update {

/// SHA-256 taken piece by piece.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;

  void update(OctetView data);
  /// 64 lower-case digits. Nothing may follow.
  [[nodiscard]] std::string finish();

 private:
  void* context_;
};

[[nodiscard]] std::string sha256_of(OctetView data);

}  // namespace srfs::update
