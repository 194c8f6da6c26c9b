#include "files/point_list.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "files/declared_unit.hpp"
#include "files/input_error.hpp"
#include "files/nearest.hpp"
#include "files/quaternion.hpp"

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

class Reader {
 public:
  Reader(const std::string& path, const PointListOptions& options) : options_(options) {
    const std::vector<std::string>& given = options.columns;
    table_ = read_delimited(path, options.dialect, [&given](const std::vector<std::string>& cells) {
      if (given.empty()) return has_position(cells);
      // With columns that the user names the header only has to be none of the rows.
      if (cells.size() != given.size()) return false;
      for (std::size_t k = 0; k < cells.size(); ++k) {
        const bool number = parse_number(cells[k], '.', unit::si) || parse_number(cells[k], ',', unit::si);
        if (given[k] != "-" && !is_name(given[k]) && given[k] != "time" && given[k] != "date" && number)
          return false;
      }
      return true;
    });
    find_columns();
    find_units();
    std::vector<std::size_t> numbers;
    for (const auto& [role, column] : columns_) {
      if (!is_name(role) && role != "time" && role != "date") numbers.push_back(column);
    }
    table_.settle_decimal(numbers, options.dialect.decimal);
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

  void find_columns() {
    const std::size_t count = table_.rows.front().cells.size();
    if (!options_.columns.empty()) {
      if (options_.columns.size() != count) {
        throw InputError(table_.path, table_.rows.front().line, "--columns",
                         fmt::format("{} names, one for each field", count),
                         fmt::format("{}", options_.columns.size()));
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
    if (int(has("rx")) + int(has("a")) + int(has("qw")) > 1) {
      throw InputError(table_.path, header_line(), "", "one orientation", "several (--columns chooses)");
    }
    if (has("date") && !has("time"))
      throw InputError(table_.path, header_line(), "date", "a time beside the date", "none");
  }

  void take(const std::string& role, std::size_t column) {
    const auto [at, is_new] = columns_.emplace(role, column);
    if (!is_new) {
      throw InputError(table_.path, header_line(), table_.column_label(column),
                       fmt::format("one column of {} (--columns says which)", role),
                       "another one: " + table_.column_label(at->second));
    }
  }

  /// Without a header: x y z at the end, and before them up to three parts of a name.
  void by_position(std::size_t count) {
    const auto& first = table_.rows.front().cells;
    const auto is_number = [this](const std::string& cell) {
      return parse_number(cell, table_.dialect.decimal, unit::si).has_value();
    };
    bool plain = count <= 6;
    if (count > 4) {
      for (const TextRow& row : table_.rows) plain = plain && !is_number(row.cells[0]);
    }
    if (!plain) {
      throw InputError(
          table_.path, table_.rows.front().line, "",
          "name X Y Z, or what the fields mean by a header or --columns (such as name,x,y,z,-,-)",
          fmt::format("{} fields: {}", count, fmt::join(first, " | ")));
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
    throw InputError(table_.path, header_line(), fmt::format("{}", fmt::join(missing, ", ")),
                     fmt::format("a column for each of {}", fmt::join(roles, ", ")), "none");
  }

  /// The unit of a kind of columns: what the header, the lines before it and the option say must agree.
  template <class UnitOf>
  Unit settle(const std::vector<std::string>& roles, const std::optional<Unit>& remark,
              const std::optional<Unit>& option, const UnitOf& unit_of, const char* option_name,
              const char* kind) const {
    std::optional<Unit> found = remark;
    std::string by = "the lines before the table";
    if (table_.header) {
      std::optional<Unit> header;
      for (const std::string& role : roles) {
        const std::string& cell = table_.header->cells[columns_.at(role)];
        const std::string word = column_name(cell).unit;
        if (word.empty()) continue;
        const std::optional<Unit> unit = unit_of(word);
        if (!unit)
          throw InputError(table_.path, table_.header->line, cell, fmt::format("a unit of {}", kind), word);
        if (header && header->name != unit->name) {
          throw InputError(table_.path, table_.header->line, cell,
                           fmt::format("{} as beside it", header->name), std::string(unit->name));
        }
        header = unit;
      }
      if (header) {
        found = header;
        by = "the header";
      }
    }
    if (found && option && found->name != option->name) {
      throw InputError(table_.path, header_line(), option_name,
                       fmt::format("{}, as {} says", found->name, by), std::string(option->name));
    }
    if (!found) found = option;
    if (found) return *found;
    throw InputError(
        table_.path, header_line(), fmt::format("{}", fmt::join(roles, ", ")),
        fmt::format("a unit of {}: in the header (X [mm]), in a line above it (Units: mm) or by {}", kind,
                    option_name),
        fmt::format("none; the first row has {}", first_values(roles)));
  }

  std::string first_values(const std::vector<std::string>& roles) const {
    std::vector<std::string> values;
    for (const std::string& role : roles) values.push_back(table_.rows.front().cells[columns_.at(role)]);
    return fmt::format("{}", fmt::join(values, ", "));
  }

  void find_units() {
    const DeclaredUnits declared = declared_units(table_.remarks);
    if (declared.contradicts) {
      throw InputError(table_.path, table_.remark_lines[*declared.contradicts], "",
                       "the same units as in a line before", table_.remarks[*declared.contradicts]);
    }
    length_ = settle({"x", "y", "z"}, declared.length, options_.length, length_unit_of, "--unit", "length");
    if (has("rx")) {
      angle_ =
          settle({"rx", "ry", "rz"}, declared.angle, options_.angle, angle_unit_of, "--angle-unit", "angle");
      if (!options_.angles) {
        throw InputError(
            table_.path, header_line(), "rx, ry, rz",
            "to be told what the angles mean: --angles fixed-xyz (SpatialAnalyzer), moving-xyz (Stäubli) "
            "or rotation-vector",
            "nothing");
      }
    }
    if (has("a"))
      angle_ =
          settle({"a", "b", "c"}, declared.angle, options_.angle, angle_unit_of, "--angle-unit", "angle");
    // Uncertainties may have a unit of their own (µm); without one they have that of the points.
    for (const std::vector<std::string>& roles : {std::vector<std::string>{"sigma"}, {"sx", "sy", "sz"}}) {
      if (has(roles[0]))
        sigma_ =
            settle(roles, std::optional<Unit>(length_), std::nullopt, length_unit_of, "--unit", "length");
    }
    if (has("time") && table_.header) {
      const std::string word = column_name(table_.header->cells[columns_.at("time")]).unit;
      if (const auto unit = time_unit_of(word)) time_ = *unit;
    }
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
      if (!q) {
        throw InputError(table_.path, row.line, "qw qx qy qz", "a quaternion of norm 1 (within 0.001)",
                         fmt::format("norm {:.6g}",
                                     std::hypot(std::hypot(wxyz[0], wxyz[1]), std::hypot(wxyz[2], wxyz[3]))));
      }
      p.orientation = *q;
    }
    if (has("rx")) p.orientation = rotation(*options_.angles, three(row, "rx", "ry", "rz", angle_));
    if (has("a")) p.orientation = kuka_rotation(three(row, "a", "b", "c", angle_));
    if (list.sigmas) {
      const Eigen::Vector3d s = has("sx") ? three(row, "sx", "sy", "sz", sigma_)
                                          : Eigen::Vector3d::Constant(number(row, "sigma", sigma_));
      if (!(s.minCoeff() > 0)) {
        throw InputError(table_.path, row.line, has("sx") ? "sx, sy, sz" : "sigma", "an uncertainty above 0",
                         fmt::format("{:g} m", s.minCoeff()));
      }
      p.sigma_m = s.norm() / std::sqrt(3.0) / options_.coverage;
    }
    if (list.times) {
      const std::size_t column = columns_.at("time");
      const std::string text =
          has("date") ? row.cells[columns_.at("date")] + " " + row.cells[column] : row.cells[column];
      const auto time = time_stamp(text, time_, table_.dialect.decimal);
      if (!time) {
        throw InputError(table_.path, row.line, table_.column_label(column),
                         "seconds, 12:30:05.25 or 2026-03-01T12:30:05.25", "'" + text + "'");
      }
      p.time = *time;
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

Eigen::Quaterniond rotation(AngleConvention convention, const Eigen::Vector3d& angles_rad) {
  const Eigen::AngleAxisd x(angles_rad.x(), Eigen::Vector3d::UnitX());
  const Eigen::AngleAxisd y(angles_rad.y(), Eigen::Vector3d::UnitY());
  const Eigen::AngleAxisd z(angles_rad.z(), Eigen::Vector3d::UnitZ());
  Eigen::Quaterniond q;
  if (convention == AngleConvention::fixed_xyz) {
    q = z * y * x;
  } else if (convention == AngleConvention::moving_xyz) {
    q = x * y * z;
  } else {
    const double angle = angles_rad.norm();
    q = angle > 0 ? Eigen::Quaterniond(Eigen::AngleAxisd(angle, angles_rad / angle))
                  : Eigen::Quaterniond::Identity();
  }
  return *unit_quaternion(std::array<double, 4>{q.w(), q.x(), q.y(), q.z()});
}

Eigen::Quaterniond kuka_rotation(const Eigen::Vector3d& abc_rad) {
  return rotation(AngleConvention::fixed_xyz, abc_rad.reverse());
}

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
    const std::string near = nearest(column, known);
    throw InputError("", 0, "--columns",
                     near.empty() ? fmt::format("names out of {}", fmt::join(known, ", "))
                                  : fmt::format("a known name (did you mean '{}'?)", near),
                     "'" + column + "'");
  }
  return Reader(path, options).read();
}

}  // namespace flexcomp::host
