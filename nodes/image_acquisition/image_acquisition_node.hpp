#pragma once

#include "ros/node.hpp"

namespace srfs {

/// Takes frames at the commanded time: not yet. A lifecycle node of the ring without work (README.md).
class ImageAcquisitionNode : public ros::LifecycleNode {
 public:
  explicit ImageAcquisitionNode(ros::NodeContext& context);
};

}  // namespace srfs
