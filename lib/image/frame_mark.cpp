#include "image/frame_mark.hpp"

#include <cstdlib>

namespace srfs::image {
namespace {

std::string_view extension(FrameMark mark) {
  switch (mark) {
    case FrameMark::detected:
      return ".detected";
    case FrameMark::nothing:
      return ".nothing";
    case FrameMark::sent:
      return ".sent";
  }
  std::abort();
}

}  // namespace

std::filesystem::path mark_path(const std::filesystem::path& frame, FrameMark mark) {
  std::filesystem::path path = frame;
  path.replace_extension(extension(mark));
  return path;
}

bool has_mark(const std::filesystem::path& frame, FrameMark mark) {
  std::error_code failed;
  return std::filesystem::exists(mark_path(frame, mark), failed);
}

Result<void, FileError> mark_frame(const std::filesystem::path& frame, FrameMark mark) {
  std::error_code failed;
  if (!std::filesystem::exists(frame, failed)) return {};
  return write_file_atomically(mark_path(frame, mark), "");
}

}  // namespace srfs::image
