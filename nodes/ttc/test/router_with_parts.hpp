// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include "nodes/ttc/command/telecommand_router.hpp"

namespace srfs {

/// The router and all its parts, connected as in ttc.
class RouterWithParts : public testing::Test {
 protected:
  mission::Dictionary dictionary_ = mission::Dictionary::load(std::string(SRFS_SOURCE_DIR) + "/msgs/mission");
  FailureCodes codes_{dictionary_};
  HousekeepingScheduler housekeeping_;
  EventReporter events_;
  ModeManager mode_{StoredModeState::first_start, "", Mode::nominal};
  ReportQueue report_queue_;
  HazardGuard hazards_{seconds(30)};
  AvailableKeySets key_sets_{{0, KeySet::a}, {0, KeySet::b}};
  TransmitterSwitch transmitter_{"boot", "", MonotonicTime{}};
  CommandForwarder forwarder_{{.not_taken = codes_.node_unavailable,
                               .no_completion = codes_.completion_unknown,
                               .interrupted = codes_.interrupted},
                              report_queue_};
  PacketRetrieval retrieval_{report_queue_, 38};
  StoreControl stores_{dictionary_, "", codes_.for_stores(), report_queue_, retrieval_};
  AcceptanceJournal journal_{"boot", seconds(60)};
  ScheduleService schedule_{dictionary_, journal_, report_queue_, seconds(60)};
  TimeReporter time_reports_;
  FileService files_{report_queue_, mission::apid::ttc};
  ParameterService parameters_{dictionary_, report_queue_, mission::apid::ttc};
  ImagingScheduler imaging_{report_queue_};
  ConnectionTester connections_{report_queue_, codes_.for_connections()};
  TelecommandRouter router_{{.dictionary = dictionary_,
                             .codes = codes_,
                             .housekeeping = housekeeping_,
                             .events = events_,
                             .mode = mode_,
                             .forwarder = forwarder_,
                             .retrieval = retrieval_,
                             .stores = stores_,
                             .files = files_,
                             .parameters = parameters_,
                             .report_queue = report_queue_,
                             .schedule = schedule_,
                             .time_reports = time_reports_,
                             .hazards = hazards_,
                             .key_sets = key_sets_,
                             .transmitter = transmitter_,
                             .imaging = imaging_,
                             .connections = connections_},
                            "ttc"};
};

}  // namespace srfs
