// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "msgs/mission/dictionary.hpp"

/// What `srfs new` writes: names, free numbers, and texts from templates. Pure; new_commands.hpp uses the
/// disk.
namespace srfs::tool {

/// Why it cannot be the name of something new; empty: it can. Lower-case words joined by '_', at most
/// longest_new_name characters, no word of C++ and none that the files use.
[[nodiscard]] std::string refusal_of_new_name(std::string_view name);
inline constexpr std::size_t longest_new_name = 24;

/// Which declarations count: those of the namespaces that new classes are in, or all.
enum class TypeScope : std::uint8_t { srfs, any };
/// Whether the text of a header declares a type of this name.
[[nodiscard]] bool declares_type(std::string_view text, std::string_view type, TypeScope scope);

/// "eps.switch_load" -> "EpsSwitchLoad": the generated struct of this name.
[[nodiscard]] std::string camel(std::string_view name);

/// Numbers that no entry of the dictionary has. They belong together: APID a, structures 1000 + a, 1100 + a
/// and 1200 + a, events and parameters from 100 a + 1 on.
struct NewNumbers {
  std::uint16_t apid = 0;
  std::uint16_t structure = 0;
  std::uint16_t counters = 0;  ///< a second structure
  std::uint16_t work = 0;      ///< a third one
  std::uint16_t event = 0;     ///< the first of ten
  std::uint16_t parameter = 0;
};
/// @return why not: all are taken
[[nodiscard]] Result<NewNumbers, std::string> free_numbers(const mission::Dictionary& dictionary);

using Placeholders = std::map<std::string, std::string, std::less<>>;
/// The template with each @key@ replaced. @return the key that it does not have
[[nodiscard]] Result<std::string, std::string> filled(std::string_view text, const Placeholders& values);

/// A change of one file: its new text.
struct ChangedFile {
  std::string name;
  std::string text;
};

/// The texts of a node's folder that a telecommand is added to.
struct CommandedFolder {
  std::string dictionary;  ///< dictionary.yaml
  ChangedFile header;      ///< the one with `using Commands = CommandSet<...>`
  ChangedFile source;
  ChangedFile test;
};
/// What is put in.
struct CommandTexts {
  std::string name;       ///< becomes a function of the class
  std::string structure;  ///< name of the generated struct
  std::string dictionary;
  std::string declaration;
  std::string member;
  std::string definition;
  std::string test;
};
/// The folder with the telecommand in it: at the end of `commands`, of the CommandSet, of the declarations,
/// of the source and of the test.
/// @return which file has no place for it
[[nodiscard]] Result<CommandedFolder, std::string> with_command(CommandedFolder folder,
                                                                const CommandTexts& texts);

/// The texts of a payload's folder that a telecommand to its peripheral is added to.
struct CommandedPayload {
  std::string dictionary;  ///< dictionary.yaml
  ChangedFile profile;     ///< the one with decode_command()
  ChangedFile model;       ///< the one with execute()
  ChangedFile test;
};
/// What is put in.
struct PeripheralCommandTexts {
  std::string name;  ///< becomes a member of the model
  std::string dictionary;
  std::string profile_case;
  std::string model_case;
  std::string handler;
  std::string member;
  std::string test;
};
/// The folder with the telecommand in it: at the end of `commands`, before the `default:` of both switches,
/// at the begin and the end of the model's private part, at the end of the test.
/// @return which file has no place for it
[[nodiscard]] Result<CommandedPayload, std::string> with_peripheral_command(
    CommandedPayload folder, const PeripheralCommandTexts& texts);

/// Where a payload's peripheral is: its CAN address, the line of its power switch.
struct PeripheralPlace {
  int can_address = 0;
  int power_line = 0;
};
/// A place that no peripheral of the deployment has. @return why not: all lines are taken
[[nodiscard]] Result<PeripheralPlace, std::string> free_place(const std::vector<PeripheralPlace>& taken);

/// The files of a mission's folder that know its payloads.
struct MissionFolder {
  ChangedFile build;       ///< CMakeLists.txt with srfs_add_simulator(... MODELS ...)
  ChangedFile dictionary;  ///< with the lists `payloads: [...]` and `include: [...]`
  ChangedFile deployment;  ///< with `slots:` and `nodes:`
};
/// The mission with a payload more: the last one in each list.
/// @return which file has no place for it
[[nodiscard]] Result<MissionFolder, std::string> with_payload(MissionFolder mission, const std::string& node,
                                                              const PeripheralPlace& place);

/// The lowest function id that no command of the node has.
[[nodiscard]] std::uint16_t free_function(const mission::Dictionary& dictionary, std::string_view node);
/// The lowest number that none of its telecommands has at the node's peripheral.
[[nodiscard]] std::uint8_t free_peripheral_function(const mission::Dictionary& dictionary,
                                                    std::string_view node);
/// What the node's names on the link begin with ("impact" of "impact.clear"); the node's name if it has none.
[[nodiscard]] std::string prefix_of(const mission::Dictionary& dictionary, std::string_view node);

}  // namespace srfs::tool
