// SPDX-License-Identifier: Apache-2.0
/// \file
/// Units as other programs declare them: in the name of a column ("X [mm]", "j1_deg") or in a line before the table
/// ("// Units: Millimeters, Degrees").
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "exchange/delimited_text.hpp"
#include "units.hpp"

namespace flexcomp::host {

/// By any of its usual names (mm, millimetres, inch …), in any case; nothing where it is none.
std::optional<Unit> length_unit_of(std::string_view word);
std::optional<Unit> angle_unit_of(std::string_view word);
std::optional<Unit> time_unit_of(std::string_view word);
/// Of joints' motors, loads and the like (V, Nm, deg/s, kg): known, and no angle.
bool is_no_angle(std::string_view word);

/// The names that an option takes.
const std::vector<std::string>& length_unit_names();
const std::vector<std::string>& angle_unit_names();
const std::vector<std::string>& time_unit_names();

/// A column's name in two parts.
struct ColumnName {
  std::string stem;  ///< lower case, letters and digits only: "Measured X [mm]" -> "measuredx"
  std::string unit;  ///< as written, without brackets; empty where the name has none
};

/// A unit stands in brackets at the end, or behind the last underscore or blank where it is a known one.
ColumnName column_name(std::string_view cell);

/// Something that says in which unit a column is.
struct UnitSource {
  std::optional<Unit> unit;  ///< nothing where it says nothing
  std::string by;            ///< "line 3", "the column's name"
};

/// The unit on which all that say one agree: of two that differ neither wins. Nothing where nobody says one.
/// \throws InputError  path:line: field: two that differ
std::optional<Unit> agreed_unit(const std::string& path, std::size_t line, const std::string& field,
                                const std::vector<UnitSource>& sources);

using UnitOf = std::optional<Unit> (*)(std::string_view word);

/// The unit in a column's name; nothing where the name has none.
/// \throws InputError  path:line: label: a unit that `unit_of` does not know; `known` says in words which it does
std::optional<Unit> unit_in_name(const std::string& path, std::size_t line, const std::string& label,
                                 UnitOf unit_of, const std::string& known);

/// What lines before and between the rows declare: "Units: Millimeters, Degrees", "Unit = mm", "Units are in inches". A line
/// that has the word unit in another meaning ("tracker unit 3, 5 m away") declares nothing.
struct DeclaredUnits {
  UnitSource length;
  UnitSource angle;
  UnitSource time;
};
/// \throws InputError  two units of one kind, in one line or in two; "units:" without any that is known
DeclaredUnits declared_units(const DelimitedText& table);

}  // namespace flexcomp::host
