// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/fits_library.hpp"

#include <dlfcn.h>

#include <filesystem>

namespace srfs::image {
namespace {

struct Library {
  void* handle = nullptr;
  std::string problem;
};

std::string dl_problem() {
  const char* text = dlerror();
  return std::string("FITS: ") + (text != nullptr ? text : "its library cannot be loaded");
}

Library load() {
  // Beside this library, by its full path: where others wrap dlopen, the run path is theirs.
  std::filesystem::path path = SRFS_FITS_LIBRARY;
  Dl_info here{};
  if (dladdr(reinterpret_cast<const void*>(&fits_function), &here) != 0 && here.dli_fname != nullptr)
    path = std::filesystem::path(here.dli_fname).parent_path() / path;
  void* const handle = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  return {handle, handle == nullptr ? dl_problem() : ""};
}

}  // namespace

FitsFunction fits_function(const char* name) {
  static const Library library = load();
  if (library.handle == nullptr) return {nullptr, library.problem};
  void* const address = dlsym(library.handle, name);
  return {address, address == nullptr ? dl_problem() : ""};
}

}  // namespace srfs::image
