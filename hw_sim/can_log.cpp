// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/can_log.hpp"

#include <system_error>

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "base/octets.hpp"

namespace srfs::sim {
namespace {

constexpr std::size_t most_waiting = 65536;

Fd create(const std::filesystem::path& file) {
  std::error_code ec;
  std::filesystem::create_directories(file.parent_path(), ec);
  return Fd(open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
}

}  // namespace

std::string candump_line(const BusDelivery& delivery) {
  const BusFrame& frame = delivery.frame;
  const std::int64_t us = delivery.end.ns() / 1000;
  const std::string id = frame.extended ? fmt::format("{:08X}", frame.id) : fmt::format("{:03X}", frame.id);
  std::string text = fmt::format("({}.{:06d}) can0 {}#", us / 1'000'000, us % 1'000'000, id);
  if (frame.remote) return text + "R\n";
  for (std::size_t i = 0; i < frame.size; ++i) text += fmt::format("{:02X}", frame.data[i]);
  return text + '\n';
}

CanLog::CanLog(std::filesystem::path file, std::size_t limit)
    : file_(std::move(file)), limit_(limit), fd_(create(file_)) {}

void CanLog::record(const BusDelivery& delivery) {
  waiting_ += candump_line(delivery);
  if (waiting_.size() > most_waiting) flush();
}

void CanLog::flush() {
  if (waiting_.empty()) return;
  if (size_ + waiting_.size() > limit_) {
    std::error_code ec;
    std::filesystem::rename(file_, file_.string() + ".1", ec);
    fd_ = create(file_);
    size_ = 0;
  }
  const ssize_t n = fd_ ? write(fd_.get(), waiting_.data(), waiting_.size()) : -1;
  const std::size_t written = n > 0 ? static_cast<std::size_t>(n) : 0;
  size_ += written;
  lost_ += waiting_.size() - written;
  waiting_.clear();
}

}  // namespace srfs::sim
