// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <mission/structures.hpp>

#include "nodes/ttc/command/acceptance_journal.hpp"
#include "nodes/ttc/command/telecommand_router.hpp"
#include "nodes/ttc/files/file_service.hpp"
#include "nodes/ttc/imaging/imaging_scheduler.hpp"
#include "nodes/ttc/report/event_reporter.hpp"
#include "nodes/ttc/services/connection_tester.hpp"
#include "nodes/ttc/services/event_action_service.hpp"
#include "nodes/ttc/services/housekeeping_scheduler.hpp"
#include "nodes/ttc/services/monitoring_service.hpp"
#include "nodes/ttc/services/own_functions.hpp"
#include "nodes/ttc/services/parameter_service.hpp"
#include "nodes/ttc/services/schedule_service.hpp"
#include "nodes/ttc/services/time_reporter.hpp"
#include "nodes/ttc/store/packet_retrieval.hpp"
#include "nodes/ttc/store/store_control.hpp"
#include "tests/mission_dictionary.hpp"

namespace srfs {

/// The router and all its parts, connected as in ttc.
class RouterWithParts : public testing::Test {
 protected:
  RouterWithParts() {
    schedule_.set_request_check([this](OctetView packet) { return router_.check_scheduled(packet); });
  }

  const mission::Dictionary& dictionary_ = testing_support::dictionary();
  ReportQueue report_queue_;
  AcceptanceJournal journal_{"boot", seconds(60)};
  ModeManager mode_{StoredModeState::first_start, "", MissionMode::nominal};
  TransmitterSwitch transmitter_{"boot", "", MonotonicTime{}};
  HazardGuard hazards_{seconds(30)};
  AvailableKeySets key_sets_{{0, KeySet::a}, {0, KeySet::b}};
  CommandForwarder forwarder_{report_queue_};
  HousekeepingScheduler housekeeping_{report_queue_};
  EventReporter events_{report_queue_};
  ModeService mode_service_{mode_, hazards_, report_queue_};
  ArmingService arming_{dictionary_, mode_, hazards_, report_queue_};
  KeyService key_service_{key_sets_, report_queue_};
  TransmitterService transmitter_service_{transmitter_, report_queue_};
  RescueService rescue_service_{report_queue_};
  TimeReporter time_reports_{report_queue_};
  ScheduleService schedule_{journal_, report_queue_, seconds(60)};
  PacketRetrieval retrieval_{report_queue_};
  StoreControl stores_{dictionary_, "", report_queue_, retrieval_};
  ConnectionTester connections_{dictionary_, "ttc", report_queue_};
  ParameterService parameters_{dictionary_, report_queue_, mission::apid::ttc};
  FileService files_{report_queue_, mission::apid::ttc};
  ImagingScheduler imaging_{report_queue_};
  MonitoringService monitoring_{dictionary_, {}, report_queue_};
  EventActionService event_actions_{dictionary_, report_queue_};
  TelecommandRouter router_{
      {.dictionary = dictionary_,
       .mode = mode_,
       .hazards = hazards_,
       .forwarder = forwarder_,
       .report_queue = report_queue_,
       .services = {&housekeeping_, &events_, &mode_service_, &arming_, &key_service_, &transmitter_service_,
                    &rescue_service_, &time_reports_, &schedule_, &retrieval_, &stores_, &connections_,
                    &parameters_, &files_, &imaging_, &monitoring_, &event_actions_}},
      "ttc"};
};

}  // namespace srfs
