// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/time.hpp"

namespace srfs::ground::api {

/// One server-sent event, ready to be written.
struct StreamItem {
  std::int64_t id = 0;  ///< in the archive; 0: none
  std::shared_ptr<const std::string> text;
};
/// "id: 7\nevent: tm_packet\ndata: {...}\n\n"; the event is the object's type.
[[nodiscard]] StreamItem stream_item(std::int64_t id, const nlohmann::json& json);

/// Hands what happens to all readers of the stream. Publishing never waits for a reader: each has a bounded
/// queue, and loses its subscription when that is full. Any thread.
class StreamHub {
 public:
  static constexpr std::size_t readers_max = 32;
  static constexpr std::size_t queue_octets_max = 2U << 20;

  class Reader {
   public:
    /// What has come, at once or within @p patience. @return false: the subscription is over, because of a
    /// full queue or the end of the gateway
    [[nodiscard]] bool wait(milliseconds patience, std::vector<StreamItem>& items);

   private:
    friend class StreamHub;
    std::mutex mutex_;
    std::condition_variable came_;
    std::deque<StreamItem> queue_;
    std::size_t octets_ = 0;
    bool over_ = false;
  };

  /// nullptr: there are readers_max.
  [[nodiscard]] std::shared_ptr<Reader> subscribe();
  void unsubscribe(const std::shared_ptr<Reader>& reader);
  void publish(const StreamItem& item);
  /// Ends all subscriptions.
  void close();
  [[nodiscard]] std::size_t readers();
  /// Readers that were too slow.
  [[nodiscard]] std::uint64_t overflows() const { return overflows_; }

 private:
  static void end(Reader& reader);
  std::mutex mutex_;
  std::set<std::shared_ptr<Reader>> readers_;
  bool closed_ = false;
  std::atomic<std::uint64_t> overflows_{0};
};

}  // namespace srfs::ground::api
