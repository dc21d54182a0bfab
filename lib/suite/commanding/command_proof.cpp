// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/commanding/command_proof.hpp"

#include <algorithm>
#include <cassert>

#include "base/octets.hpp"
#include "base/sha256.hpp"
#include "base/text.hpp"

namespace srfs {
namespace {

/// Every field has a length of its own or is preceded by it: no two messages have the same octets.
void add(OctetWriter& out, std::string_view text) {
  out.u32(static_cast<std::uint32_t>(text.size()));
  out.bytes(as_octets(text));
}

void add(OctetWriter& out, OctetView octets) {
  out.u32(static_cast<std::uint32_t>(octets.size()));
  out.bytes(octets);
}

CommandProof proof_of(const suite::CommandKey& key, const OctetWriter& message) {
  assert(message.ok());
  const Sha256::Digest digest = hmac_sha256(key, message.view());
  CommandProof proof{};
  std::copy_n(digest.begin(), proof.size(), proof.begin());
  return proof;
}

}  // namespace

CommandProof prove(const suite::CommandKey& key, const srfs_msgs::msg::Telecommand& m) {
  OctetWriter out;
  add(out, "telecommand");
  out.u64(m.id);
  add(out, m.target);
  out.u16(m.apid);
  out.u16(m.function_id);
  out.u8(m.repeat_class);
  out.u64(m.expiry_ns);
  add(out, OctetView(m.arguments));
  return proof_of(key, out);
}

CommandProof prove(const suite::CommandKey& key, const srfs_msgs::msg::TelecommandReport& m) {
  OctetWriter out;
  add(out, "telecommand report");
  out.u64(m.id);
  add(out, m.node);
  out.u32(m.node_incarnation);
  out.u8(m.stage);
  out.u8(m.success ? 1 : 0);
  out.u16(m.failure_code);
  out.u8(m.progress_step);
  out.u64(m.monotonic_ns);
  add(out, OctetView(m.data));
  return proof_of(key, out);
}

const char* to_text(Rejection rejection) {
  switch (rejection) {
    case Rejection::no_key:
      return "this node has no command key";
    case Rejection::no_proof:
      return "no proof";
    case Rejection::wrong_proof:
      return "wrong proof";
    case Rejection::no_expiry:
      return "no expiry";
  }
  return "?";
}

std::optional<Rejection> rejection_of(const suite::CommandKey* key, const srfs_msgs::msg::Telecommand& m) {
  if (m.proof == CommandProof{}) return Rejection::no_proof;
  if (key == nullptr) return Rejection::no_key;
  if (!equal_secrets(m.proof, prove(*key, m))) return Rejection::wrong_proof;
  if (m.expiry_ns == 0) return Rejection::no_expiry;
  return std::nullopt;
}

bool is_proven(const suite::CommandKey& key, const srfs_msgs::msg::TelecommandReport& report) {
  return equal_secrets(report.proof, prove(key, report));
}

}  // namespace srfs
