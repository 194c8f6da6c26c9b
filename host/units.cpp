// SPDX-License-Identifier: Apache-2.0
#include "units.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <system_error>

namespace flexcomp::host {

namespace {

template <class T>
std::optional<T> parse(std::string_view text) {
  // from_chars takes no plus sign, and takes "inf" and "nan", which no file of ours may hold.
  if (text.starts_with('+')) {
    text.remove_prefix(1);
    if (text.starts_with('-')) return {};
  }
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return {};
  return value;
}

}  // namespace

std::optional<double> parse_si(std::string_view text, const Unit& unit) {
  // Without a factor the nearest double directly: through long double it would be rounded twice.
  if (unit.multiply == 1 && unit.divide == 1) return parse<double>(text);
  const auto value = parse<long double>(text);
  if (!value) return {};
  const auto si = static_cast<double>(*value * unit.multiply / unit.divide);
  if (!std::isfinite(si)) return {};
  return si;
}

double tidied(double si, const Unit& unit) {
  const long double value = std::round(static_cast<long double>(si) * unit.divide / unit.multiply * 1e10L);
  return static_cast<double>(value / 1e10L * unit.multiply / unit.divide + 0.0L);
}

std::string format_si(double si, const Unit& unit) {
  const long double value = static_cast<long double>(si) * unit.divide / unit.multiply;
  std::array<char, 64> text{};
  // 21 digits tell any two 80-bit long doubles apart, and those are 2048 times denser than doubles.
  for (int digits = 6; digits <= 21; ++digits) {
    const int length = std::snprintf(text.data(), text.size(), "%.*Lg", digits, value);
    const std::string_view written(text.data(), static_cast<std::size_t>(length));
    if (parse_si(written, unit) == si) break;
  }
  return text.data();
}

}  // namespace flexcomp::host
