// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "motion.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "image/opencv_view.hpp"

namespace srfs {
namespace {

constexpr std::uint32_t shortest_side = 32;
constexpr int sky_px = 31;              // the sky changes over more than that
constexpr double newest_share = 0.25;   // of the mean
constexpr double least_likeness = 0.4;  // of frames that show the same stars; others have 0.15
constexpr double even_limit_noises = 10;
constexpr int least_area_px = 4;       // a hot pixel, a particle's hit are smaller
constexpr float star_residual = 0.5F;  // a star that was moved by part of a pixel differs by that much
constexpr float rms_of_median = 1.4826F;

/// Median of the absolute values, of every 7th pixel: as much as the noise needs.
float noise_of(const cv::Mat& difference) {
  std::vector<float> values;
  values.reserve(difference.total() / 7 + 1);
  const auto* pixels = difference.ptr<float>();
  for (std::size_t i = 0; i < difference.total(); i += 7) values.push_back(std::abs(pixels[i]));
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return std::max(rms_of_median * *middle, 1.0F);
}

/// The frame without its sky: stars and noise.
cv::Mat without_sky(const cv::Mat& frame) {
  cv::Mat values;
  frame.convertTo(values, CV_32F);
  cv::Mat clipped;
  cv::threshold(values, clipped, 1.5 * cv::mean(values)[0], 0, cv::THRESH_TRUNC);  // stars are not the sky
  cv::Mat sky;
  cv::blur(clipped, sky, {sky_px, sky_px}, {-1, -1}, cv::BORDER_REFLECT);
  return values - sky;
}

/// What registration compares: bright stars do not drown the others, nor does the noise.
cv::Mat even_stars(const cv::Mat& stars) {
  const double noise{noise_of(stars)};
  cv::Mat smooth;
  cv::GaussianBlur(stars, smooth, {0, 0}, 1.0);  // leaves 0.28 of the noise
  cv::Mat even;
  cv::sqrt(cv::min(cv::max(smooth - noise, 0.0), even_limit_noises * noise), even);
  return even;
}

/// Where a parabola through three neighbours has its top, in px from the middle one.
double top_of(double left, double middle, double right) {
  const double curvature = left - 2 * middle + right;
  return curvature < 0 ? std::clamp(0.5 * (left - right) / curvature, -0.5, 0.5) : 0;
}

/// How far the stars moved; nullopt: the frames do not show the same stars, up to an eighth of a side apart.
std::optional<cv::Point2d> shift_between(const cv::Mat& before, const cv::Mat& now) {
  const cv::Point most(before.cols / 8, before.rows / 8);
  const cv::Mat middle = before(cv::Rect(most, before.size() - cv::Size(2 * most)));
  cv::Mat likeness;
  cv::matchTemplate(now, middle, likeness, cv::TM_CCOEFF_NORMED);
  double best = 0;
  cv::Point at;
  cv::minMaxLoc(likeness, nullptr, &best, nullptr, &at);
  if (!(best >= least_likeness)) return std::nullopt;
  const auto value = [&](int x, int y) {
    return likeness.at<float>(std::clamp(y, 0, likeness.rows - 1), std::clamp(x, 0, likeness.cols - 1));
  };
  return cv::Point2d(at - most) +
         cv::Point2d(top_of(value(at.x - 1, at.y), value(at.x, at.y), value(at.x + 1, at.y)),
                     top_of(value(at.x, at.y - 1), value(at.x, at.y), value(at.x, at.y + 1)));
}

/// What an image shows after the camera turned by this shift; 0 where it was not seen before.
cv::Mat moved(const cv::Mat& image, cv::Point2d shift, int interpolation) {
  const cv::Mat move = (cv::Mat_<double>(2, 3) << 1, 0, shift.x, 0, 1, shift.y);
  cv::Mat result;
  cv::warpAffine(image, result, move, image.size(), interpolation, cv::BORDER_CONSTANT);
  return result;
}

/// 255 where a difference is significant, and no star that was moved.
cv::Mat significant(const cv::Mat& difference, const cv::Mat& background, float limit) {
  cv::Mat stars;
  cv::dilate(background, stars, cv::Mat::ones(5, 5, CV_8U));
  return difference > cv::max(star_residual * stars, limit);
}

void find_movers(const cv::Mat& difference, const cv::Mat& mask, float noise, Motion& motion) {
  cv::Mat labels;
  cv::Mat statistics;
  cv::Mat middles;
  const int count = cv::connectedComponentsWithStats(mask, labels, statistics, middles);
  for (int label = 1; label < count; ++label) {  // 0: all the rest
    if (statistics.at<int>(label, cv::CC_STAT_AREA) < least_area_px) continue;
    ++motion.movers;
    const cv::Rect box(
        statistics.at<int>(label, cv::CC_STAT_LEFT), statistics.at<int>(label, cv::CC_STAT_TOP),
        statistics.at<int>(label, cv::CC_STAT_WIDTH), statistics.at<int>(label, cv::CC_STAT_HEIGHT));
    const cv::Mat of_it = labels(box) == label;
    double brightest = 0;
    cv::minMaxLoc(difference(box), nullptr, &brightest, nullptr, nullptr, of_it);
    const float snr = static_cast<float>(brightest) / noise;
    if (snr <= motion.snr) continue;
    std::vector<cv::Point> pixels;
    cv::findNonZero(of_it, pixels);
    const cv::RotatedRect around = cv::minAreaRect(pixels);
    motion.snr = snr;
    motion.x_px = static_cast<float>(middles.at<double>(label, 0));
    motion.y_px = static_cast<float>(middles.at<double>(label, 1));
    motion.length_px = std::max(around.size.width, around.size.height) + 1;
  }
}

}  // namespace

std::optional<Motion> MotionFinder::on_frame(OctetView pixels, std::uint32_t width, std::uint32_t height) {
  const cv::Mat frame = image::view_of_mono16(pixels, width, height);
  if (frame.empty() || std::min(width, height) < shortest_side) return std::nullopt;
  const cv::Mat stars = without_sky(frame);
  const cv::Mat even = even_stars(stars);
  Motion motion;
  const auto shift = before_.size() == even.size() ? shift_between(before_, even) : std::nullopt;
  before_ = even;
  if (!shift) {
    background_ = stars;
    return motion;
  }
  motion.compared = true;
  motion.shift_x_px = static_cast<float>(shift->x);
  motion.shift_y_px = static_cast<float>(shift->y);
  background_ = moved(background_, *shift, cv::INTER_LINEAR);
  cv::Mat seen = moved(cv::Mat(stars.size(), CV_8U, cv::Scalar(255)), *shift, cv::INTER_NEAREST);
  cv::erode(seen, seen, cv::Mat::ones(5, 5, CV_8U));
  cv::Mat difference = cv::Mat::zeros(stars.size(), CV_32F);
  cv::subtract(stars, background_, difference, seen);
  const float noise = noise_of(difference);
  find_movers(difference, significant(difference, background_, least_snr_ * noise), noise, motion);
  cv::accumulateWeighted(stars, background_, newest_share);
  stars.copyTo(background_, ~seen);
  return motion;
}

}  // namespace srfs
