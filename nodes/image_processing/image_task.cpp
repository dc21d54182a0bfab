// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_processing/image_task.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <new>

#include <fmt/format.h>
#include <mission/structures.hpp>

#include "base/saturate.hpp"
#include "base/text.hpp"
#include "image/file/frame_file.hpp"
#include "image/file/frame_mark.hpp"
#include "image/product/frame_strips.hpp"
#include "image/product/png.hpp"

namespace srfs {
namespace {

constexpr std::size_t listed_stars_most = 100'000;
constexpr std::size_t longest_stem = 24;
constexpr std::array thumbnail_widths_px{320, 160, 80};

/// Room for the stars of a list in @p octets.
std::size_t stars_in(std::size_t octets) {
  if (octets < image::star_list_header_octets) return 0;
  return std::min((octets - image::star_list_header_octets) / image::listed_star_octets, listed_stars_most);
}

/// Why no method can say anything about a frame.
std::optional<std::string> why_unusable(const image::Frame& frame) {
  const image::Plane& pixels = frame.pixels;
  if (std::min(pixels.width(), pixels.height()) < ImageTask::side_least_px)
    return fmt::format("{} x {} pixels: less than {} a side", pixels.width(), pixels.height(),
                       ImageTask::side_least_px);
  return std::nullopt;
}

std::uint32_t saturated(std::uint32_t a, std::size_t b) {
  return as_u32(std::uint64_t{a} + b);
}

}  // namespace

ImageTask::ImageTask(TaskOrder order, std::filesystem::path images, Limits limits)
    : order_(std::move(order)),
      images_(std::move(images)),
      limits_(limits),
      masters_(images_ / "calibration"),
      stars_(stars_in(order_.request.budget_octets)) {
  findings_.task = order_.request.task;
  findings_.method = order_.request.method;
  findings_.parameters = order_.request.parameters;
  if (order_.method == nullptr) phase_ = Phase::full_frames;
  is_sequence_ = order_.request.method == "tracklet";
}

StepReport ImageTask::step(ProductStore& store) {
  StepReport report;
  try {
    if (!begun_) store.begin(order_.request.task, order_.method != nullptr);
    begun_ = true;
    advance(store, report);
  } catch (const std::bad_alloc&) {
    fail(mission::failure::not_done, "not enough memory");
  }
  return report;
}

void ImageTask::advance(ProductStore& store, StepReport& report) {
  switch (phase_) {
    case Phase::frames:
      process_next(report);
      break;
    case Phase::findings:
      make_findings(store, report);
      break;
    case Phase::cut_outs:
      cut_next(report);
      break;
    case Phase::pictures:
      make_pictures(store, report);
      break;
    case Phase::full_frames:
      pack_next(store, report);
      break;
    case Phase::done:
      break;
  }
}

void ImageTask::fail(std::uint16_t code, std::string reason) {
  failure_ = TaskRefusal{code, std::move(reason)};
}

// ---------------------------------------------------------------- frames

Result<image::Frame, image::Refusal> ImageTask::read(const std::string& file) const {
  const auto path = frame_path(images_, file);
  if (!path) return Err(path.error());
  const image::FramePixelsLimit limit(limits_.frame_pixels);
  // Four octets a pixel, and a header: what is larger holds something else beside the frame.
  std::error_code failed;
  const auto octets = std::filesystem::file_size(*path, failed);
  const auto octets_most = static_cast<std::uintmax_t>(4 * limits_.frame_pixels) + (1U << 20);
  if (!failed && octets > octets_most)
    return Err(image::Refusal{fmt::format("{} octets, more than {}", octets, octets_most)});
  auto frame = image::read_frame(*path);
  if (frame) return frame;
  // Its reason begins with the path.
  std::string why = frame.error().reason;
  if (const std::string prefix = path->string() + ": "; why.starts_with(prefix)) why.erase(0, prefix.size());
  return Err(image::Refusal{std::move(why)});
}

void ImageTask::refuse(const std::string& file, const std::string& why, StepReport& report) {
  ++counts_.frames_refused;
  report.refused.push_back({file, why});
  findings_.refused.push_back({{"file", file}, {"why", why}});
}

void ImageTask::process_next(StepReport& report) {
  const std::string& file = order_.request.files[next_++];
  try {
    // Made here: an index that is built once takes a third of a second. The method last: without memory for
    // the two the next frame begins anew.
    if (!method_) {
      calibrator_.emplace(masters_, order_.method->masters_for(order_.parameters));
      method_ = order_.method->make(order_.parameters);
    }
    process(file, report);
  } catch (const std::bad_alloc&) {
    refuse(file, "not enough memory", report);
  }
  ++counts_.frames_done;
  if (next_ < order_.request.files.size()) return;
  if (used_.empty()) return fail(mission::failure::no_usable_frame, "no frame could be read or used");
  phase_ = Phase::findings;
}

void ImageTask::process(const std::string& file, StepReport& report) {
  auto frame = read(file);
  if (!frame) return refuse(file, frame.error().reason, report);
  if (const auto why = why_unusable(*frame)) return refuse(file, *why, report);
  auto applied = calibrator_->apply(*frame);
  for (std::string& problem : calibrator_->take_problems()) report.problems.push_back(std::move(problem));
  if (!applied) return refuse(file, applied.error().reason, report);
  auto found = method_->process(*frame);
  if (!found) return refuse(file, found.error().reason, report);
  found->notes.insert(found->notes.end(), applied->notes.begin(), applied->notes.end());
  take_findings(file, *frame, *std::move(found), report);
  image::name_masters(*applied, findings_.frames.back());
}

void ImageTask::take_findings(const std::string& file, const image::Frame& frame, image::FrameFindings found,
                              StepReport& report) {
  const int number = static_cast<int>(used_.size());
  report.frame_processed = true;
  ++counts_.frames_processed;
  counts_.stars = saturated(counts_.stars, found.stars.size());
  counts_.streaks = saturated(counts_.streaks, found.streaks.size());
  findings_.frames.push_back(image::frame_summary(file, frame, found));
  for (const image::Streak& s : found.streaks) findings_.streaks.push_back({number, s});
  stars_.add(static_cast<std::uint16_t>(number), found.stars);
  if (found.attitude) {
    ++counts_.solutions;
    findings_.attitude = found.attitude;
  }
  if (found.cutout) {
    const auto* grey = std::get_if<image::Grid<std::uint8_t>>(&found.cutout->pixels);
    Piece piece{product_name(order_.request.method, file, grey != nullptr ? ".png" : ".fits"), {}};
    if (grey != nullptr)
      piece.content = image::encode_png(*grey).value_or(Octets());
    else
      piece.content = image::encode_fits(std::get<image::Plane>(found.cutout->pixels));
    if (!piece.content.empty() && pieces_octets_ + piece.content.size() <= order_.request.budget_octets) {
      pieces_octets_ += piece.content.size();
      pieces_.push_back(std::move(piece));
    } else {
      ++counts_.left_out;
    }
  }
  const bool detected = !found.streaks.empty();
  Used used{file, found.fwhm_px, {}};
  used.report = {file,        frame.time_s,  found.stars.size(), {}, found.background,
                 found.noise, found.fwhm_px, found.attitude};
  found.streaks.resize(std::min(found.streaks.size(), reported_streaks_most));
  used.report.streaks = std::move(found.streaks);
  if (!is_sequence_) {
    report.frames.push_back(used.report);
    if (looks_for_debris(order_.request.method)) mark(file, detected, report);
  }
  used_.push_back(std::move(used));
}

/// What was found once stays so: another method or other parameters see less.
void ImageTask::mark(const std::string& file, bool detected, StepReport& report) const {
  const auto path = frame_path(images_, file);
  if (!path) return;
  using image::FrameMark;
  if (!detected && image::has_mark(*path, FrameMark::detected)) return;
  const auto marked = detected ? image::mark_detected(*path, order_.request.method, order_.request.run)
                               : image::mark_frame(*path, FrameMark::nothing);
  if (!marked) report.problems.push_back(marked.error().message);
}

// ---------------------------------------------------------------- products

void ImageTask::finish_sequence(StepReport& report) {
  image::SequenceFindings found = method_->finish();
  method_.reset();
  findings_.calibration = calibrator_->used();
  calibrator_.reset();
  std::vector<bool> detected(used_.size(), false);
  for (std::size_t k = 0; k < std::min(found.streaks.size(), used_.size()); ++k) {
    detected[k] = !found.streaks[k].empty();
    counts_.streaks = saturated(counts_.streaks, found.streaks[k].size());
    findings_.frames[k]["streaks"] = found.streaks[k].size();
    for (const image::Streak& s : found.streaks[k]) findings_.streaks.push_back({static_cast<int>(k), s});
    found.streaks[k].resize(std::min(found.streaks[k].size(), reported_streaks_most));
    used_[k].report.streaks = std::move(found.streaks[k]);
  }
  for (std::size_t k = 0; k < std::min(found.registrations.size(), used_.size()); ++k)
    findings_.frames[k]["registration"] = image::to_json(found.registrations[k]);
  for (const image::Tracklet& t : found.tracklets) {
    for (const image::TrackPoint& p : t.points) {
      if (p.frame >= 0 && static_cast<std::size_t>(p.frame) < used_.size())
        detected[static_cast<std::size_t>(p.frame)] = true;
    }
  }
  counts_.tracklets = static_cast<std::uint32_t>(found.tracklets.size());
  findings_.tracklets = std::move(found.tracklets);
  findings_.defects = std::move(found.defects);
  if (order_.request.method == "calibrate") store_master(found, report);
  for (std::size_t k = 0; is_sequence_ && k < used_.size(); ++k) {
    mark(used_[k].file, detected[k], report);
    report.frames.push_back(used_[k].report);
  }
}

void ImageTask::store_master(const image::SequenceFindings& found, StepReport& report) {
  if (!found.master) {
    const std::string why = found.notes.empty() ? "no master" : found.notes.front();
    return fail(mission::failure::no_usable_frame, why);
  }
  auto saved = masters_.save(*found.master);
  if (!saved) return fail(mission::failure::disk_failed, saved.error().reason);
  findings_.master = std::move(saved->master);
  report.problems.insert(report.problems.end(), saved->problems.begin(), saved->problems.end());
}

void ImageTask::make_findings(ProductStore& store, StepReport& report) {
  finish_sequence(report);
  if (failure_) return;
  std::stable_sort(findings_.streaks.begin(), findings_.streaks.end(),
                   [](const FoundStreak& a, const FoundStreak& b) { return a.streak.snr > b.streak.snr; });
  if (const auto text = findings_text(findings_, room()))
    offer(store, "findings.json", as_octets(*text), report);
  else
    ++counts_.left_out;
  cut_outs_.emplace(findings_);
  to_cut_ = cut_outs_->frames();
  next_ = 0;
  phase_ = to_cut_.empty() ? Phase::pictures : Phase::cut_outs;
}

void ImageTask::cut_next(StepReport& report) {
  const auto number = static_cast<std::size_t>(to_cut_[next_++]);
  if (number < used_.size()) {
    if (const auto frame = read(used_[number].file))
      cut_outs_->take(static_cast<int>(number), frame->pixels, used_[number].fwhm_px);
    else
      report.problems.push_back(used_[number].file + ": " + frame.error().reason);
  }
  if (next_ == to_cut_.size()) phase_ = Phase::pictures;
}

void ImageTask::make_pictures(ProductStore& store, StepReport& report) {
  for (const auto& picture : cut_outs_->pictures()) {
    if (const auto png = image::encode_png(picture.pixels)) offer(store, picture.name, *png, report);
  }
  cut_outs_.reset();
  for (; !pieces_.empty(); pieces_.pop_front())
    offer(store, pieces_.front().name, pieces_.front().content, report);
  std::vector<image::ListedStar> stars = stars_.sorted();
  if (!stars.empty()) {
    // Half of what is left: a thumbnail cannot be cut to what fits.
    stars.resize(std::min(stars.size(), stars_in(room() / 2)));
    if (stars.empty())
      ++counts_.left_out;
    else
      offer(store, "stars.bin", image::encode_star_list(stars), report);
  }
  if (order_.request.method != "thumbnail") make_thumbnail(store, report);
  end_frames();
}

/// Of the frame with the most significant finding, else of the first; smaller where there is little room.
void ImageTask::make_thumbnail(ProductStore& store, StepReport& report) {
  int number = findings_.streaks.empty() ? 0 : findings_.streaks.front().frame;
  if (!findings_.tracklets.empty() && !findings_.tracklets.front().points.empty())
    number = findings_.tracklets.front().points.front().frame;
  const auto frame = read(used_.at(static_cast<std::size_t>(number)).file);
  if (!frame) {
    report.problems.push_back(frame.error().reason);
    return;
  }
  for (const int width : thumbnail_widths_px) {
    const auto png = image::encode_png(image::thumbnail(frame->pixels, width));
    if (!png || (png->size() > room() && width != thumbnail_widths_px.back())) continue;
    offer(store, "thumbnail.png", *png, report);
    return;
  }
}

void ImageTask::end_frames() {
  next_ = 0;
  phase_ = order_.request.full_frames ? Phase::full_frames : Phase::done;
}

void ImageTask::pack_next(ProductStore& store, StepReport& report) {
  const std::string& file = order_.request.files[next_++];
  const bool only = order_.method == nullptr;
  const auto frame = read(file);
  const auto strips = frame ? image::encode_strips(*frame) : Err(frame.error());
  if (strips) {
    if (only) ++counts_.frames_processed;
    report.frame_processed = only;
    offer(store, product_name(ProductStore::frame_prefix, file, ".strips"), *strips, report);
  } else if (only || frame) {  // else it was refused before
    refuse(file, strips.error().reason, report);
  }
  if (only) ++counts_.frames_done;
  if (next_ < order_.request.files.size()) return;
  phase_ = Phase::done;
  if (only && counts_.frames_processed == 0)
    fail(mission::failure::no_usable_frame, "no frame could be read or used");
}

std::string ImageTask::product_name(std::string_view prefix, const std::string& file,
                                    std::string_view extension) const {
  std::string stem = std::filesystem::path(file).stem().string().substr(0, longest_stem);
  for (char& c : stem) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-' && c != '_') c = '_';
  }
  const std::string_view joint = prefix.ends_with('_') ? "" : "_";
  const std::string name = fmt::format("{}{}{}{}", prefix, joint, stem, extension);
  const auto has_name = [&](const std::string& product) { return product.ends_with("/" + name); };
  const bool taken =
      std::any_of(products_.begin(), products_.end(), has_name) ||
      std::any_of(pieces_.begin(), pieces_.end(), [&](const Piece& p) { return p.name == name; });
  return taken ? fmt::format("{}{}{}_{}{}", prefix, joint, stem, next_, extension) : name;
}

bool ImageTask::offer(ProductStore& store, const std::string& name, OctetView content, StepReport& report) {
  if (content.size() > room() || products_.size() >= products_most) {
    ++counts_.left_out;
    return false;
  }
  const auto put = store.put(name, content);
  if (!put) {
    report.problems.push_back(put.error().text);
    // A master that was saved is in use, also where nothing can say so.
    if (put.error().problem == StoreProblem::disk && products_.empty() && !findings_.master)
      fail(mission::failure::disk_failed, put.error().text);
    else
      ++counts_.left_out;
    return false;
  }
  products_.push_back(*put);
  product_octets_ += static_cast<std::uint32_t>(content.size());
  return true;
}

}  // namespace srfs
