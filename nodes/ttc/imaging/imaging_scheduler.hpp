// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <mission/structures.hpp>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/services/pus_service.hpp"

namespace srfs {

/// The two nodes that serve imaging's actions.
enum class ImageServer : std::uint8_t { acquisition, processing };

/// What an imaging task needs done outside of ImagingScheduler.
enum class ImagingAction : std::uint8_t {
  capture,         ///< a goal of image_acquisition
  process,         ///< a goal of image_processing
  cancel_goal,     ///< the goal of this id; one that is not there needs nothing
  cancel_all,      ///< goals that an earlier process left at the server
  list_frames,     ///< what is stored of the task
  queue_products,  ///< into the folder of files to send
  stop_sending,    ///< what is in that folder of the task
};

struct ImagingOrder {
  ImagingAction action = ImagingAction::capture;
  std::uint64_t id = 0;  ///< of the telecommand
  std::uint32_t task = 0;
  std::uint16_t frame = 0;  ///< the only one meant; 0: all of the task
  std::optional<UtcTime> start = {};
  mission::ImageCapture capture = {};   ///< capture: the settings
  std::vector<std::string> files = {};  ///< process: frames. queue_products: products, best first
  std::string method = {};
  std::string parameters = {};
  std::uint32_t budget_octets = 0;
  bool full_frames = false;
  std::uint32_t run = 0;  ///< queue_products: of the processing, if the products show all it found; else 0
  ImageServer server = ImageServer::acquisition;  ///< of goals
};

/// How a goal ended.
struct ImageGoalEnd {
  enum class How : std::uint8_t {
    finished,  ///< with a result
    canceled,
    rejected,  ///< by its server: another time
    lost,      ///< its server is gone, silent, or does not know it any more
  };
  How how = How::finished;
  std::uint16_t failure_code = 0;  ///< of the result
  std::string reason = {};
  std::vector<std::string> files = {};  ///< frames or products, below the folder of images
  std::uint32_t detections = 0;         ///< streaks and tracklets
  std::uint32_t run = 0;                ///< of the processing (lib/image/file/frame_mark.hpp)
};

/// The time as far as it is known.
struct ImagingTime {
  MonotonicTime now;
  UtcTime utc;
  bool utc_valid = false;
};

/// Which nodes of the image lane the deployment has.
struct ImageLane {
  bool acquisition = true;
  bool processing = true;
};

/// The imaging tasks of the ground: takes telecommands image.*, decides which goals to send and to cancel and
/// what to do with files, and reports to the ground how far each task is. At most one goal at each of the two
/// nodes, so that one task can be captured while another is processed and a third is sent. Every telecommand
/// that is taken ends exactly once. Pure.
///
/// Captures go to the camera in the order of their start, those without one first; a goal is sent at most
/// `lead` before its start. A capture whose start passes while the camera does another one fails.
///
/// Progress (1,5): 1 capture asked for; 25, 50, 75 per cent of the frames; 100 all stored; 101 processing
/// asked for; 125, 150, 175; 200 processed.
class ImagingScheduler final : public PusService {
 public:
  static constexpr std::size_t max_tasks = 16;
  static constexpr std::size_t max_cancels = 8;
  static constexpr std::size_t max_failures = 16;
  static constexpr int tries_of_a_frame = 3;
  static constexpr seconds frame_patience{5};  ///< of image_acquisition beyond the exposure, of one try
  /// A task that was captured waits so long for its processing.
  static constexpr seconds longest_wait{86'400};
  static constexpr seconds lead{10};               ///< a goal is sent so long before the start of its capture
  static constexpr seconds answer_patience{60};    ///< goal sent -> accepted; order to the disk -> done
  static constexpr seconds capture_patience{30};   ///< beyond the time that the next frame takes
  static constexpr seconds process_patience{300};  ///< without a report of image_processing
  static constexpr seconds clear_patience{15};     ///< cancel_all -> on_cleared()
  static constexpr seconds reject_pause{2};
  static constexpr int max_rejections = 5;
  static constexpr std::uint8_t step_capture = 1;
  static constexpr std::uint8_t step_captured = 100;
  static constexpr std::uint8_t step_process = 101;
  static constexpr std::uint8_t step_processed = 200;

  /// @param report_queue outlives this
  explicit ImagingScheduler(ReportQueue& report_queue, ImageLane lane = {})
      : report_queue_(report_queue), lane_(lane) {}

  [[nodiscard]] bool provides(const mission::Command& command) const override;
  /// Nodes were added or removed.
  void set_lane(ImageLane lane) { lane_ = lane; }
  /// Of a node that the deployment does not have.
  [[nodiscard]] std::optional<Refusal> why_refused(const Telecommand& telecommand) const override;
  void execute(const Telecommand& telecommand, MonotonicTime now) override;
  /// Of this boot. A capture that was asked for is not asked for again: it ends as interrupted, unless all
  /// its frames were stored. What runs for it is cancelled.
  [[nodiscard]] bool restore(const Telecommand& telecommand, const TelecommandProgress& progress,
                             MonotonicTime now) override;

  /// Ends what is overdue, gives orders that are due. @param may_capture in this mode
  void on_time(const ImagingTime& time, bool may_capture);
  /// When on_time() has something without another input.
  [[nodiscard]] std::optional<MonotonicTime> next_due(const ImagingTime& time) const;
  /// To be carried out, in order, each once. Not before the progress that was reported is in the journal:
  /// this is what keeps a capture from being taken twice.
  [[nodiscard]] std::vector<ImagingOrder> take_orders() { return std::exchange(orders_, {}); }

  // What becomes of orders. An id that is not waiting for it is ignored.
  void on_accepted(std::uint64_t id, MonotonicTime now);
  void on_feedback(std::uint64_t id, std::uint16_t frames_done, MonotonicTime now);
  void on_goal_end(std::uint64_t id, ImageServer server, ImageGoalEnd end, MonotonicTime now);
  /// @param frames in order; nullopt: there is no such task
  void on_frames_listed(std::uint64_t id, std::optional<std::vector<std::string>> frames);
  /// @param failure code of the dictionary, 0: all are queued
  void on_products_queued(std::uint64_t id, std::uint16_t failure, const std::string& reason,
                          std::size_t queued);
  /// @param files taken out of the folder. @param failure code of the dictionary, 0: none
  void on_sending_stopped(std::uint64_t id, std::size_t files, std::uint16_t failure);
  /// The server got cancel_all, or is not there.
  void on_cleared(ImageServer server) { clearing_[static_cast<std::size_t>(server)].reset(); }
  /// The ground has a product.
  void on_product_sent() { ++counters_.products_sent; }

  /// Which process is the node. @param incarnation 0: none. @param looked when that was
  void on_instance(ImageServer server, std::uint32_t incarnation, MonotonicTime looked);

  struct Failure {
    std::uint32_t task = 0;
    std::string why;
  };
  /// Tasks that failed since the last call, the newest max_failures.
  [[nodiscard]] std::vector<Failure> take_failures() { return std::exchange(failures_, {}); }
  [[nodiscard]] mission::TtcImagingHousekeeping housekeeping() const;
  [[nodiscard]] std::size_t tasks() const { return tasks_.size(); }
  /// Whether a task of this telecommand is under way.
  [[nodiscard]] bool knows(std::uint64_t id) const;

 private:
  enum class Kind : std::uint8_t { capture, process, send_frame };
  enum class State : std::uint8_t {
    waits_for_camera,
    capturing,
    listing,
    waits_for_processing,
    processing,
    queueing,
  };
  struct Task {
    TelecommandOrigin origin;
    Kind kind = Kind::capture;
    State state = State::waits_for_camera;
    mission::ImageCapture settings;  ///< of any kind: number, method, parameters, budget
    std::uint16_t frame = 0;         ///< send_frame
    std::optional<UtcTime> start;
    std::vector<std::string> files;  ///< frames, then products
    MonotonicTime expiry;            ///< of waiting
    MonotonicTime silent_at;         ///< of everything else
    MonotonicTime not_before;        ///< after a rejection
    int rejections = 0;
    std::uint8_t quarters = 0;  ///< of the frames, as last reported
    bool cancelled = false;
    std::optional<MonotonicTime> accepted_at;
    std::optional<std::uint32_t> incarnation;  ///< of the server, seen since
  };
  struct Cancel {
    TelecommandOrigin origin;
    bool found = false;
    MonotonicTime expiry;
  };

  [[nodiscard]] static std::optional<Task> read(const Telecommand& telecommand, MonotonicTime now);
  [[nodiscard]] std::uint16_t refusal_of(const Task& task) const;
  void cancel(const Telecommand& telecommand, MonotonicTime now);
  void cancel(Task& task);
  void clear(ImageServer server, MonotonicTime now);
  [[nodiscard]] static bool waits(const Task& task);
  [[nodiscard]] static std::optional<ImageServer> server_of(const Task& task);
  [[nodiscard]] Task* find(std::uint64_t id);
  [[nodiscard]] Task* find(std::uint64_t id, State state);
  [[nodiscard]] bool busy(ImageServer server) const;
  [[nodiscard]] const Task* next_capture() const;
  void end_overdue(const ImagingTime& time, bool may_capture);
  void begin_capture(Task& task, const ImagingTime& time);
  void begin_processing(Task& task, MonotonicTime now);
  void list_frames(Task& task, MonotonicTime now);
  void on_captured(Task& task, ImageGoalEnd end, MonotonicTime now);
  void on_processed(Task& task, ImageGoalEnd end, MonotonicTime now);
  void lose(Task& task, MonotonicTime now);
  /// Of a frame with all its tries, at image_acquisition.
  [[nodiscard]] static nanoseconds longest_frame(const Task& task);
  void progress(const Task& task, std::uint8_t step);
  void complete(std::uint64_t id);
  void fail(std::uint64_t id, std::uint16_t code, const std::string& reason = {});
  void note_failure(std::uint32_t task, const std::string& why);
  void remove(std::uint64_t id);

  struct Counters {
    std::uint32_t taken = 0;
    std::uint32_t completed = 0;
    std::uint32_t failed = 0;
    std::uint32_t frames = 0;
    std::uint32_t detections = 0;
    std::uint32_t products_queued = 0;
    std::uint32_t products_sent = 0;
  };

  ReportQueue& report_queue_;
  ImageLane lane_;
  std::deque<Task> tasks_;  ///< in the order of their telecommands
  std::vector<Cancel> cancels_;
  std::array<std::optional<MonotonicTime>, 2> clearing_;  ///< no goals for this server, at most until then
  std::vector<ImagingOrder> orders_;
  std::vector<Failure> failures_;
  Counters counters_;
};

}  // namespace srfs
