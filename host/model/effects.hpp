// SPDX-License-Identifier: Apache-2.0
/// \file
/// Effects by name, their parameters in a set of terms, and a set of terms read back into effects. What an effect is
/// stands in its descriptor (model/effects/descriptor.hpp).
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "model/effects/descriptor.hpp"
#include "model/term_set.hpp"

namespace flexcomp::host {

/// gear_harmonic; nothing where the name is none of the catalogue's (`geometric` is no effect).
std::string effect_name(Effect effect);
std::optional<Effect> effect_of(std::string_view name);
/// By number.
const std::vector<std::string>& effect_names();

/// gear_harmonic[joint=3,order=1]; link_gravity.
std::string name(const EffectId& id);

/// Two forms of one effect: the same joint, link, order and place, whatever the size or number of coefficients.
bool same_name(const EffectId& a, const EffectId& b);

/// What is wrong with an id (joint out of range, order not positive, a link without length …), or nothing.
std::optional<std::string> validation_error(const EffectId& id, const Nominal& robot);

/// The keys of an effect on this arm in the order of docs/effects.md.
/// \throws std::invalid_argument  validation_error()
std::vector<EffectKey> keys(const EffectId& id, const Nominal& robot);

/// Appends an effect with all coefficients zero under a new instance number; its parameters are appended too.
/// \throws std::invalid_argument  validation_error()
void add_effect(ParametricModel& model, const EffectId& id, const Nominal& robot);

/// The next instance number of a set: one more than the highest.
std::uint16_t next_instance(const TermSet& set);

/// The terms of a set that enter and leave together, read back into names.
struct EffectGroup {
  EffectId id;
  std::vector<std::string> keys;      ///< those whose terms are there; a curve or grid has one key
  std::vector<Parameter> parameters;  ///< one per key, or one per value of a curve or grid
};

/// The effects of a set (without the geometric terms) in order of first appearance.
/// \throws std::invalid_argument  a term that fits no key of its effect
std::vector<EffectGroup> effects_of(const TermSet& set, const Nominal& robot);

/// The set in the order of files: links 1 to 6 (theta, d, a, alpha, beta), base, tool, then the effects in order of
/// first appearance, each with its keys in its descriptor's order; instances and tables numbered in that order.
/// \throws std::invalid_argument  as effects_of(), and for two geometric terms at one place
TermSet canonical(const TermSet& set, const Nominal& robot);

/// Every parameter of a set by name: geometric ones first, then effects_of().
std::vector<Parameter> parameters_of(const TermSet& set, const Nominal& robot);

}  // namespace flexcomp::host
