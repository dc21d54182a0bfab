// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/new_commands.hpp"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "base/file.hpp"
#include "programs/srfs/answer.hpp"
#include "programs/srfs/new_files.hpp"
#include "suite/added_nodes.hpp"
#include "suite/launcher.hpp"
#include "suite/run_node.hpp"

namespace srfs::tool {
namespace {

namespace fs = std::filesystem;

// Everything that the order or the disk does not allow is an exception; run() reports it.

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

/// Absolute, without a '/' at its end: its name is the last part.
fs::path folder_of(const fs::path& named) {
  const fs::path folder = fs::absolute(named).lexically_normal();
  return folder.has_filename() ? folder : folder.parent_path();
}

void refuse_existing(const fs::path& path) {
  std::error_code ec;
  if (fs::exists(path, ec))
    throw ConfigError(fmt::format("{} is there already: nothing was changed", path.string()));
}

/// Replaces the texts of files that are there, then does the rest; when that fails, they are as before.
template <class Rest>
void replace_files(const std::vector<ChangedFile>& files, const Rest& rest) {
  std::vector<ChangedFile> before;
  for (const ChangedFile& file : files) {
    before.push_back({file.name, text_of(file.name)});
    const fs::path folder = fs::path(file.name).parent_path();
    if (access(file.name.c_str(), W_OK) != 0 || access(folder.c_str(), W_OK) != 0)
      throw ConfigError(fmt::format("{} cannot be written: nothing was changed", file.name));
  }
  try {
    for (const ChangedFile& file : files) write(file.name, file.text);
    rest();
  } catch (const std::exception&) {
    for (const ChangedFile& file : before) static_cast<void>(write_file_atomically(file.name, file.text));
    throw;
  }
}

/// What is new in a folder is written in a hidden one, and moved when all of it is there and fits.
class NewFiles {
 public:
  explicit NewFiles(fs::path in)
      : in_(std::move(in)),
        in_is_new_(!fs::exists(in_)),
        hidden_(in_is_new_ ? in_.parent_path() / fmt::format(".{}.unfinished", in_.filename().string())
                           : in_ / ".new.unfinished") {
    fs::remove_all(hidden_);
    fs::create_directories(hidden_);
  }
  ~NewFiles() {
    std::error_code ec;
    fs::remove_all(hidden_, ec);
  }
  NewFiles(const NewFiles&) = delete;
  NewFiles& operator=(const NewFiles&) = delete;

  [[nodiscard]] const fs::path& folder() const { return hidden_; }

  /// With these files changed, or nothing at all is.
  void move(const std::vector<ChangedFile>& changed) const {
    replace_files(changed, [this] {
      if (in_is_new_) return fs::rename(hidden_, in_);
      std::vector<fs::path> names;
      for (const auto& entry : fs::directory_iterator(hidden_)) names.push_back(entry.path().filename());
      for (const fs::path& name : names) refuse_existing(in_ / name);
      std::vector<fs::path> moved;
      try {
        for (const fs::path& name : names) {
          fs::rename(hidden_ / name, in_ / name);
          moved.push_back(in_ / name);
        }
      } catch (const fs::filesystem_error&) {
        std::error_code ec;
        for (const fs::path& path : moved) fs::remove_all(path, ec);
        throw;
      }
    });
  }

 private:
  fs::path in_;
  bool in_is_new_;
  fs::path hidden_;
};

std::string filled_template(const fs::path& file, const Placeholders& values) {
  const auto text = filled(text_of(file), values);
  if (!text) throw ConfigError(fmt::format("{}: there is no value for @{}@", file.string(), text.error()));
  return *text;
}

/// The mission that the new one is for.
struct Mission {
  suite::Deployment deployment;
  fs::path dictionary;  ///< its folder
};

/// That of the folder, when it has a mission.yaml: with its own sim.yaml, else with the deployment of the
/// command. Else the deployment's.
Mission mission_of(const Target& target, const fs::path& folder) {
  std::error_code ec;
  const bool is_mission = fs::exists(folder / "mission.yaml", ec);
  const fs::path file = folder / "sim.yaml";
  if (!is_mission || !fs::exists(file, ec)) {
    fs::path dictionary = is_mission ? folder : target.deployment.dictionary;
    if (dictionary.empty()) dictionary = mission::Dictionary::default_folder();
    return {target.deployment, dictionary};
  }
  auto deployment = suite::Deployment::load(file);
  if (deployment.name == target.deployment.name)  // VAR may be that of another mission
    deployment = suite::load_deployment(file, target.var).deployment;
  fs::path dictionary = deployment.dictionary.empty() ? folder : deployment.dictionary;
  return {std::move(deployment), std::move(dictionary)};
}

/// The mission dictionary with the fragments of the nodes that were added to the suite, and of those in a
/// folder.
class KnownDictionary {
 public:
  KnownDictionary(const Mission& mission, const fs::path& folder)
      : mission_(mission), dictionary_(mission::Dictionary::load(mission.dictionary)) {
    for (const suite::AddedNode& node : mission.deployment.added)
      if (!node.dictionary.empty()) fragments_.push_back({node.name, node.dictionary});
    std::vector<fs::path> files;
    std::error_code ec;
    for (const auto& entry : fs::directory_iterator(folder, ec))
      if (fs::is_regular_file(entry.path() / "dictionary.yaml", ec))
        files.push_back(entry.path() / "dictionary.yaml");
    std::sort(files.begin(), files.end());
    for (const fs::path& file : files) add(file);
    std::vector<mission::RefusedFragment> refused;
    dictionary_ = mission::Dictionary::load_fitting(mission.dictionary, fragments_, refused);
    for (const mission::RefusedFragment& fragment : refused) {
      fmt::print(stderr, "srfs new: its numbers may be used again: {}\n", fragment.why);
      std::erase_if(fragments_, [&](const auto& other) { return other.name == fragment.name; });
    }
  }

  [[nodiscard]] const mission::Dictionary& dictionary() const { return dictionary_; }

  /// Throws ConfigError when the mission's files, as they are now, or one more fragment do not fit.
  void check(const std::vector<mission::Fragment>& more) const {
    auto all = fragments_;
    all.insert(all.end(), more.begin(), more.end());
    static_cast<void>(mission::Dictionary::load(mission_.dictionary, all));
  }

 private:
  void add(const fs::path& file) {
    const mission::Fragment fragment{file.string(), text_of(file)};
    const auto node = fragment.node();
    const bool known = node && (dictionary_.apid_of_node(*node) != nullptr ||
                                std::any_of(fragments_.begin(), fragments_.end(),
                                            [&](const auto& other) { return other.node() == node; }));
    if (!known) fragments_.push_back(fragment);
  }

  const Mission& mission_;
  mission::Dictionary dictionary_;
  std::vector<mission::Fragment> fragments_;
};

/// Writes the header of a fragment's structs. @return whether it is as new as the fragment
bool generate_or_say(const fs::path& dictionary_folder, const fs::path& fragment, const fs::path& header,
                     const std::string& node) {
  const std::string script = generator();
  const std::string dictionary = dictionary_folder;
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
    fmt::print(stderr,
               "srfs new: {} was not generated: the generator failed (it needs python3-yaml and "
               "python3-jinja2). The build generates it; in the tree of SRFS the target {}_structures does\n",
               header.filename().string(), node);
  return generated;
}

Json to_json(const NewNumbers& n) {
  return {{"apid", n.apid}, {"structure", n.structure}, {"event", n.event}, {"parameter", n.parameter}};
}

/// What was written, and what to type next.
struct Report {
  std::string node = {};
  fs::path folder = {};
  std::vector<std::string> files = {};
  Json numbers = {};
  std::vector<std::string> made = {};     ///< files of a mission that was made for it
  std::vector<std::string> changed = {};  ///< files outside of the folder that were there
  std::vector<std::string> next = {};
};

int show(const Report& report, bool json) {
  std::string text = fmt::format("written in {}: {}", report.folder.string(), fmt::join(report.files, ", "));
  for (const auto& [name, value] : report.numbers.items())
    text += fmt::format("\n  {} {}", name, value.is_string() ? value.get<std::string>() : value.dump());
  if (!report.made.empty()) text += fmt::format("\nmade: {}", fmt::join(report.made, ", "));
  if (!report.changed.empty()) text += fmt::format("\nchanged: {}", fmt::join(report.changed, ", "));
  text += "\nnext:";
  for (const std::string& line : report.next) text += "\n  " + line;
  return done(text, json,
              {{"node", report.node},
               {"folder", report.folder.string()},
               {"files", report.files},
               {"numbers", report.numbers},
               {"made", report.made},
               {"changed", report.changed},
               {"next", report.next}});
}

std::vector<std::string> names_of(const std::vector<ChangedFile>& files) {
  std::vector<std::string> names;
  for (const ChangedFile& file : files) names.push_back(file.name);
  return names;
}

/// Where a folder is built: by itself, or by the project above that it is a part of, which may be SRFS.
struct BuildPlace {
  fs::path project;
  fs::path folder;  ///< with bin/
  bool is_of_srfs = false;
};
BuildPlace build_place_of(const fs::path& folder) {
  std::error_code ec;
  fs::path project = folder;
  while (project.has_relative_path()) {
    const auto above = read_file(project.parent_path() / "CMakeLists.txt", largest_file);
    const std::string part = fmt::format("add_subdirectory({})", project.filename().string());
    if (!above || above->find(part) == std::string::npos) break;
    project = project.parent_path();
  }
  const fs::path prefix = suite::suite_bin_folder().parent_path();
  if (fs::equivalent(project, SRFS_SOURCE_DIR, ec) && fs::exists(prefix / "CMakeCache.txt", ec))
    return {project, prefix, true};
  return {project, project / "build"};
}

/// Commands that build and test the folder of the node.
std::vector<std::string> build_commands(const BuildPlace& place, const std::string& node) {
  const std::string build = place.folder;
  if (place.is_of_srfs)
    return {fmt::format("cmake --build {} --target {}_node test_{}", build, node, node),
            fmt::format("ctest --test-dir {} -R {} --output-on-failure", build, node)};
  return {fmt::format("cmake -S {} -B {} -G Ninja -DCMAKE_PREFIX_PATH={}", place.project.string(), build,
                      suite::suite_bin_folder().parent_path().string()),
          fmt::format("cmake --build {}", build),
          fmt::format("ctest --test-dir {} --output-on-failure", build)};
}

std::vector<std::string> write_folder(const fs::path& folder, const fs::path& templates,
                                      const Placeholders& values) {
  std::vector<std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(templates)) {
    if (!entry.is_regular_file()) continue;
    const fs::path relative =
        entry.path().lexically_relative(templates).replace_extension();  // without ".in"
    const auto name = filled(relative.string(), values);
    if (!name)
      throw ConfigError(fmt::format("{}: there is no value for @{}@", entry.path().string(), name.error()));
    write(folder / *name, filled_template(entry.path(), values));
    files.push_back(*name);
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// The CMakeLists.txt of the folder with the node in it; none where there is none.
std::vector<ChangedFile> with_subdirectory(const fs::path& in, const std::string& node) {
  const fs::path file = in / "CMakeLists.txt";
  std::error_code ec;
  if (!fs::exists(file, ec)) return {};
  std::string text = text_of(file);
  if (!text.empty() && text.back() != '\n') text += '\n';
  return {ChangedFile{file.string(), text + fmt::format("add_subdirectory({})\n", node)}};
}

/// Headers of SRFS that nodes include.
std::vector<fs::path> headers_of_srfs() {
  std::error_code ec;
  std::vector<fs::path> folders{suite::suite_bin_folder().parent_path() / "include/srfs"};
  if (!fs::exists(folders.front(), ec)) {
    folders.clear();
    for (const char* folder : {"lib", "nodes/payload", "hw_sim"})
      folders.push_back(fs::path(SRFS_SOURCE_DIR) / folder);
  }
  std::vector<fs::path> headers;
  for (const fs::path& folder : folders)
    for (const auto& entry : fs::recursive_directory_iterator(folder))
      if (entry.path().extension() == ".hpp") headers.push_back(entry.path());
  return headers;
}

/// Throws ConfigError when a class of the new one would have the name of one of SRFS or of its own files.
void refuse_taken_classes(const std::vector<std::string>& classes, const fs::path& templates) {
  const auto refuse = [&](const fs::path& file, TypeScope scope) {
    const std::string text = text_of(file);
    for (const std::string& name : classes)
      if (declares_type(text, name, scope))
        throw ConfigError(
            fmt::format("its class would be {}, which {} has: choose another name", name, file.string()));
  };
  for (const auto& entry : fs::recursive_directory_iterator(templates))
    if (entry.is_regular_file()) refuse(entry.path(), TypeScope::any);
  for (const fs::path& header : headers_of_srfs()) refuse(header, TypeScope::srfs);
}

std::string major_and_minor(const std::string& version) {
  return version.substr(0, version.find('.', version.find('.') + 1));
}

/// What the templates of a node's folder need.
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

void refuse_taken_node(bool taken, const std::string& node) {
  if (taken) throw ConfigError(fmt::format("there is a node '{}' already: choose another name", node));
}

NewNumbers numbers_in(const KnownDictionary& known) {
  const auto numbers = free_numbers(known.dictionary());
  if (!numbers) throw ConfigError(numbers.error());
  return *numbers;
}

int write_node(const Target& target, const NewOrder& order, const std::string& kind,
               const std::string& node) {
  const fs::path in = folder_of(order.in);
  const fs::path folder = in / node;
  if (!fs::is_directory(in)) throw ConfigError(fmt::format("{}: no such folder", in.string()));
  refuse_existing(folder);
  refuse_taken_classes({camel(order.name), camel(node) + "Node"}, templates_of(kind));
  const Mission mission = mission_of(target, in);
  const KnownDictionary known(mission, in);
  refuse_taken_node(
      mission.deployment.find(node) != nullptr || known.dictionary().apid_of_node(node) != nullptr, node);
  const NewNumbers numbers = numbers_in(known);
  std::string ring_after;  // the last one that does not come and go
  for (const suite::NodeEntry& entry : mission.deployment.nodes)
    if (!entry.added) ring_after = entry.name;
  Placeholders values = placeholders_of(order, node, numbers);
  values["ring_after"] = ring_after;

  Report report{.node = node, .folder = folder, .numbers = to_json(numbers)};
  report.numbers["checked in the ring by"] = ring_after;
  const NewFiles files(in);
  const fs::path written = files.folder() / node;
  report.files = write_folder(written, templates_of(kind), values);
  known.check({{node, text_of(written / "dictionary.yaml")}});
  const std::string header = order.name + "_structures.hpp";
  if (generate_or_say(mission.dictionary, written / "dictionary.yaml", written / header, node))
    report.files.insert(std::upper_bound(report.files.begin(), report.files.end(), header), header);
  const std::vector<ChangedFile> changed = with_subdirectory(in, node);
  files.move(changed);
  report.changed = names_of(changed);

  const BuildPlace place = build_place_of(folder);
  report.next = build_commands(place, node);
  report.next.push_back(fmt::format("{} node add {} --program {}",
                                    (suite::suite_bin_folder() / "srfs").string(), folder.string(),
                                    (place.folder / "bin" / (node + "_node")).string()));
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

/// A mission of its own, without payloads. @param name  of its folder @return its files
std::vector<std::string> write_mission(const fs::path& folder, const std::string& name) {
  if (const std::string why = refusal_of_new_name(name); !why.empty())
    throw ConfigError(fmt::format("--in: the folder's name is the mission's: {}", why));
  return write_folder(
      folder, templates_of("mission"),
      {{"mission", name}, {"Mission", camel(name)}, {"srfs_version", major_and_minor(suite::version())}});
}

/// Its sim.yaml is none that could be loaded before it has a slot.
Mission mission_without_payloads(const fs::path& folder) {
  Mission mission;
  mission.deployment.file = folder / "sim.yaml";
  mission.dictionary = folder;
  return mission;
}

/// Throws ConfigError for a deployment that is not this mission's, or a copy which the next build overwrites.
void refuse_other_deployment(const Mission& mission) {
  std::error_code ec;
  const suite::Deployment& deployment = mission.deployment;
  const fs::path file = fs::absolute(deployment.file).lexically_normal();
  if (file.parent_path() == mission.dictionary) return;
  if (!deployment.dictionary.empty() && !fs::equivalent(deployment.dictionary, mission.dictionary, ec))
    throw ConfigError(fmt::format("{} is the deployment of another mission, {}: choose with --deployment",
                                  file.string(), deployment.dictionary.string()));
  for (fs::path folder = file.parent_path(); folder.has_relative_path(); folder = folder.parent_path()) {
    const fs::path prefix = folder.parent_path();
    if (folder.filename() == "share" &&
        (fs::exists(prefix / "CMakeCache.txt", ec) || fs::exists(prefix / "bin/srfs", ec)))
      throw ConfigError(fmt::format("{} is a copy in {}: name its source with --deployment", file.string(),
                                    prefix.string()));
  }
}

/// The mission's files with the payload in them. Throws ConfigError when it has no place there.
std::vector<ChangedFile> mission_with(const Mission& mission, const fs::path& folder, const std::string& node,
                                      const PeripheralPlace& place) {
  const auto file = [](const fs::path& path) { return ChangedFile{path.string(), text_of(path)}; };
  const auto changed = with_payload({.build = file(folder / "CMakeLists.txt"),
                                     .dictionary = file(folder / "mission.yaml"),
                                     .deployment = file(fs::absolute(mission.deployment.file))},
                                    node, place);
  if (!changed) throw ConfigError(changed.error());
  return {changed->build, changed->dictionary, changed->deployment};
}

/// Links in the view to what the mission's folder has, but for the name that is written there anew. The view
/// itself, and the hidden folder that it is in, may be in the mission's folder.
void link_all_but(const fs::path& name, const fs::path& home, const fs::path& view) {
  fs::create_directory(view);
  for (const auto& entry : fs::directory_iterator(home)) {
    const fs::path other = entry.path().filename();
    if (other != name && entry.path() != view && entry.path() != view.parent_path())
      fs::create_symlink(entry.path(), view / other);
  }
}

/// The mission's dictionary as it will be, in a folder of its own: links to the files that are there, beside
/// a new mission.yaml and what is known of the payload before it has numbers.
void write_view(const fs::path& view, const fs::path& home, const std::string& mission_yaml,
                const std::string& node) {
  constexpr int other_apid = 2046;  // not one that free_numbers() gives
  link_all_but("mission.yaml", home, view);
  write(view / "mission.yaml", mission_yaml);
  write(view / node / "dictionary.yaml",
        fmt::format("subsystem: {0}\napids: [{{ name: {0}, apid: {1}, node: {0} }}]\n", node, other_apid));
}

KnownDictionary dictionary_in_view(const Mission& mission, const fs::path& home, const std::string& node) {
  try {
    return {mission, home};
  } catch (const ConfigError& error) {
    throw ConfigError(
        fmt::format("{} does not fit into the mission: {} (ids of parameters: parameter_ids of mission.yaml)",
                    node, error.what()));
  }
}

int write_payload(const Target& target, const NewOrder& order) {
  const std::string node = "payload_" + order.name;
  const fs::path in = folder_of(order.in);
  const fs::path folder = in / node;
  refuse_existing(folder);
  refuse_taken_classes({camel(order.name) + "Profile", camel(order.name) + "Model"}, templates_of("payload"));
  Report report{.node = node, .folder = folder};
  const bool is_new = !fs::exists(in / "CMakeLists.txt");
  const NewFiles files(in);
  if (is_new) {
    for (const std::string& file : write_mission(files.folder(), in.filename()))
      report.made.push_back((in / file).string());
  }
  const fs::path home = is_new ? files.folder() : in;
  if (!fs::exists(home / "mission.yaml"))
    throw ConfigError(fmt::format("{} is no mission: it has no mission.yaml", in.string()));
  Mission mission = is_new ? mission_without_payloads(home) : mission_of(target, home);
  refuse_other_deployment(mission);
  refuse_taken_node(mission.deployment.find(node) != nullptr, node);
  const auto place = free_place(places_in(mission.deployment.file));
  if (!place) throw ConfigError(place.error());
  const std::vector<ChangedFile> changed = mission_with(mission, home, node, *place);
  mission.dictionary = files.folder() / ".view";
  write_view(mission.dictionary, home, changed[1].text, node);
  const KnownDictionary known = dictionary_in_view(mission, home, node);
  const NewNumbers numbers = numbers_in(known);
  Placeholders values = placeholders_of(order, node, numbers);
  values["can_address"] = fmt::format("0x{:02X}", place->can_address);
  values["power_line"] = std::to_string(place->power_line);

  report.numbers = to_json(numbers);
  report.numbers["can_address"] = values["can_address"];
  report.numbers["power_line"] = place->power_line;
  report.numbers["deployment"] = is_new ? (in / "sim.yaml").string() : changed.back().name;
  report.files = write_folder(files.folder() / node, templates_of("payload"), values);
  write(mission.dictionary / node / "dictionary.yaml", text_of(files.folder() / node / "dictionary.yaml"));
  known.check({});
  fs::remove_all(mission.dictionary);
  if (is_new) {
    for (const ChangedFile& file : changed) write(file.name, file.text);
    files.move({});
  } else {
    files.move(changed);
    report.changed = names_of(changed);
  }
  const BuildPlace build = build_place_of(folder);
  report.next = build_commands(build, node);
  if (build.is_of_srfs) report.next.push_back("./run sim");
  return show(report, order.json);
}

int write_interfaces(const NewOrder& order) {
  const fs::path in = folder_of(order.in);
  const fs::path folder = in / order.name;
  refuse_existing(folder);
  std::error_code ec;
  if (fs::exists(shared("interfaces", "msgs") / order.name, ec) ||
      fs::exists(shared("interfaces", "msgs/interfaces") / order.name, ec))
    throw ConfigError(fmt::format("SRFS has a package '{}': choose another name", order.name));
  Report report{.node = order.name, .folder = folder, .numbers = Json::object()};
  const NewFiles files(in);
  report.files =
      write_folder(files.folder() / order.name, templates_of("interfaces"), {{"name", order.name}});
  files.move({});
  report.next = {fmt::format("in a node's CMakeLists.txt: srfs_generate_interfaces(messages PACKAGES {})",
                             folder.string()),
                 fmt::format("in a ROS 2 workspace: colcon build --packages-select {}", order.name)};
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

struct NewCommand {
  std::string node;
  std::string prefix;
  std::string name;  ///< "impact.clear"
  std::uint16_t function = 0;
};
/// Of the fragment's node. Throws ConfigError when the name is taken.
NewCommand new_command(const mission::Fragment& fragment, const mission::Dictionary& dictionary,
                       const std::string& name) {
  const auto node = fragment.node();
  if (!node) throw ConfigError(fmt::format("{}: it names no node", fragment.name));
  const std::string prefix = prefix_of(dictionary, *node);
  const std::string command = prefix + "." + name;
  if (dictionary.command(command) != nullptr)
    throw ConfigError(fmt::format("there is a telecommand '{}' already: choose another name", command));
  return {*node, prefix, command, free_function(dictionary, *node)};
}

/// Throws ConfigError when the mission does not fit with this dictionary of one of its payloads.
void check_with(const fs::path& home, const fs::path& payload, const std::string& dictionary) {
  const NewFiles files(home);
  const fs::path view = files.folder() / "view";
  link_all_but(payload.filename(), home, view);
  write(view / payload.filename() / "dictionary.yaml", dictionary);
  static_cast<void>(mission::Dictionary::load(view));
}

/// @param profile  the payload's NAME_profile.cpp
int write_peripheral_command(const Target& target, const NewOrder& order, const fs::path& profile) {
  const fs::path folder = profile.parent_path();
  const fs::path home = folder.parent_path();
  if (!fs::exists(home / "mission.yaml"))
    throw ConfigError(fmt::format("{} is no mission: it has no mission.yaml", home.string()));
  const fs::path dictionary_file = folder / "dictionary.yaml";
  const mission::Fragment fragment{dictionary_file.string(), text_of(dictionary_file)};
  const auto dictionary = mission::Dictionary::load(mission_of(target, home).dictionary);
  const auto [node, prefix, command, function] = new_command(fragment, dictionary, order.name);
  const unsigned peripheral_function = free_peripheral_function(dictionary, node);

  std::string stem = profile.stem();
  stem.resize(stem.size() - std::string_view("_profile").size());
  const fs::path model = folder / (stem + "_model.cpp");
  const fs::path test = folder / "test" / fmt::format("test_{}.cpp", stem);
  const Placeholders values{{"name", order.name},
                            {"Name", camel(order.name)},
                            {"prefix", prefix},
                            {"node", node},
                            {"Command", camel(command)},
                            {"Stem", camel(stem)},
                            {"function", std::to_string(function)},
                            {"peripheral_function", std::to_string(peripheral_function)}};
  const auto part = [&](const char* name) {
    return filled_template(templates_of("peripheral_command") / name, values);
  };
  const auto changed = with_peripheral_command({.dictionary = fragment.text,
                                                .profile = {profile.string(), text_of(profile)},
                                                .model = {model.string(), text_of(model)},
                                                .test = {test.string(), text_of(test)}},
                                               {.name = order.name,
                                                .dictionary = part("dictionary.yaml.in"),
                                                .profile_case = part("profile_case.cpp.in"),
                                                .model_case = part("model_case.cpp.in"),
                                                .handler = part("handler.cpp.in"),
                                                .member = part("member.cpp.in"),
                                                .test = part("test.cpp.in")});
  if (!changed) throw ConfigError(changed.error());
  check_with(home, folder, changed->dictionary);
  replace_files({changed->profile, changed->model, changed->test, {dictionary_file, changed->dictionary}},
                [] {});
  return show(
      {.node = node,
       .folder = folder,
       .files = {"dictionary.yaml", profile.filename(), model.filename(), "test/" + test.filename().string()},
       .numbers = {{"telecommand", command},
                   {"function", function},
                   {"peripheral_function", peripheral_function}},
       .next = build_commands(build_place_of(folder), node)},
      order.json);
}

/// That of a payload; nullopt: the folder is another node's.
std::optional<fs::path> profile_in(const fs::path& folder) {
  std::error_code ec;
  for (const auto& entry : fs::directory_iterator(folder, ec))
    if (entry.path().filename().string().ends_with("_profile.cpp") &&
        text_of(entry.path()).find("::decode_command(") != std::string::npos)
      return entry.path();
  return std::nullopt;
}

int write_telecommand(const Target& target, const NewOrder& order) {
  const fs::path folder = folder_of(order.in);
  if (const auto profile = profile_in(folder)) return write_peripheral_command(target, order, *profile);
  const fs::path fragment_file = folder / "dictionary.yaml";
  const mission::Fragment fragment{fragment_file.string(), text_of(fragment_file)};
  if (!fragment.node()) throw ConfigError(fmt::format("{}: it names no node", fragment_file.string()));
  const fs::path mission = mission_of(target, folder.parent_path()).dictionary;
  const auto dictionary = mission::Dictionary::load(mission, {fragment});
  const auto [node, prefix, command, function] = new_command(fragment, dictionary, order.name);

  const fs::path header = file_with(folder, ".hpp", "CommandSet<");
  fs::path source = header;
  source.replace_extension(".cpp");
  const std::string stem = header.stem();
  const fs::path test = folder / "test" / fmt::format("test_{}.cpp", stem);
  const Placeholders values{{"name", order.name},
                            {"Name", camel(order.name)},
                            {"prefix", prefix},
                            {"node", node},
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
  static_cast<void>(mission::Dictionary::load(mission, {{fragment.name, changed->dictionary}}));
  const fs::path structures = folder / (stem + "_structures.hpp");
  Report report{
      .node = node,
      .folder = folder,
      .files = {"dictionary.yaml", header.filename(), source.filename(), "test/" + test.filename().string()},
      .numbers = {{"telecommand", command}, {"function", function}}};
  const ChangedFile new_fragment{fragment_file.string(), changed->dictionary};
  replace_files({changed->header, changed->source, changed->test, new_fragment}, [] {});
  if (generate_or_say(mission, fragment_file, structures, node))
    report.files.push_back(structures.filename());
  report.next = build_commands(build_place_of(folder), node);
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
  } catch (const fs::filesystem_error& error) {
    const std::string why = fmt::format("{}: {}", error.path1().string(), error.code().message());
    return fail(CommandExit::refused, why, order.json);
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

int new_interfaces(const Target&, const NewOrder& order) {
  return run(order, [&] { return write_interfaces(order); });
}

int new_telecommand(const Target& target, const NewOrder& order) {
  return run(order, [&] { return write_telecommand(target, order); });
}

}  // namespace srfs::tool
