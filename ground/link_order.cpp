// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/link_order.hpp"

#include <fmt/format.h>

#include "ground/files.hpp"

namespace srfs::ground {
namespace {

Result<void, OrderError> put(StationLink& link, const CommandLine& command) {
  const auto put = link.put(command.file, command.name, false);
  if (!put) return Err(put.error());
  return {};
}

Result<void, OrderError> order_transfer(StationLink& link, cfdp::TransactionId id,
                                        StationLink::TransferOrder order) {
  const auto known = link.order_transfer(id, order);
  if (!known) return Err(known.error());
  if (!*known) return refused(fmt::format("no transfer with id {} is in progress", to_text(id)));
  return {};
}

}  // namespace

std::optional<Result<void, OrderError>> order_link(Station& station, const CommandLine& command) {
  using Kind = CommandLine::Kind;
  using Order = StationLink::TransferOrder;
  switch (command.kind) {
    case Kind::ad_on:
      return station.start_ad();
    case Kind::ad_off:
      return station.stop_ad();
    case Kind::unlock:
      return station.unlock();
    case Kind::set_vr:
      return station.set_vr(command.vr);
    case Kind::put:
      return put(station.link(), command);
    case Kind::suspend:
      return order_transfer(station.link(), command.transfer, Order::suspend);
    case Kind::resume:
      return order_transfer(station.link(), command.transfer, Order::resume);
    case Kind::cancel:
      return order_transfer(station.link(), command.transfer, Order::cancel);
    default:
      return std::nullopt;
  }
}

}  // namespace srfs::ground
