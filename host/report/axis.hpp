// SPDX-License-Identifier: Apache-2.0
/// \file
/// Axes of plots: linear and logarithmic scales, round limits, and ticks whose texts do not overlap.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace flexcomp::host {

// Of the page's 11 px text, in the wider of the usual fonts; in units of the drawing.
constexpr double letter_width = 6.7, line_height = 13;
double text_width(const std::string& text);

struct Tick {
  double value;
  std::string text;
};

/// Maps [low, high] linearly or logarithmically to [0, 1].
struct Scale {
  double low = 0, high = 1;
  bool log = false;

  double at(double v) const;
  std::vector<Tick> ticks(int about) const;
};

struct Axis {
  Scale scale;
  std::string name;
  int about = 5;                 ///< ticks
  std::vector<Tick> named = {};  ///< these and no others
};

/// The ticks of an axis whose texts do not touch each other. On a logarithmic axis the ends and the powers of ten come
/// first.
/// \param length      of the axis, in units of the drawing
/// \param horizontal  texts stand beside each other
std::vector<Tick> ticks_of(const Axis& axis, double length, bool horizontal);

/// The smallest step of 1, 2 or 5 times a power of ten that divides a range into at most `about` parts.
double round_step(double range, int about);
/// The nearest 1, 2 or 5 times a power of ten that is not below (`up`) or not above v > 0.
double round_number(double v, bool up);
/// From 0 to a multiple of the step of about `parts` parts.
Scale from_zero(double high, int parts);
/// Round limits around a range; powers of ten where it is logarithmic.
Scale round_limits(double low, double high, bool log);
/// Limits of a logarithmic axis for errors: a single error near zero must not compress all others.
/// \param mean  of the smaller errors
Scale log_error_scale(double low, double high, double mean);

/// Bins of a histogram of n values.
std::size_t bin_count(std::size_t n);
/// How many values lie in each of the bins of equal width on a scale; values outside are in the first and the last.
std::vector<std::size_t> histogram(const std::vector<double>& values, const Scale& scale, std::size_t bins);

}  // namespace flexcomp::host
