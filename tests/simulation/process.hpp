// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "suite/ring/heartbeat_page.hpp"
#include "tests/simulation/kernel.hpp"

namespace srfs::simulation {

/// The logic of a node with what translates for it, from the start of its process to its end. It is destroyed
/// where the process ends: nothing of it runs then.
class Program {
 public:
  virtual ~Program() = default;
  /// Begins its work. The process may be killed in it, not in the constructor: what is only in part there has
  /// no destructor.
  virtual void start() {}
};

/// One node's place: the process that runs there now, if there is one. Played are: that it ends between any
/// two actions, is stopped there, waits for a CPU, and is started anew.
class Host {
 public:
  enum class State : std::uint8_t { down, starting, running, stopped };
  using MakeProgram = std::function<std::unique_ptr<Program>(Host& host)>;

  /// Thrown out of the running handler where its process is killed.
  struct Killed {};

  Host(Kernel& kernel, Lane lane, MakeProgram make);
  Host(const Host&) = delete;
  Host& operator=(const Host&) = delete;

  [[nodiscard]] Kernel& kernel() { return kernel_; }
  [[nodiscard]] MonotonicTime now() const { return kernel_.now(); }
  [[nodiscard]] Lane lane() const { return lane_; }
  [[nodiscard]] std::string name() const { return to_text(lane_); }
  [[nodiscard]] State state() const { return state_; }
  /// Of its process; 0: there is none.
  [[nodiscard]] pid_t pid() const { return state_ == State::down ? 0 : pid_; }
  [[nodiscard]] std::uint32_t incarnation() const { return incarnation_; }
  [[nodiscard]] bool is_up() const { return state_ == State::running || state_ == State::stopped; }
  [[nodiscard]] bool runs() const { return state_ == State::running; }
  [[nodiscard]] const suite::HeartbeatPage::Reading& page() const { return page_; }
  /// Runnable without a CPU, since its start.
  [[nodiscard]] nanoseconds waited() const;
  [[nodiscard]] bool waits_for_cpu() const { return starves_from_.has_value(); }
  /// It waits for a CPU, and nothing else has kept it from its work in the @p before that.
  [[nodiscard]] bool only_starves(nanoseconds before) const {
    return starves_from_ && *starves_from_ - well_since_ > before;
  }
  /// When it could work last time after a stop or a start.
  [[nodiscard]] MonotonicTime well_since() const { return well_since_; }
  [[nodiscard]] Program* program() { return program_.get(); }

  // ---- from outside
  /// A process is started, which works after @p delay. Violated: there is one already.
  void begin(nanoseconds delay);
  /// SIGKILL, or the end of the power.
  void end(const char* why);
  /// The run is over.
  void discard() { program_.reset(); }
  void stop(bool for_want_of_cpu);
  void go_on();
  /// It ends, or stops, before its action number @p actions from now on. For the process that is there now.
  void kill_at_action(std::uint32_t actions);
  void stop_at_action(std::uint32_t actions, nanoseconds duration);

  // ---- for its program
  /// Runs it unless the process has ended by then; while it is stopped it waits.
  void later(nanoseconds delay, Kernel::Event event);
  /// Each @p period, as long as the process lives.
  void every(nanoseconds period, Kernel::Event event);
  /// The same at once: input.
  void give(Kernel::Event event);
  /// What leaves the process: while it is stopped in the middle of a handler, it waits.
  void output(Kernel::Event event);
  /// Before each action that is carried out.
  void action_point();
  void trace(Lane to, const char* what, std::uint64_t a = 0, std::uint64_t b = 0) {
    kernel_.trace(lane_, to, what, a, b);
  }
  [[nodiscard]] Deadline::Guard guard() {
    return [this](nanoseconds delay, Kernel::Event event) { later(delay, std::move(event)); };
  }
  void set_observer(std::function<void(Host&)> observer) { observer_ = std::move(observer); }
  [[nodiscard]] std::uint64_t starts() const { return starts_; }

 private:
  void run(const Kernel::Event& event);
  void enter();

  Kernel& kernel_;
  Lane lane_;
  MakeProgram make_;
  std::function<void(Host&)> observer_;  ///< of starts and ends
  State state_ = State::down;
  pid_t pid_ = 0;
  std::uint32_t incarnation_ = 0;
  std::uint64_t starts_ = 0;
  suite::HeartbeatPage::Reading page_;
  MonotonicTime well_since_;
  std::optional<MonotonicTime> starves_from_;
  nanoseconds waited_{0};
  std::deque<Kernel::Event> inbox_;
  std::deque<Kernel::Event> outbox_;
  std::optional<std::uint32_t> kill_in_;
  std::optional<std::uint32_t> stop_in_;
  nanoseconds stop_for_{0};
  std::unique_ptr<Program> program_;
};

/// Who hears whom: two processes find each other some time after the later one has begun, each direction by
/// itself, as DDS discovery does. What is written before is not heard.
class Network {
 public:
  explicit Network(Kernel& kernel) : kernel_(kernel), random_(kernel.random("network")) {}

  void on_begin(const Host& host);
  [[nodiscard]] bool hears(const Host& writer, const Host& reader) const {
    return writer.is_up() && reader.is_up() &&
           kernel_.now() >=
               matched_[static_cast<std::size_t>(writer.lane())][static_cast<std::size_t>(reader.lane())];
  }
  /// Of one message: mostly some 100 us; while messages are late, up to the bound.
  [[nodiscard]] nanoseconds delay();
  void set_longest_delay(nanoseconds delay) { longest_ = delay; }
  [[nodiscard]] bool is_late() const { return longest_ > nanoseconds(0); }

 private:
  Kernel& kernel_;
  Random random_;
  nanoseconds longest_{0};
  std::array<std::array<MonotonicTime, lane_count>, lane_count> matched_{};
};

/// One topic: reliable, KEEP_LAST. The messages of one writer come to one reader in order, and none is lost,
/// but those for which the reader's history had no room while it was stopped: the oldest make room.
template <class M>
class Topic {
 public:
  using Handler = std::function<void(const M& message, Host& writer)>;
  Topic(Kernel& kernel, Network& network, const char* name, std::size_t depth)
      : kernel_(kernel), network_(network), name_(name), depth_(depth) {}

  /// Until the process of @p reader ends.
  void subscribe(Host& reader, Handler handler) {
    Reader& r = readers_[static_cast<std::size_t>(reader.lane())];
    r = Reader{&reader, reader.pid(), std::move(handler), {}, {}};
  }
  void publish(Host& writer, M message) {
    writer.output([this, &writer, message = std::make_shared<const M>(std::move(message))] {
      for (Reader& reader : readers_) {
        if (reader.host != nullptr && reader.host->pid() == reader.pid &&
            network_.hears(writer, *reader.host))
          send(writer, reader, message);
      }
    });
  }
  /// Handles what waits, before its turn.
  void take_waiting(Host& host) {
    Reader& reader = readers_[static_cast<std::size_t>(host.lane())];
    while (reader.host != nullptr && !reader.waiting.empty()) take(reader);
  }
  [[nodiscard]] std::uint64_t overrun() const { return overrun_; }

 private:
  struct Message {
    std::shared_ptr<const M> content;
    Host* writer;
  };
  struct Reader {
    Host* host = nullptr;
    pid_t pid = 0;
    Handler handler;
    std::deque<Message> waiting;
    std::array<MonotonicTime, lane_count> last{};  ///< delivery by writer
  };
  void send(Host& writer, Reader& reader, std::shared_ptr<const M> message) {
    MonotonicTime& last = reader.last[static_cast<std::size_t>(writer.lane())];
    last = std::max(last, kernel_.now() + network_.delay());
    kernel_.at(last, [this, &writer, &reader, pid = reader.pid, message = std::move(message)] {
      if (reader.pid != pid || reader.host->pid() != pid) return;
      if (reader.waiting.size() == depth_) {
        reader.waiting.pop_front();
        ++overrun_;
      }
      reader.waiting.push_back({message, &writer});
      reader.host->give([this, &reader] {
        if (!reader.waiting.empty()) take(reader);
      });
    });
  }
  void take(Reader& reader) {
    const Message message = std::move(reader.waiting.front());
    reader.waiting.pop_front();
    kernel_.trace(message.writer->lane(), reader.host->lane(), name_);
    reader.handler(*message.content, *message.writer);
  }

  Kernel& kernel_;
  Network& network_;
  const char* name_;
  std::size_t depth_;
  std::array<Reader, lane_count> readers_{};
  std::uint64_t overrun_ = 0;
};

}  // namespace srfs::simulation
