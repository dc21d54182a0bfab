// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/rescue_settings.hpp"

#include <algorithm>
#include <array>
#include <functional>
#include <optional>

#include <fmt/format.h>

#include "base/sha256.hpp"
#include "base/text.hpp"

namespace srfs::suite {
namespace {

constexpr std::string_view first_line = "srfs_rescue settings 1\n";
constexpr std::string_view last_key = "sha256 ";
constexpr std::size_t digest_digits = 64;
constexpr std::size_t key_octets = 32;
constexpr std::size_t most_words = 10;
constexpr std::size_t longest_word = 400;

using Words = std::vector<std::string_view>;

/// Separated by single spaces; nullopt: an empty word, too many or too long ones, or a character that is
/// none.
std::optional<Words> words_of(std::string_view line) {
  Words words;
  while (true) {
    const std::size_t space = line.find(' ');
    const std::string_view word = line.substr(0, space);
    const bool printable = std::all_of(word.begin(), word.end(), [](char c) { return c > ' ' && c <= '~'; });
    if (word.empty() || word.size() > longest_word || !printable || words.size() == most_words)
      return std::nullopt;
    words.push_back(word);
    if (space == std::string_view::npos) return words;
    line.remove_prefix(space + 1);
  }
}

template <class T>
bool take(std::string_view word, T lowest, T highest, T& into) {
  const auto value = to_number<std::uint64_t>(word);
  if (!value || *value < lowest || *value > highest) return false;
  into = static_cast<T>(*value);
  return true;
}

bool take_flag(std::string_view word, bool& into) {
  into = word == "1";
  return into || word == "0";
}

bool take_path(std::string_view word, std::string& into) {
  into = word;
  return word.front() == '/';
}

bool take_link(const Words& w, RescueSettings& s) {
  return w.size() == 10 && take<std::uint16_t>(w[1], 0, 0x3FF, s.spacecraft) &&
         take<std::uint16_t>(w[2], 1, 2048, s.frame_octets) && take<std::uint8_t>(w[3], 1, 8, s.interleave) &&
         take_flag(w[4], s.reed_solomon) && take_flag(w[5], s.tm_randomizer) &&
         take_flag(w[6], s.tm_continuous) && take_flag(w[7], s.tc_randomizer) &&
         take_flag(w[8], s.tc_correct_single_bits) && take_flag(w[9], s.tc_strict);
}

bool take_association(const Words& w, RescueSettings& s) {
  if (w.size() != 8 || s.associations.size() == RescueSettings::most_associations) return false;
  RescueSettings::Association a;
  const auto key = from_hex(w[6]);
  const bool good = take<std::uint8_t>(w[1], 0, 63, a.vc) && take<std::uint16_t>(w[2], 1, 0xFFFE, a.spi) &&
                    w[3].size() == 1 && w[3][0] >= 'a' && w[3][0] <= 'c' && take_flag(w[4], a.for_ad) &&
                    take_flag(w[5], a.for_bd) && key && key->size() == key_octets &&
                    take_path(w[7], a.key_file);
  if (!good) return false;
  a.set = w[3][0];
  a.key = *key;
  s.associations.push_back(std::move(a));
  return true;
}

bool take_seal(const Words& w, RescueSettings& s) {
  if (w.size() != 4) return false;
  RescueSettings::Seal seal;
  const auto key = from_hex(w[2]);
  const bool good = take<std::uint16_t>(w[1], 1, 0xFFFE, seal.spi) && key && key->size() == key_octets &&
                    take_path(w[3], seal.key_file);
  if (!good) return false;
  seal.key = *key;
  s.seal = std::move(seal);
  return true;
}

bool take_open_channel(const Words& w, RescueSettings& s) {
  std::uint8_t vc = 0;
  if (w.size() != 2 || s.open_channels.size() == RescueSettings::most_associations ||
      !take<std::uint8_t>(w[1], 0, 63, vc))
    return false;
  s.open_channels.push_back(vc);
  return true;
}

bool take_steps(const Words& w, RescueSettings& s) {
  std::uint32_t calm = 0;
  std::uint32_t no_contact = 0;
  if (w.size() != 6 || !take<std::uint32_t>(w[1], 1, 1000, s.steps.last_good) ||
      !take<std::uint32_t>(w[2], 1, 1000, s.steps.golden) ||
      !take<std::uint32_t>(w[3], 1, 1000, s.steps.rescue) ||
      !take<std::uint32_t>(w[4], 60, 31'536'000, calm) ||
      !take<std::uint32_t>(w[5], 10, 31'536'000, no_contact))
    return false;
  s.steps.calm = seconds(calm);
  s.steps.no_contact = seconds(no_contact);
  return s.steps.is_sound();
}

struct Key {
  std::string_view name;
  bool required;
  bool several;
  bool (*take)(const Words& words, RescueSettings& settings);
};
constexpr std::array keys{
    Key{"var", true, false,
        [](const Words& w, RescueSettings& s) { return w.size() == 2 && take_path(w[1], s.var); }},
    Key{"program", true, false,
        [](const Words& w, RescueSettings& s) { return w.size() == 2 && take_path(w[1], s.program); }},
    Key{"deployment", true, false,
        [](const Words& w, RescueSettings& s) { return w.size() == 2 && take_path(w[1], s.deployment); }},
    Key{"rs422", true, false,
        [](const Words& w, RescueSettings& s) {
          if (w.size() == 3) s.rs422 = w[1];
          return w.size() == 3 && take<std::uint32_t>(w[2], 1200, 4'000'000, s.baud);
        }},
    Key{"watchdog", false, false,
        [](const Words& w, RescueSettings& s) {
          if (w.size() == 3) s.watchdog = w[1];
          return w.size() == 3 && take<std::uint32_t>(w[2], 1, 3600, s.watchdog_timeout_s);
        }},
    Key{"link", true, false, take_link},
    Key{"association", false, true, take_association},
    Key{"seal", false, false, take_seal},
    Key{"open_channel", false, true, take_open_channel},
    Key{"steps", true, false, take_steps},
};

/// The lines without first line and digest; nullopt: not such a file, or damaged.
std::optional<std::string_view> checked_lines(std::string_view text) {
  const std::size_t tail = last_key.size() + digest_digits + 1;
  if (text.size() > RescueSettings::largest_octets || text.size() < first_line.size() + tail ||
      !text.starts_with(first_line))
    return std::nullopt;
  const std::string_view body = text.substr(0, text.size() - tail);
  const std::string_view end = text.substr(body.size());
  if (!end.starts_with(last_key) || end.back() != '\n' ||
      end.substr(last_key.size(), digest_digits) != to_digits(sha256_of(as_octets(body))))
    return std::nullopt;
  return body.substr(first_line.size());
}

}  // namespace

std::string encode(const RescueSettings& s) {
  std::string text(first_line);
  const auto flag = [](bool value) { return value ? 1 : 0; };
  text += fmt::format("var {}\nprogram {}\ndeployment {}\nrs422 {} {}\n", s.var, s.program, s.deployment,
                      s.rs422, s.baud);
  if (!s.watchdog.empty()) text += fmt::format("watchdog {} {}\n", s.watchdog, s.watchdog_timeout_s);
  text += fmt::format("link {} {} {} {} {} {} {} {} {}\n", s.spacecraft, s.frame_octets, s.interleave,
                      flag(s.reed_solomon), flag(s.tm_randomizer), flag(s.tm_continuous),
                      flag(s.tc_randomizer), flag(s.tc_correct_single_bits), flag(s.tc_strict));
  for (const auto& a : s.associations)
    text += fmt::format("association {} {} {} {} {} {} {}\n", a.vc, a.spi, a.set, flag(a.for_ad),
                        flag(a.for_bd), to_hex(a.key), a.key_file);
  if (s.seal) text += fmt::format("seal {} {} {}\n", s.seal->spi, to_hex(s.seal->key), s.seal->key_file);
  for (const auto vc : s.open_channels) text += fmt::format("open_channel {}\n", vc);
  text += fmt::format("steps {} {} {} {} {}\n", s.steps.last_good, s.steps.golden, s.steps.rescue,
                      s.steps.calm.count(), s.steps.no_contact.count());
  return text + fmt::format("{}{}\n", last_key, to_digits(sha256_of(as_octets(text))));
}

Result<RescueSettings, std::string> decode_rescue_settings(std::string_view text) {
  auto lines = checked_lines(text);
  if (!lines) return Err(std::string("not settings of srfs_rescue, or damaged"));
  RescueSettings settings;
  std::array<unsigned, keys.size()> seen{};
  for (int number = 2; !lines->empty(); ++number) {
    const std::size_t end = lines->find('\n');
    const auto words = words_of(lines->substr(0, end));
    lines->remove_prefix(end == std::string_view::npos ? lines->size() : end + 1);
    const auto key = !words ? keys.end() : std::find_if(keys.begin(), keys.end(), [&](const Key& k) {
      return k.name == words->front();
    });
    if (key == keys.end()) return Err(fmt::format("line {}: no such key", number));
    const auto index = static_cast<std::size_t>(key - keys.begin());
    if (++seen.at(index) > 1 && !key->several)
      return Err(fmt::format("line {}: a second '{}'", number, key->name));
    if (!key->take(*words, settings))
      return Err(fmt::format("line {}: bad values of '{}'", number, key->name));
  }
  for (std::size_t i = 0; i < keys.size(); ++i) {
    if (keys.at(i).required && seen.at(i) == 0) return Err(fmt::format("no '{}'", keys.at(i).name));
  }
  if (settings.associations.empty() && settings.open_channels.empty())
    return Err(std::string("no 'association'"));
  return settings;
}

}  // namespace srfs::suite
