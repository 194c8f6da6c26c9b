// SPDX-License-Identifier: Apache-2.0
/// \file Tables as instruments and robots write them: fields separated by comma, semicolon, tab or blanks,
/// numbers with a decimal point or comma, lines of explanation before the table, comments between. Our own
/// files are read by csv.hpp.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "error_code.hpp"
#include "exchange/time_stamp.hpp"
#include "units.hpp"

namespace flexcomp::host {

struct Dialect {
  char delimiter = ',';  ///< ',' ';' '\t', or ' ' for any run of blanks and tabs
  char decimal = '.';    ///< '.' or ','
};
/// For people: "semicolon", "decimal comma".
std::string words(const Dialect& dialect);

struct DialectChoice {
  std::optional<char> delimiter;  ///< where not given: worked out
  std::optional<char> decimal;
};

struct TextRow {
  std::size_t line = 0;  ///< from 1
  std::vector<std::string> cells;
};

class DelimitedText {
 public:
  std::string path;
  Dialect dialect;
  std::vector<std::string> remarks;  ///< comments and what stands before the table, without comment marks
  std::vector<std::size_t> remark_lines;  ///< their lines
  std::optional<TextRow> header;          ///< absent where the table has none
  std::vector<TextRow> rows;              ///< each with as many cells as the header, or as the first row

  /// Settles the decimal mark by what the cells of these columns hold. Those of `small` never hold a thousand. `ambiguous`
  /// is the code of the second error.
  /// \throws InputError  two marks, or both in one cell; commas that could all part thousands (1,234)
  void settle_decimal(const std::vector<std::size_t>& columns, const std::optional<char>& given,
                      const std::vector<std::size_t>& small, ErrorCode ambiguous);

  /// A cell in SI. `name` is the column's, for messages. \throws InputError  empty or no finite number in this dialect
  double number(const TextRow& row, std::size_t column, const Unit& unit) const;
  /// The time stamp in this text of a cell or two. \throws InputError  none that is known
  TimeStamp time(const TextRow& row, std::size_t column, const std::string& text, const Unit& unit) const;
  std::string column_label(std::size_t column) const;  ///< "Y" or "column 3"
};

/// Whether these cells are the names of the columns that the reader needs.
using IsHeader = std::function<bool(const std::vector<std::string>& cells)>;

/// Reads a table. The header is the first line, comment or not, that `is_header` takes; all lines after it are rows or
/// comments (# // ! % at the beginning). Where there is none, all lines but remarks ("Key: value", "units …") are rows, and
/// the last three cells of each are numbers. Empty lines are skipped.
/// `header` says what header is expected where there must be one, `no_header` is the code where it is absent.
/// Text is UTF-8, or else Latin-1; lines end with LF, CR LF or CR. The cells are UTF-8.
/// \throws InputError  absent, empty, not 8-bit text; line ends of two kinds, of which one is CR alone; a row with another number of cells (file:line); no table; without
///                     header two ways to part the fields that differ
DelimitedText read_delimited(const std::string& path, const DialectChoice& choice, const IsHeader& is_header,
                             const std::string& header = "", ErrorCode no_header = ErrorCode::none);

/// A number with this decimal mark and no other sign in it; nothing where it is none.
std::optional<double> parse_number(std::string_view text, char decimal, const Unit& unit);

/// Whether this is a number with either decimal mark.
bool is_number(std::string_view text);

}  // namespace flexcomp::host
