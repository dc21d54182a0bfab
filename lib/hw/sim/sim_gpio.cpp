// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cerrno>

#include <poll.h>
#include <sys/socket.h>

#include "hw/backends.hpp"
#include "hw/reopening.hpp"
#include "hw/sim/seqpacket.hpp"

namespace srfs::hw {
namespace {

// A busy machine lets the simulator wait for a CPU. Callers ask on a worker thread.
constexpr milliseconds answer_timeout{500};

enum class Operation : std::uint8_t { read_line = 0, write_line = 1, read_bank = 2 };
constexpr std::uint8_t status_ok = 0;
constexpr std::uint8_t status_no_line = 1;

bool is_power(std::uint8_t line) {
  return line < gpio_power_count;
}
bool is_input(std::uint8_t line) {
  return line >= gpio_first_input && line < gpio_first_input + gpio_input_count;
}

/// Four octets there, four back (docs/reference/icd_can.md, GPIO). Waits for the answer, at most
/// answer_timeout.
class SimGpio : public GpioLines {
 public:
  SimGpio(const std::string& uri, const path& socket)
      : simulator_(
            uri, [socket] { return connect_seqpacket(socket); }, false) {}

  [[nodiscard]] const GpioCounters& counters() const override { return counters_; }

  [[nodiscard]] Result<void, GpioError> set_line(std::uint8_t line, bool on) override {
    if (!is_power(line)) return error(GpioError::no_line);
    const auto answer = ask(Operation::write_line, line, on ? 1 : 0);
    if (!answer) return error(answer.error());
    ++counters_.writes;
    return {};
  }

  [[nodiscard]] Result<bool, GpioError> read_line(std::uint8_t line) override {
    if (!is_power(line) && !is_input(line)) return error(GpioError::no_line);
    const auto answer = ask(Operation::read_line, line, 0);
    if (!answer) return error(answer.error());
    ++counters_.reads;
    return *answer != 0;
  }

  [[nodiscard]] Result<std::uint8_t, GpioError> read_bank() override {
    const auto answer = ask(Operation::read_bank, 0, 0);
    if (!answer) return error(answer.error());
    ++counters_.reads;
    return *answer;
  }

 private:
  using Message = std::array<std::uint8_t, 4>;

  Result<std::uint8_t, GpioError> ask(Operation operation, std::uint8_t line, std::uint8_t value) {
    const int socket = simulator_.device();
    counters_.reopened = simulator_.reopened();
    if (socket < 0) return Err(GpioError::gone);
    const Message request{static_cast<std::uint8_t>(operation), line, value, 0};
    if (::send(socket, request.data(), request.size(), MSG_NOSIGNAL) !=
        static_cast<ssize_t>(request.size())) {
      simulator_.lost("write: " + errno_text(errno));
      return Err(GpioError::gone);
    }
    pollfd waiting{.fd = socket, .events = POLLIN, .revents = 0};
    if (::poll(&waiting, 1, static_cast<int>(answer_timeout.count())) <= 0) {
      // A late answer would be taken for the next one's: start over with a new connection.
      simulator_.lost("no answer");
      return Err(GpioError::timeout);
    }
    Message answer{};
    const ssize_t n = ::recv(socket, answer.data(), answer.size(), MSG_TRUNC);
    if (n != static_cast<ssize_t>(answer.size()) ||
        (operation != Operation::read_bank && answer[1] != line)) {
      simulator_.lost(n <= 0 ? "the simulator closed the connection" : "an answer that matches no request");
      return Err(GpioError::gone);
    }
    if (answer[0] == status_no_line) return Err(GpioError::no_line);
    if (answer[0] != status_ok) return Err(GpioError::refused);
    return answer[2];
  }

  tl::unexpected<GpioError> error(GpioError e) {
    ++counters_.errors;
    return Err(e);
  }

  Reopening simulator_;
  GpioCounters counters_;
};

}  // namespace

std::unique_ptr<GpioLines> make_sim_gpio(const std::string& uri, const path& socket) {
  return std::make_unique<SimGpio>(uri, socket);
}

}  // namespace srfs::hw
