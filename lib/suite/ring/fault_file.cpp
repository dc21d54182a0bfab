// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/ring/fault_file.hpp"

#include <algorithm>
#include <array>
#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include "base/crc32c.hpp"
#include "base/fd.hpp"
#include "base/text.hpp"

namespace srfs::suite {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t longest_text = 200;
constexpr std::size_t checksum_digits = 8;

Json optional_us(const std::optional<nanoseconds>& d) {
  return d ? Json(d->count() / 1000) : Json(nullptr);
}

Json optional_number(const std::optional<std::uint32_t>& number) {
  return number ? Json(*number) : Json(nullptr);
}

/// @return false: there is no such value, or of another type
template <class T>
bool get(const Json& json, const char* key, T& value) {
  const auto found = json.find(key);
  if (found == json.end()) return false;
  if constexpr (std::is_same_v<T, std::string>) {
    if (!found->is_string()) return false;
  } else if (!found->is_number_integer()) {
    return false;
  }
  value = found->template get<T>();
  return true;
}

std::optional<nanoseconds> microseconds_of(const Json& json, const char* key) {
  std::int64_t us = 0;
  return get(json, key, us) ? std::optional<nanoseconds>(microseconds(us)) : std::nullopt;
}

std::optional<std::uint32_t> number_of(const Json& json, const char* key) {
  std::uint32_t number = 0;
  return get(json, key, number) ? std::optional(number) : std::nullopt;
}

/// The number of the newest whole line of the file's end; 0: there is none.
std::uint64_t last_sequence(int fd, off_t size) {
  std::array<char, 4 * FaultLedger::longest_line> tail{};
  const off_t from = std::max<off_t>(0, size - static_cast<off_t>(tail.size()));
  const ssize_t n = pread(fd, tail.data(), tail.size(), from);
  std::string_view text(tail.data(), static_cast<std::size_t>(std::max<ssize_t>(n, 0)));
  while (!text.empty()) {
    const std::size_t before = text.substr(0, text.size() - 1).rfind('\n');
    const std::size_t begin = before == std::string_view::npos ? 0 : before + 1;
    std::string_view line = text.substr(begin);
    while (line.ends_with('\n')) line.remove_suffix(1);
    if (const auto record = decode_fault(line)) return record->sequence;
    text = text.substr(0, begin);
  }
  return 0;
}

}  // namespace

std::string encode(const FaultRecord& record) {
  // One octet stays one octet (two for quotes), so that the line has a longest length.
  const auto cut = [](const std::string& text) {
    std::string kept = text.substr(0, longest_text);
    std::replace_if(
        kept.begin(), kept.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
    return kept;
  };
  Json j{{"kind", record.kind == FaultRecord::Kind::fault ? "fault" : "active"},
         {"seq", record.sequence},
         {"utc", to_iso8601(record.utc, 6)},
         {"mono_ns", record.monotonic.ns()},
         {"boot", cut(record.boot)},
         {"observer", cut(record.observer)},
         {"subject", cut(record.subject)},
         {"class", static_cast<int>(record.fault)},
         {"class_text", to_text(record.fault)},
         {"misses", record.misses},
         {"detail", cut(record.detail)},
         {"cause", cut(record.cause)},
         {"kernel_state", std::string(1, record.kernel_state)},
         {"old", record.old_incarnation},
         {"new", record.new_incarnation},
         {"outcome", static_cast<int>(record.outcome)},
         {"outcome_text", to_text(record.outcome)},
         {"reason", cut(record.reason)},
         {"version", optional_number(record.version)},
         {"failed_version", optional_number(record.failed_version)},
         {"last_turn_age_us", optional_us(record.last_turn_age)},
         {"judged_us", optional_us(record.judged)},
         {"killed_us", optional_us(record.killed)},
         {"started_us", optional_us(record.started)},
         {"active_us", optional_us(record.active)}};
  const std::string text = j.dump(-1, ' ', false, Json::error_handler_t::replace);
  return fmt::format("{}\t{:08x}", text, crc32c(as_octets(text)));
}

std::optional<FaultRecord> decode_fault(std::string_view line) {
  if (line.size() < checksum_digits + 1 || line[line.size() - checksum_digits - 1] != '\t')
    return std::nullopt;
  const std::string_view text = line.substr(0, line.size() - checksum_digits - 1);
  if (line.substr(line.size() - checksum_digits) != fmt::format("{:08x}", crc32c(as_octets(text))))
    return std::nullopt;
  const Json j = Json::parse(text, nullptr, false);
  if (!j.is_object()) return std::nullopt;
  FaultRecord r;
  std::string kind;
  std::string utc;
  std::string state;
  std::int64_t monotonic_ns = 0;
  int fault = 0;
  int outcome = 0;
  const bool complete = get(j, "kind", kind) && get(j, "seq", r.sequence) && get(j, "utc", utc) &&
                        get(j, "mono_ns", monotonic_ns) && get(j, "boot", r.boot) &&
                        get(j, "observer", r.observer) && get(j, "subject", r.subject) &&
                        get(j, "class", fault) && get(j, "misses", r.misses) && get(j, "detail", r.detail) &&
                        get(j, "cause", r.cause) && get(j, "kernel_state", state) &&
                        get(j, "old", r.old_incarnation) && get(j, "new", r.new_incarnation) &&
                        get(j, "outcome", outcome) && get(j, "reason", r.reason);
  const auto time = from_iso8601(utc);
  if (!complete || !time || state.size() != 1) return std::nullopt;
  r.kind = kind == "active" ? FaultRecord::Kind::active : FaultRecord::Kind::fault;
  r.utc = *time;
  r.monotonic = MonotonicTime(nanoseconds(monotonic_ns));
  r.kernel_state = state[0];
  r.fault = static_cast<FaultClass>(fault);
  r.outcome = static_cast<RestartOutcome::What>(outcome);
  r.version = number_of(j, "version");  // lines of earlier releases have none
  r.failed_version = number_of(j, "failed_version");
  r.last_turn_age = microseconds_of(j, "last_turn_age_us");
  r.judged = microseconds_of(j, "judged_us");
  r.killed = microseconds_of(j, "killed_us");
  r.started = microseconds_of(j, "started_us");
  r.active = microseconds_of(j, "active_us");
  return r;
}

Result<std::uint64_t, std::string> append_fault(const std::filesystem::path& path, FaultRecord record) {
  std::error_code ec;
  std::filesystem::create_directories(path.parent_path(), ec);
  Fd fd;
  off_t size = 0;
  const auto failed = [&](const char* what) {
    return Err(fmt::format("{}: cannot {}: {}", path.string(), what, errno_text(errno)));
  };
  const auto open_file = [&] {
    fd = Fd(open(path.c_str(), O_RDWR | O_CREAT | O_APPEND | O_NOFOLLOW | O_CLOEXEC, 0644));
    struct stat status {};
    if (fd && fstat(fd.get(), &status) == 0) size = status.st_size;
    return static_cast<bool>(fd);
  };
  if (!open_file()) return failed("open");
  record.sequence = last_sequence(fd.get(), size) + 1;
  if (record.sequence == 1 && size == 0) {
    // The first line after a change of file goes on from the file before.
    const Fd before(open((path.string() + ".1").c_str(), O_RDONLY | O_CLOEXEC));
    struct stat status {};
    if (before && fstat(before.get(), &status) == 0)
      record.sequence = last_sequence(before.get(), status.st_size) + 1;
  }
  std::string line = encode(record) + "\n";
  if (static_cast<std::size_t>(size) + line.size() > FaultLedger::largest_file) {
    std::filesystem::rename(path, path.string() + ".1", ec);
    if (ec || !open_file()) return failed("replace");
  }
  char last = '\n';
  if (size > 0 && pread(fd.get(), &last, 1, size - 1) == 1 && last != '\n')
    line.insert(0, "\n");  // a torn tail
  const ssize_t n = write(fd.get(), line.data(), line.size());
  if (n != static_cast<ssize_t>(line.size())) {
    const auto error = failed("write");
    if (n > 0) [[maybe_unused]]
      const int ignored = ftruncate(fd.get(), size);
    return error;
  }
  if (fdatasync(fd.get()) != 0) return failed("sync");
  return record.sequence;
}

}  // namespace srfs::suite
