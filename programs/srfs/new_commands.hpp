// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "programs/srfs/suite.hpp"

namespace srfs::tool {

/// `srfs new KIND NAME --in FOLDER`. The numbers are free in the dictionary of the mission whose folder is
/// IN, else of the deployment, with the nodes that were added to the suite and those in the folder. Either
/// all is written, or nothing is changed and the answer says why.
struct NewOrder {
  std::string name;
  std::filesystem::path in;
  bool json = false;
};

/// A node with telemetry, a telecommand, an event and a parameter: the folder IN/NAME.
int new_node(const Target& target, const NewOrder& order);
/// A method of image processing as a node of its own: the folder IN/image_NAME.
int new_method(const Target& target, const NewOrder& order);
/// A payload with its simulator model: the folder IN/payload_NAME, and its place in the mission whose folder
/// is IN, which is made if it is not there.
int new_payload(const Target& target, const NewOrder& order);
/// A package of ROS 2 interfaces: the folder IN/NAME, which a ROS 2 workspace builds, too.
int new_interfaces(const Target& target, const NewOrder& order);
/// A telecommand of the node whose folder is IN, with its handler and its test.
int new_telecommand(const Target& target, const NewOrder& order);

}  // namespace srfs::tool
