#pragma once

#include <sensor_msgs/msg/image.hpp>

#include "ros/topics.hpp"

/// Topics of the image lane, apart from the others for their large types.
namespace srfs::ros::topics {

/// Frames of megabytes: two wait, the others are on the disk.
inline const Topic<sensor_msgs::msg::Image> image_raw{"/image/raw", {.depth = 2}, Priority::bulk};

}  // namespace srfs::ros::topics
