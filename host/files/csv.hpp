// SPDX-License-Identifier: Apache-2.0
/// \file
/// Comma-separated text with one header line. Strict: a row is read in full or refused with its line.
#ifndef FLEXCOMP_HOST_FILES_CSV_HPP
#define FLEXCOMP_HOST_FILES_CSV_HPP

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

  /// Index of a column, or nothing.
  std::optional<std::size_t> find(std::string_view name) const;
  bool has(std::string_view name) const { return find(name).has_value(); }

  /// Index of a column that must be there. `candidates` are columns that it could have been meant by.
  /// \throws InputError naming the column, what it is for, and what comes near
  std::size_t require(std::string_view name, std::string_view purpose,
                      std::span<const std::string> candidates = {}) const;

  /// A cell in SI. \throws InputError file:line: column where it is empty or no finite number
  double number(const CsvRow& row, std::size_t column, const Unit& unit) const;
};

/// Reads a file with LF or CRLF ends and with or without byte-order mark; cells may be quoted ("" is one quote) and
/// have blanks around them. Only lines after the last row may be empty.
/// \throws InputError  file absent or empty, a column named twice or not at all, a row with another number of cells
CsvTable read_csv(const std::string& path);

/// One cell, quoted where it must be.
std::string csv_cell(std::string_view text);

}  // namespace flexcomp::host

#endif
