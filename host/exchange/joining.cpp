// SPDX-License-Identifier: Apache-2.0
#include "exchange/joining.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include "exchange/name_pattern.hpp"
#include "files/data_file.hpp"
#include "input_error.hpp"

namespace flexcomp::host {

namespace {

/// The points of one pose: one, or three or four reflectors.
struct Group {
  std::string label;  ///< as in the data file
  std::string key;    ///< by which the log calls it
  std::vector<const ListedPoint*> points;
};

std::string shown(const ListedPoint& p) {
  return p.name.empty() ? fmt::format("line {}", p.line) : fmt::format("{} (line {})", p.name, p.line);
}
std::string shown(const LogRow& r) {
  return r.name.empty() ? fmt::format("line {}", r.line) : fmt::format("{} (line {})", r.name, r.line);
}

std::string last_part(const std::string& name) {
  const auto at = name.rfind("::");
  return at == std::string::npos ? name : name.substr(at + 2);
}

InputError seen_before(const PointList& list, const ListedPoint& p, const ListedPoint& before,
                       ErrorCode code) {
  return InputError(list.path, p.line, p.name, fmt::format("a point that line {} has not", before.line),
                    "the same name again", code);
}

const char* const other_name = ", a name of another kind";

/// Each point alone, in the order of the list. Without a pattern its name is the pose's, or the last part of it where the
/// log's names have none.
std::vector<Group> single_points(const PointList& list, const RobotLog& log, bool repeats,
                                 const std::optional<NamePattern>& pattern,
                                 std::vector<std::string>& lonely) {
  std::vector<Group> out;
  const bool parts = std::any_of(log.rows.begin(), log.rows.end(),
                                 [](const LogRow& r) { return r.name.find("::") != std::string::npos; });
  std::map<std::string, const ListedPoint*> seen;
  for (const ListedPoint& p : list.points) {
    std::string key = parts ? p.name : last_part(p.name);
    if (pattern) {
      const auto read = pattern->read(p.name);
      if (!read) {
        lonely.push_back(shown(p) + other_name);
        continue;
      }
      key = read->first;
    }
    const auto [at, is_new] = seen.emplace(key, &p);
    if (!is_new && !repeats) {
      throw seen_before(list, p, *at->second, ErrorCode::repeated_point);
    }
    out.push_back({p.name, key, {&p}});
  }
  return out;
}

/// The reflectors of each pose, in the order in which poses first appear.
std::vector<Group> reflector_groups(const PointList& list, const NamePattern& pattern,
                                    std::vector<std::string>& lonely) {
  std::vector<Group> out;
  std::map<std::string, std::array<const ListedPoint*, 4>> poses;
  std::vector<std::string> order;
  for (const ListedPoint& p : list.points) {
    const auto read = pattern.read(p.name);
    if (!read) {
      lonely.push_back(shown(p) + other_name);
      continue;
    }
    const auto [at, is_new] = poses.emplace(read->first, std::array<const ListedPoint*, 4>{});
    if (is_new) order.push_back(read->first);
    const ListedPoint*& place = at->second[read->second];
    if (place != nullptr) throw seen_before(list, p, *place, ErrorCode::none);
    place = &p;
  }
  std::size_t with_d = 0;
  std::size_t without_d = 0;  // but with the other three
  const ListedPoint* first_d = nullptr;
  for (const std::string& key : order) {
    const auto& four = poses[key];
    if (four[3] != nullptr) {
      ++with_d;
      if (first_d == nullptr) first_d = four[3];
    } else if (four[0] != nullptr && four[1] != nullptr && four[2] != nullptr) {
      ++without_d;
    }
  }
  // Among poses of four one may lack a reflector, but a fourth one here and there is no reason to leave all others out.
  if (first_d != nullptr && without_d >= with_d) {
    throw InputError(
        list.path, first_d->line, first_d->name,
        fmt::format("three reflectors a, b, c at every pose, as {} poses have them, or four", without_d),
        fmt::format("a fourth one at {}", with_d == 1 ? "this pose alone" : fmt::format("{} poses", with_d)));
  }
  const std::size_t count = with_d == 0 ? 3 : 4;
  for (const std::string& key : order) {
    const auto& four = poses[key];
    Group group{key, key, {}};
    std::string missing;
    for (std::size_t r = 0; r < count; ++r) {
      if (four[r] == nullptr)
        missing += (missing.empty() ? "" : ", ") + std::string(1, static_cast<char>('a' + r));
      group.points.push_back(four[r]);
    }
    if (missing.empty()) {
      out.push_back(std::move(group));
      continue;
    }
    for (const ListedPoint* p : four) {
      if (p != nullptr)
        lonely.push_back(fmt::format("{}, of pose {} without reflector {}", shown(*p), key, missing));
    }
  }
  return out;
}

std::vector<Group> groups_by_name(const PointList& list, const RobotLog& log, const JoinOptions& options,
                                  std::vector<std::string>& lonely) {
  std::optional<NamePattern> pattern;
  if (!options.names.empty()) pattern.emplace(options.names);
  return pattern && pattern->has_reflectors() ? reflector_groups(list, *pattern, lonely)
                                              : single_points(list, log, options.repeats, pattern, lonely);
}

std::vector<Group> groups_by_order(const PointList& list, std::size_t size) {
  std::vector<Group> out;
  for (std::size_t k = 0; k < list.points.size(); ++k) {
    const ListedPoint& p = list.points[k];
    if (k % size == 0) out.push_back({p.name, "", {}});
    out.back().points.push_back(&p);
  }
  return out;
}

class Joiner {
 public:
  Joiner(const PointList& points, const RobotLog& log, const JoinOptions& options)
      : list_(points), log_(log), options_(options), used_(log.rows.size()) {
    MeasuredData& data = out_.data;
    data.columns.position_sigma = points.sigmas;
    data.columns.time = log.times;
    data.extra = log.context;
    if (points.names) data.extra.emplace_back(point_label);
  }

  Joining run() {
    if (log_.times) require_one_clock(log_.path, log_.rows, log_.rows.front().time.clock);
    switch (options_.by) {
      case JoinBy::name:
        by_name();
        break;
      case JoinBy::order:
        by_order();
        break;
      case JoinBy::time:
        by_time();
    }
    if (options_.by != JoinBy::time) {
      for (std::size_t k = 0; k < used_.size(); ++k) {
        if (!used_[k]) out_.lonely_rows.push_back(shown(log_.rows[k]));
      }
    }
    if (out_.data.rows.empty()) {
      throw InputError(
          list_.path, list_.points.front().line, "",
          fmt::format("points that are also in {} (there: {})", log_.path, shown(log_.rows.front())),
          fmt::format("none with a partner; the first is {}", shown(list_.points.front())),
          ErrorCode::no_common_points);
    }
    return std::move(out_);
  }

 private:
  void by_name() {
    if (!list_.names) throw InputError(list_.path, 0, "", "a column with names", "none", ErrorCode::no_names);
    if (!log_.doubtful_names.empty()) {
      throw InputError(log_.path, log_.header_line, log_.doubtful_names[0],
                       "one column that can be the pose's name",
                       fmt::format("'{}' as well", log_.doubtful_names[1]), ErrorCode::ambiguous_name_column);
    }
    if (!log_.names) throw InputError(log_.path, 0, "", "a column with names", "none", ErrorCode::no_names);
    std::map<std::string, std::size_t> rows;
    for (std::size_t k = 0; k < log_.rows.size(); ++k) {
      const auto [at, is_new] = rows.emplace(log_.rows[k].name, k);
      if (!is_new) {
        throw InputError(log_.path, log_.rows[k].line, log_.rows[k].name, "one row for each pose",
                         fmt::format("this name as in line {}", log_.rows[at->second].line));
      }
    }
    for (const Group& g : groups_by_name(list_, log_, options_, out_.lonely_points)) {
      const auto at = rows.find(g.key);
      if (at == rows.end()) {
        for (const ListedPoint* p : g.points) out_.lonely_points.push_back(shown(*p));
      } else {
        add(g, at->second);
      }
    }
  }

  void by_order() {
    const std::size_t size = std::max<std::size_t>(options_.reflectors, 1);
    if (list_.points.size() != size * log_.rows.size()) {
      throw InputError(list_.path, 0, "by_order",
                       size == 1
                           ? fmt::format("{} points, one for each row of {}", log_.rows.size(), log_.path)
                           : fmt::format("{} points, {} for each of the {} rows of {}",
                                         size * log_.rows.size(), size, log_.rows.size(), log_.path),
                       fmt::format("{}", list_.points.size()), ErrorCode::argument);
    }
    const std::vector<Group> groups = groups_by_order(list_, size);
    for (std::size_t k = 0; k < groups.size(); ++k) add(groups[k], k);
  }

  void by_time() {
    if (!list_.times)
      throw InputError(list_.path, 0, "by_time", "a column with times", "none", ErrorCode::argument);
    if (!log_.times)
      throw InputError(log_.path, 0, "by_time", "a column with times", "none", ErrorCode::argument);
    require_one_clock(list_.path, list_.points, log_.rows.front().time.clock);
    std::vector<std::size_t> order(log_.rows.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    const auto at_time = [this](std::size_t k) { return log_.rows[k].time.seconds; };
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return at_time(a) < at_time(b); });
    for (const ListedPoint& p : list_.points) {
      const double t = p.time.seconds + options_.shift_s;
      // Times such as 0.1 + 0.5 are not exact; a nanosecond is nobody's tolerance.
      const double reach = options_.tolerance_s + 1e-9;
      auto from = std::lower_bound(order.begin(), order.end(), t - reach,
                                   [&](std::size_t k, double value) { return at_time(k) < value; });
      if (from == order.end() || at_time(*from) > t + reach) {
        out_.lonely_points.push_back(shown(p));
        continue;
      }
      std::size_t nearest = *from;
      const std::size_t first = *from;
      for (; from != order.end() && at_time(*from) <= t + reach; ++from) {
        if (std::abs(at_time(*from) - t) < std::abs(at_time(nearest) - t)) nearest = *from;
        for (std::size_t j = 0; j < joint_count; ++j) {
          const double apart = std::abs(log_.rows[*from].q_rad[j] - log_.rows[first].q_rad[j]);
          if (apart <= options_.still_rad) continue;
          throw InputError(
              list_.path, p.line, p.name,
              fmt::format("an arm that stands still within {:g} s of the measurement", options_.tolerance_s),
              fmt::format("joint {} {:.4g} deg apart in lines {} and {} of {}", j + 1, degrees(apart),
                          log_.rows[first].line, log_.rows[*from].line, log_.path),
              ErrorCode::moving_arm);
        }
      }
      add({p.name, "", {&p}}, nearest);
    }
  }

  /// Every time is of this clock, and times of day are of one day.
  template <class Row>
  static void require_one_clock(const std::string& path, const std::vector<Row>& rows, Clock clock) {
    const Row* before = nullptr;
    for (const Row& row : rows) {
      if (row.time.clock != clock)
        throw InputError(path, row.line, "time", words(clock), words(row.time.clock));
      if (clock == Clock::day && before != nullptr && row.time.seconds < before->time.seconds - 3600) {
        throw InputError(
            path, row.line, "time",
            "times of day of one day, each after the one before (past midnight only a date tells)",
            fmt::format("{} after {} in line {}", of_day(row.time.seconds), of_day(before->time.seconds),
                        before->line));
      }
      before = &row;
    }
  }
  static std::string of_day(double seconds) {
    const auto s = static_cast<int>(seconds);
    return fmt::format("{:02}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60);
  }

  void add(const Group& group, std::size_t at) {
    const LogRow& row = log_.rows[at];
    used_[at] = true;
    MeasuredData& data = out_.data;
    Measurement m;
    m.line = row.line;
    m.q_rad = row.q_rad;
    if (log_.times) {
      // A date is too long a number for anybody to read; what counts is the time between rows.
      const double start = row.time.clock == Clock::count ? 0 : log_.rows.front().time.seconds;
      m.context.time_s = row.time.seconds - start;
    }
    if (group.points.size() > 1) {
      data.kind = MeasurementKind::reflectors;
      data.reflectors = group.points.size();
      double square = 0;
      for (std::size_t r = 0; r < group.points.size(); ++r) {
        m.reflector_m[r] = group.points[r]->position_m;
        square += group.points[r]->sigma_m * group.points[r]->sigma_m;
      }
      m.position_sigma_m = tidied(std::sqrt(square / static_cast<double>(group.points.size())), unit::mm);
    } else {
      const ListedPoint& p = *group.points.front();
      data.kind = list_.orientations ? MeasurementKind::pose : MeasurementKind::position;
      m.position_m = p.position_m;
      m.orientation = p.orientation;
      m.position_sigma_m = p.sigma_m;
    }
    for (const double value : row.context) m.extra.push_back(format_si(value, unit::si));
    if (list_.names) m.extra.push_back(group.label);
    data.rows.push_back(std::move(m));
    out_.log_lines.push_back(row.line);
    out_.point_lines.push_back(group.points.front()->line);
  }

  const PointList& list_;
  const RobotLog& log_;
  const JoinOptions& options_;
  std::vector<bool> used_;
  Joining out_;
};

}  // namespace

Joining join(const PointList& points, const RobotLog& log, const JoinOptions& options) {
  return Joiner(points, log, options).run();
}

}  // namespace flexcomp::host
