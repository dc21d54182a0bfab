// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/package.hpp"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/file.hpp"
#include "base/sha256.hpp"
#include "tests/temporary_folder.hpp"
#include "update/deflate.hpp"

namespace srfs::update {
namespace {

using Json = nlohmann::json;

Octets octets(std::string_view text) {
  return {text.begin(), text.end()};
}

SigningSeed seed_of(std::uint8_t first) {
  SigningSeed seed{};
  for (std::size_t i = 0; i < seed.size(); ++i) seed[i] = static_cast<std::uint8_t>(first + i);
  return seed;
}

std::string hash(std::string_view text) {
  return to_digits(sha256_of(octets(text)));
}

const SigningSeed ours = seed_of(0);
const PublicKey key = public_key_of(ours);
const std::string source = "int main(){}\n";

/// A good package that tests modify.
struct PackageTest : testing::Test {
  Json manifest = {
      {"format", "srfs node package 1"}, {"node", "payload_eps"}, {"kind", "replace"}, {"counter", 7},
      {"files", Json::array()},          {"options", {"-O2"}},    {"self_test_s", 10}, {"probation_s", 300}};
  std::vector<Octets> contents;
  std::uint64_t last_counter = 6;

  PackageTest() {
    add("src/main.cpp", source);
    add("src/power.hpp", "#pragma once\n");
  }
  void add(const std::string& path, const std::string& text) {
    manifest["files"].push_back({{"path", path}, {"octets", text.size()}, {"sha256", hash(text)}});
    contents.push_back(octets(text));
  }
  [[nodiscard]] Octets package() const { return make_package(manifest.dump(), contents, ours); }
  [[nodiscard]] Result<VerifiedPackage, PackageFailure> verify(const Octets& package) const {
    return verify_package(package, key, [&](std::string_view node) {
      EXPECT_EQ(node, "payload_eps");
      return last_counter;
    });
  }
  [[nodiscard]] std::optional<PackageRefusal> refusal(const Octets& package) const {
    const auto verified = verify(package);
    return verified ? std::nullopt : std::optional(verified.error().refusal);
  }
  [[nodiscard]] std::optional<PackageRefusal> refusal() const { return refusal(package()); }
};

TEST(PackageSignature, IsThatOfTheIndependentVector) {
  // tests/vectors/ground_link.txt
  const auto vectors = read_file(SRFS_SOURCE_DIR "/tests/vectors/ground_link.txt");
  ASSERT_TRUE(vectors);
  std::string digits;
  for (const std::uint8_t octet : sign(octets(source), ours)) {
    constexpr std::string_view hex = "0123456789abcdef";
    digits += hex[octet >> 4U];
    digits += hex[octet & 15U];
  }
  EXPECT_THAT(*vectors, testing::HasSubstr("SHA-256(\"int main(){}\\n\") = " + digits));
}

TEST(PackageSignature, HoldsForItsContentAndKeyAlone) {
  const Signature signature = sign(octets(source), ours);
  EXPECT_TRUE(is_signed(octets(source), signature, key));
  EXPECT_FALSE(is_signed(octets(source + " "), signature, key));
  EXPECT_FALSE(is_signed(octets(source), signature, public_key_of(seed_of(1))));
  for (std::size_t i = 0; i < signature.size(); ++i) {
    Signature changed = signature;
    changed[i] ^= 1U;
    EXPECT_FALSE(is_signed(octets(source), changed, key)) << i;
  }
}

TEST_F(PackageTest, ThatIsGoodGivesItsManifestAndFiles) {
  manifest["binary_sha256"] = hash("binary");
  const Octets good = package();
  const auto verified = verify(good);
  ASSERT_TRUE(verified) << verified.error().detail;
  EXPECT_EQ(verified->manifest.node, "payload_eps");
  EXPECT_EQ(verified->manifest.kind, PackageKind::replace);
  EXPECT_EQ(verified->manifest.counter, 7U);
  EXPECT_EQ(verified->manifest.probation, seconds(300));
  EXPECT_EQ(verified->manifest.binary_sha256, hash("binary"));
  ASSERT_EQ(verified->contents.size(), 2U);
  EXPECT_TRUE(std::ranges::equal(verified->contents[0], octets(source)));
  EXPECT_EQ(*decode_manifest(encode(verified->manifest)), verified->manifest);
}

TEST_F(PackageTest, OfANewNodeNeedsADeploymentEntryAndOneOfAnOldNodeHasNone) {
  manifest["kind"] = "new";
  EXPECT_EQ(refusal(), PackageRefusal::bad_manifest);
  manifest["deployment"] = {{"executable", "impact_node"}, {"memory_limit_mib", 64}};
  manifest["ring_after"] = "payload_thermal";
  const Octets good = package();
  const auto verified = verify(good);
  ASSERT_TRUE(verified) << verified.error().detail;
  EXPECT_EQ(verified->manifest.ring_after, "payload_thermal");
  EXPECT_EQ(*decode_manifest(encode(verified->manifest)), verified->manifest);
  manifest["kind"] = "replace";
  EXPECT_EQ(refusal(), PackageRefusal::bad_manifest);
}

TEST_F(PackageTest, IsRefusedWithAWrongSignatureOrAnotherKey) {
  Octets changed = package();
  changed[8 + 2 + 8 + 4 + 10] ^= 1U;  // in the manifest
  EXPECT_EQ(refusal(changed), PackageRefusal::wrong_signature);
  EXPECT_EQ(refusal(make_package(manifest.dump(), contents, seed_of(9))), PackageRefusal::wrong_key);
  // A key name alone proves nothing: the signature must match that key.
  Octets claimed = make_package(manifest.dump(), contents, seed_of(9));
  const Octets genuine = package();
  std::copy_n(genuine.begin() + 10, 8, claimed.begin() + 10);
  EXPECT_EQ(refusal(claimed), PackageRefusal::wrong_signature);
}

TEST_F(PackageTest, IsRefusedWhenAnyOctetIsChangedOrMissing) {
  const Octets good = package();
  for (std::size_t i = 0; i < good.size(); ++i) {
    Octets changed = good;
    changed[i] ^= 1U;
    EXPECT_TRUE(refusal(changed)) << i;
    EXPECT_TRUE(refusal(Octets(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(i)))) << i;
  }
  Octets longer = good;
  longer.push_back(0);
  EXPECT_EQ(refusal(longer), PackageRefusal::wrong_size);
}

TEST_F(PackageTest, IsRefusedUnlessItsCounterIsHigherThanTheLast) {
  for (const std::uint64_t last : {7U, 8U}) {
    last_counter = last;
    EXPECT_EQ(refusal(), PackageRefusal::old_counter);
  }
  manifest["counter"] = 0;
  last_counter = 0;
  EXPECT_EQ(refusal(), PackageRefusal::bad_manifest);
}

TEST_F(PackageTest, IsRefusedWhenAFileIsNotWhatWasSigned) {
  contents[1][3] ^= 1U;
  const auto verified = verify(package());
  ASSERT_FALSE(verified);
  EXPECT_EQ(verified.error().refusal, PackageRefusal::wrong_hash);
  EXPECT_EQ(verified.error().detail, "src/power.hpp");
  contents[1].pop_back();
  EXPECT_EQ(refusal(), PackageRefusal::wrong_size);
}

TEST_F(PackageTest, IsRefusedWhenAPathWouldLeaveItsFolderHideOrBeTakenForAnOption) {
  for (const char* path :
       {"", "/etc/passwd", "..", "../x", "a/../../x", "a//b", "a/", "./a", "a/./b", ".hidden", "a/.git", "-o",
        "a/-o", "a b", "a\\b", "a\nb", "a;b", "\xc3\xa4", "a/b/c/d/e/f/g/h/i"}) {
    manifest["files"][0]["path"] = path;
    EXPECT_EQ(refusal(), PackageRefusal::bad_path) << path;
  }
  manifest["files"][0]["path"] = std::string(121, 'a');
  EXPECT_EQ(refusal(), PackageRefusal::bad_path);
  manifest["files"][0]["path"] = "src/power.hpp";
  EXPECT_EQ(refusal(), PackageRefusal::bad_path) << "twice";
  manifest["files"][0]["path"] = "src";
  EXPECT_EQ(refusal(), PackageRefusal::bad_path) << "a file and a folder";
  manifest["files"][0]["path"] = "a/b/c/d/e/f/g/h..2-x_";
  EXPECT_EQ(refusal(), std::nullopt);
}

TEST_F(PackageTest, IsRefusedWithAnythingButOrdinaryFiles) {
  for (const char* type : {"link", "symlink", "device", "directory", ""}) {
    manifest["files"][1]["type"] = type;
    EXPECT_EQ(refusal(), PackageRefusal::link) << type;
  }
  manifest["files"][1]["type"] = "file";
  EXPECT_EQ(refusal(), std::nullopt);
}

TEST_F(PackageTest, IsRefusedWithTooManyOrTooLargeFilesBeforeTheyAreLookedAt) {
  for (std::size_t i = contents.size(); i < PackageLimits::files; ++i) add("f" + std::to_string(i), "");
  EXPECT_EQ(refusal(), std::nullopt);
  add("one_more", "");
  EXPECT_EQ(refusal(), PackageRefusal::too_many_files);
  manifest["files"].erase(manifest["files"].begin() + 2, manifest["files"].end());
  manifest["files"][0]["octets"] = PackageLimits::file_octets + 1;
  EXPECT_EQ(refusal(), PackageRefusal::too_large);
  manifest["files"][0]["octets"] = -1;
  EXPECT_EQ(refusal(), PackageRefusal::bad_manifest);
  EXPECT_EQ(refusal(Octets(PackageLimits::package_octets + 1)), PackageRefusal::too_large);
  manifest["node"] = std::string(PackageLimits::manifest_octets, 'x');
  EXPECT_EQ(refusal(), PackageRefusal::too_large);
}

TEST_F(PackageTest, IsRefusedWithOptionsOrKeysThatAreNotKnown) {
  for (const char* option : {"-fplugin=x.so", "-B/tmp", "@file", "-O2 -wrapper x", ""}) {
    manifest["options"] = {"-O2", option};
    EXPECT_EQ(refusal(), PackageRefusal::bad_option) << option;
  }
  manifest["options"] = Json::array();
  EXPECT_EQ(refusal(), std::nullopt);
  for (const char* field : {"node", "kind", "counter", "files", "options", "self_test_s", "probation_s"}) {
    const Json before = manifest;
    manifest.erase(field);
    EXPECT_EQ(refusal(), PackageRefusal::bad_manifest) << field;
    manifest = before;
  }
  for (const char* node : {"", "Payload", "a/b", "..", "payload eps", "1st"}) {
    EXPECT_FALSE(decode_manifest([&] {
      Json other = manifest;
      other["node"] = node;
      return other.dump();
    }()));
  }
  const Json before = manifest;
  manifest["post_install"] = "rm -rf /";
  EXPECT_EQ(refusal(), PackageRefusal::bad_manifest);
  manifest = before;
  manifest["probation_s"] = 0;
  EXPECT_EQ(refusal(), PackageRefusal::bad_manifest);
  manifest = before;
  manifest["format"] = "srfs node package 3";
  EXPECT_EQ(refusal(), PackageRefusal::unknown_format);
}

TEST_F(PackageTest, MayBringADictionaryFragmentThatIsOneOfItsFiles) {
  manifest["dictionary"] = "src/power.hpp";
  const Octets good = package();
  const auto verified = verify(good);
  ASSERT_TRUE(verified) << verified.error().detail;
  EXPECT_EQ(verified->manifest.dictionary, "src/power.hpp");
  EXPECT_EQ(*decode_manifest(encode(verified->manifest)), verified->manifest);
  for (const Json& other : {Json("elsewhere.yaml"), Json(""), Json(7), Json(nullptr)}) {
    manifest["dictionary"] = other;
    EXPECT_EQ(refusal(), PackageRefusal::bad_manifest) << other;
  }
}

TEST_F(PackageTest, MayAskForASlotOnTheBus) {
  const Json slot = {{"allotted_ms", 60}, {"overrun_ms", 0}, {"reset_ms", 40}, {"after", "payload_thermal"}};
  manifest["slot"] = slot;
  const Octets good = package();
  const auto verified = verify(good);
  ASSERT_TRUE(verified) << verified.error().detail;
  ASSERT_TRUE(verified->manifest.slot);
  EXPECT_EQ(verified->manifest.slot->payload, std::nullopt);
  EXPECT_EQ(verified->manifest.slot->allotted, milliseconds(60));
  EXPECT_EQ(verified->manifest.slot->overrun, milliseconds(0));
  EXPECT_EQ(verified->manifest.slot->reset, milliseconds(40));
  EXPECT_EQ(verified->manifest.slot->after, "payload_thermal");
  EXPECT_EQ(*decode_manifest(encode(verified->manifest)), verified->manifest);
  manifest["slot"]["payload"] = "impact";
  EXPECT_EQ(refusal(), std::nullopt);
  EXPECT_EQ(decode_manifest(manifest.dump())->slot->payload, "impact");

  for (const char* field : {"allotted_ms", "overrun_ms", "reset_ms", "after"}) {
    manifest["slot"] = slot;
    manifest["slot"].erase(field);
    EXPECT_EQ(refusal(), PackageRefusal::bad_manifest) << field;
    for (const Json& value : {Json(-1), Json(60001), Json(1.5), Json("1"), Json("A b"), Json::array()}) {
      manifest["slot"] = slot;
      manifest["slot"][field] = value;
      // "1" is neither a name nor a number.
      EXPECT_EQ(refusal(), PackageRefusal::bad_manifest) << field << " " << value;
    }
  }
  for (const char* field : {"allotted_ms", "reset_ms"}) {
    manifest["slot"] = slot;
    manifest["slot"][field] = 0;
    EXPECT_EQ(refusal(), PackageRefusal::bad_manifest) << field;
  }
  manifest["slot"] = slot;
  manifest["slot"]["payload"] = "/x";
  EXPECT_EQ(refusal(), PackageRefusal::bad_manifest);
  manifest["slot"] = slot;
  manifest["slot"]["priority"] = 1;
  EXPECT_EQ(refusal(), PackageRefusal::bad_manifest);
  manifest["slot"] = "after payload_thermal";
  EXPECT_EQ(refusal(), PackageRefusal::bad_manifest);
}

/// Format 2: the same package with the files in one DEFLATE stream.
struct CompressedPackageTest : PackageTest {
  Octets stream;

  CompressedPackageTest() {
    manifest["format"] = "srfs node package 2";
    compress();
  }
  /// Makes a signed package with the contents as one compressed stream.
  void compress() {
    Octets all;
    for (const Octets& content : contents) all.insert(all.end(), content.begin(), content.end());
    carry(shrink(all));
  }
  void carry(Octets octets_of_stream) {
    stream = std::move(octets_of_stream);
    manifest["stream"] = {{"octets", stream.size()}, {"sha256", to_digits(sha256_of(stream))}};
  }
  [[nodiscard]] Octets package() const { return seal_package(2, manifest.dump(), stream, ours); }
  [[nodiscard]] std::optional<PackageRefusal> refusal() const { return PackageTest::refusal(package()); }
};

TEST_F(CompressedPackageTest, ThatIsGoodGivesItsManifestAndFilesAndIsUnpacked) {
  const Octets good = package();
  auto verified = verify(good);
  ASSERT_TRUE(verified) << verified.error().detail;
  // The package stays valid when moved.
  const VerifiedPackage moved = std::move(*verified);
  ASSERT_EQ(moved.contents.size(), 2U);
  EXPECT_TRUE(std::ranges::equal(moved.contents[0], octets(source)));
  EXPECT_EQ(moved.manifest.stream->octets, stream.size());
  EXPECT_EQ(*decode_manifest(encode(moved.manifest)), moved.manifest);

  const testing_support::TemporaryFolder folder;
  ASSERT_TRUE(unpack(moved, folder.path() / "new"));
  EXPECT_EQ(*read_file(folder.path() / "new" / "src" / "power.hpp"), "#pragma once\n");
}

TEST_F(CompressedPackageTest, IsRefusedWhenAnyOctetIsChangedOrMissing) {
  const Octets good = package();
  for (std::size_t i = 0; i < good.size(); ++i) {
    Octets changed = good;
    changed[i] ^= 1U;
    EXPECT_TRUE(PackageTest::refusal(changed)) << i;
    EXPECT_TRUE(PackageTest::refusal(Octets(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(i))))
        << i;
  }
  Octets longer = good;
  longer.push_back(0);
  EXPECT_EQ(PackageTest::refusal(longer), PackageRefusal::wrong_size);
}

TEST_F(CompressedPackageTest, OfAStreamThatWasNotSignedIsRefusedBeforeItIsExpanded) {
  stream = shrink(octets(std::string(1'000'000, 'x')));
  manifest["stream"]["octets"] = stream.size();
  EXPECT_EQ(refusal(), PackageRefusal::wrong_hash);
}

TEST_F(CompressedPackageTest, ThatIsABombIsRefusedWithoutItsMemory) {
  // The stream holds a thousand times the size of the files. The decoder expands at most that size plus one
  // octet.
  carry(shrink(Octets(4U << 20)));
  EXPECT_LT(stream.size(), 5000U);
  const auto verified = verify(package());
  ASSERT_FALSE(verified);
  EXPECT_EQ(verified.error().refusal, PackageRefusal::bad_stream);
  EXPECT_EQ(verified.error().detail, "it expands to more octets than the files have");

  // A manifest that declares the true size, above the limit for all files, is refused before expansion.
  manifest["files"] = Json::array();
  contents.clear();
  for (int i = 0; i < 5; ++i) add("f" + std::to_string(i), std::string(1U << 20, '\0'));
  compress();
  EXPECT_EQ(refusal(), PackageRefusal::too_large);
  manifest["files"].erase(4);
  contents.pop_back();
  compress();
  EXPECT_EQ(refusal(), std::nullopt) << "4 MiB are allowed";
}

TEST_F(CompressedPackageTest, IsRefusedWithAStreamThatIsDamagedShortOrFollowedByMore) {
  const Octets good = stream;
  for (const Octets& bad : {Octets{}, Octets{0xFF, 0xFF, 0xFF}, Octets(good.begin(), good.end() - 1),
                            shrink(octets(source)), [&] {
                              Octets more = good;
                              more.push_back(0);
                              return more;
                            }()}) {
    carry(bad);
    EXPECT_EQ(refusal(), PackageRefusal::bad_stream) << bad.size();
  }
}

TEST_F(CompressedPackageTest, IsRefusedWhenAFileIsNotWhatWasSigned) {
  contents[1][3] ^= 1U;
  compress();
  EXPECT_EQ(refusal(), PackageRefusal::wrong_hash);
}

TEST_F(CompressedPackageTest, NeedsItsStreamInTheManifestAndTheSameFormatInItsHead) {
  const Json before = manifest;
  manifest.erase("stream");
  EXPECT_EQ(refusal(), PackageRefusal::bad_manifest);
  for (const char* field : {"octets", "sha256"}) {
    manifest = before;
    manifest["stream"].erase(field);
    EXPECT_EQ(refusal(), PackageRefusal::bad_manifest) << field;
    manifest = before;
    manifest["stream"][field] = -1;
    EXPECT_EQ(refusal(), PackageRefusal::bad_manifest) << field;
  }
  manifest = before;
  manifest["stream"]["coding"] = "xz";
  EXPECT_EQ(refusal(), PackageRefusal::bad_manifest);
  manifest = before;
  manifest["stream"]["octets"] = PackageLimits::package_octets + 1;
  EXPECT_EQ(refusal(), PackageRefusal::too_large);
  manifest = before;
  manifest["stream"]["octets"] = stream.size() + 1;
  EXPECT_EQ(refusal(), PackageRefusal::wrong_size);
  manifest = before;
  manifest["format"] = "srfs node package 1";
  EXPECT_EQ(refusal(), PackageRefusal::bad_manifest) << "a key that format 1 does not have";
  manifest = before;
  EXPECT_EQ(PackageTest::refusal(seal_package(1, manifest.dump(), stream, ours)),
            PackageRefusal::unknown_format);
  manifest.erase("stream");
  manifest["format"] = "srfs node package 1";
  EXPECT_EQ(PackageTest::refusal(seal_package(2, manifest.dump(), stream, ours)),
            PackageRefusal::unknown_format);
  EXPECT_EQ(PackageTest::refusal(seal_package(3, before.dump(), stream, ours)),
            PackageRefusal::unknown_format);
}

TEST(MadePackage, HasTheSizesAndHashesOfItsFilesAndIsTheSameEachTime) {
  Manifest manifest{.node = "payload_eps", .counter = 3, .options = {"-O2"}};
  manifest.files = {{.path = "main.cpp"}, {.path = "empty.hpp"}};
  const std::vector<Octets> contents{octets(source), {}};
  const auto package = make_package(manifest, contents, ours);
  ASSERT_TRUE(package) << package.error().detail;
  EXPECT_EQ(*package, *make_package(manifest, contents, ours));
  const auto verified = verify_package(*package, key, [](std::string_view) { return 2U; });
  ASSERT_TRUE(verified);
  EXPECT_EQ(verified->manifest.files[0].sha256, hash(source));
  EXPECT_EQ(verified->manifest.files[1].octets, 0U);
  EXPECT_TRUE(verified->contents[1].empty());
  const auto parts = open_package(*package);
  ASSERT_TRUE(parts);
  EXPECT_EQ(parts->format, 2);
  EXPECT_EQ(parts->key, key_id_of(key));
  EXPECT_EQ(parts->rest.size(), verified->manifest.stream->octets);
}

TEST(MadePackage, IsRefusedForWhatTheSpacecraftWouldRefuse) {
  const Manifest good{.node = "payload_eps", .counter = 3, .files = {{.path = "main.cpp"}}};
  const std::vector<Octets> contents{octets(source)};
  ASSERT_TRUE(make_package(good, contents, ours));
  const auto refusal = [&](const Manifest& manifest, const std::vector<Octets>& files) {
    return make_package(manifest, files, ours).error().refusal;
  };
  Manifest bad = good;
  bad.files[0].path = "../main.cpp";
  EXPECT_EQ(refusal(bad, contents), PackageRefusal::bad_path);
  bad = good;
  bad.options = {"-fplugin=x.so"};
  EXPECT_EQ(refusal(bad, contents), PackageRefusal::bad_option);
  bad = good;
  bad.counter = 0;
  EXPECT_EQ(refusal(bad, contents), PackageRefusal::bad_manifest);
  bad = good;
  bad.kind = PackageKind::add;
  EXPECT_EQ(refusal(bad, contents), PackageRefusal::bad_manifest);
  EXPECT_EQ(refusal(good, {}), PackageRefusal::wrong_size);
  EXPECT_EQ(refusal(good, {Octets(PackageLimits::file_octets + 1)}), PackageRefusal::too_large);
}

TEST_F(PackageTest, WithAKeyTwiceInOneObjectIsRefusedAndNamesIt) {
  manifest["kind"] = "new";
  manifest["deployment"] = {{"name", "a"}, {"parameters", {{"rate", 1}}}};
  manifest["slot"] = {{"allotted_ms", 5}, {"overrun_ms", 1}, {"reset_ms", 1}, {"after", "payload_eps"}};
  const std::string good = manifest.dump();
  ASSERT_TRUE(decode_manifest(good)) << "the same key in two objects is fine";
  const auto doubled = [&](const std::string& first, const std::string& second) {
    std::string text = good;
    const auto at = text.find(first);
    EXPECT_NE(at, std::string::npos) << first;
    return text.insert(at, second + ",");
  };
  const std::vector<std::tuple<std::string, std::string, std::string>> cases{
      {R"("node":)", R"("node":"ttc")", "node"},    {R"("counter":)", R"("counter":7)", "counter"},
      {R"("path":)", R"("path":"../x")", "path"},   {R"("rate":)", R"("rate":2)", "rate"},
      {R"("after":)", R"("after":"ttc")", "after"}, {R"("kind":)", R"("k\u0069nd":"replace")", "kind"}};
  for (const auto& [first, second, key_told] : cases) {
    const auto refused = decode_manifest(doubled(first, second));
    ASSERT_FALSE(refused) << second;
    EXPECT_EQ(refused.error().refusal, PackageRefusal::bad_manifest);
    EXPECT_EQ(refused.error().detail, key_told + " appears twice");
  }
  const auto rude = decode_manifest("{\"\x1b\":1,\"\x1b\":2}");
  EXPECT_FALSE(rude);
  EXPECT_EQ(decode_manifest(R"({"\u001b[2J":1,"\u001b[2J":2})").error().detail, "?[2J appears twice");
}

TEST_F(PackageTest, OfDeepNestingIsRefusedWithoutHarm) {
  const std::string deep = R"({"deployment":)" + std::string(30000, '[') + std::string(30000, ']') + "}";
  EXPECT_FALSE(decode_manifest(deep));
}

TEST_F(PackageTest, IsUnpackedBelowANewFolderAlone) {
  const testing_support::TemporaryFolder folder;
  const Octets good = package();
  const auto verified = verify(good);
  ASSERT_TRUE(verified);
  ASSERT_TRUE(unpack(*verified, folder.path() / "new"));
  EXPECT_EQ(*read_file(folder.path() / "new" / "src" / "main.cpp"), source);
  EXPECT_FALSE(unpack(*verified, folder.path() / "new")) << "it is there";
  std::filesystem::create_symlink(folder.path() / "elsewhere", folder.path() / "link");
  EXPECT_FALSE(unpack(*verified, folder.path() / "link"));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "elsewhere"));
}

}  // namespace
}  // namespace srfs::update
