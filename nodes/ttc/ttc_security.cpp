// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// What the ttc node reports and stores about arming and keys.
#include <algorithm>

#include "nodes/ttc/ttc_node.hpp"

namespace srfs {

void TtcNode::report_hazards() {
  const auto tell = [this](const HazardName& name, auto event) {
    event.apid = name.apid;
    event.service = name.service;
    event.subtype = name.subtype;
    event.digest = name.digest;
    send_event(event);
  };
  for (const HazardNews& news : link_->hazards.take_news()) {
    if (news.reason) {
      mission::TtcDisarmedEvent event;
      event.reason = *news.reason;
      tell(news.name, event);
    } else {
      mission::TtcArmedEvent event;
      event.window_ms = static_cast<std::uint32_t>(link_->hazards.window().count());
      tell(news.name, event);
    }
  }
}

void TtcNode::load_key_selection(UplinkConfig& config) {
  key_news_.clear();
  const FoundKeySelection found = srfs::load_key_selection(state_dir() / "key_selection");
  key_selection_ = found.selection;
  const bool lost = found.damaged_copies > 0 && found.selection.generation == 0;
  for (UplinkChannel& channel : config.channels) {
    if (channel.associations.empty()) continue;
    const auto has = [&channel](KeySet set) {
      return std::any_of(channel.associations.begin(), channel.associations.end(),
                         [set](const UplinkAssociation& a) { return a.set == set; });
    };
    const auto stored = key_selection_.sets.find(channel.vc);
    if (stored != key_selection_.sets.end()) channel.selected = stored->second;
    if (lost) key_news_.push_back({channel.vc, channel.selected, "the stored selection is damaged"});
    const KeySet other = channel.selected == KeySet::a ? KeySet::b : KeySet::a;
    if (!has(channel.selected) && has(other)) {
      channel.selected = other;
      key_news_.push_back({channel.vc, other, "the selected keys are unusable"});
    }
  }
  if (found.damaged_copies == 0) return;
  log::error("{} of 2 copies of the key selection are damaged", found.damaged_copies);
  if (const auto stored = store_key_selection(state_dir() / "key_selection", key_selection_); !stored)
    log::error("{}", stored.error().message);
}

void TtcNode::report_keys_at_start() {
  for (const UnusableKey& key : unusable_keys_) {
    log::error("association {} is not used: {}", key.spi, key.why);
    mission::TtcKeyUnusableEvent event;
    event.spi = key.spi;
    event.why = key.why;
    send_event(event);
  }
  for (const KeyNews& news : std::exchange(key_news_, {})) report_keys(news.vc, news.set, news.why);
}

void TtcNode::report_keys(std::uint8_t vc, KeySet set, const std::string& why) {
  log::warn("TC virtual channel {} uses keys {}: {}", vc, to_text(set), why);
  mission::TtcKeysSelectedEvent event;
  event.vc = vc;
  event.set = set == KeySet::b ? mission::KeySet::b : mission::KeySet::a;
  event.why = why;
  send_event(event);
}

/// The old keys work until the change is on disk: a crash before is as if it had not come.
void TtcNode::store_key_change() {
  const auto change = link_->key_service.take_change();
  if (!change) return;
  ++key_selection_.generation;
  key_selection_.sets[change->vc] = change->set;
  const auto done = [this, change = *change](bool stored) {
    link_->uplink.select(change.vc, change.set);
    link_->key_service.on_stored(change, stored);
    report_keys(change.vc, change.set, stored ? "commanded" : "commanded, not stored");
    if (is_active()) settle();
  };
  const bool taken = state_worker_->ask(
      [path = state_dir() / "key_selection", selection = key_selection_] {
        return store_key_selection(path, selection).has_value();
      },
      done);
  if (!taken) done(false);
}

}  // namespace srfs
