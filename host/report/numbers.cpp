// SPDX-License-Identifier: Apache-2.0
#include "report/numbers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace flexcomp::host {

std::string number_text(double v) {
  if (v == 0) return "0";
  if (std::abs(v) < 5e-6) return "< 0.00001";
  const int decimals = std::clamp(2 - static_cast<int>(std::floor(std::log10(std::abs(v)))), 0, 5);
  return fmt::format("{:.{}f}", v, decimals);
}

std::string length_text(double mm) {
  if (mm == 0 || mm >= 1e-3) return number_text(mm) + " mm";
  if (mm >= 1e-6) return number_text(mm * 1e3) + " µm";
  if (mm >= 1e-9) return number_text(mm * 1e6) + " nm";
  return "< 0.001 nm";
}

std::string change_text(double before, double after, bool exact) {
  if (exact || !(before > 0) || !(after > 0)) return "–";
  const double ratio = before / after;
  const bool smaller = ratio >= 1;
  const double times = smaller ? ratio : 1 / ratio;
  const std::string text = times > 1000 ? "> 1000" : fmt::format("{:.1f}", times);
  if (text == "1.0") return "the same";
  return fmt::format("{} × {}", text, smaller ? "smaller" : "larger");
}

std::string unit_of_name(std::string_view name) {
  static constexpr std::array<std::pair<std::string_view, const char*>, 10> units{
      {{"rad_per_nm3", "rad/(N·m)³"},
       {"rad_per_nm", "rad/(N·m)"},
       {"mm_per_h", "mm/h"},
       {"deg_per_h", "deg/h"},
       {"per_k", "1/K"},
       {"_kg", "kg"},
       {"_mm", "mm"},
       {"_deg", "deg"},
       {"rad", "rad"},
       {"gain", ""}}};
  for (const auto& [suffix, text] : units) {
    if (name.ends_with(suffix)) return text;
  }
  return "";
}

std::pair<std::string, std::string> with_uncertainty(double value, const std::optional<double>& sigma) {
  const double size = std::max(std::abs(value), sigma.value_or(0));
  if (size == 0) return {"0", sigma ? "0" : "–"};
  const bool small = size < 1e-3;
  const int exponent = small ? static_cast<int>(std::floor(std::log10(size))) : 0;
  const double unit = std::pow(10, exponent);
  const double least = sigma && *sigma > 0 ? *sigma / unit : std::abs(value) / unit * 1e-3;
  const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(least))), 0, 7);
  const auto text = [&](double v) {
    std::string t = fmt::format("{:.{}f}", v / unit, decimals);
    if (small) t += fmt::format("e{}", exponent);
    return t;
  };
  return {text(value), sigma ? text(*sigma) : "–"};
}

std::string mm_text(double metres) { return fmt::format("{:.4f}", metres * 1e3); }

}  // namespace flexcomp::host
