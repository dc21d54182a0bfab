// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/order_journal.hpp"

#include <algorithm>
#include <cerrno>
#include <sstream>

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "base/file.hpp"
#include "base/text.hpp"

namespace srfs::ground::api {
namespace {

using Order = OrderJournal::Order;

std::string line_of(const nlohmann::json& record) {
  return record.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace) + "\n";
}

nlohmann::json begin_of(const std::string& key, const std::string& digest) {
  return {{"key", key}, {"digest", digest}};
}

nlohmann::json end_of(const std::string& key, const std::optional<HttpResponse>& answer) {
  if (!answer) return {{"key", key}, {"refused", true}};
  return {{"key", key}, {"status", answer->status}, {"body", answer->body}};
}

void take(const nlohmann::json& record, std::vector<Order>& orders) {
  const auto key = record.at("key").get<std::string>();
  const auto same = [&key](const Order& order) { return order.key == key; };
  if (record.contains("digest")) {
    std::erase_if(orders, same);
    orders.push_back({key, record["digest"].get<std::string>()});
    return;
  }
  if (record.contains("refused")) {
    std::erase_if(orders, same);
    return;
  }
  const auto found = std::find_if(orders.begin(), orders.end(), same);
  if (found == orders.end()) return;
  found->answer =
      HttpResponse{.status = record.at("status").get<int>(), .body = record.at("body").get<std::string>()};
}

}  // namespace

Result<OrderJournal, std::string> OrderJournal::open(const std::filesystem::path& file,
                                                     std::size_t orders_max) {
  OrderJournal journal(file, orders_max);
  if (const auto made = journal.compact(); !made) return Err(made.error());
  return journal;
}

std::vector<Order> OrderJournal::orders() const {
  std::vector<Order> orders;
  std::istringstream lines(read_file(file_, 2 * octets_max).value_or(""));
  for (std::string line; std::getline(lines, line);) {
    const auto record = nlohmann::json::parse(line, nullptr, false);
    try {
      take(record, orders);
    } catch (const nlohmann::json::exception&) {
      continue;  // the end of a line that was cut
    }
    if (orders.size() > orders_max_) orders.erase(orders.begin());
  }
  return orders;
}

Result<void, std::string> OrderJournal::compact() {
  std::string text;
  for (const Order& order : orders()) {
    text += line_of(begin_of(order.key, order.digest));
    if (order.answer) text += line_of(end_of(order.key, order.answer));
  }
  if (const auto written = write_file_atomically(file_, text); !written) return Err(written.error().message);
  appended_ = Fd(::open(file_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC));
  if (!appended_) return Err(fmt::format("{}: cannot open: {}", file_.string(), errno_text(errno)));
  octets_ = text.size();
  return {};
}

Result<void, std::string> OrderJournal::append(const nlohmann::json& record) {
  if (octets_ > octets_max) {
    if (const auto made = compact(); !made) return made;
  }
  const std::string line = "\n" + line_of(record);  // behind a line that was cut, too
  octets_ += line.size();
  if (::write(appended_.get(), line.data(), line.size()) == static_cast<ssize_t>(line.size())) return {};
  return Err(fmt::format("{}: cannot write: {}", file_.string(), errno_text(errno)));
}

Result<void, std::string> OrderJournal::begin(const std::string& key, const std::string& digest) {
  if (const auto written = append(begin_of(key, digest)); !written) return written;
  if (::fdatasync(appended_.get()) == 0) return {};
  return Err(fmt::format("{}: cannot write: {}", file_.string(), errno_text(errno)));
}

Result<void, std::string> OrderJournal::end(const std::string& key,
                                            const std::optional<HttpResponse>& answer) {
  return append(end_of(key, answer));
}

}  // namespace srfs::ground::api
