// SPDX-License-Identifier: Apache-2.0
/// \file
/// The frame of a plot in SVG: axes with ticks, legend, and the marks that are drawn into it.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "report/axis.hpp"

namespace flexcomp::host {

struct LegendItem {
  std::string name;
  std::string kind;  ///< class of its colour
  bool line = true;  ///< else a dot
};

/// An SVG drawing with its axes and its legend above them. Margins follow the texts.
class PlotFrame {
 public:
  /// \param described  for those who do not see it
  PlotFrame(const std::string& described, Axis x, Axis y, const std::vector<LegendItem>& legend = {});

  /// From values on the axes to units of the drawing.
  double px(double x) const { return at_share_x(x_.scale.at(x)); }
  double py(double y) const { return at_share_y(y_.scale.at(y)); }
  /// From shares of the frame, left to right and bottom to top.
  double at_share_x(double share) const;
  double at_share_y(double share) const;

  /// The noise, as a horizontal line.
  void add_noise_floor(double y);
  void add_line(double x1, double y1, double x2, double y2, const char* kind);
  void add_path(const std::string& d, const std::string& kind);
  void add_text(double x, double y, const char* anchor, const std::string& text, const char* kind = "tick");
  std::string svg() const { return svg_ + "</svg>\n"; }

 private:
  std::string place_legend(const std::vector<LegendItem>& legend);
  void draw_y_axis(const std::vector<Tick>& ticks);
  void draw_x_axis(const std::vector<Tick>& ticks);

  Axis x_, y_;
  double left_ = 0, right_, top_, height_;
  std::string svg_;
};

/// "M0 0h0": a dot in a path whose lines have round ends.
std::string dot(double x, double y);
/// Around a dot that stands apart.
std::string diamond(double x, double y);
/// Class of dots that are so many: the more, the smaller.
std::string dots_of(std::size_t count, const std::string& kind);
/// Very many dots, each to a unit of the drawing, in about half the bytes: from left to right, each from the one before.
std::string fine_dots(std::vector<std::array<double, 2>> places);

}  // namespace flexcomp::host
