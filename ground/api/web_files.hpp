// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "ground/api/http.hpp"

namespace srfs::ground::api {

/// A file of the page: index.html for a folder. Nothing outside of @p root, and no hidden file.
[[nodiscard]] HttpResponse page_file(const std::filesystem::path& root, const Target& target);

/// Files that came down (STATE/files): [{name, octets, time, type: picture | strips | stars | findings | text
/// | octets}], the newest first, at most @p most of them.
[[nodiscard]] nlohmann::json list_files(const std::filesystem::path& folder, std::size_t most = 5000);
/// One of them. @param view  "": as it is; "png": a picture that browsers show; "json": what a product
/// contains
[[nodiscard]] HttpResponse received_file(const std::filesystem::path& folder, const std::string& name,
                                         const std::string& view);

/// The page's folder: share/srfs/web of this installation, or web of the build tree. Empty: neither is there.
[[nodiscard]] std::filesystem::path default_web_root();

}  // namespace srfs::ground::api
