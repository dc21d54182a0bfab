// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/file/frame_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <new>

#include <fmt/format.h>

#include "base/fd.hpp"
#include "base/file.hpp"
#include "base/text.hpp"

namespace srfs::image {
namespace {

constexpr std::size_t file_octets_max = std::size_t{1} << 30;

template <class... Args>
tl::unexpected<Refusal> refuse(fmt::format_string<Args...> format, Args&&... args) {
  return Err(Refusal{fmt::format(format, std::forward<Args>(args)...)});
}

using FileOctets = std::vector<std::uint8_t, FrameAllocator<std::uint8_t>>;

/// A file at once: its size is known, and a frame's may be large.
Result<FileOctets, Refusal> read_octets(const std::filesystem::path& path) {
  const auto problem = [&](const char* what) {
    return refuse("cannot {} {}: {}", what, path.string(), std::strerror(errno));
  };
  const Fd fd(open(path.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status {};
  if (!fd || fstat(fd.get(), &status) != 0) return problem("open");
  if (static_cast<std::uint64_t>(status.st_size) > file_octets_max)
    return refuse("{}: {} octets, more than {}", path.string(), status.st_size, file_octets_max);
  FileOctets content(static_cast<std::size_t>(status.st_size));
  std::size_t n = 0;
  while (n < content.size()) {
    const ssize_t got = read(fd.get(), content.data() + n, content.size() - n);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return problem("read");
    if (got == 0) break;
    n += static_cast<std::size_t>(got);
  }
  content.resize(n);  // shorter by now
  return content;
}

}  // namespace

Result<Frame, Refusal> read_frame(const std::filesystem::path& path, FrameDecoder decode) try {
  std::error_code ec;
  if (std::filesystem::exists(path, ec) && !std::filesystem::is_regular_file(path, ec))
    return refuse("{}: not a file", path.string());
  if (const auto size = std::filesystem::file_size(path, ec); !ec && size > file_octets_max)
    return refuse("{}: {} octets, more than {}", path.string(), size, file_octets_max);
  const auto content = read_octets(path);
  if (!content) return Err(content.error());
  auto frame = decode(OctetView(content->data(), content->size()));
  if (!frame) return refuse("{}: {}", path.string(), frame.error().reason);
  return frame;
} catch (const std::bad_alloc&) {
  return refuse("{}: not enough memory for this file", path.string());
}

Result<void, Refusal> write_octets(const std::filesystem::path& path, OctetView content) {
  const auto written = write_file_atomically(path, as_text(content));
  if (!written) return Err(Refusal{written.error().message});
  return {};
}

Result<void, Refusal> write_fits(const std::filesystem::path& path, const Plane& pixels) {
  return write_octets(path, encode_fits(pixels));
}

Result<void, Refusal> write_fits(const std::filesystem::path& path, const Frame& frame) {
  std::vector<FitsCard> cards;
  if (const auto begin = utc_of(frame.time_s)) cards.push_back({"DATE-OBS", fits_date(*begin)});
  if (frame.exposure_s) cards.push_back({"EXPTIME", *frame.exposure_s});
  if (frame.gain) cards.push_back({"GAIN", *frame.gain});
  if (frame.temperature_k) cards.push_back({"CCD-TEMP", *frame.temperature_k - ice_point_k});
  if (frame.saturation_adu) cards.push_back({"SATURATE", double{*frame.saturation_adu}});
  return write_octets(path, encode_fits(frame.pixels, cards));
}

}  // namespace srfs::image
