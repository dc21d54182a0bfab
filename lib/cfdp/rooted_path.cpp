// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/rooted_path.hpp"

#include <cerrno>

#include <fcntl.h>
#include <sys/stat.h>

namespace srfs::cfdp {
namespace {

/// Opens the folder @p part of @p folder.
FileResult<Fd> enter(int folder, const std::string& part) {
  if (part.empty() || part.front() == '.') return Err(FileFault::bad_name);
  Fd below(openat(folder, part.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
  if (below) return below;
  // A symbolic link in the way is ENOTDIR to O_DIRECTORY.
  struct stat s {};
  const int error = errno;
  const bool is_link = fstatat(folder, part.c_str(), &s, AT_SYMLINK_NOFOLLOW) == 0 && S_ISLNK(s.st_mode);
  return Err(is_link ? FileFault::bad_name : fault_of(error));
}

bool impossible(std::string_view name) {
  return name.empty() || name.front() == '/' || name.find('\0') != std::string_view::npos;
}

}  // namespace

FileFault fault_of(int error) {
  switch (error) {
    case ENOENT:
      return FileFault::not_found;
    case ENOTDIR:
      return FileFault::not_a_folder;
    case ELOOP:
    case ENAMETOOLONG:
      return FileFault::bad_name;
    case EISDIR:
      return FileFault::not_a_file;
    case ENOTEMPTY:
    case EEXIST:
      return FileFault::not_empty;
    case EACCES:
    case EPERM:
    case EROFS:
      return FileFault::denied;
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      return FileFault::no_space;
    default:
      return FileFault::io;
  }
}

FileResult<Place> locate(int root, std::string_view name) {
  if (impossible(name)) return Err(FileFault::bad_name);
  const std::size_t slash = name.rfind('/');
  const std::string last(slash == std::string_view::npos ? name : name.substr(slash + 1));
  if (last.empty() || last.front() == '.') return Err(FileFault::bad_name);
  auto folder = open_folder(root, slash == std::string_view::npos ? "" : name.substr(0, slash));
  if (!folder) return Err(folder.error());
  return Place{.folder = std::move(*folder), .name = last};
}

FileResult<Fd> open_folder(int root, std::string_view name) {
  if (!name.empty() && impossible(name)) return Err(FileFault::bad_name);
  // Opened anew and not duplicated: two that share a position would read a folder's entries in turns.
  Fd folder(openat(root, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder) return Err(fault_of(errno));
  for (bool last = name.empty(); !last;) {
    const std::size_t slash = name.find('/');
    last = slash == std::string_view::npos;
    auto below = enter(folder.get(), std::string(name.substr(0, slash)));
    if (!below) return below;
    folder = std::move(*below);
    if (!last) name.remove_prefix(slash + 1);
  }
  return folder;
}

}  // namespace srfs::cfdp
