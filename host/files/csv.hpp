// SPDX-License-Identifier: Apache-2.0
/// \file
/// Comma-separated text (RFC 4180) with one header line. Strict: a malformed row is refused with its line.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "units.hpp"

namespace flexcomp::host {

struct CsvRow {
  std::size_t line = 0;  ///< from 1
  std::vector<std::string> cells;
};

class CsvTable {
 public:
  std::string path;
  std::vector<std::string> header;
  std::vector<CsvRow> rows;

  /// Index of a column, if there is one.
  std::optional<std::size_t> find(std::string_view name) const;
  bool has(std::string_view name) const { return find(name).has_value(); }

  /// Index of a required column. \param candidates  columns that may be misspellings of it
  /// \throws InputError  naming the column, its purpose, and the nearest candidate
  std::size_t require(std::string_view name, std::string_view purpose,
                      std::span<const std::string> candidates = {}) const;

  /// Number of a cell, in SI. \throws InputError file:line: column where it is empty or no finite number
  double number(const CsvRow& row, std::size_t column, const Unit& unit) const;
};

/// Reads a CSV file: LF or CRLF, optional byte-order mark; cells may be quoted ("" is one quote) and have blanks around
/// them. Only lines after the last row may be empty.
/// \throws InputError  file absent or empty, a column named twice or not at all, a row with another number of cells
CsvTable read_csv(const std::string& path);

/// Formats one cell, quoted where necessary.
std::string csv_cell(std::string_view text);

}  // namespace flexcomp::host
