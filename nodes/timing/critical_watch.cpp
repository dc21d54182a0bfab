#include "nodes/timing/critical_watch.hpp"

#include <utility>

#include "base/file.hpp"
#include "ros/lifecycle.hpp"

namespace srfs {
namespace {

std::uint8_t read_desired_state(const ros::VarPaths& var, const std::string& node) {
  constexpr std::size_t longest = 64;
  const auto text = read_file(var.state(node) / "desired_state", longest);
  const auto state = text ? ros::primary_state(text->substr(0, text->find('\n'))) : std::nullopt;
  const bool usable = state && *state != ros::State::finalized;
  return static_cast<std::uint8_t>(usable ? *state : ros::State::active);
}

}  // namespace

CriticalWatch::CriticalWatch(CriticalAnswers answers, std::string observer, ros::VarPaths var)
    : answers_(std::move(answers)), observer_(std::move(observer)), var_(std::move(var)) {}

void CriticalWatch::open(const std::function<std::shared_ptr<Client>(const std::string& service)>& make) {
  clients_.clear();
  for (const std::string& node : answers_.nodes()) clients_.push_back(make("/" + node + "/check_alive"));
}

void CriticalWatch::close() {
  clients_.clear();
  reading_ = false;
}

void CriticalWatch::ask(MonotonicTime now, const std::shared_ptr<ros::Worker>& worker) {
  for (std::size_t i = 0; i < clients_.size(); ++i) {
    srfs_msgs::srv::CheckAlive::Request question;
    question.nonce = answers_.ask(i, now);
    question.observer = observer_;
    clients_[i]->call(question, critical_check_period, 1, [this, i](const Client::Outcome& answer) {
      if (answer) answers_.on_answer(i, answer->nonce, answer->lifecycle_state);
    });
  }
  read_desired_states(worker);
}

void CriticalWatch::read_desired_states(const std::shared_ptr<ros::Worker>& worker) {
  if (reading_ || clients_.empty()) return;
  auto states = std::make_shared<std::vector<std::uint8_t>>();
  reading_ = worker->post(
      [var = var_, nodes = answers_.nodes(), states] {
        for (const std::string& node : nodes) states->push_back(read_desired_state(var, node));
      },
      [this, states] {
        reading_ = false;
        for (std::size_t i = 0; i < states->size(); ++i) answers_.on_desired(i, (*states)[i]);
      });
}

std::vector<WatchdogEvidence> CriticalWatch::evidence() const {
  std::vector<WatchdogEvidence> all;
  for (std::size_t i = 0; i < answers_.nodes().size(); ++i) {
    all.push_back({answers_.nodes()[i] + " does not answer",
                   [this, i](MonotonicTime now) { return answers_.holds(i, now); }});
  }
  return all;
}

}  // namespace srfs
