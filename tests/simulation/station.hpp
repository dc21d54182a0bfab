// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "ground/ad_service.hpp"
#include "ground/commanding.hpp"
#include "ground/downlink.hpp"
#include "nodes/ttc/link/uplink_chain.hpp"
#include "tests/simulation/ttc.hpp"
#include "wire/tc_uplink.hpp"

namespace srfs::simulation {

/// What became of every telecommand, from all places where something of it can be seen: the operator's
/// packet, ttc's publication, the peripheral that carried it out, the reports on the line. Its functions
/// check what the classes of telecommands promise.
class CommandRecord final : public TtcWitness {
 public:
  CommandRecord(Kernel& kernel, const mission::Dictionary& dictionary, const suite::LinkSettings& link);

  void on_sent(const wire::RequestId& request, const mission::Command& command);
  /// FARM-1 acknowledged the frame with it.
  void on_delivered(const wire::RequestId& request);
  void on_published(const Telecommand& telecommand) override;
  void on_storage_lost() override;
  void on_cadu(const Octets& cadu) override;
  /// A peripheral has carried it out.
  void on_executed(std::uint32_t telecommand_id);
  /// At the end of a calm: what was acknowledged or accepted before it has its end.
  void check_ends(MonotonicTime sent_before);
  void set_listener(std::function<void(const Octets& cadu)> listener) { listener_ = std::move(listener); }

  struct Counters {
    std::uint64_t sent = 0;
    std::uint64_t accepted = 0;
    std::uint64_t refused = 0;
    std::uint64_t completed = 0;
    std::uint64_t failed = 0;
    std::uint64_t executed = 0;
    std::uint64_t delivered = 0;
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  struct Life {
    const mission::Command* command = nullptr;
    MonotonicTime sent;
    bool delivered = false;
    std::set<std::uint64_t> ids;  ///< that ttc gave it
    bool accepted = false;
    bool refused = false;
    bool completed = false;
    std::optional<std::uint16_t> failed{};  ///< code
    int executed = 0;
    std::optional<MonotonicTime> ended{};
    /// The journal did not reach the disk while it was under way. Without storage recovery commands run and
    /// frames are acknowledged all the same, so its end is not promised.
    bool unstored = false;
  };
  using Key = std::uint64_t;  ///< APID, sequence count, and how often that has wrapped
  void on_report(const wire::TmPacket& packet);
  [[nodiscard]] static Key key_of(const wire::RequestId& request);
  [[nodiscard]] static std::string describe(const Life& life);

  Kernel& kernel_;
  ground::Downlink receiver_;  ///< hears everything that leaves the spacecraft
  std::function<void(const Octets& cadu)> listener_;
  std::map<Key, Life> lives_;
  std::map<std::uint64_t, Key> by_id_;
  MonotonicTime last_lost_;
  Counters counters_;
};

/// The ground: its real AD service, decoders and verification, the line with its losses, and an operator who
/// sends telecommands by chance, repeats some, forgets some, sends some with wrong arguments.
class Station {
 public:
  Station(Kernel& kernel, const mission::Dictionary& dictionary, const suite::LinkSettings& link,
          const wire::SdlsKey& key, CommandRecord& record, std::function<void(const Octets&)> to_spacecraft);

  /// Share of CLTUs and CADUs that are lost, and of those that have a wrong octet.
  struct Line {
    std::uint64_t lost_per_1000 = 0;
    std::uint64_t spoiled_per_1000 = 0;
    bool cut = false;
  };
  void set_line(Line line) { line_ = line; }
  [[nodiscard]] const Line& line() const { return line_; }
  void set_operator(bool works) { works_ = works; }

 private:
  struct Queued {
    wire::RequestId request;
    const mission::Command* command;
    Octets packet;
  };
  void work();
  void send_something();
  void send_bd(const Queued& telecommand);
  void uplink(Octets cltu);
  void on_cadu(const Octets& cadu);
  void handle_ad();
  [[nodiscard]] std::optional<Octets> frame(wire::TcFrameType type, std::uint8_t sequence, OctetView packet);
  [[nodiscard]] std::optional<Octets> control_frame(wire::ControlCommand command);
  [[nodiscard]] bool passes_line(Octets& octets, Random& random);

  Kernel& kernel_;
  const mission::Dictionary& dictionary_;
  Random operator_;
  Random noise_;
  wire::TcUplinkChannel channel_;
  const wire::SdlsKey& key_;
  CommandRecord& record_;
  std::function<void(const Octets&)> to_spacecraft_;
  ground::Downlink downlink_;
  ground::Commanding commanding_;
  ground::AdService ad_;
  Line line_;
  bool works_ = true;
  std::uint64_t counter_ = 0;
  std::map<std::uint16_t, std::uint16_t> sequence_;
  std::uint64_t next_tag_ = 1;
  std::map<std::uint64_t, Queued> by_ad_;  ///< by tag
  std::vector<Queued> recent_;             ///< to repeat
  MonotonicTime up_free_;
  MonotonicTime down_free_;
  Deadline ad_timer_;
};

}  // namespace srfs::simulation
