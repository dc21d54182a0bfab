// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/rescue_commands.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <sys/stat.h>

#include "base/file.hpp"
#include "base/sha256.hpp"
#include "base/text.hpp"
#include "programs/srfs/answer.hpp"
#include "suite/launcher.hpp"
#include "suite/step_down.hpp"
#include "wire/session_keys.hpp"

namespace srfs::tool {
namespace {

constexpr std::size_t largest_program = 32U << 20;
constexpr std::int64_t usual_watchdog_timeout_s = 10;

std::string text_of_device(const suite::Deployment& deployment, const std::string& name) {
  const auto device = deployment.devices.find(name);
  return device == deployment.devices.end() ? "" : device->second;
}

/// @param file absolute
Result<Octets, std::string> key_in(const std::string& file) {
  auto text = read_file(file, 4096);
  if (!text) return Err(text.error().message);
  while (!text->empty() && (text->back() == '\n' || text->back() == '\r')) text->pop_back();
  const auto key = from_hex(*text);
  std::fill(text->begin(), text->end(), '\0');
  if (!key || key->size() != 32) return Err(fmt::format("{}: expected 64 hexadecimal digits", file));
  return *key;
}

Result<suite::RescueSettings::Association, std::string> association_of(const suite::TelecommandChannel& entry,
                                                                       const suite::LinkSettings& link,
                                                                       const std::filesystem::path& var) {
  // As ttc does: of two associations of a set the first is for BD, the second for AD; one alone has both.
  const auto same_set = [&](const suite::TelecommandChannel& other) {
    return other.security == suite::ChannelSecurity::sdls && other.set == entry.set &&
           other.virtual_channel == entry.virtual_channel;
  };
  const auto first = std::find_if(link.channels.begin(), link.channels.end(), same_set);
  const bool alone = std::count_if(link.channels.begin(), link.channels.end(), same_set) == 1;
  suite::RescueSettings::Association association{
      .vc = static_cast<std::uint8_t>(entry.virtual_channel),
      .spi = static_cast<std::uint16_t>(entry.spi),
      .set = entry.set == suite::AssociationSet::a   ? 'a'
             : entry.set == suite::AssociationSet::b ? 'b'
                                                     : 'c',
      .for_ad = alone || first->spi != entry.spi,
      .for_bd = alone || first->spi == entry.spi,
      .key_file = (var / entry.key_file).lexically_normal().string()};
  auto key = key_in(association.key_file);
  if (!key) return Err(key.error());
  association.key = std::move(*key);
  // One that was replaced in flight: for the case that the disk with it cannot be read.
  const auto session_keys =
      wire::session_key_file(wire::session_key_folder(var) / wire::session_keys_name).load().state;
  const auto use = session_keys ? session_keys->use_of(association.spi) : std::nullopt;
  if (const auto* current = use ? session_keys->find(use->current) : nullptr; current != nullptr)
    association.key.assign(current->octets.view().begin(), current->octets.view().end());
  return association;
}

/// Through a temporary file that nobody else may read.
Result<void, std::string> put(const std::filesystem::path& file, std::string_view content, mode_t mode) {
  const mode_t before = umask(077);
  const auto written = write_file_atomically(file, content);
  umask(before);
  if (!written) return Err(written.error().message);
  if (chmod(file.c_str(), mode) != 0) return Err(file.string() + ": its mode cannot be set");
  return {};
}

Result<void, std::string> fill_folder(const std::filesystem::path& folder, const std::string& program,
                                      const std::string& settings) {
  std::error_code ec;
  std::filesystem::create_directories(folder, ec);
  if (chmod(folder.c_str(), 0700) != 0) return Err(folder.string() + ": cannot be made, or is not yours");
  const auto digest = [](const std::string& text) { return to_digits(sha256_of(as_octets(text))); };
  const std::string list = fmt::format("{}  srfs_rescue\n{}  settings\n", digest(program), digest(settings));
  for (const auto& [name, content, mode] :
       {std::tuple("srfs_rescue", &program, mode_t{0700}), std::tuple("settings", &settings, mode_t{0600}),
        std::tuple("SHA256SUMS", &list, mode_t{0600})}) {
    if (const auto done = put(folder / name, *content, mode); !done) return done;
  }
  return {};
}

}  // namespace

Result<suite::RescueSettings, std::string> rescue_settings_of(const Target& target) {
  const suite::Deployment& deployment = target.deployment;
  const suite::LinkSettings& link = deployment.link;
  suite::RescueSettings s;
  s.var = target.var.root.string();
  s.program = (suite::suite_bin_folder() / "srfs").string();
  s.deployment = std::filesystem::absolute(deployment.file).lexically_normal().string();
  s.rs422 = text_of_device(deployment, "rs422");
  s.baud = static_cast<std::uint32_t>(link.baud);
  s.watchdog = text_of_device(deployment, "watchdog");
  const suite::NodeEntry* const timing = deployment.find("timing");
  if (!s.watchdog.empty())
    s.watchdog_timeout_s = static_cast<std::uint32_t>(
        timing == nullptr
            ? usual_watchdog_timeout_s
            : timing->parameters.integer("watchdog_timeout_s", 1, 3600, usual_watchdog_timeout_s));
  s.spacecraft = static_cast<std::uint16_t>(link.spacecraft_id);
  s.frame_octets = static_cast<std::uint16_t>(link.tm_frame_length);
  s.interleave = static_cast<std::uint8_t>(link.tm_interleave);
  s.reed_solomon = link.tm_reed_solomon;
  s.tm_randomizer = link.tm_randomizer;
  s.tm_continuous = link.tm_continuous;
  s.tc_randomizer = link.tc_randomizer;
  s.tc_correct_single_bits = link.tc_correct_single_bits;
  s.tc_strict = link.tc_strict;
  s.steps = deployment.step_down;
  for (const suite::TelecommandChannel& entry : link.channels) {
    if (entry.security == suite::ChannelSecurity::none) {
      s.open_channels.push_back(static_cast<std::uint8_t>(entry.virtual_channel));
      continue;
    }
    auto association = association_of(entry, link, target.var.root);
    if (!association) return Err(association.error());
    s.associations.push_back(std::move(*association));
  }
  if (link.tm_security) {
    suite::RescueSettings::Seal seal{
        .spi = static_cast<std::uint16_t>(link.tm_security->spi),
        .key_file = (target.var.root / link.tm_security->key_file).lexically_normal().string()};
    auto key = key_in(seal.key_file);
    if (!key) return Err(key.error());
    seal.key = std::move(*key);
    s.seal = std::move(seal);
  }
  // Whatever cannot be read back (a path with a space) is found now, not in orbit.
  const auto read = suite::decode_rescue_settings(encode(s));
  if (!read) return Err(fmt::format("the deployment cannot be stated for srfs_rescue: {}", read.error()));
  return s;
}

int prepare_rescue(const Target& target, const std::vector<std::string>& folders, bool json) {
  const auto settings = rescue_settings_of(target);
  if (!settings) return fail(CommandExit::refused, settings.error(), json);
  const auto program = read_file(suite::suite_bin_folder() / "srfs_rescue", largest_program);
  if (!program) return fail(CommandExit::refused, program.error().message, json);
  for (const std::string& folder : folders) {
    if (const auto filled = fill_folder(folder, *program, encode(*settings)); !filled)
      return fail(CommandExit::refused, filled.error(), json);
  }
  return done(fmt::format("{} copies of srfs_rescue and its settings are ready", folders.size()), json,
              {{"folders", folders}});
}

int show_step(const Target& target, bool up, bool json) {
  suite::StepStore store(target.var.boot());
  if (up) {
    const auto problem = store.change([](suite::StepRecord record) {
      return suite::on_commanded(std::move(record), suite::BootStep::normal);
    });
    if (!problem.empty()) return fail(CommandExit::refused, problem, json);
  }
  const suite::StepRecord record = store.read();
  return done(
      fmt::format("step {}, cause {}, {} unhealthy starts{}{}", to_text(record.step), to_text(record.cause),
                  record.unhealthy_starts(), record.detail.empty() ? "" : ": ", record.detail),
      json,
      {{"step", to_text(record.step)},
       {"cause", to_text(record.cause)},
       {"unhealthy_starts", record.unhealthy_starts()},
       {"set_aside", record.set_aside},
       {"detail", record.detail}});
}

}  // namespace srfs::tool
