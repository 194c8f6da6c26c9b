// SPDX-License-Identifier: Apache-2.0
#include "exchange/point_list.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "exchange/declared_unit.hpp"
#include "input_error.hpp"
#include "nearest.hpp"
#include "quaternion.hpp"

namespace flexcomp::host {

namespace {

using Columns = std::map<std::string, std::size_t>;  // role -> column

/// Roles and the stems by which headers call them, "measured" and its like taken off.
const std::vector<std::pair<std::string, std::vector<std::string>>>& vocabulary() {
  static const std::vector<std::pair<std::string, std::vector<std::string>>> all{
      {"name",
       {"name", "point", "pointname", "pointid", "id", "label", "object", "objectname", "feature",
        "featurename", "target", "no", "nr", "number", "punkt", "collectiongrouppoint", "grouppoint",
        "pointnumber"}},
      {"collection", {"collection"}},
      {"group", {"group", "pointgroup"}},
      {"x", {"x"}},
      {"y", {"y"}},
      {"z", {"z"}},
      {"rx", {"rx", "rotx"}},
      {"ry", {"ry", "roty"}},
      {"rz", {"rz", "rotz"}},
      {"a", {"a"}},
      {"b", {"b"}},
      {"c", {"c"}},
      {"qw", {"qw"}},
      {"qx", {"qx"}},
      {"qy", {"qy"}},
      {"qz", {"qz"}},
      {"sigma", {"sigma", "uncertainty", "std", "stddev", "σ"}},
      {"sx", {"ux", "sx", "sigmax", "σx", "stdx", "stddevx", "uncertaintyx", "xsigma", "xuncertainty"}},
      {"sy", {"uy", "sy", "sigmay", "σy", "stdy", "stddevy", "uncertaintyy", "ysigma", "yuncertainty"}},
      {"sz", {"uz", "sz", "sigmaz", "σz", "stdz", "stddevz", "uncertaintyz", "zsigma", "zuncertainty"}},
      {"time", {"time", "timestamp", "t", "datetime", "zeit"}},
      {"date", {"date", "datum"}}};
  return all;
}

std::string role_of_stem(std::string stem) {
  for (const std::string_view word : {"measured", "meas", "actual", "act"}) {
    if (stem.size() > word.size() && stem.starts_with(word)) {
      stem.erase(0, word.size());
      break;
    }
    if (stem.size() > word.size() && stem.ends_with(word)) {
      stem.erase(stem.size() - word.size());
      break;
    }
  }
  for (const auto& [role, stems] : vocabulary()) {
    if (std::find(stems.begin(), stems.end(), stem) != stems.end()) return role;
  }
  return {};
}

bool has_position(const std::vector<std::string>& cells) {
  std::array<bool, 3> there{};
  for (const std::string& cell : cells) {
    const std::string role = role_of_stem(column_name(cell).stem);
    if (role.size() == 1 && role[0] >= 'x' && role[0] <= 'z')
      there[static_cast<std::size_t>(role[0] - 'x')] = true;
  }
  return there[0] && there[1] && there[2];
}

bool is_name(const std::string& role) { return role == "name" || role == "group" || role == "collection"; }

class PointReader {
 public:
  PointReader(const std::string& path, const PointListOptions& options) : options_(options) {
    const std::vector<std::string>& given = options.columns;
    table_ = read_delimited(path, options.dialect, [&given](const std::vector<std::string>& cells) {
      if (given.empty()) return has_position(cells);
      // With columns that the user names the header only has to be none of the rows.
      if (cells.size() != given.size()) return false;
      for (std::size_t k = 0; k < cells.size(); ++k) {
        if (given[k] != "-" && !is_name(given[k]) && given[k] != "time" && given[k] != "date" &&
            is_number(cells[k]))
          return false;
      }
      return true;
    });
    find_columns();
    find_units();
    std::vector<std::size_t> numbers;
    std::vector<std::size_t> small;  // angles and quaternions
    for (const auto& [role, column] : columns_) {
      if (!is_name(role) && role != "time" && role != "date") numbers.push_back(column);
      if (role.starts_with('q') || role.starts_with('r') || role == "a" || role == "b" || role == "c")
        small.push_back(column);
    }
    table_.settle_decimal(numbers, options.dialect.decimal, small, ErrorCode::ambiguous_decimal_mark);
  }

  PointList read() {
    PointList out;
    out.path = table_.path;
    out.dialect = table_.dialect;
    out.length = length_;
    out.names = has("name") || has("group") || has("collection");
    out.orientations = has("qw") || has("rx") || has("a");
    out.sigmas = has("sigma") || has("sx");
    out.times = has("time");
    out.unused = unused_;
    for (const TextRow& row : table_.rows) out.points.push_back(point(row, out));
    return out;
  }

 private:
  bool has(const std::string& role) const { return columns_.contains(role); }
  std::size_t header_line() const { return table_.header ? table_.header->line : table_.rows.front().line; }

  InputError error(const std::string& field, const std::string& expected, const std::string& found,
                   ErrorCode code = ErrorCode::none) const {
    return {table_.path, header_line(), field, expected, found, code};
  }

  void find_columns() {
    const std::size_t count = table_.rows.front().cells.size();
    if (!options_.columns.empty()) {
      if (options_.columns.size() != count) {
        throw InputError(table_.path, table_.rows.front().line, "columns",
                         fmt::format("{} names, one for each field", count),
                         fmt::format("{}", options_.columns.size()), ErrorCode::argument);
      }
      for (std::size_t k = 0; k < count; ++k) {
        if (options_.columns[k] != "-") take(options_.columns[k], k);
      }
    } else if (table_.header) {
      for (std::size_t k = 0; k < count; ++k) {
        const std::string role = role_of_stem(column_name(table_.header->cells[k]).stem);
        if (role.empty()) {
          unused_.push_back(table_.header->cells[k]);
        } else {
          take(role, k);
        }
      }
    } else {
      by_position(count);
    }
    require_all({"x", "y", "z"});
    require_all({"rx", "ry", "rz"}, true);
    require_all({"a", "b", "c"}, true);
    require_all({"qw", "qx", "qy", "qz"}, true);
    require_all({"sx", "sy", "sz"}, true);
    // The same twice, as parts and as their sum: the parts are what an instrument knows.
    if (has("sigma") && has("sx")) {
      if (!options_.columns.empty()) {
        throw error("columns", "sigma or sx, sy, sz", "both", ErrorCode::argument);
      }
      unused_.push_back(table_.column_label(columns_.at("sigma")));
      columns_.erase("sigma");
    }
    if (int(has("rx")) + int(has("a")) + int(has("qw")) > 1) {
      throw error("", "one orientation", "several", ErrorCode::several_orientations);
    }
    if (has("date") && !has("time")) throw error("date", "a time beside the date", "none");
  }

  void take(const std::string& role, std::size_t column) {
    const auto [at, is_new] = columns_.emplace(role, column);
    if (!is_new) {
      throw error(table_.column_label(column), fmt::format("one column of {}", role),
                  "another one: " + table_.column_label(at->second), ErrorCode::ambiguous_column);
    }
  }

  /// Without a header: x y z at the end, and before them up to three parts of a name.
  void by_position(std::size_t count) {
    // A name may be a whole number, as long as no other part of the name is a word: "P1 100.5 200.5 300.5 0.015" has a
    // fourth number that is none.
    bool plain = count <= 6;
    const TextRow* shown = &table_.rows.front();
    for (const TextRow& row : table_.rows) {
      bool numbers = false;
      bool fine = true;
      for (std::size_t k = 0; k + 3 < count; ++k) {
        const std::string& cell = row.cells[k];
        if (!is_number(cell)) continue;
        numbers = true;
        fine = fine && cell.find_first_of(".,eE") == std::string::npos;
      }
      if (fine && (count <= 4 || !numbers)) continue;
      if (plain) shown = &row;
      plain = false;
    }
    if (!plain) {
      throw InputError(table_.path, shown->line, "", "name X Y Z, or what the fields mean by a header",
                       fmt::format("{} fields: {}", count, fmt::join(shown->cells, " | ")),
                       ErrorCode::unknown_layout);
    }
    take("x", count - 3);
    take("y", count - 2);
    take("z", count - 1);
    if (count > 3) take("name", count - 4);
    if (count > 4) take("group", count - 5);
    if (count > 5) take("collection", count - 6);
  }

  void require_all(const std::vector<std::string>& roles, bool or_none = false) const {
    std::vector<std::string> missing;
    for (const std::string& role : roles) {
      if (!has(role)) missing.push_back(role);
    }
    if (missing.empty() || (or_none && missing.size() == roles.size())) return;
    throw error(fmt::format("{}", fmt::join(missing, ", ")),
                fmt::format("a column for each of {}", fmt::join(roles, ", ")), "none");
  }

  /// The unit of a kind of columns, on which the header, the lines before it and the option must agree.
  Unit settle(const std::vector<std::string>& roles, const UnitSource& remark, const UnitSource& option,
              UnitOf unit_of, ErrorCode none, const char* kind, const std::vector<std::string>& known) const {
    if (const auto unit = agreed(roles, {remark}, option, unit_of, kind, known)) return *unit;
    throw error(fmt::format("{}", fmt::join(roles, ", ")),
                fmt::format("a unit of {}: in the header (X [mm]), in a line above it (Units: mm)", kind),
                fmt::format("none; the first row has {}", first_values(roles)), none);
  }

  /// The same, but nothing where nobody says one.
  std::optional<Unit> agreed(const std::vector<std::string>& roles, std::vector<UnitSource> sources,
                             const UnitSource& option, UnitOf unit_of, const char* kind,
                             const std::vector<std::string>& known) const {
    std::string field = fmt::format("{}", fmt::join(roles, ", "));
    if (table_.header) {
      for (const std::string& role : roles) {
        const std::string& label = table_.header->cells[columns_.at(role)];
        sources.push_back({unit_in_name(table_.path, header_line(), label, unit_of,
                                        fmt::format("a unit of {} ({})", kind, fmt::join(known, ", "))),
                           fmt::format("the name '{}'", label)});
        if (sources.back().unit) agreed_unit(table_.path, header_line(), field = label, sources);
      }
    }
    sources.push_back(option);
    return agreed_unit(table_.path, header_line(), field, sources);
  }

  std::string first_values(const std::vector<std::string>& roles) const {
    std::vector<std::string> values;
    for (const std::string& role : roles) values.push_back(table_.rows.front().cells[columns_.at(role)]);
    return fmt::format("{}", fmt::join(values, ", "));
  }

  void find_units() {
    const DeclaredUnits declared = declared_units(table_);
    length_ = settle({"x", "y", "z"}, declared.length, options_.length, length_unit_of,
                     ErrorCode::no_length_unit, "length", length_unit_names());
    const auto angle_of = [&](const std::vector<std::string>& roles) {
      return settle(roles, declared.angle, options_.angle, angle_unit_of, ErrorCode::no_angle_unit, "angle",
                    angle_unit_names());
    };
    if (has("rx")) {
      angle_ = angle_of({"rx", "ry", "rz"});
      if (!options_.angles) {
        throw error("rx, ry, rz", "to be told what the angles mean", "nothing",
                    ErrorCode::no_angle_convention);
      }
    }
    if (has("a")) angle_ = angle_of({"a", "b", "c"});
    // Uncertainties may have a unit of their own (µm); without one they have that of the points.
    for (const std::vector<std::string>& roles : {std::vector<std::string>{"sigma"}, {"sx", "sy", "sz"}}) {
      if (has(roles[0]))
        sigma_ = agreed(roles, {}, {}, length_unit_of, "length", length_unit_names()).value_or(length_);
    }
    if (has("time")) find_time_unit(declared.time);
    refuse_idle_options();
  }

  /// Of times that are numbers: "Time [UTC]" with times of day needs none.
  void find_time_unit(const UnitSource& declared) {
    const std::size_t column = columns_.at("time");
    const auto counts = [column](const TextRow& row) { return is_number(row.cells[column]); };
    if (has("date") || std::none_of(table_.rows.begin(), table_.rows.end(), counts)) return;
    time_ = agreed({"time"}, {declared}, {}, time_unit_of, "time", time_unit_names()).value_or(unit::si);
  }

  /// An option for columns that are not there was meant for another file.
  void refuse_idle_options() const {
    const auto idle = [this](bool given, bool used, const char* argument, const char* columns) {
      if (given && !used) throw error(argument, columns, "none", ErrorCode::argument);
    };
    idle(options_.angles.has_value(), has("rx"), "angles", "columns rx, ry, rz");
    idle(options_.angle.unit.has_value(), has("rx") || has("a"), "angle_unit",
         "columns rx, ry, rz or a, b, c");
    idle(options_.coverage != 1, has("sigma") || has("sx"), "coverage",
         "a column sigma or columns ux, uy, uz");
  }

  double number(const TextRow& row, const std::string& role, const Unit& unit) const {
    return table_.number(row, columns_.at(role), unit);
  }
  Eigen::Vector3d three(const TextRow& row, const char* x, const char* y, const char* z,
                        const Unit& unit) const {
    return {number(row, x, unit), number(row, y, unit), number(row, z, unit)};
  }

  ListedPoint point(const TextRow& row, const PointList& list) const {
    ListedPoint p;
    p.line = row.line;
    for (const char* part : {"collection", "group", "name"}) {
      if (!has(part)) continue;
      const std::string& cell = row.cells[columns_.at(part)];
      if (cell.empty()) throw InputError(table_.path, row.line, part, "a name", "an empty field");
      p.name += (p.name.empty() ? "" : "::") + cell;
    }
    p.position_m = three(row, "x", "y", "z", length_);
    if (has("qw")) {
      const std::array<double, 4> wxyz{number(row, "qw", unit::si), number(row, "qx", unit::si),
                                       number(row, "qy", unit::si), number(row, "qz", unit::si)};
      const auto q = unit_quaternion(wxyz);
      if (!q) throw InputError(table_.path, row.line, "qw qx qy qz", unit_quaternion_rule, norm_text(wxyz));
      p.orientation = *q;
    }
    if (has("rx")) p.orientation = rotation(*options_.angles, three(row, "rx", "ry", "rz", angle_));
    if (has("a")) p.orientation = kuka_rotation(three(row, "a", "b", "c", angle_));
    if (list.sigmas) {
      const Eigen::Vector3d s = has("sx") ? three(row, "sx", "sy", "sz", sigma_)
                                          : Eigen::Vector3d::Constant(number(row, "sigma", sigma_));
      p.sigma_m = tidied(s.stableNorm() / std::sqrt(3.0) / options_.coverage, unit::mm);
      if (!(s.minCoeff() > 0 && p.sigma_m > 0 && std::isfinite(p.sigma_m))) {
        throw InputError(table_.path, row.line, has("sx") ? "sx, sy, sz" : "sigma",
                         "an uncertainty above 0 (and above 1e-10 mm)", fmt::format("{:g} m", s.minCoeff()));
      }
    }
    if (list.times) {
      const std::size_t column = columns_.at("time");
      const std::string text =
          has("date") ? row.cells[columns_.at("date")] + " " + row.cells[column] : row.cells[column];
      p.time = table_.time(row, column, text, time_);
    }
    return p;
  }

  const PointListOptions& options_;
  DelimitedText table_;
  Columns columns_;
  std::vector<std::string> unused_;
  Unit length_ = unit::mm;
  Unit angle_ = unit::degree;
  Unit sigma_ = unit::mm;
  Unit time_ = unit::si;
};

}  // namespace

const std::vector<std::string>& point_column_names() {
  static const std::vector<std::string> all = [] {
    std::vector<std::string> names{"-"};
    for (const auto& entry : vocabulary()) names.push_back(entry.first);
    return names;
  }();
  return all;
}

PointList read_point_list(const std::string& path, const PointListOptions& options) {
  for (const std::string& column : options.columns) {
    const auto& known = point_column_names();
    if (std::find(known.begin(), known.end(), column) != known.end()) continue;
    throw InputError("", 0, "columns", expected_name(column, known, "names out of", "a known name"),
                     "'" + column + "'", ErrorCode::argument);
  }
  return PointReader(path, options).read();
}

}  // namespace flexcomp::host
