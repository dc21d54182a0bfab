// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/fd.hpp"
#include "base/result.hpp"
#include "ground/api/http.hpp"

namespace srfs::ground::api {

/// Orders with a key, in a file: the gateway after one that was killed knows which were begun, and how they
/// were answered. One process writes. Bounded: the newest orders_max of them, written anew when the file has
/// grown to octets_max. Blocks on the disk.
class OrderJournal {
 public:
  static constexpr std::size_t octets_max = 1U << 20;

  struct Order {
    std::string key;
    std::string digest;
    std::optional<HttpResponse> answer = {};  ///< nullopt: it was begun, and how it ended is not known
  };
  /// The error is ready to print.
  [[nodiscard]] static Result<OrderJournal, std::string> open(const std::filesystem::path& file,
                                                              std::size_t orders_max);
  /// The oldest first.
  [[nodiscard]] std::vector<Order> orders() const;
  /// Before it is carried out: survives the power. An error, ready to print: it is not in the file.
  [[nodiscard]] Result<void, std::string> begin(const std::string& key, const std::string& digest);
  /// @param answer  nullopt: nothing was done, and it may be tried again
  [[nodiscard]] Result<void, std::string> end(const std::string& key,
                                              const std::optional<HttpResponse>& answer);

 private:
  OrderJournal(std::filesystem::path file, std::size_t orders_max)
      : file_(std::move(file)), orders_max_(orders_max) {}
  /// The newest orders alone, in a new file.
  [[nodiscard]] Result<void, std::string> compact();
  [[nodiscard]] Result<void, std::string> append(const nlohmann::json& record);

  std::filesystem::path file_;
  std::size_t orders_max_;
  Fd appended_;
  std::size_t octets_ = 0;
};

}  // namespace srfs::ground::api
