// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/session_keys.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <random>

#include "tests/temporary_folder.hpp"

namespace srfs::wire {
namespace {

SdlsKey key(std::uint8_t first) {
  return SdlsKey({first, 0x5A, 0x17});
}
SessionKeys with_active(std::uint16_t id, std::uint8_t first, const SessionKeys& keys = {}) {
  return *keys.uploaded(id, key(first))->activated(id);
}

TEST(SessionKeys, GoFromOtarToUseAndTheOldKeyEndsWithTheFirstFrameUnderTheNewOne) {
  SessionKeys keys = with_active(128, 1);
  keys = *keys.rekeyed(1, 128);
  EXPECT_EQ(keys.use_of(1)->current, SessionKeys::file_id) << "until a frame came";
  keys = keys.confirmed(1, 128);
  EXPECT_EQ(keys.use_of(1), (SessionKeys::Use{.spi = 1, .current = 128}));

  keys = *with_active(129, 2, keys).rekeyed(1, 129);
  EXPECT_EQ(keys.use_of(1), (SessionKeys::Use{.spi = 1, .current = 128, .next = 129}));
  keys = keys.confirmed(1, 129);
  EXPECT_EQ(keys.find(128), nullptr) << "destroyed";
  EXPECT_EQ(keys.use_of(1)->current, 129);
}

TEST(SessionKeys, RefuseWhatWouldLeaveAnAssociationWithoutAKey) {
  const SessionKeys keys = *with_active(128, 1).rekeyed(1, 128);
  EXPECT_EQ(keys.deactivated(128).error(), KeyRefusal::key_in_use);
  EXPECT_EQ(keys.destroyed(128).error(), KeyRefusal::key_in_use);
  EXPECT_EQ(keys.confirmed(1, 128).destroyed(128).error(), KeyRefusal::key_in_use);
  EXPECT_EQ(keys.uploaded(128, key(9)).error(), KeyRefusal::wrong_state) << "its octets stay";
}

TEST(SessionKeys, OneKeyServesOneAssociation) {
  const SessionKeys keys = *with_active(128, 1).rekeyed(1, 128);
  EXPECT_EQ(keys.rekeyed(2, 128).error(), KeyRefusal::key_in_use);
  EXPECT_EQ(keys.uploaded(129, key(1)).error(), KeyRefusal::not_a_new_key);
}

TEST(SessionKeys, OnlyAnActiveKeyIsTakenIntoUseAndADeactivatedOneNeverIs) {
  SessionKeys keys = *SessionKeys{}.uploaded(128, key(1));
  EXPECT_EQ(keys.rekeyed(1, 128).error(), KeyRefusal::wrong_state);
  EXPECT_EQ(keys.rekeyed(1, 130).error(), KeyRefusal::unknown_key);
  keys = *keys.deactivated(128);
  EXPECT_EQ(keys.activated(128).error(), KeyRefusal::wrong_state);
  EXPECT_EQ(keys.uploaded(128, key(1)).error(), KeyRefusal::wrong_state);
  EXPECT_EQ(keys.destroyed(128)->find(128), nullptr);
}

TEST(SessionKeys, ARepeatChangesNothing) {
  const SessionKeys keys = *with_active(128, 1).rekeyed(1, 128);
  EXPECT_EQ(keys.uploaded(128, key(1))->generation(), keys.generation());
  EXPECT_EQ(keys.activated(128)->generation(), keys.generation());
  EXPECT_EQ(keys.rekeyed(1, 128)->generation(), keys.generation());
  const SessionKeys used = keys.confirmed(1, 128);
  EXPECT_EQ(used.confirmed(1, 128).generation(), used.generation());
  EXPECT_EQ(used.rekeyed(1, 128)->generation(), used.generation());
}

TEST(SessionKeys, AKeyThatIsSentAgainBeforeItIsActiveReplacesItself) {
  const SessionKeys keys = *SessionKeys{}.uploaded(128, key(1))->uploaded(128, key(2));
  ASSERT_EQ(keys.keys().size(), 1U);
  EXPECT_TRUE(keys.has(key(2).octets()));
}

/// While the rekeying to another key was written, a frame under the one before came.
TEST(SessionKeys, AConfirmationNamesItsKey) {
  SessionKeys keys = *with_active(128, 1).rekeyed(1, 128);
  keys = *with_active(129, 2, keys).rekeyed(1, 129);
  keys = keys.confirmed(1, 128);
  EXPECT_EQ(keys.use_of(1), (SessionKeys::Use{.spi = 1, .current = 128, .next = 129}));
}

/// A key that was the next one, and no longer is, may be deactivated before a frame under it is known here.
TEST(SessionKeys, AConfirmationOfAKeyThatIsNotActiveChangesNothing) {
  SessionKeys keys = *with_active(128, 1).rekeyed(1, 128);
  keys = *with_active(129, 2, keys).rekeyed(1, 129);
  keys = *keys.deactivated(128);
  EXPECT_EQ(keys.confirmed(1, 128), keys);
  EXPECT_EQ(decode_session_keys(encode_session_keys(keys.confirmed(1, 128))), keys);
}

TEST(SessionKeys, HaveABound) {
  SessionKeys keys;
  for (std::uint16_t i = 0; i < SessionKeys::max_keys; ++i)
    keys = *keys.uploaded(static_cast<std::uint16_t>(128 + i), key(static_cast<std::uint8_t>(i + 1)));
  EXPECT_EQ(keys.uploaded(999, key(99)).error(), KeyRefusal::table_full);
  EXPECT_EQ(keys.uploaded(127, key(99)).error(), KeyRefusal::unknown_key);
  EXPECT_EQ(keys.uploaded(SessionKeys::lost_id, key(99)).error(), KeyRefusal::unknown_key);
}

TEST(SessionKeyText, IsReadAsItWasWritten) {
  SessionKeys keys = *with_active(128, 1).rekeyed(1, 128);
  keys = *with_active(129, 2, keys.confirmed(1, 128)).rekeyed(1, 129);
  EXPECT_EQ(decode_session_keys(encode_session_keys(keys)), keys);
  EXPECT_EQ(decode_session_keys(encode_session_keys({})), SessionKeys{});
  const SessionKeys lost = SessionKeys::lost({1, 2});
  EXPECT_EQ(decode_session_keys(encode_session_keys(lost)), lost);
}

TEST(SessionKeyText, IsRefusedWithAnyOctetChangedOrMissing) {
  const std::string text = encode_session_keys(*with_active(128, 1).rekeyed(1, 128));
  for (std::size_t i = 0; i < text.size(); ++i) {
    EXPECT_FALSE(decode_session_keys(text.substr(0, i))) << i;
    std::string changed = text;
    changed[i] = changed[i] == '0' ? '1' : '0';
    EXPECT_FALSE(decode_session_keys(changed)) << i;
  }
}

TEST(SessionKeyFile, IsForItsOwnerAloneAndADamagedCopyCostsNothing) {
  const testing_support::TemporaryFolder folder;
  const auto path = folder.path() / "session_keys";
  const SessionKeys keys = with_active(128, 1);
  ASSERT_EQ(session_key_file(path).store(keys).copies, 2U);
  for (const char* copy : {".0", ".1"}) {
    struct stat info {};
    ASSERT_EQ(stat((path.string() + copy).c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 0777U, 0600U);
  }
  std::filesystem::resize_file(path.string() + ".1", 20);
  const auto found = session_key_file(path).load();
  EXPECT_EQ(found.state, keys);
  EXPECT_EQ(found.damaged.size(), 1U);
}

/// Whatever is asked in whatever order: no association loses its key, and what is stored is read again.
TEST(SessionKeyProperties, HoldInEverySequenceOfChanges) {
  for (std::uint32_t seed = 1; seed <= 200; ++seed) {
    std::mt19937 random(seed);
    SessionKeys keys;
    for (int step = 0; step < 100; ++step) {
      const auto id = static_cast<std::uint16_t>(128 + random() % 20);
      const auto spi = static_cast<std::uint16_t>(1 + random() % 3);
      const auto old = keys;
      const auto take = [&](const Result<SessionKeys, KeyRefusal>& after) { keys = after ? *after : keys; };
      switch (random() % 6) {
        case 0:
          take(keys.uploaded(id, key(static_cast<std::uint8_t>(random() % 250))));
          break;
        case 1:
          take(keys.activated(id));
          break;
        case 2:
          take(keys.deactivated(id));
          break;
        case 3:
          take(keys.destroyed(id));
          break;
        case 4:
          take(keys.rekeyed(spi, id));
          break;
        default:
          if (const auto use = keys.use_of(spi); use && use->next) keys = keys.confirmed(spi, *use->next);
      }
      ASSERT_EQ(decode_session_keys(encode_session_keys(keys)), keys) << "seed " << seed;
      for (const auto& use : old.uses()) {
        const auto after = keys.use_of(use.spi);
        ASSERT_TRUE(after);
        const bool kept = after->current == use.current || after->current == use.next;
        EXPECT_TRUE(kept && (after->current == SessionKeys::file_id || keys.find(after->current) != nullptr));
      }
    }
  }
}

}  // namespace
}  // namespace srfs::wire
