// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_processing/findings_report.hpp"

#include <algorithm>

namespace srfs {
namespace {

using image::Json;

constexpr std::size_t summaries_share = 4;
constexpr std::size_t room_for_counts = 40;  // digits of what is left out

/// Fills lists of an object as long as there is room.
class Filler {
 public:
  Filler(Json& object, std::size_t room) : object_(object), room_(room) {}

  [[nodiscard]] std::size_t room() const { return room_; }
  /// @param at_most  octets of this list
  template <class List, class ToJson>
  void fill(const char* name, const List& list, std::size_t at_most, const ToJson& to_json) {
    std::size_t allowed = std::min(at_most, room_);
    std::size_t taken = 0;
    for (const auto& item : list) {
      Json json = to_json(item);
      const std::size_t octets = dumped(json).size() + 1;
      if (octets > allowed) break;
      allowed -= octets;
      room_ -= octets;
      object_[name].push_back(std::move(json));
      ++taken;
    }
    if (taken < list.size()) object_["left_out"][name] = list.size() - taken;
  }
  /// Texts come from files: what is no UTF-8 is replaced.
  static std::string dumped(const Json& json) {
    return json.dump(-1, ' ', false, Json::error_handler_t::replace);
  }

 private:
  Json& object_;
  std::size_t room_;
};

}  // namespace

std::optional<std::string> findings_text(const TaskFindings& findings, std::size_t budget) {
  Json object{
      {"task", findings.task},
      {"method", findings.method},
      {"parameters", findings.parameters},
      {"frame_count", findings.frames.size()},
      {"solution", image::to_json(findings.attitude)},
      {"calibration", Json::array()},
      {"master", findings.master ? image::to_json(*findings.master) : Json()},
      {"tracklets", Json::array()},
      {"streaks", Json::array()},
      {"defects", Json::array()},
      {"frames", Json::array()},
      {"refused", Json::array()},
      {"left_out", {{"tracklets", 0}, {"streaks", 0}, {"defects", 0}, {"frames", 0}, {"refused", 0}}}};
  for (const image::StoredMaster& m : findings.calibration)
    object["calibration"].push_back(image::to_json(m));
  const std::size_t least = Filler::dumped(object).size() + room_for_counts;
  if (least > budget) return std::nullopt;
  Filler filler(object, budget - least);
  const auto as_it_is = [](const Json& json) { return json; };
  filler.fill("tracklets", findings.tracklets, filler.room(),
              [](const image::Tracklet& t) { return image::to_json(t); });
  filler.fill("streaks", findings.streaks, filler.room(),
              [](const FoundStreak& s) { return image::to_json(s.streak, s.frame); });
  filler.fill("defects", findings.defects, filler.room(),
              [](const image::Defect& d) { return image::to_json(d); });
  filler.fill("refused", findings.refused, budget / summaries_share, as_it_is);
  filler.fill("frames", findings.frames, budget / summaries_share, as_it_is);
  return Filler::dumped(object);
}

}  // namespace srfs
