// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/screen/operator_screen.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "ground/screen/line_editor.hpp"
#include "ground/terminal_text.hpp"

namespace srfs::ground::screen {
namespace {

constexpr int top_rows = 4;     // title, link, limits, views
constexpr int bottom_rows = 2;  // hint, prompt
constexpr int side_from = 120;  // columns of a screen with limits and events at the side
constexpr int age_columns = 7;
constexpr int scroll_columns = 26;       // "1-9 of 300 (PgUp, PgDn)" beside the views
constexpr milliseconds overdue{77'000};  // two and a half intervals of the structure health, and a margin

/// Where lines of one kind stand.
struct Area {
  int row = 0;
  int rows = 0;
  int column = 0;
  int columns = 0;
};
struct Layout {
  Area values;
  Area limits;  ///< of a wide screen; else no rows
  Area events;
  Area news;
};

Layout layout_of(Size size) {
  const int body = size.rows - top_rows - bottom_rows;
  const int news = std::clamp(body / 4, 2, 10);
  Layout layout;
  layout.news = {size.rows - bottom_rows - news, news, 0, size.columns};
  if (size.columns >= side_from) {
    const int left = size.columns * 3 / 5;
    const int rows = body - news - 1;
    layout.values = {top_rows, rows, 0, left - 1};
    layout.limits = {top_rows + 1, rows / 2 - 1, left, size.columns - left};
    layout.events = {top_rows + rows / 2 + 1, rows - rows / 2 - 1, left, size.columns - left};
    return layout;
  }
  const int events = std::clamp(body / 6, 1, 8);
  layout.events = {layout.news.row - 1 - events, events, 0, size.columns};
  layout.values = {top_rows, layout.events.row - 1 - top_rows, 0, size.columns};
  return layout;
}

/// Puts texts into rows, and cuts what does not fit.
class Painter {
 public:
  explicit Painter(Size size) : size_(size) { frame_.rows.resize(static_cast<std::size_t>(size.rows)); }

  /// @return the column behind it
  int put(int row, int column, std::string_view text, Tone tone = Tone::plain, int columns = 1 << 20) {
    if (row < 0 || row >= size_.rows || column < 0) return column;
    const int room = std::min(columns, size_.columns - column);
    std::u32string fits;
    int used = 0;
    for (const char32_t character : characters_of(text)) {
      const char32_t shown = shown_as(character);
      const int width = columns_of(shown);
      if (used + width > room) break;
      fits += shown;
      used += width;
    }
    if (used > 0) frame_.rows[static_cast<std::size_t>(row)].push_back({column, utf8_of(fits), tone});
    return column + used;
  }
  void put_right(int row, int end, std::string_view text, Tone tone = Tone::plain) {
    put(row, std::max(0, end - columns_of(characters_of(text))), text, tone);
  }
  void bar(int row, int column, int columns, std::string_view text) {
    put(row, column, std::string(static_cast<std::size_t>(std::max(0, columns)), ' '), Tone::bar, columns);
    put(row, column, text, Tone::bar, columns);
  }
  Frame take() { return std::move(frame_); }
  void set_cursor(int row, int column) {
    frame_.cursor_row = row;
    frame_.cursor_column = std::clamp(column, 0, size_.columns - 1);
  }

 private:
  /// Nothing that steers a terminal gets through, whatever the text was.
  [[nodiscard]] char32_t shown_as(char32_t character) const {
    if (character < 0x20 || (character >= 0x7F && character < 0xA0)) return U'?';
    return character > 0x7F && !size_.utf8 ? U'?' : character;
  }
  Size size_;
  Frame frame_;
};

Tone tone_of(mission::LimitState limit) {
  if (limit == mission::LimitState::red) return Tone::red;
  return limit == mission::LimitState::yellow ? Tone::yellow : Tone::plain;
}

std::string clock_text(UtcTime time) {
  const std::string iso = to_iso8601(time, 0);
  return iso.size() >= 19 ? iso.substr(11, 8) : iso;
}

std::string field_of(const LatestValues::Entry& entry, const std::string& name) {
  for (const auto& field : entry.report.fields) {
    if (field.name == name) return for_terminal(field.text);
  }
  return "";
}

std::string value_text(const mission::DecodedField& field) {
  return for_terminal(field.text) + (field.unit.empty() || !field.known ? "" : " " + field.unit);
}

/// Mode and why, by the newest packet that has them.
void draw_title(Painter& painter, const ScreenState& state, Size size) {
  const LatestValues::Entry* newest = nullptr;
  for (const char* name : {"health", "beacon"}) {
    const auto* entry = state.latest.structure(name);
    if (entry != nullptr && (newest == nullptr || entry->received > newest->received)) newest = entry;
  }
  std::string text = fmt::format(" {}  mode ", state.title);
  if (newest == nullptr) {
    text += "unknown: no packet yet";
  } else {
    std::string why = field_of(*newest, "reason");
    if (why.empty()) why = field_of(*newest, "mode_reason");
    text += field_of(*newest, "mode") + (why.empty() ? "" : ": " + why);
    if (const auto since = field_of(*newest, "since"); !since.empty()) text += ", since " + since;
    const nanoseconds age = state.now - newest->received;
    if (age > overdue) text += fmt::format(" (OLD, {} ago)", age_text(age));
  }
  const std::string clock = fmt::format(" {} UTC ", clock_text(state.now));
  const int clock_columns = static_cast<int>(clock.size());
  painter.bar(0, 0, size.columns - clock_columns, text);
  painter.bar(0, size.columns - clock_columns, clock_columns, clock);
}

void draw_link(Painter& painter, const ScreenState& state) {
  if (!state.server_there) {
    painter.put(1, 0,
                fmt::format("NO SERVER since {}: srfs-ground serve; values are old",
                            age_text(state.now - state.server_lost)),
                Tone::red);
    return;
  }
  const std::string line = !state.line_open ? "LINE CLOSED"
                           : state.locked   ? "line open"
                                            : "line open, NO FRAMES";
  int column = painter.put(1, 0, line, state.line_open && state.locked ? Tone::good : Tone::red);
  std::string text =
      ", newest packet " + (state.newest ? age_text(state.now - *state.newest) + " ago" : "never");
  text += fmt::format("  AD {}", to_text(state.cop.phase));
  if (state.cop.outstanding + state.cop.queued > 0)
    text += fmt::format(" ({} outstanding, {} queued)", state.cop.outstanding, state.cop.queued);
  if (state.cop.clcw && state.cop.clcw->lockout) text += " FARM LOCKOUT";
  if (!state.keys.empty()) text += "  keys " + state.keys;
  text += fmt::format("  {} sent", state.telecommands_sent);
  column = painter.put(1, column, text);
  if (!state.archive_problem.empty())
    painter.put(1, column, "  ARCHIVE FAILS: " + for_terminal(state.archive_problem), Tone::red);
}

/// The worst first.
std::vector<LatestValues::Row> out_of_limits(const LatestValues& latest) {
  auto rows = latest.rows("", true);
  std::stable_sort(rows.begin(), rows.end(), [](const auto& a, const auto& b) {
    return a.field.limit == mission::LimitState::red && b.field.limit != mission::LimitState::red;
  });
  return rows;
}

std::string out_text(const LatestValues::Row& row) {
  return fmt::format("{} {} {}", row.parameter, value_text(row.field), to_text(row.field.limit));
}

void draw_limits(Painter& painter, const ScreenState& state, const Layout& layout) {
  const auto out = out_of_limits(state.latest);
  if (out.empty()) {
    painter.put(2, 0, state.latest.all().empty() ? "limits: no value yet" : "limits: all within", Tone::dim);
  } else {
    int column =
        painter.put(2, 0, fmt::format("{} OUT OF LIMITS", out.size()), tone_of(out.front().field.limit));
    for (const auto& row : out)
      column = painter.put(2, column, "  " + out_text(row), tone_of(row.field.limit));
  }
  const Area& area = layout.limits;
  if (area.rows <= 0) return;
  painter.bar(area.row - 1, area.column, area.columns, " limits out");
  for (int i = 0; i < area.rows && i < static_cast<int>(out.size()); ++i) {
    const auto& row = out[static_cast<std::size_t>(i)];
    painter.put(area.row + i, area.column, out_text(row), tone_of(row.field.limit), area.columns);
  }
}

void draw_views(Painter& painter, const ScreenState& state, const Views& views, const Area& values) {
  const int room = std::max(values.columns - scroll_columns, values.columns / 3);
  std::vector<int> widths;
  for (const auto& name : views.names()) widths.push_back(static_cast<int>(name.size()) + 3);
  // The one that is shown is always seen.
  std::size_t first = 0;
  const auto width_to = [&](std::size_t begin, std::size_t end) {
    int sum = 0;
    for (std::size_t i = begin; i < end; ++i) sum += widths[i];
    return sum;
  };
  while (first < state.view && width_to(first, state.view + 1) > room) ++first;
  int column = 0;
  for (std::size_t i = first; i < views.names().size() && column < room; ++i) {
    const bool is_shown = i == state.view;
    painter.put(3, column, is_shown ? "[" + views.names()[i] + "]" : " " + views.names()[i] + " ",
                is_shown ? Tone::strong : Tone::dim, room - column);
    column += widths[i];
  }
}

void draw_values(Painter& painter, const ScreenState& state, const Views& views, const Area& area) {
  const auto rows = views.rows(state.view, state.latest);
  const int shown = std::max(0, area.rows);
  const std::size_t last =
      rows.size() > static_cast<std::size_t>(shown) ? rows.size() - static_cast<std::size_t>(shown) : 0;
  const std::size_t first = std::min(state.scroll, last);
  const int name_columns = std::clamp(area.columns / 2 - 4, 16, 46);
  const int end = area.column + area.columns;
  if (rows.empty())
    painter.put(area.row, area.column,
                state.view == 0 ? "no value outside its limits" : "nothing received yet", Tone::dim);
  for (int i = 0; i < shown && first + static_cast<std::size_t>(i) < rows.size(); ++i) {
    const auto& row = rows[first + static_cast<std::size_t>(i)];
    const Tone tone = tone_of(row.field.limit);
    const int y = area.row + i;
    painter.put(y, area.column, row.parameter, Tone::plain, name_columns);
    const std::string limit = tone == Tone::plain ? "" : " " + std::string(to_text(row.field.limit));
    const int value_columns = area.columns - name_columns - 1 - age_columns;
    const int behind = painter.put(y, area.column + name_columns + 1, value_text(row.field), tone,
                                   value_columns - static_cast<int>(limit.size()));
    painter.put(y, behind, limit, tone, value_columns);
    painter.put_right(y, end, age_text(state.now - row.received), Tone::dim);
  }
  if (last > 0)
    painter.put_right(3, end,
                      fmt::format(" {}-{} of {} (PgUp, PgDn)", first + 1,
                                  first + static_cast<std::size_t>(shown), rows.size()),
                      Tone::dim);
}

/// A text in parts of so many columns.
std::vector<std::string> parts_of(std::string_view text, int columns) {
  std::vector<std::string> parts;
  std::u32string part;
  int used = 0;
  for (const char32_t character : characters_of(text)) {
    if (used + columns_of(character) > columns) {
      parts.push_back(utf8_of(part));
      part.clear();
      used = 0;
    }
    part += character;
    used += columns_of(character);
  }
  parts.push_back(utf8_of(part));
  return parts;
}

void draw_happenings(Painter& painter, const std::deque<Happening>& list, const Area& area,
                     std::string_view name) {
  if (area.rows <= 0) return;
  painter.bar(area.row - 1, area.column, area.columns, name);
  constexpr int clock_columns = 9;
  std::deque<std::pair<const Happening*, std::string>> rows;  // a happening stands at its first part
  std::deque<Tone> tones;
  for (auto each = list.rbegin(); each != list.rend() && static_cast<int>(rows.size()) < area.rows; ++each) {
    const auto parts = parts_of(each->text, std::max(1, area.columns - clock_columns));
    for (std::size_t i = parts.size(); i > 0; --i)
      rows.emplace_front(i == 1 ? &*each : nullptr, parts[i - 1]);
    for (std::size_t i = 0; i < parts.size(); ++i) tones.push_front(each->tone);
  }
  while (static_cast<int>(rows.size()) > area.rows) {
    rows.pop_front();
    tones.pop_front();
  }
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const int row = area.row + static_cast<int>(i);
    if (rows[i].first != nullptr) painter.put(row, area.column, clock_text(rows[i].first->time), Tone::dim);
    painter.put(row, area.column + clock_columns, rows[i].second, tones[i], area.columns - clock_columns);
  }
}

/// The end of what is typed is seen with its cursor.
void draw_prompt(Painter& painter, const ScreenState& state, Size size) {
  const int row = size.rows - 1;
  painter.put(row - 1, 0, state.hint, Tone::dim);
  const int begin = painter.put(row, 0, state.prompt, Tone::strong, size.columns - 2);
  const std::u32string line = characters_of(state.line);
  const std::u32string before = characters_of(state.before_cursor);
  const int room = std::max(1, size.columns - begin - 1);
  std::size_t skipped = 0;
  while (skipped < before.size() && columns_of(std::u32string_view(before).substr(skipped)) > room) ++skipped;
  painter.put(row, begin, utf8_of(std::u32string_view(line).substr(skipped)));
  painter.set_cursor(row, begin + columns_of(std::u32string_view(before).substr(skipped)));
}

}  // namespace

int columns_of(char32_t c) {
  struct Range {
    char32_t first;
    char32_t last;
  };
  constexpr std::array combining{Range{0x300, 0x36F},   Range{0x483, 0x489},   Range{0x591, 0x5BD},
                                 Range{0x610, 0x61A},   Range{0x64B, 0x65F},   Range{0x1AB0, 0x1AFF},
                                 Range{0x1DC0, 0x1DFF}, Range{0x200B, 0x200F}, Range{0x20D0, 0x20FF},
                                 Range{0xFE00, 0xFE0F}, Range{0xFE20, 0xFE2F}};
  constexpr std::array wide{Range{0x1100, 0x115F}, Range{0x2E80, 0xA4CF},   Range{0xAC00, 0xD7A3},
                            Range{0xF900, 0xFAFF}, Range{0xFE30, 0xFE6F},   Range{0xFF00, 0xFF60},
                            Range{0xFFE0, 0xFFE6}, Range{0x1F300, 0x1FAFF}, Range{0x20000, 0x3FFFD}};
  const auto is_in = [c](const Range& range) { return c >= range.first && c <= range.last; };
  if (std::any_of(combining.begin(), combining.end(), is_in)) return 0;
  return std::any_of(wide.begin(), wide.end(), is_in) ? 2 : 1;
}

int columns_of(std::u32string_view text) {
  int columns = 0;
  for (const char32_t character : text) columns += columns_of(character);
  return columns;
}

Views::Views(const mission::Dictionary& dictionary) {
  std::vector<std::string> subsystems;
  for (const auto& structure : dictionary.structures()) {
    const auto* process = dictionary.apid(structure.apid);
    const std::string& subsystem = process == nullptr ? structure.node : process->name;
    subsystem_of_[structure.name] = subsystem;
    const bool known = std::find(subsystems.begin(), subsystems.end(), subsystem) != subsystems.end();
    if (structure.kind == mission::StructureKind::housekeeping && !known) subsystems.push_back(subsystem);
  }
  std::sort(subsystems.begin(), subsystems.end());
  names_ = {"limits"};
  names_.insert(names_.end(), subsystems.begin(), subsystems.end());
  names_.emplace_back("all");
}

std::vector<LatestValues::Row> Views::rows(std::size_t view, const LatestValues& latest) const {
  if (view == 0) return out_of_limits(latest);
  auto rows = latest.rows("", false);
  if (view + 1 >= names_.size()) return rows;
  std::erase_if(rows, [&](const LatestValues::Row& row) {
    const auto found = subsystem_of_.find(row.parameter.substr(0, row.parameter.find('.')));
    return found == subsystem_of_.end() || found->second != names_[view];
  });
  return rows;
}

void ScreenState::add(std::deque<Happening>& list, Happening happening) {
  if (!happening.of.empty())
    std::erase_if(list, [&happening](const Happening& each) { return each.of == happening.of; });
  list.push_back(std::move(happening));
  if (list.size() > happenings_max) list.pop_front();
}

int value_rows(Size size) {
  return std::max(1, layout_of(size).values.rows);
}

Frame draw(const ScreenState& state, const Views& views, Size size) {
  size.rows = std::max(1, size.rows);
  size.columns = std::max(1, size.columns);
  Painter painter(size);
  if (size.rows < smallest.rows || size.columns < smallest.columns) {
    painter.put(0, 0, fmt::format("too small: {}x{} needed", smallest.columns, smallest.rows), Tone::strong);
    painter.set_cursor(size.rows - 1, 0);
    return painter.take();
  }
  const Layout layout = layout_of(size);
  draw_title(painter, state, size);
  draw_link(painter, state);
  draw_limits(painter, state, layout);
  draw_views(painter, state, views, layout.values);
  draw_values(painter, state, views, layout.values);
  draw_happenings(painter, state.events, layout.events, " events");
  draw_happenings(painter, state.news, layout.news, " telecommands");
  draw_prompt(painter, state, size);
  return painter.take();
}

}  // namespace srfs::ground::screen
