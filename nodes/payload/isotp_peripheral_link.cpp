// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/payload/isotp_peripheral_link.hpp"

namespace srfs {
namespace {

using wire::IsoTpError;
using wire::PeripheralProtocolError;

RequestFailure kind_of(IsoTpError error) {
  switch (error) {
    case IsoTpError::timeout_bs:
    case IsoTpError::timeout_cr:
      return RequestFailure::silent;
    case IsoTpError::busy:
    case IsoTpError::empty_message:
    case IsoTpError::message_too_long:
    case IsoTpError::timeout_as:
    case IsoTpError::aborted:
      return RequestFailure::not_sent;
    default:
      return RequestFailure::garbage;
  }
}

}  // namespace

IsoTpPeripheralLink::IsoTpPeripheralLink(std::uint8_t address)
    : channel_(wire::IsoTpAddress{.target = address, .source = computer_address}, wire::IsoTpSettings{}) {}

void IsoTpPeripheralLink::request(const Body& body, MonotonicTime now) {
  abort();
  request_ = wire::PeripheralRequest{next_sequence_++, body};
  // A refusal shows as the result of the transfer; after abort() the channel is never busy.
  if (const auto sent = channel_.send(wire::encode(*request_), now); !sent) request_.reset();
}

void IsoTpPeripheralLink::abort() {
  channel_.abort();
  (void)channel_.take_send_result();
  (void)channel_.take_receive_error();
  while (channel_.messages_waiting() > 0) {
    ++late_answers_;
    channel_.pop_message();
  }
  request_.reset();
}

std::optional<PeripheralLink::Outcome> IsoTpPeripheralLink::fail(RequestFailure kind, const char* detail) {
  request_.reset();
  channel_.abort();
  return Outcome(tl::unexpected(Failure{kind, detail}));
}

std::optional<PeripheralLink::Outcome> IsoTpPeripheralLink::judge(OctetView message) {
  if (!request_) {
    ++late_answers_;
    return std::nullopt;
  }
  auto response = wire::decode_response(message, *request_);
  if (response) {
    request_.reset();
    return Outcome(std::move(*response));
  }
  if (response.error() == PeripheralProtocolError::wrong_sequence) {
    ++late_answers_;  // of an earlier request; ours may still come
    return std::nullopt;
  }
  return fail(RequestFailure::garbage, wire::to_string(response.error()));
}

std::optional<PeripheralLink::Outcome> IsoTpPeripheralLink::take_outcome() {
  while (channel_.messages_waiting() > 0) {
    auto outcome = judge(channel_.front_message());
    channel_.pop_message();
    if (outcome) return outcome;
  }
  const auto sent = channel_.take_send_result();
  const auto received = channel_.take_receive_error();
  if (!request_) return std::nullopt;
  if (sent && !*sent) return fail(kind_of(sent->error()), wire::to_string(sent->error()));
  if (received) return fail(kind_of(*received), wire::to_string(*received));
  return std::nullopt;
}

PeripheralLink::Counters IsoTpPeripheralLink::counters() const {
  const wire::IsoTpCounters& c = channel_.counters();
  return {.late_answers = late_answers_,
          .transport_errors = c.timeouts_as + c.timeouts_bs + c.timeouts_cr + c.wrong_sequences +
                              c.invalid_flow_statuses + c.unexpected_pdus + c.malformed_pdus + c.wait_limits +
                              c.peer_overflows + c.receive_overflows};
}

}  // namespace srfs
