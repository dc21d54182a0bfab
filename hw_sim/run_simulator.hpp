// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "hw_sim/peripheral_model.hpp"

namespace srfs::sim {

/// The simulator program of a mission (README.md): arguments, keys, the loop. srfs_add_simulator() writes the
/// main() that calls it.
/// @return the exit code
[[nodiscard]] int run_simulator(int argc, char** argv, const PeripheralModels& models);

}  // namespace srfs::sim
