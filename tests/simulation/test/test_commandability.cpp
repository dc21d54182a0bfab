// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "tests/build_kind.hpp"
#include "tests/simulation/commandability.hpp"
#include "tests/simulation/orders.hpp"
#include "tests/simulation/spacecraft.hpp"

namespace srfs::simulation {
namespace {

constexpr std::uint64_t last_seed = 4;
constexpr std::size_t pairs = testing_support::slow ? 20 : 250;

TEST(CommandabilityOrders, HaveEveryTelecommandButThoseWithTheValueOfAParameter) {
  const mission::Dictionary& dictionary = Spacecraft::dictionary();
  std::set<std::string> given;
  for (const Order& order : all_orders(dictionary)) {
    given.insert(order.command->name);
    const auto encoded = dictionary.encode(order.command->name, order.arguments);
    ASSERT_TRUE(encoded) << to_text(order) << ": " << encoded.error().message;
  }
  for (const mission::Command& command : dictionary.commands()) {
    const bool has_value = std::any_of(
        command.arguments.begin(), command.arguments.end(),
        [](const mission::Field& argument) { return argument.type == mission::FieldType::parameter_value; });
    EXPECT_EQ(given.contains(command.name), !has_value) << command.name;
  }
}

TEST(Commandability, NoPairOfTelecommandsMakesTheSpacecraftDeaf) {
  for (std::uint64_t seed = 1; seed <= last_seed; ++seed) {
    const CommandabilityOutcome outcome = run_commandability({.seed = seed, .pairs = pairs});
    ASSERT_FALSE(outcome.violation) << "seed " << seed << ": " << outcome.violation->requirement << ": "
                                    << outcome.violation->text << "\n"
                                    << outcome.diagram;
    EXPECT_EQ(outcome.pairs, pairs);
    EXPECT_GT(outcome.completed, 2 * pairs);  // the proofs, and some of the pairs
  }
}

TEST(Commandability, ASpacecraftThatHearsNothingFailsTheProof) {
  const CommandabilityOutcome outcome = run_commandability({.seed = 1, .pairs = 1, .line_cut = true});
  ASSERT_TRUE(outcome.violation);
  EXPECT_EQ(outcome.violation->requirement, "C11");
}

}  // namespace
}  // namespace srfs::simulation
