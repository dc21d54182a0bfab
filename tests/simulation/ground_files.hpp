// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "cfdp/transfer_folders.hpp"
#include "tests/simulation/file_record.hpp"

namespace srfs::simulation {

/// The ground's end of CFDP, as ground::DirectLink carries it: PDUs leave while the line is free. The
/// ground's program is started anew now and then, and goes on from its checkpoint.
class GroundFiles {
 public:
  /// @return when the line is free behind what was sent
  using SendPacket = std::function<MonotonicTime(Octets packet)>;
  GroundFiles(Kernel& kernel, FileRecord& record, std::size_t packet_octets_max, SendPacket send);

  void on_pdu(OctetView pdu);
  /// After PDUs.
  void move();
  /// An operator lets go on what rests.
  void on_contact();
  void put(Random& random);
  void restart();
  [[nodiscard]] std::vector<std::string> under_way() { return names_under_way(*folders_); }

 private:
  Kernel& kernel_;
  FileRecord& record_;
  std::size_t packet_octets_max_;
  SendPacket send_;
  std::unique_ptr<cfdp::TransferFolders> folders_;
  std::uint16_t sequence_count_ = 0;
  MonotonicTime line_free_at_;
  Deadline timer_;
};

}  // namespace srfs::simulation
