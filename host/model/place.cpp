// SPDX-License-Identifier: Apache-2.0
#include "model/place.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "model/robot.hpp"

namespace flexcomp::host {

namespace {

constexpr std::array<const char*, 6> link_slots{"theta", "d", "a", "alpha", "beta", "gamma"};
constexpr std::array<const char*, 6> frame_slots{"x", "y", "z", "rx", "ry", "rz"};
constexpr std::array<const char*, 4> load_slots{"mass", "com_x", "com_y", "com_z"};

std::string body_name(Place place) {
  if (is_link(place)) return fmt::format("link{}", place.body);
  if (place.body == body::base) return "base";
  if (place.body == body::tool) return "tool";
  return place.body == body::load ? "load" : "point";
}

}  // namespace

bool is_length(Place place) {
  return is_link(place) ? place.slot == slot::d || place.slot == slot::a : place.slot <= slot::z;
}

std::string slot_name(Place place) {
  if (is_link(place)) return place.slot < link_slots.size() ? link_slots[place.slot] : "";
  if (place.body == body::base || place.body == body::tool)
    return place.slot < frame_slots.size() ? frame_slots[place.slot] : "";
  if (place.body == body::load) return place.slot < load_slots.size() ? load_slots[place.slot] : "";
  return place.body == body::point && place.slot < 3 ? frame_slots[place.slot] : "";
}

std::string place_name(Place place) {
  const std::string slot = slot_name(place);
  return slot.empty() ? slot : fmt::format("{}.{}", body_name(place), slot);
}

std::optional<Place> place_of(std::string_view name) {
  for (const std::uint8_t b : {body::base, body::tool, body::load, body::point}) {
    for (std::uint8_t s = 0; s < 6; ++s) {
      if (place_name({b, s}) == name) return Place{b, s};
    }
  }
  for (std::uint8_t b = 1; b <= joint_count; ++b) {
    for (std::uint8_t s = 0; s < 6; ++s) {
      if (place_name({b, s}) == name) return Place{b, s};
    }
  }
  return {};
}

Unit place_unit(Place place) {
  if (place.body == body::load) return place.slot == slot::mass ? Unit{"kg", 1, 1} : unit::mm;
  return is_length(place) ? unit::mm : unit::degree;
}

std::string geometric_name(Place place) {
  return fmt::format("{}_{}", place_name(place), place_unit(place).name);
}

bool is_beyond_small(const Term<double>& term) {
  if (term.place.body != body::base && term.place.body != body::tool) return false;
  // A little more than the limit, for a value that was written with few digits.
  return std::abs(term.coefficient) > (term.place.slot <= slot::z ? 0.020 : radians(2)) * (1 + 1e-12);
}

}  // namespace flexcomp::host
