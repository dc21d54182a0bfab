// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "image/defect_map.hpp"
#include "image/frame.hpp"

/// What a detector adds to each pixel, and how it responds: master frames, made in orbit from frames of the
/// same kind and taken out of the frames that are searched.
namespace srfs::image {

enum class MasterKind : std::uint8_t {
  dark,  ///< frames without light: ADU of each pixel
  flat   ///< frames lit evenly, without their dark: response of each pixel beside the middle one's
};
[[nodiscard]] const char* to_text(MasterKind kind);

/// How a detector was set when it took a frame.
struct DetectorSetting {
  int width = 0;
  int height = 0;
  std::optional<double> exposure_s;
  std::optional<double> gain;
  std::optional<double> temperature_k;
};
[[nodiscard]] DetectorSetting setting_of(const Frame& frame);
/// As in "640 x 480 px, 0.1 s, gain 6, 291 K", without what is not known.
[[nodiscard]] std::string to_text(const DetectorSetting& setting);

/// Whether a master made at one setting belongs to frames of the other. Both need the same size. A dark also
/// needs the same exposure within 2 % (an unknown one fits only unknown ones), and where both know them the
/// same gain and a temperature within 5 K. It is never scaled to another exposure: only what is above the
/// bias grows with it, and the bias is not known.
[[nodiscard]] bool fits(MasterKind kind, const DetectorSetting& master, const DetectorSetting& frame);

struct Master {
  MasterKind kind = MasterKind::dark;
  Plane level;                ///< NaN: a pixel that says nothing
  int frames = 0;             ///< that it was made of
  std::uint32_t defects = 0;  ///< pixels without a level because they are not as their neighbours
  DetectorSetting setting;    ///< of the first frame
};

/// Makes a master of frames, one at a time: the mean of each pixel without its highest and its lowest value,
/// so that no particle counts. 12 octets a pixel, however many frames.
class MasterMaker {
 public:
  explicit MasterMaker(MasterKind kind) : kind_(kind) {}

  /// A flat's saturated pixels get no level: they do not show how they respond.
  /// @return why a frame is not taken: its setting, no values, no light (flat), most of it saturated (a dark
  /// only by the saturation that its file names), too many frames
  [[nodiscard]] Result<void, Refusal> add(const Frame& frame);
  [[nodiscard]] int frames() const { return frames_; }

  struct Made {
    Master master;
    /// The strongest first. Beyond defects_listed_most the weakest are not listed; they count and have no
    /// level all the same.
    std::vector<Defect> defects;
  };
  /// The next frame begins another master.
  /// @return why there is none: fewer than frames_least, or more defects than a detector has
  [[nodiscard]] Result<Made, Refusal> finish();

  static constexpr int frames_least = 3;
  static constexpr int frames_most = 1000;
  static constexpr std::size_t defects_listed_most = 10'000;
  static constexpr double defects_share_most = 0.1;  ///< of the pixels

 private:
  [[nodiscard]] Result<Made, Refusal> made();
  /// Leaves the means in the sums. @return how far a pixel's values are from each other, ADU
  [[nodiscard]] float average();
  [[nodiscard]] bool is_defect(float value, float around, float limit) const;
  /// Takes their level from the defects.
  void find_defects(float limit, Made& made) const;

  MasterKind kind_;
  Plane sum_;
  Plane lowest_;
  Plane highest_;
  int frames_ = 0;
  float step_ = 0;
  DetectorSetting setting_;
};

/// Which masters a method's frames get.
struct MastersUsed {
  bool dark = false;
  bool flat = false;
  bool needs_dark = false;  ///< a frame that none fits is refused
};

/// Takes @p dark away and divides by @p flat, where there is one. A pixel without a level has no value then,
/// saturated or not; other saturated pixels stay saturated.
/// @pre both have the frame's size
void calibrate(const Master* dark, const Master* flat, Frame& frame);

}  // namespace srfs::image
