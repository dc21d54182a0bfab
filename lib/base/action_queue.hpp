// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cassert>
#include <cstddef>
#include <initializer_list>
#include <utility>
#include <vector>

namespace srfs {

/// The actions of one decision, @p most of them, without memory from the heap: for what runs with every tick.
/// As a std::vector otherwise.
template <class Action, std::size_t most>
class ActionList {
 public:
  ActionList() = default;
  ActionList(std::initializer_list<Action> actions) {
    for (const Action& action : actions) emplace_back(action);
  }
  template <class A>
  void emplace_back(A&& action) {
    assert(size_ < most);
    actions_[size_++] = std::forward<A>(action);
  }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] const Action& front() const { return actions_[0]; }
  [[nodiscard]] auto begin() { return actions_.begin(); }
  [[nodiscard]] auto end() { return actions_.begin() + static_cast<std::ptrdiff_t>(size_); }
  [[nodiscard]] auto begin() const { return actions_.begin(); }
  [[nodiscard]] auto end() const { return actions_.begin() + static_cast<std::ptrdiff_t>(size_); }

 private:
  std::array<Action, most> actions_{};
  std::size_t size_ = 0;
};

/// From logic to adapter: carries out decided actions in their order. What is decided while one is carried
/// out, by its own consequence, comes behind those that wait. Bounded by what the logic decides. One thread.
template <class Action>
class ActionQueue {
 public:
  /// @param carry_out  takes one Action
  /// @return false: an outer call carries them out
  template <class CarryOut>
  bool run(std::vector<Action> actions, CarryOut carry_out) {
    return run_all(actions, carry_out);
  }
  template <std::size_t most, class CarryOut>
  bool run(ActionList<Action, most> actions, CarryOut carry_out) {
    return run_all(actions, carry_out);
  }
  /// Forgets what waits.
  void clear() {
    waiting_.clear();
    next_ = 0;
  }

 private:
  template <class Actions, class CarryOut>
  bool run_all(Actions& actions, CarryOut& carry_out) {
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
