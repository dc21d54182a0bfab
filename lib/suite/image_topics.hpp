// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sensor_msgs/msg/image.hpp>

#include "ros/cdr.hpp"
#include "suite/topics.hpp"

/// Topics of the image lane, apart from the others for their large types.
namespace srfs::suite::topics {

/// Frames of megabytes: two wait, the others are on the disk.
inline const ros::Topic<sensor_msgs::msg::Image> image_raw{
    "/image/raw", {.depth = 2, .largest_octets = ros::largest_payload}, ros::Priority::bulk, {.all = true}};

}  // namespace srfs::suite::topics
