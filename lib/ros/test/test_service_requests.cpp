// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ros/service.hpp"
#include "ros/service_requests.hpp"

namespace srfs::ros {
namespace {

using Verdict = ServiceRequests::Verdict;

SampleIdentity request(std::uint8_t client, std::int64_t sequence) {
  SampleIdentity identity;
  GUID_t guid;
  guid.guidPrefix.value[0] = client;
  guid.entityId.value[3] = 0x04;
  identity.writer_guid(guid);
  identity.sequence_number(sequence_number(sequence));
  return identity;
}
MonotonicTime at(milliseconds t) {
  return MonotonicTime(t);
}
ServiceRequests::Response response(int n) {
  return std::make_shared<int>(n);
}

TEST(ServiceRequests, ARequestIsExecutedAndAnsweredOnce) {
  ServiceRequests requests;
  const auto judged = requests.judge(request(1, 7), std::nullopt, false, at(seconds(0)));
  ASSERT_EQ(judged.verdict, Verdict::execute);
  EXPECT_EQ(requests.client(judged.ticket), request(1, 7).writer_guid());
  EXPECT_EQ(requests.answer(judged.ticket, response(1), at(seconds(0))), request(1, 7));
  EXPECT_FALSE(requests.answer(judged.ticket, response(1), at(seconds(0))));
  EXPECT_EQ(requests.pending(), 0U);
}

TEST(ServiceRequests, ARepeatOfAnAnsweredRequestGetsTheSameAnswer) {
  ServiceRequests requests;
  const auto first = requests.judge(request(1, 7), std::nullopt, false, at(seconds(0)));
  const auto kept = response(1);
  (void)requests.answer(first.ticket, kept, at(seconds(0)));
  const auto repeat = requests.judge(request(1, 8), 7, false, at(seconds(1)));
  EXPECT_EQ(repeat.verdict, Verdict::answer_again);
  EXPECT_EQ(repeat.response, kept);
  EXPECT_EQ(requests.judge(request(1, 9), 7, false, at(seconds(2))).verdict, Verdict::answer_again);
  EXPECT_EQ(requests.counters().repeats, 2U);
}

TEST(ServiceRequests, ARepeatOfARequestUnderWayWaitsForItsAnswer) {
  ServiceRequests requests;
  (void)requests.judge(request(1, 7), std::nullopt, false, at(seconds(0)));
  EXPECT_EQ(requests.judge(request(1, 8), 7, false, at(seconds(1))).verdict, Verdict::wait);
  EXPECT_EQ(requests.pending(), 1U);
}

TEST(ServiceRequests, ARepeatWhoseFirstAttemptWasLostIsExecutedOnce) {
  ServiceRequests requests;
  const auto second = requests.judge(request(1, 8), 7, false, at(seconds(0)));
  ASSERT_EQ(second.verdict, Verdict::execute);
  EXPECT_EQ(requests.answer(second.ticket, response(1), at(seconds(0))), request(1, 8))
      << "answered as the sample that came";
  EXPECT_EQ(requests.judge(request(1, 9), 7, false, at(seconds(1))).verdict, Verdict::answer_again);
}

TEST(ServiceRequests, TheSameSequenceNumberOfAnotherClientIsAnotherRequest) {
  ServiceRequests requests;
  (void)requests.answer(requests.judge(request(1, 7), std::nullopt, false, at(seconds(0))).ticket,
                        response(1), at(seconds(0)));
  EXPECT_EQ(requests.judge(request(2, 8), 7, false, at(seconds(0))).verdict, Verdict::execute);
}

TEST(ServiceRequests, ForgetsAnswersAfterTheirTimeAndBeyondItsBound) {
  ServiceRequests requests;
  const auto serve = [&](std::int64_t sequence, MonotonicTime now) {
    (void)requests.answer(requests.judge(request(1, sequence), std::nullopt, false, now).ticket, response(1),
                          now);
  };
  serve(1, at(seconds(0)));
  EXPECT_EQ(requests.judge(request(1, 500), 1, false, at(ServiceRequests::longest_memory)).verdict,
            Verdict::answer_again);
  EXPECT_EQ(requests.judge(request(1, 501), 1, false, at(ServiceRequests::longest_memory + milliseconds(1)))
                .verdict,
            Verdict::execute);

  for (std::int64_t n = 2; n < 2 + static_cast<std::int64_t>(ServiceRequests::most_answered) + 1; ++n)
    serve(n, at(seconds(20)));
  EXPECT_EQ(requests.judge(request(1, 502), 3, false, at(seconds(20))).verdict, Verdict::answer_again);
  EXPECT_EQ(requests.judge(request(1, 503), 2, false, at(seconds(20))).verdict, Verdict::execute);
}

TEST(ServiceRequests, RefusesAndCountsWhatItCannotKeep) {
  ServiceRequests requests;
  for (std::size_t n = 1; n <= ServiceRequests::most_pending; ++n)
    EXPECT_EQ(
        requests.judge(request(1, static_cast<std::int64_t>(n)), std::nullopt, false, at(seconds(0))).verdict,
        Verdict::execute);
  EXPECT_EQ(requests.judge(request(2, 1), std::nullopt, false, at(seconds(0))).verdict, Verdict::refuse);
  EXPECT_EQ(requests.counters().refused, 1U);
}

TEST(ServiceRequests, AForgottenRequestLeavesNothingAndItsRepeatIsExecuted) {
  ServiceRequests requests;
  const auto ticket = requests.judge(request(1, 7), std::nullopt, false, at(seconds(0))).ticket;
  requests.forget(ticket);
  EXPECT_EQ(requests.pending(), 0U);
  EXPECT_FALSE(requests.answer(ticket, response(1), at(seconds(0))));
  EXPECT_EQ(requests.judge(request(1, 8), 7, false, at(seconds(1))).verdict, Verdict::execute);
}

TEST(ServiceRequests, DropsTheRequestsOfAClientThatVanished) {
  ServiceRequests requests;
  const auto gone = requests.judge(request(1, 1), std::nullopt, false, at(seconds(0))).ticket;
  const auto there = requests.judge(request(2, 1), std::nullopt, false, at(seconds(0))).ticket;
  const auto everybody = [](const GUID_t&) { return true; };
  const auto only_the_second = [](const GUID_t& c) { return c == request(2, 1).writer_guid(); };
  EXPECT_THAT(requests.drop_vanished(everybody, at(milliseconds(1))), testing::IsEmpty());
  EXPECT_THAT(requests.drop_vanished(only_the_second, at(milliseconds(2))), testing::ElementsAre(gone));
  EXPECT_FALSE(requests.answer(gone, response(1), at(seconds(1))));
  EXPECT_TRUE(requests.answer(there, response(1), at(seconds(1))));
  EXPECT_EQ(requests.counters().dropped, 1U);
}

TEST(ServiceRequests, AClientThatWasThereWithItsRequestIsMissedAtOnce) {
  ServiceRequests requests;
  (void)requests.judge(request(1, 1), std::nullopt, true, at(seconds(0)));
  EXPECT_EQ(requests.drop_vanished([](const GUID_t&) { return false; }, at(milliseconds(1))).size(), 1U);
}

TEST(ServiceRequests, AClientHasTimeToAppear) {
  ServiceRequests requests;
  (void)requests.judge(request(1, 1), std::nullopt, false, at(seconds(0)));
  const auto nobody = [](const GUID_t&) { return false; };
  EXPECT_THAT(requests.drop_vanished(nobody, at(ServiceRequests::longest_to_match - milliseconds(1))),
              testing::IsEmpty());
  EXPECT_EQ(requests.drop_vanished(nobody, at(ServiceRequests::longest_to_match)).size(), 1U);
}

SampleIdentity request_of(const GUID_t& client, std::int64_t number) {
  SampleIdentity request;
  request.writer_guid(client);
  request.sequence_number(sequence_number(number));
  return request;
}

TEST(RefusalQueue, NamesEveryLostRequestOfEveryClientOnceInOrder) {
  GUID_t a;
  a.entityId.value[0] = 1;
  GUID_t b;
  b.entityId.value[0] = 2;
  RefusalQueue queue;
  EXPECT_EQ(queue.add(a, 5, 4), 0U);
  EXPECT_TRUE(queue.empty());
  EXPECT_EQ(queue.add(a, 5, 6), 0U);
  EXPECT_EQ(queue.add(a, 7, 7), 0U);
  EXPECT_EQ(queue.add(b, 1, 1), 0U);
  EXPECT_EQ(queue.take(), request_of(a, 5));
  EXPECT_EQ(queue.take(), request_of(a, 6));
  EXPECT_EQ(queue.take(), request_of(a, 7));
  EXPECT_EQ(queue.take(), request_of(b, 1));
  EXPECT_EQ(queue.take(), std::nullopt);
}

TEST(RefusalQueue, IsBoundedAndSaysWhatFoundNoRoom) {
  RefusalQueue queue;
  EXPECT_EQ(queue.add({}, 1, 1'000'000'000'000), 1'000'000'000'000U - 16'384U);
  EXPECT_EQ(queue.take(), request_of({}, 1'000'000'000'000 - 16'383)) << "the newest are kept";
  for (std::int64_t i = 1; i < 64; ++i) EXPECT_EQ(queue.add({}, 10 * i, 10 * i), 0U);
  EXPECT_EQ(queue.add({}, 5000, 5009), 10U);
}

}  // namespace
}  // namespace srfs::ros
