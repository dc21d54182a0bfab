// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "hw_sim/frame_peripheral_channel.hpp"
#include "wire/peripheral_protocol.hpp"

namespace srfs::sim {

class SpacecraftWorld;

/// What one peripheral does and measures: its state, its functions, its measurement block, its own faults.
/// The protocol around it, and the faults of every peripheral (silent, late, short, garbage, babble), are
/// Peripheral's. Pure; one thread.
class PeripheralModel {
 public:
  virtual ~PeripheralModel() = default;
  /// The world went on so long, powered or not.
  virtual void step(nanoseconds /*dt*/) {}
  /// The raw measurement block, taken now: the raw structure of the dictionary, big-endian.
  [[nodiscard]] virtual Octets measure() = 0;
  /// Carries out a function: done, unknown_function, bad_argument or cannot_now.
  [[nodiscard]] virtual wire::PeripheralResult execute(std::uint8_t function, OctetView arguments) = 0;
  /// The processor restarts; what hardware latches stays.
  virtual void restart() {}
  /// Power comes or goes. Without power nothing is kept.
  virtual void set_power(bool /*on*/) {}
  /// The frames of its protocol; none: that of docs/reference/icd_can.md.
  /// @param address  its CAN address in the deployment
  [[nodiscard]] virtual std::unique_ptr<PeripheralFrames> make_frames(std::uint8_t /*address*/) const {
    return nullptr;
  }
  /// A fault of this peripheral alone, as the control socket names it; "none" ends it.
  /// @return false: it has no such fault
  [[nodiscard]] virtual bool set_fault(std::string_view name) { return name == "none"; }
};

/// What a model is made with.
struct ModelContext {
  SpacecraftWorld& world;  ///< outlives the model
  std::uint64_t seed;      ///< of its noise; another one for each peripheral
};
using MakeModel = std::function<std::unique_ptr<PeripheralModel>(const ModelContext&)>;
/// The models of a mission, by the payload whose peripheral they are.
using PeripheralModels = std::map<std::string, MakeModel, std::less<>>;

}  // namespace srfs::sim
