// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/file/fits.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "base/text.hpp"
#include "image/file/rice.hpp"
#include "image/simd.hpp"

namespace srfs::image {
namespace {

constexpr std::size_t card_octets = 80;
constexpr std::size_t block_octets = 2880;
constexpr std::size_t header_octets_most = 100 * block_octets;
constexpr std::size_t descriptor_octets = 8;  // of a row in the table: length and place of what it packs to
constexpr int value_bits = 16;
constexpr std::int64_t unsigned_zero = 32768;  // FITS has signed numbers only: unsigned ones are moved

template <class... Args>
tl::unexpected<Refusal> refuse(fmt::format_string<Args...> format, Args&&... args) {
  return Err(Refusal{"FITS: " + fmt::format(format, std::forward<Args>(args)...)});
}

std::size_t whole_blocks(std::size_t octets) {
  return (octets + block_octets - 1) / block_octets * block_octets;
}

// --- reading

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return text;
}

template <class T>
std::optional<T> number(std::string_view text) {
  return to_number<T>(text.starts_with('+') ? text.substr(1) : text);
}

/// The lines of a header, up to END.
class Header {
 public:
  static Result<Header, Refusal> read(OctetView content) {
    const std::string_view text = as_text(content).substr(0, header_octets_most);
    for (std::size_t at = 0; at + card_octets <= text.size(); at += card_octets) {
      if (trimmed(text.substr(at, card_octets)) == "END") return Header(text.substr(0, at));
    }
    return refuse("a header without END in the first {} octets", text.size());
  }

  /// What follows it.
  [[nodiscard]] OctetView behind(OctetView content) const {
    return content.subspan(std::min(content.size(), whole_blocks(cards_.size() + card_octets)));
  }
  [[nodiscard]] bool has(std::string_view key) const { return find(key).has_value(); }
  /// The value of a key, a text without its quotes. @param otherwise  where there is no such key
  [[nodiscard]] std::string_view text(std::string_view key) const {
    const std::string_view value = find(key).value_or("");
    if (!value.starts_with('\'')) return trimmed(value.substr(0, value.find('/')));
    return trimmed(value.substr(1, value.find('\'', 1) - 1));
  }
  [[nodiscard]] std::int64_t whole(std::string_view key, std::int64_t otherwise) const {
    return has(key) ? number<std::int64_t>(text(key)).value_or(-1) : otherwise;
  }
  [[nodiscard]] double real(std::string_view key, double otherwise) const {
    return has(key) ? number<double>(text(key)).value_or(NAN) : otherwise;
  }

 private:
  explicit Header(std::string_view cards) : cards_(cards) {}
  [[nodiscard]] std::optional<std::string_view> find(std::string_view key) const {
    const std::string begin = fmt::format("{:<8}= ", key);
    for (std::size_t at = 0; at < cards_.size(); at += card_octets) {
      const std::string_view card = cards_.substr(at, card_octets);
      if (card.starts_with(begin)) return trimmed(card.substr(begin.size()));
    }
    return std::nullopt;
  }

  std::string_view cards_;
};

/// Seconds of a date as FITS has it: 2026-11-22T07:52:30.25.
std::optional<double> seconds_of(std::string_view text) {
  if (text.size() < 19 || text[4] != '-' || text[7] != '-' || text[10] != 'T' || text[13] != ':' ||
      text[16] != ':')
    return std::nullopt;
  const auto year = number<int>(text.substr(0, 4));
  const auto month = number<unsigned>(text.substr(5, 2));
  const auto day = number<unsigned>(text.substr(8, 2));
  const auto hour = number<int>(text.substr(11, 2));
  const auto minute = number<int>(text.substr(14, 2));
  const auto second = number<double>(text.substr(17));
  if (!year || !month || !day || !hour || !minute || !second || !std::isfinite(*second)) return std::nullopt;
  const auto date = std::chrono::year{*year} / std::chrono::month{*month} / std::chrono::day{*day};
  if (!date.ok()) return std::nullopt;
  const auto days = static_cast<double>(std::chrono::sys_days{date}.time_since_epoch().count());
  return 86400 * days + 3600 * *hour + 60 * *minute + *second;
}

/// An image as its header describes it.
struct Layout {
  std::int64_t width;
  std::int64_t height;
  float zero;  ///< what is added to each number of the file
};

/// @param prefix  of the keys: a table that holds an image describes it with a Z
Result<Layout, Refusal> layout_of(const Header& header, const std::string& prefix) {
  const std::int64_t axes = header.whole(prefix + "NAXIS", 0);
  const std::int64_t bits = header.whole(prefix + "BITPIX", 0);
  if (axes != 2 || bits != value_bits)
    return refuse("an image of {} axes and {} bits a pixel; expected 2 and {}", axes, bits, value_bits);
  const double zero = header.real("BZERO", 0);
  if (header.real("BSCALE", 1) != 1 || (zero != 0 && zero != unsigned_zero))
    return refuse("BSCALE is not 1, or BZERO neither 0 nor {}", unsigned_zero);
  if (header.has("BLANK") || header.has("ZBLANK")) return refuse("pixels without a value (BLANK)");
  const Layout layout{header.whole(prefix + "NAXIS1", 0), header.whole(prefix + "NAXIS2", 0),
                      static_cast<float>(zero)};
  if (auto refusal = refuse_size(layout.width, layout.height)) return Err(std::move(*refusal));
  return layout;
}

SRFS_VECTORISED
void take_big_endian(const std::uint8_t* in, std::uint16_t* out, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) out[i] = static_cast<std::uint16_t>((in[2 * i] << 8) | in[2 * i + 1]);
}

SRFS_VECTORISED
void to_adu(const std::uint16_t* in, float* out, std::size_t n, float zero) {
  for (std::size_t i = 0; i < n; ++i) out[i] = static_cast<float>(static_cast<std::int16_t>(in[i])) + zero;
}

/// A frame without pixels yet: what the header says beside them.
Frame frame_of(const Header& header, const Layout& layout) {
  Frame frame;
  frame.pixels = Plane::unset(static_cast<int>(layout.width), static_cast<int>(layout.height));
  frame.step = 1;
  const double saturation = header.real("SATURATE", NAN);
  if (std::isfinite(saturation)) frame.saturation_adu = static_cast<float>(saturation);
  frame.time_s = seconds_of(header.text("DATE-OBS"));
  const double exposure_s = header.real("EXPTIME", NAN);
  if (std::isfinite(exposure_s) && exposure_s >= 0) frame.exposure_s = exposure_s;
  const double gain = header.real("GAIN", NAN);
  if (std::isfinite(gain)) frame.gain = gain;
  const double celsius = header.real("CCD-TEMP", NAN);
  if (std::isfinite(celsius)) frame.temperature_k = celsius + ice_point_k;
  return frame;
}

Result<Frame, Refusal> decode_plain(const Header& header, OctetView data) {
  const auto layout = layout_of(header, "");
  if (!layout) return Err(layout.error());
  const std::size_t row_octets = 2 * static_cast<std::size_t>(layout->width);
  const std::size_t octets = row_octets * static_cast<std::size_t>(layout->height);
  if (data.size() < octets)
    return refuse("the header announces {} octets of pixels, the file has {}", octets, data.size());
  Frame frame = frame_of(header, *layout);
  std::vector<std::uint16_t> row(static_cast<std::size_t>(layout->width));
  for (int y = 0; y < frame.pixels.height(); ++y) {
    take_big_endian(data.data() + static_cast<std::size_t>(y) * row_octets, row.data(), row.size());
    to_adu(row.data(), frame.pixels.row(y), row.size(), layout->zero);
  }
  return frame;
}

/// @return why a table is not one of packed rows as encode_packed_fits() makes them
std::optional<std::string> why_not_rows(const Header& table, const Layout& layout) {
  if (table.text("ZCMPTYPE") != "RICE_1") return "the image is packed otherwise than RICE_1";
  if (table.text("ZNAME1") != "BLOCKSIZE" || table.whole("ZVAL1", 0) != rice_block ||
      table.text("ZNAME2") != "BYTEPIX" || table.whole("ZVAL2", 0) != value_bits / 8)
    return "other parameters than BLOCKSIZE 32, BYTEPIX 2";
  if (table.whole("ZTILE1", layout.width) != layout.width || table.whole("ZTILE2", 1) != 1)
    return "tiles that are not rows";
  if (table.whole("TFIELDS", 0) != 1 || !table.text("TFORM1").starts_with("1PB") ||
      table.whole("NAXIS1", 0) != descriptor_octets || table.whole("NAXIS2", 0) != layout.height)
    return "the table has other columns or rows than the image needs";
  if (table.whole("THEAP", 0) != 0 && table.whole("THEAP", 0) != 8 * layout.height)
    return "the table has a gap before its rows";
  return std::nullopt;
}

Result<Frame, Refusal> decode_packed(const Header& table, OctetView data) {
  if (table.text("XTENSION") != "BINTABLE" || table.text("ZIMAGE") != "T")
    return refuse("neither an image nor a table that holds one");
  const auto layout = layout_of(table, "Z");
  if (!layout) return Err(layout.error());
  if (const auto why = why_not_rows(table, *layout)) return refuse("{}", *why);
  const auto width = static_cast<std::size_t>(layout->width);
  const std::size_t table_octets = descriptor_octets * static_cast<std::size_t>(layout->height);
  // Four bits at least for each 32 pixels: what announces more is not unpacked.
  const std::size_t least =
      table_octets + static_cast<std::size_t>(layout->height) * (width / rice_block) / 2;
  if (data.size() < least)
    return refuse("the header announces {} x {} pixels, the file has {} octets", layout->width,
                  layout->height, data.size());
  const OctetView heap = data.subspan(table_octets);
  std::size_t left =
      heap.size();  // rows share nothing, so that unpacking costs no more than the file is long
  OctetReader descriptors(data.first(table_octets));
  Frame frame = frame_of(table, *layout);
  std::vector<std::uint16_t> row(width);
  for (int y = 0; y < frame.pixels.height(); ++y) {
    const std::size_t octets = descriptors.u32();
    const std::size_t at = descriptors.u32();
    if (at > heap.size() || octets > heap.size() - at)
      return refuse("row {} is beyond the end of the file", y);
    if (octets > left) return refuse("rows up to {} have more octets than the file", y);
    left -= octets;
    if (!unpack_rice(heap.subspan(at, octets), row)) return refuse("row {} is damaged", y);
    to_adu(row.data(), frame.pixels.row(y), width, layout->zero);
  }
  return frame;
}

// --- writing

std::string quoted(const std::string& text) {
  constexpr std::size_t most = 69;  // with the first quote
  std::string out = "'";
  for (const char c : text) {
    const std::string_view one = c == '\'' ? std::string_view("''") : std::string_view(&c, 1);
    if (out.size() + one.size() > most) break;
    out += one;
  }
  out.resize(std::max<std::size_t>(out.size(), 9), ' ');
  return out + "'";
}

std::string value_of(const FitsCard& card) {
  if (const auto* flag = std::get_if<bool>(&card.value)) return fmt::format("{:>20}", *flag ? "T" : "F");
  if (const auto* text = std::get_if<std::string>(&card.value)) return quoted(*text);
  if (const auto* whole = std::get_if<std::int64_t>(&card.value)) return fmt::format("{:>20}", *whole);
  const double real = std::get<double>(card.value);
  std::string text = std::isfinite(real) ? fmt::format("{}", real) : "";
  std::replace(text.begin(), text.end(), 'e', 'E');
  return fmt::format("{:>20}", text);
}

void append(std::string& header, const FitsCard& card) {
  std::string line = fmt::format("{:<8.8}= {}", card.key, value_of(card));
  if (!card.comment.empty()) line += " / " + card.comment;
  line.resize(card_octets, ' ');
  header += line;
}

void append(std::string& header, std::string_view key, std::int64_t value) {
  append(header, {std::string(key), value});
}

/// Fills the last block. @param with  of a header: spaces; of data: zeros
void end_block(Octets& file, std::uint8_t with) {
  file.resize(whole_blocks(file.size()), with);
}

void append_header(Octets& file, std::string header, std::span<const FitsCard> cards) {
  append(header, "BZERO", unsigned_zero);
  append(header, "BSCALE", 1);
  for (const FitsCard& card : cards) append(header, card);
  header += "END";
  file.insert(file.end(), header.begin(), header.end());
  end_block(file, ' ');
}

/// An empty first part, which must not be a table.
Octets first_part() {
  std::string header;
  append(header, {"SIMPLE", true});
  append(header, "BITPIX", value_bits);
  append(header, "NAXIS", 0);
  append(header, {"EXTEND", true});
  header += "END";
  Octets file(header.begin(), header.end());
  end_block(file, ' ');
  return file;
}

/// @param longest  octets of a row
std::string header_of_rows(int width, int height, std::size_t heap_octets, std::size_t longest) {
  std::string header;
  append(header, {"XTENSION", std::string("BINTABLE")});
  append(header, "BITPIX", 8);
  append(header, "NAXIS", 2);
  append(header, "NAXIS1", descriptor_octets);
  append(header, "NAXIS2", height);
  append(header, "PCOUNT", static_cast<std::int64_t>(heap_octets));
  append(header, "GCOUNT", 1);
  append(header, "TFIELDS", 1);
  append(header, {"TTYPE1", std::string("COMPRESSED_DATA")});
  append(header, {"TFORM1", fmt::format("1PB({})", longest)});
  append(header, {"ZIMAGE", true});
  append(header, {"ZSIMPLE", true});
  append(header, "ZBITPIX", value_bits);
  append(header, "ZNAXIS", 2);
  append(header, "ZNAXIS1", width);
  append(header, "ZNAXIS2", height);
  append(header, "ZTILE1", width);
  append(header, "ZTILE2", 1);
  append(header, {"ZCMPTYPE", std::string("RICE_1")});
  append(header, {"ZNAME1", std::string("BLOCKSIZE")});
  append(header, "ZVAL1", rice_block);
  append(header, {"ZNAME2", std::string("BYTEPIX")});
  append(header, "ZVAL2", value_bits / 8);
  return header;
}

}  // namespace

std::string fits_date(UtcTime time) {
  std::string date = to_iso8601(time, 6);
  if (date.ends_with('Z')) date.pop_back();
  return date;
}

Result<Frame, Refusal> decode_fits(OctetView content) try {
  constexpr std::string_view magic = "SIMPLE  =";
  if (content.empty()) return Err(Refusal{"the file is empty"});
  if (!std::equal(magic.begin(), magic.end(), content.begin(),
                  content.begin() + static_cast<std::ptrdiff_t>(std::min(content.size(), magic.size()))))
    return Err(Refusal{"not a FITS file; srfs-product makes one of TIFF, PNG and JPEG"});
  const auto header = Header::read(content);
  if (!header) return Err(header.error());
  if (header->text("SIMPLE") != "T") return refuse("SIMPLE is not T");
  const OctetView rest = header->behind(content);
  if (header->whole("NAXIS", -1) != 0) return decode_plain(*header, rest);
  if (rest.empty()) return refuse("no image in the file");
  const auto table = Header::read(rest);
  if (!table) return Err(table.error());
  return decode_packed(*table, table->behind(rest));
} catch (const std::bad_alloc&) {
  return Err(Refusal{"not enough memory for this frame"});
}

Octets encode_fits(const Plane& pixels, std::span<const FitsCard> cards) {
  std::string header;
  append(header, {"SIMPLE", true});
  append(header, "BITPIX", value_bits);
  append(header, "NAXIS", 2);
  append(header, "NAXIS1", pixels.width());
  append(header, "NAXIS2", pixels.height());
  Octets file;
  file.reserve(2 * pixels.size() + whole_blocks(header.size() + (cards.size() + 3) * card_octets) +
               block_octets);
  append_header(file, std::move(header), cards);
  for (const float v : pixels.cells()) {
    const long rounded = std::isfinite(v) ? std::lround(std::clamp(v, 0.0F, 65535.0F)) : 0;
    const auto stored = static_cast<std::uint16_t>(rounded - unsigned_zero);
    file.push_back(static_cast<std::uint8_t>(stored >> 8));
    file.push_back(static_cast<std::uint8_t>(stored & 0xFF));
  }
  end_block(file, 0);
  return file;
}

Result<Octets, Refusal> encode_packed_fits(const Grid<std::uint16_t>& pixels,
                                           std::span<const FitsCard> cards) try {
  if (pixels.empty()) return refuse("a frame without pixels");
  const auto width = static_cast<std::size_t>(pixels.width());
  OctetWriter descriptors(descriptor_octets * static_cast<std::size_t>(pixels.height()));
  Octets heap;
  heap.reserve(pixels.size());  // eight bits a pixel is what noise packs to
  std::vector<std::uint16_t> row(width);
  std::size_t longest = 0;
  for (int y = 0; y < pixels.height(); ++y) {
    const std::uint16_t* const values = pixels.row(y);
    for (std::size_t x = 0; x < width; ++x) row[x] = static_cast<std::uint16_t>(values[x] - unsigned_zero);
    const std::size_t at = heap.size();
    pack_rice(row, heap);
    longest = std::max(longest, heap.size() - at);
    descriptors.u32(static_cast<std::uint32_t>(heap.size() - at));
    descriptors.u32(static_cast<std::uint32_t>(at));
  }
  Octets file = first_part();
  append_header(file, header_of_rows(pixels.width(), pixels.height(), heap.size(), longest), cards);
  for (const OctetView part : {descriptors.view(), OctetView(heap)})
    file.insert(file.end(), part.begin(), part.end());
  end_block(file, 0);
  return file;
} catch (const std::bad_alloc&) {
  return refuse("not enough memory for this frame");
}

}  // namespace srfs::image
