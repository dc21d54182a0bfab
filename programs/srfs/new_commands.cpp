// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/new_commands.hpp"

#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <vector>

#include <fmt/format.h>

#include "base/file.hpp"
#include "programs/srfs/answer.hpp"
#include "programs/srfs/new_files.hpp"
#include "suite/launcher.hpp"
#include "suite/run_node.hpp"

namespace srfs::tool {
namespace {

namespace fs = std::filesystem;

// Everything that the order or the disk does not allow is a ConfigError; run() reports it.

constexpr std::size_t largest_file = 1U << 20U;

/// A file of the installation, or of the tree that this was built from.
fs::path shared(const std::string& installed, const std::string& source) {
  const fs::path path = suite::suite_bin_folder().parent_path() / "share/srfs" / installed;
  std::error_code ec;
  return fs::exists(path, ec) ? path : fs::path(SRFS_SOURCE_DIR) / source;
}
fs::path templates_of(const std::string& kind) {
  return shared("templates", "programs/srfs/templates") / kind;
}
fs::path generator() {
  return shared("generator/mission_structures.py", "msgs/generator/mission_structures.py");
}

std::string text_of(const fs::path& file) {
  auto text = read_file(file, largest_file);
  if (!text) throw ConfigError(text.error().message);
  return std::move(*text);
}

void write(const fs::path& file, const std::string& text) {
  if (const auto written = write_file_atomically(file, text); !written)
    throw ConfigError(written.error().message);
}

std::string filled_template(const fs::path& file, const Placeholders& values) {
  const auto text = filled(text_of(file), values);
  if (!text) throw ConfigError(fmt::format("{}: there is no value for @{}@", file.string(), text.error()));
  return *text;
}

/// The mission dictionary with the fragments of the nodes that were added to the suite, and of the folders in
/// @p folder.
mission::Dictionary dictionary_with(const Target& target, const fs::path& folder) {
  const auto own = mission::Dictionary::load(mission::Dictionary::default_folder());
  std::vector<mission::Fragment> fragments;
  for (const suite::AddedNode& node : target.deployment.added)
    if (!node.dictionary.empty()) fragments.push_back({node.name, node.dictionary});
  std::vector<fs::path> files;
  std::error_code ec;
  for (const auto& entry : fs::directory_iterator(folder, ec))
    if (fs::is_regular_file(entry.path() / "dictionary.yaml", ec))
      files.push_back(entry.path() / "dictionary.yaml");
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files) {
    const mission::Fragment fragment{file.string(), text_of(file)};
    const auto node = fragment.node();
    const bool known = node && (own.apid_of_node(*node) != nullptr ||
                                std::any_of(fragments.begin(), fragments.end(),
                                            [&](const auto& other) { return other.node() == node; }));
    if (!known) fragments.push_back(fragment);
  }
  std::vector<mission::RefusedFragment> refused;
  auto dictionary =
      mission::Dictionary::load_fitting(mission::Dictionary::default_folder(), fragments, refused);
  for (const mission::RefusedFragment& fragment : refused)
    fmt::print(stderr, "srfs new: its numbers may be used again: {}\n", fragment.why);
  return dictionary;
}

/// Writes the header of a fragment's structs. Without the generator's packages the build does it later.
void generate_or_say(const fs::path& fragment, const fs::path& header) {
  const std::string script = generator();
  const std::string dictionary = mission::Dictionary::default_folder();
  const std::string in = fragment;
  const std::string out = header;
  std::vector<const char*> command{"/usr/bin/python3", "-B",         script.c_str(), "--dictionary",
                                   dictionary.c_str(), "--fragment", in.c_str(),     "--out",
                                   out.c_str(),        nullptr};
  pid_t pid = 0;
  int status = 0;
  const int failure =
      posix_spawn(&pid, command[0], nullptr, nullptr, const_cast<char**>(command.data()), environ);
  const bool generated =
      failure == 0 && waitpid(pid, &status, 0) == pid && WIFEXITED(status) && WEXITSTATUS(status) == 0;
  if (!generated)
    fmt::print(
        stderr,
        "srfs new: {} was not generated, the build will do it: install python3-yaml and python3-jinja2\n",
        header.filename().string());
}

Json to_json(const NewNumbers& n) {
  return {{"apid", n.apid}, {"structure", n.structure}, {"event", n.event}, {"parameter", n.parameter}};
}

/// What was written, and what to type next.
struct Report {
  std::string node;
  fs::path folder;
  std::vector<std::string> files;
  Json numbers;
  std::vector<std::string> next;
};

int show(const Report& report, bool json) {
  std::string text = fmt::format("written in {}: {}", report.folder.string(), fmt::join(report.files, ", "));
  for (const auto& [name, value] : report.numbers.items())
    text += fmt::format("\n  {} {}", name, value.is_string() ? value.get<std::string>() : value.dump());
  text += "\nnext:";
  for (const std::string& line : report.next) text += "\n  " + line;
  return done(text, json,
              {{"node", report.node},
               {"folder", report.folder.string()},
               {"files", report.files},
               {"numbers", report.numbers},
               {"next", report.next}});
}

/// Commands that build and test the folder: by itself, or in the tree that it is a part of.
std::vector<std::string> build_commands(const fs::path& folder, const std::string& node, bool in_tree) {
  const fs::path prefix = suite::suite_bin_folder().parent_path();
  if (in_tree)
    return {fmt::format("cmake --build {} --target {}_node test_{}", prefix.string(), node, node),
            fmt::format("ctest --test-dir {} -R {} --output-on-failure", prefix.string(), node)};
  const std::string build = folder / "build";
  return {fmt::format("cmake -S {} -B {} -G Ninja -DCMAKE_PREFIX_PATH={}", folder.string(), build,
                      prefix.string()),
          fmt::format("cmake --build {}", build),
          fmt::format("ctest --test-dir {} --output-on-failure", build)};
}

/// The folder is complete or absent: it is written under another name first.
/// @param header  that is generated from dictionary.yaml; empty: none
std::vector<std::string> write_folder(const fs::path& folder, const fs::path& templates,
                                      const Placeholders& values, const std::string& header) {
  const fs::path unfinished =
      folder.parent_path() / fmt::format(".{}.unfinished", folder.filename().string());
  std::error_code ec;
  fs::remove_all(unfinished, ec);
  std::vector<std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(templates)) {
    if (!entry.is_regular_file()) continue;
    const fs::path relative =
        entry.path().lexically_relative(templates).replace_extension();  // without ".in"
    const auto name = filled(relative.string(), values);
    if (!name)
      throw ConfigError(fmt::format("{}: there is no value for @{}@", entry.path().string(), name.error()));
    write(unfinished / *name, filled_template(entry.path(), values));
    files.push_back(*name);
  }
  if (!header.empty()) {
    generate_or_say(unfinished / "dictionary.yaml", unfinished / header);
    files.push_back(header);
  }
  fs::rename(unfinished, folder, ec);
  if (ec) throw ConfigError(fmt::format("{}: {}", folder.string(), ec.message()));
  std::sort(files.begin(), files.end());
  return files;
}

/// @return whether the folder became a part of the build in @p in
bool add_to_build(const fs::path& in, const std::string& node) {
  const fs::path file = in / "CMakeLists.txt";
  std::error_code ec;
  if (!fs::exists(file, ec)) return false;
  std::string text = text_of(file);
  if (!text.empty() && text.back() != '\n') text += '\n';
  write(file, text + fmt::format("add_subdirectory({})\n", node));
  return true;
}

std::string major_and_minor(const std::string& version) {
  return version.substr(0, version.find('.', version.find('.') + 1));
}

/// What the templates of a node's folder need. Throws ConfigError when it cannot be written there.
Placeholders placeholders_of(const NewOrder& order, const std::string& node, const NewNumbers& numbers) {
  return {{"name", order.name},
          {"Name", camel(order.name)},
          {"node", node},
          {"Node", camel(node)},
          {"apid", std::to_string(numbers.apid)},
          {"structure", std::to_string(numbers.structure)},
          {"counters", std::to_string(numbers.counters)},
          {"work", std::to_string(numbers.work)},
          {"event", std::to_string(numbers.event)},
          {"parameter", std::to_string(numbers.parameter)},
          {"srfs_version", major_and_minor(suite::version())}};
}

NewNumbers numbers_for(const Target& target, const fs::path& in, const std::string& node) {
  std::error_code ec;
  if (fs::exists(in / node, ec))
    throw ConfigError(fmt::format("{} is there already: nothing was changed", (in / node).string()));
  const mission::Dictionary dictionary = dictionary_with(target, in);
  if (target.deployment.find(node) != nullptr || dictionary.apid_of_node(node) != nullptr)
    throw ConfigError(fmt::format("there is a node '{}' already: choose another name", node));
  const auto numbers = free_numbers(dictionary);
  if (!numbers) throw ConfigError(numbers.error());
  return *numbers;
}

int write_node(const Target& target, const NewOrder& order, const std::string& kind,
               const std::string& node) {
  const fs::path folder = (order.in / node).lexically_normal();
  std::error_code ec;
  if (!fs::is_directory(order.in, ec))
    throw ConfigError(fmt::format("{}: no such folder", order.in.string()));
  const NewNumbers numbers = numbers_for(target, order.in, node);
  std::string ring_after;  // the last one that does not come and go
  for (const suite::NodeEntry& entry : target.deployment.nodes)
    if (!entry.added) ring_after = entry.name;
  Placeholders values = placeholders_of(order, node, numbers);
  values["ring_after"] = ring_after;

  Report report{.node = node, .folder = folder, .files = {}, .numbers = to_json(numbers), .next = {}};
  report.numbers["checked in the ring by"] = ring_after;
  report.files = write_folder(folder, templates_of(kind), values, order.name + "_structures.hpp");
  const bool in_tree = add_to_build(order.in, node);
  report.next = build_commands(folder, node, in_tree);
  const fs::path bin = suite::suite_bin_folder();
  const fs::path program = (in_tree ? bin : folder / "build/bin") / (node + "_node");
  report.next.push_back(
      fmt::format("{} node add {} --program {}", (bin / "srfs").string(), folder.string(), program.string()));
  return show(report, order.json);
}

/// Places of all peripherals that the deployment file names.
std::vector<PeripheralPlace> places_in(const fs::path& deployment) {
  const ConfigSection file = ConfigSection::load(deployment);
  std::vector<ConfigSection> sections = file.sections("peripherals");
  for (const ConfigSection& node : file.sections("nodes"))
    if (node.has("peripheral")) sections.push_back(node.section("peripheral"));
  std::vector<PeripheralPlace> places;
  for (const ConfigSection& section : sections)
    places.push_back({static_cast<int>(section.integer("can_address", 0, 255)),
                      static_cast<int>(section.integer("power_line", 0, 255))});
  return places;
}

/// A mission of its own, without payloads: it is made when it is not there.
void make_mission(const fs::path& folder) {
  std::error_code ec;
  if (fs::exists(folder, ec)) return;
  const std::string name = fs::absolute(folder).lexically_normal().filename();
  if (const std::string why = refusal_of_new_name(name); !why.empty()) throw ConfigError(why);
  static_cast<void>(write_folder(
      folder, templates_of("mission"),
      {{"mission", name}, {"Mission", camel(name)}, {"srfs_version", major_and_minor(suite::version())}},
      ""));
}

int write_payload(const Target& target, const NewOrder& order) {
  const std::string node = "payload_" + order.name;
  const fs::path in = (order.in / "").lexically_normal().parent_path();
  const NewNumbers numbers = numbers_for(target, in, node);
  make_mission(in);
  std::error_code ec;
  const auto first_of = [&](const fs::path& own, const fs::path& other) {
    return fs::exists(own, ec) ? own : other;
  };
  const fs::path dictionary = first_of(in / "mission.yaml", in / "dictionary.yaml");
  const fs::path deployment = first_of(in / "sim.yaml", target.deployment.file);
  const fs::path build = in / "CMakeLists.txt";
  const auto place = free_place(places_in(deployment));
  if (!place) throw ConfigError(place.error());
  const auto mission = with_payload({.build = {build.string(), text_of(build)},
                                     .dictionary = {dictionary.string(), text_of(dictionary)},
                                     .deployment = {deployment.string(), text_of(deployment)}},
                                    node, *place);
  if (!mission) throw ConfigError(mission.error());
  Placeholders values = placeholders_of(order, node, numbers);
  values["can_address"] = fmt::format("0x{:02X}", place->can_address);
  values["power_line"] = std::to_string(place->power_line);

  const fs::path folder = in / node;
  Report report{.node = node, .folder = folder, .files = {}, .numbers = to_json(numbers), .next = {}};
  report.numbers["can_address"] = values["can_address"];
  report.numbers["power_line"] = place->power_line;
  report.files = write_folder(folder, templates_of("payload"), values, "");
  for (const ChangedFile& file : {mission->build, mission->dictionary, mission->deployment})
    write(file.name, file.text);
  const bool in_tree = fs::exists(in / ".." / "CMakeLists.txt", ec);
  report.next = build_commands(in_tree ? folder : in, node, in_tree);
  if (in_tree) report.next.push_back("./run sim");
  return show(report, order.json);
}

/// The one file of the folder whose name ends so and whose text has @p text.
fs::path file_with(const fs::path& folder, std::string_view end, std::string_view text) {
  std::error_code ec;
  for (const auto& entry : fs::directory_iterator(folder, ec)) {
    const std::string name = entry.path().filename();
    if (entry.is_regular_file() && name.ends_with(end) &&
        text_of(entry.path()).find(text) != std::string::npos)
      return entry.path();
  }
  throw ConfigError(
      fmt::format("{}: no *{} with '{}': telecommands are added to nodes that `srfs new node` wrote",
                  folder.string(), end, text));
}

int write_telecommand(const NewOrder& order) {
  const fs::path fragment_file = order.in / "dictionary.yaml";
  const mission::Fragment fragment{fragment_file.string(), text_of(fragment_file)};
  const auto node = fragment.node();
  if (!node) throw ConfigError(fmt::format("{}: it names no node", fragment_file.string()));
  const auto dictionary = mission::Dictionary::load(mission::Dictionary::default_folder(), {fragment});
  const std::string prefix = prefix_of(dictionary, *node);
  const std::string command = prefix + "." + order.name;
  if (dictionary.command(command) != nullptr)
    throw ConfigError(fmt::format("there is a telecommand '{}' already: choose another name", command));
  const std::uint16_t function = free_function(dictionary, *node);

  const fs::path header = file_with(order.in, ".hpp", "CommandSet<");
  fs::path source = header;
  source.replace_extension(".cpp");
  const std::string stem = header.stem();
  const fs::path test = order.in / "test" / fmt::format("test_{}.cpp", stem);
  const Placeholders values{{"name", order.name},
                            {"Name", camel(order.name)},
                            {"prefix", prefix},
                            {"node", *node},
                            {"Command", camel(command)},
                            {"Class", camel(stem)},
                            {"function", std::to_string(function)}};
  const auto part = [&](const char* name) {
    return filled_template(templates_of("telecommand") / name, values);
  };
  const auto changed = with_command({.dictionary = fragment.text,
                                     .header = {header.string(), text_of(header)},
                                     .source = {source.string(), text_of(source)},
                                     .test = {test.string(), text_of(test)}},
                                    {.name = order.name,
                                     .structure = camel(command),
                                     .dictionary = part("dictionary.yaml.in"),
                                     .declaration = part("declaration.hpp.in"),
                                     .member = part("member.hpp.in"),
                                     .definition = part("definition.cpp.in"),
                                     .test = part("test.cpp.in")});
  if (!changed) throw ConfigError(changed.error());
  // It must still be a dictionary before any file is changed.
  static_cast<void>(mission::Dictionary::load(mission::Dictionary::default_folder(),
                                              {{fragment.name, changed->dictionary}}));
  const fs::path structures = order.in / (stem + "_structures.hpp");
  Report report{.node = *node,
                .folder = order.in,
                .files = {"dictionary.yaml", header.filename(), source.filename(),
                          "test/" + test.filename().string(), structures.filename()},
                .numbers = {{"telecommand", command}, {"function", function}},
                .next = {}};
  write(header, changed->header.text);
  write(source, changed->source.text);
  write(test, changed->test.text);
  write(fragment_file, changed->dictionary);
  generate_or_say(fragment_file, structures);
  std::error_code ec;
  const bool in_tree = fs::exists(order.in / ".." / "CMakeLists.txt", ec);
  report.next = build_commands(order.in, *node, in_tree);
  return show(report, order.json);
}

template <class Write>
int run(const NewOrder& order, const Write& write_it) {
  if (const std::string why = refusal_of_new_name(order.name); !why.empty())
    return fail(CommandExit::refused, why, order.json);
  try {
    return write_it();
  } catch (const ConfigError& error) {
    return fail(CommandExit::refused, error.what(), order.json);
  }
}

}  // namespace

int new_node(const Target& target, const NewOrder& order) {
  return run(order, [&] { return write_node(target, order, "node", order.name); });
}

int new_method(const Target& target, const NewOrder& order) {
  return run(order, [&] { return write_node(target, order, "method", "image_" + order.name); });
}

int new_payload(const Target& target, const NewOrder& order) {
  return run(order, [&] { return write_payload(target, order); });
}

int new_telecommand(const Target& /*target*/, const NewOrder& order) {
  return run(order, [&] { return write_telecommand(order); });
}

}  // namespace srfs::tool
