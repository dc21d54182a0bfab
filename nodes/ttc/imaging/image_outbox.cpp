// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/imaging/image_outbox.hpp"

#include <algorithm>
#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <mission/structures.hpp>

#include "base/fd.hpp"
#include "base/log.hpp"
#include "base/text.hpp"
#include "image/file/frame_mark.hpp"

namespace srfs {
namespace {

constexpr std::string_view product_prefix = "image_";
constexpr std::string_view strip_prefix = "strip_";
constexpr std::string_view outbox_prefix = "outbox/";
constexpr std::size_t rank_digits = 3;
constexpr std::size_t task_digits = 10;
constexpr std::size_t frame_digits = 4;
constexpr std::size_t run_digits = 8;  // hexadecimal
constexpr int name_attempts = 9;

/// Takes a number of so many digits and the underscore behind it.
template <class Number>
bool take(std::string_view& rest, std::size_t digits, Number& number, int base = 10) {
  if (rest.size() <= digits || rest[digits] != '_') return false;
  const auto found = to_number<Number>(rest.substr(0, digits), base);
  if (!found) return false;
  number = *found;
  rest.remove_prefix(digits + 1);
  return true;
}

/// Below the folder of images and nowhere else.
bool is_inside(const std::string& file) {
  const std::filesystem::path path(file);
  return !file.empty() && path.is_relative() && std::all_of(path.begin(), path.end(), [](const auto& part) {
    return !part.empty() && part != ".." && part != ".";
  });
}

bool same_file(const std::filesystem::path& a, const std::filesystem::path& b) {
  struct stat first {};
  struct stat second {};
  return ::lstat(a.c_str(), &first) == 0 && ::lstat(b.c_str(), &second) == 0 &&
         first.st_dev == second.st_dev && first.st_ino == second.st_ino;
}

/// As one step, by link, or by a copy where the two folders are on different file systems. @return errno
int put(const std::filesystem::path& from, const std::filesystem::path& to) {
  struct stat info {};
  if (::lstat(from.c_str(), &info) != 0) return errno;
  if (!S_ISREG(info.st_mode)) return EINVAL;
  if (::link(from.c_str(), to.c_str()) == 0) return 0;
  if (errno == EEXIST && same_file(from, to)) return 0;  // queued before a restart
  if (errno != EXDEV && errno != EPERM && errno != EMLINK) return errno;
  std::error_code failed;
  if (std::filesystem::exists(to, failed)) return EEXIST;
  const std::filesystem::path part = to.parent_path() / ("." + to.filename().string());
  std::filesystem::copy_file(from, part, std::filesystem::copy_options::overwrite_existing, failed);
  if (failed) return failed.value() != 0 ? failed.value() : EIO;
  const Fd copy(::open(part.c_str(), O_RDONLY | O_CLOEXEC));
  if (!copy || ::fsync(copy.get()) != 0) return errno;
  if (!failed) std::filesystem::rename(part, to, failed);
  return failed ? (failed.value() != 0 ? failed.value() : EIO) : 0;
}

std::uint16_t code_of(int error) {
  switch (error) {
    case ENOSPC:
    case EDQUOT:
      return mission::failure::no_space;
    case ENOENT:
      return mission::failure::file_not_found;
    case EEXIST:
      return mission::failure::outbox_full;
    case EROFS:
    case EACCES:
      return mission::failure::file_denied;
    default:
      return mission::failure::disk_failed;
  }
}

std::filesystem::path frame_folder(std::uint32_t task) {
  return std::filesystem::path("frames") / fmt::format("{:0{}}", task, task_digits);
}

}  // namespace

std::optional<OutboxImage> outbox_image(std::string_view name) {
  const bool is_strip = name.starts_with(strip_prefix);
  if (!is_strip && !name.starts_with(product_prefix)) return std::nullopt;
  name.remove_prefix(is_strip ? strip_prefix.size() : product_prefix.size());
  OutboxImage image;
  std::uint32_t rank = 0;
  if (!take(name, rank_digits, rank)) return std::nullopt;
  if (!is_strip && name.starts_with('r')) {
    name.remove_prefix(1);
    if (!take(name, run_digits, image.run, 16)) return std::nullopt;
  }
  if (!take(name, task_digits, image.task)) return std::nullopt;
  if (is_strip && !take(name, frame_digits, image.frame)) return std::nullopt;
  return image;
}

std::string outbox_image_name(const OutboxImage& image, std::size_t rank, std::string_view name) {
  const std::string run = image.run == 0 ? "" : fmt::format("r{:0{}x}_", image.run, run_digits);
  const std::string of = fmt::format("{}{:0{}}_{}{:0{}}_", image.frame == 0 ? product_prefix : strip_prefix,
                                     rank, rank_digits, run, image.task, task_digits);
  return image.frame == 0 ? of + std::string(name)
                          : fmt::format("{}{:0{}}_{}", of, image.frame, frame_digits, name);
}

std::vector<std::string> ImageOutbox::frames_of(std::uint32_t task, std::uint16_t frame) const {
  const std::filesystem::path folder = frame_folder(task);
  std::vector<std::string> frames;
  std::error_code failed;
  for (std::filesystem::directory_iterator it(images_ / folder, failed), end; !failed && it != end;
       it.increment(failed)) {
    const std::filesystem::path name = it->path().filename();
    if (name.extension() != ".fits" || name.string().starts_with('.')) continue;
    if (frame != 0 && name.string() != fmt::format("{:0{}}.fits", frame, frame_digits)) continue;
    frames.push_back((folder / name).string());
  }
  std::sort(frames.begin(), frames.end());
  return frames;
}

std::vector<std::string> ImageOutbox::newest_frames_of(std::uint32_t task, std::uint16_t frame) const {
  std::vector<std::string> frames = frames_of(task, frame);
  if (frames.size() > max_frames) frames.erase(frames.begin(), frames.end() - max_frames);
  return frames;
}

QueuedProducts ImageOutbox::queue(const OutboxImage& image, const std::vector<std::string>& products,
                                  const std::function<bool(const std::string&)>& is_sending) {
  const std::filesystem::path outbox = files_ / "outbox";
  std::error_code failed;
  std::filesystem::create_directories(outbox, failed);
  std::size_t waiting = 0;
  for (std::filesystem::directory_iterator it(outbox, failed), end; !failed && it != end;
       it.increment(failed))
    ++waiting;
  if (failed) return {.failure = code_of(failed.value()), .reason = failed.message()};
  if (waiting + products.size() > max_outbox_files)
    return {.failure = mission::failure::outbox_full, .reason = "too many files wait in the outbox"};
  QueuedProducts done;
  for (std::size_t i = 0; i < products.size(); ++i) {
    const std::string& product = products[i];
    if (!is_inside(product)) return {mission::failure::bad_file_name, product, done.queued};
    const std::string name = std::filesystem::path(product).filename();
    int error = EEXIST;
    // An earlier one of the same name, whose transfer must not be disturbed, may still wait there.
    for (int attempt = 1; error == EEXIST && attempt <= name_attempts; ++attempt) {
      const std::string given =
          outbox_image_name(image, i + 1, attempt == 1 ? name : fmt::format("{}_{}", attempt, name));
      // Its file may be gone while the ground does not know yet that it was cancelled.
      std::error_code none;
      const bool taken = is_sending && is_sending(given) && !std::filesystem::exists(outbox / given, none);
      error = taken ? EEXIST : put(images_ / product, outbox / given);
    }
    if (error != 0) return {code_of(error), fmt::format("{}: {}", product, errno_text(error)), done.queued};
    ++done.queued;
  }
  const Fd folder(::open(outbox.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (folder.get() < 0 || ::fsync(folder.get()) != 0)
    return {mission::failure::disk_failed, errno_text(errno), done.queued};
  return done;
}

std::vector<std::string> ImageOutbox::queued(std::uint32_t task) const {
  std::vector<std::string> names;
  std::error_code failed;
  for (std::filesystem::directory_iterator it(files_ / "outbox", failed), end; !failed && it != end;
       it.increment(failed)) {
    std::string name = it->path().filename();
    const auto image = outbox_image(name);
    if (image && image->task == task) names.push_back(std::move(name));
  }
  std::sort(names.begin(), names.end());
  return names;
}

std::size_t ImageOutbox::remove(const std::vector<std::string>& names) {
  std::size_t removed = 0;
  std::error_code failed;
  for (const std::string& name : names) {
    if (std::filesystem::remove(files_ / "outbox" / name, failed)) ++removed;
  }
  return removed;
}

bool ImageOutbox::is_left(const OutboxImage& image) const {
  for (const char* folder : {"outbox", "unsent"}) {
    std::error_code failed;
    for (std::filesystem::directory_iterator it(files_ / folder, failed), end; !failed && it != end;
         it.increment(failed)) {
      if (outbox_image(it->path().filename().string()) == image) return true;
    }
  }
  return false;
}

bool ImageOutbox::on_sent(std::string_view source_file) {
  if (!source_file.starts_with(outbox_prefix)) return false;
  const auto image = outbox_image(source_file.substr(outbox_prefix.size()));
  if (!image) return false;
  const bool known = std::find(to_mark_.begin(), to_mark_.end(), *image) != to_mark_.end();
  if (known || is_left(*image)) return true;
  if (to_mark_.size() == max_to_mark) to_mark_.pop_front();
  to_mark_.push_back(*image);
  return true;
}

void ImageOutbox::mark_some() {
  if (to_mark_.empty()) return;
  const OutboxImage image = to_mark_.front();
  const auto run = image.frame == 0 ? std::optional(image.run) : std::nullopt;
  std::size_t marked = 0;
  for (const std::string& frame : frames_of(image.task, image.frame)) {
    const std::filesystem::path path = images_ / frame;
    if (!image::lacks_sent_mark(path, run)) continue;
    if (marked++ == marks_per_call) return;  // goes on with the next call
    const auto done = image::mark_sent(path, run);
    if (done) continue;
    log::warn("{} is not marked as sent: {}", frame, done.error().message);
    break;
  }
  to_mark_.pop_front();
}

}  // namespace srfs
