// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ground/report_order.hpp"
#include "tests/mission_dictionary.hpp"

namespace srfs::ground {
namespace {

using testing_support::dictionary;

constexpr MonotonicTime start{seconds(100)};

std::optional<ReportOrder> order_of(const std::string& command,
                                    const std::vector<std::string>& arguments = {}) {
  const auto encoded = dictionary().encode(command, arguments);
  EXPECT_TRUE(encoded) << encoded.error().message;
  return ReportOrder::of(dictionary(), *encoded);
}

TelemetryReport packet(std::uint8_t service, std::uint8_t subtype, const std::string& name = "") {
  TelemetryReport report;
  report.service = service;
  report.subtype = subtype;
  report.name = name;
  return report;
}

TEST(ReportOrder, IsNamedInTheDictionary) {
  EXPECT_FALSE(order_of("eps.switch_load", {"load=1", "state=on"}));
  EXPECT_EQ(order_of("storage.summary")->what(), "packet of structure packet_store_summary");
  EXPECT_EQ(order_of("ring.report_faults")->what(), "packet of structure ring_fault");
  EXPECT_EQ(order_of("ttc.ping")->what(), "TM 17,2");
}

TEST(ReportOrder, OfAStructureThatAnArgumentNames) {
  EXPECT_EQ(order_of("housekeeping.one_shot", {"structure=payload_eps"})->what(),
            "packet of structure payload_eps");
  EXPECT_EQ(order_of("housekeeping.one_shot", {"structure=3"})->what(), "packet of structure timing");
}

TEST(ReportOrder, TakesItsOwnLivePacketsAlone) {
  auto order = *order_of("package.report");
  EXPECT_FALSE(order.take(packet(3, 25, "node_version"), start));
  EXPECT_FALSE(order.take(packet(5, 1, "update_status"), start));
  auto stored = packet(3, 25, "update_status");
  stored.vc = tm_channel::playback;
  EXPECT_FALSE(order.take(stored, start));
  EXPECT_FALSE(order.came());
  EXPECT_TRUE(order.take(packet(3, 25, "update_status"), start));
  EXPECT_TRUE(order.came());
}

TEST(ReportOrder, OfOnePacketIsOverWithItAndTheCompletion) {
  auto order = *order_of("package.report");
  ASSERT_TRUE(order.take(packet(3, 25, "update_status"), start));
  EXPECT_FALSE(order.is_over(start + seconds(9))) << "not completed";
  order.on_completed(start + seconds(9));
  EXPECT_TRUE(order.is_over(start + seconds(9)));

  auto late = *order_of("package.report");
  late.on_completed(start);
  EXPECT_FALSE(late.is_over(start + seconds(1)));
  ASSERT_TRUE(late.take(packet(3, 25, "update_status"), start + seconds(1)));
  EXPECT_TRUE(late.is_over(start + seconds(1)));
}

TEST(ReportOrder, OfSeveralPacketsIsOverWhenNoOtherCame) {
  auto order = *order_of("storage.status");
  ASSERT_TRUE(order.take(packet(15, 19, "packet_store_status"), start));
  order.on_completed(start);
  EXPECT_FALSE(order.is_over(start + ReportOrder::gap / 2));
  ASSERT_TRUE(order.take(packet(15, 19, "packet_store_status"), start + ReportOrder::gap / 2));
  EXPECT_FALSE(order.is_over(start + ReportOrder::gap));
  EXPECT_EQ(order.deadline(), start + ReportOrder::gap / 2 + ReportOrder::gap);
  EXPECT_TRUE(order.is_over(start + ReportOrder::gap / 2 + ReportOrder::gap));
}

TEST(ReportOrder, IsGivenUpWhenNothingCame) {
  auto order = *order_of("storage.status");
  EXPECT_FALSE(order.deadline());
  order.on_completed(start);
  EXPECT_FALSE(order.is_over(start + ReportOrder::patience - milliseconds(1)));
  EXPECT_TRUE(order.is_over(start + ReportOrder::patience));
  EXPECT_FALSE(order.came());
  EXPECT_FALSE(order.may_be_none());

  auto faults = *order_of("ring.report_faults");
  faults.on_completed(start);
  EXPECT_TRUE(faults.is_over(start + ReportOrder::patience_with_none));
  EXPECT_TRUE(faults.may_be_none());
}

TEST(ReportOrder, OfAnyStructureOnRequest) {
  auto order = ReportOrder::of_structure(*dictionary().structure("file_attributes"));
  EXPECT_TRUE(order.take(packet(23, 4, "file_attributes"), start));
  EXPECT_FALSE(order.take(packet(3, 25, "timing"), start));
}

}  // namespace
}  // namespace srfs::ground
