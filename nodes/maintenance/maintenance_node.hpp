#pragma once

#include "ros/node.hpp"

namespace srfs {

/// Changes parameters, replaces nodes from uplinked source: not yet. A lifecycle node of the ring without
/// work (README.md).
class MaintenanceNode : public ros::LifecycleNode {
 public:
  explicit MaintenanceNode(ros::NodeContext& context);
};

}  // namespace srfs
