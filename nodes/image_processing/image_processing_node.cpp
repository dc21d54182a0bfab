#include "nodes/image_processing/image_processing_node.hpp"

namespace srfs {

ImageProcessingNode::ImageProcessingNode(ros::NodeContext& context) : LifecycleNode(context) {}

}  // namespace srfs
