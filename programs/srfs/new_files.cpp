// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/new_files.hpp"

#include <algorithm>
#include <array>
#include <cctype>

#include <fmt/format.h>

namespace srfs::tool {
namespace {

constexpr std::uint16_t first_apid = 64;  // those below are the mission's
constexpr std::uint16_t last_apid = 600;  // 100 times it is a u16 still
constexpr std::uint16_t events_of_a_node = 10;

// Words of C++, and macros of its compiler; what a folder, a target or a class of the templates is called.
constexpr std::array reserved{"alignas",      "alignof",   "and",          "and_eq",    "asm",
                              "assert",       "auto",      "bitand",       "bitor",     "bool",
                              "break",        "build",     "case",         "catch",     "char",
                              "char16_t",     "char32_t",  "char8_t",      "class",     "co_await",
                              "co_return",    "co_yield",  "compl",        "concept",   "const",
                              "const_cast",   "consteval", "constexpr",    "constinit", "continue",
                              "decltype",     "default",   "delete",       "do",        "double",
                              "dynamic_cast", "else",      "enum",         "errno",     "explicit",
                              "export",       "extern",    "false",        "float",     "for",
                              "friend",       "goto",      "if",           "inline",    "int",
                              "linux",        "long",      "main",         "mission",   "mutable",
                              "namespace",    "new",       "node",         "noexcept",  "not",
                              "not_eq",       "nullptr",   "operator",     "or",        "or_eq",
                              "private",      "protected", "public",       "register",  "reinterpret_cast",
                              "requires",     "result",    "return",       "ros",       "short",
                              "signed",       "sizeof",    "srfs",         "static",    "static_assert",
                              "static_cast",  "struct",    "suite",        "switch",    "template",
                              "test",         "this",      "thread_local", "throw",     "true",
                              "try",          "typedef",   "typeid",       "typename",  "union",
                              "unix",         "unsigned",  "using",        "virtual",   "void",
                              "volatile",     "wchar_t",   "while",        "xor",       "xor_eq"};

bool is_lower_snake_case(std::string_view name) {
  const auto is_lower = [](char c) { return c >= 'a' && c <= 'z'; };
  if (name.empty() || !is_lower(name.front()) || name.back() == '_') return false;
  char before = 'a';
  for (const char c : name) {
    if (!is_lower(c) && !(c >= '0' && c <= '9') && c != '_') return false;
    if (c == '_' && before == '_') return false;
    before = c;
  }
  return true;
}

bool is_part_of_word(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
}

bool has_word(std::string_view text, std::string_view word) {
  for (std::size_t at = text.find(word); at != std::string_view::npos; at = text.find(word, at + 1)) {
    const std::size_t end = at + word.size();
    if ((at == 0 || !is_part_of_word(text[at - 1])) && (end == text.size() || !is_part_of_word(text[end])))
      return true;
  }
  return false;
}

/// `class Name`, `using Name = ...` and the like at the begin of the line.
bool line_declares(std::string_view line, std::string_view type) {
  for (const std::string_view key :
       {"class ", "struct ", "enum class ", "enum ", "union ", "concept ", "using "}) {
    if (!line.starts_with(key)) continue;
    std::string_view rest = line.substr(key.size());
    if (rest.starts_with("[[")) rest.remove_prefix(std::min(rest.size(), rest.find("]] ") + 3));
    if (rest.starts_with(type) && (rest.size() == type.size() || !is_part_of_word(rest[type.size()])))
      return true;
  }
  return false;
}

/// Position of the first line, from @p from on, that is a key of the document itself; else the end.
std::size_t next_key(const std::string& yaml, std::size_t from) {
  while (from < yaml.size()) {
    const std::size_t line = yaml.find('\n', from);
    if (line == std::string::npos || line + 1 >= yaml.size()) return yaml.size();
    from = line + 1;
    if (std::isalpha(static_cast<unsigned char>(yaml[from])) != 0) return from;
  }
  return yaml.size();
}

/// Behind the last entry of the list @p key, which is made if there is none.
std::string with_entry(std::string yaml, const std::string& key, const std::string& entry) {
  if (!yaml.empty() && yaml.back() != '\n') yaml += '\n';
  const std::size_t list = yaml.find(fmt::format("\n{}:", key));
  if (list == std::string::npos) return fmt::format("{}\n{}:\n{}", yaml, key, entry);
  std::size_t end = next_key(yaml, list + 1);
  while (end > 1 && yaml[end - 2] == '\n') --end;  // empty lines stay before what follows
  return yaml.insert(end, entry);
}

/// The struct in the list of the CommandSet, the declaration behind the last execute(), the member at the end
/// of the class that has them.
Result<std::string, std::string> with_declaration(std::string header, const CommandTexts& texts) {
  if (header.find(fmt::format(" {}(", texts.name)) != std::string::npos)
    return Err(fmt::format("it has a function '{}' already: choose another name", texts.name));
  if (has_word(header, texts.name + "_"))
    return Err(fmt::format("it has a member '{}_' already: choose another name", texts.name));
  const std::size_t set = header.find("CommandSet<");
  const std::size_t set_end = set == std::string::npos ? set : header.find(">;", set);
  if (set_end == std::string::npos) return Err(std::string("no 'using Commands = CommandSet<...>;'"));
  header.insert(set_end, ", mission::" + texts.structure);
  const std::size_t execute = header.rfind("FailureCode execute(const mission::");
  const std::size_t line = execute == std::string::npos ? execute : header.find('\n', execute);
  if (line == std::string::npos) return Err(std::string("no 'FailureCode execute(const mission::...&)'"));
  header.insert(line + 1, texts.declaration);
  const std::size_t end = header.find("\n};", line);
  if (end == std::string::npos) return Err(std::string("no end of the class"));
  header.insert(end + 1, texts.member);
  return header;
}

/// Before the end of the innermost namespace that ends the file.
Result<std::string, std::string> with_text_at_end(std::string source, std::string_view end,
                                                  const std::string& text) {
  const std::size_t at = source.rfind(end);
  if (at == std::string::npos) return Err(fmt::format("no '{}'", end));
  return source.insert(at, text);
}

/// Before the `default:` of `switch (function)`.
Result<std::string, std::string> with_case(std::string source, const std::string& entry) {
  const std::size_t begin = source.find("switch (function) {");
  const std::size_t end = begin == std::string::npos ? begin : source.find("default:", begin);
  if (end == std::string::npos) return Err(std::string("no 'switch (function) {' with a 'default:'"));
  return source.insert(source.rfind('\n', end) + 1, entry);
}

/// The handler and the member in the private part of the class that has the switch.
Result<std::string, std::string> with_handler(std::string model, const PeripheralCommandTexts& texts) {
  if (has_word(model, texts.name + "_"))
    return Err(fmt::format("it has a member '{}_' already: choose another name", texts.name));
  constexpr std::string_view key = "\n private:\n";
  const std::size_t begin = model.find(key, model.find("switch (function) {"));
  const std::size_t end = begin == std::string::npos ? begin : model.find("\n};", begin);
  if (end == std::string::npos) return Err(std::string("no class with ' private:'"));
  model.insert(end + 1, texts.member);
  return model.insert(begin + key.size(), texts.handler);
}

/// At the end of the list in brackets: `key: [a, b]`.
Result<std::string, std::string> with_element(std::string yaml, const std::string& key,
                                              const std::string& element) {
  const std::size_t list = yaml.find(fmt::format("\n{}: [", key));
  const std::size_t end = list == std::string::npos ? list : yaml.find(']', list);
  if (end == std::string::npos) return Err(fmt::format("no '{}: [...]'", key));
  const bool is_first = yaml[end - 1] == '[';
  return yaml.insert(end, (is_first ? "" : ", ") + element);
}

/// The payload's folder before the simulator, its model in the simulator's list.
Result<std::string, std::string> with_model(std::string cmake, const std::string& node) {
  const std::size_t simulator = cmake.find("\nsrfs_add_simulator(");
  const std::size_t end = simulator == std::string::npos ? simulator : cmake.find(')', simulator);
  if (end == std::string::npos) return Err(std::string("no 'srfs_add_simulator(... MODELS ...)'"));
  cmake.insert(end, " " + node);
  return cmake.insert(simulator + 1, fmt::format("add_subdirectory({})\n", node));
}

}  // namespace

std::string refusal_of_new_name(std::string_view name) {
  if (!is_lower_snake_case(name))
    return fmt::format("'{}': expected lower-case words joined by '_', as in star_tracker", name);
  if (name.size() > longest_new_name)
    return fmt::format("'{}': expected at most {} characters", name, longest_new_name);
  if (std::find(reserved.begin(), reserved.end(), name) != reserved.end())
    return fmt::format("'{}' is reserved: choose another name", name);
  return {};
}

bool declares_type(std::string_view text, std::string_view type, TypeScope scope) {
  std::vector<bool> counts{scope == TypeScope::any};  // in each open namespace
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (scope == TypeScope::any) {
      line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
    } else if (line.starts_with("namespace ") && line.ends_with("{")) {
      counts.push_back(line == "namespace srfs {" || line == "namespace srfs::sim {");
    } else if (line.starts_with("}  // namespace") && counts.size() > 1) {
      counts.pop_back();
    }
    if (counts.back() && line_declares(line, type)) return true;
  }
  return false;
}

std::string camel(std::string_view name) {
  std::string result;
  bool upper = true;
  for (const char c : name) {
    if (c == '_' || c == '.') {
      upper = true;
      continue;
    }
    result += upper ? static_cast<char>(std::toupper(static_cast<unsigned char>(c))) : c;
    upper = false;
  }
  return result;
}

Result<NewNumbers, std::string> free_numbers(const mission::Dictionary& dictionary) {
  for (std::uint16_t apid = first_apid; apid <= last_apid; ++apid) {
    const auto base = static_cast<std::uint16_t>(100 * apid);
    const NewNumbers numbers{.apid = apid,
                             .structure = static_cast<std::uint16_t>(1000 + apid),
                             .counters = static_cast<std::uint16_t>(1100 + apid),
                             .work = static_cast<std::uint16_t>(1200 + apid),
                             .event = static_cast<std::uint16_t>(base + 1),
                             .parameter = static_cast<std::uint16_t>(base + 1)};
    bool taken = dictionary.apid(apid) != nullptr || dictionary.structure(numbers.structure) != nullptr ||
                 dictionary.structure(numbers.counters) != nullptr ||
                 dictionary.structure(numbers.work) != nullptr;
    for (std::uint16_t i = 1; i <= events_of_a_node; ++i) {
      const auto id = static_cast<std::uint16_t>(base + i);
      taken = taken || dictionary.event(id) != nullptr || dictionary.parameter(id) != nullptr;
    }
    if (!taken) return numbers;
  }
  return Err(fmt::format("no APID from {} to {} is free", first_apid, last_apid));
}

Result<std::string, std::string> filled(std::string_view text, const Placeholders& values) {
  std::string result;
  while (true) {
    const std::size_t begin = text.find('@');
    result += text.substr(0, begin);
    if (begin == std::string_view::npos) return result;
    text.remove_prefix(begin + 1);
    const std::size_t end = text.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_");
    if (end == std::string_view::npos || end == 0 || text[end] != '@') {  // an address
      result += '@';
      continue;
    }
    const auto value = values.find(text.substr(0, end));
    if (value == values.end()) return Err(std::string(text.substr(0, end)));
    result += value->second;
    text.remove_prefix(end + 1);
  }
}

Result<CommandedFolder, std::string> with_command(CommandedFolder folder, const CommandTexts& texts) {
  folder.dictionary = with_entry(std::move(folder.dictionary), "commands", texts.dictionary);
  auto header = with_declaration(std::move(folder.header.text), texts);
  if (!header) return Err(fmt::format("{}: {}", folder.header.name, header.error()));
  auto source = with_text_at_end(std::move(folder.source.text), "}  // namespace srfs\n", texts.definition);
  if (!source) return Err(fmt::format("{}: {}", folder.source.name, source.error()));
  auto test =
      with_text_at_end(std::move(folder.test.text), "}  // namespace\n}  // namespace srfs\n", texts.test);
  if (!test) return Err(fmt::format("{}: {}", folder.test.name, test.error()));
  folder.header.text = std::move(*header);
  folder.source.text = std::move(*source);
  folder.test.text = std::move(*test);
  return folder;
}

Result<CommandedPayload, std::string> with_peripheral_command(CommandedPayload folder,
                                                              const PeripheralCommandTexts& texts) {
  folder.dictionary = with_entry(std::move(folder.dictionary), "commands", texts.dictionary);
  auto profile = with_case(std::move(folder.profile.text), texts.profile_case);
  if (!profile) return Err(fmt::format("{}: {}", folder.profile.name, profile.error()));
  auto model = with_case(std::move(folder.model.text), texts.model_case).and_then([&](std::string text) {
    return with_handler(std::move(text), texts);
  });
  if (!model) return Err(fmt::format("{}: {}", folder.model.name, model.error()));
  auto test =
      with_text_at_end(std::move(folder.test.text), "}  // namespace\n}  // namespace srfs\n", texts.test);
  if (!test) return Err(fmt::format("{}: {}", folder.test.name, test.error()));
  folder.profile.text = std::move(*profile);
  folder.model.text = std::move(*model);
  folder.test.text = std::move(*test);
  return folder;
}

Result<PeripheralPlace, std::string> free_place(const std::vector<PeripheralPlace>& taken) {
  constexpr int first_address = 0x21;
  constexpr int lines = 8;
  const auto has = [&](int PeripheralPlace::*member, int value) {
    return std::any_of(taken.begin(), taken.end(),
                       [&](const PeripheralPlace& place) { return place.*member == value; });
  };
  PeripheralPlace place{.can_address = first_address, .power_line = 0};
  while (has(&PeripheralPlace::can_address, place.can_address)) ++place.can_address;
  while (place.power_line < lines && has(&PeripheralPlace::power_line, place.power_line)) ++place.power_line;
  if (place.power_line == lines) return Err(fmt::format("all {} power lines are taken", lines));
  return place;
}

Result<MissionFolder, std::string> with_payload(MissionFolder mission, const std::string& node,
                                                const PeripheralPlace& place) {
  auto build = with_model(std::move(mission.build.text), node);
  if (!build) return Err(fmt::format("{}: {}", mission.build.name, build.error()));
  auto dictionary =
      with_element(std::move(mission.dictionary.text), "payloads", node).and_then([&](std::string text) {
        return with_element(std::move(text), "include", node + "/dictionary.yaml");
      });
  if (!dictionary) return Err(fmt::format("{}: {}", mission.dictionary.name, dictionary.error()));
  mission.build.text = std::move(*build);
  mission.dictionary.text = std::move(*dictionary);
  const std::string slot =
      fmt::format("  - {{ payload: {}, allotted_ms: 60, overrun_ms: 20, reset_ms: 40 }}\n", node);
  const std::string entry = fmt::format(
      "  - name: {0}\n    executable: {0}_node\n    peripheral: {{ can_address: 0x{1:02X}, power_line: {2} "
      "}}\n"
      "    memory_limit_mib: 256\n",
      node, place.can_address, place.power_line);
  mission.deployment.text =
      with_entry(with_entry(std::move(mission.deployment.text), "slots", slot), "nodes", entry);
  return mission;
}

std::uint16_t free_function(const mission::Dictionary& dictionary, std::string_view node) {
  const mission::ApplicationProcess* process = dictionary.apid_of_node(node);
  std::uint16_t function = 1;
  while (process != nullptr && dictionary.function(process->apid, function) != nullptr) ++function;
  return function;
}

std::uint8_t free_peripheral_function(const mission::Dictionary& dictionary, std::string_view node) {
  const auto is_taken = [&](std::uint8_t function) {
    return std::any_of(dictionary.commands().begin(), dictionary.commands().end(), [&](const auto& command) {
      return command.node == node && command.peripheral_function == function;
    });
  };
  std::uint8_t function = 1;
  while (function < UINT8_MAX && is_taken(function)) ++function;
  return function;
}

std::string prefix_of(const mission::Dictionary& dictionary, std::string_view node) {
  for (const mission::Command& command : dictionary.commands())
    if (command.node == node && command.is_function()) return command.name.substr(0, command.name.find('.'));
  return std::string(node);
}

}  // namespace srfs::tool
