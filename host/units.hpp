// SPDX-License-Identifier: Apache-2.0
/// \file
/// Units of files, and conversion between text and SI. Inside everything is SI.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace flexcomp::host {

/// A file's unit as the exact ratio SI = file * multiply / divide. A ratio, because 1/1000 has no exact binary form:
/// 70 mm must become the double nearest to 0.07.
struct Unit {
  std::string_view name;  ///< e.g. "mm"; empty for SI itself
  long double multiply = 1;
  long double divide = 1;

  double si_per_file_unit() const { return static_cast<double>(multiply / divide); }
};

namespace unit {
constexpr long double pi = 3.14159265358979323846264338327950288L;
constexpr Unit si{"", 1, 1};
constexpr Unit mm{"mm", 1, 1000};
constexpr Unit degree{"deg", pi, 180};
constexpr Unit mm_per_hour{"mm/h", 1, 3600000};
constexpr Unit degree_per_hour{"deg/h", pi, 648000};
}  // namespace unit

constexpr double pi = 3.14159265358979323846;
/// Rounded once, as parse_si() does: radians(133.5) is what a file's 133.5 becomes.
constexpr double radians(double degrees) {
  return static_cast<double>(static_cast<long double>(degrees) * unit::pi / 180);
}
constexpr double degrees(double radians) {
  return static_cast<double>(static_cast<long double>(radians) * 180 / unit::pi);
}

/// Whole text to SI: an optional sign, digits, an optional exponent; nothing before or after. Unit conversion happens
/// in long double and is rounded once. Nothing where the text is not a finite number.
std::optional<double> parse_si(std::string_view text, const Unit& unit);

/// To ten decimals of the file's unit, without a negative zero: what arithmetic made 89.99999999999999 is 90 again, and
/// no arm notices the 1e-10 mm.
double tidied(double si, const Unit& unit);

/// The fewest digits (6 or more where they are not zeros) from which parse_si() gives back the identical double.
std::string format_si(double si, const Unit& unit);

}  // namespace flexcomp::host
