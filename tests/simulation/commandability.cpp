// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/commandability.hpp"

#include <algorithm>
#include <exception>

#include <mission/structures.hpp>

#include "tests/simulation/orders.hpp"
#include "tests/simulation/spacecraft.hpp"

namespace srfs::simulation {
namespace {

constexpr nanoseconds start = seconds(20);
constexpr nanoseconds limit =
    seconds(60);  ///< from a pair to the proof: a reset and the start of the suite fit
constexpr nanoseconds ping_patience = seconds(1);
constexpr nanoseconds payload_patience = seconds(10);
constexpr nanoseconds step = milliseconds(50);
constexpr std::uint64_t kill_behind_one_in = 10;
constexpr std::uint64_t power_cut_behind_one_in = 100;

class Trials {
 public:
  Trials(Kernel& kernel, Spacecraft& spacecraft, CommandabilityOutcome& outcome)
      : kernel_(kernel),
        spacecraft_(spacecraft),
        outcome_(outcome),
        random_(kernel.random("pairs")),
        orders_(all_orders(spacecraft.dictionary())) {
    outcome_.orders = orders_.size();
    spacecraft_.station().set_operator(false);
    wait(start);
  }

  void give_pair() {
    const Order& first = orders_[random_.below(orders_.size())];
    const Order& second = orders_[random_.below(orders_.size())];
    pair_ = to_text(first) + " + " + to_text(second);
    const MonotonicTime begin = kernel_.now();
    give(first);
    give(second);
    wait(random_.between(milliseconds(10), milliseconds(500)));
    disturb();
    prove(begin + limit);
    ++outcome_.pairs;
    outcome_.slowest = std::max(outcome_.slowest, kernel_.now() - begin);
  }

 private:
  using Answer = CommandRecord::Answer;

  void wait(nanoseconds time) { kernel_.run_until(kernel_.now() + time); }

  void give(const Order& order) {
    Station& station = spacecraft_.station();
    if (order.command->hazardous) {
      const Order arming = arming_of(spacecraft_.dictionary(), order);
      station.order(arming.command->name, arming.arguments);
    }
    station.order(order.command->name, order.arguments);
  }

  void disturb() {
    if (random_.one_in(kill_behind_one_in)) {
      ++outcome_.kills;
      spacecraft_.host(static_cast<Lane>(random_.below(spacecraft_.node_count()))).end("SIGKILL");
    }
    if (random_.one_in(power_cut_behind_one_in)) spacecraft_.cut_power("the power is cut", false);
  }

  /// What was switched off on the ground's order is switched on blind.
  void prove(MonotonicTime until) {
    while (kernel_.now() < until) {
      if (completes(mission::TtcPing::name, {}, ping_patience) &&
          completes("thermal.set_setpoint", {"heater=0", "setpoint_k=290"}, payload_patience))
        return;
      spacecraft_.station().order(mission::TtcTransmitterOn::name, {});
    }
    throw Violation{"C11", "not commandable within a minute after: " + pair_};
  }

  bool completes(std::string_view name, const std::vector<std::string>& arguments, nanoseconds patience) {
    const wire::RequestId request = spacecraft_.station().order(name, arguments);
    const MonotonicTime until = kernel_.now() + patience;
    auto answer = Answer::none;
    while (answer == Answer::none && kernel_.now() < until) {
      wait(step);
      answer = spacecraft_.commands().answer(request);
    }
    return answer == Answer::completed;
  }

  Kernel& kernel_;
  Spacecraft& spacecraft_;
  CommandabilityOutcome& outcome_;
  Random random_;
  std::vector<Order> orders_;
  std::string pair_;
};

void fly(Kernel& kernel, Spacecraft& spacecraft, const CommandabilitySettings& settings,
         CommandabilityOutcome& outcome) {
  constexpr std::size_t look_at_ends_each = 100;
  constexpr nanoseconds longest_life = seconds(3600);
  Trials trials(kernel, spacecraft, outcome);
  if (settings.line_cut) spacecraft.station().set_line({.cut = true});
  while (outcome.pairs < settings.pairs) {
    trials.give_pair();
    if (outcome.pairs % look_at_ends_each == 0) spacecraft.commands().check_ends(kernel.now() - longest_life);
  }
}

}  // namespace

CommandabilityOutcome run_commandability(const CommandabilitySettings& settings) {
  Kernel kernel(settings.seed);
  CommandabilityOutcome outcome;
  Spacecraft spacecraft(kernel);
  try {
    fly(kernel, spacecraft, settings, outcome);
  } catch (const Violation& violation) {
    outcome.violation = violation;
    outcome.diagram = kernel.diagram();
  } catch (const std::exception& error) {  // of a class that is flown, or of the simulation
    outcome.violation = Violation{"no exception", std::string("it was thrown: ") + error.what()};
    outcome.diagram = kernel.diagram();
  }
  outcome.completed = spacecraft.commands().counters().completed;
  outcome.boots = spacecraft.boots();
  return outcome;
}

}  // namespace srfs::simulation
