#include "nodes/maintenance/maintenance_node.hpp"

namespace srfs {

MaintenanceNode::MaintenanceNode(ros::NodeContext& context) : LifecycleNode(context) {}

}  // namespace srfs
