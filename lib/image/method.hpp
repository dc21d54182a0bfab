// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <span>
#include <string_view>

#include "image/detections.hpp"
#include "image/frame.hpp"
#include "image/tracklet_linker.hpp"

namespace srfs::image {

/// One parameter of a method. Its default stands here and nowhere else.
struct ParameterSpec {
  std::string_view name;
  double standard;
  double least;
  double most;
  std::string_view description;  ///< with the unit
};

/// Parameters of one run, all of them, checked.
class Parameters {
 public:
  /// @param given  "name=value" each
  /// @return why one is refused: unknown (with the names there are), not a number, out of range, or given
  /// twice
  [[nodiscard]] static Result<Parameters, Refusal> parse(std::span<const ParameterSpec> specs,
                                                         std::span<const std::string> given);

  /// @pre name is one of the method's
  [[nodiscard]] double operator[](std::string_view name) const;

 private:
  std::map<std::string, double, std::less<>> values_;
};

/// What a method makes of a sequence of frames, one at a time, in order. Single-threaded; a call takes as
/// long as the frame is large (a tenth of a second for 2 MP).
class Method {
 public:
  virtual ~Method() = default;
  /// @return what is in this frame, or why it cannot be in this sequence
  [[nodiscard]] virtual Result<FrameFindings, Refusal> process(const Frame& frame) = 0;
  /// What the frames hold together; the next frame starts another sequence.
  [[nodiscard]] virtual SequenceFindings finish() { return {}; }
};

/// A method as the mission names it. A new one is one class and one row in method.cpp.
struct MethodEntry {
  std::string_view name;
  std::string_view description;
  std::span<const ParameterSpec> parameters;
  std::unique_ptr<Method> (*make)(const Parameters&);
  /// What its frames are to be freed of before; nullptr: they stay as they are.
  MastersUsed (*masters)(const Parameters&) = nullptr;

  [[nodiscard]] MastersUsed masters_for(const Parameters& chosen) const {
    return masters != nullptr ? masters(chosen) : MastersUsed{};
  }
};

[[nodiscard]] std::span<const MethodEntry> methods();

/// @return the entry, or which ones there are
[[nodiscard]] Result<const MethodEntry*, Refusal> find_method(std::string_view name);

}  // namespace srfs::image
