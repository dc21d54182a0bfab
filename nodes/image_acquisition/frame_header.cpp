// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_acquisition/frame_header.hpp"

#include <algorithm>

namespace srfs {
namespace {

constexpr std::size_t text_max = 60;

/// FITS has printable ASCII only.
std::string plain(const std::string& text) {
  std::string out = text.substr(0, text_max);
  std::replace_if(
      out.begin(), out.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return out;
}

}  // namespace

std::vector<image::FitsCard> frame_header(const hw::CameraFrame& frame, const FrameFacts& facts) {
  const auto& cells = frame.pixels.cells();
  const auto [least, most] = std::minmax_element(cells.begin(), cells.end());
  std::vector<image::FitsCard> cards;
  cards.push_back({"ORIGIN", std::string("SRFS"), ""});
  cards.push_back({"INSTRUME", plain(facts.instrument), ""});
  cards.push_back({"CAMERA", plain(facts.camera), ""});
  cards.push_back({"TASK", std::int64_t{facts.task}, "number of the task"});
  cards.push_back({"FRAME", std::int64_t{facts.number}, "number in the task, from 1"});
  if (facts.begin) {
    cards.push_back({"TIMESYS", std::string("UTC"), ""});
    cards.push_back({"DATE-OBS", image::fits_date(*facts.begin), "start of the exposure"});
  }
  cards.push_back({"EXPTIME", std::chrono::duration<double>(frame.settings.exposure).count(), "s"});
  cards.push_back({"GAIN", frame.settings.gain_db, "dB"});
  cards.push_back({"STARTERR", std::int64_t{facts.start_error_us}, "us, actual minus due start"});
  cards.push_back({"SEQUENCE", std::int64_t{frame.sequence}, "the camera's count"});
  cards.push_back({"DATABITS", std::int64_t{frame.bits}, "bits of a pixel"});
  if (least != cells.end()) {
    cards.push_back({"DATAMIN", std::int64_t{*least}, "ADU"});
    cards.push_back({"DATAMAX", std::int64_t{*most}, "ADU"});
  }
  if (frame.saturation_adu)
    cards.push_back({"SATURATE", std::int64_t{*frame.saturation_adu}, "ADU, saturated from here on"});
  if (frame.temperature_k)
    cards.push_back({"CCD-TEMP", *frame.temperature_k - image::ice_point_k, "deg C, of the sensor"});
  if (facts.attitude) {
    constexpr std::array names{"ATT-X", "ATT-Y", "ATT-Z", "ATT-W"};
    for (std::size_t i = 0; i < names.size(); ++i) {
      cards.push_back(
          {names[i], static_cast<double>(facts.attitude->quaternion[i]), "body to inertial, as measured"});
    }
    cards.push_back({"ATT-AGE", facts.attitude->age_s, "s, before the start of the exposure"});
  }
  return cards;
}

}  // namespace srfs
