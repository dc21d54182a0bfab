// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/stream_hub.hpp"

#include <utility>

#include <fmt/format.h>

namespace srfs::ground::api {

StreamItem stream_item(std::int64_t id, const nlohmann::json& json) {
  std::string text = id == 0 ? "" : fmt::format("id: {}\n", id);
  text += fmt::format("event: {}\ndata: {}\n\n", json.value("type", "note"),
                      json.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace));
  return {id, std::make_shared<const std::string>(std::move(text))};
}

bool StreamHub::Reader::wait(milliseconds patience, std::vector<StreamItem>& items) {
  items.clear();
  std::unique_lock lock(mutex_);
  came_.wait_for(lock, patience, [this] { return over_ || !queue_.empty(); });
  if (over_) return false;
  items.assign(queue_.begin(), queue_.end());
  queue_.clear();
  octets_ = 0;
  return true;
}

std::shared_ptr<StreamHub::Reader> StreamHub::subscribe() {
  const std::lock_guard lock(mutex_);
  if (closed_ || readers_.size() >= readers_max) return nullptr;
  auto reader = std::make_shared<Reader>();
  readers_.insert(reader);
  return reader;
}

void StreamHub::unsubscribe(const std::shared_ptr<Reader>& reader) {
  const std::lock_guard lock(mutex_);
  readers_.erase(reader);
}

void StreamHub::end(Reader& reader) {
  reader.over_ = true;
  reader.queue_.clear();
  reader.octets_ = 0;
  reader.came_.notify_one();
}

void StreamHub::publish(const StreamItem& item) {
  const std::lock_guard lock(mutex_);
  std::erase_if(readers_, [&](const auto& reader) {
    const std::lock_guard of_reader(reader->mutex_);
    if (reader->octets_ + item.text->size() > queue_octets_max) {
      ++overflows_;
      end(*reader);
      return true;
    }
    reader->queue_.push_back(item);
    reader->octets_ += item.text->size();
    reader->came_.notify_one();
    return false;
  });
}

void StreamHub::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  for (const auto& reader : readers_) {
    const std::lock_guard of_reader(reader->mutex_);
    end(*reader);
  }
  readers_.clear();
}

std::size_t StreamHub::readers() {
  const std::lock_guard lock(mutex_);
  return readers_.size();
}

}  // namespace srfs::ground::api
