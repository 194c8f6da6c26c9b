// SPDX-License-Identifier: Apache-2.0
#include "exchange/delimited_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

#include "files/read_file.hpp"
#include "files/text.hpp"
#include "input_error.hpp"
#include "utf8.hpp"

namespace flexcomp::host {

namespace {

constexpr std::array<char, 4> delimiters{'\t', ';', ',', ' '};
constexpr std::size_t least_numbers = 3;

struct Line {
  std::size_t number = 0;
  std::string_view text;  ///< trimmed, without comment mark
  bool comment = false;
};

std::optional<std::string_view> without_comment_mark(std::string_view line) {
  for (const std::string_view mark : {"//", "#", "!", "%"}) {
    if (line.starts_with(mark)) {
      while (!mark.empty() && line.starts_with(mark)) line.remove_prefix(mark.size());
      return trimmed(line);
    }
  }
  return {};
}

bool is_utf8(std::string_view text) {
  while (!text.empty()) {
    const std::size_t bytes = utf8_length(text);
    if (bytes == 0) return false;
    text.remove_prefix(bytes);
  }
  return true;
}

std::string from_latin1(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x80) {
      out += c;
    } else {
      out += static_cast<char>(0xC0U | (byte >> 6U));
      out += static_cast<char>(0x80U | (byte & 0x3FU));
    }
  }
  return out;
}

/// \throws InputError  a CR alone in a file with LF
std::vector<Line> lines_of(const std::string& path, std::string_view text) {
  std::vector<Line> lines;
  const char line_end = text.find('\n') == std::string_view::npos ? '\r' : '\n';
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find(line_end);
    std::string_view line = text.substr(0, end);
    text = end == std::string_view::npos ? std::string_view() : text.substr(end + 1);
    while (line.ends_with('\r')) line.remove_suffix(1);
    if (line.find('\r') != std::string_view::npos) {
      throw InputError(path, number, "", "lines that all end with LF, CR LF or CR",
                       "a CR alone within the line");
    }
    // A tab at either end of a line may be an empty field.
    if (trimmed(line).empty()) continue;
    if (const auto comment = without_comment_mark(trimmed(line))) {
      lines.push_back({number, *comment, true});
    } else {
      lines.push_back({number, line, false});
    }
  }
  return lines;
}

/// One line into cells, or nothing where a quoted cell has no end or something behind it.
std::optional<std::vector<std::string>> split(std::string_view line, char delimiter) {
  std::vector<std::string> cells;
  const bool blanks = delimiter == ' ';
  const char* const around = delimiter == '\t' ? " " : " \t";
  std::size_t at = 0;
  for (;;) {
    at = std::min(line.find_first_not_of(around, at), line.size());
    if (blanks && at == line.size()) return cells;
    std::string cell;
    if (at < line.size() && line[at] == '"') {
      for (++at;; ++at) {
        if (at >= line.size()) return {};
        if (line[at] != '"') {
          cell += line[at];
        } else if (at + 1 < line.size() && line[at + 1] == '"') {
          cell += line[at++];
        } else {
          ++at;
          break;
        }
      }
      cell = std::string(trimmed(cell));
      const std::size_t next = std::min(line.find_first_not_of(around, at), line.size());
      if (blanks ? next == at && next < line.size() : next < line.size() && line[next] != delimiter)
        return {};
      at = next;
    } else {
      std::size_t end = blanks ? line.find_first_of(" \t", at) : line.find(delimiter, at);
      end = std::min(end, line.size());
      cell = std::string(trimmed(line.substr(at, end - at)));
      at = end;
    }
    // "X [mm]" is one name, also where blanks part the fields.
    if (blanks && !cells.empty() && (cell.starts_with('[') || cell.starts_with('('))) {
      cells.back() += " " + cell;
    } else {
      cells.push_back(std::move(cell));
    }
    if (blanks) continue;
    if (at >= line.size()) return cells;
    ++at;
    if (at >= line.size()) {
      cells.emplace_back();
      return cells;
    }
  }
}

/// Exports end their lines with a delimiter, or do not.
void drop_empty_end(std::vector<std::string>& cells, std::size_t columns) {
  if (cells.size() == columns + 1 && cells.back().empty()) cells.pop_back();
}

bool is_remark(std::string_view line) {
  const std::string text = lower(line);
  if (text.find("unit") != std::string::npos) return true;
  const auto colon = text.find(':');
  return colon != std::string::npos && colon + 1 < text.size() && text[colon + 1] != ':' &&
         std::isalpha(static_cast<unsigned char>(text.front())) != 0;
}

InputError wrong_cells(const std::string& path, const Line& line, const Dialect& dialect, std::size_t wanted,
                       std::size_t found, const char* as_in) {
  return {path, line.number, "",
          fmt::format("{} fields separated by {}, {}", wanted, words(Dialect{dialect.delimiter, '.'}), as_in),
          fmt::format("{}: '{}'", found, line.text)};
}

struct Headerless {
  Dialect dialect;
  std::vector<TextRow> rows;
};

/// The lines as rows of one dialect, as far as they are.
Headerless as_rows(const std::vector<Line>& lines, Dialect dialect) {
  Headerless out{dialect, {}};
  for (const Line& line : lines) {
    auto cells = split(line.text, dialect.delimiter);
    if (!cells) return out;
    if (!out.rows.empty()) drop_empty_end(*cells, out.rows.front().cells.size());
    if (out.rows.empty() && cells->size() > least_numbers && cells->back().empty()) cells->pop_back();
    if (cells->size() < least_numbers) return out;
    if (!out.rows.empty() && cells->size() != out.rows.front().cells.size()) return out;
    for (std::size_t k = cells->size() - least_numbers; k < cells->size(); ++k) {
      if (!parse_number((*cells)[k], dialect.decimal, unit::si)) return out;
    }
    out.rows.push_back({line.number, std::move(*cells)});
  }
  return out;
}

/// Whether the comma of a number may stand between thousands: 1,234 but not 0,123 nor 1234,567 nor 1,23.
bool may_part_thousands(std::string_view number) {
  if (number.starts_with('-') || number.starts_with('+')) number.remove_prefix(1);
  const auto comma = number.find(',');
  const auto digits = [](std::string_view text) {
    return std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
  };
  return comma != std::string_view::npos && comma >= 1 && comma <= 3 && number.front() != '0' &&
         digits(number.substr(0, comma)) && number.size() == comma + 4 && digits(number.substr(comma + 1));
}

bool same_cells(const Headerless& a, const Headerless& b) {
  if (a.rows.front().cells.size() != b.rows.front().cells.size()) return false;
  for (std::size_t k = 0; k < a.rows.size(); ++k) {
    if (a.rows[k].cells != b.rows[k].cells) return false;
  }
  return true;
}

}  // namespace

std::string words(const Dialect& dialect) {
  const char* const mark = dialect.delimiter == '\t'  ? "tab"
                           : dialect.delimiter == ';' ? "semicolon"
                           : dialect.delimiter == ',' ? "comma"
                                                      : "blanks";
  return dialect.decimal == ',' ? fmt::format("{}, decimal comma", mark) : mark;
}

std::optional<double> parse_number(std::string_view text, char decimal, const Unit& unit) {
  if (decimal == '.') return parse_si(text, unit);
  if (text.find('.') != std::string_view::npos) return {};
  const auto comma = text.find(',');
  if (comma == std::string_view::npos) return parse_si(text, unit);
  // As with a point: a digit on both sides, or nothing is sure.
  if (comma + 1 >= text.size() || text.find(',', comma + 1) != std::string_view::npos) return {};
  std::string number(text);
  number[comma] = '.';
  return parse_si(number, unit);
}

bool is_number(std::string_view text) {
  return parse_number(text, '.', unit::si) || parse_number(text, ',', unit::si);
}

void DelimitedText::settle_decimal(const std::vector<std::size_t>& columns, const std::optional<char>& given,
                                   const std::vector<std::size_t>& small, ErrorCode ambiguous) {
  if (given) {
    dialect.decimal = *given;
    return;
  }
  char seen = 0;
  const TextRow* first = nullptr;
  std::size_t first_column = 0;
  bool sure = false;
  for (const TextRow& row : rows) {
    for (const std::size_t c : columns) {
      const std::string& cell = row.cells[c];
      const bool point = cell.find('.') != std::string::npos;
      const bool comma = cell.find(',') != std::string::npos;
      if (!point && !comma) continue;
      const char mark = comma ? ',' : '.';
      if ((point && comma) || (seen != 0 && mark != seen)) {
        throw InputError(path, row.line, column_label(c),
                         seen == 0 || (point && comma)
                             ? std::string("a number with a decimal point or a decimal comma alone")
                             : fmt::format("a decimal '{}' as in line {}", seen, first->line),
                         "'" + cell + "'");
      }
      if (seen == 0) {
        first = &row;
        first_column = c;
      }
      seen = mark;
      sure = sure || mark == '.' || !may_part_thousands(cell) ||
             std::find(small.begin(), small.end(), c) != small.end();
    }
  }
  if (seen == 0) return;
  if (!sure) {
    throw InputError(
        path, first->line, column_label(first_column),
        "a number whose comma is certainly a decimal comma; commas that separate thousands are not read",
        "'" + first->cells[first_column] + "'", ambiguous);
  }
  dialect.decimal = seen;
}

double DelimitedText::number(const TextRow& row, std::size_t column, const Unit& unit) const {
  const std::string& cell = row.cells[column];
  if (const auto value = parse_number(cell, dialect.decimal, unit)) return *value;
  throw InputError(
      path, row.line, column_label(column),
      fmt::format("a finite number with a decimal {}", dialect.decimal == ',' ? "comma" : "point"),
      cell.empty() ? "an empty field" : "'" + cell + "'");
}

TimeStamp DelimitedText::time(const TextRow& row, std::size_t column, const std::string& text,
                              const Unit& unit) const {
  if (const auto stamp = time_stamp(text, unit, dialect.decimal)) return *stamp;
  throw InputError(path, row.line, column_label(column), "seconds, 12:30:05.25 or 2026-03-01T12:30:05.25",
                   "'" + text + "'");
}

std::string DelimitedText::column_label(std::size_t column) const {
  return header ? header->cells[column] : fmt::format("column {}", column + 1);
}

namespace {

/// The text in UTF-8, without byte order mark. \throws InputError  UTF-16 or no text
std::string decoded(const std::string& path) {
  const std::string content = read_file(path);
  std::string_view text = content;
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF") ||
      text.find('\0') != std::string_view::npos) {
    throw InputError(path, 0, "", "text in UTF-8 or Latin-1 (export it so, or: iconv -f UTF-16 -t UTF-8)",
                     "UTF-16 or no text");
  }
  return is_utf8(text) ? std::string(text) : from_latin1(text);
}

void add_remark(DelimitedText& table, const Line& line) {
  table.remarks.emplace_back(line.text);
  table.remark_lines.push_back(line.number);
}

/// Sets header and delimiter. Returns the index of the header's line; nothing where there is none.
std::optional<std::size_t> find_header(DelimitedText& out, const std::vector<Line>& lines,
                                       const std::vector<char>& tried, const IsHeader& is_header) {
  for (std::size_t k = 0; k < lines.size(); ++k) {
    for (const char delimiter : tried) {
      auto cells = split(lines[k].text, delimiter);
      if (!cells) continue;
      if (cells->size() > 1 && cells->back().empty()) cells->pop_back();
      if (!is_header(*cells)) continue;
      out.dialect.delimiter = delimiter;
      out.header = TextRow{lines[k].number, std::move(*cells)};
      return k;
    }
  }
  return {};
}

void read_below_header(DelimitedText& out, const std::vector<Line>& lines, std::size_t header) {
  const std::size_t wanted = out.header->cells.size();
  for (std::size_t k = 0; k < lines.size(); ++k) {
    if (k == header) continue;
    if (k < header || lines[k].comment) {
      add_remark(out, lines[k]);
      continue;
    }
    auto cells = split(lines[k].text, out.dialect.delimiter);
    if (cells) drop_empty_end(*cells, wanted);
    if (!cells || cells->size() != wanted) {
      throw wrong_cells(out.path, lines[k], out.dialect, wanted, cells ? cells->size() : 0,
                        "as in the header");
    }
    out.rows.push_back({lines[k].number, std::move(*cells)});
  }
  if (out.rows.empty()) throw InputError(out.path, 0, "", "a row below the header", "none");
}

/// By the one dialect in which all lines but remarks are rows.
void read_without_header(DelimitedText& out, const std::vector<Line>& lines, const std::vector<char>& tried,
                         const std::optional<char>& decimal) {
  std::vector<Line> table;
  for (const Line& line : lines) {
    if (line.comment || (table.empty() && is_remark(line.text))) {
      add_remark(out, line);
    } else {
      table.push_back(line);
    }
  }
  if (table.empty()) throw InputError(out.path, 0, "", "a table", "comments alone");
  std::optional<Headerless> found;
  std::size_t readable = 0;  // rows before the line that stands against every dialect
  for (const char delimiter : tried) {
    for (const char mark : {'.', ','}) {
      if (decimal && *decimal != mark) continue;
      Headerless rows = as_rows(table, {delimiter, mark});
      readable = std::max(readable, rows.rows.size());
      if (rows.rows.size() != table.size()) continue;
      if (found && !same_cells(*found, rows)) {
        throw InputError(out.path, table.front().number, "", "one way to separate the fields",
                         fmt::format("{} as well as {}", words(found->dialect), words(rows.dialect)),
                         ErrorCode::ambiguous_dialect);
      }
      if (!found) found = std::move(rows);
    }
  }
  if (!found) {
    throw InputError(out.path, table[readable].number, "",
                     "a header with the names of the columns, or a row as the ones before whose last three "
                     "fields are numbers",
                     fmt::format("'{}'", table[readable].text));
  }
  out.dialect = found->dialect;
  out.rows = std::move(found->rows);
}

}  // namespace

DelimitedText read_delimited(const std::string& path, const DialectChoice& choice, const IsHeader& is_header,
                             const std::string& header, ErrorCode no_header) {
  const std::string text = decoded(path);
  const std::vector<Line> lines = lines_of(path, text);
  if (lines.empty()) throw InputError(path, 0, "", "a table of measured points or joints", "nothing in it");
  std::vector<char> tried(delimiters.begin(), delimiters.end());
  if (choice.delimiter) tried = {*choice.delimiter};
  DelimitedText out;
  out.path = path;
  if (const auto at = find_header(out, lines, tried, is_header)) {
    read_below_header(out, lines, *at);
  } else if (!header.empty()) {
    throw InputError(path, lines.front().number, "", header, fmt::format("'{}'", lines.front().text),
                     no_header);
  } else {
    read_without_header(out, lines, tried, choice.decimal);
  }
  return out;
}

}  // namespace flexcomp::host
