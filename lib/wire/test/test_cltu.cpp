// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <optional>
#include <random>

#include "lib/wire/test/link_vectors.hpp"
#include "wire/cltu.hpp"
#include "wire/sdls.hpp"
#include "wire/tc_uplink.hpp"

namespace srfs::wire {
namespace {

constexpr MonotonicTime start{seconds(10)};

Octets frame_of(std::size_t data_octets, std::uint8_t seed = 1) {
  Octets data(data_octets);
  std::mt19937 random(seed);
  for (std::uint8_t& octet : data) octet = static_cast<std::uint8_t>(random());
  return encode_tc_frame({.spacecraft_id = 0xAB, .vc = 1, .sequence = seed, .data = data});
}
Octets operator+(Octets left, const Octets& right) {
  left.insert(left.end(), right.begin(), right.end());
  return left;
}
Octets cut(Octets octets, std::size_t length) {
  octets.resize(length);
  return octets;
}

TEST(CltuDecoder, FindsFramesOfEveryLengthWhateverThePiecesTheyComeIn) {
  for (const bool randomized : {false, true}) {
    CltuDecoder decoder({.randomized = randomized});
    std::mt19937 random(2);
    for (std::size_t length = 1; length <= tc_data_octets_max; length += 1 + length / 16) {
      const Octets frame = frame_of(length, static_cast<std::uint8_t>(length));
      Octets line = encode_cltu(frame, randomized);
      std::vector<Octets> frames;
      for (OctetView rest(line); !rest.empty();) {
        const std::size_t piece = std::min<std::size_t>(1 + random() % 40, rest.size());
        for (Octets& found : decoder.push(rest.first(piece), start)) frames.push_back(std::move(found));
        rest = rest.subspan(piece);
      }
      ASSERT_EQ(frames.size(), 1U) << length;
      ASSERT_EQ(frames[0], frame) << length;
    }
    EXPECT_EQ(decoder.counters().noise_octets, 0U) << "the tail is no noise";
    EXPECT_EQ(decoder.counters().blocks_rejected, 0U);
  }
}

TEST(CltuDecoder, NeverNeedsTheTail) {
  CltuDecoder decoder({});
  const Octets frame = frame_of(30);
  const Octets line = encode_cltu(frame, false);
  EXPECT_EQ(decoder.push(cut(line, line.size() - 8), start).size(), 1U);
}

TEST(CltuDecoder, FindsTheStartSequenceInsideGarbageThatLooksLikeOne) {
  CltuDecoder decoder({});
  const Octets line = octets_of("0011ebebeb90ebeb") + encode_cltu(frame_of(20), false);
  EXPECT_EQ(decoder.push(line, start).size(), 1U);
}

TEST(CltuDecoder, ACltuCutAnywhereDoesNotTakeTheNextOneWithIt) {
  const Octets first = encode_cltu(frame_of(40, 1), false);
  const Octets second_frame = frame_of(25, 2);
  for (const bool correct : {false, true}) {
    for (const bool wrong_bit : {false, correct}) {
      Octets second = encode_cltu(second_frame, false);
      second[1] ^= wrong_bit ? 0x10 : 0;
      for (std::size_t length = 1; length < first.size() - 8; ++length) {
        CltuDecoder decoder({.correct_single_bits = correct});
        auto frames = decoder.push(cut(first, length) + second, start);
        for (Octets& late : decoder.on_idle(start + seconds(1))) frames.push_back(std::move(late));
        // The last blocks of the first frame may be complete if only fill is missing.
        ASSERT_FALSE(frames.empty()) << length;
        ASSERT_EQ(frames.back(), second_frame) << length;
      }
    }
  }
}

TEST(CltuDecoder, ASilentLineEndsACltuCutShort) {
  CltuDecoder decoder({.silence = std::chrono::milliseconds(200)});
  const Octets line = encode_cltu(frame_of(40), false);
  EXPECT_TRUE(decoder.push(cut(line, 20), start).empty());
  EXPECT_TRUE(decoder.in_cltu());
  EXPECT_TRUE(decoder.on_idle(start + milliseconds(199)).empty());
  EXPECT_TRUE(decoder.in_cltu());
  EXPECT_TRUE(decoder.on_idle(start + milliseconds(200)).empty());
  EXPECT_FALSE(decoder.in_cltu());
  EXPECT_EQ(decoder.counters().cut_short, 1U);
  EXPECT_EQ(decoder.push(line, start + seconds(1)).size(), 1U);
}

TEST(CltuDecoder, OctetsAfterASilenceDoNotContinueWhatWasBefore) {
  CltuDecoder decoder({.silence = std::chrono::milliseconds(200)});
  const Octets line = encode_cltu(frame_of(40), false);
  (void)decoder.push(cut(line, 18), start);
  EXPECT_EQ(decoder.push(line, start + milliseconds(300)).size(), 1U);
}

TEST(CltuDecoder, AReaderHeldUpInsideACltuLosesNothing) {
  CltuDecoder decoder({.silence = std::chrono::milliseconds(200)});
  const Octets frame = frame_of(40);
  const Octets line = encode_cltu(frame, false);
  (void)decoder.push(cut(line, 18), start);
  // The rest of the CLTU waited in the kernel while the reader did not run.
  const auto frames = decoder.push(Octets(line.begin() + 18, line.end()), start + milliseconds(350));
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(frames[0], frame);
  EXPECT_EQ(decoder.counters().cut_short, 0U);
}

TEST(CltuDecoder, RejectsOneWrongBitOrCorrectsItAsConfigured) {
  const Octets frame = frame_of(9);
  const Octets good = encode_cltu(frame, false);
  const std::size_t code_bits = (good.size() - 8 - 2) * 8;
  for (std::size_t bit = 0; bit < code_bits; ++bit) {
    Octets line = good;
    line[2 + bit / 8] ^= static_cast<std::uint8_t>(0x80 >> bit % 8);
    const bool filler = bit % 64 == 63;

    CltuDecoder detecting({});
    EXPECT_EQ(detecting.push(line, start).size(), filler ? 1U : 0U) << bit;
    EXPECT_EQ(detecting.counters().blocks_rejected, filler ? 0U : 1U) << bit;

    CltuDecoder correcting({.correct_single_bits = true});
    const auto frames = correcting.push(line, start);
    ASSERT_EQ(frames.size(), 1U) << bit;
    EXPECT_EQ(frames[0], frame);
    EXPECT_EQ(correcting.counters().corrected_bits, filler ? 0U : 1U);
  }
}

TEST(CltuDecoder, OneWrongBitOfTheStartSequenceIsToleratedWhereBlocksAreCorrected) {
  const Octets frame = frame_of(20);
  const Octets good = encode_cltu(frame, false);
  for (unsigned bit = 0; bit < 16; ++bit) {
    Octets line = good;
    line[bit / 8] ^= static_cast<std::uint8_t>(0x80U >> bit % 8);
    for (const std::size_t piece : {std::size_t{1}, line.size()}) {
      CltuDecoder correcting({.correct_single_bits = true});
      std::vector<Octets> frames;
      for (OctetView rest(line); !rest.empty(); rest = rest.subspan(std::min(piece, rest.size()))) {
        for (Octets& found : correcting.push(rest.first(std::min(piece, rest.size())), start))
          frames.push_back(std::move(found));
      }
      ASSERT_EQ(frames.size(), 1U) << bit;
      EXPECT_EQ(frames[0], frame);
      EXPECT_EQ(correcting.counters().corrected_bits, 1U);
      EXPECT_EQ(correcting.counters().noise_octets, 0U);
    }
    CltuDecoder detecting({.correct_single_bits = false});
    EXPECT_TRUE(detecting.push(line, start).empty()) << bit;
    for (unsigned other = bit + 1; other < 16; ++other) {
      Octets twice = line;
      twice[other / 8] ^= static_cast<std::uint8_t>(0x80U >> other % 8);
      CltuDecoder correcting({.correct_single_bits = true});
      EXPECT_TRUE(correcting.push(twice, start).empty()) << bit << ' ' << other;
    }
  }
}

TEST(CltuDecoder, CltusWithAWrongBitInEachBlockAndStartComeThroughNoiseAndOneAfterTheOther) {
  std::mt19937 random(11);
  CltuDecoder decoder({.correct_single_bits = true});
  std::vector<Octets> sent;
  std::vector<Octets> received;
  const auto push = [&](const Octets& octets) {
    for (Octets& found : decoder.push(octets, start)) received.push_back(std::move(found));
  };
  for (int i = 0; i < 2000; ++i) {
    Octets noise(random() % 3 == 0 ? random() % 40 : 0);
    for (std::uint8_t& octet : noise) octet = static_cast<std::uint8_t>(random());
    push(noise);
    sent.push_back(frame_of(1 + random() % 60, static_cast<std::uint8_t>(i)));
    Octets line = encode_cltu(sent.back(), false);
    line[random() % 2] ^= static_cast<std::uint8_t>(1U << random() % 8);
    for (std::size_t block = 2; block + 8 <= line.size() - 8; block += 8) {
      const std::size_t bit = random() % 63;  // the filler bit is not part of the code
      line[block + bit / 8] ^= static_cast<std::uint8_t>(0x80U >> bit % 8);
    }
    push(line);
  }
  for (Octets& late : decoder.on_idle(start + seconds(1))) received.push_back(std::move(late));
  EXPECT_EQ(received, sent);
}

TEST(CltuDecoder, TwoWrongBitsInABlockAreNeverCorrected) {
  const Octets good = encode_cltu(frame_of(9), false);
  for (std::size_t one = 0; one < 63; ++one) {
    for (std::size_t two = one + 1; two < 63; ++two) {
      Octets line = good;
      line[2 + one / 8] ^= static_cast<std::uint8_t>(0x80 >> one % 8);
      line[2 + two / 8] ^= static_cast<std::uint8_t>(0x80 >> two % 8);
      CltuDecoder decoder({.correct_single_bits = true});
      ASSERT_TRUE(decoder.push(line, start).empty()) << one << ' ' << two;
    }
  }
}

TEST(CltuDecoder, RefusesFramesOverItsLimitAtTheFirstBlock) {
  CltuDecoder decoder({.frame_octets_max = 64});
  const Octets line = encode_cltu(frame_of(100), false) + encode_cltu(frame_of(30), false);
  EXPECT_EQ(decoder.push(line, start).size(), 1U);
  EXPECT_EQ(decoder.counters().bad_length, 1U);
}

TEST(CltuDecoder, RefusesAFrameWithAWrongFecf) {
  Octets frame = frame_of(20);
  frame.back() ^= 1;
  CltuDecoder decoder({});
  EXPECT_TRUE(decoder.push(encode_cltu(frame, false), start).empty());
  EXPECT_EQ(decoder.counters().bad_fecf, 1U);
}

TEST(CltuDecoder, DataThatContainsAStartSequenceAtABlockBorderIsStillOneFrame) {
  // 5 octets of header, then data. Code blocks begin every 7 octets of the frame.
  const Octets frame = encode_tc_frame(
      {.spacecraft_id = 0xAB, .vc = 1, .data = octets_of("c000eb90eb90eb90eb90eb90eb90eb90eb90")});
  CltuDecoder decoder({});
  const auto frames = decoder.push(encode_cltu(frame, false), start);
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(frames[0], frame);
  EXPECT_EQ(decoder.counters().start_sequences, 1U);
}

TEST(CltuDecoder, AfterAnyGarbageAndSilenceTheNextGoodCltuDecodes) {
  std::mt19937 random(7);
  for (int round = 0; round < 2000; ++round) {
    const bool correct = round % 2 == 0;
    CltuDecoder decoder({.randomized = round % 3 == 0, .correct_single_bits = correct});
    Octets garbage(random() % 300);
    for (std::uint8_t& octet : garbage) {
      const auto choice = random() % 8;
      octet = choice == 0 ? 0xEB : choice == 1 ? 0x90 : static_cast<std::uint8_t>(random());
    }
    // Half of the rounds use a real CLTU with random damage instead of pure noise.
    if (round % 4 < 2) {
      garbage = encode_cltu(frame_of(1 + random() % 200), false);
      for (auto i = random() % 6; i-- > 0;)
        garbage[random() % garbage.size()] ^= static_cast<std::uint8_t>(random());
      garbage.resize(random() % garbage.size());
    }
    const Octets good = frame_of(1 + random() % 100, 99);
    (void)decoder.push(garbage, start);
    auto frames = decoder.push(encode_cltu(good, round % 3 == 0), start + milliseconds(1));
    for (Octets& late : decoder.on_idle(start + seconds(2))) frames.push_back(std::move(late));
    ASSERT_FALSE(frames.empty()) << round;
    ASSERT_EQ(frames.back(), good) << round;
    ASSERT_FALSE(decoder.in_cltu());
  }
}

TEST(TcUplink, APacketGoesThroughSecurityFrameAndCltuAndBack) {
  const SdlsKey key(std::array<std::uint8_t, sdls_key_octets>{1, 2, 3});
  const TcUplinkChannel channel{.spacecraft_id = 0xAB, .vc = 0, .randomize = true};
  const Octets packet = octets_of("1801c01600062f11010000ab62");
  const SdlsSeal seal{.key = key, .spi = 1, .counter = 77};

  CltuDecoder decoder({.randomized = true});
  const auto frames =
      decoder.push(make_uplink_cltu(channel, TcFrameType::ad, 9, &seal, packet).value(), start);
  ASSERT_EQ(frames.size(), 1U);
  const auto frame = decode_tc_frame(frames[0], 0xAB);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->sequence, 9);
  const auto opened = sdls_open(key, 1, 0, frame->data);
  ASSERT_TRUE(opened);
  EXPECT_EQ(opened->packet, packet);
  EXPECT_EQ(opened->counter, 77U);

  const auto clear =
      decoder.push(make_uplink_cltu(channel, TcFrameType::bd, 9, nullptr, packet).value(), start);
  ASSERT_EQ(clear.size(), 1U);
  EXPECT_EQ(to_hex(segment_payload(decode_tc_frame(clear[0], 0xAB)->data).value()), to_hex(packet));
  EXPECT_EQ(decode_tc_frame(clear[0], 0xAB)->sequence, 0);
}

TEST(TcUplink, RefusesWhatDoesNotFitIntoOneFrame) {
  const SdlsKey key(std::array<std::uint8_t, sdls_key_octets>{});
  const SdlsSeal seal{.key = key};
  const TcUplinkChannel channel{.spacecraft_id = 0xAB};
  const auto error = [&](const SdlsSeal* with, std::size_t octets) {
    const auto cltu = make_uplink_cltu(channel, TcFrameType::bd, 0, with, Octets(octets, 1));
    return cltu ? std::nullopt : std::optional(cltu.error());
  };
  EXPECT_EQ(error(nullptr, 0), TcUplinkError::empty);
  EXPECT_EQ(error(nullptr, tc_data_octets_max), TcUplinkError::too_long);
  EXPECT_EQ(error(&seal, sdls_packet_octets_max + 1), TcUplinkError::too_long);
  EXPECT_TRUE(make_uplink_cltu(channel, TcFrameType::bd, 0, &seal, Octets(sdls_packet_octets_max, 1)));
}

TEST(TcUplink, ControlCommandsGoUnsecured) {
  EXPECT_EQ(make_control_cltu({.spacecraft_id = 0xAB, .vc = 1}, {.kind = ControlCommand::Kind::unlock}),
            vector_named("CLTU of unlock"));
}

}  // namespace
}  // namespace srfs::wire
