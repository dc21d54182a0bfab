// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/web_gateway.hpp"

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <fstream>

#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include "base/signals.hpp"
#include "base/text.hpp"
#include "ground/api/api.hpp"
#include "ground/api/web_files.hpp"

namespace srfs::ground::api {
namespace {

constexpr seconds end_patience{3};
constexpr int niceness = 5;
constexpr rlim_t memory_max = rlim_t{2} << 30;  ///< beyond, a request ends, or this process

/// The server and its line come first: in time, in memory, and when the kernel has none left.
void yield_to_the_server() {
  static_cast<void>(::setpriority(PRIO_PROCESS, 0, niceness));
  const rlimit memory{memory_max, memory_max};
  static_cast<void>(::setrlimit(RLIMIT_DATA, &memory));
  std::ofstream("/proc/self/oom_score_adj") << 900;
}

/// The port of the last start, for one that is chosen freely: readers of the stream find it again.
std::uint16_t port_of_url(const std::string& url) {
  const std::size_t colon = url.rfind(':');
  return colon == std::string::npos
             ? std::uint16_t{0}
             : to_number<std::uint16_t>(url.substr(colon + 1)).value_or(std::uint16_t{0});
}

Site site_of(const Address& address, std::uint16_t port, const std::shared_ptr<const TlsSettings>& tls) {
  std::string own = address.name;
  if (own.starts_with('[')) own = own.substr(1, own.size() - 2);
  Site site{.scheme = tls ? "https" : "http", .port = port, .is_own_name = [own](const std::string& name) {
              return name == own || is_loopback_name(name);
            }};
  if (tls) site.is_own_name = [tls, own](const std::string& name) { return name == own || tls->names(name); };
  return site;
}

}  // namespace

std::optional<std::string> wrong_options(const WebOptions& options) {
  const auto address = parse_address(options.address);
  if (!address) return address.error();
  if (options.certificate.empty() != options.key.empty())
    return "--web-certificate and --web-key belong together";
  if (!address->is_loopback() && options.certificate.empty())
    return fmt::format("{} is not this machine alone: --web-certificate and --web-key are needed there",
                       address->name);
  return std::nullopt;
}

Result<void, std::string> run_web_gateway(const mission::Dictionary& dictionary,
                                          const std::filesystem::path& state_dir, const ArchivePlace& archive,
                                          const WebOptions& options) {
  if (const auto wrong = wrong_options(options)) return Err(*wrong);
  const auto address = parse_address(options.address);
  std::shared_ptr<const TlsSettings> tls;
  if (!options.certificate.empty()) {
    auto loaded = TlsSettings::load(options.certificate, options.key);
    if (!loaded) return Err(loaded.error());
    tls = std::move(*loaded);
  }
  const auto lock = lock_web_file(state_dir);
  if (!lock) return Err(lock.error());
  const bool is_first = static_cast<bool>(*lock);
  auto file = open_web_file(state_dir);
  if (!file) return Err(file.error());
  if (!is_first && file->url.empty())
    return Err(std::string("another web gateway of this folder is starting; try again"));
  const Fd signals = termination_signals();
  ignore_broken_pipes();
  yield_to_the_server();
  auto gateway = Gateway::open(dictionary, state_dir, archive);
  if (!gateway) return Err(gateway.error());
  auto server = HttpServer::open(*address, is_first ? port_of_url(file->url) : std::uint16_t{0}, tls);
  if (!server) return Err(server.error());
  const std::uint16_t port = (*server)->port();
  file->url = fmt::format("{}://{}:{}", tls ? "https" : "http", address->name, port);
  if (is_first) {
    if (const auto written = write_web_file(state_dir, *file); !written) return Err(written.error());
  } else {
    std::fprintf(stderr, "srfs-ground: %s names the first web gateway of this folder, and stays as it is\n",
                 (state_dir / web_file).c_str());
  }
  Api api(dictionary, **gateway,
          {.state_dir = state_dir,
           .archive = archive,
           .web_root = options.root.empty() ? default_web_root() : options.root,
           .orders_file = is_first ? state_dir / "web_orders" : std::filesystem::path(),
           .tokens = file->tokens,
           .site = site_of(*address, port, tls)});
  (*server)->start(api);
  std::printf("web: %s/#token=%s\n", file->url.c_str(), file->tokens.command.c_str());
  std::fflush(stdout);
  auto ended = (*gateway)->run(signals.get());
  (*server)->stop();
  return ended;
}

WebKeeper::~WebKeeper() {
  if (!child_) return;
  static_cast<void>(child_->process().signal(SIGTERM));
  static_cast<void>(child_->process().wait_for_exit(end_patience));
  pass_output();
}

void WebKeeper::on_time(MonotonicTime now) {
  if (child_) {
    pass_output();
    const auto end = child_->take_end();
    if (!end) return;
    if (now - started_ > restart_pause_most) pause_ = restart_pause;
    log_(fmt::format("the web gateway has ended ({}); it is started again in {} s", to_text(*end),
                     pause_.count()));
    child_.reset();
    next_start_ = now + pause_;
    pause_ = std::min(2 * pause_, restart_pause_most);
  }
  if (now < next_start_) return;
  started_ = now;
  next_start_ = now + pause_;
  auto child = ChildProcess::start(command_);
  if (child)
    child_.emplace(std::move(*child));
  else
    log_("the web gateway cannot be started: " + child.error());
}

/// Its line "web: ..." is this program's; what else it writes goes to the log.
void WebKeeper::pass_output() {
  std::array<char, 1024> chunk{};
  for (;;) {
    const ssize_t got = ::read(child_->output(), chunk.data(), chunk.size());
    if (got <= 0) return;
    for (const char c : std::string_view(chunk.data(), static_cast<std::size_t>(got))) {
      if (c != '\n') {
        if (line_.size() < line_octets_max) line_ += c;
        continue;
      }
      if (line_.starts_with("web: ")) {
        std::puts(line_.c_str());
        std::fflush(stdout);
      } else if (!line_.empty()) {
        log_(line_);
      }
      line_.clear();
    }
  }
}

}  // namespace srfs::ground::api
