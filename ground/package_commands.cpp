// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/package_commands.hpp"

#include <cstdio>
#include <filesystem>

#include <fmt/format.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include "base/file.hpp"
#include "base/text.hpp"
#include "update/package_keys.hpp"

namespace srfs::ground {
namespace {

using Json = nlohmann::ordered_json;

Exit fail(const PackageCommand& command, const std::string& message, Exit exit = Exit::unusable) {
  if (command.json) {
    const Json json{{"type", "error"}, {"message", message}};
    std::puts(json.dump(-1, ' ', false, Json::error_handler_t::replace).c_str());
  } else {
    std::fprintf(stderr, "srfs-ground: %s\n", message.c_str());
  }
  return exit;
}

Result<Octets, std::string> load(const std::string& file) {
  const auto text = read_file(file, update::PackageLimits::package_octets);
  if (!text) return Err(text.error().message);
  return Octets(text->begin(), text->end());
}

/// A package and what it says of itself.
struct Shown {
  update::PackageParts parts;
  update::Manifest manifest;
  std::size_t octets = 0;
  std::string signature;  ///< good, wrong, of another key, not checked
};

Result<Shown, std::string> look_at(OctetView package, const std::optional<update::PublicKey>& key) {
  const auto parts = update::open_package(package);
  if (!parts) return Err(update::to_text(parts.error()));
  auto manifest = update::decode_manifest(parts->manifest);
  if (!manifest) return Err(update::to_text(manifest.error()));
  const OctetView content = as_octets(parts->manifest);
  const char* const signature = !key                                                 ? "not checked"
                                : parts->key != update::key_id_of(*key)              ? "of another key"
                                : update::is_signed(content, parts->signature, *key) ? "good"
                                                                                     : "wrong";
  return Shown{*parts, std::move(*manifest), package.size(), signature};
}

std::uint64_t source_octets(const update::Manifest& manifest) {
  std::uint64_t octets = 0;
  for (const update::PackageFile& file : manifest.files) octets += file.octets;
  return octets;
}

void print_json(const Shown& shown) {
  const Json json{{"type", "package"},
                  {"format", shown.parts.format},
                  {"octets", shown.octets},
                  {"manifest_octets", shown.parts.manifest.size()},
                  {"packed_octets", shown.parts.rest.size()},
                  {"source_octets", source_octets(shown.manifest)},
                  {"key", to_hex(shown.parts.key)},
                  {"signature", shown.signature},
                  {"manifest", Json::parse(update::encode(shown.manifest), nullptr, false)}};
  std::puts(json.dump(-1, ' ', false, Json::error_handler_t::replace).c_str());
}

void print_lines(const Shown& shown) {
  const update::Manifest& manifest = shown.manifest;
  const auto line = [](const char* name, const std::string& value) {
    if (!value.empty()) std::fputs(fmt::format("{:<14} {}\n", name, value).c_str(), stdout);
  };
  std::string options;
  for (const std::string& option : manifest.options) options += (options.empty() ? "" : " ") + option;
  line("node",
       fmt::format("{}, {}", manifest.node, manifest.kind == update::PackageKind::add ? "new" : "replaced"));
  line("counter", std::to_string(manifest.counter));
  line("options", options);
  line("self-test", fmt::format("{} s", manifest.self_test.count()));
  line("probation", fmt::format("{} s", manifest.probation.count()));
  line("ring after", manifest.ring_after.value_or(""));
  if (manifest.slot) {
    line("slot",
         fmt::format("{} ms, overrun {} ms, reset {} ms, after {}{}", manifest.slot->allotted.count(),
                     manifest.slot->overrun.count(), manifest.slot->reset.count(), manifest.slot->after,
                     manifest.slot->payload ? ", for " + *manifest.slot->payload : ""));
  }
  line("deployment", manifest.deployment.value_or(""));
  line("dictionary", manifest.dictionary.value_or(""));
  line("binary", manifest.binary_sha256.value_or(""));
  for (const update::PackageFile& file : manifest.files)
    line("file", fmt::format("{:>8}  {}", file.octets, file.path));
  line("octets",
       fmt::format("{} (format {}): manifest {}, {} of sources in {}", shown.octets, shown.parts.format,
                   shown.parts.manifest.size(), source_octets(manifest), shown.parts.rest.size()));
  line("key", to_hex(shown.parts.key));
  line("signature", shown.signature);
}

Exit show(const PackageCommand& command, OctetView package, const std::optional<update::PublicKey>& key) {
  const auto shown = look_at(package, key);
  if (!shown) return fail(command, fmt::format("{}: {}", command.file, shown.error()));
  command.json ? print_json(*shown) : print_lines(*shown);
  return Exit::done;
}

}  // namespace

Exit make_package(const PackageCommand& command) {
  PackageDraft draft;
  if (!command.manifest.empty()) {
    auto loaded = load_draft(command.manifest);
    if (!loaded) return fail(command, loaded.error());
    draft = std::move(*loaded);
  }
  const auto seed = update::load_seed(command.seed);
  if (!seed) return fail(command, seed.error().message);
  const auto package = make_package(merged(std::move(draft), command.said), *seed);
  if (!package) return fail(command, package.error());
  const auto written = write_file_atomically(command.output, as_text(*package));
  if (!written) return fail(command, written.error().message);
  return show(command, *package, update::public_key_of(*seed));
}

Exit make_keys(const PackageCommand& command) {
  const update::SigningSeed seed = update::new_seed();
  const update::PublicKey key = update::public_key_of(seed);
  if (const auto saved = update::save_new_seed(command.seed, seed); !saved)
    return fail(command, saved.error().message);
  if (const auto saved = update::save_new_public_key(command.key, key); !saved) {
    unlink(command.seed.c_str());  // made above; half a pair is of no use
    return fail(command, saved.error().message);
  }
  const std::string id = to_hex(update::key_id_of(key));
  if (command.json) {
    const Json json{{"type", "package_keys"}, {"key", id}, {"seed", command.seed}, {"public", command.key}};
    std::puts(json.dump(-1, ' ', false, Json::error_handler_t::replace).c_str());
  } else {
    std::puts(
        fmt::format("key {}: {} signs and stays on the ground; copy {} to the spacecraft as keys/package.pub",
                    id, command.seed, command.key)
            .c_str());
  }
  return Exit::done;
}

Exit show_package(const PackageCommand& command) {
  const auto package = load(command.file);
  if (!package) return fail(command, package.error());
  std::optional<update::PublicKey> key;
  if (!command.key.empty()) {
    const auto loaded = update::load_public_key(command.key);
    if (!loaded) return fail(command, loaded.error().message);
    key = *loaded;
  }
  return show(command, *package, key);
}

Exit verify_package(const PackageCommand& command) {
  const auto package = load(command.file);
  if (!package) return fail(command, package.error());
  const auto key = update::load_public_key(command.key);
  if (!key) return fail(command, key.error().message);
  const auto verified =
      update::verify_package(*package, *key, [&](std::string_view) { return command.last_counter; });
  if (!verified)
    return fail(command, fmt::format("{}: refused: {}", command.file, update::to_text(verified.error())),
                Exit::refused);
  const update::Manifest& manifest = verified->manifest;
  if (command.json) {
    const Json json{{"type", "package_verified"}, {"node", manifest.node}, {"counter", manifest.counter}};
    std::puts(json.dump().c_str());
  } else {
    std::puts(
        fmt::format("good: {}, counter {}, {} files", manifest.node, manifest.counter, manifest.files.size())
            .c_str());
  }
  return Exit::done;
}

Result<Installation, std::string> prepare_installation(const std::string& file, const std::string& key_file) {
  const auto package = load(file);
  if (!package) return Err(package.error());
  std::optional<update::PublicKey> key;
  if (!key_file.empty()) {
    const auto loaded = update::load_public_key(key_file);
    if (!loaded) return Err(loaded.error().message);
    const auto verified = update::verify_package(*package, *loaded, [](std::string_view) { return 0U; });
    if (!verified) return Err(fmt::format("{}: refused: {}", file, update::to_text(verified.error())));
  }
  const auto shown = look_at(*package, std::nullopt);
  if (!shown) return Err(fmt::format("{}: {}", file, shown.error()));
  return Installation{.file = file,
                      .name = fmt::format("{}_{}.pkg", shown->manifest.node, shown->manifest.counter)};
}

}  // namespace srfs::ground
