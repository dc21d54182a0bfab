// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// srfs-product: turns products of image_processing that came down into what other programs read: strips into
// FITS and PNG, lists of stars into CSV; and pictures into FITS that the spacecraft reads.

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include "base/file.hpp"
#include "base/text.hpp"
#include "base/time.hpp"
#include "base/version.hpp"
#include "image/file/frame_file.hpp"
#include "image/photograph/photograph.hpp"
#include "image/picture.hpp"
#include "image/product/frame_strips.hpp"
#include "image/product/star_list.hpp"

namespace {

using namespace srfs;
using namespace srfs::image;

enum ExitCode { whole = 0, file_refused = 1, bad_usage = 2, incomplete = 3 };

constexpr std::size_t file_octets_max = std::size_t{1} << 30;
constexpr int picture_width_most = 4096;

struct Options {
  std::string file;
  std::string fits;
  std::string png;
  std::string frame;
};

ExitCode refuse(const std::string& why) {
  std::fprintf(stderr, "srfs-product: %s\n", why.c_str());
  return file_refused;
}

/// "3, 7-9"
std::string ranges(const std::vector<std::uint32_t>& numbers) {
  std::vector<std::string> parts;
  for (std::size_t i = 0; i < numbers.size();) {
    std::size_t end = i + 1;
    while (end < numbers.size() && numbers[end] == numbers[end - 1] + 1) ++end;
    parts.push_back(end - i == 1 ? fmt::format("{}", numbers[i])
                                 : fmt::format("{}-{}", numbers[i], numbers[end - 1]));
    i = end;
  }
  return fmt::format("{}", fmt::join(parts, ", "));
}

int print_stars(const std::vector<ListedStar>& stars) {
  fmt::print("frame,x,y,flux_adu,snr\n");
  for (const ListedStar& s : stars)
    fmt::print("{},{:.3f},{:.3f},{:.1f},{:.1f}\n", s.frame, s.x, s.y, s.flux, s.snr);
  return whole;
}

int write_frame(const Options& options, const Frame& frame) {
  if (!options.fits.empty()) {
    if (const auto written = write_fits(options.fits, frame); !written) return refuse(written.error().reason);
  }
  if (!options.png.empty()) {
    const auto written = write_png(options.png, thumbnail(frame.pixels, picture_width_most));
    if (!written) return refuse(written.error().reason);
  }
  return whole;
}

int unpack_strips(const Options& options, OctetView content) {
  const auto found = decode_strips(content);
  if (!found) return refuse(options.file + ": " + found.error().reason);
  const Plane& pixels = found->frame.pixels;
  fmt::print("{}: {} x {}, {} strips of {} rows", options.file, pixels.width(), pixels.height(),
             found->strips, found->rows);
  if (const auto begin = utc_of(found->frame.time_s)) fmt::print(", exposed from {}", to_iso8601(*begin));
  fmt::print("\n");
  if (!found->missing.empty())
    fmt::print("missing: {} strips ({}), {} of them damaged; their pixels are 0\n", found->missing.size(),
               ranges(found->missing), std::min<std::size_t>(found->damaged, found->missing.size()));
  if (const int problem = write_frame(options, found->frame); problem != whole) return problem;
  return found->missing.empty() ? whole : incomplete;
}

int convert(const Options& options, OctetView content) {
  const auto frame = decode_photograph(content);
  if (!frame) return refuse(options.file + ": " + frame.error().reason);
  fmt::print("{}: {} x {}\n", options.file, frame->pixels.width(), frame->pixels.height());
  return write_frame(options, in_16_bits(*frame));
}

int pack_frame(const Options& options) {
  const auto frame = read_frame(options.frame, decode_photograph);
  if (!frame) return refuse(frame.error().reason);
  const auto strips = encode_strips(*frame);
  if (!strips) return refuse(options.frame + ": " + strips.error().reason);
  const auto written = write_octets(options.file, *strips);
  return written ? whole : refuse(written.error().reason);
}

int run(const Options& options) {
  if (!options.frame.empty()) return pack_frame(options);
  const auto content = read_file(options.file, file_octets_max);
  if (!content) return refuse(content.error().message);
  if (const auto stars = decode_star_list(as_octets(*content))) return print_stars(*stars);
  if (content->starts_with("SRFSTARS"))
    return refuse(options.file + ": " + decode_star_list(as_octets(*content)).error().reason);
  if (is_photograph(as_octets(*content))) return convert(options, as_octets(*content));
  return unpack_strips(options, as_octets(*content));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Converts products of image_processing into files for other programs: a frame in strips (*.strips) "
      "into FITS and PNG, a list of stars (stars.bin) into CSV on standard output. Lists missing strips. "
      "Also "
      "makes FITS that the spacecraft reads of other FITS, TIFF, PNG and JPEG."};
  Options options;
  app.add_option("FILE", options.file, "Product (strips or a list of stars), or a picture")->required();
  app.add_option("--out", options.fits, "Write the frame as 16-bit FITS");
  app.add_option("--png", options.png, "Write the frame as PNG, stretched for viewing");
  app.add_option("--pack", options.frame,
                 "The reverse: write this frame (FITS, TIFF, PNG, JPEG) to FILE in strips");
  app.set_version_flag("--version", srfs::version());
  app.footer(
      "Exit code 0: complete; 1: a file cannot be read or written; 2: unknown option; 3: strips are missing, "
      "the rest is written.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? whole : bad_usage;
  }
  try {
    return run(options);
  } catch (const std::bad_alloc&) {
    return refuse("not enough memory for this frame");
  }
}
