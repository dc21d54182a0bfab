// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <string>

#include "base/time.hpp"
#include "ground/api/http.hpp"
#include "ground/api/order_journal.hpp"

namespace srfs::ground::api {

/// Orders with an Idempotency-Key: one whose answer was lost is repeated with its key, and is answered again
/// instead of carried out again. Bounded: the newest kept_max orders that were, or may have been, carried
/// out; the oldest is forgotten first. Refused orders are not kept: nothing was done, so they may be tried
/// again. With a journal, orders of an earlier process are known: one that had not ended is of unknown
/// outcome. Any thread.
class AnsweredOrders {
 public:
  static constexpr std::size_t kept_max = 1024;
  static constexpr std::size_t key_octets_min = 8;
  static constexpr std::size_t key_octets_max = 64;

  explicit AnsweredOrders(std::optional<OrderJournal> journal = std::nullopt);

  /// Letters, digits, '-' and '_'.
  [[nodiscard]] static bool is_key(const std::string& key);

  /// @param digest  of the request: a key belongs to one request alone
  /// @param patience  while another thread carries out the same order
  /// @param journaled  whether it goes into the journal
  /// @return nullopt: it is to be carried out, then end() is called; else its answer: that of the first
  /// time, 422 for a key of another request, 409 when the first one has not ended within @p patience
  [[nodiscard]] std::optional<HttpResponse> begin(const std::string& key, const std::string& digest,
                                                  milliseconds patience, bool journaled = true);
  void end(const std::string& key, const HttpResponse& answer);

 private:
  struct Order {
    std::string digest;
    std::optional<HttpResponse> answer;
    bool journaled = false;
  };
  void report(const Result<void, std::string>& written);

  std::mutex mutex_;
  std::condition_variable ended_;
  std::map<std::string, Order> orders_;
  std::deque<std::string> kept_;  ///< keys of answered orders, the oldest first
  std::optional<OrderJournal> journal_;
  bool reported_ = false;
};

}  // namespace srfs::ground::api
