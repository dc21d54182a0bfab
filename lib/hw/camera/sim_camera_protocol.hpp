// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <variant>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "hw/camera/camera.hpp"

/// The simulated camera's messages (hw_sim/camera_device.hpp): datagrams of a local SOCK_SEQPACKET
/// connection. Fields are big-endian, pixels in this computer's order. A frame is a head, its pixels in
/// pieces from the first to the last octet, and an end.
namespace srfs::hw::sim_camera {

inline constexpr std::size_t piece_octets = 60'000;
inline constexpr std::size_t message_octets = piece_octets + 16;

// --- to the camera
struct SettingsRequest {
  std::uint32_t exposure_us = 0;
  float gain_db = 0;
};
/// The exposure of frame @p number begins now. One under way is given up.
struct BeginRequest {
  std::uint32_t number = 0;
};
struct AbandonRequest {};
using Request = std::variant<SettingsRequest, BeginRequest, AbandonRequest>;

// --- from the camera
struct SettingsReply {
  bool accepted = false;
  std::uint16_t width = 0;
  std::uint16_t height = 0;
  std::uint8_t bits = 0;
};
struct FrameHead {
  std::uint32_t number = 0;    ///< of the BeginRequest
  std::uint32_t sequence = 0;  ///< the camera's count
  std::uint64_t begin_ns = 0;  ///< CLOCK_MONOTONIC
  std::uint32_t exposure_us = 0;
  float gain_db = 0;
  float temperature_k = 0;
  std::uint16_t width = 0;
  std::uint16_t height = 0;
  std::uint8_t bits = 0;
  std::uint32_t crc = 0;  ///< CRC-32C of the pixels
};
struct FramePiece {
  std::uint32_t number = 0;
  std::uint32_t offset = 0;  ///< octets
  OctetView octets;
};
struct FrameEnd {
  std::uint32_t number = 0;
};
using Reply = std::variant<SettingsReply, FrameHead, FramePiece, FrameEnd>;

[[nodiscard]] Octets encode(const Request& request);
[[nodiscard]] Octets encode(const Reply& reply);
/// nullopt: no such message.
[[nodiscard]] std::optional<Request> decode_request(OctetView message);
/// A piece looks into @p message.
[[nodiscard]] std::optional<Reply> decode_reply(OctetView message);

/// Puts one frame together. Takes only the size that the camera said it has: memory is bounded by it.
class FrameAssembler {
 public:
  FrameAssembler(int width, int height, int bits) : width_(width), height_(height), bits_(bits) {}

  /// From now on the frame @p number is waited for; what comes of others is dropped.
  void expect(std::uint32_t number);
  /// @return the frame when this was its end; nothing: more is to come; or why it is unsound (waits no
  /// longer)
  [[nodiscard]] Result<std::optional<CameraFrame>, std::string> on_reply(const Reply& reply);

 private:
  [[nodiscard]] Result<std::optional<CameraFrame>, std::string> on_head(const FrameHead& head);
  [[nodiscard]] Result<std::optional<CameraFrame>, std::string> on_piece(const FramePiece& piece);
  [[nodiscard]] Result<std::optional<CameraFrame>, std::string> on_end();
  [[nodiscard]] tl::unexpected<std::string> unsound(std::string why);

  int width_;
  int height_;
  int bits_;
  std::optional<std::uint32_t> expected_;
  std::optional<FrameHead> head_;
  CameraFrame frame_;
  std::size_t received_ = 0;  ///< octets
};

}  // namespace srfs::hw::sim_camera
