// SPDX-License-Identifier: Apache-2.0
/// \file
/// Names and units of the places where terms act.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "flexcomp/term.hpp"
#include "units.hpp"

namespace flexcomp::host {

inline bool is_link(Place p) { return p.body >= 1 && p.body <= body::max_link; }
/// True where the slot is a length and not an angle; not of the load.
bool is_length(Place place);

/// link3.theta, base.rx, tool.x, load.mass, point.z: a place as files name it. Nothing where there is no such place.
std::string place_name(Place place);
std::optional<Place> place_of(std::string_view name);
/// rx of base.rx
std::string slot_name(Place place);
/// The unit that files use at a place: mm, deg (of a geometric term) or kg; and the suffix that goes with it.
Unit place_unit(Place place);
/// link3.d_mm
std::string geometric_name(Place place);

/// B and the tool's own terms are small by contract: F and E take what is large.
constexpr const char* small_terms_rule = "at most 20 mm and 2 deg (larger displacements belong to frames)";
bool is_beyond_small(const Term<double>& term);

}  // namespace flexcomp::host
