// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/octets.hpp"

namespace srfs {

/// What the PUS service 23 asks of the folder of files and of the copies under way.
enum class FileAction : std::uint8_t {
  delete_file,
  report_attributes,
  make_folder,
  remove_folder,
  list,
  copy,
  suspend,
  resume,
  abort,
  report_copies,
};

/// One request as the worker that owns the disk carries it out.
struct FileOrder {
  std::uint64_t number = 0;  ///< distinguishes orders
  FileAction action = FileAction::list;
  std::string repository = {};  ///< folder below the folder of files; empty: that itself
  std::string name = {};        ///< of the file or folder in it; list: the name behind which it begins
  std::uint16_t most = 0;       ///< list: entries
  std::string target_repository = {};
  std::string target_name = {};
  std::vector<std::uint64_t> operations = {};  ///< copy: its id. suspend, resume, abort: which
  bool all_in_repository = false;              ///< suspend, resume, abort: instead of `operations`
  bool repeated = false;                       ///< may have been done before a restart
};

/// What became of it.
struct FileOutcome {
  bool unfinished = false;    ///< the same order again goes on with it
  std::uint16_t failure = 0;  ///< failure code of the dictionary; 0: none
  Octets failure_parameter = {};
  std::uint8_t report_subtype = 0;
  std::vector<Octets> reports = {};  ///< source data of TM 23,report_subtype
};

}  // namespace srfs
