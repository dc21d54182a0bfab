// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ros/request_book.hpp"
#include "ros/service.hpp"

namespace srfs::ros {
namespace {

using Verdict = RequestBook::Verdict;

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
RequestBook::Response response(int n) {
  return std::make_shared<int>(n);
}

TEST(RequestBook, ARequestIsExecutedAndAnsweredOnce) {
  RequestBook book;
  const auto judged = book.judge(request(1, 7), std::nullopt, false, at(seconds(0)));
  ASSERT_EQ(judged.verdict, Verdict::execute);
  EXPECT_EQ(book.client(judged.ticket), request(1, 7).writer_guid());
  EXPECT_EQ(book.answer(judged.ticket, response(1), at(seconds(0))), request(1, 7));
  EXPECT_FALSE(book.answer(judged.ticket, response(1), at(seconds(0))));
  EXPECT_EQ(book.pending(), 0U);
}

TEST(RequestBook, ARepeatOfAnAnsweredRequestGetsTheSameAnswer) {
  RequestBook book;
  const auto first = book.judge(request(1, 7), std::nullopt, false, at(seconds(0)));
  const auto kept = response(1);
  (void)book.answer(first.ticket, kept, at(seconds(0)));
  const auto repeat = book.judge(request(1, 8), 7, false, at(seconds(1)));
  EXPECT_EQ(repeat.verdict, Verdict::answer_again);
  EXPECT_EQ(repeat.response, kept);
  EXPECT_EQ(book.judge(request(1, 9), 7, false, at(seconds(2))).verdict, Verdict::answer_again);
  EXPECT_EQ(book.counters().repeats, 2U);
}

TEST(RequestBook, ARepeatOfARequestUnderWayWaitsForItsAnswer) {
  RequestBook book;
  (void)book.judge(request(1, 7), std::nullopt, false, at(seconds(0)));
  EXPECT_EQ(book.judge(request(1, 8), 7, false, at(seconds(1))).verdict, Verdict::wait);
  EXPECT_EQ(book.pending(), 1U);
}

TEST(RequestBook, ARepeatWhoseFirstAttemptWasLostIsExecutedOnce) {
  RequestBook book;
  const auto second = book.judge(request(1, 8), 7, false, at(seconds(0)));
  ASSERT_EQ(second.verdict, Verdict::execute);
  EXPECT_EQ(book.answer(second.ticket, response(1), at(seconds(0))), request(1, 8))
      << "answered as the sample that came";
  EXPECT_EQ(book.judge(request(1, 9), 7, false, at(seconds(1))).verdict, Verdict::answer_again);
}

TEST(RequestBook, TheSameSequenceNumberOfAnotherClientIsAnotherRequest) {
  RequestBook book;
  (void)book.answer(book.judge(request(1, 7), std::nullopt, false, at(seconds(0))).ticket, response(1),
                    at(seconds(0)));
  EXPECT_EQ(book.judge(request(2, 8), 7, false, at(seconds(0))).verdict, Verdict::execute);
}

TEST(RequestBook, ForgetsAnswersAfterTheirTimeAndBeyondItsBound) {
  RequestBook book;
  const auto serve = [&](std::int64_t sequence, MonotonicTime now) {
    (void)book.answer(book.judge(request(1, sequence), std::nullopt, false, now).ticket, response(1), now);
  };
  serve(1, at(seconds(0)));
  EXPECT_EQ(book.judge(request(1, 500), 1, false, at(RequestBook::longest_memory)).verdict,
            Verdict::answer_again);
  EXPECT_EQ(book.judge(request(1, 501), 1, false, at(RequestBook::longest_memory + milliseconds(1))).verdict,
            Verdict::execute);

  for (std::int64_t n = 2; n < 2 + static_cast<std::int64_t>(RequestBook::most_answered) + 1; ++n)
    serve(n, at(seconds(20)));
  EXPECT_EQ(book.judge(request(1, 502), 3, false, at(seconds(20))).verdict, Verdict::answer_again);
  EXPECT_EQ(book.judge(request(1, 503), 2, false, at(seconds(20))).verdict, Verdict::execute);
}

TEST(RequestBook, RefusesAndCountsWhatItCannotKeep) {
  RequestBook book;
  for (std::size_t n = 1; n <= RequestBook::most_pending; ++n)
    EXPECT_EQ(
        book.judge(request(1, static_cast<std::int64_t>(n)), std::nullopt, false, at(seconds(0))).verdict,
        Verdict::execute);
  EXPECT_EQ(book.judge(request(2, 1), std::nullopt, false, at(seconds(0))).verdict, Verdict::refuse);
  EXPECT_EQ(book.counters().refused, 1U);
}

TEST(RequestBook, AForgottenRequestLeavesNothingAndItsRepeatIsExecuted) {
  RequestBook book;
  const auto ticket = book.judge(request(1, 7), std::nullopt, false, at(seconds(0))).ticket;
  book.forget(ticket);
  EXPECT_EQ(book.pending(), 0U);
  EXPECT_FALSE(book.answer(ticket, response(1), at(seconds(0))));
  EXPECT_EQ(book.judge(request(1, 8), 7, false, at(seconds(1))).verdict, Verdict::execute);
}

TEST(RequestBook, DropsTheRequestsOfAClientThatVanished) {
  RequestBook book;
  const auto gone = book.judge(request(1, 1), std::nullopt, false, at(seconds(0))).ticket;
  const auto there = book.judge(request(2, 1), std::nullopt, false, at(seconds(0))).ticket;
  const auto everybody = [](const GUID_t&) { return true; };
  const auto only_the_second = [](const GUID_t& c) { return c == request(2, 1).writer_guid(); };
  EXPECT_THAT(book.drop_vanished(everybody, at(milliseconds(1))), testing::IsEmpty());
  EXPECT_THAT(book.drop_vanished(only_the_second, at(milliseconds(2))), testing::ElementsAre(gone));
  EXPECT_FALSE(book.answer(gone, response(1), at(seconds(1))));
  EXPECT_TRUE(book.answer(there, response(1), at(seconds(1))));
  EXPECT_EQ(book.counters().dropped, 1U);
}

TEST(RequestBook, AClientThatWasThereWithItsRequestIsMissedAtOnce) {
  RequestBook book;
  (void)book.judge(request(1, 1), std::nullopt, true, at(seconds(0)));
  EXPECT_EQ(book.drop_vanished([](const GUID_t&) { return false; }, at(milliseconds(1))).size(), 1U);
}

TEST(RequestBook, AClientHasTimeToAppear) {
  RequestBook book;
  (void)book.judge(request(1, 1), std::nullopt, false, at(seconds(0)));
  const auto nobody = [](const GUID_t&) { return false; };
  EXPECT_THAT(book.drop_vanished(nobody, at(RequestBook::longest_to_match - milliseconds(1))),
              testing::IsEmpty());
  EXPECT_EQ(book.drop_vanished(nobody, at(RequestBook::longest_to_match)).size(), 1U);
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
