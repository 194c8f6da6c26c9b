// SPDX-License-Identifier: Apache-2.0
/// \file
/// Time stamps of instruments and robots.
#pragma once

#include <optional>
#include <string_view>

#include "units.hpp"

namespace flexcomp::host {

enum class Clock {
  count,  ///< seconds (or a part of them) from a start that the file does not tell
  day,    ///< 12:30:05.25, from midnight
  date,   ///< 2026-03-01T12:30:05.25, from 1970 in a zone that the file does not tell
  zoned   ///< 2026-03-01T12:30:05.25Z, from 1970 in UTC
};

struct TimeStamp {
  double seconds = 0;
  Clock clock = Clock::count;
};

/// A number (in `unit`), a time of day, or an ISO 8601 date and time with T or a blank between, to a fraction of a second
/// behind a point or a comma, with or without an offset from UTC. Nothing where the text is none of it.
std::optional<TimeStamp> time_stamp(std::string_view text, const Unit& unit, char decimal);

/// In words, for messages.
const char* words(Clock clock);

}  // namespace flexcomp::host
