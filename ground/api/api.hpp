// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <string>

#include "ground/api/answered_orders.hpp"
#include "ground/api/gateway.hpp"
#include "ground/api/http_server.hpp"
#include "ground/api/routes.hpp"

namespace srfs::ground::api {

/// Rows of the archive that a request asks for.
struct RowQuery {
  static constexpr std::size_t rows_default = 500;
  static constexpr std::size_t rows_max = 5000;
  Period period;
  std::size_t most = rows_default;
  std::optional<std::int64_t> before;  ///< the number of a packet: older ones alone
};
/// from, to, limit, before of a query; the error is ready to print. Pure.
[[nodiscard]] Result<RowQuery, std::string> read_row_query(const Target& target, UtcTime now);

/// One packet of the archive as the stream has it: decoded, or the stage of the telecommand that it reports.
[[nodiscard]] nlohmann::json archived_json(const StoredPacket& stored, Archive& archive,
                                           const mission::Dictionary& dictionary);

/// The requests of the HTTP API and the files of the page.
class Api final : public HttpApplication {
 public:
  struct Settings {
    std::filesystem::path state_dir;
    ArchivePlace archive;
    std::filesystem::path web_root;          ///< empty: there is no page
    std::filesystem::path orders_file = {};  ///< of the OrderJournal; empty: none
    Tokens tokens;
    Site site;
  };
  Api(const mission::Dictionary& dictionary, Gateway& gateway, Settings settings);

  [[nodiscard]] Admission admit(const HttpRequest& request) override;
  [[nodiscard]] HttpResponse answer(const HttpRequest& request) override;
  [[nodiscard]] bool stream(const HttpRequest& request, Transport& transport) override;

 private:
  using Rows = Result<nlohmann::json, std::string>;
  [[nodiscard]] HttpResponse answer_route(const HttpRequest& request, const Found& found);
  [[nodiscard]] HttpResponse get_station();
  [[nodiscard]] HttpResponse get_latest();
  [[nodiscard]] HttpResponse get_history(const Target& target);
  [[nodiscard]] HttpResponse get_schedule();
  [[nodiscard]] HttpResponse get_live_transfers();
  /// Rows of the archive; an error of reading is 500.
  [[nodiscard]] HttpResponse get_rows(const Target& target, Endpoint endpoint);
  [[nodiscard]] Rows packets_of(Archive& archive, const RowQuery& query, bool events);
  /// An order with a key: carried out once, answered as often as it comes.
  [[nodiscard]] HttpResponse answer_once(const HttpRequest& request, const Found& found);
  /// @param token  unique, of an order that may be repeated; empty: it is not
  [[nodiscard]] HttpResponse post_telecommand(const std::string& body, const std::string& token);
  /// The answer of a telecommand that an earlier gateway sent with this token.
  [[nodiscard]] std::optional<HttpResponse> sent_before(const TelecommandRequest& order) const;
  [[nodiscard]] HttpResponse post_uplink(const HttpRequest& request);
  [[nodiscard]] HttpResponse post_transfer(const std::string& id, const std::string& body);
  [[nodiscard]] HttpResponse post_retrieve(const std::string& body, const std::string& token);
  [[nodiscard]] HttpResponse post_cop(const std::string& body);
  [[nodiscard]] HttpResponse post_keys(const std::string& body);
  [[nodiscard]] HttpResponse post_acknowledge(const std::string& id, const std::string& body);
  /// Packets after @p last in the archive; @p last follows. @return false: the reader has gone
  [[nodiscard]] bool replay(Transport& transport, std::int64_t& last);
  [[nodiscard]] Result<std::unique_ptr<Archive>, std::string> open() const;

  const mission::Dictionary& dictionary_;
  Gateway& gateway_;
  Settings settings_;
  std::string dictionary_text_;
  AnsweredOrders answered_;
  std::atomic<std::uint64_t> uploads_{0};
};

}  // namespace srfs::ground::api
