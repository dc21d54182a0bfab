#pragma once

#include <functional>
#include <memory>
#include <vector>

#include <srfs_msgs/srv/check_alive.hpp>

#include "nodes/timing/critical_answers.hpp"
#include "nodes/timing/watchdog_feeding.hpp"
#include "ros/client.hpp"
#include "ros/instance.hpp"
#include "ros/worker.hpp"

namespace srfs {

/// Asks every critical node of the ring other than timing itself whether it is alive, each second, and turns
/// the answers into evidence for the watchdog. Adapter of CriticalAnswers.
class CriticalWatch {
 public:
  using Client = ros::Client<srfs_msgs::srv::CheckAlive>;

  /// @param observer  timing's own name
  CriticalWatch(CriticalAnswers answers, std::string observer, ros::VarPaths var);

  /// @param make  a client of the service of this name
  void open(const std::function<std::shared_ptr<Client>(const std::string& service)>& make);
  void close();
  /// Sends the questions; reads the desired states on @p worker.
  void ask(MonotonicTime now, const std::shared_ptr<ros::Worker>& worker);
  /// One per node. They refer to this object.
  [[nodiscard]] std::vector<WatchdogEvidence> evidence() const;
  [[nodiscard]] const CriticalAnswers& answers() const { return answers_; }

 private:
  void read_desired_states(const std::shared_ptr<ros::Worker>& worker);

  CriticalAnswers answers_;
  std::string observer_;
  ros::VarPaths var_;
  std::vector<std::shared_ptr<Client>> clients_;
  bool reading_ = false;
};

}  // namespace srfs
