// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/payload/mode_orders.hpp"

#include <charconv>
#include <sstream>
#include <variant>

#include <fmt/format.h>

namespace srfs {
namespace {

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  return words;
}

Result<StandingOrder, std::string> resolve(const mission::Dictionary& dictionary, const std::string& node,
                                           const std::string& text,
                                           const PayloadCycle::CommandDecoder& decode) {
  std::vector<std::string> words = words_of(text);
  if (words.empty()) return Err(std::string("no telecommand"));
  const std::string name = words.front();
  words.erase(words.begin());
  const auto encoded = dictionary.encode(name, words);
  if (!encoded) return Err(encoded.error().message);
  const mission::Command& command = *encoded->command;
  if (command.node != node) return Err(fmt::format("{} is a telecommand of {}", name, command.node));
  if (command.hazardous) return Err(fmt::format("{} is hazardous: only the ground sends it", name));
  OctetReader in(encoded->data);
  const std::uint16_t function = in.u16();
  const auto decoded = decode(function, OctetView(encoded->data).subspan(sizeof function));
  if (!decoded) return Err(std::string(mission::failure_text(decoded.error())));
  const auto* order = std::get_if<PeripheralFunction>(&*decoded);
  if (order == nullptr) return Err(fmt::format("{} does not go to the peripheral", name));
  return StandingOrder{order->function, order->arguments, text};
}

}  // namespace

ModeOrders resolve_orders(const mission::Dictionary& dictionary, const suite::ModeSettings& settings,
                          const std::string& node, const PayloadCycle::CommandDecoder& decode) {
  ModeOrders orders;
  for (const auto& [mode, rows] : settings.table) {
    const suite::ModeReaction reaction = settings.reaction(mode, node);
    ModeOrders::OfMode& of_mode = orders.modes[mode];
    const auto add = [&, name = mode](const std::vector<std::string>& texts,
                                      std::vector<StandingOrder>& list) {
      for (const std::string& text : texts) {
        auto order = resolve(dictionary, node, text, decode);
        if (order) {
          list.push_back(std::move(*order));
        } else {
          orders.problems.push_back({name, text, order.error()});
        }
      }
    };
    add(reaction.once, of_mode.once);
    add(reaction.hold, of_mode.hold);
  }
  return orders;
}

OnceDone::OnceDone(std::optional<std::string_view> stored) {
  if (!stored) return;
  std::uint32_t change = 0;
  const bool fine =
      std::from_chars(stored->data(), stored->data() + stored->size(), change).ec == std::errc{};
  change_ = fine ? std::optional(change) : std::nullopt;
}

std::string OnceDone::stored_text() const {
  return change_ ? fmt::format("{}\n", *change_) : "by itself\n";
}

}  // namespace srfs
