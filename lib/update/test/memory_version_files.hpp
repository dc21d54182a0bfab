// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>

#include "base/sha256.hpp"
#include "update/version_files.hpp"

namespace srfs::update {

/// The computer loses power in the middle of a call.
struct PowerLoss {};

/// A folder in memory that loses unsynced changes: each name change separately, and any number of octets. It
/// can end its user at any changing call: before it, half-way through, or after it.
class MemoryVersionFiles final : public VersionFiles {
 public:
  struct Inode {
    std::string now;
    std::string synced;
  };
  struct Disk {
    std::map<std::string, int> names;
    std::map<std::string, int> synced_names;
    std::map<int, Inode> inodes;
    int last = 0;
  };
  Disk disk;
  std::map<std::string, std::string> elsewhere;  ///< programs to copy in
  std::optional<std::size_t> calls_until_loss;   ///< of changing calls
  bool refuses = false;                          ///< a full disk
  std::uint32_t random = 1;

  std::uint32_t draw(std::uint32_t below) {
    random = random * 1664525U + 1013904223U;
    return (random >> 8U) % below;
  }
  /// Leaves the state that is found after power returns.
  void lose_unsynced() {
    std::map<std::string, int> found = disk.synced_names;
    for (const auto& [name, inode] : disk.names) {
      if (draw(2) == 0) found[name] = inode;
    }
    for (const auto& [name, inode] : disk.synced_names) {
      if (!disk.names.contains(name) && draw(2) == 0) found.erase(name);
    }
    for (auto& [number, inode] : disk.inodes) {
      if (inode.now != inode.synced && draw(2) == 0)
        inode.synced = inode.now.substr(0, draw(static_cast<std::uint32_t>(inode.now.size()) + 1));
      inode.now = inode.synced;
    }
    disk.names = disk.synced_names = found;
    calls_until_loss.reset();
  }

  std::vector<std::string> names() const override {
    std::vector<std::string> all;
    for (const auto& [name, inode] : disk.names) all.push_back(name);
    return all;
  }
  Result<std::string, FileError> read(const std::string& name) const override {
    const auto found = disk.names.find(name);
    if (found == disk.names.end()) return Err(FileError{name + " is not there"});
    return disk.inodes.at(found->second).now;
  }
  Result<Digest, FileError> digest(const std::string& name) const override {
    const auto content = read(name);
    if (!content) return Err(content.error());
    return Digest{hash_of(*content), content->size()};
  }
  Result<void, FileError> write(const std::string& name, const std::string& text) override {
    return put(name, text);
  }
  Result<Digest, FileError> copy_in(const std::filesystem::path& source, const std::string& name) override {
    const auto found = elsewhere.find(source.string());
    if (found == elsewhere.end()) return Err(FileError{source.string() + " is not there"});
    disk.names.erase(name);
    if (auto done = put(name, found->second); !done) return Err(done.error());
    return Digest{hash_of(found->second), found->second.size()};
  }
  Result<void, FileError> rename(const std::string& from, const std::string& to) override {
    return step([&] {
      disk.names[to] = disk.names.at(from);
      disk.names.erase(from);
    });
  }
  Result<void, FileError> remove(const std::string& name) override {
    return step([&] { disk.names.erase(name); });
  }
  Result<void, FileError> sync_names() override {
    return step([&] { disk.synced_names = disk.names; });
  }

 private:
  static std::string hash_of(const std::string& text) {
    return to_digits(sha256_of({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}));
  }
  template <class Effect>
  Result<void, FileError> step(Effect effect) {
    if (refuses) return Err(FileError{"no space"});
    if (calls_until_loss && (*calls_until_loss)-- == 0) {
      if (draw(2) == 0) effect();
      throw PowerLoss{};
    }
    effect();
    return {};
  }
  /// Makes two calls: one for the octets, one for their sync.
  Result<void, FileError> put(const std::string& name, const std::string& text) {
    auto written = step([&] {
      if (!disk.names.contains(name)) {
        disk.names[name] = ++disk.last;
        disk.inodes[disk.last] = {};
      }
      disk.inodes[disk.names[name]].now = text;
    });
    if (!written) return written;
    return step([&] {
      Inode& inode = disk.inodes[disk.names[name]];
      inode.synced = inode.now;
    });
  }
};

}  // namespace srfs::update
