// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The list of added nodes as read from the disk, and a package's data about a node: description, slot and
// dictionary fragment. Any input is either refused or used, and the deployment stays valid.
#include <cstdlib>

#include <fmt/format.h>

#include "base/crc32c.hpp"
#include "base/time.hpp"
#include "msgs/mission/dictionary.hpp"
#include "suite/added_nodes.hpp"

namespace {

using namespace srfs;

const suite::Deployment& deployment() {
  static const suite::Deployment made = [] {
    suite::Deployment d;
    d.devices = {{"can", "sim:can"}};
    for (const char* node : {"timing", "payload_eps"})
      d.nodes.push_back({node, "program", {}, {}, 0, 0, {}, "", "", ConfigSection::parse("", node), {}});
    d.buses.front().slots = {{"payload_eps", milliseconds(60), milliseconds(20), milliseconds(40)}};
    return d;
  }();
  return made;
}

void check(const suite::AddedNodes& added) {
  const auto d = suite::with_added(deployment(), added).deployment;
  if (d.nodes.size() != deployment().nodes.size() + d.added.size()) std::abort();
  if (d.buses.front().slots.size() > suite::slots_at_most) std::abort();
  for (std::size_t i = 0; i < deployment().buses.front().slots.size(); ++i) {
    if (d.buses.front().slots[i].payload != deployment().buses.front().slots[i].payload) std::abort();
  }
  std::size_t payloads = 0;
  for (const suite::Slot& slot : d.buses.front().slots) payloads += slot.payload.empty() ? 0 : 1;
  if (suite::turns_of(d.buses.front().slots).size() != payloads) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) return 0;
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  switch (data[0] % 4) {
    case 0: {  // with the correct checksum, which random octets never have
      std::string whole = "# Nodes that were added to the suite. Written by SRFS.\n" + text;
      whole += fmt::format("# crc32c {:08x}\n",
                           crc32c({reinterpret_cast<const std::uint8_t*>(whole.data()), whole.size()}));
      if (const auto added = suite::added_nodes_from_text(whole)) check(*added);
      break;
    }
    case 1:
      check({1, {{"extra", "", text, "", std::size_t{3}}}});
      break;
    case 2:
      check({1, {{"extra", "", "{}", "", std::size_t{3}, text}}});
      break;
    default: {
      const auto node = mission::Fragment{"fuzz", text}.node();
      if (node && text.empty()) std::abort();
      break;
    }
  }
  return 0;
}
