// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/frame_peripheral_channel.hpp"

#include <algorithm>
#include <utility>

namespace srfs::sim {

void FramePeripheralChannel::on_frame(const wire::CanDataFrame& frame, MonotonicTime /*now*/) {
  const auto pairs = frames_->identifiers();
  const bool ours = std::any_of(pairs.begin(), pairs.end(), [&](const wire::CanIdentifierPair& pair) {
    return pair.extended == frame.extended && pair.request == frame.id;
  });
  if (!ours) return;
  ++counters_.frames_received;
  auto request = frames_->hear(frame);
  if (!request) return;
  if (auto* command = std::get_if<wire::CommandRequest>(&*request)) command->telecommand_id = ++commands_;
  if (requests_.size() == requests_max) requests_.pop_front();
  requests_.push_back(wire::encode(wire::PeripheralRequest{sequence_++, std::move(*request)}));
}

std::optional<Octets> FramePeripheralChannel::take_request() {
  if (requests_.empty()) return std::nullopt;
  Octets request = std::move(requests_.front());
  requests_.pop_front();
  return request;
}

bool FramePeripheralChannel::send(OctetView answer, MonotonicTime /*now*/) {
  if (const auto response = wire::decode_response(answer)) {
    const auto frames = frames_->say(*response);
    waiting_.assign(frames.begin(), frames.end());
    return true;
  }
  const wire::CanIdentifierPair pair = frames_->identifiers().front();
  constexpr std::size_t longest = 8;
  waiting_.assign(
      1, wire::make_data_frame(pair.answer, pair.extended, answer.first(std::min(answer.size(), longest))));
  return true;
}

void FramePeripheralChannel::on_transmit_refused(MonotonicTime now) {
  if (!handed_out_) return;
  waiting_.push_front(*std::exchange(handed_out_, std::nullopt));
  --counters_.frames_sent;
  not_before_ = now + offered_again;
}

std::optional<wire::CanDataFrame> FramePeripheralChannel::poll(MonotonicTime now) {
  if (waiting_.empty() || (not_before_ && now < *not_before_)) return std::nullopt;
  not_before_.reset();
  handed_out_ = waiting_.front();
  waiting_.pop_front();
  ++counters_.frames_sent;
  return handed_out_;
}

std::optional<MonotonicTime> FramePeripheralChannel::next_deadline() const {
  return waiting_.empty() ? std::nullopt : not_before_;
}

}  // namespace srfs::sim
