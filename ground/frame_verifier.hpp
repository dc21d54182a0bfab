// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "base/fd.hpp"
#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "suite/deployment.hpp"
#include "wire/tm_frame.hpp"

namespace srfs::ground {

enum class FrameVerdict : std::uint8_t {
  verified,
  forged,     ///< not made with the key, or altered
  replayed,   ///< authentic; its number is not higher than all before
  too_old,    ///< authentic; its number is a time that is too long ago
  malformed,  ///< authentic, and no frame of packets
};
[[nodiscard]] std::string_view to_text(FrameVerdict verdict);

/// Whether TM frames are the spacecraft's, and new (ICD 3.4). Pure.
class FrameVerifier {
 public:
  struct Settings {
    std::uint16_t spi = 0;
    std::uint64_t floor = 0;  ///< no lower number is taken
    /// A frame whose number is a time further back is refused; 0: none is. What was recorded behind a jammer,
    /// or since the floor was restored from a copy, is older than that.
    seconds age_max{600};
  };
  struct Counters {
    std::uint64_t verified = 0;
    std::uint64_t forged = 0;
    std::uint64_t replayed = 0;
    std::uint64_t too_old = 0;
    std::uint64_t malformed = 0;
    friend bool operator==(const Counters&, const Counters&) = default;
  };
  FrameVerifier(Settings settings, wire::TmAuthenticator authenticator)
      : settings_(settings), authenticator_(std::move(authenticator)) {}

  /// @param octets  the whole frame. @param frame  as read; when verified, without the security fields, else
  /// unchanged
  /// @param now  of this computer's clock
  [[nodiscard]] FrameVerdict verify(OctetView octets, wire::TmFrame& frame, UtcTime now);
  /// The lowest number that is taken from now on.
  [[nodiscard]] std::uint64_t floor() const { return settings_.floor; }
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  [[nodiscard]] FrameVerdict judge(OctetView octets, wire::TmFrame& frame, UtcTime now);

  Settings settings_;
  wire::TmAuthenticator authenticator_;
  Counters counters_;
};

/// What becomes of frames that cannot be verified.
enum class UnverifiedFrames : std::uint8_t {
  dropped,
  marked,  ///< their packets are Authenticity::unverified; their control words and file PDUs are dropped
};

/// What the operator should know of refused frames: at once, then each minute while there are more. Pure.
class RefusedFrameNews {
 public:
  static constexpr seconds period{60};
  /// @return empty: nothing new
  [[nodiscard]] std::string take(const FrameVerifier::Counters& counters, MonotonicTime now);

 private:
  FrameVerifier::Counters told_;
  std::optional<MonotonicTime> told_at_;
};

/// The floor of frame numbers, in a file of the station's folder. A write costs no wait and outlives a kill
/// of this process; sync() brings it to the medium.
class FrameFloorFile {
 public:
  struct Opened;
  /// @return the error is ready to print
  [[nodiscard]] static Result<Opened, std::string> open(const std::filesystem::path& file);
  /// Before what the frames carried is used: a kill in between loses it, and takes nothing twice.
  [[nodiscard]] Result<void, std::string> write(std::uint64_t floor);
  /// Blocks on the disk; at most once a second, and only after a write.
  void sync(MonotonicTime now);

 private:
  FrameFloorFile(Fd fd, std::filesystem::path path) : fd_(std::move(fd)), path_(std::move(path)) {}
  Fd fd_;
  std::filesystem::path path_;
  bool written_ = false;
  MonotonicTime synced_at_;
};
struct FrameFloorFile::Opened {
  FrameFloorFile file;
  std::uint64_t floor = 0;  ///< 0: there was none
  bool damaged = false;
};

/// How the frames of a link are verified.
struct FrameTrust {
  std::optional<FrameVerifier> verifier =
      {};  ///< nullopt: the link has no authentication, or the key is missing
  std::optional<FrameFloorFile> floor_file = {};
  UnverifiedFrames unverified = UnverifiedFrames::dropped;
  std::string warning = {};  ///< for the operator; empty: all is well
};
struct FrameTrustOptions {
  seconds age_max = FrameVerifier::Settings{}.age_max;
  UnverifiedFrames unverified = UnverifiedFrames::dropped;
  std::optional<UtcTime> from = {};  ///< the floor is the number of this time, whatever is stored
};
/// @param var_dir  where relative key files stand. @param state_dir  where the floor is kept
/// @return the error is ready to print
[[nodiscard]] Result<FrameTrust, std::string> open_frame_trust(const suite::LinkSettings& link,
                                                               const std::filesystem::path& var_dir,
                                                               const std::filesystem::path& state_dir,
                                                               const FrameTrustOptions& options);

}  // namespace srfs::ground
