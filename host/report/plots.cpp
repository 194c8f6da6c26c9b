// SPDX-License-Identifier: Apache-2.0
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
constexpr double width = 360, usual_height = 220;
constexpr double least_left_margin = 46, most_left = 166, least_right = 12, top = 12, bottom = 36;
constexpr double letter = 6.7, line_height = 13;  // of the page's 11 px text, in the wider of the usual fonts
constexpr double legend_sample = 20, legend_gap = 14;
// A logarithmic axis where one number is this many times another: else the smaller ones lie on the axis.
constexpr double log_from_ratio = 8;

struct Tick {
  double value;
  std::string text;
};

/// Characters, not bytes.
std::size_t characters(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}
double text_width(const std::string& text) { return letter * static_cast<double>(characters(text)); }

/// Cut where it would be wider than `room`.
std::string fitting(const std::string& text, double room) {
  if (text_width(text) <= room) return text;
  std::string cut;
  double used = 2 * letter;
  for (const char c : text) {
    if ((c & 0xC0) != 0x80) used += letter;
    if (used > room) break;
    cut += c;
  }
  return cut + "…";
}

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

std::string power_of_ten(int exponent) {
  static constexpr std::array<const char*, 10> raised{"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string text = exponent < 0 ? "10⁻" : "10";
  for (const char digit : fmt::format("{}", std::abs(exponent)))
    text += raised[static_cast<std::size_t>(digit - '0')];
  return text;
}

/// A number on an axis whose ticks are `step` apart: as many decimals as tell it from its neighbours.
std::string tick_text(double v, double step, double largest) {
  if (std::abs(v) < 1e-9 * step) return "0";
  const bool plain = largest < 1e6 && largest >= 1e-3;
  const int exponent = plain ? 0 : static_cast<int>(std::floor(std::log10(largest) + 1e-9));
  const double unit = std::pow(10, exponent);
  const int decimals = std::clamp(-static_cast<int>(std::floor(std::log10(step / unit) + 1e-9)), 0, 9);
  std::string text = fmt::format("{:.{}f}", v / unit, decimals);
  if (plain) return text;
  return text == "1" ? power_of_ten(exponent) : text + "·" + power_of_ten(exponent);
}

/// 1, 2 or 5 times a power of ten on a logarithmic axis.
std::string log_text(int factor, int exponent) {
  if (exponent >= -4 && exponent < 5) return fmt::format("{:g}", factor * std::pow(10, exponent));
  return (factor == 1 ? "" : fmt::format("{}·", factor)) + power_of_ten(exponent);
}

std::vector<Tick> Scale::ticks(int about) const {
  std::vector<Tick> found;
  if (log) {
    const bool few = high / low < 1e5;  // 2 and 5 are named where there is room
    const auto end = [&](double v) {
      return v < low * 1.001 || v > high * 0.999;  // the ends always, where they are round
    };
    for (int e = static_cast<int>(std::floor(std::log10(low) + 1e-9)); std::pow(10, e) <= high * 1.001; ++e) {
      for (const int factor : {1, 2, 5}) {
        const double v = factor * std::pow(10, e);
        if (v < low * 0.999 || v > high * 1.001 || (factor != 1 && !few && !end(v))) continue;
        found.push_back({v, log_text(factor, e)});
      }
    }
    return found;
  }
  const double step = round_step(high - low, about);
  const double largest = std::max(std::abs(low), std::abs(high));
  for (double k = std::ceil(low / step - 1e-6); k * step <= high + 1e-6 * step; ++k)
    found.push_back({k * step, tick_text(k * step, step, largest)});
  return found;
}

struct Axis {
  Scale scale;
  std::string name;
  int about = 5;                 ///< ticks
  std::vector<Tick> named = {};  ///< these and no others
};

/// The ticks of an axis so long that no text touches the next. Of a logarithmic axis the ends and the powers of ten
/// come first.
std::vector<Tick> ticks_of(const Axis& axis, double length, bool across) {
  const auto apart = [&](const Tick& a, const Tick& b) {
    const double room = across ? (text_width(a.text) + text_width(b.text)) / 2 + letter : line_height - 1;
    return std::abs(axis.scale.at(a.value) - axis.scale.at(b.value)) * length >= room;
  };
  if (axis.named.empty() && !axis.scale.log) {
    for (int about = axis.about; about > 1; --about) {
      std::vector<Tick> ticks = axis.scale.ticks(about);
      bool fits = true;
      for (std::size_t k = 1; k < ticks.size(); ++k) fits = fits && apart(ticks[k - 1], ticks[k]);
      if (fits) return ticks;
    }
    return axis.scale.ticks(1);
  }
  std::vector<Tick> wanted = axis.named.empty() ? axis.scale.ticks(axis.about) : axis.named;
  if (wanted.empty()) return wanted;
  if (axis.named.empty()) {
    const auto rank = [&](const Tick& t) {
      if (t.value == wanted.front().value || t.value == wanted.back().value) return 0;
      const double power = std::log10(t.value);
      return std::abs(power - std::round(power)) < 1e-6 ? 1 : 2;
    };
    std::vector<std::pair<int, Tick>> ranked;
    ranked.reserve(wanted.size());
    for (const Tick& t : wanted) ranked.emplace_back(rank(t), t);
    std::stable_sort(ranked.begin(), ranked.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    wanted.clear();
    for (auto& [place, tick] : ranked) wanted.push_back(std::move(tick));
  }
  std::vector<Tick> kept;
  for (const Tick& t : wanted) {
    if (std::all_of(kept.begin(), kept.end(), [&](const Tick& k) { return apart(k, t); })) kept.push_back(t);
  }
  return kept;
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
  if (is_logarithmic(errors)) {
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

struct LegendItem {
  std::string name;
  std::string kind;  ///< class of its colour
  bool line = true;  ///< else a dot
};

/// The frame of a plot: title for those who do not see it, legend, axes, what hangs on them. Margins follow the texts.
class Plot {
 public:
  Plot(const std::string& described, const Axis& x, const Axis& y,
       const std::vector<LegendItem>& legend = {}) {
    // Above the frame, where no curve is.
    double row = legend.empty() ? 0 : line_height, used = 4;
    std::string items;
    for (const LegendItem& item : legend) {
      const std::string name = fitting(item.name, width - legend_sample - 8);
      const double needed = legend_sample + text_width(name);
      if (used > 4 && used + needed > width) {
        row += line_height;
        used = 4;
      }
      const double middle = row - 3.5;
      items += item.line ? fmt::format("<path class=\"line {0}\" d=\"M{1:.1f} {2:.1f}H{3:.1f}\"/>\n",
                                       item.kind, used, middle, used + legend_sample - 5)
                         : fmt::format("<path class=\"dots {}\" d=\"M{:.1f} {:.1f}h0\"/>\n", item.kind,
                                       used + legend_sample - 9, middle);
      items += fmt::format("<text class=\"entry\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n",
                           used + legend_sample, row, escaped(name));
      used += needed + legend_gap;
    }
    top_ = top + (legend.empty() ? 0 : row + 2);
    height_ = usual_height + top_ - top;
    const double tall = height_ - top_ - bottom;
    const std::vector<Tick> up = ticks_of(y, tall, false);
    double longest = 0;
    for (const Tick& t : up) longest = std::max(longest, text_width(t.text));
    left_ = std::clamp(longest + (y.name.empty() ? 7 : 25), least_left_margin, most_left);
    const std::vector<Tick> along = ticks_of(x, width - left_ - least_right, true);
    right_ = least_right;
    for (const Tick& t : along) {
      // A text that is centred at its tick must end inside the drawing.
      const double share = x.scale.at(t.value);
      if (share > 0.5)
        right_ = std::max(
            right_, std::min(60.0, (text_width(t.text) / 2 + 2 - (1 - share) * (width - left_)) / share));
    }
    svg_ = fmt::format(
        "<svg viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\" "
        "xmlns=\"http://www.w3.org/2000/svg\">\n{}",
        width, height_, escaped(described), items);
    for (const Tick& t : up) {
      const double at = py(y.scale.at(t.value));
      line(px(0), at, px(1), at, "grid");
      text(px(0) - 5, at + 3.5, "end", fitting(t.text, left_ - 6));
    }
    if (!y.name.empty()) {
      svg_ += fmt::format(
          "<text class=\"name\" text-anchor=\"middle\" transform=\"translate(11 {:.1f}) "
          "rotate(-90)\">{}</text>\n",
          py(0.5), escaped(fitting(y.name, height_)));
    }
    for (const Tick& t : along) {
      const double at = px(x.scale.at(t.value));
      line(at, py(0), at, py(0) + 4, "axis");
      text(at, py(0) + 15, "middle", t.text);
    }
    line(px(0), py(0), px(1), py(0), "axis");
    text(px(0.5), height_ - 5, "middle", x.name, "name");
  }

  /// From shares of the frame, left to right and bottom to top, to places of the drawing.
  double px(double share) const { return left_ + share * (width - left_ - right_); }
  double py(double share) const { return height_ - bottom - share * (height_ - top_ - bottom); }

  void floor(double y) {
    line(px(0), y, px(1), y, "floor");
    text(px(1) - 2, y - 4, "end", "noise");
  }
  void line(double x1, double y1, double x2, double y2, const char* kind) {
    svg_ += fmt::format("<path class=\"{}\" d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\"/>\n", kind, x1, y1, x2, y2);
  }
  void path(const std::string& d, const std::string& kind) {
    if (!d.empty()) svg_ += fmt::format("<path class=\"{}\" d=\"{}\"/>\n", kind, d);
  }
  void text(double x, double y, const char* anchor, const std::string& what, const char* kind = "tick") {
    svg_ += fmt::format("<text class=\"{}\" x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>\n", kind,
                        x, y, anchor, escaped(what));
  }
  std::string done() { return svg_ + "</svg>\n"; }

 private:
  double left_ = least_left_margin, right_ = least_right, top_ = top, height_ = usual_height;
  std::string svg_;
};

/// How large dots are: so many must be told apart.
std::string dots_of(std::size_t count, const std::string& kind) {
  return (count <= 60 ? "dots " : count <= 300 ? "mid " : "fine ") + kind;
}

/// Around a dot that stands apart.
std::string diamond(double x, double y) {
  return fmt::format("M{0:.1f} {3:.1f}L{2:.1f} {4:.1f}L{0:.1f} {5:.1f}L{1:.1f} {4:.1f}Z", x, x - 6, x + 6,
                     y - 6, y, y + 6);
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

std::string step_line(const Plot& plot, std::vector<double> values, const Scale& scale, std::size_t most) {
  std::sort(values.begin(), values.end());
  std::string d;
  const auto n = static_cast<double>(values.size());
  double from = 0;
  for (const std::size_t k : evenly(values.size(), most)) {
    const double x = plot.px(scale.at(values[k]));
    const double to = static_cast<double>(k + 1) / n;
    d += fmt::format("{}{:.1f} {:.1f}V{:.1f}", d.empty() ? "M" : "L", x, plot.py(from), plot.py(to));
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

/// "position error [mm]"
std::string axis_name(const ErrorPairs& errors) {
  return fmt::format("{} [{}]", errors.quantity, errors.unit);
}

}  // namespace

bool is_logarithmic(const ErrorPairs& errors) {
  double high = errors.floor.value_or(0), sum = 0;
  for (const auto* set : {&errors.before, &errors.after})
    for (const double v : *set) high = std::max(high, v);
  for (const double v : errors.after) sum += v;
  const double usual = errors.after.empty() ? high : sum / static_cast<double>(errors.after.size());
  return usual > 0 && high / usual > log_from_ratio;
}

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
  if (c.x_from_zero) x_low = std::min(x_low, 0.0);
  const double margin = std::max(1e-9, c.x_texts.empty() ? 0.02 * (x_high - x_low) : 0.5);
  Axis x{{c.x_from_zero ? x_low : x_low - margin, x_high + margin, false}, c.x_name, 6};
  for (std::size_t k = 0; k < c.x_texts.size(); ++k)
    x.named.push_back({static_cast<double>(k), c.x_texts[k]});
  const Axis y{around(y_low, y_high, c.log_y), c.y_name};
  const std::size_t drawn = std::min(c.curves.size(), Curves::most);
  const auto kind_of = [&](std::size_t k) {
    return c.curves[k].colour.empty() ? fmt::format("c{}", k + 1) : c.curves[k].colour;
  };
  const auto is_joined = [&](const Curve& curve) {
    return curve.style == CurveStyle::usual ? c.x_texts.empty() : curve.style != CurveStyle::dots;
  };
  std::vector<LegendItem> legend;
  for (std::size_t k = 0; k < drawn && c.curves.size() > 1; ++k)
    legend.push_back({c.curves[k].name, kind_of(k), is_joined(c.curves[k])});
  Plot plot(c.described, x, y, legend);
  for (std::size_t k = 0; k < drawn; ++k) {
    const Curve& curve = c.curves[k];
    const std::string kind = kind_of(k);
    std::string line, dots, forth, back;
    for (const std::size_t n :
         evenly(curve.points.size(), curve.style == CurveStyle::dots ? Detail().dots : curve.points.size())) {
      const auto& [at, value] = curve.points[n];
      if (c.log_y && !(value > 0)) continue;
      const double px_at = plot.px(x.scale.at(at));
      const double py_at = plot.py(y.scale.at(value));
      line += line.empty()                       ? fmt::format("M{:.1f} {:.1f}", px_at, py_at)
              : curve.style == CurveStyle::steps ? fmt::format("H{:.1f}V{:.1f}", px_at, py_at)
                                                 : fmt::format("L{:.1f} {:.1f}", px_at, py_at);
      dots += dot(px_at, py_at);
      if (n >= curve.band.size()) continue;
      forth += fmt::format("{}{:.1f} {:.1f}", forth.empty() ? "M" : "L", px_at,
                           plot.py(y.scale.at(curve.band[n][1])));
      back.insert(0, fmt::format("L{:.1f} {:.1f}", px_at, plot.py(y.scale.at(curve.band[n][0]))));
    }
    if (!forth.empty()) plot.path(forth + back + "Z", "bars " + kind);
    const bool with_dots = curve.style == CurveStyle::usual || curve.style == CurveStyle::joined;
    if (is_joined(curve)) plot.path(line, "line " + kind);
    if (curve.style == CurveStyle::dots || (with_dots && curve.points.size() <= 60))
      plot.path(dots, dots_of(curve.points.size(), kind));
  }
  if (c.floor) plot.floor(plot.py(y.scale.at(*c.floor)));
  return plot.done();
}

std::string plot_bars(const Bars& bars) {
  double most = 0;
  for (const auto* list : {&bars.before, &bars.after})
    for (const double v : *list) most = std::max(most, v);
  if (!(most > 0)) return "";
  const double step = round_step(most, 5);
  const Axis x{{0, step * std::ceil(most / step - 1e-9), false}, bars.x_name};
  const auto count = static_cast<double>(std::max<std::size_t>(bars.names.size(), 1));
  Axis y{{0, count, false}, ""};
  for (std::size_t k = 0; k < bars.names.size(); ++k)
    y.named.push_back({count - static_cast<double>(k) - 0.5, bars.names[k]});
  Plot plot(bars.described, x, y);
  const auto draw = [&](const std::vector<double>& values, double from, double to, const char* kind) {
    std::string d;
    for (std::size_t k = 0; k < values.size(); ++k) {
      const double top_of = count - static_cast<double>(k);
      d += fmt::format("M{:.1f} {:.1f}H{:.1f}V{:.1f}H{:.1f}Z", plot.px(0), plot.py(y.scale.at(top_of - from)),
                       plot.px(x.scale.at(std::max(values[k], 0.0))), plot.py(y.scale.at(top_of - to)),
                       plot.px(0));
    }
    plot.path(d, kind);
  };
  draw(bars.before, 0.12, bars.after.empty() ? 0.88 : 0.5, "bars before");
  draw(bars.after, 0.5, 0.88, "bars after");
  return plot.done();
}

std::string plot_in_order(const ErrorPairs& errors, const Detail& detail) {
  const Axis y{scale_of(errors), axis_name(errors)};
  const auto n = static_cast<double>(errors.before.size());
  Axis x{{0.5 - 0.02 * n, n + 0.5 + 0.02 * n, false}, "pose"};
  for (int about = 6; about > 0 && x.named.empty(); --about) {
    for (Tick& t : x.scale.ticks(about)) {
      if (t.value >= 1 && t.value <= n && t.value == std::floor(t.value)) x.named.push_back(t);
    }
  }
  Plot plot("Error of each pose in the order of the data, before and after", x, y);
  std::string stems, before, after, apart;
  const std::vector<std::size_t> shown = shown_rows({&errors.after, &errors.before}, detail.dots);
  for (const std::size_t k : shown) {
    const double at = plot.px(x.scale.at(static_cast<double>(k + 1)));
    const double upper = plot.py(y.scale.at(errors.before[k])), lower = plot.py(y.scale.at(errors.after[k]));
    if (errors.before.size() <= 120) stems += fmt::format("M{:.1f} {:.1f}V{:.1f}", at, upper, lower);
    before += dot(at, upper);
    after += dot(at, lower);
    if (std::binary_search(errors.outliers.begin(), errors.outliers.end(), k)) apart += diamond(at, lower);
  }
  plot.path(stems, "stem");
  plot.path(before, dots_of(shown.size(), "before"));
  plot.path(after, dots_of(shown.size(), "after"));
  plot.path(apart, "apart");
  if (errors.floor) plot.floor(plot.py(y.scale.at(*errors.floor)));
  return plot.done();
}

std::string plot_sorted(const ErrorPairs& errors, const Detail& detail) {
  const Axis x{scale_of(errors), axis_name(errors), 6};
  const Axis y{{0, 100, false}, "% of the poses below", 4};
  Plot plot("Share of the poses whose error lies below a value, before and after", x, y);
  if (errors.floor) {
    const double at = plot.px(x.scale.at(*errors.floor));
    const bool beside = at < plot.px(0.8);
    plot.line(at, plot.py(0), at, plot.py(1), "floor");
    plot.text(beside ? at + 3 : at - 3, plot.py(0.06), beside ? "start" : "end", "noise");
  }
  plot.path(step_line(plot, errors.before, x.scale, detail.steps), "line before");
  plot.path(step_line(plot, errors.after, x.scale, detail.steps), "line after");
  return plot.done();
}

std::string plot_histogram(const ErrorPairs& errors) {
  const Axis x{scale_of(errors), axis_name(errors), 6};
  const auto n = static_cast<double>(errors.before.size());
  const auto classes = static_cast<std::size_t>(std::clamp(2 * std::cbrt(n) + 8, 12.0, 40.0));
  const auto before = counts(errors.before, x.scale, classes);
  const auto after = counts(errors.after, x.scale, classes);
  std::size_t most = 1;
  for (std::size_t k = 0; k < classes; ++k) most = std::max({most, before[k], after[k]});
  const double step = std::max(1.0, round_step(static_cast<double>(most), 4));
  Axis y{{0, step * std::ceil(static_cast<double>(most) / step), false}, "poses"};
  const auto whole = static_cast<std::size_t>(step);
  for (std::size_t v = 0; static_cast<double>(v) <= y.scale.high; v += whole)
    y.named.push_back({static_cast<double>(v), fmt::format("{}", v)});
  Plot plot("How many poses have which error, before and after", x, y);
  const auto bars = [&](const std::vector<std::size_t>& count) {
    std::string d;
    for (std::size_t k = 0; k < classes; ++k) {
      if (count[k] == 0) continue;
      const double from = plot.px(static_cast<double>(k) / static_cast<double>(classes)) + 0.5;
      const double to = plot.px(static_cast<double>(k + 1) / static_cast<double>(classes)) - 0.5;
      d += fmt::format("M{:.1f} {:.1f}V{:.1f}H{:.1f}V{:.1f}Z", from, plot.py(0),
                       plot.py(y.scale.at(static_cast<double>(count[k]))), to, plot.py(0));
    }
    return d;
  };
  plot.path(bars(before), "bars before");
  plot.path(bars(after), "bars after");
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
  const Axis y{{-step * std::ceil(reach / step - 1e-9), step * std::ceil(reach / step - 1e-9), false},
               "error after [mm]",
               4};
  const double margin = high > low ? 0.04 * (high - low) : 1;
  const Axis x{{low - margin, high + margin, false}, axis, 6};
  Plot plot("What is left of the position error against " + described, x, y);
  const std::vector<std::size_t> shown = shown_poses(poses, detail.dots_of_three);
  std::string apart;
  for (std::size_t k = 0; k < 3; ++k) {
    std::vector<std::array<double, 2>> places;
    places.reserve(shown.size());
    for (const std::size_t n : shown) {
      places.push_back({plot.px(x.scale.at(values[n])),
                        plot.py(std::clamp(y.scale.at(poses[n].after_m[k] * 1e3), 0.0, 1.0))});
      if (poses[n].outlier) apart += diamond(places.back()[0], places.back()[1]);
    }
    std::string d;
    if (places.size() > 200 || places.size() < poses.size()) {
      d = fine_dots(std::move(places));
    } else {
      for (const auto& [at, value] : places) d += dot(at, value);
    }
    plot.path(d, dots_of(shown.size(), std::string(1, "xyz"[k])));
  }
  plot.path(apart, "apart");
  return plot.done();
}

std::string plot_coverage(const PagePlan& plan) {
  const Axis x{{0, 100, false}, "% of the way from the lower to the upper limit"};
  Axis y{{0.4, static_cast<double>(joint_count) + 0.6, false}, "joint"};
  for (std::size_t j = 0; j < joint_count; ++j)
    y.named.push_back({static_cast<double>(joint_count - j), fmt::format("q{}", j + 1)});
  Plot plot("Where the poses lie between the limits of each joint", x, y);
  const auto dots = [&](const std::vector<std::array<double, joint_count>>& poses, double shift) {
    std::string d;
    for (const auto& q : poses) {
      for (std::size_t j = 0; j < joint_count; ++j) {
        const auto& [lower, upper] = plan.limits_rad[j];
        d += dot(plot.px(std::clamp((q[j] - lower) / (upper - lower), 0.0, 1.0)),
                 plot.py(y.scale.at(static_cast<double>(joint_count - j) + shift)));
      }
    }
    return d;
  };
  plot.path(dots(plan.known_q_rad, 0.2), dots_of(plan.known_q_rad.size(), "before"));
  plot.path(dots(plan.q_rad, 0), dots_of(plan.q_rad.size(), "after"));
  return plot.done();
}

}  // namespace flexcomp::host
