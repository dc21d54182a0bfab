#include "nodes/image_acquisition/image_acquisition_node.hpp"

namespace srfs {

ImageAcquisitionNode::ImageAcquisitionNode(ros::NodeContext& context) : LifecycleNode(context) {}

}  // namespace srfs
