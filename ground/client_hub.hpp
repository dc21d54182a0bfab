// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/time.hpp"
#include "ground/serve_messages.hpp"
#include "ground/station_link.hpp"

namespace srfs::ground {

/// What `srfs-ground serve` does for its clients: one link for all of them. Telecommands are secured and
/// sent in the order in which they come; the AD service is on while a client uses it; packets go to all. Each
/// client has a bounded queue; a client whose queue is full, or that sends what is no message, is
/// disconnected, and no other notices. Pure: no socket, no clock.
class ClientHub {
 public:
  using ClientId = std::uint64_t;
  static constexpr std::size_t clients_max = 64;
  static constexpr std::size_t queue_octets_max = 8U << 20;  ///< of one client
  static constexpr milliseconds hello_patience{5000};        ///< for the first message of a client
  static constexpr milliseconds state_period{250};           ///< of counters and transfers, when they changed

  /// What the server remembers. Functions that are not set: it remembers nothing.
  struct Memory {
    /// A packet came. @return its number; 0: none
    std::function<std::int64_t(const ReceivedPacket&)> packet;
    /// The request of a telecommand that was recorded with this token. An error: it is not known.
    std::function<Result<std::optional<wire::RequestId>, std::string>(const std::string& token)> request_of;
    /// The packets that came after one, in order.
    std::function<void(std::int64_t id, const std::function<void(std::int64_t, const ReceivedPacket&)>&)>
        packets_after;
    std::function<void(const cfdp::News&)> file;
    /// Why it records nothing now; empty: it does.
    std::function<std::string()> problem = {};
    /// An operator has seen an event. The error says why that is not so.
    std::function<Result<void, std::string>(std::int64_t id, const std::string& who)> acknowledge = {};
    /// From now on, gaps are filled.
    std::function<void()> fill_gaps = {};
  };
  struct Hooks {
    /// Octets for the line as they are (clients that forward frames).
    std::function<Result<void, std::string>(OctetView)> write;
    /// For the server's log; ready to print.
    std::function<void(const std::string&)> log;
    wire::FopSettings fop = {};  ///< of the AD service, for clients to compare
    Memory memory = {};
  };

  /// Becomes the output of @p link.
  ClientHub(StationLink& link, Hooks hooks);

  /// @param who  for people: "pid 12 of user 1000"
  /// @return an error when there are clients_max already: the message that tells it the one who is refused
  [[nodiscard]] Result<ClientId, std::string> on_connect(const std::string& who);
  void on_message(ClientId client, std::string_view text);
  void on_disconnect(ClientId client);
  /// A telecommand was made, for a client or by the server itself; clients that asked for it are told, but
  /// the one that sends it.
  void on_telecommand(const SeenTelecommand& seen);
  /// The line was closed, for whatever reason; each client is told.
  void on_line_closed(const std::string& why);
  void on_line_opened();
  /// Octets of the line as they came, for the clients that asked for them.
  void on_octets(OctetView octets);
  void on_time(MonotonicTime now);

  using Message = std::shared_ptr<const std::string>;
  /// The next message for a client; nullptr: none.
  [[nodiscard]] Message front(ClientId client) const;
  void pop(ClientId client);
  /// The clients whose connections are to be closed, after what is queued for them was tried once.
  [[nodiscard]] std::vector<ClientId> take_closing();
  [[nodiscard]] std::size_t clients() const { return clients_.size(); }

 private:
  struct Client {
    std::string who;
    std::string verb = "?";
    bool greeted = false;
    std::optional<MonotonicTime> hello_deadline = {};
    bool wants_files = false;
    bool wants_octets = false;  ///< instead of packets
    bool wants_telecommands = false;
    bool uses_ad = false;
    bool closing = false;
    std::optional<suite::AssociationSet> keys = {};
    std::string told_cop = {};
    std::deque<Message> queue = {};
    std::size_t queued_octets = 0;
  };
  struct Sender {
    ClientId client;
    std::uint64_t number;  ///< the client's own
  };

  void answer(ClientId id, Client& client, const nlohmann::json& message);
  void greet(Client& client, const nlohmann::json& message);
  [[nodiscard]] nlohmann::json carry_out(ClientId id, Client& client, const std::string& type,
                                         const nlohmann::json& message);
  [[nodiscard]] nlohmann::json send(ClientId id, const Client& client, const nlohmann::json& message);
  /// The reply to an order that was sent before, or of which nobody knows; nullopt: it is a new one.
  [[nodiscard]] std::optional<nlohmann::json> sent_before(const std::string& token, bool again) const;
  [[nodiscard]] nlohmann::json make_packet(const Client& client, const nlohmann::json& message);
  void replay(Client& client, std::int64_t after);
  [[nodiscard]] nlohmann::json order_ad(Client& client, const std::string& type,
                                        const nlohmann::json& message);
  [[nodiscard]] nlohmann::json order_memory(const Client& client, const std::string& type,
                                            const nlohmann::json& message);
  [[nodiscard]] nlohmann::json order_files(const std::string& type, const nlohmann::json& message);
  /// Another client that uses the AD service; empty: none.
  [[nodiscard]] std::string other_ad_user(const Client& client) const;
  [[nodiscard]] Result<void, OrderError> leave_ad(Client& client);
  void on_packet(const ReceivedPacket& received);
  void on_ad(std::uint64_t number, AdProgress progress);
  void on_cop(const CopReport& report);
  void tell_cop(Client& client, const CopReport& report);
  void tell_all(const nlohmann::json& message, bool (*wants)(const Client&));
  void queue(Client& client, const Message& message);
  void queue(Client& client, const nlohmann::json& message);
  void close(Client& client, const std::string& why);
  void close_silent(MonotonicTime now);
  [[nodiscard]] nlohmann::json state() const;

  StationLink& link_;
  Hooks hooks_;
  std::map<ClientId, Client> clients_;
  ClientId next_client_ = 1;
  ClientId sending_ = 0;                        ///< the client whose order is carried out; 0: none
  std::map<std::uint64_t, Sender> ad_senders_;  ///< by number; bounded by the AD service's queue and window
  std::uint64_t next_number_ = 1;
  MonotonicTime next_state_;
  std::string told_state_;
  std::string told_transfers_;
};

}  // namespace srfs::ground
