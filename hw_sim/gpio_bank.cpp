// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/gpio_bank.hpp"

namespace srfs::sim {

std::array<std::uint8_t, 4> GpioBank::read_line(std::uint8_t line) const {
  if (line < switch_count) return {ok, line, static_cast<std::uint8_t>(power_[line] ? 1 : 0), 0};
  if (line >= first_input && line < first_input + input_count) {
    return {ok, line, static_cast<std::uint8_t>(inputs() >> (line - first_input) & 1U), 0};
  }
  return {no_such_line, line, 0, 0};
}

std::array<std::uint8_t, 4> GpioBank::write_line(std::uint8_t line, std::uint8_t value) {
  if (line >= first_input && line < first_input + input_count) return {not_an_output, line, 0, 0};
  if (line >= switch_count) return {no_such_line, line, 0, 0};
  if (value > 1) return {bad_request, line, value, 0};
  const bool on = value == 1;
  if (power_[line] != on) {
    power_[line] = on;
    on_switch_(line, on);
  }
  return {ok, line, value, 0};
}

std::array<std::uint8_t, 4> GpioBank::on_request(OctetView request) {
  ++counters_.requests;
  std::array<std::uint8_t, 4> reply{bad_request, 0, 0, 0};
  if (request.size() == 4) {
    const std::uint8_t line = request[1];
    reply[1] = line;
    switch (request[0]) {
      case 0:
        reply = read_line(line);
        break;
      case 1:
        reply = write_line(line, request[2]);
        break;
      case 2:
        reply = {ok, line, inputs(), 0};
        break;
      default:
        break;
    }
  }
  if (reply[0] != ok) ++counters_.refused;
  return reply;
}

}  // namespace srfs::sim
