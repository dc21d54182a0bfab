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
#include "base/saturate.hpp"
#include "nodes/ttc/ttc_node.hpp"
#include "ros/boot_store.hpp"

namespace srfs {
namespace {

/// There while the counters of the uplink have no floor yet.
constexpr const char* wanted_floor_file = "counters_lost";
constexpr std::string_view first_start_text = "first start\n";  ///< in it; else counters were lost
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

KeySet to_key_set(ros::AssociationSet set) {
  switch (set) {
    case ros::AssociationSet::b:
      return KeySet::b;
    case ros::AssociationSet::contingency:
      return KeySet::contingency;
    case ros::AssociationSet::a:
      break;
  }
  return KeySet::a;
}

AvailableKeySets key_sets_of(const UplinkConfig& config) {
  AvailableKeySets sets;
  for (const UplinkChannel& channel : config.channels) {
    for (const UplinkAssociation& association : channel.associations)
      sets.emplace_back(channel.vc, association.set);
  }
  return sets;
}

}  // namespace

TtcNode::Link::Link(const mission::Dictionary& dictionary, AcceptanceJournal restored,
                    UplinkConfig uplink_config, DownlinkConfig downlink_config, ModeManager mode_manager,
                    TransmitterSwitch transmitter_switch, std::string_view stored_stores,
                    milliseconds persist_deadline, milliseconds schedule_late_max, milliseconds arm_window,
                    SpacecraftClock start, const std::string& own_name)
    : journal(std::move(restored)),
      mode(std::move(mode_manager)),
      transmitter(std::move(transmitter_switch)),
      hazards(arm_window),
      key_sets(key_sets_of(uplink_config)),
      forwarder(report_queue),
      housekeeping(report_queue),
      events(report_queue),
      mode_service(mode, hazards, report_queue),
      arming(dictionary, mode, hazards, report_queue),
      key_service(key_sets, report_queue),
      transmitter_service(transmitter, report_queue),
      time_reports(report_queue),
      schedule(journal, report_queue, schedule_late_max),
      retrieval(report_queue),
      stores(dictionary, stored_stores, report_queue, retrieval),
      connections(dictionary, own_name, report_queue),
      parameters(dictionary, report_queue, mission::apid::ttc),
      file_service(report_queue, mission::apid::ttc),
      imaging(report_queue),
      router({.dictionary = dictionary,
              .mode = mode,
              .hazards = hazards,
              .forwarder = forwarder,
              .report_queue = report_queue,
              .services = {&housekeeping, &events, &mode_service, &arming, &key_service, &transmitter_service,
                           &time_reports, &schedule, &retrieval, &stores, &connections, &parameters,
                           &file_service, &imaging}},
             own_name),
      uplink(std::move(uplink_config), journal.link()),
      gate(persist_deadline, journal.revision()),
      downlink(downlink_config),
      files(downlink_config.files_queue_octets / 2),
      beacon(dictionary),
      clock(start) {
  schedule.set_request_check([this](OctetView packet) { return router.check_scheduled(packet); });
}

TtcNode::TtcNode(ros::NodeContext& context)
    : LifecycleNode(context),
      dictionary_(mission::Dictionary::load_fitting(mission::Dictionary::default_folder(), fragments(),
                                                    refused_fragments_)),
      dictionary_revision_(deployment().added_revision) {
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
  declare_parameter("schedule_late_max_ms", std::int64_t{60000}, ros::ParameterRange{1000, 86'400'000},
                    "A scheduled activity that is later than this is dropped", true);
  declare_parameter("uplink_quota_mib", std::int64_t{256}, ros::ParameterRange{1, 1024},
                    "Octets of all files that are coming up, together; more is refused", true);
  declare_parameter("free_floor_mib", std::int64_t{64}, ros::ParameterRange{0, 65'536},
                    "So much of the disk files that come up leave free", true);
  on_parameter_change([this](const std::string& parameter) { on_parameter_changed(parameter); });
}

void TtcNode::on_parameter_changed(const std::string& parameter) {
  if (parameter == "repeat_window_ms" && link_)
    link_->journal.set_repeat_window(milliseconds(get_parameter<std::int64_t>(parameter)));
  if ((parameter == "beacon_period_ms" || parameter == "housekeeping_period_ms") && is_active())
    start_periods();
}

Result<wire::SdlsKey, std::string> TtcNode::read_key(const std::string& file) const {
  const std::filesystem::path path = var().root / file;
  if (const auto problem = permission_problem(path)) return Err(*problem);
  auto text = read_file(path, 4096);
  if (!text) return Err(text.error().message);
  while (!text->empty() && (text->back() == '\n' || text->back() == '\r')) text->pop_back();
  auto key = wire::SdlsKey::from_hex(*text);
  std::fill(text->begin(), text->end(), '\0');
  if (!key) return Err(fmt::format("{}: expected 64 hexadecimal digits", path.string()));
  // Left out, and no more: see ros::unsafe_link().
  const auto known = why_known(key->octets());
  if (known && ros::is_hardware_line(device("rs422"), var().root))
    return Err(fmt::format("{}: not used, everybody may know this key: {}", path.string(), *known));
  return std::move(*key);
}

Result<UplinkConfig, std::string> TtcNode::read_channels() {
  const ros::LinkSettings& settings = deployment().link;
  if (auto unsafe = ros::unsafe_link(deployment(), var().root); !unsafe.empty())
    return Err(std::move(unsafe));
  UplinkConfig config;
  config.spacecraft_id = static_cast<std::uint16_t>(settings.spacecraft_id);
  config.cltu.randomized = settings.tc_randomizer;
  config.cltu.correct_single_bits = settings.tc_correct_single_bits;
  unusable_keys_.clear();
  for (const ros::TelecommandChannel& entry : settings.channels) {
    const auto vc = static_cast<std::uint8_t>(entry.virtual_channel);
    auto channel = std::find_if(config.channels.begin(), config.channels.end(),
                                [&](const UplinkChannel& c) { return c.vc == vc; });
    if (channel == config.channels.end()) {
      config.channels.push_back(UplinkChannel{.vc = vc, .associations = {}});
      channel = config.channels.end() - 1;
    }
    if (entry.security == ros::ChannelSecurity::none) continue;
    auto key = read_key(entry.key_file);
    const auto spi = static_cast<std::uint16_t>(entry.spi);
    if (!key) {
      unusable_keys_.push_back({.spi = spi, .vc = vc, .why = key.error()});
      continue;
    }
    // One association of a set carries both frame types; of two the first is for BD, the second for AD.
    const auto same_set = [&](const ros::TelecommandChannel& other) {
      return other.security == ros::ChannelSecurity::sdls && other.set == entry.set &&
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
  for (const UnusableKey& unusable : unusable_keys_) {
    const bool closed = std::any_of(config.channels.begin(), config.channels.end(), [&](const auto& channel) {
      return channel.vc == unusable.vc && channel.associations.empty();
    });
    if (closed) return Err(unusable.why);
  }
  if (config.channels.empty())
    return Err(fmt::format("{}: 'link.tc_channels': expected one at least", deployment().file.string()));
  if (const auto shared = associations_with_one_key(config)) {
    const auto key_of = [&settings](int spi) {
      const auto entry = std::find_if(settings.channels.begin(), settings.channels.end(),
                                      [spi](const ros::TelecommandChannel& c) { return c.spi == spi; });
      return fmt::format("{} (SPI {})", entry->key_file, spi);
    };
    return Err(fmt::format(
        "{}: 'link.tc_channels': expected another key for each SPI, found the same one in {} and {}",
        deployment().file.string(), key_of(shared->first), key_of(shared->second)));
  }
  return config;
}

Result<DownlinkConfig, std::string> TtcNode::read_downlink() const {
  const ros::LinkSettings& settings = deployment().link;
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
                           deployment().file.string(), settings.tm_frame_length, settings.tm_interleave));
  }
  return config;
}

wire::TmFrameCounts TtcNode::open_frame_counts() {
  frame_counts_.reset();
  frame_count_reserve_ = {};
  frame_count_file_ = std::make_shared<FrameCountFile>(state_dir() / "frame_counts");
  auto page = FrameCountPage::open(var().memory() / "ttc_frame_counts", var().owner());
  if (!page) {
    log::warn("{}: a kill of ttc makes a gap in the TM frame counters", page.error());
    return frame_count_file_->load().value_or(wire::TmFrameCounts{});
  }
  frame_counts_ = std::move(*page);
  if (const auto counts = frame_counts_->read()) return *counts;
  const auto counts = frame_count_file_->load().value_or(wire::TmFrameCounts{});
  frame_counts_->write(counts);
  return counts;
}

bool TtcNode::ran_before() const {
  std::error_code ec;
  if (std::filesystem::exists(state_dir() / "link_state", ec) ||
      std::filesystem::exists(state_dir() / "mode", ec))
    return true;
  // Its own state may be lost and the packets it stored not.
  const auto stored = std::filesystem::directory_iterator(var().root / "store", ec);
  return !ec && std::any_of(begin(stored), end(stored), [](const auto& store) {
    std::error_code none;
    return store.is_directory(none) && !std::filesystem::is_empty(store.path(), none);
  });
}

ModeManager TtcNode::load_mode(bool ran) {
  const auto initial = get_parameter<std::string>("initial_mode");
  if (initial != "safe" && initial != "nominal") {
    throw ConfigError(fmt::format("{}: ttc parameter 'initial_mode': expected safe or nominal, found '{}'",
                                  deployment().file.string(), initial));
  }
  const auto stored = read_file(state_dir() / "mode", 256);
  const StoredModeState state = stored ? StoredModeState::present
                                : ran  ? StoredModeState::missing
                                       : StoredModeState::first_start;
  ModeManager manager(state, stored.value_or(""),
                      initial == "nominal" ? MissionMode::nominal : MissionMode::safe);
  if (const auto written = write_file_atomically(state_dir() / "mode", manager.stored_text()); !written) {
    log::error("the mode is not durable: {}", written.error().message);
  }
  log::info("mode {}: {}", manager.mode() == MissionMode::nominal ? "nominal" : "safe", manager.reason());
  return manager;
}

TransmitterSwitch TtcNode::load_transmitter() const {
  const auto stored = read_file(state_dir() / "transmitter", 256);
  const MonotonicTime at = monotonic_now();
  TransmitterSwitch transmitter(kernel_boot_id().value_or("unknown"), stored.value_or(""), at);
  if (!transmitter.may_transmit(at))
    log::warn("the transmitter stays off for {} s", transmitter.rest(at) / seconds(1));
  // A silence that begins anew with this boot must not do so with the next.
  if (const auto written = write_file_atomically(state_dir() / "transmitter", transmitter.stored_text());
      !written)
    log::error("the state of the transmitter is not durable: {}", written.error().message);
  return transmitter;
}

/// The boot record, used until timing reports more: timing may be writing the record of this boot right now.
BootTold TtcNode::load_boot() const {
  const auto record = ros::BootStore(var().boot()).load();
  if (!record) return {.count = 1, .cause = mission::ResetCause::unknown};
  const auto kernel = kernel_boot_id();
  const bool same = kernel && record->boot_id.substr(0, kernel->size()) == *kernel;
  if (!same) return {.count = record->count + 1, .cause = mission::ResetCause::unknown};
  return {.count = record->count, .cause = static_cast<mission::ResetCause>(record->reset_cause)};
}

ros::CallbackReturn TtcNode::on_configure() {
  auto channels = read_channels();
  auto downlink = channels ? read_downlink() : Err(channels.error());
  if (!downlink) {
    set_failure_reason(downlink.error());
    return ros::CallbackReturn::failure;
  }
  auto line =
      hw::open_serial(device("rs422"), static_cast<std::uint32_t>(deployment().link.baud), var().root);
  if (!line) {
    set_failure_reason(line.error().message);
    return ros::CallbackReturn::failure;
  }
  line_ = std::move(*line);

  if (dictionary_revision_ != deployment().added_revision) {  // added or removed while nothing was open
    dictionary_revision_ = deployment().added_revision;
    dictionary_ = mission::Dictionary::load_fitting(mission::Dictionary::default_folder(), fragments(),
                                                    refused_fragments_);
  }
  const bool ran = ran_before();
  downlink->first_counts = open_frame_counts();
  load_key_selection(*channels);
  AcceptanceJournal journal = load_journal(ran);
  link_ = std::make_unique<Link>(dictionary_, std::move(journal), std::move(*channels), *downlink,
                                 load_mode(ran), load_transmitter(), load_stores(),
                                 milliseconds(get_parameter<std::int64_t>("persist_deadline_ms")),
                                 milliseconds(get_parameter<std::int64_t>("schedule_late_max_ms")),
                                 milliseconds(get_parameter<std::int64_t>("arm_window_ms")),
                                 SpacecraftClock(system_utc_now(), monotonic_now()), name());
  boot_ = load_boot();
  fill_from_dictionary();
  stores_ = std::make_shared<PacketStores>(dictionary_, var().root / "store");
  journal_worker_ = create_worker("ttc_journal", journal_worker_capacity);
  state_worker_ = create_worker("ttc_state", state_worker_capacity);
  store_worker_ = create_worker("ttc_store", store_worker_capacity);
  store_worker_->post([stores = stores_, file = frame_count_file_,
                       counts = frame_count_reserve_.wanted(link_->downlink.frame_counts()).value()] {
    (void)file->store(counts);  // the first commit writes them again, and says what fails
    stores->open();
  });
  files_ = std::make_shared<Files>();
  files_->root = var().root / "files";
  files_->checkpoint = state_dir() / "cfdp";
  const auto mib = [this](const char* parameter) {
    return static_cast<std::uint64_t>(get_parameter<std::int64_t>(parameter)) << 20;
  };
  files_->uplink_quota_octets = mib("uplink_quota_mib");
  files_->free_floor_octets = mib("free_floor_mib");
  files_->manager.emplace(files_->root);
  files_->images.emplace(var().root / "images", files_->root);
  files_worker_ = create_worker("ttc_files", files_worker_capacity);
  files_status_ = {};
  subscribe();
  meet_added_nodes(false);
  connect_imaging();
  say_how_the_link_is_secured();
  restore_telecommands();
  malloc_trim(0);  // reading the dictionary took more than keeping it does
  return ros::CallbackReturn::success;
}

AcceptanceJournal TtcNode::load_journal(bool ran) {
  AcceptanceJournal journal(kernel_boot_id().value_or("unknown"),
                            milliseconds(get_parameter<std::int64_t>("repeat_window_ms")));
  journal_file_ = std::make_shared<JournalOnDisk>(state_dir() / "telecommands");
  JournalLog::Found found = journal_file_->log.load();
  journal_damaged_octets_ = found.damaged_octets;
  for (const JournalRecord& record : found.records) {
    if (!journal.apply(record)) journal_damaged_octets_ += record.payload.size() + journal_record_overhead;
  }
  link_file_ = std::make_shared<LinkStateFile>(state_dir() / "link_state");
  const LinkStateFile::Found copy = link_file_->load();
  const bool lost = found.existed && !journal.has_state() && journal.link().generation == 0;
  journal_damage_ = !lost                        ? journal_damaged_octets_ > 0 ? "the rest is read" : ""
                    : copy.state.generation != 0 ? "telecommands lost, counters from their copy"
                                                 : "telecommands and counters lost";
  if (!journal_damage_.empty()) {
    log::error("the journal of telecommands is damaged, {} octets skipped: {}", journal_damaged_octets_,
               journal_damage_);
  }
  copied_generation_ = copy.state.generation;
  journal.begin(copy.state,
                first_telecommand_id(copy.state.next_telecommand_id, next_telecommand_id_, system_utc_now()),
                monotonic_now());
  const bool nothing = !journal.has_state() && journal.link().generation == 0;
  note_missing_counters(nothing, ran || found.existed);
  // A first start that is killed from here on has left a journal, and is none any more.
  if (nothing) {
    const JournalBatch batch = journal.take_batch(true);
    const auto written = journal_file_->log.snapshot(*batch.snapshot);
    journal.on_written(batch, written.has_value(), journal_file_->log.used_octets());
  }
  return journal;
}

/// A first start looks like the loss of everything that ttc wrote: it wants a floor, too.
void TtcNode::note_missing_counters(bool nothing, bool ran) {
  const auto marker = state_dir() / wanted_floor_file;
  first_start_ = nothing && !ran;
  const auto noted = read_file(marker, 64);
  const bool lost = (nothing && ran) || (noted && *noted != first_start_text);
  if (!nothing && !noted) {
    floor_wanted_ = FloorWanted::no;
    return;
  }
  floor_wanted_ = lost ? FloorWanted::counters_lost : FloorWanted::first_start;
  if (lost) log::error("the counters of the uplink are lost: any is taken until the time is valid");
  if (const auto written = write_file_atomically(marker, lost ? "" : first_start_text); !written)
    log::error("that the counters want a floor is not durable: {}", written.error().message);
}

void TtcNode::report_counters(std::uint64_t floor, const std::string& why) {
  mission::TtcCountersLostEvent event;
  event.floor = floor;
  event.why = why;
  send_event(event);
}

/// The first valid time came. At a first start a ground station that was heard and counts no clock goes on
/// with its counters: it would be locked out in the middle of its work.
void TtcNode::raise_counters() {
  const bool lost = std::exchange(floor_wanted_, FloorWanted::no) == FloorWanted::counters_lost;
  const LinkState& state = link_->uplink.state();
  const std::uint64_t before = state.generation;
  const std::uint64_t floor = lost_counter_floor(link_->clock.utc_at(monotonic_now()));
  const bool counts_no_clock =
      std::any_of(state.associations.begin(), state.associations.end(),
                  [](const LinkState::Association& a) { return a.counter < lowest_clock_counter; });
  if (lost || !counts_no_clock) link_->uplink.raise_counters(floor);
  raised_generation_ = state.generation;
  if (state.generation == before) forget_wanted_floor();  // nothing to write
  if (lost) {
    log::warn("uplink counters that were lost go on behind {}", floor);
    report_counters(floor, "time is valid");
  } else if (!counts_no_clock) {
    log::info("the counters of the uplink begin behind {}", floor);
  } else {
    log::info("the ground station counts no clock: the counters of the uplink get no floor");
  }
}

/// The floor is on disk.
void TtcNode::forget_wanted_floor() {
  raised_generation_.reset();
  state_worker_->post([marker = state_dir() / wanted_floor_file] {
    std::error_code ec;
    std::filesystem::remove(marker, ec);
    if (ec) log::error("{}: cannot be removed: {}", marker.string(), ec.message());
  });
}

/// What was accepted and has not ended goes on; what may not have reached the ground is reported again.
void TtcNode::restore_telecommands() {
  AcceptanceJournal& journal = link_->journal;
  journal.tell_refused_again(link_->report_queue);
  for (const AcceptedTelecommand* t : journal.known()) {
    AcceptanceJournal::tell_again(*t, journal.told(), link_->report_queue);
    if (t->end) continue;
    link_->router.restore({.origin = t->origin,
                           .packet = t->packet,
                           .expiry = t->expiry,
                           .progress = {.taken = t->taken,
                                        .started = t->started,
                                        .last_step = t->last_step,
                                        .other_boot = t->other_boot}},
                          monotonic_now());
  }
  if (journal.open() > 0) log::info("{} accepted telecommands go on", journal.open());
}

void TtcNode::fill_from_dictionary() {
  for (const mission::Structure& structure : dictionary_.structures()) {
    if (structure.kind == mission::StructureKind::housekeeping && structure.id != 0) add_structure(structure);
  }
  for (const mission::Event& event : dictionary_.events()) link_->events.add_event(event.id);
  link_->events.add_essential_event(mission::event::ttc_retrieval_done);
}

void TtcNode::subscribe() {
  const auto keep = [this](auto subscription) { subscriptions_.push_back(std::move(subscription)); };
  telecommands_ = create_publisher(ros::topics::telecommand);
  mode_publisher_ = create_publisher(ros::topics::mode);
  keep(
      create_subscription(ros::topics::time_tick, [this](const srfs_msgs::msg::TimeTick& m) { on_tick(m); }));
  keep(create_subscription(ros::topics::event,
                           [this](const srfs_msgs::msg::Event& m) { on_event_message(m); }));
  keep(create_subscription(ros::topics::telecommand_report,
                           [this](const srfs_msgs::msg::TelecommandReport& m) { on_telecommand_report(m); }));
  for (const std::string& node : link_->beacon.nodes()) {
    if (node == name()) continue;
    keep(create_subscription(ros::topics::telemetry(node),
                             [this, node](const srfs_msgs::msg::PayloadTelemetry& m) {
                               if (m.source == node) on_telemetry(m);
                             }));
    keep(create_subscription(
        ros::Topic<lifecycle_msgs::msg::TransitionEvent>{"/" + node + "/transition_event", {}},
        [this, node](const lifecycle_msgs::msg::TransitionEvent& m) {
          link_->beacon.on_lifecycle(node, m.goal_state.id);
        }));
  }
}

void TtcNode::say_how_the_link_is_secured() const {
  for (const ros::TelecommandChannel& channel : deployment().link.channels) {
    if (channel.security == ros::ChannelSecurity::none) {
      log::warn(
          "TC VIRTUAL CHANNEL {} HAS NO SECURITY: anybody on the line can command this spacecraft. For tests "
          "only.",
          channel.virtual_channel);
    } else {
      log::info("TC virtual channel {}: SDLS, SPI {}, keys {}", channel.virtual_channel, channel.spi,
                to_text(to_key_set(channel.set)));
    }
  }
}

void TtcNode::start_periods() {
  housekeeping_timer_ = create_timer(
      milliseconds(get_parameter<std::int64_t>("housekeeping_period_ms")),
      [this] { send_own_housekeeping(); }, "housekeeping");
  beacon_timer_ = create_timer(
      milliseconds(get_parameter<std::int64_t>("beacon_period_ms")), [this] { send_beacon(); }, "beacon");
}

ros::CallbackReturn TtcNode::on_activate() {
  report_refused_fragments();
  report_added_problems();
  line_watch_ = watch_fd(
      line_->fd(), EPOLLIN,
      [this](std::uint32_t) {
        read_line();
        settle();
      },
      "rs422");
  timers_.push_back(create_timer(
      seconds(1), [this] { commit_stores(); }, "commit stores"));
  timers_.push_back(create_timer(
      ModeManager::publish_period, [this] { publish_mode(); }, "mode"));
  start_periods();
  // The first beacon does not wait for its period: an operator who listens wants to know that the spacecraft
  // is up.
  timers_.push_back(create_one_shot(
      monotonic_now() + seconds(6), [this] { send_beacon(); }, "beacon"));
  timers_.push_back(create_timer(
      seconds(30), [this] { send_files_housekeeping(); }, "files housekeeping"));
  timers_.push_back(create_timer(
      seconds(30), [this] { send_schedule_housekeeping(); }, "schedule housekeeping"));
  timers_.push_back(create_timer(
      seconds(30), [this] { send_imaging_housekeeping(); }, "imaging housekeeping"));
  timers_.push_back(create_timer(
      seconds(2), [this] { look_at_imaging_nodes(); }, "look at imaging nodes"));
  timers_.push_back(create_timer(
      seconds(5), [this] { look_at_nodes(); }, "look at nodes"));
  timers_.push_back(create_timer(
      link_state_copy_period,
      [this] {
        copy_link_state();
        store_open_progress();
      },
      "copy link state"));
  look_at_nodes();
  publish_mode();
  if (!journal_damage_.empty()) {
    mission::TtcJournalDamagedEvent event;
    event.skipped = as_u32(journal_damaged_octets_);
    event.what = std::exchange(journal_damage_, {});
    send_event(event);
  }
  if (first_start_) {
    mission::TtcFirstStartEvent event;
    event.boot_count = boot_.count;
    send_event(event);
    first_start_ = false;
  }
  if (floor_wanted_ == FloorWanted::counters_lost) report_counters(0, "any is taken until the time is valid");
  report_keys_at_start();
  settle();
  return ros::CallbackReturn::success;
}

ros::CallbackReturn TtcNode::on_deactivate() {
  wake_up_.reset();
  wake_up_at_.reset();
  timers_.clear();
  housekeeping_timer_.reset();
  beacon_timer_.reset();
  line_watch_.reset();
  if (!to_store_.empty()) {
    store_worker_->post([stores = stores_, items = std::exchange(to_store_, {})] {
      for (const StoreItem& item : items) stores->append(item);
      stores->commit();
    });
  }
  return ros::CallbackReturn::success;
}

ros::CallbackReturn TtcNode::on_cleanup() {
  subscriptions_.clear();
  disconnect_imaging();
  state_clients_.clear();
  connection_clients_.clear();
  get_clients_.clear();
  set_clients_.clear();
  telecommands_.reset();
  mode_publisher_.reset();
  // Nothing that was accepted or collected is lost by an orderly end.
  if (link_ && journal_worker_) {
    record_progress();
    journal_worker_->drain();
    persist_journal(true);
    journal_worker_->drain();
    copy_link_state();
    store_open_progress();
    // No more is sent: the next start goes on exactly there.
    store_worker_->post([file = frame_count_file_, counts = link_->downlink.frame_counts()] {
      if (const auto stored = file->store(counts); !stored) log::warn("{}", stored.error().message);
    });
  }
  if (state_worker_) state_worker_->drain();
  if (store_worker_) store_worker_->drain();
  journal_worker_.reset();
  if (files_worker_) files_worker_->drain();
  files_worker_.reset();
  files_.reset();
  state_worker_.reset();
  joined_nodes_.clear();  // a dictionary that was on its way may have met them again
  store_worker_.reset();
  stores_.reset();
  journal_file_.reset();
  link_file_.reset();
  line_.reset();
  if (link_) next_telecommand_id_ = link_->journal.next_id();
  link_.reset();
  outgoing_.clear();
  commit_running_ = false;
  return ros::CallbackReturn::success;
}

ros::CallbackReturn TtcNode::on_shutdown() {
  if (link_) {
    on_deactivate();
    on_cleanup();
  }
  return ros::CallbackReturn::success;
}

ros::CallbackReturn TtcNode::on_error() {
  return on_shutdown();
}

}  // namespace srfs
