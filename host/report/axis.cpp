// SPDX-License-Identifier: Apache-2.0
#include "report/axis.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace flexcomp::host {
namespace {

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

std::vector<Tick> log_ticks(const Scale& s) {
  std::vector<Tick> found;
  const bool few = s.high / s.low < 1e5;  // 2 and 5 are named where there is room
  const auto is_end = [&](double v) { return v < s.low * 1.001 || v > s.high * 0.999; };
  for (int e = static_cast<int>(std::floor(std::log10(s.low) + 1e-9)); std::pow(10, e) <= s.high * 1.001;
       ++e) {
    for (const int factor : {1, 2, 5}) {
      const double v = factor * std::pow(10, e);
      if (v < s.low * 0.999 || v > s.high * 1.001 || (factor != 1 && !few && !is_end(v))) continue;
      found.push_back({v, log_text(factor, e)});
    }
  }
  return found;
}

/// The ends first, then powers of ten.
void sort_by_importance(std::vector<Tick>& ticks) {
  if (ticks.empty()) return;
  const double first = ticks.front().value, last = ticks.back().value;
  const auto rank = [&](const Tick& t) {
    if (t.value == first || t.value == last) return 0;
    const double power = std::log10(t.value);
    return std::abs(power - std::round(power)) < 1e-6 ? 1 : 2;
  };
  std::ranges::stable_sort(ticks, [&](const Tick& a, const Tick& b) { return rank(a) < rank(b); });
}

}  // namespace

double text_width(const std::string& text) {
  const auto starts_character = [](char c) { return (c & 0xC0) != 0x80; };
  return letter_width * static_cast<double>(std::ranges::count_if(text, starts_character));
}

double round_step(double range, int about) { return round_number(range / about, true); }

double round_number(double v, bool up) {
  const double power = std::pow(10, std::floor(std::log10(v) + 1e-9));
  double below = power;
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (up && factor * power >= v * (1 - 1e-9)) return factor * power;
    if (factor * power <= v * (1 + 1e-9)) below = factor * power;
  }
  return up ? 10 * power : below;
}

Scale from_zero(double high, int parts) {
  const double step = round_step(high, parts);
  return {0, step * std::ceil(high / step - 1e-9), false};
}

Scale round_limits(double low, double high, bool log) {
  if (log) {
    low = std::pow(10, std::floor(std::log10(low)));
    high = std::pow(10, std::ceil(std::log10(high)));
    return {low, high > low ? high : 10 * low, true};
  }
  const double step = round_step(std::max(high - low, 1e-12 + 0.02 * std::abs(high)), 5);
  const double from = step * std::floor(low / step + 1e-9), to = step * std::ceil(high / step - 1e-9);
  return {from, to > from ? to : from + step, false};
}

Scale log_error_scale(double low, double high, double mean) {
  low = round_number(std::max(low, mean / 30), false);
  high = round_number(high, true);
  return {low, high > low ? high : 10 * low, true};
}

double Scale::at(double v) const {
  if (!log) return (v - low) / (high - low);
  return std::log(std::max(v, low) / low) / std::log(high / low);
}

std::vector<Tick> Scale::ticks(int about) const {
  if (log) return log_ticks(*this);
  std::vector<Tick> found;
  const double step = round_step(high - low, about);
  const double largest = std::max(std::abs(low), std::abs(high));
  for (double k = std::ceil(low / step - 1e-6); k * step <= high + 1e-6 * step; ++k)
    found.push_back({k * step, tick_text(k * step, step, largest)});
  return found;
}

std::vector<Tick> ticks_of(const Axis& axis, double length, bool horizontal) {
  const auto apart = [&](const Tick& a, const Tick& b) {
    const double room =
        horizontal ? (text_width(a.text) + text_width(b.text)) / 2 + letter_width : line_height - 1;
    return std::abs(axis.scale.at(a.value) - axis.scale.at(b.value)) * length >= room;
  };
  const auto touch = [&](const Tick& a, const Tick& b) { return !apart(a, b); };
  if (axis.named.empty() && !axis.scale.log) {
    for (int about = axis.about; about > 1; --about) {
      std::vector<Tick> ticks = axis.scale.ticks(about);
      if (std::ranges::adjacent_find(ticks, touch) == ticks.end()) return ticks;
    }
    return axis.scale.ticks(1);
  }
  std::vector<Tick> wanted = axis.named;
  if (wanted.empty()) {
    wanted = axis.scale.ticks(axis.about);
    sort_by_importance(wanted);
  }
  std::vector<Tick> kept;
  for (const Tick& t : wanted) {
    if (std::ranges::all_of(kept, [&](const Tick& k) { return apart(k, t); })) kept.push_back(t);
  }
  return kept;
}

std::size_t bin_count(std::size_t n) {
  return static_cast<std::size_t>(
      std::clamp(std::round(2 * std::cbrt(static_cast<double>(n)) + 8), 12.0, 40.0));
}

std::vector<std::size_t> histogram(const std::vector<double>& values, const Scale& scale, std::size_t bins) {
  std::vector<std::size_t> counts(bins);
  for (const double v : values) {
    const double share = scale.at(v);
    const double bin = std::isfinite(share) ? std::floor(share * static_cast<double>(bins)) : 0;
    ++counts[static_cast<std::size_t>(std::clamp(bin, 0.0, static_cast<double>(bins - 1)))];
  }
  return counts;
}

}  // namespace flexcomp::host
