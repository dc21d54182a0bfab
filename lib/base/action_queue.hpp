// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace srfs {

/// From logic to adapter: carries out decided actions in their order. What is decided while one is carried
/// out, by its own consequence, comes behind those that wait. Bounded by what the logic decides. One thread.
template <class Action>
class ActionQueue {
 public:
  /// @param carry_out  takes one Action
  /// @return false: an outer call carries them out
  template <class CarryOut>
  bool run(std::vector<Action> actions, CarryOut carry_out) {
    for (Action& action : actions) waiting_.push_back(std::move(action));
    if (runs_) return false;
    const Running running(*this);
    while (!waiting_.empty()) {
      const Action action = std::move(waiting_[next_++]);
      if (next_ == waiting_.size()) clear();
      carry_out(action);
    }
    return true;
  }
  /// Forgets what waits.
  void clear() {
    waiting_.clear();
    next_ = 0;
  }

 private:
  /// Until the outer call ends. An exception leaves actions behind: without the one that failed they have no
  /// sense.
  struct Running {
    explicit Running(ActionQueue& its_queue) : queue(its_queue) { queue.runs_ = true; }
    ~Running() {
      queue.clear();
      queue.runs_ = false;
    }
    Running(const Running&) = delete;
    Running& operator=(const Running&) = delete;
    ActionQueue& queue;
  };

  std::vector<Action> waiting_;  ///< keeps its memory: a queue that was this long before takes none
  std::size_t next_ = 0;         ///< of waiting_
  bool runs_ = false;
};

}  // namespace srfs
