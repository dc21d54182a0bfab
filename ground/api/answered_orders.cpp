// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/answered_orders.hpp"

#include <algorithm>

namespace srfs::ground::api {

bool AnsweredOrders::is_key(const std::string& key) {
  constexpr std::string_view letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
  return key.size() >= key_octets_min && key.size() <= key_octets_max &&
         key.find_first_not_of(letters) == std::string::npos;
}

std::optional<HttpResponse> AnsweredOrders::begin(const std::string& key, const std::string& digest,
                                                  milliseconds patience) {
  std::unique_lock lock(mutex_);
  const auto decided = [&] {
    const auto found = orders_.find(key);
    return found == orders_.end() || found->second.digest != digest || found->second.answer;
  };
  if (!ended_.wait_for(lock, patience, decided))
    return error_response(409, "the first request with this Idempotency-Key is still being carried out");
  const auto [found, is_new] = orders_.try_emplace(key, Order{digest, std::nullopt});
  if (is_new) return std::nullopt;
  if (found->second.digest != digest)
    return error_response(422, "this Idempotency-Key was used for another request");
  HttpResponse again = *found->second.answer;
  again.headers["Idempotency-Replayed"] = "true";
  return again;
}

void AnsweredOrders::end(const std::string& key, const HttpResponse& answer) {
  const std::lock_guard lock(mutex_);
  const auto found = orders_.find(key);
  if (found == orders_.end()) return;
  const bool carried_out = answer.status >= 200 && answer.status < 300;
  if (carried_out || answer.status == unknown_outcome) {
    found->second.answer = answer;
    kept_.push_back(key);
  } else {
    orders_.erase(found);
  }
  if (kept_.size() > kept_max) {
    orders_.erase(kept_.front());
    kept_.pop_front();
  }
  ended_.notify_all();
}

}  // namespace srfs::ground::api
