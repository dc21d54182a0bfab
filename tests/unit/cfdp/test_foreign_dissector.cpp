// What Wireshark's dissector, which is not ours, reads in the PDUs of a transfer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>

#include <unistd.h>

#include "unit/cfdp/simulated_link.hpp"

namespace srfs::cfdp {
namespace {

using testing::ElementsAre;

/// libpcap's classic format with link type 147 (user 0), which tshark is told to take for CFDP.
class Capture {
 public:
  Capture() {
    std::string name = "/tmp/srfs_cfdp_XXXXXX";
    const int fd = mkstemp(name.data());
    if (fd >= 0) close(fd);
    path_ = name;
    for (const std::uint32_t word : {0xA1B2C3D4U, 0x00020004U, 0U, 0U, 65535U, 147U}) pcap_.u32(word);
  }
  ~Capture() { std::remove(path_.c_str()); }
  Capture(const Capture&) = delete;
  Capture& operator=(const Capture&) = delete;
  void add(OctetView pdu) {
    pcap_.u64(0);
    pcap_.u32(static_cast<std::uint32_t>(pdu.size()));
    pcap_.u32(static_cast<std::uint32_t>(pdu.size()));
    pcap_.bytes(pdu);
  }
  /// One line for each PDU: fields joined by spaces.
  std::vector<std::string> dissected(const std::string& fields) {
    std::ofstream(path_, std::ios::binary)
        .write(reinterpret_cast<const char*>(pcap_.view().data()),
               static_cast<std::streamsize>(pcap_.size()));
    std::string command = "tshark -r " + path_ +
                          " -o 'uat:user_dlts:\"User 0 (DLT=147)\",\"cfdp\",\"0\",\"\",\"0\",\"\"' -T fields "
                          "-E 'separator= '";
    std::istringstream names(fields);
    for (std::string field; names >> field;) command += " -e " + field;
    std::vector<std::string> lines;
    FILE* const out = popen((command + " 2>/dev/null").c_str(), "r");
    char line[4096];
    while (out != nullptr && std::fgets(line, sizeof line, out) != nullptr) {
      lines.emplace_back(line, std::strcspn(line, "\n"));
    }
    if (out != nullptr) pclose(out);
    return lines;
  }

 private:
  std::string path_;
  OctetWriter pcap_{1U << 20};
};

TEST(ForeignDissector, ReadsATransferWithAGapAsItWasMeant) {
  if (std::system("tshark --version > /dev/null 2>&1") != 0) GTEST_SKIP() << "no tshark";
  Capture capture;
  SimulatedLink link;
  int data_pdus = 0;
  link.on_line = [&](std::uint64_t, OctetView pdu) {
    capture.add(pdu);
    const auto decoded = wire::decode_cfdp_pdu(pdu);
    return !std::holds_alternative<wire::CfdpFileData>(decoded->body) || ++data_pdus != 2;
  };
  link.start();
  link.at(ground).files.add("image.fits", random_file(2500, 1));
  ASSERT_TRUE(link.entity(ground).put("image.fits", "got.fits"));
  ASSERT_TRUE(link.run(link.now + seconds(60)));

  const auto lines = capture.dissected(
      "cfdp.srcid cfdp.transeqnum cfdp.dstid cfdp.direction cfdp.fdtype cfdp.offset cfdp.file_size "
      "cfdp.src_file_name cfdp.dst_file_name cfdp.nak_st_scope cfdp.nak_sp_scope cfdp.condition_code "
      "cfdp.delivery_code cfdp.file_status _ws.malformed");
  std::vector<std::string> words;  // without the fields that a PDU does not have
  for (const std::string& line : lines) {
    std::istringstream in(line);
    std::string joined;
    for (std::string word; in >> word;) joined += (joined.empty() ? "" : " ") + word;
    words.push_back(joined);
  }
  EXPECT_THAT(words, ElementsAre("1 1 2 0 7 2500 image.fits got.fits",  // Metadata
                                 "1 1 2 0 0", "1 1 2 0 950", "1 1 2 0 1900",
                                 "1 1 2 0 4 2500 0",    // EOF
                                 "1 1 2 1 6 0",         // ACK of EOF
                                 "1 1 2 1 8 950 1900",  // NAK
                                 "1 1 2 0 950",         // again
                                 "1 1 2 1 5 0 0 2",     // Finished
                                 "1 1 2 0 6 0"));       // its ACK
}

}  // namespace
}  // namespace srfs::cfdp
