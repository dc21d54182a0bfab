// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/raw_dds.hpp"

#include <algorithm>
#include <csignal>
#include <cstdio>

#include <fmt/format.h>
#include <malloc.h>

namespace srfs::bench {

RawService::RawService(ros::Participant& participant, const std::string& name)
    : replies_(participant, name + "Reply", {}),
      requests_(participant, name + "Request", {},
                [this](const Probe& request, const ros::dds::SampleInfo& info) {
                  SampleIdentity id;
                  id.writer_guid(info.related_sample_identity.writer_guid());
                  id.sequence_number(info.sample_identity.sequence_number());
                  WriteParams params;
                  params.related_sample_identity(id);
                  replies_.write(request, params);
                }) {}

RawClient::RawClient(ros::Participant& participant, const std::string& name)
    : replies_(participant, name + "Reply", {},
               [this](const Probe&, const ros::dds::SampleInfo& info) {
                 if (info.related_sample_identity.writer_guid() != replies_.guid()) return;
                 const std::lock_guard lock(mutex_);
                 answered_at_ = monotonic_now();
                 answered_ = info.related_sample_identity;
                 changed_.notify_one();
               }),
      requests_(participant, name + "Request", {}) {}

std::optional<MonotonicTime> RawClient::call(std::uint32_t number, nanoseconds longest) {
  Probe request;
  request.number = number;
  WriteParams params;
  params.related_sample_identity().writer_guid(replies_.guid());
  if (!requests_.write(request, params)) return std::nullopt;
  const auto sequence = params.sample_identity().sequence_number();
  std::unique_lock lock(mutex_);
  if (!changed_.wait_for(lock, longest, [&] { return answered_.sequence_number() == sequence; }))
    return std::nullopt;
  return answered_at_;
}

RawChecks::RawChecks(ros::Participant& participant, const std::string& name,
                     const std::vector<std::string>& asked)
    : name_(name),
      replies_(participant, "bench_check/" + name + "Reply", {.depth = 8}),
      requests_(participant, "bench_check/" + name + "Request", {.depth = 8},
                [this](const CheckAlive::Request& request, const ros::dds::SampleInfo& info) {
                  SampleIdentity id;
                  id.writer_guid(info.related_sample_identity.writer_guid());
                  id.sequence_number(info.sample_identity.sequence_number());
                  WriteParams params;
                  params.related_sample_identity(id);
                  CheckAlive::Response response;
                  response.nonce = request.nonce;
                  replies_.write(response, params);
                }),
      peers_(asked.size()) {
  for (std::size_t i = 0; i < asked.size(); ++i) {
    Peer& peer = peers_[i];
    peer.replies = std::make_unique<RawReader<CheckAlive::Response>>(
        participant, "bench_check/" + asked[i] + "Reply", ros::Qos{.depth = 8},
        [this, &peer](const CheckAlive::Response&, const ros::dds::SampleInfo& info) {
          if (info.related_sample_identity.writer_guid() == peer.replies->guid()) ++answered_;
        });
    peer.requests = std::make_unique<RawWriter<CheckAlive::Request>>(
        participant, "bench_check/" + asked[i] + "Request", ros::Qos{.depth = 8});
  }
}

void RawChecks::ask() {
  for (const Peer& peer : peers_) {
    CheckAlive::Request request;
    request.nonce = ++asked_count_;
    request.observer = name_;
    WriteParams params;
    params.related_sample_identity().writer_guid(peer.replies->guid());
    peer.requests->write(request, params);
  }
}

int run_raw_node(int domain, const std::string& name, int writers, int readers,
                 const std::vector<std::string>& asked) {
  sigset_t ends;
  sigemptyset(&ends);
  sigaddset(&ends, SIGTERM);
  sigprocmask(SIG_BLOCK, &ends, nullptr);
  mallopt(M_ARENA_MAX, 1);  // like run_node
  const auto participant = raw_participant(domain);
  const RawService service(*participant, "bench_raw/" + name);
  std::vector<std::unique_ptr<RawWriter<Probe>>> out;
  std::vector<std::unique_ptr<RawReader<Probe>>> in;
  for (int i = 1; i < writers; ++i)
    out.push_back(std::make_unique<RawWriter<Probe>>(*participant, fmt::format("bench_raw/{}/w{}", name, i),
                                                     ros::Qos{}));
  for (int i = 1; i < readers; ++i)
    in.push_back(std::make_unique<RawReader<Probe>>(*participant, fmt::format("bench_raw/{}/r{}", name, i),
                                                    ros::Qos{},
                                                    [](const Probe&, const ros::dds::SampleInfo&) {}));
  RawChecks checks(*participant, name, asked);
  malloc_trim(0);
  int signal = 0;
  if (asked.empty()) {
    sigwait(&ends, &signal);
    return 0;
  }
  MonotonicTime next = monotonic_now() + check_period;
  while (signal != SIGTERM) {
    const nanoseconds wait = std::max(next - monotonic_now(), nanoseconds(0));
    const timespec time{wait / seconds(1), (wait % seconds(1)).count()};
    signal = sigtimedwait(&ends, nullptr, &time);
    if (signal == SIGTERM) break;
    next += check_period;
    checks.ask();
  }
  std::printf("%s asked %llu answered %llu\n", name.c_str(), static_cast<unsigned long long>(checks.asked()),
              static_cast<unsigned long long>(checks.answered()));
  return 0;
}

}  // namespace srfs::bench
