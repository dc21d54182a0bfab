// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/payload/frame_peripheral_link.hpp"

#include <algorithm>
#include <utility>

namespace srfs {

PeripheralLink::Outcome measured(Octets measurement) {
  return wire::PeripheralResponse{0, wire::WakeUpResponse{.measurement = std::move(measurement)}};
}

PeripheralLink::Outcome still_booting() {
  return wire::PeripheralResponse{0, wire::WakeUpResponse{.status = wire::PeripheralStatus::booting}};
}

PeripheralLink::Outcome carried_out(wire::PeripheralResult result) {
  return wire::PeripheralResponse{0, wire::CommandResponse{.result = result}};
}

PeripheralLink::Outcome restarting() {
  return wire::PeripheralResponse{0, wire::ResetResponse{}};
}

PeripheralLink::Outcome not_understood(const char* why) {
  return tl::unexpected(PeripheralLink::Failure{RequestFailure::garbage, why});
}

FramePeripheralLink::FramePeripheralLink(std::unique_ptr<FrameProtocol> protocol)
    : protocol_(std::move(protocol)), identifiers_(protocol_->identifiers()) {}

void FramePeripheralLink::request(const Body& body, MonotonicTime /*now*/) {
  abort();
  under_way_ = body;
  send(protocol_->begin(body));
}

void FramePeripheralLink::send(FrameProtocol::Frames frames) {
  const auto refuse = [this](const char* why) {
    end(tl::unexpected(Failure{RequestFailure::not_sent, why}));
  };
  if (frames.empty()) {
    refuse("the peripheral's protocol has no such request");
  } else if (waiting_.size() + frames.size() > frames_max) {
    refuse("more frames than a request may have");
  } else if (!std::all_of(frames.begin(), frames.end(), [this](const auto& f) { return is_request(f); })) {
    refuse("a frame that the peripheral's protocol does not declare");
  } else {
    waiting_.insert(waiting_.end(), frames.begin(), frames.end());
  }
}

void FramePeripheralLink::abort() {
  under_way_.reset();
  waiting_.clear();
  handed_out_.reset();
  not_before_.reset();
  outcome_.reset();
}

void FramePeripheralLink::end(Outcome outcome) {
  // The peripheral knows no telecommand by its id; the request under way does.
  const auto* command = under_way_ ? std::get_if<wire::CommandRequest>(&*under_way_) : nullptr;
  auto* response = outcome ? std::get_if<wire::CommandResponse>(&outcome->body) : nullptr;
  if (command != nullptr && response != nullptr) response->telecommand_id = command->telecommand_id;
  abort();
  outcome_ = std::move(outcome);
}

void FramePeripheralLink::on_frame(const wire::CanDataFrame& frame, MonotonicTime /*now*/) {
  if (!is_answer(frame)) return;
  if (!under_way_) {
    ++counters_.late_answers;
    return;
  }
  FrameProtocol::Heard heard = protocol_->hear(frame);
  if (auto* more = std::get_if<FrameProtocol::SendMore>(&heard)) {
    send(std::move(more->frames));
  } else if (auto* outcome = std::get_if<Outcome>(&heard)) {
    if (!*outcome) ++counters_.transport_errors;
    end(std::move(*outcome));
  }
}

void FramePeripheralLink::on_transmit_confirm(const wire::CanDataFrame& /*frame*/, MonotonicTime /*now*/) {
  not_before_.reset();
}

void FramePeripheralLink::on_transmit_refused(MonotonicTime now) {
  if (!handed_out_) return;
  waiting_.push_front(*handed_out_);
  handed_out_.reset();
  not_before_ = now + offered_again;
}

std::optional<wire::CanDataFrame> FramePeripheralLink::poll(MonotonicTime now) {
  if (waiting_.empty() || (not_before_ && now < *not_before_)) return std::nullopt;
  not_before_.reset();
  handed_out_ = waiting_.front();
  waiting_.pop_front();
  return handed_out_;
}

std::optional<MonotonicTime> FramePeripheralLink::next_deadline() const {
  return waiting_.empty() ? std::nullopt : not_before_;
}

std::optional<PeripheralLink::Outcome> FramePeripheralLink::take_outcome() {
  return std::exchange(outcome_, std::nullopt);
}

bool FramePeripheralLink::is_answer(const wire::CanDataFrame& frame) const {
  return std::any_of(identifiers_.begin(), identifiers_.end(), [&](const wire::CanIdentifierPair& pair) {
    return pair.extended == frame.extended && pair.answer == frame.id;
  });
}

bool FramePeripheralLink::is_request(const wire::CanDataFrame& frame) const {
  return frame.size <= 8 &&
         std::any_of(identifiers_.begin(), identifiers_.end(), [&](const wire::CanIdentifierPair& pair) {
           return pair.extended == frame.extended && pair.request == frame.id;
         });
}

}  // namespace srfs
