// SPDX-License-Identifier: Apache-2.0
#include "files/csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "files/read_file.hpp"
#include "files/text.hpp"
#include "input_error.hpp"
#include "nearest.hpp"

namespace flexcomp::host {

namespace {

/// Splits one line into cells.
std::vector<std::string> split(std::string_view line, const std::string& path, std::size_t number) {
  std::vector<std::string> cells;
  std::size_t at = 0;
  for (;;) {
    const std::size_t start = line.find_first_not_of(" \t", at);
    const bool quoted = start != std::string_view::npos && line[start] == '"';
    std::string cell;
    if (quoted) {
      at = start + 1;
      for (;; ++at) {
        if (at >= line.size())
          throw InputError(path, number, "", "a quoted cell that ends on its line", "no end");
        if (line[at] != '"') {
          cell += line[at];
        } else if (at + 1 < line.size() && line[at + 1] == '"') {
          cell += line[at++];
        } else {
          ++at;
          break;
        }
      }
    }
    const std::size_t comma = std::min(line.find(',', at), line.size());
    const std::string_view rest = trimmed(line.substr(at, comma - at));
    if (quoted && !rest.empty())
      throw InputError(path, number, "", "a comma after a quoted cell", fmt::format("'{}'", rest));
    cells.push_back(quoted ? std::move(cell) : std::string(rest));
    if (comma == line.size()) return cells;
    at = comma + 1;
  }
}

}  // namespace

std::optional<std::size_t> CsvTable::find(std::string_view name) const {
  for (std::size_t k = 0; k < header.size(); ++k) {
    if (header[k] == name) return k;
  }
  return {};
}

std::size_t CsvTable::require(std::string_view name, std::string_view purpose,
                              std::span<const std::string> candidates) const {
  if (const auto column = find(name)) return *column;
  const std::string near = nearest(name, candidates);
  throw InputError(path, 1, std::string(name), fmt::format("this column ({})", purpose),
                   near.empty() ? fmt::format("none; the columns are {}", fmt::join(header, ", "))
                                : fmt::format("none, but '{}'", near),
                   ErrorCode::missing_column);
}

double CsvTable::number(const CsvRow& row, std::size_t column, const Unit& unit) const {
  const std::string& cell = row.cells[column];
  if (const auto value = parse_si(cell, unit)) return *value;
  throw InputError(path, row.line, header[column], "a finite number",
                   cell.empty() ? "an empty cell" : fmt::format("'{}'", cell));
}

CsvTable read_csv(const std::string& path) {
  const std::string content = read_file(path);
  std::string_view text = content;
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  if (text.find('\0') != std::string_view::npos) throw InputError(path, 0, "", "text", "a zero byte");

  CsvTable table;
  table.path = path;
  std::size_t empty_line = 0;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text = end == std::string_view::npos ? std::string_view() : text.substr(end + 1);
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (trimmed(line).empty()) {
      if (empty_line == 0) empty_line = number;
      continue;
    }
    if (empty_line != 0)
      throw InputError(path, empty_line, "", "a row (only the end may be empty)", "an empty line");
    std::vector<std::string> cells = split(line, path, number);
    if (number == 1) {
      table.header = std::move(cells);
      for (std::size_t k = 0; k < table.header.size(); ++k) {
        if (table.header[k].empty()) {
          throw InputError(path, 1, fmt::format("column {}", k + 1), "a name", "an empty cell");
        }
        for (std::size_t j = 0; j < k; ++j) {
          if (table.header[j] == table.header[k]) {
            throw InputError(path, 1, table.header[k], "each column once",
                             fmt::format("it as columns {} and {}", j + 1, k + 1));
          }
        }
      }
      continue;
    }
    if (cells.size() != table.header.size()) {
      throw InputError(path, number, "", fmt::format("{} cells, as in the header", table.header.size()),
                       fmt::format("{}", cells.size()));
    }
    table.rows.push_back({number, std::move(cells)});
  }
  if (table.header.empty())
    throw InputError(path, 1, "", "a header line with the names of the columns", "nothing");
  return table;
}

std::string csv_cell(std::string_view text) {
  if (text.find_first_of(",\"\r\n") == std::string_view::npos && trimmed(text) == text)
    return std::string(text);
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"') quoted += '"';
    quoted += c;
  }
  return quoted + '"';
}

}  // namespace flexcomp::host
