// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// How ttc comes up: parameters, keys, what is on disk, subscriptions.
#include <algorithm>
#include <cerrno>

#include <fmt/format.h>
#include <malloc.h>
#include <sys/epoll.h>
#include <sys/stat.h>

#include <mission/structures.hpp>

#include "base/known_key.hpp"
#include "nodes/ttc/ttc_node.hpp"
#include "suite/boot_store.hpp"
#include "suite/step_down.hpp"

namespace srfs {
namespace {

constexpr std::size_t journal_worker_capacity = 2;
constexpr std::size_t state_worker_capacity = 8;
constexpr std::size_t store_worker_capacity = 8;
constexpr seconds link_state_copy_period{10};
constexpr std::size_t files_worker_capacity = 3;  // a turn of CFDP, an order of PUS 23, one of imaging
/// File data in front of the line: long enough for a turn of the disk, short enough that an answer from the
/// ground is not old when it comes.
constexpr milliseconds files_queue_time{350};
constexpr std::size_t files_queue_octets_min = 4096;

std::optional<std::string> permission_problem(const std::filesystem::path& path) {
  struct stat info {};
  if (stat(path.c_str(), &info) != 0)
    return fmt::format("{}: cannot be read: {}", path.string(), errno_text(errno));
  if (!S_ISREG(info.st_mode)) return fmt::format("{}: expected a regular file", path.string());
  if ((info.st_mode & 077U) != 0) {
    return fmt::format("{}: expected mode 0600, others may not read a key (mode is {:04o})", path.string(),
                       info.st_mode & 07777U);
  }
  return std::nullopt;
}

/// nullopt: the contingency association.
std::optional<KeySet> to_key_set(suite::AssociationSet set) {
  if (set == suite::AssociationSet::contingency) return std::nullopt;
  return set == suite::AssociationSet::b ? KeySet::b : KeySet::a;
}

Result<wire::SdlsKey, std::string> read_key(const std::filesystem::path& path, bool is_hardware_line) {
  if (const auto problem = permission_problem(path)) return Err(*problem);
  auto text = read_file(path, 4096);
  if (!text) return Err(text.error().message);
  while (!text->empty() && (text->back() == '\n' || text->back() == '\r')) text->pop_back();
  auto key = wire::SdlsKey::from_hex(*text);
  std::fill(text->begin(), text->end(), '\0');
  if (!key) return Err(fmt::format("{}: expected 64 hexadecimal digits", path.string()));
  // Left out, and no more: see suite::unsafe_link().
  const auto known = why_known(key->octets());
  if (known && is_hardware_line)
    return Err(fmt::format("{}: not used, everybody may know this key: {}", path.string(), *known));
  return std::move(*key);
}

bool on_hardware_line(const suite::Deployment& deployment, const std::filesystem::path& root) {
  const auto line = deployment.devices.find("rs422");
  return line != deployment.devices.end() && suite::is_hardware_line(line->second, root);
}

std::vector<KeyEncryptionKey> read_masters(const suite::Deployment& deployment,
                                           const std::filesystem::path& root, const UplinkConfig& uplink,
                                           std::vector<TtcCore::UnusableMaster>& unusable) {
  std::vector<KeyEncryptionKey> masters;
  for (const suite::KeyEncryptionKeyFile& entry : deployment.link.key_encryption_keys) {
    auto key = read_key(root / entry.key_file, on_hardware_line(deployment, root));
    const auto id = static_cast<std::uint16_t>(entry.id);
    if (key && is_key_of(uplink, *key))
      key = Err(fmt::format("{}: a telecommand channel has this key, too", entry.key_file));
    if (key) {
      masters.push_back({.id = id, .key = std::move(*key)});
    } else {
      unusable.push_back({.id = id, .why = key.error()});
    }
  }
  return masters;
}

Result<UplinkConfig, std::string> read_channels(const suite::Deployment& deployment,
                                                const std::filesystem::path& root,
                                                const wire::SessionKeys& session_keys,
                                                std::vector<TtcCore::UnusableKey>& unusable_keys) {
  const suite::LinkSettings& settings = deployment.link;
  if (auto unsafe = suite::unsafe_link(deployment, root); !unsafe.empty()) return Err(std::move(unsafe));
  UplinkConfig config;
  config.spacecraft_id = static_cast<std::uint16_t>(settings.spacecraft_id);
  config.strict = settings.tc_strict;
  config.cltu.randomized = settings.tc_randomizer;
  config.cltu.correct_single_bits = settings.tc_correct_single_bits;
  for (const suite::TelecommandChannel& entry : settings.channels) {
    const auto vc = static_cast<std::uint8_t>(entry.virtual_channel);
    auto channel = std::find_if(config.channels.begin(), config.channels.end(),
                                [&](const UplinkChannel& c) { return c.vc == vc; });
    if (channel == config.channels.end()) {
      config.channels.push_back(UplinkChannel{.vc = vc, .associations = {}});
      channel = config.channels.end() - 1;
    }
    if (entry.security == suite::ChannelSecurity::none) continue;
    const auto spi = static_cast<std::uint16_t>(entry.spi);
    // One that was replaced in flight needs no file as long as a copy of the session keys can be read.
    const auto use = session_keys.use_of(spi);
    const auto* current = use ? session_keys.find(use->current) : nullptr;
    auto key = current != nullptr ? Result<wire::SdlsKey, std::string>(current->octets.key())
                                  : read_key(root / entry.key_file, on_hardware_line(deployment, root));
    if (!key) {
      unusable_keys.push_back({.spi = spi, .vc = vc, .why = key.error()});
      continue;
    }
    // One association of a set carries both frame types; of two the first is for BD, the second for AD.
    const auto same_set = [&](const suite::TelecommandChannel& other) {
      return other.security == suite::ChannelSecurity::sdls && other.set == entry.set &&
             other.virtual_channel == entry.virtual_channel;
    };
    const auto first = std::find_if(settings.channels.begin(), settings.channels.end(), same_set);
    const bool alone = std::count_if(settings.channels.begin(), settings.channels.end(), same_set) == 1;
    channel->associations.push_back(UplinkAssociation{.spi = spi,
                                                      .key = std::move(*key),
                                                      .for_ad = alone || first->spi != entry.spi,
                                                      .for_bd = alone || first->spi == entry.spi,
                                                      .set = to_key_set(entry.set)});
  }
  // A channel whose keys are all gone must not turn into one without security.
  for (const TtcCore::UnusableKey& unusable : unusable_keys) {
    const bool closed = std::any_of(config.channels.begin(), config.channels.end(), [&](const auto& channel) {
      return channel.vc == unusable.vc && channel.associations.empty();
    });
    if (closed) return Err(unusable.why);
  }
  if (config.channels.empty())
    return Err(fmt::format("{}: 'link.tc_channels': expected one at least", deployment.file.string()));
  if (const auto shared = associations_with_one_key(config)) {
    const auto key_of = [&settings](int spi) {
      const auto entry = std::find_if(settings.channels.begin(), settings.channels.end(),
                                      [spi](const suite::TelecommandChannel& c) { return c.spi == spi; });
      return fmt::format("{} (SPI {})", entry->key_file, spi);
    };
    return Err(fmt::format(
        "{}: 'link.tc_channels': expected another key for each SPI, found the same one in {} and {}",
        deployment.file.string(), key_of(shared->first), key_of(shared->second)));
  }
  return config;
}

/// What frames are sealed with. Without its key telemetry goes down all the same, and the event says why the
/// ground cannot verify it.
std::optional<wire::TmSeal> read_seal(const suite::Deployment& deployment, const std::filesystem::path& root,
                                      const UplinkConfig& uplink,
                                      std::vector<TtcCore::UnusableKey>& unusable_keys) {
  const auto& security = deployment.link.tm_security;
  if (!security) return std::nullopt;
  wire::TmSeal seal{.spi = static_cast<std::uint16_t>(security->spi), .authenticator = {}};
  auto key = read_key(root / security->key_file, on_hardware_line(deployment, root));
  if (key && is_key_of(uplink, *key))
    key = Err(fmt::format("{}: a telecommand channel has this key, too", security->key_file));
  if (key) seal.authenticator = wire::TmAuthenticator::create(std::move(*key));
  if (!seal.authenticator)
    unusable_keys.push_back({.spi = seal.spi, .vc = 0, .why = key ? "the cipher failed" : key.error()});
  return seal;
}

Result<DownlinkConfig, std::string> read_downlink(const suite::Deployment& deployment) {
  const suite::LinkSettings& settings = deployment.link;
  DownlinkConfig config;
  config.spacecraft_id = static_cast<std::uint16_t>(settings.spacecraft_id);
  config.baud = static_cast<std::uint32_t>(settings.baud);
  config.cadu = {.frame_octets = static_cast<std::size_t>(settings.tm_frame_length),
                 .reed_solomon = settings.tm_reed_solomon,
                 .interleave = static_cast<unsigned>(settings.tm_interleave),
                 .randomize = settings.tm_randomizer};
  config.continuous = settings.tm_continuous;
  config.files_queue_octets =
      std::clamp<std::size_t>(config.baud / 10 * static_cast<std::size_t>(files_queue_time.count()) / 1000,
                              files_queue_octets_min, config.files_queue_octets);
  const bool fits = config.cadu.frame_octets >= wire::tm_frame_octets_min &&
                    config.cadu.frame_octets <= wire::tm_frame_octets_max && wire::is_valid(config.cadu);
  if (!fits) {
    return Err(fmt::format("{}: 'link.tm': frame_length {} does not fit reed_solomon and interleave {}",
                           deployment.file.string(), settings.tm_frame_length, settings.tm_interleave));
  }
  return config;
}

MissionMode initial_mode(const std::string& text, const std::filesystem::path& deployment) {
  if (text == "safe") return MissionMode::safe;
  if (text == "nominal") return MissionMode::nominal;
  throw ConfigError(fmt::format("{}: ttc parameter 'initial_mode': expected safe or nominal, found '{}'",
                                deployment.string(), text));
}

/// The boot record, used until timing reports more: timing may be writing the record of this boot right now.
BootTold load_boot(const suite::VarPaths& var) {
  const auto record = suite::BootStore(var.boot()).load().state;
  if (!record) return {.count = 1, .cause = mission::ResetCause::unknown};
  const auto kernel = kernel_boot_id();
  const bool same = kernel && record->boot_id.substr(0, kernel->size()) == *kernel;
  if (!same) return {.count = record->count + 1, .cause = mission::ResetCause::unknown};
  return {.count = record->count, .cause = static_cast<mission::ResetCause>(record->reset_cause)};
}

/// Where the frame counters go on. @param page  is opened, if it can be
wire::TmFrameCounts open_frame_counts(const FrameCountFile& file, const suite::VarPaths& var,
                                      std::optional<FrameCountPage>& page) {
  page.reset();
  auto opened = FrameCountPage::open(var.memory() / "ttc_frame_counts", var.owner());
  if (!opened) {
    log::warn("{}: a kill of ttc makes a gap in the TM frame counters", opened.error());
    return file.load().value_or(wire::TmFrameCounts{});
  }
  page = std::move(*opened);
  if (const auto counts = page->read()) return *counts;
  const auto counts = file.load().value_or(wire::TmFrameCounts{});
  page->write(counts);
  return counts;
}

/// Where the numbers of sealed frames go on. Blocks until a reserve for the first minute is on the disk, or
/// could not be written: then nothing is reserved.
FrameNumbers open_frame_numbers(StateFile<std::uint64_t>& file, const std::optional<FrameCountPage>& page) {
  const auto found = file.load();
  const auto in_memory = page ? page->read_number() : std::nullopt;
  const UtcTime clock = system_utc_now();
  if (found.existed() && !found.state && !in_memory)
    log::error("the numbers of TM frames are lost: they go on from this computer's clock");
  FrameNumbers numbers(first_frame_number(in_memory, found.state, clock));
  const std::uint64_t reserve = numbers.wanted(std::nullopt).value();
  const auto stored = file.store(reserve);
  if (stored.durable()) {
    numbers.on_reserved(reserve);
  } else {
    log::error("{}: a reset of the computer may use numbers of TM frames again", stored.problem);
  }
  return numbers;
}

void say_how_the_link_is_secured(const suite::LinkSettings& link) {
  if (link.tm_security) log::info("TM frames: SDLS, SPI {}", link.tm_security->spi);
  for (const suite::TelecommandChannel& channel : link.channels) {
    if (channel.security == suite::ChannelSecurity::none) {
      log::warn(
          "TC VIRTUAL CHANNEL {} HAS NO SECURITY: anybody on the line can command this spacecraft. For tests "
          "only.",
          channel.virtual_channel);
    } else {
      const auto set = to_key_set(channel.set);
      log::info("TC virtual channel {}: SDLS{}, SPI {}, keys {}", channel.virtual_channel,
                link.tc_strict ? ", strict" : "", channel.spi, set ? to_text(*set) : "contingency");
    }
  }
}

}  // namespace

TtcNode::TtcNode(suite::NodeContext& context) : Node(context), added_(list_of(deployment())) {
  declare_parameter("initial_mode", std::string("safe"),
                    "Mode of a deployment that never ran: safe or nominal", true);
  declare_parameter("beacon_period_ms", std::int64_t{30000}, ros::ParameterRange{1000, 600000},
                    "Period of the beacon");
  declare_parameter("housekeeping_period_ms", std::int64_t{5000}, ros::ParameterRange{100, 600000},
                    "Period of the sample of the own link counters");
  declare_parameter("persist_deadline_ms", std::int64_t{1000}, ros::ParameterRange{10, 60000},
                    "Longest wait for the journal to be on disk; then only recovery commands run", true);
  declare_parameter("arm_window_ms", std::int64_t{30000}, ros::ParameterRange{1000, 600'000},
                    "How long a hazardous telecommand stays armed", true);
  declare_parameter("repeat_window_ms", std::int64_t{60000}, ros::ParameterRange{0, 86'400'000},
                    "The same packet on a secured channel within this time is a repeat");
  declare_parameter("command_loss_s", std::int64_t{259'200}, ros::ParameterRange{4, 2'592'000},
                    "Time without an authenticated telecommand after which the command-loss timer acts");
  declare_parameter("telecommand_lifetime_s", std::int64_t{600}, ros::ParameterRange{0, 86'400},
                    "On a strict link a telecommand older than this is refused; 0: none is");
  declare_parameter("ignored_causes", std::vector<std::string>{},
                    "Causes of the deployment's modes that change nothing");
  declare_parameter("schedule_late_max_ms", std::int64_t{60000}, ros::ParameterRange{1000, 86'400'000},
                    "A scheduled activity that is later than this is dropped", true);
  declare_parameter("uplink_quota_mib", std::int64_t{256}, ros::ParameterRange{1, 1024},
                    "Octets of all files that are coming up, together; more is refused", true);
  declare_parameter("free_floor_mib", std::int64_t{64}, ros::ParameterRange{0, 65'536},
                    "So much of the disk files that come up leave free", true);
  on_parameter_change([this](const std::string& parameter) {
    if (parameter == "repeat_window_ms" && core_)
      core_->set_repeat_window(milliseconds(get_parameter<std::int64_t>(parameter)));
    if (parameter == "telecommand_lifetime_s" && core_)
      core_->set_lifetime(seconds(get_parameter<std::int64_t>(parameter)));
    if (parameter == "ignored_causes" && core_)
      core_->set_ignored_causes(get_parameter<std::vector<std::string>>(parameter));
    if (parameter == "command_loss_s" && core_) {
      core_->set_command_loss(seconds(get_parameter<std::int64_t>(parameter)));
      advance();  // the next step may be due sooner
    }
    if ((parameter == "beacon_period_ms" || parameter == "housekeeping_period_ms") && is_active())
      start_periods();
  });
}

TtcCore::Setup TtcNode::read_setup(TtcDisk::Parts& parts, UplinkConfig channels, DownlinkConfig downlink) {
  StoredState& state = *parts.state;
  const auto parameter = [this](const char* name) { return milliseconds(get_parameter<std::int64_t>(name)); };
  const bool ran = state.ran_before(var().root / "store");
  downlink.first_counts = open_frame_counts(parts.frame_counts, var(), frame_counts_);
  if (deployment().link.tm_security)
    downlink.numbers = open_frame_numbers(parts.frame_numbers, frame_counts_);
  std::vector<TtcCore::KeyNews> key_news;
  KeySelection keys = state.load_keys(channels, key_news);
  FoundSessionKeys session_keys = state.load_session_keys(channels);
  std::vector<TtcCore::UnusableMaster> unusable_masters;
  std::vector<KeyEncryptionKey> masters = read_masters(deployment(), var().root, channels, unusable_masters);
  const MissionMode initial = initial_mode(get_parameter<std::string>("initial_mode"), deployment().file);
  TtcCore::Setup setup{
      .dictionary = added_.dictionary(),
      .node = name(),
      .journal = AcceptanceJournal(kernel_boot_id().value_or("unknown"), parameter("repeat_window_ms")),
      .uplink = std::move(channels),
      .downlink = downlink,
      .mode = state.load_mode(initial, ran),
      .transmitter = state.load_transmitter(monotonic_now()),
      .command_loss =
          state.load_command_loss(seconds(get_parameter<std::int64_t>("command_loss_s")), monotonic_now()),
      .stores = state.load_stores(),
      .monitors = state.load_table(MonitoringService::table_name),
      .event_actions = state.load_table(EventActionService::table_name),
      .keys = std::move(keys),
      .session_keys = std::move(session_keys.keys),
      .masters = std::move(masters),
      .unusable_masters = std::move(unusable_masters),
      .session_keys_lost = std::move(session_keys.lost),
      .boot = load_boot(var()),
      .step = suite::StepStore(var().boot()).read(),
      .clock = SpacecraftClock(system_utc_now(), monotonic_now()),
      .persist_deadline = parameter("persist_deadline_ms"),
      .schedule_late_max = parameter("schedule_late_max_ms"),
      .arm_window = parameter("arm_window_ms"),
      .lifetime = seconds(get_parameter<std::int64_t>("telecommand_lifetime_s")),
      .key_news = std::move(key_news),
      .remembered = remembered_,
      .lane = image_lane(),
      .modes = deployment().modes,
      .begun = monotonic_now()};
  state.load_journal(setup, ran, next_telecommand_id_, system_utc_now(), monotonic_now());
  return setup;
}

ImageLane TtcNode::image_lane() const {
  return {.acquisition = deployment().find("image_acquisition") != nullptr,
          .processing = deployment().find("image_processing") != nullptr};
}

ros::CallbackReturn TtcNode::on_configure() {
  std::vector<TtcCore::UnusableKey> unusable_keys;
  const auto session_keys =
      wire::session_key_file(wire::session_key_folder(var().root) / wire::session_keys_name).load().state;
  auto channels =
      read_channels(deployment(), var().root, session_keys.value_or(wire::SessionKeys{}), unusable_keys);
  const auto downlink = channels ? read_downlink(deployment()) : Err(channels.error());
  if (!downlink) {
    set_failure_reason(downlink.error());
    return ros::CallbackReturn::failure;
  }
  auto seal = read_seal(deployment(), var().root, *channels, unusable_keys);
  auto line =
      hw::open_serial(device("rs422"), static_cast<std::uint32_t>(deployment().link.baud), var().root);
  if (!line) {
    set_failure_reason(line.error().message);
    return ros::CallbackReturn::failure;
  }
  line_ = std::move(*line);

  added_.read_again(list_of(deployment()));  // added or removed while nothing was open
  const auto mib = [this](const char* parameter) {
    return static_cast<std::uint64_t>(get_parameter<std::int64_t>(parameter)) << 20;
  };
  TtcDisk::Parts parts{
      .state = std::make_unique<StoredState>(state_dir(), wire::session_key_folder(var().root)),
      .frame_counts = FrameCountFile(state_dir() / "frame_counts"),
      .frame_numbers = frame_number_file(state_dir() / "frame_numbers"),
      .stores = std::make_unique<PacketStores>(added_.dictionary(), var().root / "store"),
      .files = {.root = var().root / "files",
                .images = var().root / "images",
                .checkpoint = state_dir() / "cfdp",
                .uplink_quota_octets = mib("uplink_quota_mib"),
                .free_floor_octets = mib("free_floor_mib"),
                // Less than one file a second was ever sent.
                .first_transaction = [] {
                  return static_cast<std::uint32_t>(system_utc_now().ns() / 1'000'000'000);
                }}};
  TtcCore::Setup setup = read_setup(parts, std::move(*channels), *downlink);
  setup.seal = std::move(seal);
  setup.unusable_keys = std::move(unusable_keys);
  core_ = std::make_unique<TtcCore>(std::move(setup));
  core_->set_ignored_causes(get_parameter<std::vector<std::string>>("ignored_causes"));
  core_->add_reports();
  disk_ = std::make_unique<TtcDisk>(
      std::move(parts),
      TtcDisk::Workers{.journal = create_worker("ttc_journal", journal_worker_capacity),
                       .state = create_worker("ttc_state", state_worker_capacity),
                       .stores = create_worker("ttc_store", store_worker_capacity),
                       .files = create_worker("ttc_files", files_worker_capacity)},
      *core_, [this] { advance(); });
  subscribe();
  follow_added_nodes(false);
  imaging_goals_ =
      std::make_unique<ImagingGoals>(create_action_client<ImagingGoals::Capture>("/image/capture"),
                                     create_action_client<ImagingGoals::Process>("/image/process"),
                                     core_->imaging(), disk_->small_files(), var(), [this] { advance(); });
  say_how_the_link_is_secured(deployment().link);
  core_->restore(monotonic_now());
  run(core_->take_actions());
  malloc_trim(0);  // reading the dictionary took more than keeping it does
  return ros::CallbackReturn::success;
}

void TtcNode::subscribe() {
  const auto keep = [this](auto subscription) { subscriptions_.push_back(std::move(subscription)); };
  signer_.emplace(var(), deployment().open_orders, [this] {
    std::vector<std::string> names;
    for (const auto& node : deployment().nodes) names.push_back(node.name);
    return names;
  });
  telecommands_ = create_publisher(suite::topics::telecommand);
  mode_publisher_ = create_publisher(suite::topics::mode);
  keep(create_subscription(suite::topics::time_tick,
                           [this](const srfs_msgs::msg::TimeTick& m) { on_tick(m); }));
  keep(create_subscription(suite::topics::event, [this](const srfs_msgs::msg::Event& m) {
    if (!is_active()) return;
    const bool sends = core_->on_event(m.source, m.event_id, m.severity, m.data, now());
    if (core_->has_waiting_actions()) return advance();
    if (sends) pump_downlink();
  }));
  keep(create_subscription(suite::topics::telecommand_report,
                           [this](const srfs_msgs::msg::TelecommandReport& m) { on_telecommand_report(m); }));
  for (const std::string& node : core_->beacon().nodes()) {
    if (node == name()) continue;
    for (auto& subscription : listen_to(node)) keep(std::move(subscription));
  }
}

std::vector<std::shared_ptr<void>> TtcNode::listen_to(const std::string& node) {
  using lifecycle_msgs::msg::TransitionEvent;
  return {create_subscription(suite::topics::telemetry(node),
                              [this, node](const srfs_msgs::msg::PayloadTelemetry& m) {
                                if (m.source == node) on_telemetry(m);
                              }),
          create_subscription(ros::Topic<TransitionEvent>{"/" + node + "/transition_event", {}},
                              [this, node](const TransitionEvent& m) {
                                on_node_state(node, m.goal_state.id);
                                added_.on_lifecycle(node, m.goal_state.id);
                              })};
}

void TtcNode::watch_line() {
  line_watch_ = watch_fd(
      line_->fd(), EPOLLIN,
      [this](std::uint32_t) {
        read_line();
        advance();
      },
      "rs422");
}

void TtcNode::start_periods() {
  housekeeping_timer_ = create_timer(
      milliseconds(get_parameter<std::int64_t>("housekeeping_period_ms")),
      [this] { send_own_housekeeping(); }, "housekeeping");
  beacon_timer_ = create_timer(
      core_->reaction().beacon_period.value_or(milliseconds(get_parameter<std::int64_t>("beacon_period_ms"))),
      [this] { send_beacon(); }, "beacon");
}

ros::CallbackReturn TtcNode::on_activate() {
  added_.report_refused();
  added_.report_problems(deployment().added_problems);
  raise_added_events();
  watch_line();
  const auto every = [this](nanoseconds period, std::string_view what, auto work) {
    const auto run_it = [this, work] {
      work();
      advance();
    };
    timers_.push_back(create_timer(period, run_it, what));
  };
  every(seconds(1), "commit stores", [this] { core_->commit_stores(outgoing_.empty(), monotonic_now()); });
  every(ModeManager::publish_period, "mode", [this] { core_->publish_mode(); });
  every(seconds(30), "health", [this] { core_->send_health(now()); });
  every(seconds(30), "files housekeeping", [this] { core_->send_files_housekeeping(now()); });
  every(seconds(30), "schedule housekeeping", [this] { core_->send_schedule_housekeeping(now()); });
  every(seconds(30), "imaging housekeeping", [this] { core_->send_imaging_housekeeping(now()); });
  every(seconds(30), "monitoring housekeeping", [this] { core_->send_monitoring_housekeeping(now()); });
  every(link_state_copy_period, "copy link state", [this] {
    core_->copy_link_state();
    core_->store_open_progress();
  });
  start_periods();
  // The first beacon does not wait for its period: an operator who listens wants to know that the spacecraft
  // is up.
  timers_.push_back(create_one_shot(
      monotonic_now() + seconds(6), [this] { send_beacon(); }, "beacon"));
  timers_.push_back(create_timer(
      seconds(2), [this] { imaging_goals_->look_at_nodes(); }, "look at imaging nodes"));
  timers_.push_back(create_timer(
      seconds(1), [this] { signer_->keep_keys(); }, "keys of orders"));
  timers_.push_back(create_timer(
      seconds(5), [this] { look_at_nodes(); }, "look at nodes"));
  look_at_nodes();
  core_->activate(monotonic_now());
  advance();
  return ros::CallbackReturn::success;
}

ros::CallbackReturn TtcNode::on_deactivate() {
  wake_up_.reset();
  wake_up_at_.reset();
  timers_.clear();
  housekeeping_timer_.reset();
  beacon_timer_.reset();
  line_watch_.reset();
  if (disk_) disk_->store_rest();
  return ros::CallbackReturn::success;
}

ros::CallbackReturn TtcNode::on_cleanup() {
  subscriptions_.clear();
  state_clients_.clear();
  connection_clients_.clear();
  get_clients_.clear();
  set_clients_.clear();
  restart_client_.reset();
  // Nothing that was accepted or collected is lost by an orderly end.
  if (disk_) {
    disk_->drain_journal();
    core_->flush_journal(monotonic_now());
    run(core_->take_actions());
    disk_->drain_journal();
    core_->copy_link_state();
    core_->store_open_progress();
    run(core_->take_actions());
    disk_->close();
  }
  disk_.reset();
  imaging_goals_.reset();  // its worker is gone
  telecommands_.reset();
  mode_publisher_.reset();
  added_.forget();  // a dictionary that was on its way may have met them again
  added_subscriptions_.clear();
  line_.reset();
  if (core_) {
    next_telecommand_id_ = core_->journal().next_id();
    remembered_ = core_->remembered();
  }
  core_.reset();
  actions_.clear();
  outgoing_.clear();
  return ros::CallbackReturn::success;
}

ros::CallbackReturn TtcNode::on_shutdown() {
  if (core_) {
    on_deactivate();
    on_cleanup();
  }
  return ros::CallbackReturn::success;
}

ros::CallbackReturn TtcNode::on_error() {
  return on_shutdown();
}

}  // namespace srfs
