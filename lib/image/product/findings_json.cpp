// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/product/findings_json.hpp"

#include <cmath>

#include "base/time.hpp"
#include "image/product/tracking_message.hpp"

namespace srfs::image {
namespace {

double rounded(double value, double unit) {
  return std::round(value / unit) * unit;
}

Json utc_json(const std::optional<double>& seconds) {
  const auto time = utc_of(seconds);
  return time ? Json(to_iso8601(*time, 6)) : Json(nullptr);
}

Json to_json(const SkyPlace& p) {
  return {{"ra_deg", rounded(p.ra_deg, 1e-7)},
          {"dec_deg", rounded(p.dec_deg, 1e-7)},
          {"sigma_east_arcsec", rounded(p.sigma_east_arcsec, 1e-3)},
          {"sigma_north_arcsec", rounded(p.sigma_north_arcsec, 1e-3)},
          {"correlation", rounded(p.correlation, 1e-3)}};
}

void add(Json& json, const std::optional<Magnitude>& magnitude) {
  if (!magnitude) return;
  json["magnitude"] = rounded(magnitude->value, 1e-3);
  json["sigma_magnitude"] = rounded(magnitude->sigma, 1e-3);
}

Json to_json(const SkyTrail& t) {
  Json json{{"first", to_json(t.first)},
            {"last", to_json(t.last)},
            {"middle", to_json(t.middle)},
            {"directed", t.is_directed},
            {"begin", utc_json(t.begin_s)},
            {"end", t.begin_s && t.exposure_s ? utc_json(*t.begin_s + *t.exposure_s) : Json(nullptr)}};
  add(json, t.magnitude);
  return json;
}

Json to_json(const SkyPoint& p) {
  Json json = to_json(p.place);
  const auto time = time_of(p);
  json["utc"] = time ? Json(to_iso8601(*time, 6)) : Json(nullptr);
  add(json, p.magnitude);
  return json;
}

}  // namespace

Json to_json(const Star& s, int frame) {
  return {{"frame", frame},
          {"x", rounded(s.x, 1e-4)},
          {"y", rounded(s.y, 1e-4)},
          {"flux", rounded(s.flux, 1e-2)},
          {"snr", rounded(s.snr, 1e-3)},
          {"fwhm", rounded(s.fwhm_px, 1e-3)},
          {"flags", s.flags}};
}

Json to_json(const Streak& s, int frame) {
  Json json{{"frame", frame},
            {"x1", rounded(s.x1, 1e-3)},
            {"y1", rounded(s.y1, 1e-3)},
            {"x2", rounded(s.x2, 1e-3)},
            {"y2", rounded(s.y2, 1e-3)},
            {"snr", rounded(s.snr, 1e-3)},
            {"flux", rounded(s.flux, 1e-2)},
            {"width", rounded(s.width_px, 1e-3)},
            {"raggedness", rounded(s.raggedness, 1e-3)}};
  if (s.sky) json["sky"] = to_json(*s.sky);
  return json;
}

static Json to_json(const TrackPoint& p) {
  Json point{{"frame", p.frame},
             {"x", rounded(p.x, 1e-3)},
             {"y", rounded(p.y, 1e-3)},
             {"snr", rounded(p.snr, 1e-3)}};
  if (p.streak) {
    point["x1"] = rounded(p.streak->x1, 1e-3), point["y1"] = rounded(p.streak->y1, 1e-3);
    point["x2"] = rounded(p.streak->x2, 1e-3), point["y2"] = rounded(p.streak->y2, 1e-3);
  }
  if (p.sky) point["sky"] = to_json(*p.sky);
  if (p.streak && p.streak->sky) point["trail"] = to_json(*p.streak->sky);
  return point;
}

Json to_json(const Tracklet& t) {
  Json points = Json::array();
  for (const TrackPoint& p : t.points) points.push_back(to_json(p));
  return {{"x", rounded(t.x0, 1e-3)},   {"y", rounded(t.y0, 1e-3)},    {"vx", rounded(t.vx, 1e-5)},
          {"vy", rounded(t.vy, 1e-5)},  {"snr", rounded(t.snr, 1e-3)}, {"rms", rounded(t.rms_px, 1e-4)},
          {"points", std::move(points)}};
}

Json to_json(const FrameRegistration& r) {
  if (!r.registered) return nullptr;
  const FrameTransform& t = r.registration.to_reference;
  return {{"dx", rounded(t.shift_x, 1e-4)},
          {"dy", rounded(t.shift_y, 1e-4)},
          {"a", t.a},
          {"b", t.b},
          {"stars", r.registration.stars},
          {"rms", rounded(r.registration.rms_px, 1e-4)}};
}

static Json to_json(const Lens& lens) {
  return {{"focal_px", rounded(lens.focal_px, 1e-3)},
          {"axis_x", rounded(lens.axis_x, 1e-3)},
          {"axis_y", rounded(lens.axis_y, 1e-3)},
          {"k1", rounded(lens.k1, 1e-7)},
          {"k2", rounded(lens.k2, 1e-7)}};
}

Json to_json(const std::optional<Attitude>& a) {
  if (!a) return nullptr;
  return {{"ra_deg", rounded(a->ra_deg, 1e-6)},
          {"dec_deg", rounded(a->dec_deg, 1e-6)},
          {"roll_deg", rounded(a->roll_deg, 1e-5)},
          {"scale_arcsec_px", rounded(a->scale_arcsec_px, 1e-5)},
          {"mirrored", a->mirrored},
          {"stars", a->stars},
          {"rms_arcsec", rounded(a->rms_arcsec, 1e-3)},
          {"rms_px", rounded(a->rms_px, 1e-4)},
          {"field_deg", rounded(a->field_deg, 1e-5)},
          {"distortion", rounded(a->lens.k1 + a->lens.k2, 1e-6)},
          {"lens", to_json(a->lens)}};
}

Json to_json(const Defect& d) {
  return {{"x", d.x},
          {"y", d.y},
          {"kind", d.kind == Defect::Kind::hot ? "hot" : "dark"},
          {"level", rounded(d.level_adu, 1e-2)},
          {"frames", d.frames}};
}

Json to_json(const StoredMaster& master) {
  const auto or_null = [](const std::optional<double>& value) { return value ? Json(*value) : Json(); };
  const DetectorSetting& setting = master.setting;
  return {{"kind", to_text(master.kind)},
          {"generation", master.generation},
          {"frames", master.frames},
          {"defects", master.defects},
          {"exposure", or_null(setting.exposure_s)},
          {"gain", or_null(setting.gain)},
          {"temperature_k", or_null(setting.temperature_k)},
          {"sha256", master.sha256}};
}

Json frame_summary(const std::string& file, const Frame& frame, const FrameFindings& found) {
  return {{"file", file},
          {"width", frame.pixels.width()},
          {"height", frame.pixels.height()},
          {"background", rounded(found.background, 1e-3)},
          {"noise", rounded(found.noise, 1e-3)},
          {"fwhm", rounded(found.fwhm_px, 1e-3)},
          {"stars", found.stars.size()},
          {"streaks", found.streaks.size()},
          {"spikes", found.spikes},
          {"saturated", found.saturated},
          {"invalid", found.invalid},
          {"notes", found.notes},
          {"solution", to_json(found.attitude)}};
}

void name_masters(const Calibrator::Applied& applied, Json& summary) {
  if (applied.dark) summary["dark"] = *applied.dark;
  if (applied.flat) summary["flat"] = *applied.flat;
}

}  // namespace srfs::image
