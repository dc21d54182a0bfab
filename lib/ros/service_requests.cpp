// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/service_requests.hpp"

#include <algorithm>
#include <utility>

namespace srfs::ros {
namespace {

SampleIdentity first_attempt(const SampleIdentity& request, std::optional<std::int64_t> first_sequence) {
  SampleIdentity first = request;
  if (first_sequence) first.sequence_number(sequence_number(*first_sequence));
  return first;
}

}  // namespace

void ServiceRequests::forget_old(MonotonicTime now) {
  while (!answered_.empty() &&
         (answered_.size() > most_answered || now - answered_.front().at > longest_memory))
    answered_.pop_front();
}

ServiceRequests::Judgement ServiceRequests::judge(const SampleIdentity& request,
                                                  std::optional<std::int64_t> first_sequence,
                                                  bool within_reach, MonotonicTime now) {
  forget_old(now);
  const SampleIdentity first = first_attempt(request, first_sequence);
  const auto is_this = [&](const auto& known) { return known.first == first; };
  if (first_sequence) {
    if (std::any_of(pending_.begin(), pending_.end(), is_this)) {
      ++counters_.repeats;
      return {Verdict::wait};
    }
    if (const auto found = std::find_if(answered_.begin(), answered_.end(), is_this);
        found != answered_.end()) {
      ++counters_.repeats;
      return {Verdict::answer_again, {}, found->response};
    }
  }
  if (pending_.size() >= most_pending) {
    ++counters_.refused;
    return {Verdict::refuse};
  }
  const auto ticket = static_cast<Ticket>(next_ticket_++);
  pending_.push_back({ticket, first, request, now, within_reach});
  return {Verdict::execute, ticket};
}

std::optional<SampleIdentity> ServiceRequests::answer(Ticket ticket, Response response, MonotonicTime now) {
  const auto found = std::find_if(pending_.begin(), pending_.end(),
                                  [&](const Pending& pending) { return pending.ticket == ticket; });
  if (found == pending_.end()) return std::nullopt;
  const SampleIdentity reply_to = found->reply_to;
  answered_.push_back({found->first, now, std::move(response)});
  pending_.erase(found);
  forget_old(now);
  return reply_to;
}

void ServiceRequests::forget(Ticket ticket) {
  std::erase_if(pending_, [&](const Pending& pending) { return pending.ticket == ticket; });
}

std::vector<Ticket> ServiceRequests::drop_vanished(const std::function<bool(const GUID_t&)>& within_reach,
                                                   MonotonicTime now) {
  std::vector<Ticket> dropped;
  std::erase_if(pending_, [&](Pending& pending) {
    if (within_reach(pending.first.writer_guid())) {
      pending.client_seen = true;
      return false;
    }
    if (!pending.client_seen && now - pending.since < longest_to_match) return false;
    dropped.push_back(pending.ticket);
    return true;
  });
  counters_.dropped += dropped.size();
  return dropped;
}

GUID_t ServiceRequests::client(Ticket ticket) const {
  const auto found = std::find_if(pending_.begin(), pending_.end(),
                                  [&](const Pending& pending) { return pending.ticket == ticket; });
  return found != pending_.end() ? found->first.writer_guid() : GUID_t::unknown();
}

}  // namespace srfs::ros
