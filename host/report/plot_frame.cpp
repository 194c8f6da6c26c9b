// SPDX-License-Identifier: Apache-2.0
#include "report/plot_frame.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "report/html.hpp"

namespace flexcomp::host {
namespace {

// In units of the drawing: about a pixel on a phone.
constexpr double width = 360, usual_height = 220;
constexpr double least_left_margin = 46, most_left_margin = 166, least_right_margin = 12,
                 most_right_margin = 60;
constexpr double top_margin = 12, bottom_margin = 36;
constexpr double legend_sample = 20, legend_gap = 14;

/// Cut where it would be wider than `room`.
std::string fitting(const std::string& text, double room) {
  if (text_width(text) <= room) return text;
  std::string cut;
  double used = 2 * letter_width;
  for (const char c : text) {
    if ((c & 0xC0) != 0x80) used += letter_width;
    if (used > room) break;
    cut += c;
  }
  return cut + "…";
}

}  // namespace

PlotFrame::PlotFrame(const std::string& described, Axis x, Axis y, const std::vector<LegendItem>& legend)
    : x_(std::move(x)),
      y_(std::move(y)),
      right_(least_right_margin),
      top_(top_margin),
      height_(usual_height) {
  const std::string items = place_legend(legend);
  const std::vector<Tick> up = ticks_of(y_, height_ - top_ - bottom_margin, false);
  double longest = 0;
  for (const Tick& t : up) longest = std::max(longest, text_width(t.text));
  left_ = std::clamp(longest + (y_.name.empty() ? 7 : 25), least_left_margin, most_left_margin);
  const std::vector<Tick> along = ticks_of(x_, width - left_ - least_right_margin, true);
  for (const Tick& t : along) {
    // A text that is centred at its tick must end inside the drawing.
    const double share = x_.scale.at(t.value);
    if (share <= 0.5) continue;
    const double needed = (text_width(t.text) / 2 + 2 - (1 - share) * (width - left_)) / share;
    right_ = std::max(right_, std::min(most_right_margin, needed));
  }
  svg_ = fmt::format(
      "<svg viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\" "
      "xmlns=\"http://www.w3.org/2000/svg\">\n{}",
      width, height_, escaped(described), items);
  draw_y_axis(up);
  draw_x_axis(along);
}

/// Above the frame, which begins below it.
std::string PlotFrame::place_legend(const std::vector<LegendItem>& legend) {
  if (legend.empty()) return "";
  double row = line_height, used = 4;
  std::string items;
  for (const LegendItem& item : legend) {
    const std::string name = fitting(item.name, width - legend_sample - 8);
    const double needed = legend_sample + text_width(name);
    if (used > 4 && used + needed > width) {
      row += line_height;
      used = 4;
    }
    const double middle = row - 3.5;
    items += item.line ? fmt::format("<path class=\"line {0}\" d=\"M{1:.1f} {2:.1f}H{3:.1f}\"/>\n", item.kind,
                                     used, middle, used + legend_sample - 5)
                       : fmt::format("<path class=\"dots {}\" d=\"{}\"/>\n", item.kind,
                                     dot(used + legend_sample - 9, middle));
    items += fmt::format("<text class=\"entry\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n", used + legend_sample,
                         row, escaped(name));
    used += needed + legend_gap;
  }
  top_ += row + 2;
  height_ += row + 2;
  return items;
}

void PlotFrame::draw_y_axis(const std::vector<Tick>& ticks) {
  for (const Tick& t : ticks) {
    const double at = py(t.value);
    add_line(at_share_x(0), at, at_share_x(1), at, "grid");
    add_text(at_share_x(0) - 5, at + 3.5, "end", fitting(t.text, left_ - 6));
  }
  if (y_.name.empty()) return;
  svg_ += fmt::format(
      "<text class=\"name\" text-anchor=\"middle\" transform=\"translate(11 {:.1f}) "
      "rotate(-90)\">{}</text>\n",
      at_share_y(0.5), escaped(fitting(y_.name, height_)));
}

void PlotFrame::draw_x_axis(const std::vector<Tick>& ticks) {
  const double base = at_share_y(0);
  for (const Tick& t : ticks) {
    const double at = px(t.value);
    add_line(at, base, at, base + 4, "axis");
    add_text(at, base + 15, "middle", t.text);
  }
  add_line(at_share_x(0), base, at_share_x(1), base, "axis");
  add_text(at_share_x(0.5), height_ - 5, "middle", x_.name, "name");
}

double PlotFrame::at_share_x(double share) const { return left_ + share * (width - left_ - right_); }

double PlotFrame::at_share_y(double share) const {
  return height_ - bottom_margin - share * (height_ - top_ - bottom_margin);
}

void PlotFrame::add_noise_floor(double y) {
  add_line(at_share_x(0), py(y), at_share_x(1), py(y), "floor");
  add_text(at_share_x(1) - 2, py(y) - 4, "end", "noise");
}

void PlotFrame::add_line(double x1, double y1, double x2, double y2, const char* kind) {
  svg_ += fmt::format("<path class=\"{}\" d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\"/>\n", kind, x1, y1, x2, y2);
}

void PlotFrame::add_path(const std::string& d, const std::string& kind) {
  if (!d.empty()) svg_ += fmt::format("<path class=\"{}\" d=\"{}\"/>\n", kind, d);
}

void PlotFrame::add_text(double x, double y, const char* anchor, const std::string& text, const char* kind) {
  svg_ += fmt::format("<text class=\"{}\" x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>\n", kind, x,
                      y, anchor, escaped(text));
}

std::string dots_of(std::size_t count, const std::string& kind) {
  return (count <= 60 ? "dots " : count <= 300 ? "mid " : "fine ") + kind;
}

std::string diamond(double x, double y) {
  return fmt::format("M{0:.1f} {3:.1f}L{2:.1f} {4:.1f}L{0:.1f} {5:.1f}L{1:.1f} {4:.1f}Z", x, x - 6, x + 6,
                     y - 6, y, y + 6);
}

std::string dot(double x, double y) { return fmt::format("M{:.1f} {:.1f}h0", x, y); }

std::string fine_dots(std::vector<std::array<double, 2>> places) {
  std::ranges::sort(places);
  std::string d;
  long x = 0, y = 0;
  for (const auto& place : places) {
    const long to_x = std::lround(place[0]), to_y = std::lround(place[1]);
    if (!d.empty() && to_x == x && to_y == y) continue;
    d += d.empty() ? fmt::format("M{} {}h0", to_x, to_y)
                   : fmt::format("m{}{}{}h0", to_x - x, to_y < y ? "" : " ", to_y - y);
    x = to_x;
    y = to_y;
  }
  return d;
}

}  // namespace flexcomp::host
