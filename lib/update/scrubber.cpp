// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/scrubber.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.hpp"
#include "update/build_id.hpp"

namespace srfs::update {
namespace {

constexpr std::array manifest_copies{"manifest_a", "manifest_b"};
constexpr std::size_t largest_manifest = 1U << 20U;
constexpr std::string_view unfinished = ".mend";
constexpr mode_t permissions = 07777;

std::int64_t modified_ns(const struct stat& status) {
  return std::int64_t{status.st_mtim.tv_sec} * 1'000'000'000 + status.st_mtim.tv_nsec;
}

Result<void, std::string> sync_folder(const std::filesystem::path& folder) {
  const Fd fd(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!fd || fsync(fd.get()) != 0) return Err(fmt::format("{}: {}", folder.string(), errno_text(errno)));
  return {};
}

}  // namespace

/// One file read from its beginning to its end, and copied where there is a target.
class Scrubber::Pass {
 public:
  explicit Pass(const std::filesystem::path& from)
      : from_(open(from.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {
    if (!from_) fail("cannot be read", errno);
  }
  Pass(const std::filesystem::path& from, const std::filesystem::path& to) : Pass(from) {
    ::unlink(to.c_str());  // what a power loss left
    if (error_.empty())
      to_ = Fd(open(to.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600));
    if (error_.empty() && !to_) fail("cannot be copied", errno);
    copies_ = true;
  }

  /// @return false: at the end, or failed
  bool step(std::size_t most) {
    if (!error_.empty()) return false;
    buffer_.resize(most);
    const ssize_t n = read(from_.get(), buffer_.data(), most);
    if (n < 0 && errno == EINTR) return true;
    if (n < 0) fail("cannot be read", errno);
    if (n <= 0) return false;
    const OctetView piece(buffer_.data(), static_cast<std::size_t>(n));
    sha_.update(piece);
    octets_ += piece.size();
    for (std::size_t done = 0; copies_ && done < piece.size();) {
      const ssize_t written = write(to_.get(), piece.data() + done, piece.size() - done);
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) {
        fail("cannot be copied", errno);
        return false;
      }
      done += static_cast<std::size_t>(written);
    }
    return true;
  }

  /// Not what the kernel still has in memory of it.
  void read_from_the_medium() const {
    if (from_) posix_fadvise(from_.get(), 0, 0, POSIX_FADV_DONTNEED);
  }
  [[nodiscard]] const std::string& error() const { return error_; }
  [[nodiscard]] std::uint64_t octets() const { return octets_; }
  /// Once, at the end.
  [[nodiscard]] std::string sha256() { return to_digits(sha_.finish()); }
  [[nodiscard]] int target() const { return to_.get(); }

 private:
  void fail(const char* what, int error) { error_ = fmt::format("{}: {}", what, errno_text(error)); }

  Fd from_;
  Fd to_;
  bool copies_ = false;
  Sha256 sha_;
  std::uint64_t octets_ = 0;
  Octets buffer_;
  std::string error_;
};

Scrubber::Scrubber(Settings settings) : settings_(std::move(settings)) {}
Scrubber::~Scrubber() = default;

// ---------------------------------------------------------------- rounds

void Scrubber::begin(std::vector<ScrubFile> files, ScrubMode mode, UtcTime now) {
  if (status_.running) return;
  if (!manifest_read_) read_manifest();
  mode_ = mode;
  files_ = std::move(files);
  other_build_ = std::any_of(manifest_.files.begin(), manifest_.files.end(), [](const GoldenFile& golden) {
    return golden.kind == ScrubKind::program && is_another_build(golden.build_id, build_id_of(golden.path));
  });
  const bool taken_anew = mode == ScrubMode::retake || (mode == ScrubMode::start && other_build_);
  const auto is_listed = [&](const GoldenFile& golden) {
    return std::any_of(files_.begin(), files_.end(),
                       [&](const ScrubFile& file) { return file.path == golden.path; });
  };
  const auto given_up = [&](const GoldenFile& golden) {
    if (is_listed(golden)) return false;
    if (golden.kind == ScrubKind::version) return true;
    std::error_code ec;
    if (taken_anew && !std::filesystem::exists(golden.path, ec)) return true;
    files_.push_back({golden.path, golden.kind, {}});
    return false;
  };
  manifest_changed_ = std::erase_if(manifest_.files, given_up) != 0 || manifest_changed_;
  if (files_.size() > GoldenManifest::most_files) files_.resize(GoldenManifest::most_files);
  next_ = 0;
  taken_ = lost_ = unmended_ = 0;
  status_.running = true;
  status_.files = files_.size();
  status_.checked = 0;
  status_.octets = 0;
  next_file(now);
}

bool Scrubber::step(UtcTime now) {
  if (!status_.running) return false;
  if (pass_->step(settings_.slice_octets)) return true;
  switch (phase_) {
    case Phase::read_file:
      if (pass_->error().empty() && found_) {
        found_->octets = pass_->octets();
        found_->sha256 = pass_->sha256();
      } else {
        found_.reset();
      }
      after_file();
      break;
    case Phase::read_copy:
      after_copy(pass_->error().empty() && pass_->sha256() == golden_.sha256);
      break;
    case Phase::take:
      after_take();
      break;
    case Phase::mend_file:
    case Phase::mend_copy:
      after_mend();
  }
  if (!pass_) next_file(now);
  return status_.running;
}

void Scrubber::next_file(UtcTime now) {
  if (next_ > 0) ++status_.checked;
  if (next_ == files_.size()) {
    if (next_ == 0) status_.checked = 0;
    finish_round(now);
    return;
  }
  file_ = files_[next_++];
  found_.reset();
  struct stat status {};
  if (stat(file_.path.c_str(), &status) == 0 && S_ISREG(status.st_mode)) {
    found_.emplace();
    found_->modified_ns = modified_ns(status);
    found_->build_id = file_.kind == ScrubKind::program ? build_id_of(file_.path) : "";
    const nanoseconds age = nanoseconds(now.ns() - found_->modified_ns);
    found_->settled = age < nanoseconds(0) || age >= settings_.settled_after;
    found_mode_ = status.st_mode & permissions;
    status_.octets += static_cast<std::uint64_t>(status.st_size);
  }
  phase_ = Phase::read_file;
  pass_ = std::make_unique<Pass>(file_.path);
}

void Scrubber::finish_round(UtcTime now) {
  status_.running = false;
  if (manifest_changed_) {
    if (const auto saved = save_manifest(); !saved) {
      file_ = {settings_.folder / manifest_copies[0], ScrubKind::text, {}};
      leave(saved.error());
    } else {
      manifest_changed_ = false;
      if (std::exchange(manifest_damaged_, false)) {
        file_ = {settings_.folder / manifest_copies[0], ScrubKind::text, {}};
        ++status_.mended;
        say(ScrubFinding::What::mended, "");
      }
    }
  }
  // Unneeded copies, and what was begun and not finished. Not while the manifest on disk may name them.
  std::error_code ec;
  for (std::filesystem::directory_iterator it(settings_.folder, ec), end;
       !manifest_changed_ && !ec && it != end; it.increment(ec)) {
    const std::string name = it->path().filename().string();
    const bool named =
        std::find(manifest_copies.begin(), manifest_copies.end(), name) != manifest_copies.end() ||
        std::any_of(manifest_.files.begin(), manifest_.files.end(),
                    [&](const GoldenFile& file) { return file.sha256 == name; });
    if (!named) ::unlink(it->path().c_str());
  }
  ++status_.rounds;
  status_.last_round = now;
  status_.build = manifest_.build();
  status_.taken = taken_;
  status_.lost = lost_;
  status_.unmended = unmended_;
}

// ---------------------------------------------------------------- one file

/// The file has been read: is it taken for good, or compared?
void Scrubber::after_file() {
  pass_.reset();
  const GoldenFile* golden = manifest_.find(file_.path.string());
  const bool is_version = file_.kind == ScrubKind::version;
  bool take = golden == nullptr || (is_version && golden->sha256 != file_.sha256);
  if (golden != nullptr && !is_version && found_) {
    const ScrubVerdict verdict = judge(*golden, found_);
    take = (verdict != ScrubVerdict::good && mode_ == ScrubMode::retake) ||
           (verdict == ScrubVerdict::changed && mode_ == ScrubMode::start);
  }
  if (!take) {
    golden_ = *golden;
    phase_ = Phase::read_copy;
    pass_ = std::make_unique<Pass>(copy_of(golden_));
    pass_->read_from_the_medium();
    return;
  }
  if (!found_) return lose("missing, and no copy exists");
  if (is_version && found_->sha256 != file_.sha256) return lose("wrong SHA-256, and no copy exists");
  if (!is_version && !found_->settled && mode_ != ScrubMode::retake) return;  // next time
  golden_ = {file_.path.string(), file_.kind,  found_->sha256,  found_->octets,
             found_->modified_ns, found_mode_, found_->build_id};
  std::error_code ec;
  std::filesystem::create_directories(settings_.folder, ec);
  std::filesystem::permissions(settings_.folder, std::filesystem::perms::owner_all,
                               ec);  // there are keys in it
  const auto space = std::filesystem::space(settings_.folder, ec);
  if (!ec && space.available < golden_.octets + settings_.keep_free_octets)
    return leave("no disk space for a copy");
  begin_copy(Phase::take, file_.path, copy_of(golden_));
}

void Scrubber::after_copy(bool good) {
  const std::string copy_error = pass_->error();
  pass_.reset();
  const auto say_copy_is_bad = [&] {
    return copy_error.empty() ? std::string("its copy is damaged") : "its copy " + copy_error;
  };
  switch (judge(golden_, found_)) {
    case ScrubVerdict::good:
      if (good) return;
      say(ScrubFinding::What::damaged, say_copy_is_bad());
      begin_copy(Phase::mend_copy, file_.path, copy_of(golden_));
      return;
    case ScrubVerdict::changed:
      return leave("changed on purpose; accepted by scrub.retake or at a restart");
    case ScrubVerdict::unsettled:
      return;
    case ScrubVerdict::damaged:
      break;
  }
  // The old copy of a file beside new ones would be worse than the damage.
  const bool may_belong_to_it =
      !found_ || (golden_.kind == ScrubKind::program && found_->build_id != golden_.build_id);
  if (other_build_ && golden_.kind != ScrubKind::version && may_belong_to_it)
    return leave("damaged or missing, and another build is installed");
  say(ScrubFinding::What::damaged,
      !found_ ? "missing or unreadable"
      : found_->octets != golden_.octets
          ? fmt::format("{} octets instead of {}", found_->octets, golden_.octets)
          : "wrong SHA-256");
  if (!good) return lose(say_copy_is_bad() + " too");
  begin_copy(Phase::mend_file, copy_of(golden_), file_.path);
}

void Scrubber::begin_copy(Phase phase, const std::filesystem::path& from, const std::filesystem::path& to) {
  phase_ = phase;
  target_ = to;
  pass_ = std::make_unique<Pass>(from, to.string() + std::string(unfinished));
}

/// What was copied gets its name, when it is what it has to be.
Result<void, std::string> Scrubber::place_copy() {
  const std::filesystem::path copy = target_.string() + std::string(unfinished);
  std::string why = pass_->error();
  if (why.empty() && pass_->sha256() != golden_.sha256) why = "changed while being copied";
  if (why.empty() && phase_ == Phase::mend_file) {
    const timespec time{static_cast<time_t>(golden_.modified_ns / 1'000'000'000),
                        static_cast<long>(golden_.modified_ns % 1'000'000'000)};
    const std::array times{time, time};
    if (fchmod(pass_->target(), golden_.mode) != 0 || futimens(pass_->target(), times.data()) != 0)
      why = errno_text(errno);
  }
  if (why.empty() && fsync(pass_->target()) != 0) why = errno_text(errno);
  if (why.empty() && ::rename(copy.c_str(), target_.c_str()) != 0) why = errno_text(errno);
  pass_.reset();
  if (!why.empty()) {
    ::unlink(copy.c_str());
    return Err(why);
  }
  return sync_folder(target_.parent_path());
}

void Scrubber::after_take() {
  if (const auto placed = place_copy(); !placed) return leave(placed.error());
  manifest_.put(golden_);
  manifest_changed_ = true;
  ++taken_;
}

void Scrubber::after_mend() {
  if (const auto placed = place_copy(); !placed) return leave(placed.error());
  ++status_.mended;
  say(ScrubFinding::What::mended, "");
}

void Scrubber::say(ScrubFinding::What what, std::string why) {
  if (what == ScrubFinding::What::damaged) {
    ++status_.damaged;
    status_.last_damaged = file_.path.string();
  }
  findings_.push_back({what, file_.path.string(), std::move(why)});
}

void Scrubber::lose(std::string why) {
  ++lost_;
  say(ScrubFinding::What::left, std::move(why));
}

void Scrubber::leave(std::string why) {
  ++unmended_;
  say(ScrubFinding::What::left, std::move(why));
}

// ---------------------------------------------------------------- the manifest

void Scrubber::read_manifest() {
  manifest_read_ = true;
  std::error_code ec;
  bool any = false;
  std::optional<GoldenManifest> newest;
  for (const char* copy : manifest_copies) {
    if (!std::filesystem::exists(settings_.folder / copy, ec)) {
      manifest_changed_ = true;
      continue;
    }
    any = true;
    const auto text = read_file(settings_.folder / copy, largest_manifest);
    auto manifest = text ? decode_golden(*text) : std::nullopt;
    if (!manifest) {
      manifest_changed_ = manifest_damaged_ = true;
      file_ = {settings_.folder / copy, ScrubKind::text, {}};
      say(ScrubFinding::What::damaged, text ? "wrong checksum" : text.error().message);
    } else if (!newest || manifest->revision > newest->revision) {
      newest = std::move(manifest);
    }
  }
  manifest_changed_ = manifest_changed_ && any;  // the first round writes it
  if (!newest && any) {
    manifest_damaged_ = false;
    say(ScrubFinding::What::left, "both manifests damaged; all files accepted as they are");
  }
  if (newest) manifest_ = std::move(*newest);
  status_.build = manifest_.build();
}

Result<void, std::string> Scrubber::save_manifest() {
  ++manifest_.revision;
  const std::string text = encode(manifest_);
  std::string why;
  bool any = false;
  for (const char* copy : manifest_copies) {
    const auto written = write_file_atomically(settings_.folder / copy, text);
    any = any || written;
    if (!written) why = written.error().message;
  }
  if (!any) return Err(why);
  return {};
}

}  // namespace srfs::update
