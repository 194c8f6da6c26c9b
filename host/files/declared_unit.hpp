/// \file
/// Units as other programs declare them: in the name of a column ("X [mm]", "j1_deg") or in a line before the table
/// ("// Units: Millimeters, Degrees").
#ifndef FLEXCOMP_HOST_FILES_DECLARED_UNIT_HPP
#define FLEXCOMP_HOST_FILES_DECLARED_UNIT_HPP

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "units.hpp"

namespace flexcomp::host {

/// By any of its usual names (mm, millimetres, inch …), in any case; nothing where it is none.
std::optional<Unit> length_unit_of(std::string_view word);
std::optional<Unit> angle_unit_of(std::string_view word);
std::optional<Unit> time_unit_of(std::string_view word);

/// The names that an option takes.
const std::vector<std::string>& length_unit_names();
const std::vector<std::string>& angle_unit_names();

/// A column's name in two parts.
struct ColumnName {
  std::string stem;  ///< lower case, letters and digits only: "Measured X [mm]" -> "measuredx"
  std::string unit;  ///< as written, without brackets; empty where the name has none
};

/// A unit stands in brackets at the end, or behind the last underscore or blank where it is a known one.
ColumnName column_name(std::string_view cell);

/// What lines that speak of units declare; the first line that says something wins, `contradicts` holds one that says
/// something else.
struct DeclaredUnits {
  std::optional<Unit> length;
  std::optional<Unit> angle;
  std::optional<std::size_t> contradicts;  ///< index of the line
};
DeclaredUnits declared_units(const std::vector<std::string>& lines);

}  // namespace flexcomp::host

#endif
