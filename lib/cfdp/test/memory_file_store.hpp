// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cassert>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "cfdp/file_store.hpp"

namespace srfs::cfdp {

/// Thrown when the simulated computer dies during a call of the store.
struct Killed {};

/// A disk in memory that can lose unsynced data, refuse selected calls, and kill its user at any call.
class MemoryFileStore final : public FileStore {
 public:
  struct File {
    Octets octets;
    FileStamp stamp;
  };
  std::map<std::string, File, std::less<>> files;
  Octets checkpoint;
  std::optional<FileFault> write_fault;
  std::optional<FileFault> commit_fault;
  std::optional<FileFault> room_fault;
  std::optional<FileFault> sync_fault;
  std::optional<FileFault> checkpoint_fault;
  std::optional<std::size_t> calls_until_kill;  ///< counts changing calls only
  bool kill_after_effect = false;               ///< the fatal call still changes the disk
  std::size_t largest_read = 0;

  void add(const std::string& name, Octets octets) {
    const std::size_t size = octets.size();
    files[name] = {.octets = std::move(octets),
                   .stamp = {.octets = size, .inode = ++last_inode_, .modified_ns = 0}};
  }
  [[nodiscard]] const Octets* content(const std::string& name) const {
    const auto found = files.find(name);
    return found == files.end() ? nullptr : &found->second.octets;
  }
  [[nodiscard]] std::size_t temporaries() const { return temporaries_.size(); }
  /// Simulates a power loss, or a kill before the process' writes reached the disk.
  void lose_unsynced() {
    for (auto& [id, t] : temporaries_) t.now = t.synced;
  }

  FileResult<FileStamp> stamp(std::string_view name) override {
    if (name.find("..") != std::string_view::npos) return Err(FileFault::bad_name);
    const auto found = files.find(name);
    if (found == files.end()) return Err(FileFault::not_found);
    return found->second.stamp;
  }
  FileResult<std::size_t> read(std::string_view name, std::uint64_t offset,
                               std::span<std::uint8_t> into) override {
    const auto found = files.find(name);
    if (found == files.end()) return Err(FileFault::not_found);
    return copy(found->second.octets, offset, into);
  }
  FileResult<void> check_destination(std::string_view name) override {
    if (name.empty() || name.front() == '/' || name.find("..") != std::string_view::npos) {
      return Err(FileFault::bad_name);
    }
    return {};
  }
  FileResult<void> create_temporary(TransactionId id) override {
    return change([&] { temporaries_[id] = {}; });
  }
  FileResult<void> check_room(std::uint64_t) override {
    if (room_fault) return Err(*room_fault);
    return {};
  }
  FileResult<void> write_temporary(TransactionId id, std::uint64_t offset, OctetView data) override {
    if (write_fault) return Err(*write_fault);
    if (!temporaries_.contains(id)) return Err(FileFault::not_found);
    return change([&] {
      Octets& octets = temporaries_[id].now;
      octets.resize(std::max<std::size_t>(octets.size(), offset + data.size()));
      std::copy(data.begin(), data.end(), octets.begin() + static_cast<std::ptrdiff_t>(offset));
    });
  }
  FileResult<std::size_t> read_temporary(TransactionId id, std::uint64_t offset,
                                         std::span<std::uint8_t> into) override {
    const auto found = temporaries_.find(id);
    if (found == temporaries_.end()) return Err(FileFault::not_found);
    return copy(found->second.now, offset, into);
  }
  FileResult<void> sync_temporary(TransactionId id) override {
    if (sync_fault) return Err(*sync_fault);
    return change([&] { temporaries_[id].synced = temporaries_[id].now; });
  }
  FileResult<void> commit(TransactionId id, std::uint64_t octets, std::string_view name) override {
    if (commit_fault) return Err(*commit_fault);
    if (!temporaries_.contains(id)) return Err(FileFault::not_found);
    return change([&] {
      Octets content = temporaries_[id].now;
      content.resize(octets);
      temporaries_.erase(id);
      add(std::string(name), std::move(content));
    });
  }
  void discard_temporary(TransactionId id) override {
    (void)change([&] { temporaries_.erase(id); });
  }
  void discard_temporaries_except(std::span<const TransactionId> kept) override {
    std::erase_if(temporaries_,
                  [&](const auto& t) { return std::find(kept.begin(), kept.end(), t.first) == kept.end(); });
  }
  std::vector<std::string> list(std::string_view folder, std::size_t names_max) override {
    const std::string prefix = std::string(folder) + "/";
    std::vector<std::string> names;
    for (auto it = files.lower_bound(prefix); it != files.end() && it->first.starts_with(prefix); ++it) {
      if (names.size() < names_max) names.push_back(it->first.substr(prefix.size()));
    }
    return names;
  }
  void remove(std::string_view name) override {
    (void)change([&] {
      if (const auto found = files.find(name); found != files.end()) files.erase(found);
    });
  }
  bool rename(std::string_view from, std::string_view to) override {
    auto found = files.find(from);
    if (found == files.end()) return false;
    (void)change([&] {
      files[std::string(to)] = std::move(found->second);
      files.erase(found);
    });
    return true;
  }
  FileResult<void> save_checkpoint(OctetView octets) override {
    if (checkpoint_fault) return Err(*checkpoint_fault);
    return change([&] { checkpoint.assign(octets.begin(), octets.end()); });
  }

 private:
  struct Temporary {
    Octets now;
    Octets synced;
  };
  FileResult<void> change(const std::function<void()>& effect) {
    const bool dies = calls_until_kill && (*calls_until_kill)-- == 0;
    if (dies) calls_until_kill.reset();
    if (!dies || kill_after_effect) effect();
    if (dies) throw Killed{};
    return {};
  }
  std::size_t copy(const Octets& from, std::uint64_t offset, std::span<std::uint8_t> into) {
    largest_read = std::max(largest_read, into.size());
    if (offset >= from.size()) return 0;
    const std::size_t n = std::min<std::size_t>(into.size(), from.size() - offset);
    std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(offset), n, into.begin());
    return n;
  }

  std::map<TransactionId, Temporary> temporaries_;
  std::uint64_t last_inode_ = 0;
};

}  // namespace srfs::cfdp
