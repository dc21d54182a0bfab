// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include <netinet/in.h>
#include <nlohmann/json.hpp>

#include "base/fd.hpp"
#include "base/octets.hpp"
#include "base/result.hpp"
#include "ground/internet_address.hpp"
#include "ground/link.hpp"
#include "suite/deployment.hpp"
#include "wire/cadu.hpp"
#include "wire/tm_frame.hpp"

namespace srfs::ground {

enum class DatagramError : std::uint8_t {
  too_short,
  too_long,
  not_a_frame,  ///< neither a CLTU nor a TC transfer frame: start sequence, version, length
  bad_fecf,
};
[[nodiscard]] std::string_view to_text(DatagramError error);

/// The octets for the line of one uplink datagram: a CLTU (it begins with EB90, which no version 1 frame
/// does) goes as it is, a TC transfer frame is coded.
[[nodiscard]] Result<Octets, DatagramError> uplink_octets(OctetView datagram, bool randomize);

struct BridgeCounters {
  std::uint64_t tm_frames = 0;     ///< sent as datagrams
  std::uint64_t tm_unsent = 0;     ///< the socket refused them
  std::uint64_t tm_bad = 0;        ///< not of this spacecraft, or could not be corrected
  std::uint64_t tc_datagrams = 0;  ///< written to the line
  std::uint64_t tc_refused = 0;    ///< neither CLTU nor frame
  std::uint64_t tc_unsent = 0;     ///< the line took no octets
};
[[nodiscard]] nlohmann::json to_json(const BridgeCounters& counters);

/// The serial line on one side, UDP on the other: TM transfer frames after Reed-Solomon and derandomizer, one
/// a datagram, to @p tm; CLTUs or TC transfer frames, one a datagram, taken at @p tc. Both directions are as
/// open as their addresses: any host that reaches @p tc can transmit. One thread.
class Bridge {
 public:
  static constexpr milliseconds write_patience{5000};
  static constexpr std::size_t datagrams_a_turn = 64;

  /// @return the error is ready to print
  static Result<Bridge, std::string> open(const suite::LinkSettings& link, std::unique_ptr<OctetLine> line,
                                          const sockaddr_in& tm, const sockaddr_in& tc);

  /// For poll(2): the line and the uplink's socket.
  [[nodiscard]] int line_fd() const { return line_->fd(); }
  [[nodiscard]] int socket_fd() const { return socket_.get(); }
  /// Frames that are there, to UDP. An error: the link is gone.
  [[nodiscard]] Result<void, std::string> on_line();
  /// Datagrams that are there, to the line. Blocks while the line takes no octets, at most write_patience.
  void on_socket();
  [[nodiscard]] const BridgeCounters& counters() const { return counters_; }
  /// Where the uplink's socket is bound: the port when 0 was asked for.
  [[nodiscard]] sockaddr_in uplink_address() const;

 private:
  Bridge(const suite::LinkSettings& link, std::unique_ptr<OctetLine> line, Fd socket, const sockaddr_in& tm);
  std::unique_ptr<OctetLine> line_;
  Fd socket_;
  sockaddr_in tm_;
  bool randomize_uplink_;
  wire::CaduSynchroniser synchroniser_;
  wire::TmFrameDecoder decoder_;
  BridgeCounters counters_;
};

}  // namespace srfs::ground
