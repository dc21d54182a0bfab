// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/ring/fault.hpp"

#include <fmt/format.h>

namespace srfs::suite {

const char* to_text(FaultClass fault) {
  switch (fault) {
    case FaultClass::none:
      return "none";
    case FaultClass::absent:
      return "absent";
    case FaultClass::exited:
      return "exited";
    case FaultClass::silent:
      return "silent";
    case FaultClass::deaf:
      return "deaf";
    case FaultClass::wrong_answer:
      return "wrong answer";
    case FaultClass::not_checking:
      return "not checking";
    case FaultClass::not_working:
      return "not working";
    case FaultClass::worker_frozen:
      return "worker frozen";
    case FaultClass::start_overdue:
      return "start overdue";
    case FaultClass::too_large:
      return "too large";
    case FaultClass::not_confirmed:
      return "not confirmed in time";
    case FaultClass::limit_violation:
      return "limit violation";
    case FaultClass::cpu_hog:
      return "taking the CPUs";
  }
  return "?";
}

std::string to_text(const VersionFallback& fallback) {
  const auto name = [](std::uint32_t version) {
    return version == 0 ? std::string("the golden version") : fmt::format("version {}", version);
  };
  return fmt::format("{} instead of {}: {}", name(fallback.to), name(fallback.from), fallback.why);
}

const char* to_text(RestartOutcome::What what) {
  switch (what) {
    case RestartOutcome::What::restarted:
      return "restarted";
    case RestartOutcome::What::renewed:
      return "renewed by another";
    case RestartOutcome::What::under_way:
      return "restart under way";
    case RestartOutcome::What::held:
      return "held";
    case RestartOutcome::What::backing_off:
      return "backing off";
    case RestartOutcome::What::quarantined:
      return "quarantined";
    case RestartOutcome::What::stopping:
      return "suite stopping";
    case RestartOutcome::What::unkillable:
      return "unkillable";
    case RestartOutcome::What::cannot_start:
      return "cannot start";
    case RestartOutcome::What::not_believed:
      return "not believed";
    case RestartOutcome::What::communication:
      return "communication fault";
  }
  return "?";
}

}  // namespace srfs::suite
