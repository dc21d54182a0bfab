// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "base/action_queue.hpp"
#include "nodes/ttc/command/journal_log.hpp"
#include "nodes/ttc/test/simulated_medium.hpp"
#include "nodes/ttc/ttc_core.hpp"
#include "tests/simulation/disk.hpp"
#include "tests/simulation/file_record.hpp"
#include "tests/simulation/played_worker.hpp"
#include "tests/simulation/store_ledger.hpp"
#include "tests/simulation/topics.hpp"

namespace srfs::simulation {

/// Lets so many calls through to a medium; then the process that makes them has ended.
class EndingMedium final : public JournalMedium {
 public:
  explicit EndingMedium(JournalMedium& medium) : medium_(medium) {}
  void end_after(unsigned calls) { left_ = calls; }
  [[nodiscard]] Octets read(unsigned segment) override { return medium_.read(segment); }
  Result<void, FileError> write(unsigned segment, std::size_t offset, OctetView octets) override;
  Result<void, FileError> sync(unsigned segment) override;

 private:
  [[nodiscard]] bool has_ended();
  JournalMedium& medium_;
  std::optional<unsigned> left_;  ///< nullopt: all
};

/// The medium of ttc's journal: what was written and not synced is lost with the power, in any order, whole
/// or in part; not with the process. The other state of ttc that is no text file.
struct TtcFlash {
  TtcFlash(Kernel& kernel, const mission::Dictionary& dictionary)
      : journal(kernel.random("flash").next()),
        in_flight(kernel.random("journal in flight")),
        stores(kernel, dictionary),
        files(kernel),
        work_in_flight(kernel.random("work in flight")) {}
  testing_support::SimulatedMedium journal;
  LinkState link_copy;
  wire::TmFrameCounts frame_counts;  ///< in the mapped page: outlives the process, and what is read at a boot
  Random in_flight;                  ///< how far a write came in which the process ended
  std::array<std::uint64_t, 3> cut{};  ///< of them: nothing was written, written, written and synced
  StoreLedger stores;
  FileRecord files;
  Random work_in_flight;  ///< the same of the workers of stores and files
  void lose_power();
  void set_failing(bool failing);
};

/// Sees what ttc does, for the invariants.
class TtcWitness {
 public:
  virtual ~TtcWitness() = default;
  /// A node is asked to execute it.
  virtual void on_published(const Telecommand& telecommand) = 0;
  /// Its journal does not reach the disk now: what is under way may be forgotten with the process.
  virtual void on_storage_lost() = 0;
  /// Octets leave on the line to the ground.
  virtual void on_cadu(const Octets& cadu) = 0;
  /// The mode in force, by the number of its change.
  virtual void on_mode(std::uint32_t change) = 0;
  /// The spacecraft's time.
  virtual void on_time(UtcTime utc, bool valid) = 0;
};

struct TtcSurroundings {
  Topics& topics;
  Disk& disk;
  TtcFlash& flash;
  const mission::Dictionary& dictionary;
  UplinkConfig uplink;
  DownlinkConfig downlink;
  std::string boot_id;
  std::uint32_t boot_count = 0;
  Network& network;
  std::vector<Host*> nodes;  ///< by place in the ring
  std::function<void(const char* why)> restart_computer;
  const suite::ModeSettings& modes;
  seconds command_loss;
  TtcWitness& witness;
};

/// ttc's logic (TtcCore with its journal, JournalLog, all services, PacketStores, cfdp::TransferFolders) with
/// what TtcNode, TtcDisk and StoredState translate, over played surroundings.
class Ttc final : public Program {
 public:
  Ttc(Host& host, TtcSurroundings surroundings);
  ~Ttc() override;
  void start() override;
  [[nodiscard]] const TtcCore& core() const { return *core_; }
  [[nodiscard]] std::vector<std::string> files_under_way() { return names_under_way(*files_); }
  /// Octets came up the line.
  void on_line(const Octets& octets);

 private:
  [[nodiscard]] std::string text_of(const std::string& name) const;
  [[nodiscard]] FoundTable table_of(std::string_view name) const;
  [[nodiscard]] TtcCore::Setup read_setup();
  void load_journal(TtcCore::Setup& setup);
  void subscribe();
  void start_periods();
  void every(nanoseconds period, std::function<void()> work);
  void look_at_nodes();
  void advance();
  bool run(TtcCore::Actions actions);
  void pump_downlink();
  void carry_out(const WriteJournal& action);
  void carry_out(const WriteState& action);
  void carry_out(const WriteKeys& action);
  void carry_out(const WriteSessionKeys& action);
  void carry_out(const WriteRescueEntry& action);
  void carry_out(const WriteTable& action);
  void carry_out(const CopyLinkState& action);
  void carry_out(const ForgetWantedFloor& action);
  void carry_out(const CommitStores& action);
  void carry_out(const ReadStore& action);
  void carry_out(const PublishTelecommand& action);
  void carry_out(const PublishMode& action);
  void carry_out(const FollowMode& /*action*/) {}
  void carry_out(const RaiseEvent& action);
  void carry_out(const TestConnection& action);
  void carry_out(const CallParameter& action);
  void carry_out(const ServeFile& action);
  void carry_out(const TakeFilesTurn& action);
  void carry_out(const ServeImaging& action);
  void carry_out(const ServeImages& action);
  void carry_out(const ReopenLine& action);
  void carry_out(const RestartComputer& action);
  void carry_out(const AcceptanceSent& action);
  void carry_out(const LogLine& action);
  void work_on_journal();
  void open_stores();
  void commit(const CommitStores& action);
  void append(const std::vector<StoreItem>& items);
  void open_files();
  void end_work_in_flight();

  Host& host_;
  TtcSurroundings around_;
  EndingMedium medium_;
  JournalLog log_;
  std::optional<TtcCore> core_;
  ActionQueue<TtcAction> actions_;
  std::deque<JournalBatch> journal_jobs_;  ///< the first is being written
  std::optional<PacketStores> stores_;
  std::unique_ptr<cfdp::TransferFolders> files_;
  PlayedWorker store_worker_;
  PlayedWorker file_worker_;
  Deadline timer_;
};

}  // namespace srfs::simulation
