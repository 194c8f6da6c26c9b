// SPDX-License-Identifier: Apache-2.0
/// \file
/// The plots of a page as inline SVG. Colours come from the page's style sheet by class, so that one drawing serves
/// light, dark and paper. Of very many poses a part is drawn (shown_poses()), so that a page stays small. Drawn for the width of a phone; wider screens put several beside each other.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "report/page.hpp"

namespace flexcomp::host {

/// How much is drawn of very many poses: more dots than these cover each other on a drawing of this size, and fill the page.
struct Detail {
  std::size_t dots = 1000;
  std::size_t dots_of_three = 700;  ///< where each pose has three
  std::size_t steps = 400;          ///< of a sorted line
};

/// Errors before and after over the same poses, in the unit in which they are shown.
struct ErrorPairs {
  std::vector<double> before;
  std::vector<double> after;
  std::string unit;  ///< "mm" or "deg"
  std::optional<double> floor = {};
  std::string quantity = "error";          ///< of the axis: "position error"
  std::vector<std::size_t> outliers = {};  ///< ascending; marked where each pose is drawn
};

/// Whether an axis for both would press one of them onto zero, were it not logarithmic.
bool is_logarithmic(const ErrorPairs& errors);

enum class CurveStyle {
  usual,   ///< a line, with dots where they are few; over cases dots alone
  joined,  ///< the same, and a line over cases too
  line,
  dots,
  steps  ///< each value stays until the next
};

struct Curve {
  std::string name = {};
  std::vector<std::array<double, 2>> points = {};  ///< x, y
  CurveStyle style = CurveStyle::usual;
  /// after, before, x, y, z; empty: by its place in the list, told apart by colour and by dashes
  std::string colour = {};
  std::vector<std::array<double, 2>> band = {};  ///< low and high beside each point, or empty
};

/// Any quantity over any other: up to six curves with their names.
struct Curves {
  static constexpr std::size_t most = 6;

  std::string described;  ///< for those who do not see it
  std::string x_name;
  std::string y_name;
  /// Where x counts cases 0, 1, 2 …: their names; points are then not joined.
  std::vector<std::string> x_texts = {};
  bool log_y = false;
  std::vector<Curve> curves = {};
  std::optional<double> floor = {};  ///< the noise, as a line across
  bool x_from_zero = false;          ///< the axis begins there, whatever the curves do
};
/// \return empty where there is nothing to draw
std::string plot_curves(const Curves& curves);

/// Each pose in the order of the data, before above after.
std::string plot_in_order(const ErrorPairs& errors, const Detail& detail = {});
/// Which share of the poses lies below which error.
std::string plot_sorted(const ErrorPairs& errors, const Detail& detail = {});
/// How many poses lie in which class of errors.
std::string plot_histogram(const ErrorPairs& errors);
/// The three components of the position error that is left, against something known at every pose: what has a shape is not
/// noise.
/// \param values     one per pose
/// \param axis       "q1 [deg]"
/// \param described  what they are, for those who do not see it: "the angle of joint 1"
std::string plot_against(const std::vector<PagePose>& poses, const std::vector<double>& values,
                         const std::string& axis, const std::string& described, const Detail& detail = {});

/// Named amounts of 0 or more as bars, one above the other, before and after.
struct Bars {
  std::string described;
  std::string x_name;
  std::vector<std::string> names;
  std::vector<double> before;
  std::vector<double> after;  ///< as many, or none
};
/// \return empty where all are 0
std::string plot_bars(const Bars& bars);

/// Where the poses of a plan lie between each joint's limits; those that were measured already above them.
std::string plot_coverage(const PagePlan& plan);

}  // namespace flexcomp::host
