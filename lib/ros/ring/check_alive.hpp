#pragma once

#include <string>

#include <srfs_msgs/srv/check_alive.hpp>

#include "base/time.hpp"
#include "ros/service.hpp"

namespace srfs::ros {

class LifecycleNode;

/// A node's answers to the liveness checks, given on its work thread with or without a ring. A part of
/// LifecycleNode.
class CheckAliveService {
 public:
  /// What the node's own half of the ring adds.
  class RingMember {
   public:
    virtual ~RingMember() = default;
    virtual void on_asked(const std::string& observer, std::uint32_t generation) = 0;
    [[nodiscard]] virtual std::uint32_t generation() const = 0;
    [[nodiscard]] virtual nanoseconds last_check_age() const = 0;
    /// Time this node was stopped or starved, in all so far.
    [[nodiscard]] virtual nanoseconds held_up() const = 0;
  };

  explicit CheckAliveService(LifecycleNode& node);
  /// @param member nullptr: no ring; else outlives its place here
  void set_member(RingMember* member) { member_ = member; }

 private:
  /// Something that began at a time, and how much of the time since then does not count.
  struct Span {
    MonotonicTime since;
    nanoseconds held_up_before{0};
  };
  void answer(const srfs_msgs::srv::CheckAlive_Request& request,
              srfs_msgs::srv::CheckAlive_Response& response);
  void fill_work(srfs_msgs::srv::CheckAlive_Response& response);
  void fill_worker(srfs_msgs::srv::CheckAlive_Response& response);
  [[nodiscard]] std::uint32_t age_ms(Span& span, MonotonicTime since);

  LifecycleNode& node_;
  RingMember* member_ = nullptr;
  Span oldest_due_;
  Span busiest_;
  std::shared_ptr<Service<srfs_msgs::srv::CheckAlive>> service_;
};

/// "/NODE/check_alive"
[[nodiscard]] std::string check_alive_name(std::string_view node);

}  // namespace srfs::ros
