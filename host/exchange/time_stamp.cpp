// SPDX-License-Identifier: Apache-2.0
#include "exchange/time_stamp.hpp"

#include <chrono>
#include <cstddef>

#include "exchange/delimited_text.hpp"

namespace flexcomp::host {

namespace {

/// Reads digits; advances. Nothing where there is another number of them.
std::optional<int> digits(std::string_view& text, std::size_t count) {
  if (text.size() < count) return {};
  int value = 0;
  for (std::size_t k = 0; k < count; ++k) {
    if (text[k] < '0' || text[k] > '9') return {};
    value = 10 * value + (text[k] - '0');
  }
  text.remove_prefix(count);
  return value;
}

bool take(std::string_view& text, std::string_view any_of) {
  if (text.empty() || any_of.find(text.front()) == std::string_view::npos) return false;
  text.remove_prefix(1);
  return true;
}

std::optional<double> of_day(std::string_view& text) {
  const auto h = digits(text, 2);
  if (!h || !take(text, ":")) return {};
  const auto m = digits(text, 2);
  if (!m || !take(text, ":")) return {};
  const auto s = digits(text, 2);
  if (!s || *h > 23 || *m > 59 || *s > 60) return {};
  double fraction = 0;
  if (take(text, ".,")) {
    double scale = 1;
    bool any = false;
    while (!text.empty() && text.front() >= '0' && text.front() <= '9') {
      scale /= 10;
      fraction += scale * (text.front() - '0');
      text.remove_prefix(1);
      any = true;
    }
    if (!any) return {};
  }
  return *h * 3600.0 + *m * 60.0 + *s + fraction;
}

}  // namespace

std::optional<TimeStamp> time_stamp(std::string_view text, const Unit& unit, char decimal) {
  std::string_view rest = text;
  if (const auto day = of_day(rest); day && rest.empty()) return TimeStamp{*day, Clock::day};
  rest = text;
  const auto year = digits(rest, 4);
  if (year && take(rest, "-")) {
    const auto month = digits(rest, 2);
    if (!month || !take(rest, "-")) return {};
    const auto day = digits(rest, 2);
    if (!day || !take(rest, "T ")) return {};
    const std::chrono::year_month_day date{std::chrono::year(*year),
                                           std::chrono::month(static_cast<unsigned>(*month)),
                                           std::chrono::day(static_cast<unsigned>(*day))};
    if (!date.ok()) return {};
    const auto time = of_day(rest);
    if (!time) return {};
    double offset = 0;
    const Clock clock = rest.empty() ? Clock::date : Clock::zoned;
    if (!rest.empty() && !take(rest, "Z")) {
      const double sign = rest.front() == '-' ? -1 : 1;
      if (!take(rest, "+-")) return {};
      const auto h = digits(rest, 2);
      take(rest, ":");
      const auto m = rest.empty() ? std::optional<int>(0) : digits(rest, 2);
      if (!h || !m || *h > 14 || *m > 59) return {};
      offset = sign * (*h * 3600.0 + *m * 60.0);
    }
    if (!rest.empty()) return {};
    const auto days = std::chrono::sys_days(date).time_since_epoch().count();
    return TimeStamp{static_cast<double>(days) * 86400.0 + *time - offset, clock};
  }
  if (const auto seconds = parse_number(text, decimal, unit)) return TimeStamp{*seconds, Clock::count};
  return {};
}

const char* words(Clock clock) {
  switch (clock) {
    case Clock::count:
      return "seconds from a start of its own";
    case Clock::day:
      return "times of day";
    case Clock::date:
      return "dates with times, without a time zone";
    default:
      return "dates with times and a time zone (Z, +01:00)";
  }
}

}  // namespace flexcomp::host
