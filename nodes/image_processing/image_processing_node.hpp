#pragma once

#include "ros/node.hpp"

namespace srfs {

/// Processes frames by the named method: not yet. A lifecycle node of the ring without work (README.md).
class ImageProcessingNode : public ros::LifecycleNode {
 public:
  explicit ImageProcessingNode(ros::NodeContext& context);
};

}  // namespace srfs
