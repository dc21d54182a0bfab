// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include <nlohmann/json.hpp>

#include "base/fd.hpp"
#include "ground/link.hpp"
#include "ground/serve_messages.hpp"
#include "ground/station_link.hpp"

namespace srfs::ground {

/// One client's connection to `srfs-ground serve`: messages there and back, and calls that wait for their
/// reply. When the server ends, it is looked for again.
class ServerConnection {
 public:
  static constexpr milliseconds reply_patience{10'000};
  static constexpr milliseconds server_patience{30'000};  ///< for another server, when one has ended
  static constexpr std::size_t pending_max = 65'536;      ///< messages that came while a call waited

  struct Hello {
    std::string verb;
    bool files = false;         ///< news of file transfers, and problems, are wanted
    bool octets = false;        ///< the octets of the line instead of packets
    bool telecommands = false;  ///< those of others are wanted, too
    std::optional<suite::AssociationSet> keys = {};
  };

  /// nullopt: no server listens at @p socket. The error is ready to print.
  [[nodiscard]] static Result<std::optional<ServerConnection>, std::string> open(
      const std::filesystem::path& socket, Hello hello);

  /// -1: there is no server now.
  [[nodiscard]] int fd() const { return socket_.get(); }
  [[nodiscard]] const nlohmann::json& welcome() const { return welcome_; }
  /// Messages that are there, oldest first, at most some. After the server's end: none.
  [[nodiscard]] std::vector<nlohmann::json> take_messages();
  [[nodiscard]] bool has_pending() const { return !pending_.empty(); }

  /// Waits for the reply, and for a server if there is none, but not longer than reply_patience each.
  /// @param servers_max  more than 1: an order with a token. It is repeated when a server with an archive
  ///                     ended before it answered: the next one knows by the token whether it was done. One
  ///                     that the archive cannot record is given to the server once more, and to no other. Of
  ///                     a message with "recorded_alone" it is refused
  [[nodiscard]] Result<nlohmann::json, OrderError> call(nlohmann::json message, int servers_max = 1);

  /// Looks for a server again, if there is none. @return an error when that has taken too long
  [[nodiscard]] Result<void, std::string> seek(MonotonicTime now);
  /// When seek() has something to do. nullopt: there is a server.
  [[nodiscard]] std::optional<MonotonicTime> next_seek() const;
  /// Another server was found since the last call: welcome() is its own. Packets after those that have come
  /// are asked for, and the AD service is on again if it was.
  [[nodiscard]] bool take_found() { return std::exchange(found_, false); }

 private:
  ServerConnection(std::filesystem::path path, Hello hello)
      : path_(std::move(path)), hello_(std::move(hello)) {}
  /// @return false: no server. The error: it refuses this client
  [[nodiscard]] Result<bool, std::string> connect();
  [[nodiscard]] std::optional<nlohmann::json> receive(MonotonicTime deadline);
  /// What the next server is to know of a message that came.
  void follow(const nlohmann::json& message);
  void lose(MonotonicTime now);
  /// Sends to the server, or to the next one: a message is taken whole or not at all.
  [[nodiscard]] Result<void, std::string> hand_over(const std::string& message);
  /// nullopt: the server ended before it answered.
  [[nodiscard]] std::optional<nlohmann::json> receive_reply(std::uint64_t call);

  std::filesystem::path path_;
  Hello hello_;
  Fd socket_;
  nlohmann::json welcome_;
  std::deque<nlohmann::json> pending_;
  std::uint64_t next_call_ = 1;
  MonotonicTime lost_;
  MonotonicTime next_seek_;
  bool found_ = false;
  std::int64_t seen_ = 0;   ///< the last packet; 0: none
  bool ad_wanted_ = false;  ///< the AD service is on for this client
};

/// The link of a client of `srfs-ground serve`.
class ServedLink final : public StationLink {
 public:
  /// @param files  whether files are carried for this user
  ServedLink(ServerConnection connection, bool files);

  [[nodiscard]] Result<wire::RequestId, OrderError> send(const TelecommandOrder& order) override;
  [[nodiscard]] Result<TelecommandPacket, OrderError> make_packet(const TelecommandOrder& order) override;
  void settle() override {}
  [[nodiscard]] Result<void, OrderError> start_ad() override { return order_ad({{"type", "start_ad"}}); }
  [[nodiscard]] Result<void, OrderError> stop_ad() override { return order_ad({{"type", "stop_ad"}}); }
  [[nodiscard]] Result<void, OrderError> unlock() override { return order_ad({{"type", "unlock"}}); }
  [[nodiscard]] Result<void, OrderError> set_vr(std::uint8_t vr) override {
    return order_ad({{"type", "set_vr"}, {"vr", vr}});
  }
  [[nodiscard]] CopReport cop() const override { return cop_; }
  [[nodiscard]] Result<void, OrderError> select_keys(suite::AssociationSet set,
                                                     const std::string& why) override;
  [[nodiscard]] std::uint8_t vc() const override { return vc_; }
  [[nodiscard]] bool carries_files() const override { return files_; }
  [[nodiscard]] Result<cfdp::TransactionId, OrderError> put(const std::filesystem::path& file,
                                                            const std::string& name, bool resume) override;
  [[nodiscard]] std::vector<cfdp::Report> transfers() const override { return transfers_; }
  [[nodiscard]] Result<bool, OrderError> order_transfer(cfdp::TransactionId id, TransferOrder order) override;
  /// From now on the server fills gaps of its archive.
  [[nodiscard]] Result<void, OrderError> fill_gaps() override;
  /// Notes in the archive that an event was seen. @param event  its number there
  [[nodiscard]] Result<void, OrderError> acknowledge(std::int64_t event, const std::string& who);
  /// Whether the server has an archive.
  [[nodiscard]] bool has_archive() const { return connection_.welcome().value("archive", false); }
  [[nodiscard]] bool remembers() const override { return has_archive(); }
  /// Why the server records nothing now; empty: it does.
  [[nodiscard]] const std::string& archive_problem() const { return archive_problem_; }
  /// Whether the server had the line when it was found.
  [[nodiscard]] bool line_was_open() const { return connection_.welcome().value("line_open", false); }
  [[nodiscard]] int fd() const override { return connection_.fd(); }
  [[nodiscard]] Result<void, std::string> on_readable() override;
  [[nodiscard]] Result<void, std::string> on_time() override;
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const override;
  [[nodiscard]] DownlinkCounters counters() const override { return counters_; }
  [[nodiscard]] bool locked() const override { return locked_; }
  [[nodiscard]] std::optional<std::uint32_t> clcw() const override { return clcw_; }
  [[nodiscard]] std::uint64_t telecommands_sent() const override { return sent_; }

 private:
  [[nodiscard]] Result<void, OrderError> order_ad(nlohmann::json message);
  /// @return an error when the line was closed
  [[nodiscard]] Result<void, std::string> take_messages();
  [[nodiscard]] Result<void, std::string> take(const nlohmann::json& message);
  void take_welcome();
  void take_file(const cfdp::News& news);
  void take_state(const nlohmann::json& message);
  void take_cop(const CopReport& report);
  /// Makes a call; all that is made go this way.
  [[nodiscard]] Result<nlohmann::json, OrderError> call(nlohmann::json message, int servers_max = 1);
  /// If another server was found: what this one knows counts from now on. Reports nothing yet.
  void resume_with_server();
  /// Reports what went with the server before.
  void tell_resumed();
  void end_transfers(const std::vector<cfdp::Report>& before);
  [[nodiscard]] std::string new_token();

  ServerConnection connection_;
  bool files_;
  std::uint8_t vc_ = 0;
  CopReport cop_;
  DownlinkCounters counters_;
  bool locked_ = false;
  std::optional<std::uint32_t> clcw_;
  std::uint64_t sent_ = 0;
  std::string archive_problem_;
  std::vector<cfdp::Report> transfers_;
  std::set<std::uint64_t> in_ad_;    ///< numbers in the hands of the AD service
  std::set<std::uint64_t> orphans_;  ///< of them those that went with a server that ended
  std::vector<cfdp::Report> ended_;  ///< transfers that the next server does not know
  Result<void, std::string> line_;   ///< closed while an order was carried out, and not reported yet
  bool resumed_ = false;             ///< with another server, which is not told yet
  bool cop_changed_ = false;         ///< by that
  std::string token_;                ///< of this client, for the tokens of its telecommands
  std::uint64_t tokens_ = 0;
};

/// The octets of the line through the server, for programs that forward frames.
class ServedLine final : public OctetLine {
 public:
  explicit ServedLine(ServerConnection connection) : connection_(std::move(connection)) {}
  [[nodiscard]] int fd() const override { return connection_.fd(); }
  [[nodiscard]] Result<Octets, std::string> read() override;
  [[nodiscard]] Result<void, std::string> write(OctetView octets, milliseconds patience) override;

 private:
  ServerConnection connection_;
};

}  // namespace srfs::ground
