// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "cfdp/transfer_folders.hpp"
#include "ground/ad_service.hpp"
#include "ground/downlink.hpp"
#include "ground/uplink.hpp"
#include "msgs/mission/dictionary.hpp"
#include "suite/deployment.hpp"
#include "wire/pus.hpp"

namespace srfs::ground {

/// What became of a telecommand in the hands of the AD service.
enum class AdProgress : std::uint8_t {
  transmitted,  ///< for the first time, or again
  delivered,    ///< FARM-1 accepted it
  undelivered,  ///< transmitted; whether it arrived is unknown
  not_sent,     ///< never transmitted
  unknown,      ///< the server ended; whether it was transmitted is unknown, unless it was reported
};

/// A telecommand that another user of the same server sends.
struct SeenTelecommand {
  wire::RequestId request;
  std::string name;
  std::string who;
  bool scheduled = false;  ///< a packet for the schedule on board
};

/// Why an order has no result.
struct OrderError {
  enum class Kind : std::uint8_t {
    refused,     ///< nothing was done
    unknown,     ///< the server ended before it answered: whether it was done is not known
    unrecorded,  ///< nothing was done: it was to be recorded before, and could not be
  };
  Kind kind = Kind::refused;
  std::string text = {};  ///< ready to print
  [[nodiscard]] bool is_unknown() const { return kind == Kind::unknown; }
};
[[nodiscard]] inline auto refused(std::string why) {
  return Err(OrderError{OrderError::Kind::refused, std::move(why)});
}
[[nodiscard]] inline auto not_known(std::string why) {
  return Err(OrderError{OrderError::Kind::unknown, std::move(why)});
}

/// What a link reports. Functions that are not set are not called.
struct LinkOutput {
  std::function<void(const ReceivedPacket&)> packet;
  std::function<void(std::uint64_t number, AdProgress)> ad;
  std::function<void(const CopReport&)> cop;  ///< when something of it changed
  std::function<void(const cfdp::News&)> file;
  std::function<void(suite::AssociationSet, const std::string& why)> keys;  ///< other keys are used now
  std::function<void(const std::string&)> problem;                          ///< ready to print
  std::function<void(const std::string&)> note;                             ///< no failure; ready to print
  std::function<void(const SeenTelecommand&)> telecommand = {};             ///< if they were asked for
  std::function<void()> line_opened = {};                                   ///< after it was closed
};

struct TelecommandOrder {
  const mission::EncodedCommand& command;
  std::vector<std::string> arguments = {};         ///< as written, for the archive
  std::uint64_t number = 0;                        ///< the caller's own, for LinkOutput::ad; not 0
  bool ad = false;                                 ///< by the AD service
  std::optional<suite::AssociationSet> keys = {};  ///< of this BD frame; nullopt: those in use
  std::string who = {};                            ///< for the archive
  std::string token = {};       ///< likewise: unique; an order with a known one is not carried out again
  bool recorded_alone = false;  ///< not sent when the archive cannot record it
  /// An earlier process may have given this order, with this token: it is carried out only when it is certain
  /// that it was not, else the error is Kind::unknown.
  bool again = false;
};

/// The way to the spacecraft below telecommands and their stages: counters, keys, frames, COP-1, CFDP.
/// DirectLink owns the line; ServedLink is a client of `srfs-ground serve`. One thread.
class StationLink {
 public:
  StationLink() = default;
  virtual ~StationLink() = default;
  StationLink(const StationLink&) = delete;
  StationLink& operator=(const StationLink&) = delete;

  void set_output(LinkOutput output) { output_ = std::move(output); }

  /// Secures a telecommand and writes it, or hands it to the AD service. What the AD service does with it is
  /// reported from the next settle() on.
  [[nodiscard]] virtual Result<wire::RequestId, OrderError> send(const TelecommandOrder& order) = 0;
  /// A packet with a sequence count of its own, for the schedule on board. Without it nothing goes up: no
  /// error is Kind::unknown.
  [[nodiscard]] virtual Result<TelecommandPacket, OrderError> make_packet(const TelecommandOrder& order) = 0;
  /// Reports what is waiting to be reported. After each order.
  virtual void settle() = 0;

  // The AD service (see AdService). The error: it cannot be ordered now.
  [[nodiscard]] virtual Result<void, OrderError> start_ad() = 0;
  [[nodiscard]] virtual Result<void, OrderError> stop_ad() = 0;
  [[nodiscard]] virtual Result<void, OrderError> unlock() = 0;
  [[nodiscard]] virtual Result<void, OrderError> set_vr(std::uint8_t vr) = 0;
  /// Phase off: telecommands of this user go as BD frames.
  [[nodiscard]] virtual CopReport cop() const = 0;

  /// ttc.select_keys was completed, or the operator orders it.
  [[nodiscard]] virtual Result<void, OrderError> select_keys(suite::AssociationSet set,
                                                             const std::string& why) = 0;
  /// The telecommand channel.
  [[nodiscard]] virtual std::uint8_t vc() const = 0;

  [[nodiscard]] virtual bool carries_files() const = 0;
  /// @param resume the same octets under way by this name go on
  [[nodiscard]] virtual Result<cfdp::TransactionId, OrderError> put(const std::filesystem::path& file,
                                                                    const std::string& name, bool resume) = 0;
  [[nodiscard]] virtual std::vector<cfdp::Report> transfers() const = 0;
  enum class TransferOrder : std::uint8_t { suspend, resume, cancel };
  /// @return whether there is such a transfer
  [[nodiscard]] virtual Result<bool, OrderError> order_transfer(cfdp::TransactionId id,
                                                                TransferOrder order) = 0;

  /// For poll(2); -1: nothing to wait for but on_time().
  [[nodiscard]] virtual int fd() const = 0;
  /// Reads what is there and reports it. An error, ready to print: the link is gone.
  [[nodiscard]] virtual Result<void, std::string> on_readable() = 0;
  /// Does what is due. An error: the link is gone.
  [[nodiscard]] virtual Result<void, std::string> on_time() = 0;
  [[nodiscard]] virtual std::optional<MonotonicTime> next_deadline() const = 0;

  /// An archive behind the link knows telecommands by their tokens.
  [[nodiscard]] virtual bool remembers() const { return false; }
  /// From now on gaps of that archive are filled.
  [[nodiscard]] virtual Result<void, OrderError> fill_gaps() { return refused("there is no archive"); }

  [[nodiscard]] virtual DownlinkCounters counters() const = 0;
  [[nodiscard]] virtual bool locked() const = 0;
  [[nodiscard]] virtual std::optional<std::uint32_t> clcw() const = 0;
  [[nodiscard]] virtual std::uint64_t telecommands_sent() const = 0;

 protected:
  void report_problem(const std::string& problem) const {
    if (output_.problem) output_.problem(problem);
  }
  LinkOutput output_;
};

}  // namespace srfs::ground
