#include "report/plots.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "report/escape.hpp"
#include "report/shown_poses.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

// In units of the drawing: about a pixel on a phone.
constexpr double width = 360, height = 220;
constexpr double left = 46, right = 12, top = 12, bottom = 36;
// A logarithmic axis where one number is this many times another: else the smaller ones lie on the axis.
constexpr double log_from_ratio = 8;

struct Tick {
  double value;
  std::string text;
};

/// From values to a place between 0 and 1.
struct Scale {
  double low = 0, high = 1;
  bool log = false;

  double at(double v) const {
    if (!log) return (v - low) / (high - low);
    return std::log(std::max(v, low) / low) / std::log(high / low);
  }
  double value(double share) const {
    return log ? low * std::pow(high / low, share) : low + share * (high - low);
  }
  std::vector<Tick> ticks(int about) const;
};

/// 1, 2 or 5 times a power of ten, so that there are about so many steps.
double round_step(double range, int about) {
  const double raw = range / about;
  const double power = std::pow(10, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= raw * (1 - 1e-9)) return factor * power;
  }
  return 10 * power;
}

std::vector<Tick> Scale::ticks(int about) const {
  std::vector<Tick> found;
  if (log) {
    const bool few = high / low < 1000;  // 2 and 5 are named where there is room
    for (int e = static_cast<int>(std::floor(std::log10(low))); std::pow(10, e) <= high * 1.001; ++e) {
      for (const int factor : {1, 2, 5}) {
        const double v = factor * std::pow(10, e);
        if (v < low * 0.999 || v > high * 1.001 || (factor != 1 && !few)) continue;
        found.push_back({v, fmt::format("{:g}", v)});
      }
    }
    return found;
  }
  const double step = round_step(high - low, about);
  for (double k = std::ceil(low / step - 1e-6); k * step <= high + 1e-6 * step; ++k) {
    const double v = k * step;
    found.push_back({v, fmt::format("{:g}", std::abs(v) < 1e-9 * step ? 0.0 : v)});
  }
  return found;
}

/// Covers positive numbers with round ends.
Scale scale_of(const ErrorPairs& errors) {
  double low = HUGE_VAL, high = 0, sum = 0;
  for (const auto* set : {&errors.before, &errors.after}) {
    for (const double v : *set) {
      high = std::max(high, v);
      if (v > 0) low = std::min(low, v);
    }
  }
  if (errors.floor) {
    high = std::max(high, *errors.floor);
    low = std::min(low, *errors.floor);
  }
  for (const double v : errors.after) sum += v;
  const double usual = errors.after.empty() ? high : sum / static_cast<double>(errors.after.size());
  if (!(high > 0)) return {0, 1, false};
  if (usual > 0 && high / usual > log_from_ratio) {
    // One lucky pose near zero must not squeeze all the others.
    low = std::max(low, usual / 30);
    const auto rounded = [](double v, bool up) {
      const double power = std::pow(10, std::floor(std::log10(v)));
      double best = up ? 10 * power : power;
      for (const double factor : {1.0, 2.0, 5.0}) {
        if (up && factor * power >= v) return factor * power;
        if (!up && factor * power <= v) best = factor * power;
      }
      return best;
    };
    return {rounded(low, false), rounded(high, true), true};
  }
  const double step = round_step(high, 5);
  return {0, step * std::ceil(high / step - 1e-9), false};
}

double px(double share) { return left + share * (width - left - right); }
double py(double share) { return height - bottom - share * (height - top - bottom); }

/// The frame of a plot: title for those who do not see it, axes, what hangs on them.
class Plot {
 public:
  /// `indent`: more room on the left, for long names there.
  explicit Plot(const std::string& described, double indent = 0) : indent_(indent) {
    svg_ = fmt::format(
        "<svg viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\" "
        "xmlns=\"http://www.w3.org/2000/svg\">\n",
        width, height, escaped(described));
  }

  /// Horizontally from 0 to 1, inside this plot's frame.
  double px(double share) const { return left + indent_ + share * (width - left - indent_ - right); }

  void x_axis(const std::vector<Tick>& ticks, const Scale& scale, const std::string& name) {
    for (const Tick& t : ticks) {
      const double x = px(scale.at(t.value));
      line(x, py(0), x, py(0) + 4, "axis");
      text(x, py(0) + 15, "middle", t.text);
    }
    line(px(0), py(0), px(1), py(0), "axis");
    text(px(0.5), height - 5, "middle", name, "name");
  }
  void y_axis(const std::vector<Tick>& ticks, const Scale& scale, const std::string& name) {
    for (const Tick& t : ticks) {
      const double y = py(scale.at(t.value));
      line(px(0), y, px(1), y, "grid");
      text(px(0) - 5, y + 3.5, "end", t.text);
    }
    svg_ += fmt::format(
        "<text class=\"name\" text-anchor=\"middle\" transform=\"translate(11 {:.1f}) "
        "rotate(-90)\">{}</text>\n",
        py(0.5), escaped(name));
  }
  void floor(double y) {
    line(px(0), y, px(1), y, "floor");
    text(px(1) - 2, y - 4, "end", "noise");
  }
  void line(double x1, double y1, double x2, double y2, const char* kind) {
    svg_ += fmt::format("<path class=\"{}\" d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\"/>\n", kind, x1, y1, x2, y2);
  }
  void path(const std::string& d, const char* kind) {
    if (!d.empty()) svg_ += fmt::format("<path class=\"{}\" d=\"{}\"/>\n", kind, d);
  }
  void text(double x, double y, const char* anchor, const std::string& what, const char* kind = "tick") {
    svg_ += fmt::format("<text class=\"{}\" x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>\n", kind,
                        x, y, anchor, escaped(what));
  }
  std::string done() { return svg_ + "</svg>\n"; }

 private:
  double indent_;
  std::string svg_;
};

/// Room for names on the left of the frame, beyond what numbers take.
double longest(const std::vector<std::string>& names) {
  std::size_t most = 0;
  for (const std::string& name : names) most = std::max(most, name.size());
  return std::clamp(6.0 * static_cast<double>(most) - 30, 0.0, 120.0);
}

/// A dot in a path whose lines have round ends.
std::string dot(double x, double y) { return fmt::format("M{:.1f} {:.1f}h0", x, y); }

/// Very many dots, each where it is to a unit of the drawing, in about half the bytes: from left to right, each from the one before.
std::string fine_dots(std::vector<std::array<double, 2>> places) {
  std::sort(places.begin(), places.end());
  std::string d;
  long x = 0, y = 0;
  for (const auto& place : places) {
    const long to_x = std::lround(place[0]), to_y = std::lround(place[1]);
    if (!d.empty() && to_x == x && to_y == y) continue;
    d += d.empty() ? fmt::format("M{} {}h0", to_x, to_y)
                   : fmt::format("m{}{}{}h0", to_x - x, to_y < y ? "" : " ", to_y - y);
    x = to_x;
    y = to_y;
  }
  return d;
}

/// Which of `count` things in a row are drawn: all, or so many evenly spaced ones.
std::vector<std::size_t> evenly(std::size_t count, std::size_t most) {
  std::vector<std::size_t> chosen;
  const std::size_t drawn = std::min(count, most);
  for (std::size_t k = 0; k < drawn; ++k) chosen.push_back(drawn < 2 ? k : k * (count - 1) / (drawn - 1));
  return chosen;
}

std::string step_line(std::vector<double> values, const Scale& scale, std::size_t most) {
  std::sort(values.begin(), values.end());
  std::string d;
  const auto n = static_cast<double>(values.size());
  double from = 0;
  for (const std::size_t k : evenly(values.size(), most)) {
    const double x = px(scale.at(values[k]));
    const double to = static_cast<double>(k + 1) / n;
    d += fmt::format("{}{:.1f} {:.1f}V{:.1f}", d.empty() ? "M" : "L", x, py(from), py(to));
    from = to;
  }
  return d;
}

/// Classes of equal width on the scale.
std::vector<std::size_t> counts(const std::vector<double>& values, const Scale& scale, std::size_t classes) {
  std::vector<std::size_t> count(classes);
  for (const double v : values) {
    const auto k = static_cast<long>(std::floor(scale.at(v) * static_cast<double>(classes)));
    ++count[static_cast<std::size_t>(std::clamp<long>(k, 0, static_cast<long>(classes) - 1))];
  }
  return count;
}

/// Round ends around a range of numbers.
Scale around(double low, double high, bool log) {
  if (log) {
    low = std::pow(10, std::floor(std::log10(low)));
    high = std::pow(10, std::ceil(std::log10(high)));
    return {low, high > low ? high : 10 * low, true};
  }
  const double step = round_step(std::max(high - low, 1e-12 + 0.02 * std::abs(high)), 5);
  const double from = step * std::floor(low / step + 1e-9), to = step * std::ceil(high / step - 1e-9);
  return {from, to > from ? to : from + step, false};
}

}  // namespace

std::string plot_curves(const Curves& c) {
  double x_low = HUGE_VAL, x_high = -HUGE_VAL, y_low = HUGE_VAL, y_high = -HUGE_VAL;
  const auto reach = [&](double y) {
    if (c.log_y && !(y > 0)) return;
    y_low = std::min(y_low, y);
    y_high = std::max(y_high, y);
  };
  for (const Curve& curve : c.curves) {
    for (const auto& [x, y] : curve.points) {
      if (c.log_y && !(y > 0)) continue;
      x_low = std::min(x_low, x);
      x_high = std::max(x_high, x);
      reach(y);
    }
    for (const auto& [low, high] : curve.band) reach(low), reach(high);
  }
  if (!(y_high >= y_low)) return "";
  if (c.floor) reach(*c.floor);
  if (!c.x_texts.empty()) {
    x_low = std::min(x_low, 0.0);
    x_high = std::max(x_high, static_cast<double>(c.x_texts.size() - 1));
  }
  const double margin = std::max(1e-9, c.x_texts.empty() ? 0.02 * (x_high - x_low) : 0.5);
  const Scale x{x_low - margin, x_high + margin, false};
  const Scale y = around(y_low, y_high, c.log_y);
  Plot plot(c.described);
  plot.y_axis(y.ticks(5), y, c.y_name);
  std::vector<Tick> ticks = x.ticks(6);
  if (!c.x_texts.empty()) {
    ticks.clear();
    for (std::size_t k = 0; k < c.x_texts.size(); ++k)
      ticks.push_back({static_cast<double>(k), c.x_texts[k]});
  }
  plot.x_axis(ticks, x, c.x_name);
  static constexpr std::array<const char*, 6> kinds{"after", "before", "y", "x", "z", "floor"};
  for (std::size_t k = 0; k < c.curves.size() && k < kinds.size(); ++k) {
    const Curve& curve = c.curves[k];
    const std::string kind = curve.colour.empty() ? kinds[k] : curve.colour;
    std::string line, dots, forth, back;
    for (const std::size_t n :
         evenly(curve.points.size(), curve.style == CurveStyle::dots ? Detail().dots : curve.points.size())) {
      const auto& [at, value] = curve.points[n];
      if (c.log_y && !(value > 0)) continue;
      const double px_at = px(x.at(at));
      const double py_at = py(y.at(value));
      line += line.empty()                       ? fmt::format("M{:.1f} {:.1f}", px_at, py_at)
              : curve.style == CurveStyle::steps ? fmt::format("H{:.1f}V{:.1f}", px_at, py_at)
                                                 : fmt::format("L{:.1f} {:.1f}", px_at, py_at);
      dots += dot(px_at, py_at);
      if (n >= curve.band.size()) continue;
      forth += fmt::format("{}{:.1f} {:.1f}", forth.empty() ? "M" : "L", px_at, py(y.at(curve.band[n][1])));
      back.insert(0, fmt::format("L{:.1f} {:.1f}", px_at, py(y.at(curve.band[n][0]))));
    }
    if (!forth.empty()) plot.path(forth + back + "Z", fmt::format("bars {}", kind).c_str());
    const bool with_dots = curve.style == CurveStyle::usual || curve.style == CurveStyle::joined;
    const bool joined =
        curve.style == CurveStyle::usual ? c.x_texts.empty() : curve.style != CurveStyle::dots;
    const bool few = curve.points.size() <= 60;
    if (joined) plot.path(line, fmt::format("line {}", kind).c_str());
    if (curve.style == CurveStyle::dots || (with_dots && few))
      plot.path(dots, fmt::format("{} {}", few ? "dots" : "fine", kind).c_str());
    if (c.curves.size() > 1) {
      const double row = py(1) + 12 + 13 * static_cast<double>(k);
      plot.path(dot(px(1) - 8, row - 4), fmt::format("dots {}", kind).c_str());
      plot.text(px(1) - 16, row, "end", curve.name);
    }
  }
  if (c.floor) plot.floor(py(y.at(*c.floor)));
  return plot.done();
}

std::string plot_bars(const Bars& bars) {
  double most = 0;
  for (const auto* list : {&bars.before, &bars.after})
    for (const double v : *list) most = std::max(most, v);
  const double step = round_step(most > 0 ? most : 1, 5);
  const Scale x{0, step * std::ceil((most > 0 ? most : 1) / step - 1e-9), false};
  const auto count = static_cast<double>(std::max<std::size_t>(bars.names.size(), 1));
  Plot plot(bars.described, longest(bars.names));
  std::vector<Tick> names;
  for (std::size_t k = 0; k < bars.names.size(); ++k)
    names.push_back({count - static_cast<double>(k) - 0.5, bars.names[k]});
  const Scale y{0, count, false};
  plot.y_axis(names, y, "");
  plot.x_axis(x.ticks(5), x, bars.x_name);
  const auto draw = [&](const std::vector<double>& values, double from, double to, const char* kind) {
    std::string d;
    for (std::size_t k = 0; k < values.size(); ++k) {
      const double top_of = count - static_cast<double>(k);
      d += fmt::format("M{:.1f} {:.1f}H{:.1f}V{:.1f}H{:.1f}Z", plot.px(0), py(y.at(top_of - from)),
                       plot.px(x.at(std::max(values[k], 0.0))), py(y.at(top_of - to)), plot.px(0));
    }
    plot.path(d, kind);
  };
  draw(bars.before, 0.12, bars.after.empty() ? 0.88 : 0.5, "bars before");
  draw(bars.after, 0.5, 0.88, "bars after");
  return plot.done();
}

std::string plot_in_order(const ErrorPairs& errors, const Detail& detail) {
  const Scale y = scale_of(errors);
  const auto n = static_cast<double>(errors.before.size());
  const Scale x{0.5 - 0.02 * n, n + 0.5 + 0.02 * n, false};
  Plot plot("Error of each pose in the order of the data, before and after");
  plot.y_axis(y.ticks(5), y, errors.unit);
  std::vector<Tick> ticks;
  for (Tick& t : x.ticks(6)) {
    if (t.value >= 1 && t.value <= n && t.value == std::floor(t.value)) ticks.push_back(t);
  }
  plot.x_axis(ticks, x, "pose");
  std::string stems, before, after;
  for (const std::size_t k : evenly(errors.before.size(), detail.dots)) {
    const double at = px(x.at(static_cast<double>(k + 1)));
    const double upper = py(y.at(errors.before[k])), lower = py(y.at(errors.after[k]));
    if (errors.before.size() <= 120) stems += fmt::format("M{:.1f} {:.1f}V{:.1f}", at, upper, lower);
    before += dot(at, upper);
    after += dot(at, lower);
  }
  const bool many = errors.before.size() > 120;
  plot.path(stems, "stem");
  plot.path(before, many ? "fine before" : "dots before");
  plot.path(after, many ? "fine after" : "dots after");
  if (errors.floor) plot.floor(py(y.at(*errors.floor)));
  return plot.done();
}

std::string plot_sorted(const ErrorPairs& errors, const Detail& detail) {
  const Scale x = scale_of(errors);
  const Scale y{0, 100, false};
  Plot plot("Share of the poses whose error lies below a value, before and after");
  plot.y_axis(y.ticks(4), y, "% of the poses below");
  plot.x_axis(x.ticks(6), x, errors.unit);
  if (errors.floor) {
    const double at = px(x.at(*errors.floor));
    plot.line(at, py(0), at, py(1), "floor");
    plot.text(at + 3, py(0.06), "start", "noise");
  }
  plot.path(step_line(errors.before, x, detail.steps), "line before");
  plot.path(step_line(errors.after, x, detail.steps), "line after");
  return plot.done();
}

std::string plot_histogram(const ErrorPairs& errors) {
  const Scale x = scale_of(errors);
  const auto n = static_cast<double>(errors.before.size());
  const auto classes = static_cast<std::size_t>(std::clamp(2 * std::cbrt(n) + 8, 12.0, 40.0));
  const auto before = counts(errors.before, x, classes);
  const auto after = counts(errors.after, x, classes);
  std::size_t most = 1;
  for (std::size_t k = 0; k < classes; ++k) most = std::max({most, before[k], after[k]});
  const double step = std::max(1.0, round_step(static_cast<double>(most), 4));
  const Scale y{0, step * std::ceil(static_cast<double>(most) / step), false};
  Plot plot("How many poses have which error, before and after");
  plot.y_axis(y.ticks(4), y, "poses");
  const auto bars = [&](const std::vector<std::size_t>& count) {
    std::string d;
    for (std::size_t k = 0; k < classes; ++k) {
      if (count[k] == 0) continue;
      const double from = px(static_cast<double>(k) / static_cast<double>(classes)) + 0.5;
      const double to = px(static_cast<double>(k + 1) / static_cast<double>(classes)) - 0.5;
      d += fmt::format("M{:.1f} {:.1f}V{:.1f}H{:.1f}V{:.1f}Z", from, py(0),
                       py(y.at(static_cast<double>(count[k]))), to, py(0));
    }
    return d;
  };
  plot.path(bars(before), "bars before");
  plot.path(bars(after), "bars after");
  plot.x_axis(x.ticks(6), x, errors.unit);
  return plot.done();
}

std::string plot_against(const std::vector<PagePose>& poses, const std::vector<double>& values,
                         const std::string& axis, const std::string& described, const Detail& detail) {
  double reach = 0, low = HUGE_VAL, high = -HUGE_VAL;
  std::vector<double> sizes;
  for (std::size_t n = 0; n < poses.size(); ++n) {
    for (const double e : poses[n].after_m) sizes.push_back(std::abs(e) * 1e3);
    low = std::min(low, values[n]);
    high = std::max(high, values[n]);
  }
  if (!sizes.empty()) {
    // The bulk sets the scale; what lies far off is drawn at the edge.
    std::sort(sizes.begin(), sizes.end());
    const double bulk = sizes[static_cast<std::size_t>(static_cast<double>(sizes.size() - 1) * 0.9)];
    reach = std::min(sizes.back(), 3 * bulk);
  }
  if (!(reach > 0)) reach = 1e-3;
  const double step = round_step(reach, 2);
  const Scale y{-step * std::ceil(reach / step - 1e-9), step * std::ceil(reach / step - 1e-9), false};
  const double margin = high > low ? 0.04 * (high - low) : 1;
  const Scale x{low - margin, high + margin, false};
  Plot plot("What is left of the position error against " + described);
  plot.y_axis(y.ticks(4), y, "mm");
  plot.x_axis(x.ticks(6), x, axis);
  static constexpr std::array<const char*, 3> kind{"dots x", "dots y", "dots z"};
  static constexpr std::array<const char*, 3> fine{"fine x", "fine y", "fine z"};
  const std::vector<std::size_t> shown = shown_poses(poses, detail.dots_of_three);
  for (std::size_t k = 0; k < 3; ++k) {
    std::vector<std::array<double, 2>> places;
    places.reserve(shown.size());
    for (const std::size_t n : shown)
      places.push_back({px(x.at(values[n])), py(std::clamp(y.at(poses[n].after_m[k] * 1e3), 0.0, 1.0))});
    std::string d;
    if (places.size() > 200) {
      d = fine_dots(std::move(places));
    } else {
      for (const auto& [at, value] : places) d += dot(at, value);
    }
    plot.path(d, poses.size() > 60 ? fine[k] : kind[k]);
  }
  return plot.done();
}

std::string plot_coverage(const PagePlan& plan) {
  const Scale x{0, 100, false};
  const Scale y{0.4, static_cast<double>(joint_count) + 0.6, false};
  Plot plot("Where the poses lie between the limits of each joint");
  std::vector<Tick> joints;
  for (std::size_t j = 0; j < joint_count; ++j) {
    joints.push_back({static_cast<double>(joint_count - j), fmt::format("q{}", j + 1)});
  }
  plot.y_axis(joints, y, "joint");
  plot.x_axis(x.ticks(5), x, "% of the way from the lower to the upper limit");
  const auto dots = [&](const std::vector<std::array<double, joint_count>>& poses, double shift) {
    std::string d;
    for (const auto& q : poses) {
      for (std::size_t j = 0; j < joint_count; ++j) {
        const auto& [lower, upper] = plan.limits_rad[j];
        d += dot(px(std::clamp((q[j] - lower) / (upper - lower), 0.0, 1.0)),
                 py(y.at(static_cast<double>(joint_count - j) + shift)));
      }
    }
    return d;
  };
  plot.path(dots(plan.known_q_rad, 0.2), "dots before");
  plot.path(dots(plan.q_rad, 0), "dots after");
  return plot.done();
}

}  // namespace flexcomp::host
