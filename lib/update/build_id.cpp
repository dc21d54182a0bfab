// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/build_id.hpp"

#include <algorithm>
#include <array>
#include <cstring>

#include <elf.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "base/fd.hpp"

namespace srfs::update {
namespace {

constexpr std::size_t most_headers = 64;
constexpr std::size_t largest_notes = 4096;
constexpr std::string_view gnu{"GNU\0", 4};

bool read_at(int fd, void* to, std::size_t octets, std::uint64_t at) {
  return pread(fd, to, octets, static_cast<off_t>(at)) == static_cast<ssize_t>(octets);
}

/// Notes are padded to four octets.
std::size_t padded(std::size_t octets) {
  return (octets + 3) / 4 * 4;
}

std::string id_among(std::string_view notes) {
  Elf64_Nhdr note{};
  while (notes.size() >= sizeof note) {
    std::memcpy(&note, notes.data(), sizeof note);
    notes.remove_prefix(sizeof note);
    const std::size_t name = padded(note.n_namesz);
    const std::size_t content = padded(note.n_descsz);
    if (name > notes.size() || content > notes.size() - name) break;
    if (note.n_type == NT_GNU_BUILD_ID && notes.substr(0, note.n_namesz) == gnu) {
      std::string digits;
      for (const char octet : notes.substr(name, note.n_descsz))
        digits += fmt::format("{:02x}", static_cast<unsigned char>(octet));
      return digits;
    }
    notes.remove_prefix(name + content);
  }
  return {};
}

}  // namespace

std::string build_id_of(const std::filesystem::path& file) {
  const Fd fd(open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  Elf64_Ehdr header{};
  if (!fd || !read_at(fd.get(), &header, sizeof header, 0)) return {};
  if (std::memcmp(header.e_ident, ELFMAG, SELFMAG) != 0 || header.e_ident[EI_CLASS] != ELFCLASS64) return {};
  for (std::size_t i = 0; i < std::min<std::size_t>(header.e_phnum, most_headers); ++i) {
    Elf64_Phdr part{};
    if (!read_at(fd.get(), &part, sizeof part, header.e_phoff + i * sizeof part)) return {};
    if (part.p_type != PT_NOTE || part.p_filesz > largest_notes) continue;
    std::array<char, largest_notes> notes{};
    if (!read_at(fd.get(), notes.data(), part.p_filesz, part.p_offset)) continue;
    if (auto id = id_among({notes.data(), part.p_filesz}); !id.empty()) return id;
  }
  return {};
}

bool is_another_build(std::string_view id, std::string_view other) {
  if (id.empty() || other.empty()) return false;
  if (id.size() != other.size()) return true;
  std::size_t different = 0;
  for (std::size_t i = 0; i + 1 < id.size(); i += 2)
    different += id.substr(i, 2) != other.substr(i, 2) ? 1 : 0;
  return different > id.size() / 4;
}

}  // namespace srfs::update
