// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace srfs::ground {

/// Exit codes of srfs-ground.
enum class Exit : int {
  done = 0,         ///< what was asked for was done
  refused = 1,      ///< the telecommand was rejected, failed or not answered; the retrieval is incomplete
  unusable = 2,     ///< arguments, deployment, key or port
  link_closed = 3,  ///< the other end of the link went away
  unknown = 4,      ///< the server ended before it answered: whether it was sent is not known
};

}  // namespace srfs::ground
