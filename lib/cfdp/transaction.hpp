// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "cfdp/file_digest.hpp"
#include "cfdp/file_store.hpp"
#include "cfdp/frame_fit.hpp"
#include "cfdp/settings.hpp"
#include "wire/cfdp_pdu.hpp"

namespace srfs::cfdp {

using wire::CfdpBody;
using wire::CfdpCondition;
using wire::CfdpHeader;

enum class Role : std::uint8_t { sending, receiving };

/// Why a transaction neither sends nor runs timers.
enum class Rest : std::uint8_t {
  none,
  by_request,  ///< until resume()
  by_fault,    ///< until resume(), or until the peer is heard
};

[[nodiscard]] std::string_view to_string(FaultHandler handler);

/// How a transaction ended.
struct Outcome {
  CfdpCondition condition = CfdpCondition::no_error;
  bool incomplete = false;
  wire::CfdpFileStatus file_status = wire::CfdpFileStatus::retained;
  friend bool operator==(const Outcome&, const Outcome&) = default;
};

enum class EventKind : std::uint8_t {
  started,            ///< put() was accepted, or the first PDU came
  metadata_received,  ///< names and size are known
  fault,              ///< condition, handler; file_fault details a filestore rejection
  suspended,
  resumed,
  finished,           ///< outcome: success has no_error
  checkpoint_failed,  ///< the disk did not take it: a crash from here on costs more
};
[[nodiscard]] std::string_view to_string(EventKind kind);

struct Event {
  EventKind kind = EventKind::started;
  TransactionId id = {};
  Role role = Role::sending;
  Outcome outcome = {};
  FaultHandler handler = FaultHandler::cancel;
  std::optional<FileFault> file_fault = {};
};

/// What a display shows of a transaction.
struct Report {
  TransactionId id;
  Role role = Role::sending;
  std::string source_file;
  std::string destination_file;
  std::optional<std::uint64_t> file_octets;  ///< nullopt: not known yet
  std::uint64_t progress_octets = 0;         ///< handed to the link once, or received
  std::uint64_t missing_octets = 0;          ///< asked for by the receiver, or lacking in front of what came
  bool waits_for_peer = false;               ///< all sent; or all received, and the end not acknowledged
  Rest rest = Rest::none;
  std::uint64_t operation = 0;  ///< of put(); 0: none
  bool cancelled = false;       ///< and the peer does not know yet
};

/// What a transaction needs of its entity.
class Context {
 public:
  Context(const Settings& settings_, FileStore& files_) : settings(settings_), files(files_) {}
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  virtual void report(const Event& event) = 0;
  /// Everything that must survive a crash is on disk when this returns, or checkpoint_failures counts it.
  virtual void save_checkpoint() = 0;
  /// Of all files that are being received.
  [[nodiscard]] virtual std::uint64_t receiving_octets() const = 0;

  const Settings settings;
  FileStore& files;
  Counters counters;
  FrameFit frame_fit;  ///< of what is sent

 protected:
  ~Context() = default;
};

/// A PDU for the link.
struct Outgoing {
  CfdpHeader header;
  CfdpBody body;
};

}  // namespace srfs::cfdp
