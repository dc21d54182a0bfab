// srfs-ground: the operator's side of the ground link on a command line.
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include <unistd.h>
#include <CLI/CLI.hpp>

#include "ground/console.hpp"
#include "ros/deployment.hpp"

namespace {

using namespace srfs;
using namespace srfs::ground;

struct Arguments {
  std::string port = "var/rs422";
  std::string deployment = "sim";
  std::string state;
  bool json = false;
  double timeout_s = 0;
  bool wait = false;
  double duration_s = 0;
  std::string name;
  std::vector<std::string> pairs;
  std::string from;
  std::string to;
  std::string store = "housekeeping";
};

std::optional<milliseconds> duration(double value_s) {
  if (value_s <= 0) return std::nullopt;
  return milliseconds(static_cast<std::int64_t>(value_s * 1000));
}

void define(CLI::App& app, Arguments& a) {
  app.require_subcommand(1);
  app.add_option("--port", a.port, "Serial port of the ground link")->capture_default_str();
  app.add_option("--deployment", a.deployment, "Deployment file, or its name in launch_config")
      ->capture_default_str();
  app.add_option("--state", a.state, "Folder of the security counter (default: ground beside the port)");
  app.add_flag("--json", a.json, "One JSON object a line");
  const auto timeout = [&a](CLI::App* sub) {
    sub->add_option("--timeout", a.timeout_s, "Seconds until the final report")
        ->check(CLI::Range(0.001, 86400.0));
  };
  timeout(app.add_subcommand("ping", "Ask the spacecraft whether it is alive (17,1)"));
  auto* tc = app.add_subcommand("tc", "Send a telecommand of the mission dictionary");
  tc->add_option("name", a.name, "Telecommand, as in 'list'")->required();
  tc->add_option("arguments", a.pairs, "key=value ...");
  tc->add_flag("--wait", a.wait, "Until completion, not only acceptance");
  timeout(tc);
  auto* listen = app.add_subcommand("listen", "Show telemetry, events and the beacon");
  listen->add_option("--duration", a.duration_s, "Seconds (default: until interrupted)")
      ->check(CLI::PositiveNumber);
  auto* retrieve = app.add_subcommand("retrieve", "Get the stored packets of a period");
  retrieve->add_option("--from", a.from, "UTC, like 2026-11-21T08:00:00Z")->required();
  retrieve->add_option("--to", a.to, "UTC")->required();
  retrieve->add_option("--store", a.store, "Packet store")->capture_default_str();
  timeout(retrieve);
  app.add_subcommand("list", "Show the telecommands")->add_option("name", a.name, "Only this one");
  app.add_subcommand("session", "Command lines from standard input, everything that happens as JSON lines");
  for (auto* sub : app.get_subcommands({})) sub->fallthrough();
}

Exit fail(const Arguments& a, const std::string& message) {
  if (a.json) {
    const nlohmann::json json{{"type", "error"}, {"message", message}};
    std::puts(json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
  } else {
    std::fprintf(stderr, "srfs-ground: %s\n", message.c_str());
  }
  return Exit::unusable;
}

Exit operate(const CLI::App& app, const Arguments& a) {
  const auto dictionary = mission::Dictionary::load(mission::Dictionary::default_folder());
  if (app.got_subcommand("list")) return list(dictionary, a.name, a.json);
  const auto deployment = find_deployment(a.deployment);
  if (!deployment) return fail(a, deployment.error());
  const auto link = ros::Deployment::load(*deployment).link;
  const std::filesystem::path port_path = a.port;
  const auto var_dir = port_path.has_parent_path() ? port_path.parent_path() : std::filesystem::path(".");
  auto port = Port::open(port_path, link.baud);
  if (!port) return fail(a, port.error());
  const std::filesystem::path state_dir =
      a.state.empty() ? var_dir / "ground" : std::filesystem::path(a.state);
  auto uplink = Uplink::open(link, var_dir, state_dir, system_utc_now());
  if (!uplink) return fail(a, uplink.error());
  const bool colour = !a.json && isatty(STDOUT_FILENO) == 1;
  Console console(dictionary, link, std::move(*port), std::move(*uplink), {.json = a.json, .colour = colour});
  if (app.got_subcommand("ping")) return console.ping(duration(a.timeout_s));
  if (app.got_subcommand("tc")) return console.telecommand(a.name, a.pairs, a.wait, duration(a.timeout_s));
  if (app.got_subcommand("listen")) return console.listen(duration(a.duration_s));
  if (app.got_subcommand("retrieve")) return console.retrieve(a.store, a.from, a.to, duration(a.timeout_s));
  return console.session();
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The operator's side of the ground link");
  Arguments arguments;
  define(app, arguments);
  try {
    app.parse(argc, argv);
    return static_cast<int>(operate(app, arguments));
  } catch (const CLI::ParseError& error) {
    // 0: help was asked for; CLI11 numbers its errors from 100.
    return app.exit(error) == 0 ? 0 : static_cast<int>(Exit::unusable);
  } catch (const std::exception& error) {
    return static_cast<int>(fail(arguments, error.what()));
  }
}
