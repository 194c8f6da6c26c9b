// SPDX-License-Identifier: Apache-2.0
/// \file
/// The catalogue of effects as code: the one place that knows which terms an effect's name stands for, and its keys.
#ifndef FLEXCOMP_HOST_MODEL_EFFECTS_HPP
#define FLEXCOMP_HOST_MODEL_EFFECTS_HPP

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "flexcomp/robot.hpp"
#include "flexcomp/term.hpp"
#include "model/robot.hpp"
#include "model/term_set.hpp"
#include "units.hpp"

namespace flexcomp::host {

using Nominal = NominalRobot<joint_count>;

/// Which effect, and of which joint, order …: what stands in the brackets of a parameter's name. Members that an effect
/// does not use stay at their defaults.
struct EffectId {
  Effect effect = Effect::joint_compliance;
  unsigned joint = 0;                         ///< from 1
  unsigned from = 0;                          ///< joint_coupling, from 1
  unsigned link = 0;                          ///< link_bending; thermal_growth: 0 means all links
  double order = 0;                           ///< gear_harmonic (may be a fraction), axis_wobble
  double pivot_z_m = 0;                       ///< base_compliance, height in F0
  double after_s = 0;                         ///< reflector_slip
  std::size_t coefficients = 0;               ///< joint_curve: 6 … 256
  Factor factor = Factor::one;                ///< joint_curve
  Place place{};                              ///< unnamed
  std::array<Covariate, 2> covariate{};       ///< unnamed: along rows, along columns
  std::array<unsigned, 2> covariate_joint{};  ///< unnamed: from 1 where the covariate is a joint's
  std::array<std::vector<double>, 2> node{};  ///< unnamed: ascending, SI
};

/// What a key of an effect stands for.
struct EffectKey {
  std::string key;  ///< e.g. sin_rad
  Unit unit;
  std::vector<Term<double>>
      terms;               ///< with coefficient 0; a curve's or grid's term with coefficient 1 and table 0
  bool identified = true;  ///< false: accepted from files, but not a parameter on this arm
};

/// gear_harmonic; nothing where the name is none of the catalogue's (`geometric` is no effect).
std::string effect_name(Effect effect);
std::optional<Effect> effect_of(std::string_view name);
const std::vector<std::string>& effect_names();

/// gear_harmonic[joint=3,order=1]; link_gravity.
std::string name(const EffectId& id);

/// Belongs to the measurement and not to the robot: never pushed.
bool is_measurement_effect(Effect effect);

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
/// first appearance, each with its keys in the catalogue's order; instances and tables numbered in that order.
/// \throws std::invalid_argument  as effects_of(), and for two geometric terms at one place
TermSet canonical(const TermSet& set, const Nominal& robot);

/// Every parameter of a set by name: geometric ones first, then effects_of().
std::vector<Parameter> parameters_of(const TermSet& set, const Nominal& robot);

/// link3.theta, base.rx, tool.x, load.mass, point.z: a place as files name it. Nothing where there is no such place.
std::string place_name(Place place);
std::optional<Place> place_of(std::string_view name);
/// The unit that files use at a place: mm, deg (of a geometric term) or kg; and the suffix that goes with it.
Unit place_unit(Place place);
/// link3.d_mm
std::string geometric_name(Place place);

/// B and the tool's own terms are small by contract: F and E take what is large.
constexpr const char* small_terms_rule = "at most 20 mm and 2 deg (larger displacements belong to frames)";
bool is_beyond_small(const Term<double>& term);

/// q2, dir3, speed1, payload_kg, temp_c, time_s.
std::string covariate_name(Covariate covariate, unsigned joint);
std::optional<std::pair<Covariate, unsigned>> covariate_of(std::string_view name);
Unit covariate_unit(Covariate covariate);

/// Axes nearer to parallel or antiparallel than this are treated as parallel. The feet of their common normal move by
/// (distance of the axes) · (error of direction) / (angle between them): d would have to follow an error of 0.05 degrees by
/// 2 mm at 15 degrees, by 70 mm at 2 degrees, by metres below.
constexpr double parallel_within_rad = radians(15);

/// Links whose joint axis is nominally parallel to the next one's (parallel_within_rad): there d cannot be told from the
/// neighbour's and beta takes its place (Hayati). From the geometry alone, for any arm; link 6 has no next one.
std::array<bool, joint_count> takes_beta(const Nominal& robot);

/// True where link_gravity applies: gravity lies along the axis of joint 1.
bool gravity_is_axial(const Nominal& robot);

enum class ModelKind { full, geometric, no_gravity, no_stiffness };

/// The model of the paper for any arm, all coefficients zero: theta, d, a, alpha, beta of links 1 to 6 (24), base (6),
/// joint compliances (6), link gravity (3). Without base where frames are fitted. Gravity is left out where
/// !gravity_is_axial().
ParametricModel paper_model(const Nominal& robot, ModelKind kind, bool with_base);

}  // namespace flexcomp::host

#endif
