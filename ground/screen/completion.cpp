// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/screen/completion.hpp"

#include <algorithm>

#include "ground/time_tag.hpp"

namespace srfs::ground::screen {
namespace {

using Names = std::vector<std::string>;

const Names verbs{"ad",     "arm",      "cancel", "clcw",  "files",   "help", "ping",   "put", "quit",
                  "resume", "retrieve", "setvr",  "stats", "suspend", "tc",   "unlock", "view"};

template <class List>
Names names_of(const List& list) {
  Names names;
  for (const auto& each : list) names.push_back(each.name);
  return names;
}

/// Values that the dictionary lists for an argument, each behind "name=".
Names values_of(const mission::Field& field, const mission::Dictionary& dictionary) {
  using mission::Reference;
  Names values;
  if (field.enumeration != nullptr) {
    for (const auto& [value, label] : field.enumeration->labels) values.push_back(label);
  } else if (field.type == mission::FieldType::boolean) {
    values = {"false", "true"};
  } else if (field.reference == Reference::structure) {
    values = names_of(dictionary.structures());
  } else if (field.reference == Reference::event || field.reference == Reference::event_or_none) {
    values = names_of(dictionary.events());
  } else if (field.reference == Reference::store) {
    values = names_of(dictionary.stores());
  } else if (field.reference == Reference::parameter) {
    values = names_of(dictionary.parameters());
  }
  for (std::string& value : values) value = field.name + "=" + value;
  return values;
}

/// Of a telecommand: its name, its arguments that are not given yet, values of the one that is begun.
Names of_telecommand(const Words& words, const std::string& word, const mission::Dictionary& dictionary) {
  if (words.size() == 1) return names_of(dictionary.commands());
  const auto* command = dictionary.command(words[1]);
  if (command == nullptr) return {};
  if (word.starts_with('-')) return {"--at", "--timeout"};
  Names names;
  const std::size_t equals = word.find('=');
  for (const mission::Field& field : command->arguments) {
    if (equals != std::string::npos) {
      if (word.substr(0, equals) == field.name) return values_of(field, dictionary);
      continue;
    }
    const bool given = std::any_of(words.begin(), words.end(), [&field](const std::string& each) {
      return each.starts_with(field.name + "=");
    });
    if (!given) names.push_back(field.name + "=");
  }
  return names;
}

Names names_after(const Words& words, const std::string& word, const mission::Dictionary& dictionary,
                  const Names& views) {
  if (words.empty()) return verbs;
  const std::string& verb = words.front();
  if (verb == "tc" || verb == "arm") return of_telecommand(words, word, dictionary);
  if (verb == "view" && words.size() == 1) return views;
  if (verb == "ad" && words.size() == 1) return {"off", "on"};
  if (verb == "retrieve" && words.size() == 3) return names_of(dictionary.stores());
  return {};
}

std::string common_of(const Names& names) {
  std::string common = names.front();
  for (const std::string& name : names) {
    const auto end = std::mismatch(common.begin(), common.end(), name.begin(), name.end()).first;
    common.erase(end, common.end());
  }
  return common;
}

}  // namespace

Completion complete(const std::string& before, const mission::Dictionary& dictionary, const Names& views) {
  Completion completion;
  const std::size_t space = before.rfind(' ');
  completion.begin = space == std::string::npos ? 0 : space + 1;
  const std::string word = before.substr(completion.begin);
  completion.text = word;
  for (std::string& name :
       names_after(words_of(before.substr(0, completion.begin)), word, dictionary, views)) {
    if (name.starts_with(word)) completion.candidates.push_back(std::move(name));
  }
  std::sort(completion.candidates.begin(), completion.candidates.end());
  if (completion.candidates.empty()) return completion;
  completion.text = common_of(completion.candidates);
  if (completion.candidates.size() == 1 && !completion.text.ends_with('=')) completion.text += ' ';
  return completion;
}

}  // namespace srfs::ground::screen
