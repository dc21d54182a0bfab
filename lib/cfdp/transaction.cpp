// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/transaction.hpp"

namespace srfs::cfdp {

std::string_view to_string(FileFault fault) {
  switch (fault) {
    case FileFault::bad_name:
      return "name leads out of the folder";
    case FileFault::not_found:
      return "no such file";
    case FileFault::not_a_file:
      return "not a file";
    case FileFault::not_a_folder:
      return "not a folder";
    case FileFault::not_empty:
      return "folder is not empty";
    case FileFault::denied:
      return "permission denied or read-only";
    case FileFault::no_space:
      return "no space";
    case FileFault::io:
      return "input/output error";
  }
  return "?";
}

std::string_view to_string(FaultHandler handler) {
  switch (handler) {
    case FaultHandler::cancel:
      return "cancel";
    case FaultHandler::suspend:
      return "suspend";
    case FaultHandler::ignore:
      return "ignore";
    case FaultHandler::abandon:
      return "abandon";
  }
  return "?";
}

std::string_view to_string(EventKind kind) {
  switch (kind) {
    case EventKind::started:
      return "started";
    case EventKind::metadata_received:
      return "metadata received";
    case EventKind::fault:
      return "fault";
    case EventKind::suspended:
      return "suspended";
    case EventKind::resumed:
      return "resumed";
    case EventKind::finished:
      return "finished";
    case EventKind::checkpoint_failed:
      return "checkpoint failed";
  }
  return "?";
}

}  // namespace srfs::cfdp
