// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/plot.hpp"

#include <algorithm>
#include <functional>

#include <fmt/format.h>

namespace srfs::simulation {
namespace {

constexpr double left = 150;
constexpr double right = 1150;
constexpr double band = 90;
constexpr double gap = 26;
constexpr double row = 11;

/// Builds the picture from the top down.
class Canvas {
 public:
  explicit Canvas(double end_s) : end_s_(std::max(end_s, 1.0)) {}

  [[nodiscard]] double x(double at_s) const { return left + (right - left) * at_s / end_s_; }
  [[nodiscard]] double y() const { return y_; }
  void down(double by) { y_ += by; }
  void add(const std::string& element) { body_ += element + "\n"; }
  void text(double x, double y, const std::string& words, const char* anchor = "start") {
    add(fmt::format(R"(<text x="{:.1f}" y="{:.1f}" text-anchor="{}">{}</text>)", x, y, anchor, words));
  }
  void strip(double from_s, double to_s, double height, const char* colour) {
    add(fmt::format(R"(<rect x="{:.2f}" y="{:.1f}" width="{:.2f}" height="{:.1f}" fill="{}"/>)", x(from_s),
                    y_, std::max(x(to_s) - x(from_s), 0.7), height, colour));
  }
  [[nodiscard]] std::string finish(const std::string& title) const {
    return fmt::format(
        R"(<svg xmlns="http://www.w3.org/2000/svg" width="{0:.0f}" height="{1:.0f}" viewBox="0 0 {0:.0f} {1:.0f}" font-family="sans-serif" font-size="11">
<rect width="100%" height="100%" fill="white"/>
<text x="{2:.0f}" y="20" font-size="14">{3}</text>
{4}</svg>
)",
        right + 120, y_ + 30, left, title, body_);
  }

 private:
  double end_s_;
  double y_ = 44;
  std::string body_;
};

struct Curve {
  const char* name;
  const char* colour;
  std::function<double(std::size_t sample)> value;
};

/// Curves with one scale.
void draw_band(Canvas& canvas, const char* title, std::size_t samples,
               const std::function<double(std::size_t)>& at_s, const std::vector<Curve>& curves) {
  double low = 0;
  double high = 0;
  for (std::size_t c = 0; c < curves.size(); ++c) {
    for (std::size_t i = 0; i < samples; ++i) {
      const double value = curves[c].value(i);
      if (c + i == 0) low = high = value;
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
  const double span = high > low ? high - low : 1;
  canvas.text(left - 8, canvas.y() + band / 2, title, "end");
  canvas.text(left - 8, canvas.y() + 10, fmt::format("{:.4g}", high), "end");
  canvas.text(left - 8, canvas.y() + band, fmt::format("{:.4g}", low), "end");
  canvas.add(
      fmt::format(R"(<rect x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}" fill="none" stroke="#bbb"/>)",
                  left, canvas.y(), right - left, band));
  double label = canvas.y() + 12;
  for (const Curve& curve : curves) {
    std::string points;
    for (std::size_t i = 0; i < samples; ++i)
      points += fmt::format("{:.1f},{:.1f} ", canvas.x(at_s(i)),
                            canvas.y() + band - band * (curve.value(i) - low) / span);
    canvas.add(fmt::format(R"(<polyline points="{}" fill="none" stroke="{}" stroke-width="1"/>)", points,
                           curve.colour));
    canvas.add(fmt::format(R"(<text x="{:.1f}" y="{:.1f}" fill="{}">{}</text>)", right + 8, label,
                           curve.colour, curve.name));
    label += 14;
  }
  canvas.down(band + gap);
}

}  // namespace

void Plot::sample(nanoseconds at, Kernel& kernel, Spacecraft& spacecraft, const FaultInjector& faults) {
  Sample s;
  s.at_s = static_cast<double>(at.count()) / 1e9;
  s.mode = kernel.coverage().state(StateTable::mode, 0).value_or(0);
  const auto& power = spacecraft.world().power().state();
  s.charge = power.charge;
  s.solar_w = power.solar_w;
  s.battery_k = spacecraft.world().thermal().temperature_k(sim::ThermalNode::battery);
  s.radiator_k = spacecraft.world().thermal().temperature_k(sim::ThermalNode::radiator);
  s.granted = static_cast<double>(spacecraft.ledger().granted);
  s.released = static_cast<double>(spacecraft.ledger().released);
  for (std::size_t i = 0; i < spacecraft.node_count(); ++i)
    s.starts += static_cast<double>(spacecraft.host(static_cast<Lane>(i)).starts());
  s.boots = spacecraft.boots();
  s.line_cut = spacecraft.station().line().cut;
  s.calm = faults.is_calm();
  for (std::size_t i = 0; i < fault_count; ++i) s.faults.at(i) = faults.injected(static_cast<Fault>(i));
  samples_.push_back(s);
}

std::string Plot::svg(const std::string& title) const {
  const std::size_t n = samples_.size();
  Canvas canvas(n == 0 ? 0 : samples_.back().at_s);
  const auto at_s = [this](std::size_t i) { return samples_[i].at_s; };
  const auto rate = [this](std::size_t i, double Sample::*counter) {
    return i == 0 ? 0.0 : samples_[i].*counter - samples_[i - 1].*counter;
  };
  static constexpr std::array modes{"#d62728", "#2ca02c", "#ff7f0e", "#9467bd", "#1f77b4"};
  const auto strips = [&](const char* name, double height, const auto& colour_of) {
    canvas.text(left - 8, canvas.y() + height - 2, name, "end");
    for (std::size_t i = 1; i < n; ++i) {
      if (const char* colour = colour_of(i)) canvas.strip(at_s(i - 1), at_s(i), height, colour);
    }
    canvas.down(height + 3);
  };
  strips("mode", 14, [&](std::size_t i) -> const char* { return modes.at(samples_[i].mode % modes.size()); });
  canvas.text(right + 8, canvas.y() - 6, "safe red, nominal green");
  strips("line cut", row, [&](std::size_t i) { return samples_[i].line_cut ? "#555" : nullptr; });
  strips("calm", row, [&](std::size_t i) { return samples_[i].calm ? "#cde" : nullptr; });
  canvas.down(gap - row);
  draw_band(canvas, "charge", n, at_s,
            {{"battery 0-1", "#1f77b4", [&](std::size_t i) { return samples_[i].charge; }}});
  draw_band(canvas, "power W", n, at_s,
            {{"panels", "#ff7f0e", [&](std::size_t i) { return samples_[i].solar_w; }}});
  draw_band(canvas, "temperature K", n, at_s,
            {{"battery", "#d62728", [&](std::size_t i) { return samples_[i].battery_k; }},
             {"radiator", "#17becf", [&](std::size_t i) { return samples_[i].radiator_k; }}});
  draw_band(canvas, "slots", n, at_s,
            {{"granted", "#888", [&](std::size_t i) { return rate(i, &Sample::granted); }},
             {"released", "#2ca02c", [&](std::size_t i) { return rate(i, &Sample::released); }}});
  draw_band(canvas, "recoveries", n, at_s,
            {{"starts", "#9467bd", [&](std::size_t i) { return rate(i, &Sample::starts); }},
             {"boots", "#d62728", [&](std::size_t i) { return rate(i, &Sample::boots); }}});
  for (std::size_t fault = 0; fault < fault_count; ++fault)
    strips(to_text(static_cast<Fault>(fault)), row - 2, [&](std::size_t i) {
      return samples_[i].faults.at(fault) > samples_[i - 1].faults.at(fault) ? "#d62728" : nullptr;
    });
  for (int part = 0; part <= 6 && n > 0; ++part) {
    const double at = samples_.back().at_s * part / 6;
    canvas.text(canvas.x(at), canvas.y() + 12, fmt::format("{:.1f} h", at / 3600), "middle");
  }
  return canvas.finish(title);
}

}  // namespace srfs::simulation
