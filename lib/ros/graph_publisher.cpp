// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/graph_publisher.hpp"

#include "ros/type_support.hpp"

namespace srfs::ros {
namespace {

// The latest state is all that counts, also for late readers (rmw_fastrtps_cpp, init_rmw_context_impl.cpp).
constexpr Qos graph_qos{.depth = 1, .transient_local = true};

dds::TypeSupport type_of(GraphDialect dialect) {
  if (dialect == GraphDialect::iron) return dds::TypeSupport(new TypeSupport<IronGraphMessage>);
  return dds::TypeSupport(new TypeSupport<HumbleGraphMessage>);
}

}  // namespace

GraphPublisher::GraphPublisher(Executor& executor, Participant& participant, GraphDialect dialect,
                               const NodeNames& node)
    : executor_(executor), participant_(participant), dialect_(dialect) {
  if (dialect_ == GraphDialect::off) return;
  writer_ = std::make_unique<WriterEndpoint>(participant_, graph_topic, type_of(dialect_), graph_qos);
  participant_.on_graph_change([this] {
    if (due_) return;
    due_ = executor_.add_timer(monotonic_now(), nanoseconds(0), [this] { publish(); });
  });
  participant_.set_node(node.name(), node.name_space());
}

GraphPublisher::~GraphPublisher() {
  if (!writer_) return;
  participant_.on_graph_change({});  // the destruction is not worth another turn of the work thread
  participant_.set_node(std::nullopt);
  publish();
}

void GraphPublisher::publish() {
  due_.reset();
  const ParticipantGraph graph = participant_.graph();
  if (dialect_ == GraphDialect::iron) {
    const IronGraphMessage message = graph.message<16>();
    writer_->write(&message);
  } else {
    const HumbleGraphMessage message = graph.message<24>();
    writer_->write(&message);
  }
}

}  // namespace srfs::ros
