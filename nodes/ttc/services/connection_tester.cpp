// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/connection_tester.hpp"

#include <cassert>

#include <mission/structures.hpp>

namespace srfs {

void ConnectionTester::execute(const Telecommand& telecommand, MonotonicTime /*now*/) {
  const TelecommandOrigin& origin = telecommand.origin;
  const std::uint8_t subtype = telecommand.command->subtype;
  const std::uint16_t apid =
      subtype == test_connection ? OctetReader(telecommand.arguments).u16() : origin.apid;
  const mission::ApplicationProcess* process = dictionary_.apid(apid);
  if (process == nullptr) {
    report_queue_.failure(origin, Stage::start, mission::failure::unknown_identifier, octets_of_u16(apid));
    return;
  }
  if (waiting_.size() == capacity) {
    report_queue_.failure(origin, Stage::start, mission::failure::busy);
    return;
  }
  report_queue_.success(origin, Stage::start);
  Test test{.origin = origin, .subtype = subtype, .apid = apid, .node = process->node};
  if (process->node == own_node_) return end(test, true);
  waiting_.push_back(std::move(test));
}

std::optional<std::string> ConnectionTester::take_question() {
  if (asking_ || waiting_.empty()) return std::nullopt;
  asking_ = true;
  return waiting_.front().node;
}

void ConnectionTester::on_answer(bool answered) {
  assert(asking_ && !waiting_.empty());
  asking_ = false;
  const Test test = std::move(waiting_.front());
  waiting_.pop_front();
  end(test, answered);
}

void ConnectionTester::end(const Test& test, bool answered) {
  if (!answered) {
    report_queue_.failure(test.origin, Stage::completion, mission::failure::node_unavailable);
    return;
  }
  Report report{.apid = test.origin.apid,
                .service = service_type,
                .subtype = test.subtype == are_you_alive ? are_you_alive_report : connection_report,
                .destination_id = test.origin.source_id,
                .data = {}};
  if (test.subtype == test_connection) report.data = octets_of_u16(test.apid);
  report_queue_.put(std::move(report));
  report_queue_.success(test.origin, Stage::completion);
}

}  // namespace srfs
