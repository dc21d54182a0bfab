#include "nodes/image_acquisition/image_acquisition_node.hpp"

int main(int argc, char** argv) {
  return srfs::ros::run_node<srfs::ImageAcquisitionNode>(argc, argv);
}
