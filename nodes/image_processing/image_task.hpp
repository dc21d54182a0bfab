// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <deque>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "image/file/calibrator.hpp"
#include "image/product/star_list.hpp"
#include "nodes/image_processing/cut_outs.hpp"
#include "nodes/image_processing/findings_report.hpp"
#include "nodes/image_processing/product_store.hpp"
#include "nodes/image_processing/task_order.hpp"

namespace srfs {

/// What one frame holds, for listeners while the task runs.
struct FrameReport {
  std::string file;
  std::optional<double> time_s;  ///< begin of the exposure, seconds since 1970
  std::size_t stars = 0;
  std::vector<image::Streak> streaks;  ///< most significant first, 64 at most
  double background = 0;
  double noise = 0;
  double fwhm_px = 0;
  std::optional<image::Attitude> attitude;
};

/// What one step of a task brought.
struct StepReport {
  bool frame_processed = false;
  std::vector<FrameReport> frames;  ///< whose findings are known now
  struct Refused {
    std::string file;
    std::string why;
  };
  std::vector<Refused> refused;
  std::vector<std::string> problems;  ///< of the disk; for the log
};

/// Counts of a task so far.
struct TaskCounts {
  std::uint16_t frames_done = 0;  ///< processed or refused
  std::uint16_t frames_processed = 0;
  std::uint32_t frames_refused = 0;
  std::uint32_t stars = 0;
  std::uint32_t streaks = 0;
  std::uint32_t tracklets = 0;
  std::uint32_t solutions = 0;
  std::uint16_t left_out = 0;  ///< products that had no room
};

/// One goal of /image/process, in steps of one frame or less: the frames are processed, then what they hold
/// together, then the products are made, the most important first, as long as the budget lasts. In memory
/// are one frame, what the method keeps, and products of the budget's size.
///
/// step() blocks on the disk and computes; it belongs on a worker. Nothing else may be called meanwhile.
class ImageTask {
 public:
  struct Limits {
    std::int64_t frame_pixels = 6'000'000;  ///< larger frames are refused
  };

  ImageTask(TaskOrder order, std::filesystem::path images, Limits limits);

  /// @pre not is_done()
  [[nodiscard]] StepReport step(ProductStore& store);
  [[nodiscard]] bool is_done() const { return failure_ || phase_ == Phase::done; }

  [[nodiscard]] const ProcessRequest& request() const { return order_.request; }
  [[nodiscard]] const TaskCounts& counts() const { return counts_; }
  /// Set where the task could not be done.
  [[nodiscard]] const std::optional<TaskRefusal>& failure() const { return failure_; }
  /// Below the folder of images, most important first; 256 at most.
  [[nodiscard]] const std::vector<std::string>& products() const { return products_; }
  [[nodiscard]] std::uint32_t product_octets() const { return product_octets_; }
  [[nodiscard]] const std::optional<image::Attitude>& attitude() const { return findings_.attitude; }

  static constexpr std::size_t products_most = 256;
  static constexpr std::size_t reported_streaks_most = 64;
  static constexpr int side_least_px = 16;

 private:
  enum class Phase : std::uint8_t { frames, findings, cut_outs, pictures, full_frames, done };
  /// A frame that was processed.
  struct Used {
    std::string file;
    double fwhm_px = 0;
    FrameReport report;
  };
  /// A product of the method itself: roi, thumbnail.
  struct Piece {
    std::string name;
    Octets content;
  };

  void advance(ProductStore& store, StepReport& report);
  void process_next(StepReport& report);
  void process(const std::string& file, StepReport& report);
  void take_findings(const std::string& file, const image::Frame& frame, image::FrameFindings found,
                     StepReport& report);
  void finish_sequence(StepReport& report);
  void store_master(const image::SequenceFindings& found, StepReport& report);
  void make_findings(ProductStore& store, StepReport& report);
  void cut_next(StepReport& report);
  void make_pictures(ProductStore& store, StepReport& report);
  void make_thumbnail(ProductStore& store, StepReport& report);
  void pack_next(ProductStore& store, StepReport& report);
  void end_frames();

  [[nodiscard]] Result<image::Frame, image::Refusal> read(const std::string& file) const;
  void refuse(const std::string& file, const std::string& why, StepReport& report);
  void mark(const std::string& file, bool detected, StepReport& report) const;
  /// A product, if it fits. @return whether it was written
  bool offer(ProductStore& store, const std::string& name, OctetView content, StepReport& report);
  [[nodiscard]] std::size_t room() const { return order_.request.budget_octets - product_octets_; }
  [[nodiscard]] std::string product_name(std::string_view prefix, const std::string& file,
                                         std::string_view extension) const;
  void fail(std::uint16_t code, std::string reason);

  TaskOrder order_;
  std::filesystem::path images_;
  Limits limits_;
  image::MasterStore masters_;
  std::optional<image::Calibrator> calibrator_;  // while there is a method
  std::unique_ptr<image::Method> method_;        // null: full frames only
  bool is_sequence_ = false;                     // streaks are known when all frames are

  Phase phase_ = Phase::frames;
  std::size_t next_ = 0;  // file, or frame to be cut, of the phase
  bool begun_ = false;    // at the store
  std::vector<Used> used_;
  TaskFindings findings_;
  image::BrightestStars stars_;
  std::deque<Piece> pieces_;
  std::size_t pieces_octets_ = 0;
  std::optional<CutOuts> cut_outs_;
  std::vector<int> to_cut_;

  TaskCounts counts_;
  std::optional<TaskRefusal> failure_;
  std::vector<std::string> products_;
  std::uint32_t product_octets_ = 0;
};

}  // namespace srfs
