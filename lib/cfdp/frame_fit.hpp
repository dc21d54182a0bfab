// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace srfs::cfdp {

/// Where the next PDU comes to lie in the frames of the link, when PDUs follow one another through frames of
/// a fixed length (CCSDS 132.0-B). A frame that is lost takes all PDUs along that have octets in it.
struct FrameFill {
  std::size_t octets = 0;    ///< of a frame's data field; 0: not such a link
  std::size_t filled = 0;    ///< of the frame in which the next PDU begins, 0 to octets - 1
  std::size_t overhead = 0;  ///< of a PDU on the link: its packet's header

  /// As it is behind a PDU of @p pdu_octets.
  [[nodiscard]] FrameFill behind(std::size_t pdu_octets) const {
    FrameFill next = *this;
    if (octets > 0) next.filled = (filled + pdu_octets + overhead) % octets;
    return next;
  }
};

/// How many octets of a file a PDU should carry, by how many frames are being lost: long PDUs waste little on
/// headers, but each frame more is one chance more to lose all of it. Pure.
class FrameFit {
 public:
  /// A PDU of file data was handed out. @param pdu_octets with its headers
  void on_sent(const FrameFill& frame, std::size_t pdu_octets, std::size_t file_octets);
  /// The receiver asks for so many octets that were sent and not asked for yet.
  void on_lost(std::size_t file_octets) { lost_octets_ += static_cast<double>(file_octets); }
  /// Estimate of the share of frames that are lost, 0-1, of some 32 KiB.
  [[nodiscard]] double frame_loss() const;
  /// @param header_octets of a PDU of file data  @param most octets of the file in one
  /// @return most, or what ends with a frame
  [[nodiscard]] std::size_t file_octets(const FrameFill& frame, std::size_t header_octets,
                                        std::size_t most) const;

 private:
  // Of the latest PDUs; older ones count less. At first as if one frame of 33 had been lost: two frames a
  // PDU, which costs little on any line.
  double sent_octets_ = 8192;  // of files
  double lost_octets_ = 492;
  double pdus_ = 20;
  double frames_ = 40;  // that they touched
};

}  // namespace srfs::cfdp
