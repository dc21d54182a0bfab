// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/rescue/rescuer.hpp"

#include <algorithm>
#include <array>
#include <exception>

#include <fmt/format.h>
#include <poll.h>

#include "base/file.hpp"
#include "base/log.hpp"
#include "base/process.hpp"
#include "base/text.hpp"
#include "hw/open.hpp"

namespace srfs::rescue {
namespace {

constexpr std::uint16_t own_apid = mission::TtcSelectKeys::apid;
constexpr std::uint8_t housekeeping_service = 3;
constexpr std::uint8_t housekeeping_report = 25;
constexpr std::uint8_t pong = 2;  // of service 17
constexpr seconds beacon_period{30};
constexpr milliseconds longest_sleep{250};
constexpr milliseconds line_full_sleep{2};
constexpr seconds last_words{3};  // for the report of an order that ends this
constexpr std::uint64_t cfdp_ground = 1;
constexpr std::uint64_t cfdp_spacecraft = 2;
constexpr std::uint64_t uplink_quota_octets = 256U << 20;
constexpr std::uint64_t free_floor_octets = 1U << 20;
constexpr std::size_t files_queue_octets = 32U << 10;

Octets key_in_use(const std::string& file, const Octets& otherwise) {
  auto text = read_file(file, 4096);
  if (!text) return otherwise;
  while (!text->empty() && (text->back() == '\n' || text->back() == '\r')) text->pop_back();
  auto key = from_hex(*text);
  return key && key->size() == otherwise.size() ? *key : otherwise;
}

/// The key in use, where its file has one; else the one the settings were made with. Of the contingency
/// association always that: it is for the case that files are lost.
Octets key_of(const suite::RescueSettings::Association& association) {
  return association.set == 'c' ? association.key : key_in_use(association.key_file, association.key);
}

/// Always under the key of the settings, which have a digest. In a key file, a rotten digit makes another
/// key, and the ground, which has one key for telemetry, would take no frame.
std::optional<wire::TmSeal> seal_of(const suite::RescueSettings& settings) {
  if (!settings.seal) return std::nullopt;
  wire::TmSeal seal{.spi = settings.seal->spi, .authenticator = {}};
  auto key = wire::SdlsKey::from_hex(to_hex(settings.seal->key));
  if (key) seal.authenticator = wire::TmAuthenticator::create(std::move(*key));
  return seal;
}

/// @param session_keys  which it uses, as they are on the disk
UplinkConfig uplink_of(const suite::RescueSettings& settings, wire::SessionKeys& session_keys) {
  UplinkConfig config;
  config.spacecraft_id = settings.spacecraft;
  config.strict = settings.tc_strict;
  config.cltu.randomized = settings.tc_randomizer;
  config.cltu.correct_single_bits = settings.tc_correct_single_bits;
  const auto channel = [&config](std::uint8_t vc) -> UplinkChannel& {
    for (UplinkChannel& known : config.channels) {
      if (known.vc == vc) return known;
    }
    return config.channels.emplace_back(UplinkChannel{.vc = vc, .associations = {}});
  };
  for (const auto& a : settings.associations) {
    auto key = wire::SdlsKey::from_hex(to_hex(key_of(a)));
    if (!key) continue;
    channel(a.vc).associations.push_back(
        {.spi = a.spi,
         .key = std::move(*key),
         .for_ad = a.for_ad,
         .for_bd = a.for_bd,
         .set = a.set == 'c' ? std::nullopt : std::optional(a.set == 'b' ? KeySet::b : KeySet::a)});
  }
  // Two associations under one key would use an IV twice: a damaged file must not make them.
  if (associations_with_one_key(config)) {
    for (UplinkChannel& known : config.channels) {
      for (UplinkAssociation& association : known.associations) {
        const auto a = std::find_if(settings.associations.begin(), settings.associations.end(),
                                    [&](const auto& of) { return of.spi == association.spi; });
        if (auto key = wire::SdlsKey::from_hex(to_hex(a->key))) association.key = std::move(*key);
      }
    }
  }
  for (const std::uint8_t vc : settings.open_channels) (void)channel(vc);
  const auto selection =
      key_selection_file(std::filesystem::path(settings.var) / "state/ttc/key_selection").load();
  if (selection.state) {
    for (UplinkChannel& known : config.channels) {
      const auto set = selection.state->sets.find(known.vc);
      if (set != selection.state->sets.end()) known.selected = set->second;
    }
  }
  session_keys = load_session_keys(wire::session_key_folder(settings.var), config).keys;
  return config;
}

DownlinkConfig downlink_of(const suite::RescueSettings& settings, const FrameCountFile& counts,
                           StateFile<std::uint64_t>& numbers) {
  DownlinkConfig config;
  config.spacecraft_id = settings.spacecraft;
  config.baud = settings.baud;
  config.cadu = {.frame_octets = settings.frame_octets,
                 .reed_solomon = settings.reed_solomon,
                 .interleave = settings.interleave,
                 .randomize = settings.tm_randomizer};
  config.continuous = settings.tm_continuous;
  config.files_queue_octets = files_queue_octets;
  config.first_counts = counts.load().value_or(wire::TmFrameCounts{});
  if (settings.seal)
    config.numbers = FrameNumbers(first_frame_number(std::nullopt, numbers.load().state, system_utc_now()));
  return config;
}

/// Where ttc has it.
std::filesystem::path transmitter_file(const suite::RescueSettings& settings) {
  return std::filesystem::path(settings.var) / "state/ttc/transmitter";
}

TransmitterSwitch read_transmitter(const suite::RescueSettings& settings, MonotonicTime now) {
  const auto stored = read_file(transmitter_file(settings), 256);
  return {kernel_boot_id().value_or("unknown"), stored.value_or(""), now};
}

std::uint32_t whole_seconds(nanoseconds time) {
  return static_cast<std::uint32_t>(std::clamp<std::int64_t>(time / seconds(1), 0, UINT32_MAX - 1));
}

}  // namespace

Result<std::unique_ptr<Rescuer>, std::string> Rescuer::create(const suite::RescueSettings& settings,
                                                              suite::StepRecord step) {
  const wire::CaduFormat format{.frame_octets = settings.frame_octets,
                                .reed_solomon = settings.reed_solomon,
                                .interleave = settings.interleave,
                                .randomize = settings.tm_randomizer};
  const std::size_t sealing = settings.seal ? wire::tm_sdls_overhead_octets : 0;
  if (settings.frame_octets < wire::tm_frame_octets_min + sealing || !wire::is_valid(format))
    return Err(std::string("the frame length does not fit the coding"));
  Devices devices;
  auto line = hw::open_serial(settings.rs422, settings.baud, settings.var);
  if (!line) return Err(line.error().message);
  devices.line = std::move(*line);
  if (!settings.watchdog.empty()) {
    auto watchdog = hw::open_watchdog(settings.watchdog, settings.var, seconds(settings.watchdog_timeout_s));
    if (watchdog) {
      devices.watchdog = std::move(*watchdog);
    } else {
      log::error("{}", watchdog.error().message);
    }
  }
  return std::unique_ptr<Rescuer>(
      new Rescuer(settings, std::move(step), std::move(devices), monotonic_now()));
}

Rescuer::Rescuer(const suite::RescueSettings& settings, suite::StepRecord step, Devices devices,
                 MonotonicTime now)
    : settings_(settings),
      step_(std::move(step)),
      devices_(std::move(devices)),
      files_(settings, [this] { feed(monotonic_now()); }),
      link_store_(std::filesystem::path(settings.var) / "state" / "ttc"),
      uplink_(uplink_of(settings, session_keys_), link_store_.load(now)),
      transmitter_(read_transmitter(settings, now)),
      frame_count_file_(std::filesystem::path(settings.var) / "state/ttc/frame_counts"),
      frame_number_file_(frame_number_file(std::filesystem::path(settings.var) / "state/ttc/frame_numbers")),
      downlink_(downlink_of(settings, frame_count_file_, frame_number_file_), seal_of(settings)),
      clock_(system_utc_now(), now),
      exchange_(files_queue_octets / 2),
      file_manager_(std::filesystem::path(settings.var) / "files"),
      begun_(now),
      contact_(now),
      beacon_at_(now),
      feed_at_(now) {
  reserve_frames();
  if (transmitter_.may_transmit(now)) return;
  log::warn("the transmitter stays off for {} s", whole_seconds(transmitter_.rest(now)));
  // A silence that begins anew with this boot must not do so with the next.
  (void)store_transmitter();
}

// ---------------------------------------------------------------- the loop

RescueEnd Rescuer::serve() {
  while (true) {
    const MonotonicTime now = monotonic_now();
    feed(now);
    read_line(now);
    turn_transmitter(now);
    if (now >= beacon_at_ && transmitter_.may_transmit(now)) send_step(now);
    turn_files(now);
    go_on_with_file_order(now);
    pump(now);
    if (!end_ && now - contact_ >= settings_.steps.no_contact) return finish({});
    const bool said = outgoing_.empty() && devices_.line->output_pending() == 0 &&
                      (downlink_.empty(DownlinkChannel::live) || !transmitter_.may_transmit(now));
    if (end_ && (said || now >= end_by_)) return finish(*end_);
    wait(now);
  }
}

RescueEnd Rescuer::finish(RescueEnd end) {
  uplink_.keep_flags();  // what was acknowledged since the last frame
  store_link(uplink_.state());
  return end;
}

void Rescuer::turn_transmitter(MonotonicTime now) {
  if (!transmitter_.take_end(now)) return;
  log::info("the transmitter is on again: the time is over");
  (void)store_transmitter();
}

bool Rescuer::store_transmitter() const {
  const auto written = write_file_atomically(transmitter_file(settings_), transmitter_.stored_text());
  if (!written) log::error("the state of the transmitter is not durable: {}", written.error().message);
  return written.has_value();
}

void Rescuer::feed(MonotonicTime now) {
  if (!devices_.watchdog || now < feed_at_) return;
  feed_at_ = now + milliseconds(std::max<std::uint32_t>(settings_.watchdog_timeout_s, 1) * 250);
  (void)devices_.watchdog->feed();  // one that is gone is opened again by the next one
}

void Rescuer::wait(MonotonicTime now) {
  MonotonicTime until = now + longest_sleep;
  const auto sooner = [&until](const std::optional<MonotonicTime>& at) {
    if (at) until = std::min(until, *at);
  };
  sooner(uplink_.idle_deadline());
  sooner(transmitter_.next_due(now));
  if (transmitter_.may_transmit(now)) {
    sooner(beacon_at_);
    if (outgoing_.empty()) sooner(downlink_.next_due(now));
  }
  sooner(exchange_.next_due(downlink_.room_octets(DownlinkChannel::files)));
  if (!outgoing_.empty()) until = std::min(until, now + line_full_sleep);
  if (file_request_) until = now;
  pollfd line{.fd = devices_.line->fd(), .events = POLLIN, .revents = 0};
  // Upwards: with less than a millisecond left it would turn without a rest.
  const auto rest = std::max(std::chrono::ceil<milliseconds>(until - monotonic_now()), milliseconds(0));
  (void)poll(&line, 1, static_cast<int>(rest.count()));
}

void Rescuer::read_line(MonotonicTime now) {
  std::array<std::uint8_t, 4096> octets{};
  bool empty = false;
  const std::uint64_t cltus = uplink_.cltu_counters().cltus_decoded;
  // Bounded, so that a line that is never silent lets the rest have its turn.
  for (int part = 0; part < 16 && !empty; ++part) {
    const auto got = devices_.line->read(octets);
    empty = !got || *got == 0;
    if (!empty) take(uplink_.push({octets.data(), *got}, now), now);
  }
  if (const auto deadline = uplink_.idle_deadline(); empty && deadline && now >= *deadline)
    take(uplink_.on_idle(now), now);
  // Also for a control command, and for a frame that FARM-1 discarded: COP-1 on the ground waits for it.
  if (uplink_.cltu_counters().cltus_decoded != cltus) downlink_.want_control_word(now);
}

void Rescuer::take(std::vector<UplinkedPacket> packets, MonotonicTime now) {
  // A secured control command, or a frame whose packet is none, has a generation of its own; what needs no
  // key has none.
  if (packets.empty() && uplink_.state().generation != uplink_.stored_state().generation)
    store_link(uplink_.state());
  for (UplinkedPacket& packet : packets) {
    // Before anything is done: a frame is never taken twice, whoever is on the line then.
    store_link(packet.link);
    contact_ = now;
    store_confirmed_keys();
    if (cfdp::is_pdu_packet(packet.packet)) {
      exchange_.on_packet(packet.packet);
    } else if (!end_) {
      take_order(packet, now);
    }
  }
  if (!packets.empty()) {
    store_link(uplink_.state());
    exchange_.on_contact();
  }
  (void)uplink_.take_refused();
}

/// A key whose first frame came is the only one, as ttc does it; unstored, after a restart the one before it
/// works too.
void Rescuer::store_confirmed_keys() {
  const auto confirmed = uplink_.take_confirmed();
  for (const auto& [spi, key] : confirmed) session_keys_ = session_keys_.confirmed(spi, key);
  if (confirmed.empty()) return;
  (void)store_session_keys(wire::session_key_folder(settings_.var), session_keys_);
}

void Rescuer::store_link(const LinkState& link) {
  if (link.generation <= uplink_.stored_state().generation && storage_writable_) return;
  storage_writable_ = link_store_.store(link);
  // Also when it is not on the disk: the ground must get on. The beacon reports it.
  (void)uplink_.on_stored(link);
}

void Rescuer::pump(MonotonicTime now) {
  while (true) {
    if (!outgoing_.empty()) {
      const auto written = devices_.line->write(outgoing_);
      if (!written) {
        outgoing_.clear();  // the line is gone: as if it had been lost on the way
      } else {
        outgoing_.erase(outgoing_.begin(), outgoing_.begin() + static_cast<std::ptrdiff_t>(*written));
      }
      if (!outgoing_.empty()) return;
    }
    if (!transmitter_.may_transmit(now)) break;
    auto cadu = downlink_.next(now, [this] { return uplink_.next_clcw(); });
    if (!cadu) break;
    outgoing_ = std::move(*cadu);
  }
  reserve_frames();
}

void Rescuer::reserve_frames() {
  if (const auto counts = frame_count_reserve_.wanted(downlink_.frame_counts())) {
    if (frame_count_file_.store(*counts)) frame_count_reserve_.on_stored(*counts);
  }
  // The clock of this computer is no valid time: numbers go on from those that were reserved.
  const auto numbers = downlink_.sealed() ? downlink_.numbers().wanted(std::nullopt) : std::nullopt;
  if (numbers && frame_number_file_.store(*numbers).durable()) downlink_.numbers().on_reserved(*numbers);
}

// ---------------------------------------------------------------- telemetry

void Rescuer::send(const Report& report, MonotonicTime now) {
  (void)downlink_.push(DownlinkChannel::live,
                       packets_.make(report, clock_.tai_at(now), clock_.reference_at(now)), true, now);
}

template <class Structure>
void Rescuer::send_structure(const Structure& h, MonotonicTime now) {
  OctetWriter content;
  content.u16(Structure::structure_id);
  h.encode(content);
  send({.apid = own_apid,
        .service = housekeeping_service,
        .subtype = housekeeping_report,
        .data = content.take()},
       now);
}

void Rescuer::send_step(MonotonicTime now) {
  beacon_at_ = now + beacon_period;
  const UplinkCounters& counters = uplink_.counters();
  mission::BootStepHousekeeping h;
  h.step = static_cast<mission::BootStep>(step_.step);
  h.cause = static_cast<mission::BootStepCause>(step_.cause);
  h.in_rescue = true;
  h.unhealthy_starts = step_.unhealthy_starts();
  h.set_aside = step_.set_aside;
  h.detail = step_.detail.substr(0, suite::StepRecord::most_detail);
  h.uptime_s = whole_seconds(now - begun_);
  h.suite_in_s = whole_seconds(settings_.steps.no_contact - (now - contact_));
  h.storage_writable = storage_writable_;
  h.free_mib = files_.free_mib();
  h.octets = counters.octets;
  h.frames_refused = counters.not_authentic + counters.replayed + counters.wrong_header +
                     counters.wrong_scid + counters.wrong_vc + counters.farm_discarded +
                     counters.counter_out_of_range;
  h.telecommands = telecommands_;
  h.telecommands_failed = telecommands_failed_;
  if (!uplink_.state().channels.empty()) {
    h.farm_vr = uplink_.state().channels.front().farm.vr;
    h.farm_lockout = uplink_.state().channels.front().farm.lockout;
  }
  send_structure(h, now);
}

void Rescuer::send_health(MonotonicTime now) {
  mission::HealthHousekeeping h;
  h.reason = fmt::format("srfs_rescue: {}, the suite is down", to_text(step_.cause));
  h.present = fmt::format("{} unhealthy starts{}{}", step_.unhealthy_starts(),
                          step_.detail.empty() ? "" : ", ", step_.detail);
  h.next = "srfs_rescue tries the suite";
  h.next_in_s = whole_seconds(settings_.steps.no_contact - (now - contact_));
  send_structure(h, now);
}

// ---------------------------------------------------------------- files over the link

void Rescuer::turn_files(MonotonicTime now) {
  const auto turn = exchange_.next_turn(
      downlink_.room_octets(DownlinkChannel::files), now,
      {.octets = downlink_.field_octets(), .filled = downlink_.begun_octets(DownlinkChannel::files)});
  if (!turn) return;
  if (!folders_) {
    const std::filesystem::path var = settings_.var;
    const cfdp::Settings settings{.own_entity = cfdp_spacecraft,
                                  .peer_entity = cfdp_ground,
                                  .receiving_octets_max = uplink_quota_octets,
                                  .free_floor_octets = free_floor_octets};
    const auto first = static_cast<std::uint32_t>(system_utc_now().ns() / 1'000'000'000);
    auto opened = cfdp::TransferFolders::open(var / "files", var / "state/ttc/cfdp", settings, first, now);
    if (!opened) {
      log::error("{}", opened.error().message);
      return exchange_.on_turn_refused(now);
    }
    folders_ = std::move(*opened);
  }
  auto result = cfdp::take_turn(*folders_, *turn, now);
  for (Octets& packet : exchange_.on_turn(result))
    (void)downlink_.push(DownlinkChannel::files, std::move(packet), false, now);
}

void Rescuer::go_on_with_file_order(MonotonicTime now) {
  if (!file_request_) return;
  const FileRequest request = *file_request_;
  FileOutcome outcome{.failure = mission::failure::disk_failed};
  if (folders_) outcome = file_manager_.serve(*folders_, request.order, now);
  if (outcome.unfinished) return;
  file_request_.reset();
  for (Octets& report : outcome.reports)
    send({.apid = own_apid,
          .service = mission::FileList::service,
          .subtype = outcome.report_subtype,
          .destination_id = request.origin.source_id,
          .data = std::move(report)},
         now);
  exchange_.on_change();
  if (outcome.failure == 0) return done(request.origin, now);
  ++telecommands_failed_;
  send(failure_report(request.origin, Stage::completion, outcome.failure, outcome.failure_parameter), now);
}

// ---------------------------------------------------------------- orders

void Rescuer::take_order(const UplinkedPacket& uplinked, MonotonicTime now) {
  JudgedOrder judged = judge(uplinked.packet);
  if (judged.refusal) {
    ++telecommands_failed_;
    return send(
        failure_report(judged.origin, judged.refusal->stage, judged.refusal->code, judged.refusal->parameter),
        now);
  }
  if (wants_success(judged.origin, Stage::acceptance))
    send(success_report(judged.origin, Stage::acceptance), now);
  try {
    std::visit([&](const auto& order) { execute(judged.origin, order, now); }, judged.order);
  } catch (const std::exception& e) {  // of a library; nothing an order does may end this program
    failed(judged.origin, {mission::failure::not_done, e.what()}, now);
  }
}

void Rescuer::done(const TelecommandOrigin& origin, MonotonicTime now) {
  ++telecommands_;
  if (wants_success(origin, Stage::completion)) send(success_report(origin, Stage::completion), now);
}

void Rescuer::failed(const TelecommandOrigin& origin, const FilesFailure& failure, MonotonicTime now) {
  ++telecommands_failed_;
  log::error("{}", failure.text);
  send(failure_report(origin, Stage::completion, failure.code), now);
}

std::uint32_t Rescuer::next_set_aside() {
  (void)files_.make_room(RecoveryFiles::RoomFor::an_order);
  step_.set_aside = files_.next_number(step_.set_aside);
  const auto problem = suite::StepStore(std::filesystem::path(settings_.var) / "state/boot")
                           .change([this](suite::StepRecord r) {
                             r.set_aside = step_.set_aside;
                             return r;
                           });
  if (!problem.empty()) log::error("{}", problem);
  return step_.set_aside;
}

void Rescuer::execute(const TelecommandOrigin& origin, const Ping& /*order*/, MonotonicTime now) {
  send({.apid = origin.apid,
        .service = mission::TtcPing::service,
        .subtype = pong,
        .destination_id = origin.source_id,
        .urgent = true},
       now);
  done(origin, now);
}

void Rescuer::execute(const TelecommandOrigin& origin, const OneShot& order, MonotonicTime now) {
  for (const auto& [structure] : order) {
    if (structure == mission::BootStepHousekeeping::structure_id) {
      send_step(now);
    } else if (structure == mission::HealthHousekeeping::structure_id) {
      send_health(now);
    } else {
      return failed(origin, {mission::failure::unknown_identifier, "srfs_rescue has no such structure"}, now);
    }
  }
  done(origin, now);
}

void Rescuer::execute(const TelecommandOrigin& origin, const mission::TtcSelectKeys& order,
                      MonotonicTime now) {
  if (!uplink_.select(order.vc, order.set))
    return failed(origin, {mission::failure::unknown_identifier, "no such set of keys"}, now);
  auto file = key_selection_file(std::filesystem::path(settings_.var) / "state/ttc/key_selection");
  KeySelection selection = file.load().state.value_or(KeySelection{});
  ++selection.generation;
  selection.sets[order.vc] = order.set;
  if (const auto stored = file.store(selection); !stored.durable())
    return failed(origin, {mission::failure::storage_unavailable, stored.problem}, now);
  done(origin, now);
}

void Rescuer::execute(const TelecommandOrigin& origin, const mission::TtcTransmitterOn& /*order*/,
                      MonotonicTime now) {
  transmitter_.switch_on();
  if (!store_transmitter())
    return failed(origin, {mission::failure::storage_unavailable, "a restart goes on with the silence"}, now);
  log::info("the transmitter is on: commanded");
  done(origin, now);
}

void Rescuer::execute(const TelecommandOrigin& origin, const mission::RescueReport& /*order*/,
                      MonotonicTime now) {
  send_step(now);
  done(origin, now);
}

void Rescuer::execute(const TelecommandOrigin& origin, const mission::RescueStartSuite& order,
                      MonotonicTime now) {
  if (order.step == mission::BootStep::rescue)
    return failed(origin, {mission::failure::bad_argument, "rescue is no step to start the suite in"}, now);
  end_ = RescueEnd{RescueEnd::Kind::start_suite, static_cast<suite::BootStep>(order.step)};
  end_by_ = now + last_words;
  done(origin, now);
}

void Rescuer::execute(const TelecommandOrigin& origin, const mission::RescueReboot& /*order*/,
                      MonotonicTime now) {
  end_ = RescueEnd{RescueEnd::Kind::reboot};
  end_by_ = now + last_words;
  done(origin, now);
}

void Rescuer::execute(const TelecommandOrigin& origin, const mission::RescueReset& order, MonotonicTime now) {
  const auto moved = files_.set_aside(order.part, next_set_aside(), link_store_);
  files_.keep_reserve();
  if (!moved) return failed(origin, moved.error(), now);
  log::warn("{}: {} files and folders set aside", mission::to_text(order.part), *moved);
  done(origin, now);
}

void Rescuer::execute(const TelecommandOrigin& origin, const mission::RescueMend& /*order*/,
                      MonotonicTime now) {
  const auto count = files_.mend(Mend::everything);
  if (!count) return failed(origin, count.error(), now);
  step_.detail = fmt::format("{} of {} files mended, {} left", count->mended, count->files, count->left);
  send_step(now);
  if (count->left > 0) return failed(origin, {mission::failure::not_done, step_.detail}, now);
  done(origin, now);
}

void Rescuer::execute(const TelecommandOrigin& origin, const mission::RescueRestore& order,
                      MonotonicTime now) {
  const auto restored = files_.restore(order.file, order.target, next_set_aside());
  files_.keep_reserve();
  if (!restored) return failed(origin, restored.error(), now);
  done(origin, now);
}

void Rescuer::execute(const TelecommandOrigin& origin, const mission::RescueFetch& order, MonotonicTime now) {
  const auto name = files_.fetch(order.path);
  if (!name) return failed(origin, name.error(), now);
  exchange_.on_change();
  done(origin, now);
}

void Rescuer::execute(const TelecommandOrigin& origin, const mission::RescueList& order, MonotonicTime now) {
  auto reports = files_.list(order.path);
  if (!reports) return failed(origin, reports.error(), now);
  for (Octets& report : *reports)
    send({.apid = own_apid,
          .service = mission::RepositorySummary::service,
          .subtype = mission::RepositorySummary::subtype,
          .destination_id = origin.source_id,
          .data = std::move(report)},
         now);
  done(origin, now);
}

void Rescuer::execute(const TelecommandOrigin& origin, const FileOrder& order, MonotonicTime now) {
  if (file_request_)
    return failed(origin, {mission::failure::busy, "a request about files is under way"}, now);
  file_request_ = FileRequest{origin, order};
  file_request_->order.number = next_file_order_++;
}

}  // namespace srfs::rescue
