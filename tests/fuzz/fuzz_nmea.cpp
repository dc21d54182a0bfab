// The GNSS receiver's line.
#include <cstdlib>

#include "wire/nmea.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace srfs;
  using namespace srfs::wire;
  (void)parse_nmea(std::string_view(reinterpret_cast<const char*>(data), size));
  NmeaReceiver receiver;
  (void)receiver.push(OctetView(data, size));
  // Whatever came before: the next sentence is read.
  const std::string good = "\r\n$GPZDA,080000,21,11,2026,00,00*45\r\n";
  if (receiver.push(OctetView(reinterpret_cast<const std::uint8_t*>(good.data()), good.size())).empty())
    std::abort();
  return 0;
}
