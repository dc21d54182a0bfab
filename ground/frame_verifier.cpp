// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/frame_verifier.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "base/crc32c.hpp"
#include "ground/uplink.hpp"

namespace srfs::ground {
namespace {

constexpr std::size_t floor_check_octets = 4;
constexpr std::size_t floor_file_octets = sizeof(std::uint64_t) + floor_check_octets;

/// An odd number is twice the milliseconds of UTC, and one.
std::optional<UtcTime> time_in(std::uint64_t number) {
  if (number % 2 == 0) return std::nullopt;
  return UtcTime(milliseconds(static_cast<std::int64_t>(number / 2)));
}

FrameVerdict verdict_of(wire::TmSdlsError error) {
  return error == wire::TmSdlsError::bad_header_pointer ? FrameVerdict::malformed : FrameVerdict::forged;
}

}  // namespace

std::string_view to_text(FrameVerdict verdict) {
  switch (verdict) {
    case FrameVerdict::verified:
      return "verified";
    case FrameVerdict::forged:
      return "forged";
    case FrameVerdict::replayed:
      return "replayed";
    case FrameVerdict::too_old:
      return "too old";
    case FrameVerdict::malformed:
      return "malformed";
  }
  return "?";
}

FrameVerdict FrameVerifier::verify(OctetView octets, wire::TmFrame& frame, UtcTime now) {
  const FrameVerdict verdict = judge(octets, frame, now);
  switch (verdict) {
    case FrameVerdict::verified:
      ++counters_.verified;
      break;
    case FrameVerdict::forged:
      ++counters_.forged;
      break;
    case FrameVerdict::replayed:
      ++counters_.replayed;
      break;
    case FrameVerdict::too_old:
      ++counters_.too_old;
      break;
    case FrameVerdict::malformed:
      ++counters_.malformed;
      break;
  }
  return verdict;
}

FrameVerdict FrameVerifier::judge(OctetView octets, wire::TmFrame& frame, UtcTime now) {
  wire::TmFrame opened = frame;
  const auto number = wire::tm_sdls_open(octets, opened, settings_.spi, authenticator_);
  if (!number) return verdict_of(number.error());
  if (*number < settings_.floor) return FrameVerdict::replayed;
  const auto sent = time_in(*number);
  const bool is_judged = sent && settings_.age_max > seconds(0);
  if (is_judged && now - *sent > settings_.age_max) return FrameVerdict::too_old;
  settings_.floor = *number + 1;
  frame = std::move(opened);
  return FrameVerdict::verified;
}

std::string RefusedFrameNews::take(const FrameVerifier::Counters& counters, MonotonicTime now) {
  if (told_at_ && now - *told_at_ < period) return "";
  const FrameVerifier::Counters before = std::exchange(told_, counters);
  std::string text;
  const auto add = [&text](std::uint64_t frames, std::string_view why) {
    if (frames == 0) return;
    text += fmt::format("{}{} {}", text.empty() ? "TM frames refused: " : ", ", frames, why);
  };
  add(counters.forged - before.forged, "not authentic (another sender, or other keys here)");
  add(counters.replayed - before.replayed,
      "authentic, with numbers that were used (a replay; --frames-from when the spacecraft lost its "
      "numbers)");
  add(counters.too_old - before.too_old,
      "authentic and too old (a recording, or a wrong clock here or on board; --frame-age)");
  if (!text.empty()) told_at_ = now;
  return text;
}

Result<FrameFloorFile::Opened, std::string> FrameFloorFile::open(const std::filesystem::path& file) {
  const auto failed = [&file](int error) {
    return Err(fmt::format("{}: cannot be used: {}", file.string(), errno_text(error)));
  };
  std::error_code ec;
  std::filesystem::create_directories(file.parent_path(), ec);
  Fd fd(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!fd) return failed(errno);
  std::array<std::uint8_t, floor_file_octets + 1> octets{};
  const ssize_t got = pread(fd.get(), octets.data(), octets.size(), 0);
  if (got < 0) return failed(errno);
  Opened opened{.file = FrameFloorFile(std::move(fd), file)};
  if (got == 0) return opened;
  OctetReader in(OctetView(octets).first(floor_file_octets));
  const std::uint64_t floor = in.u64();
  const bool whole = got == static_cast<ssize_t>(floor_file_octets) &&
                     in.u32() == crc32c(OctetView(octets).first(sizeof(std::uint64_t))) &&
                     floor <= wire::tm_sdls_number_max + 1;
  opened.damaged = !whole;
  if (whole) opened.floor = floor;
  return opened;
}

Result<void, std::string> FrameFloorFile::write(std::uint64_t floor) {
  OctetWriter out(floor_file_octets);
  out.u64(floor);
  out.u32(crc32c(out.view()));
  const ssize_t put = pwrite(fd_.get(), out.view().data(), floor_file_octets, 0);
  if (put != static_cast<ssize_t>(floor_file_octets))
    return Err(fmt::format("{}: the floor of frame numbers is not stored: {}", path_.string(),
                           errno_text(put < 0 ? errno : ENOSPC)));
  written_ = true;
  return {};
}

void FrameFloorFile::sync(MonotonicTime now) {
  if (!written_ || now - synced_at_ < seconds(1)) return;
  synced_at_ = now;
  written_ = false;
  static_cast<void>(fdatasync(fd_.get()));  // what a power failure may cost, the next write makes good
}

Result<FrameTrust, std::string> open_frame_trust(const suite::LinkSettings& link,
                                                 const std::filesystem::path& var_dir,
                                                 const std::filesystem::path& state_dir,
                                                 const FrameTrustOptions& options) {
  FrameTrust trust{.unverified = options.unverified};
  if (!link.tm_security) return trust;
  auto key = read_link_key(var_dir / link.tm_security->key_file);
  if (!key && options.unverified == UnverifiedFrames::dropped)
    return Err(fmt::format(
        "{} (without it no telemetry is verified; --unverified mark shows it all the same)", key.error()));
  auto opened = FrameFloorFile::open(state_dir / "frame_floor");
  if (!opened) return Err(opened.error());
  if (opened->damaged)
    trust.warning =
        "the floor of frame numbers was damaged: a recording of the last minutes may be taken for new";
  std::uint64_t floor = opened->floor;
  if (options.from)
    floor = 2 * static_cast<std::uint64_t>(std::max<std::int64_t>(options.from->ns(), 0) / 1'000'000);
  if (!key) {
    trust.warning = key.error();
    return trust;
  }
  auto authenticator = wire::TmAuthenticator::create(std::move(*key));
  if (!authenticator) return Err(std::string("the cipher of TM frames cannot be used"));
  trust.verifier.emplace(FrameVerifier::Settings{.spi = static_cast<std::uint16_t>(link.tm_security->spi),
                                                 .floor = floor,
                                                 .age_max = options.age_max},
                         std::move(*authenticator));
  trust.floor_file = std::move(opened->file);
  return trust;
}

}  // namespace srfs::ground
