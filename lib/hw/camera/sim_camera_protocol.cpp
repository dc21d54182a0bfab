// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw/camera/sim_camera_protocol.hpp"

#include <cmath>
#include <cstring>

#include <fmt/format.h>

#include "base/crc32c.hpp"

namespace srfs::hw::sim_camera {
namespace {

enum Kind : std::uint8_t {
  settings = 1,
  begin = 2,
  abandon = 3,
  settings_reply = 0x81,
  head = 0x82,
  piece = 0x83,
  end = 0x84
};

template <class... Visitors>
struct Overloaded : Visitors... {
  using Visitors::operator()...;
};
template <class... Visitors>
Overloaded(Visitors...) -> Overloaded<Visitors...>;  // clang 16 makes none of its own

}  // namespace

Octets encode(const Request& request) {
  OctetWriter out;
  std::visit(Overloaded{[&](const SettingsRequest& r) {
                          out.u8(settings);
                          out.u32(r.exposure_us);
                          out.f32(r.gain_db);
                        },
                        [&](const BeginRequest& r) {
                          out.u8(begin);
                          out.u32(r.number);
                        },
                        [&](const AbandonRequest&) { out.u8(abandon); }},
             request);
  return out.take();
}

Octets encode(const Reply& reply) {
  OctetWriter out;
  std::visit(Overloaded{[&](const SettingsReply& r) {
                          out.u8(settings_reply);
                          out.u8(r.accepted ? 1 : 0);
                          out.u16(r.width);
                          out.u16(r.height);
                          out.u8(r.bits);
                        },
                        [&](const FrameHead& h) {
                          out.u8(head);
                          out.u32(h.number);
                          out.u32(h.sequence);
                          out.u64(h.begin_ns);
                          out.u32(h.exposure_us);
                          out.f32(h.gain_db);
                          out.f32(h.temperature_k);
                          out.u16(h.width);
                          out.u16(h.height);
                          out.u8(h.bits);
                          out.u32(h.crc);
                        },
                        [&](const FramePiece& p) {
                          out.u8(piece);
                          out.u32(p.number);
                          out.u32(p.offset);
                          out.bytes(p.octets);
                        },
                        [&](const FrameEnd& e) {
                          out.u8(end);
                          out.u32(e.number);
                        }},
             reply);
  return out.take();
}

std::optional<Request> decode_request(OctetView message) {
  OctetReader in(message);
  std::optional<Request> request;
  switch (in.u8()) {
    case settings: {
      SettingsRequest r;
      r.exposure_us = in.u32();
      r.gain_db = in.f32();
      request = r;
      break;
    }
    case begin:
      request = BeginRequest{in.u32()};
      break;
    case abandon:
      request = AbandonRequest{};
      break;
    default:
      break;
  }
  return in.ok() && in.remaining() == 0 ? request : std::nullopt;
}

std::optional<Reply> decode_reply(OctetView message) {
  OctetReader in(message);
  std::optional<Reply> reply;
  switch (in.u8()) {
    case settings_reply: {
      SettingsReply r;
      r.accepted = in.u8() == 1;
      r.width = in.u16();
      r.height = in.u16();
      r.bits = in.u8();
      reply = r;
      break;
    }
    case head: {
      FrameHead h;
      h.number = in.u32();
      h.sequence = in.u32();
      h.begin_ns = in.u64();
      h.exposure_us = in.u32();
      h.gain_db = in.f32();
      h.temperature_k = in.f32();
      h.width = in.u16();
      h.height = in.u16();
      h.bits = in.u8();
      h.crc = in.u32();
      reply = h;
      break;
    }
    case piece: {
      FramePiece p;
      p.number = in.u32();
      p.offset = in.u32();
      p.octets = in.rest();
      reply = p;
      break;
    }
    case end:
      reply = FrameEnd{in.u32()};
      break;
    default:
      break;
  }
  return in.ok() && in.remaining() == 0 ? reply : std::nullopt;
}

void FrameAssembler::expect(std::uint32_t number) {
  expected_ = number;
  head_.reset();
  received_ = 0;
}

tl::unexpected<std::string> FrameAssembler::unsound(std::string why) {
  expected_.reset();
  head_.reset();
  return Err(std::move(why));
}

Result<std::optional<CameraFrame>, std::string> FrameAssembler::on_reply(const Reply& reply) {
  if (const auto* r = std::get_if<FrameHead>(&reply); r != nullptr && expected_ == r->number)
    return on_head(*r);
  if (const auto* r = std::get_if<FramePiece>(&reply); r != nullptr && expected_ == r->number)
    return on_piece(*r);
  if (const auto* r = std::get_if<FrameEnd>(&reply); r != nullptr && expected_ == r->number) return on_end();
  return std::optional<CameraFrame>{};
}

Result<std::optional<CameraFrame>, std::string> FrameAssembler::on_head(const FrameHead& head) {
  if (head.width != width_ || head.height != height_ || head.bits != bits_)
    return unsound(fmt::format("a frame of {} x {}, {} bits; the camera has {} x {}, {} bits", head.width,
                               head.height, head.bits, width_, height_, bits_));
  if (head.begin_ns > static_cast<std::uint64_t>(INT64_MAX))
    return unsound("a frame with an impossible time");
  head_ = head;
  received_ = 0;
  frame_ = CameraFrame{};
  frame_.pixels = image::Grid<std::uint16_t>::unset(width_, height_);
  return std::optional<CameraFrame>{};
}

Result<std::optional<CameraFrame>, std::string> FrameAssembler::on_piece(const FramePiece& piece) {
  const std::size_t whole = frame_.pixels.size() * sizeof(std::uint16_t);
  if (!head_ || piece.offset != received_ || piece.octets.size() > whole - received_)
    return unsound(
        fmt::format("torn: pixels from octet {}, expected from octet {}", piece.offset, received_));
  auto* const pixels = reinterpret_cast<std::uint8_t*>(frame_.pixels.cells().data());
  std::copy(piece.octets.begin(), piece.octets.end(), pixels + received_);
  received_ += piece.octets.size();
  return std::optional<CameraFrame>{};
}

Result<std::optional<CameraFrame>, std::string> FrameAssembler::on_end() {
  const std::size_t whole = frame_.pixels.size() * sizeof(std::uint16_t);
  if (!head_ || received_ != whole)
    return unsound(fmt::format("short: {} of {} octets", head_ ? received_ : 0, whole));
  const OctetView octets(reinterpret_cast<const std::uint8_t*>(frame_.pixels.cells().data()), whole);
  if (crc32c(octets) != head_->crc) return unsound("torn: wrong checksum of the pixels");
  frame_.bits = head_->bits;
  frame_.sequence = head_->sequence;
  frame_.begin = MonotonicTime(nanoseconds(static_cast<std::int64_t>(head_->begin_ns)));
  frame_.settings = {microseconds(head_->exposure_us), static_cast<double>(head_->gain_db)};
  if (std::isfinite(head_->temperature_k) && head_->temperature_k > 0)
    frame_.temperature_k = static_cast<double>(head_->temperature_k);
  frame_.saturation_adu = static_cast<std::uint16_t>((1U << head_->bits) - 1);
  expected_.reset();
  head_.reset();
  return std::optional<CameraFrame>(std::move(frame_));
}

}  // namespace srfs::hw::sim_camera
