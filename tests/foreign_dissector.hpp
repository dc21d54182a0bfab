// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <unistd.h>

#include "base/octets.hpp"

namespace srfs {

/// Decodes messages with Wireshark's independent dissectors. The messages are in libpcap's classic format
/// with link type 147 (user 0), which an option makes tshark treat as @p protocol ("cfdp", "ccsds").
class ForeignDissector {
 public:
  static bool is_installed() { return std::system("tshark --version > /dev/null 2>&1") == 0; }

  explicit ForeignDissector(std::string protocol) : protocol_(std::move(protocol)) {
    std::string name = "/tmp/srfs_dissect_XXXXXX";
    const int fd = mkstemp(name.data());
    if (fd >= 0) close(fd);
    path_ = name;
    for (const std::uint32_t word : {0xA1B2C3D4U, 0x00020004U, 0U, 0U, 65535U, 147U}) pcap_.u32(word);
  }
  ~ForeignDissector() { std::remove(path_.c_str()); }
  ForeignDissector(const ForeignDissector&) = delete;
  ForeignDissector& operator=(const ForeignDissector&) = delete;
  void add(OctetView message) {
    pcap_.u64(0);
    pcap_.u32(static_cast<std::uint32_t>(message.size()));
    pcap_.u32(static_cast<std::uint32_t>(message.size()));
    pcap_.bytes(message);
  }
  /// One line for each message: its fields, joined by spaces.
  std::vector<std::string> dissected(const std::string& fields) {
    std::ofstream(path_, std::ios::binary)
        .write(reinterpret_cast<const char*>(pcap_.view().data()),
               static_cast<std::streamsize>(pcap_.size()));
    std::string command = "tshark -r " + path_ + " -o 'uat:user_dlts:\"User 0 (DLT=147)\",\"" + protocol_ +
                          "\",\"0\",\"\",\"0\",\"\"' -T fields "
                          "-E 'separator= '";
    std::istringstream names(fields);
    for (std::string field; names >> field;) command += " -e " + field;
    std::vector<std::string> lines;
    FILE* const out = popen((command + " 2>/dev/null").c_str(), "r");
    char line[4096];
    while (out != nullptr && std::fgets(line, sizeof line, out) != nullptr) {
      std::istringstream in(std::string(line, std::strcspn(line, "\n")));
      std::string joined;
      for (std::string word; in >> word;) joined += (joined.empty() ? "" : " ") + word;
      lines.push_back(joined);
    }
    if (out != nullptr) pclose(out);
    return lines;
  }

 private:
  std::string protocol_;
  std::string path_;
  OctetWriter pcap_{1U << 20};
};

}  // namespace srfs
