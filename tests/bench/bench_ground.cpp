// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Measures the ground station, one subject per call, and prints one JSON object: its archive, with made
// telemetry at virtual speed, and the start of a command. `./run bench ground` calls this program.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <map>
#include <optional>
#include <queue>
#include <random>
#include <stdexcept>

#include <fcntl.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include "base/child_process.hpp"
#include "ground/archive/recorder.hpp"
#include "ground/dictionary_cache.hpp"
#include "msgs/mission/dictionary.hpp"
#include "tests/bench/process.hpp"
#include "tests/temporary_folder.hpp"

namespace {

using namespace srfs;
using bench::Json;

struct ArchiveOptions {
  double hours = 24;
  double rate = 10;
  int queries = 300;
  unsigned seed = 1;
};

constexpr std::size_t points = 2000;
constexpr milliseconds turn{20};        ///< of the server: what came in it is committed at once
constexpr seconds minutes_behind{120};  ///< when all aggregates of a time can be made

/// CPU time of this process.
double cpu_s() {
  timespec used{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
  return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

/// kB; "VmRSS" or "VmHWM".
double memory_kb(const std::string& name) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with(name + ":")) return std::stod(line.substr(name.size() + 1));
  }
  throw std::runtime_error("/proc/self/status has no " + name);
}

/// Housekeeping of a mission whose values drift, each structure at its interval, several times as often.
class MadeTelemetry {
 public:
  MadeTelemetry(const mission::Dictionary& dictionary, UtcTime start, double rate, unsigned seed)
      : random_(seed), start_(start) {
    for (const mission::Structure& structure : dictionary.structures()) {
      if (structure.id == 0 || structure.interval <= milliseconds(0)) continue;
      const auto period = std::chrono::duration_cast<nanoseconds>(structure.interval / rate);
      const auto phase = nanoseconds(std::uniform_int_distribution<std::int64_t>(0, period.count())(random_));
      due_.push({start + phase, period, &structure});
      per_second_ += 1e9 / static_cast<double>(period.count());
    }
    if (due_.empty()) throw std::runtime_error("the dictionary has no periodic structure");
  }

  [[nodiscard]] double per_second() const { return per_second_; }
  /// The next packet, if it is due before @p end.
  [[nodiscard]] std::optional<ground::ReceivedPacket> next(UtcTime end) {
    Due due = due_.top();
    if (due.at >= end) return std::nullopt;
    due_.pop();
    const ground::ReceivedPacket packet = make(*due.structure, due.at);
    due.at = due.at + due.period;
    due_.push(due);
    return packet;
  }

 private:
  struct Due {
    UtcTime at;
    nanoseconds period;
    const mission::Structure* structure;
    bool operator<(const Due& other) const { return at > other.at; }
  };

  ground::ReceivedPacket make(const mission::Structure& structure, UtcTime at) {
    OctetWriter source;
    source.u16(structure.id);
    const double hour = std::chrono::duration<double, std::ratio<3600>>(at - start_).count();
    double phase = structure.id;
    for (const mission::Field& field : structure.fields) {
      for (std::size_t i = 0; i < field.count; ++i) put(field, std::sin(hour + (phase += 0.7)), source);
    }
    wire::TmPacket packet{.apid = structure.apid,
                          .sequence_count = static_cast<std::uint16_t>(counts_[structure.apid]++ & 0x3FFF),
                          .time_reference = 1,
                          .service = mission::housekeeping_report.first,
                          .subtype = mission::housekeeping_report.second,
                          .time = to_tai(at),
                          .source = source.take()};
    return {.vc = ground::tm_channel::live, .packet = packet, .raw = wire::make_tm_packet(packet)};
  }

  void put(const mission::Field& field, double drift, OctetWriter& out) {
    using Type = mission::FieldType;
    const double noise = std::uniform_real_distribution<double>(0, 0.01)(random_);
    const double value = 100 * (1.5 + drift) + noise;
    const auto count = static_cast<std::uint64_t>(value);
    const bool labelled = field.enumeration != nullptr && !field.enumeration->labels.empty();
    const auto small =
        labelled ? static_cast<std::uint64_t>(field.enumeration->labels.begin()->first) : count;
    switch (field.type) {
      case Type::u8:
      case Type::i8:
        return out.u8(static_cast<std::uint8_t>(small & 0x7F));
      case Type::boolean:
        return out.u8(drift > 0 ? 1 : 0);
      case Type::u16:
      case Type::i16:
        return out.u16(static_cast<std::uint16_t>(small));
      case Type::u32:
      case Type::i32:
        return out.u32(static_cast<std::uint32_t>(small));
      case Type::u64:
      case Type::i64:
        return out.u64(small);
      case Type::f32:
        return out.f32(static_cast<float>(value));
      case Type::f64:
        return out.f64(value);
      case Type::text:
        return out.u8(0);
      case Type::time:
        return mission::detail::put_time(out, to_tai(start_));
      case Type::packet:
      case Type::parameter_value:
        throw std::runtime_error("field " + field.name + ": no telemetry has this type");
    }
  }

  std::mt19937 random_;
  UtcTime start_;
  std::priority_queue<Due> due_;
  std::map<std::uint16_t, std::uint32_t> counts_;
  double per_second_ = 0;
};

/// What recording costs. @return the share of a core in percent, memory, the file's size
Json record(const ArchiveOptions& options, const mission::Dictionary& dictionary,
            const std::filesystem::path& file, UtcTime start) {
  auto opened = ground::open_archive(file, ground::ArchiveUse::write);
  if (!opened) throw std::runtime_error(opened.error());
  std::string problem;
  ground::Recorder recorder(std::move(*opened), dictionary,
                            [&problem](const std::string& text) { problem = text; });
  MadeTelemetry telemetry(dictionary, start, options.rate, options.seed);
  const auto length = nanoseconds(static_cast<std::int64_t>(options.hours * 3.6e12));
  std::uint64_t packets = 0;
  double insert_s = 0;
  double minutes_s = 0;
  for (UtcTime now = start; now < start + length; now = now + turn) {
    std::vector<ground::ReceivedPacket> came;
    while (auto packet = telemetry.next(now + turn)) came.push_back(std::move(*packet));
    const double begin = cpu_s();
    for (const auto& packet : came) {
      if (recorder.on_packet(packet, now + turn) == 0) throw std::runtime_error("a packet was not recorded");
    }
    if (!came.empty()) recorder.commit();
    const double inserted = cpu_s();
    // As the server does between its turns.
    static_cast<void>(recorder.make_minute(now + turn));
    insert_s += inserted - begin;
    minutes_s += cpu_s() - inserted;
    packets += came.size();
  }
  while (recorder.make_minute(start + length + minutes_behind)) {
  }
  if (!problem.empty()) throw std::runtime_error(problem);
  const double virtual_s = options.hours * 3600;
  return {{"hours", options.hours},
          {"rate", options.rate},
          {"packets", packets},
          {"packets_a_second", static_cast<double>(packets) / virtual_s},
          {"insert_core_percent", 100 * insert_s / virtual_s},
          {"minutes_core_percent", 100 * minutes_s / virtual_s},
          {"insert_us_a_packet", 1e6 * insert_s / static_cast<double>(packets)},
          {"rss_mib", memory_kb("VmRSS") / 1024},
          {"rss_max_mib", memory_kb("VmHWM") / 1024},
          {"file_mib", static_cast<double>(std::filesystem::file_size(file)) / (1 << 20)}};
}

/// Names of all numbers of periodic structures that the archive has.
std::vector<std::string> parameters_of(const mission::Dictionary& dictionary) {
  std::vector<std::string> names;
  for (const mission::Structure& structure : dictionary.structures()) {
    if (structure.id == 0 || structure.interval <= milliseconds(0)) continue;
    for (std::uint32_t element = 0;; ++element) {
      const std::uint32_t number = (std::uint32_t{structure.id} << 16U) | element;
      const auto found = dictionary.telemetry(number);
      if (!found) break;
      const bool is_number =
          found->field->type != mission::FieldType::text && found->field->type != mission::FieldType::time;
      if (is_number) names.push_back(dictionary.telemetry_name(number));
    }
  }
  return names;
}

/// A parameter over the whole time, the archive opened anew each time, as the API does it.
Json ask(const ArchiveOptions& options, const mission::Dictionary& dictionary,
         const std::filesystem::path& file, UtcTime start) {
  const auto names = parameters_of(dictionary);
  const ground::Period period{start, start + nanoseconds(static_cast<std::int64_t>(options.hours * 3.6e12))};
  std::mt19937 random(options.seed + 1);
  std::vector<double> times_ms;
  std::size_t fewest = SIZE_MAX;
  std::string slowest;
  for (int i = 0; i < options.queries; ++i) {
    const std::string& name =
        names.at(std::uniform_int_distribution<std::size_t>(0, names.size() - 1)(random));
    const MonotonicTime begin = monotonic_now();
    const auto archive = ground::open_archive(file, ground::ArchiveUse::read);
    if (!archive) throw std::runtime_error(archive.error());
    const auto found = ground::history(**archive, dictionary, name, period, points);
    if (!found) throw std::runtime_error(name + ": " + found.error());
    const double took_ms = 1e-6 * static_cast<double>((monotonic_now() - begin).count());
    if (times_ms.empty() || took_ms > *std::max_element(times_ms.begin(), times_ms.end())) slowest = name;
    times_ms.push_back(took_ms);
    fewest = std::min(fewest, found->size());
  }
  return {{"parameters", names.size()},
          {"query_ms", bench::summary(times_ms)},
          {"slowest", slowest},
          {"fewest_points", fewest}};
}

Json measure_archive(const ArchiveOptions& options) {
  const auto dictionary = mission::Dictionary::load(mission::Dictionary::default_folder());
  const testing_support::TemporaryFolder folder;
  const auto file = folder.path() / "archive.sqlite";
  const UtcTime start = *from_iso8601("2026-01-01T00:00:00Z");
  Json result = record(options, dictionary, file, start);
  result.update(ask(options, dictionary, file, start));
  return result;
}

struct StartOptions {
  int rounds = 50;
};

/// A station at a pseudo terminal, whose far end is a line without a spacecraft.
class Station {
 public:
  Station() {
    std::filesystem::create_directories(folder_.path() / "keys");
    for (const char* name : {"tc_uplink", "tc_uplink_ad", "tm_downlink"}) write_key(name);
    grantpt(line_.get());
    unlockpt(line_.get());
    const std::string near = ptsname(line_.get());
    near_ = Fd(::open(near.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC));
    termios settings{};
    tcgetattr(near_.get(), &settings);
    cfmakeraw(&settings);
    tcsetattr(near_.get(), TCSANOW, &settings);
    std::filesystem::create_symlink(near, port());
    server_.emplace(start({"serve"}));
    if (!readable(server_->output())) throw std::runtime_error("srfs-ground serve does not start");
  }

  [[nodiscard]] std::filesystem::path port() const { return folder_.path() / "rs422"; }
  [[nodiscard]] std::filesystem::path cache() const {
    return folder_.path() / "ground" / ground::dictionary_cache_name;
  }
  /// ms until the first octet of a telecommand is on the line.
  double telecommand_ms() {
    drain();
    const MonotonicTime begin = monotonic_now();
    auto command = start({"tc", "eps.switch_load", "load=1", "state=on", "--timeout", "0.05"});
    if (!readable(line_.get())) throw std::runtime_error("no telecommand came");
    const double took = since_ms(begin);
    read_to_end(command);
    return took;
  }
  /// ms until all telecommands of the dictionary are printed.
  double list_ms() {
    const MonotonicTime begin = monotonic_now();
    auto command = start({"--json", "list"});
    if (read_to_end(command) < 10'000) throw std::runtime_error("the list is short");
    return since_ms(begin);
  }

 private:
  static double since_ms(MonotonicTime begin) {
    return 1e-6 * static_cast<double>((monotonic_now() - begin).count());
  }
  static bool readable(int fd) {
    pollfd wait{fd, POLLIN, 0};
    return ::poll(&wait, 1, 30'000) == 1 && (wait.revents & POLLIN) != 0;
  }
  void write_key(const std::string& name) const {
    const auto file = folder_.path() / "keys" / (name + ".key");
    std::ofstream(file) << std::string(63, '0') << std::hex << name.size() << "\n";  // each another
    std::filesystem::permissions(file,
                                 std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  }
  ChildProcess start(const std::vector<std::string>& words) const {
    std::error_code error;
    const auto bin = std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
    std::vector<std::string> command{bin / "srfs-ground", "--port", port()};
    command.insert(command.end(), words.begin(), words.end());
    auto started = ChildProcess::start(command);
    if (!started) throw std::runtime_error(started.error());
    return std::move(*started);
  }
  static std::size_t read_to_end(ChildProcess& command) {
    std::array<char, 65536> chunk{};
    for (std::size_t octets = 0;;) {
      pollfd wait{command.output(), POLLIN, 0};
      if (::poll(&wait, 1, 30'000) != 1) throw std::runtime_error("srfs-ground does not end");
      const ssize_t got = ::read(command.output(), chunk.data(), chunk.size());
      if (got <= 0) return octets;
      octets += static_cast<std::size_t>(got);
    }
  }
  void drain() {
    std::array<char, 65536> chunk{};
    pollfd wait{line_.get(), POLLIN, 0};
    while (::poll(&wait, 1, 0) == 1 && ::read(line_.get(), chunk.data(), chunk.size()) > 0) {
    }
  }

  testing_support::TemporaryFolder folder_;
  Fd line_{posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC)};
  Fd near_;
  std::optional<ChildProcess> server_;
};

/// From the start of a command to the first octet on the line, by a server; with and without the cache of
/// the dictionary, in turn.
Json measure_start(const StartOptions& options) {
  Station station;
  std::map<std::string, std::vector<double>> times;
  for (int i = 0; i < options.rounds; ++i) {
    std::filesystem::remove(station.cache());
    times["telecommand_uncached_ms"].push_back(station.telecommand_ms());
    times["telecommand_ms"].push_back(station.telecommand_ms());
    times["list_ms"].push_back(station.list_ms());
    std::filesystem::remove(station.cache());
    times["list_uncached_ms"].push_back(station.list_ms());
  }
  Json result;
  for (const auto& [name, values] : times) result[name] = bench::summary(values);
  return result;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Measures the ground station; prints JSON. Files are in $TMPDIR"};
  app.require_subcommand(1);
  Json result;
  ArchiveOptions archive;
  auto* sub = app.add_subcommand("archive", "Made telemetry into an archive, histories out of it");
  sub->add_option("--hours", archive.hours, "Of telemetry")
      ->check(CLI::Range(0.05, 240.0))
      ->capture_default_str();
  sub->add_option("--rate", archive.rate, "How many times as often as the dictionary says")
      ->check(CLI::Range(0.1, 100.0))
      ->capture_default_str();
  sub->add_option("--queries", archive.queries)->check(CLI::Range(10, 100'000))->capture_default_str();
  sub->add_option("--seed", archive.seed)->capture_default_str();
  sub->callback([&] { result = measure_archive(archive); });
  StartOptions start;
  sub = app.add_subcommand("start", "From the start of a command to the line");
  sub->add_option("--rounds", start.rounds)->check(CLI::Range(1, 10'000))->capture_default_str();
  sub->callback([&] { result = measure_start(start); });
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_ground: %s\n", error.what());
    return 1;
  }
  std::printf("%s\n", result.dump().c_str());
  return 0;
}
