// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "base/time.hpp"
#include "suite/instance.hpp"
#include "suite/ring/fault.hpp"

namespace srfs::suite {

/// One line of the fault ledger: what an observer did about a node, or (kind `active`) that a node it had
/// restarted works again.
struct FaultRecord {
  enum class Kind : std::uint8_t { fault, active };
  Kind kind = Kind::fault;
  std::uint64_t sequence = 0;  ///< given by append()
  UtcTime utc;                 ///< as the observer's clock said
  MonotonicTime monotonic;
  std::string boot;  ///< the kernel's boot id: monotonic times compare within one boot only
  std::string observer;
  std::string subject;
  FaultClass fault = FaultClass::none;
  std::uint32_t misses = 0;
  std::string detail;  ///< of the accusation
  std::string cause;   ///< how the old process ended: "exit code 2", "signal 11 (SIGSEGV)", "killed by ..."
  char kernel_state = '-';            ///< of the old process when it was accused (proc(5)); '-': it was gone
  std::uint32_t old_incarnation = 0;  ///< 0: not known
  std::uint32_t new_incarnation = 0;  ///< 0: not started
  RestartOutcome::What outcome = RestartOutcome::What::restarted;
  std::string reason;                           ///< of the outcome
  std::optional<std::uint32_t> version;         ///< that was started; 0: golden
  std::optional<std::uint32_t> failed_version;  ///< that was to be started, and was found bad
  std::optional<nanoseconds> last_turn_age;     ///< of the second witness, at the first evidence
  // Durations; nullopt: did not come to it.
  std::optional<nanoseconds> judged;   ///< first evidence to decision
  std::optional<nanoseconds> killed;   ///< decision to the proof that the old process is gone
  std::optional<nanoseconds> started;  ///< from there to the new process holding its instance lock
  std::optional<nanoseconds> active;   ///< from there to Active again (kind `active`)

  friend bool operator==(const FaultRecord&, const FaultRecord&) = default;
};

/// One line: JSON, a tab, its CRC-32C. Texts are cut and made plain ASCII, so that the line is never longer
/// than FaultLedger::longest_line.
[[nodiscard]] std::string encode(const FaultRecord& record);
/// nullopt: torn or damaged. @param line without the newline
[[nodiscard]] std::optional<FaultRecord> decode_fault(std::string_view line);

/// The ledger of a suite in VAR/state/ring: faults.log and the one before it, of 256 KiB at most each. Any
/// process appends, each line by one write under a short lock; a line that was torn by a power loss or a full
/// disk costs itself only.
class FaultLedger {
 public:
  static constexpr std::size_t largest_file = 256U << 10;
  static constexpr std::size_t longest_line = 4096;

  explicit FaultLedger(const VarPaths& var) : var_(var) {}

  /// On the medium when it returns. Blocks on the disk; for the lock 0.2 s at most (then it writes without).
  /// @return the sequence number
  [[nodiscard]] Result<std::uint64_t, std::string> append(FaultRecord record) const;

  struct Content {
    std::vector<FaultRecord> records;  ///< oldest first
    std::size_t damaged = 0;           ///< lines that were skipped
  };
  /// Blocks on the disk.
  [[nodiscard]] Content read() const;

  [[nodiscard]] std::filesystem::path file() const { return var_.state("ring") / "faults.log"; }

 private:
  VarPaths var_;
};

}  // namespace srfs::suite
