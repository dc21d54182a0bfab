// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/answered_orders.hpp"

#include <cstdio>

namespace srfs::ground::api {

AnsweredOrders::AnsweredOrders(std::optional<OrderJournal> journal) : journal_(std::move(journal)) {
  if (!journal_) return;
  const HttpResponse not_ended =
      unknown_response("the web gateway ended before the order did: not known whether it was carried out");
  for (const OrderJournal::Order& order : journal_->orders()) {
    orders_[order.key] = {order.digest, order.answer.value_or(not_ended), true};
    kept_.push_back(order.key);
  }
}

void AnsweredOrders::report(const Result<void, std::string>& written) {
  if (written || std::exchange(reported_, true)) return;
  std::fprintf(stderr, "orders are not remembered beyond the end of this process: %s\n",
               written.error().c_str());
}

bool AnsweredOrders::is_key(const std::string& key) {
  constexpr std::string_view letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
  return key.size() >= key_octets_min && key.size() <= key_octets_max &&
         key.find_first_not_of(letters) == std::string::npos;
}

std::optional<HttpResponse> AnsweredOrders::begin(const std::string& key, const std::string& digest,
                                                  milliseconds patience, bool journaled) {
  std::unique_lock lock(mutex_);
  const auto decided = [&] {
    const auto found = orders_.find(key);
    return found == orders_.end() || found->second.digest != digest || found->second.answer;
  };
  if (!ended_.wait_for(lock, patience, decided))
    return error_response(409, "the first request with this Idempotency-Key is still being carried out");
  const auto [found, is_new] = orders_.try_emplace(key, Order{digest, std::nullopt, journaled});
  if (is_new) {
    if (journaled && journal_) report(journal_->begin(key, digest));
    return std::nullopt;
  }
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
  const bool kept = carried_out || answer.status == unknown_outcome;
  if (found->second.journaled && journal_)
    report(journal_->end(key, kept ? std::optional(answer) : std::nullopt));
  if (kept) {
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
