// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// How it goes on with the ground, and power cuts: ground/test/test_key_change.cpp.
#include "nodes/ttc/services/key_management_service.hpp"

#include <algorithm>
#include <array>
#include <optional>

#include <gtest/gtest.h>

#include "tests/mission_dictionary.hpp"
#include "wire/sdls_procedures.hpp"
#include "wire/tc_uplink.hpp"

namespace srfs {
namespace {

namespace failure = mission::failure;

constexpr std::uint16_t spacecraft = 0xAB;

/// No pattern that why_known() refuses.
wire::SdlsKey key(std::uint8_t first) {
  std::array<std::uint8_t, wire::sdls_key_octets> octets{};
  for (std::size_t i = 0; i < octets.size(); ++i)
    octets.at(i) = static_cast<std::uint8_t>(first + 7 * i * i + i);
  return wire::SdlsKey(octets);
}

class KeyManagement : public testing::Test {
 protected:
  static UplinkConfig config() {
    UplinkConfig config;
    config.spacecraft_id = spacecraft;
    config.strict = true;
    UplinkChannel channel;
    channel.associations.push_back({.spi = 1, .key = key(1), .for_ad = false});
    channel.associations.push_back({.spi = 2, .key = key(2), .for_bd = false});
    channel.associations.push_back({.spi = 5, .key = key(5), .set = std::nullopt});
    config.channels.push_back(std::move(channel));
    return config;
  }
  static std::vector<KeyEncryptionKey> masters() {
    std::vector<KeyEncryptionKey> keys;
    keys.push_back({.id = 1, .key = key(0xE1)});
    keys.push_back({.id = 2, .key = key(0xE2)});
    return keys;
  }
  /// Executes it, and stores what it wants if @p store.
  template <class Command>
  void run(const Command& command, std::optional<bool> store = true) {
    const auto* definition = dictionary_.command(Command::name);
    ASSERT_NE(definition, nullptr);
    const Octets arguments = command.encoded();
    ASSERT_TRUE(dictionary_.check_arguments(*definition, arguments));
    service_.execute({.origin = {.apid = 1, .ack_flags = wire::ack::all, .id = ++id_},
                      .command = definition,
                      .arguments = arguments},
                     {});
    if (store) store_all(*store);
  }
  void store_all(bool works) {
    while (const auto change = service_.take_change()) service_.on_stored(*change, works);
  }
  /// Failure code of the last report; nullopt: completed.
  std::optional<std::uint16_t> end() {
    const auto reports = reports_.take();
    if (reports.empty() || reports.back().service != 1) return failure::none;
    if (reports.back().subtype == 7) return std::nullopt;
    return OctetReader(OctetView(reports.back().data).subspan(4)).u16();
  }
  static mission::KeysOtar otar(std::uint16_t id, std::uint8_t first, std::uint16_t master = 1,
                                std::uint8_t master_key = 0xE1) {
    const Octets iv(wire::sdls_iv_octets, 0x33);
    const auto sealed = wire::seal_key(key(master_key), iv, id, key(first));
    OctetReader in(sealed->iv_block_mac);
    mission::KeysOtar otar;
    otar.tag = 1;
    otar.length = 64;
    otar.master = master;
    otar.iv_1 = in.u32();
    otar.iv_2 = in.u64();
    otar.sealed_id = in.u16();
    for (auto* word :
         {&otar.sealed_1, &otar.sealed_2, &otar.sealed_3, &otar.sealed_4, &otar.mac_1, &otar.mac_2})
      *word = in.u64();
    return otar;
  }
  template <class Command>
  static Command about(std::uint16_t id) {
    Command command;
    command.tag = Command::subtype;
    command.length = 2;
    command.key = id;
    return command;
  }
  static mission::KeysRekey rekey(std::uint16_t spi, std::uint16_t id) {
    mission::KeysRekey command;
    command.tag = mission::KeysRekey::subtype;
    command.length = 4;
    command.spi = spi;
    command.key = id;
    return command;
  }
  void bring(std::uint16_t id, std::uint8_t first) {
    run(otar(id, first));
    run(about<mission::KeysActivate>(id));
    ASSERT_EQ(end(), std::nullopt);
  }
  std::size_t send(const wire::SdlsKey& used, std::uint16_t spi = 1) {
    const wire::SdlsSeal seal{.key = used, .spi = spi, .counter = ++counter_, .sender = 7};
    const Octets packet = wire::make_tc_packet({.apid = 1, .service = 17, .subtype = 1});
    const auto cltu = wire::make_uplink_cltu({.spacecraft_id = spacecraft, .vc = 0, .whole_header = true},
                                             wire::TcFrameType::bd, 0, &seal, packet);
    const std::size_t packets = uplink_.push(*cltu, {}).size();
    service_.on_confirmed(uplink_.take_confirmed());
    return packets;
  }

  const mission::Dictionary& dictionary_ = testing_support::dictionary();
  UplinkChain uplink_{config(), LinkState{}};
  ReportQueue reports_;
  KeyManagementService service_{{}, masters(), rekeyable_associations(config()), uplink_, reports_};
  std::uint64_t id_ = 0;
  std::uint64_t counter_ = lowest_clock_counter;
};

TEST_F(KeyManagement, TakesAnAssociationFromItsFileToANewKey) {
  bring(128, 9);
  EXPECT_EQ(send(key(9)), 0U) << "not its key yet";
  run(rekey(1, 128));
  EXPECT_EQ(end(), std::nullopt);
  EXPECT_EQ(send(key(1)), 1U) << "the old one";
  EXPECT_EQ(send(key(9)), 1U) << "and the new one";
  EXPECT_EQ(send(key(1)), 0U) << "which is alone since then";
  EXPECT_EQ(send(key(5), 5), 1U) << "the contingency key always";
  store_all(true);
  EXPECT_EQ(service_.keys().use_of(1), (wire::SessionKeys::Use{.spi = 1, .current = 128}));
}

TEST_F(KeyManagement, AFrameThatIsRefusedEndsNoKey) {
  bring(128, 9);
  run(rekey(1, 128));
  counter_ += 10;
  EXPECT_EQ(send(key(1)), 1U);
  counter_ -= 5;
  EXPECT_EQ(send(key(9)), 0U) << "replayed";
  counter_ += 5;
  EXPECT_EQ(send(key(1)), 1U);
}

TEST_F(KeyManagement, TheContingencyKeyIsNeverReplaced) {
  bring(128, 9);
  run(rekey(5, 128));
  EXPECT_EQ(end(), failure::unknown_key);
}

TEST_F(KeyManagement, OtarTakesOnlyWhatOneOfItsOwnKeysHasSealed) {
  run(otar(128, 9, 1, 0xE2));
  EXPECT_EQ(end(), failure::key_not_authentic);
  run(otar(128, 9, 3));
  EXPECT_EQ(end(), failure::unknown_key);
  run(otar(128, 9, 2, 0xE2));
  EXPECT_EQ(end(), std::nullopt) << "the second one";
}

TEST_F(KeyManagement, OtarTakesNoKeyThatIsOneAlready) {
  run(otar(128, 1));
  EXPECT_EQ(end(), failure::not_a_new_key) << "of an association";
  run(otar(128, 0xE2));
  EXPECT_EQ(end(), failure::not_a_new_key) << "a key-encryption key";
  run(otar(127, 9));
  EXPECT_EQ(end(), failure::unknown_key) << "no id of a session key";
}

TEST_F(KeyManagement, ProvesThatItHasAKey) {
  mission::KeysVerify verify;
  verify.tag = 4;
  verify.length = 18;
  verify.key = 128;
  verify.challenge_1 = 0x0102030405060708;
  verify.challenge_2 = 0x090A0B0C0D0E0F10;
  run(otar(128, 9));
  run(verify);
  EXPECT_EQ(end(), failure::wrong_key_state) << "only an active one";
  run(about<mission::KeysActivate>(128));
  (void)reports_.take();

  run(verify);

  const auto reports = reports_.take();
  const auto answer = std::find_if(reports.begin(), reports.end(), [](const Report& r) {
    return r.service == KeyManagementService::service_type;
  });
  ASSERT_NE(answer, reports.end());
  EXPECT_FALSE(answer->stored);
  const auto decoded = mission::KeyVerification::decode(answer->data);
  ASSERT_TRUE(decoded);
  EXPECT_EQ(decoded->tag, 0x84);
  EXPECT_EQ(decoded->length, answer->data.size() - wire::procedure_header_octets);
  const wire::Challenge challenge{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};
  EXPECT_TRUE(wire::is_right_answer(key(9), challenge, OctetView(answer->data).subspan(5)));
}

TEST_F(KeyManagement, WhatCannotBeStoredIsNotDone) {
  run(otar(128, 9), false);
  EXPECT_EQ(end(), failure::storage_unavailable);
  EXPECT_TRUE(service_.keys().keys().empty());
  bring(128, 9);
  run(rekey(1, 128), false);
  EXPECT_EQ(end(), failure::storage_unavailable);
  EXPECT_EQ(send(key(9)), 0U);
}

TEST_F(KeyManagement, RequestsThatComeDuringAWriteWaitAndOneTooManyIsRefused) {
  run(otar(128, 9), std::nullopt);
  const auto writing = service_.take_change();
  ASSERT_TRUE(writing);
  run(about<mission::KeysActivate>(128), std::nullopt);
  for (std::uint16_t id = 129; id < 132; ++id) run(otar(id, static_cast<std::uint8_t>(id)), std::nullopt);
  EXPECT_FALSE(service_.take_change());
  run(otar(140, 140), std::nullopt);
  EXPECT_EQ(end(), failure::busy);

  service_.on_stored(*writing, true);
  store_all(true);

  EXPECT_EQ(service_.keys().keys().size(), 4U);
  EXPECT_EQ(service_.keys().find(128)->state, wire::KeyState::active);
}

TEST_F(KeyManagement, ReportsItsKeysInARange) {
  bring(128, 9);
  run(otar(130, 10));
  (void)reports_.take();
  mission::KeysInventory inventory;
  inventory.tag = 7;
  inventory.length = 4;
  inventory.first = 129;
  inventory.last = 65535;

  run(inventory);

  const auto reports = reports_.take();
  const auto listed = mission::KeyInventory::decode(reports.front().data);
  ASSERT_TRUE(listed);
  EXPECT_EQ(listed->key, 130);
  EXPECT_EQ(listed->state, mission::KeyState::pre_active);
  EXPECT_EQ(to_hex(reports.front().data),
            "870005"
            "0001"
            "0082"
            "00");
  EXPECT_EQ(reports.size(), 3U) << "and start and completion";
}

TEST_F(KeyManagement, TheCounterIsReadAndRaisedByADayAtMostAndNeverLowered) {
  ASSERT_EQ(send(key(1)), 1U);
  mission::KeysSetArsn set;
  set.tag = mission::KeysSetArsn::subtype;
  set.length = 10;
  set.spi = 1;
  set.counter = counter_ - 1;
  run(set);
  EXPECT_EQ(end(), failure::arsn_out_of_range);
  set.counter = counter_ + KeyManagementService::max_arsn_step + 1;
  run(set);
  EXPECT_EQ(end(), failure::arsn_out_of_range);
  set.counter = counter_ + 1000;
  run(set);
  EXPECT_EQ(end(), std::nullopt);
  EXPECT_EQ(send(key(1)), 0U) << "up to it";
  EXPECT_EQ(send(key(5), 5), 0U) << "one order for all on a strict link";
  EXPECT_EQ(uplink_.state().associations.front().counter, counter_ - 2 + 1000) << "goes to the journal";

  mission::KeysReadArsn read;
  read.tag = mission::KeysReadArsn::subtype;
  read.length = 2;
  read.spi = 1;
  run(read);
  const auto reports = reports_.take();
  const auto arsn = mission::AssociationArsn::decode(reports.front().data);
  ASSERT_TRUE(arsn);
  EXPECT_EQ(arsn->counter, counter_ - 2 + 1000);
  read.spi = 77;
  run(read);
  EXPECT_EQ(end(), failure::unknown_key);
}

TEST_F(KeyManagement, AKeyInUseIsNeitherDeactivatedNorDestroyed) {
  bring(128, 9);
  run(rekey(1, 128));
  run(about<mission::KeysDeactivate>(128));
  EXPECT_EQ(end(), failure::key_in_use);
  run(about<mission::KeysDestroy>(128));
  EXPECT_EQ(end(), failure::key_in_use);
  bring(129, 10);
  run(about<mission::KeysDeactivate>(129));
  run(about<mission::KeysActivate>(129));
  EXPECT_EQ(end(), failure::wrong_key_state);
  run(about<mission::KeysDestroy>(129));
  EXPECT_EQ(end(), std::nullopt);
  EXPECT_EQ(service_.keys().find(129), nullptr);
}

/// While the rekeying to another key was written, a frame under the one before came, which is the key of the
/// association since then.
TEST_F(KeyManagement, AKeyThatHasJustBecomeTheCurrentOneIsInUseBeforeThatIsStored) {
  bring(128, 9);
  bring(129, 10);
  run(rekey(1, 128));
  run(rekey(1, 129), std::nullopt);
  const auto writing = service_.take_change();
  ASSERT_TRUE(writing);
  ASSERT_EQ(send(key(9)), 1U);
  service_.on_stored(*writing, true);

  run(about<mission::KeysDeactivate>(128), std::nullopt);
  EXPECT_EQ(end(), failure::key_in_use);
  run(about<mission::KeysDestroy>(128), std::nullopt);
  EXPECT_EQ(end(), failure::key_in_use);
  run(rekey(2, 128), std::nullopt);
  EXPECT_EQ(end(), failure::key_in_use) << "nor has it another association";
  store_all(true);

  EXPECT_EQ(service_.keys().use_of(1), (wire::SessionKeys::Use{.spi = 1, .current = 128, .next = 129}));
  EXPECT_EQ(wire::decode_session_keys(wire::encode_session_keys(service_.keys())), service_.keys());
  EXPECT_EQ(send(key(9)), 1U);
  EXPECT_EQ(send(key(10)), 1U);
}

}  // namespace
}  // namespace srfs
