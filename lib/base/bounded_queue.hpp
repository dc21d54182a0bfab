// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <utility>

namespace srfs {

/// What a full queue does with the next item. Either way the loss is counted.
enum class Overflow : std::uint8_t {
  drop_newest,  ///< the pushed item is refused
  drop_oldest,  ///< the item at the front makes room
};

/// FIFO with a capacity and a stated overflow rule. Not thread-safe.
template <class T>
class BoundedQueue {
 public:
  BoundedQueue(std::size_t capacity, Overflow rule) : capacity_(capacity), rule_(rule) {
    assert(capacity > 0);
  }

  /// @return false if the pushed item itself was refused
  bool push(T item) {
    if (items_.size() == capacity_) {
      ++dropped_;
      if (rule_ == Overflow::drop_newest) return false;
      items_.pop_front();
    }
    items_.push_back(std::move(item));
    return true;
  }

  [[nodiscard]] std::optional<T> pop() {
    if (items_.empty()) return std::nullopt;
    std::optional<T> item(std::move(items_.front()));
    items_.pop_front();
    return item;
  }

  [[nodiscard]] bool empty() const { return items_.empty(); }
  [[nodiscard]] std::size_t size() const { return items_.size(); }
  [[nodiscard]] std::size_t capacity() const { return capacity_; }
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }
  [[nodiscard]] const T& front() const { return items_.front(); }
  void clear() { items_.clear(); }
  [[nodiscard]] auto begin() { return items_.begin(); }
  [[nodiscard]] auto end() { return items_.end(); }

 private:
  std::deque<T> items_;
  std::size_t capacity_;
  Overflow rule_;
  std::uint64_t dropped_ = 0;
};

}  // namespace srfs
