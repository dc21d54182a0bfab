// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/screen/terminal.hpp"

#include <array>
#include <cerrno>
#include <clocale>
#include <csignal>
#include <cstdlib>
#include <cstring>

#include <fmt/format.h>
#include <langinfo.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/signalfd.h>
#include <unistd.h>

#define NCURSES_NOMACROS 1
#define NCURSES_WIDECHAR 1
#include <curses.h>

namespace srfs::ground::screen {
namespace {

constexpr short pair_good = 1;
constexpr short pair_yellow = 2;
constexpr short pair_red = 3;

constexpr int escape_patience_ms = 100;  ///< of a key's octets after Escape, over a slow line too

/// What terminals send that have other keys than their type says.
struct KnownKey {
  const char* octets;
  int code;
};
constexpr std::array known_keys{
    KnownKey{"\033[A", KEY_UP},     KnownKey{"\033[B", KEY_DOWN},   KnownKey{"\033[C", KEY_RIGHT},
    KnownKey{"\033[D", KEY_LEFT},   KnownKey{"\033[H", KEY_HOME},   KnownKey{"\033[F", KEY_END},
    KnownKey{"\033[5~", KEY_PPAGE}, KnownKey{"\033[6~", KEY_NPAGE}, KnownKey{"\033[3~", KEY_DC},
    KnownKey{"\033OQ", KEY_F(2)},   KnownKey{"\033OR", KEY_F(3)}};

sigset_t taken_signals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGWINCH}) sigaddset(&set, signal);
  return set;
}

attr_t attributes_of(Tone tone, bool colours) {
  switch (tone) {
    case Tone::plain:
      return A_NORMAL;
    case Tone::dim:
      return colours ? A_DIM : A_NORMAL;
    case Tone::strong:
      return A_BOLD;
    case Tone::bar:
      return A_REVERSE;
    case Tone::good:
      return colours ? static_cast<attr_t>(COLOR_PAIR(pair_good)) : A_NORMAL;
    case Tone::yellow:
      return colours ? A_BOLD | static_cast<attr_t>(COLOR_PAIR(pair_yellow)) : A_BOLD;
    case Tone::red:
      return colours ? A_BOLD | static_cast<attr_t>(COLOR_PAIR(pair_red)) : A_BOLD | A_REVERSE;
  }
  return A_NORMAL;
}

Key key_of_code(wint_t code) {
  switch (code) {
    case KEY_ENTER:
      return Key::enter;
    case KEY_BACKSPACE:
      return Key::backspace;
    case KEY_DC:
      return Key::remove;
    case KEY_LEFT:
      return Key::left;
    case KEY_RIGHT:
      return Key::right;
    case KEY_HOME:
      return Key::home;
    case KEY_END:
      return Key::end;
    case KEY_UP:
      return Key::up;
    case KEY_DOWN:
      return Key::down;
    case KEY_PPAGE:
      return Key::page_up;
    case KEY_NPAGE:
      return Key::page_down;
    case KEY_F(2):
      return Key::previous_view;
    case KEY_F(3):
    case KEY_BTAB:
      return Key::next_view;
    default:
      return Key::none;
  }
}

/// A letter with Ctrl.
constexpr char32_t ctrl(char letter) {
  return static_cast<char32_t>(letter) & 0x1FU;
}

Input input_of(char32_t character) {
  switch (character) {
    case U'\r':
    case U'\n':
      return {Key::enter};
    case U'\t':
      return {Key::complete};
    case 0x7F:
    case ctrl('H'):
      return {Key::backspace};
    case ctrl('A'):
      return {Key::home};
    case ctrl('E'):
      return {Key::end};
    case ctrl('W'):
      return {Key::erase_word};
    case ctrl('U'):
      return {Key::erase_line};
    case ctrl('P'):
      return {Key::up};
    case ctrl('N'):
      return {Key::down};
    case ctrl('C'):
      return {Key::interrupt};
    case ctrl('D'):
      return {Key::end_of_input};
    case ctrl('L'):
      return {Key::redraw};
    default:
      return character < 0x20 ? Input{} : Input{Key::character, character};
  }
}

}  // namespace

struct Terminal::Screen {
  SCREEN* screen = nullptr;
  sigset_t mask_before{};
};

Terminal::Terminal(Fd signals) : signals_(std::move(signals)), screen_(std::make_unique<Screen>()) {}

Result<std::unique_ptr<Terminal>, std::string> Terminal::open() {
  if (::isatty(STDIN_FILENO) != 1 || ::isatty(STDOUT_FILENO) != 1)
    return Err(std::string("it needs a terminal; elsewhere: watch, listen, events, session"));
  const sigset_t set = taken_signals();
  sigset_t before;
  ::pthread_sigmask(SIG_BLOCK, &set, &before);
  Fd signals(::signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK));
  if (!signals) return Err(fmt::format("no signalfd: {}", std::strerror(errno)));
  std::unique_ptr<Terminal> terminal(new Terminal(std::move(signals)));
  terminal->screen_->mask_before = before;
  std::setlocale(LC_CTYPE, "");
  terminal->size_.utf8 = std::string_view(::nl_langinfo(CODESET)) == "UTF-8";
  SCREEN* screen = ::newterm(nullptr, stdout, stdin);
  if (screen == nullptr) {
    const char* term = std::getenv("TERM");
    return Err(fmt::format("the terminal '{}' is not known here; set TERM, for example TERM=vt100",
                           term == nullptr ? "" : term));
  }
  terminal->screen_->screen = screen;
  ::raw();
  ::noecho();
  ::nonl();
  ::set_escdelay(escape_patience_ms);
  ::keypad(::stdscr, TRUE);
  for (const KnownKey& key : known_keys) ::define_key(key.octets, key.code);
  ::nodelay(::stdscr, TRUE);
  terminal->colours_ = ::has_colors() == TRUE;
  if (terminal->colours_) {
    ::start_color();
    ::use_default_colors();
    ::init_pair(pair_good, COLOR_GREEN, -1);
    ::init_pair(pair_yellow, COLOR_YELLOW, -1);
    ::init_pair(pair_red, COLOR_RED, -1);
  }
  terminal->read_size();
  return terminal;
}

Terminal::~Terminal() {
  if (screen_->screen != nullptr) {
    ::endwin();
    ::delscreen(screen_->screen);
  }
  // What came meanwhile was for this terminal.
  static_cast<void>(take_signals());
  ::pthread_sigmask(SIG_SETMASK, &screen_->mask_before, nullptr);
}

int Terminal::keys() const {
  return STDIN_FILENO;
}

void Terminal::read_size() {
  winsize window{};
  if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &window) == 0 && window.ws_row > 0 && window.ws_col > 0)
    ::resizeterm(window.ws_row, window.ws_col);
  size_.rows = ::getmaxy(::stdscr);
  size_.columns = ::getmaxx(::stdscr);
}

void Terminal::show(const Frame& frame, bool anew) {
  ::werase(::stdscr);
  for (std::size_t row = 0; row < frame.rows.size(); ++row) {
    for (const Span& span : frame.rows[row]) {
      ::wattrset(::stdscr, static_cast<int>(attributes_of(span.tone, colours_)));
      ::mvwaddnstr(::stdscr, static_cast<int>(row), span.column, span.text.c_str(), -1);
    }
  }
  ::wattrset(::stdscr, A_NORMAL);
  ::wmove(::stdscr, frame.cursor_row, frame.cursor_column);
  if (anew) ::clearok(::stdscr, TRUE);
  ::wrefresh(::stdscr);
}

std::optional<Input> Terminal::next_input() {
  wint_t code = 0;
  const int got = ::wget_wch(::stdscr, &code);
  if (got == ERR) {
    pollfd hung{STDIN_FILENO, POLLIN, 0};
    gone_ = gone_ || (::poll(&hung, 1, 0) == 1 && (hung.revents & (POLLHUP | POLLERR | POLLNVAL)) != 0);
    return std::nullopt;
  }
  return got == KEY_CODE_YES ? Input{key_of_code(code)} : input_of(static_cast<char32_t>(code));
}

Terminal::Signal Terminal::take_signals() {
  Signal found = Signal::none;
  signalfd_siginfo info{};
  while (::read(signals_.get(), &info, sizeof info) == static_cast<ssize_t>(sizeof info)) {
    if (info.ssi_signo == SIGWINCH) {
      if (found == Signal::none) found = Signal::resized;
    } else {
      found = Signal::end;
    }
  }
  if (found == Signal::resized && screen_->screen != nullptr) read_size();
  return found;
}

}  // namespace srfs::ground::screen
