// SPDX-License-Identifier: Apache-2.0
/// \file
/// Registered numbers of the effects (docs/effects.md) and the physical bounds of their coefficients, which host and
/// controller share. Everything else about an effect is in its descriptor on the host.
#ifndef FLEXCOMP_EFFECT_HPP
#define FLEXCOMP_EFFECT_HPP

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace flexcomp {

/// The effect that a term belongs to, so that a set can be read back into names. The numbers are on the wire: add,
/// never change, never reuse.
enum class Effect : std::uint8_t {
  geometric = 0,             ///< constant of a slot
  joint_compliance = 1,      ///< angle per load torque (M12)
  link_gravity = 2,          ///< link weight (M14)
  nonlinear_compliance = 3,  ///< angle per cube of the load torque
  gear_harmonic = 4,         ///< sine and cosine of a reading
  joint_curve = 5,           ///< spline of a reading (M6)
  backlash = 6,              ///< half the gap, by direction
  readout_lag = 7,           ///< angle per relative speed; never pushed
  encoder_scale = 8,         ///< angle per own reading
  joint_coupling = 9,        ///< angle per another joint's reading
  axis_wobble = 10,          ///< tilt of an axis by its own reading
  link_bending = 11,         ///< tilt of a link per load moment
  thermal_growth = 12,       ///< length per temperature
  base_drift = 13,           ///< motion of the base in time; never pushed
  base_compliance = 14,      ///< tilt of the base per load moment
  payload_error = 15,        ///< mass and centre of mass
  reflector_slip = 16,       ///< shift of the measured point from a time on; never pushed
  unnamed = 17,              ///< grid that no other effect explains
  reflector_drift = 18,      ///< motion of the measured point in time; never pushed
};

/// What physics allows for each coefficient of an effect, SI per unit of the basis.
struct EffectBounds {
  double least = -std::numeric_limits<double>::infinity();
  double greatest = std::numeric_limits<double>::infinity();
  /// Span of the covariate (SI) below which the effect is not testable.
  double least_span = 0;
  /// The bounds are shares of the declared payload mass and hold for the mass only.
  bool of_declared_mass = false;
};

namespace detail {
/// By number of the effect.
inline constexpr std::array<EffectBounds, 19> effect_bounds_table{{
    {},                    // geometric
    {0},                   // joint_compliance
    {},                    // link_gravity
    {},                    // nonlinear_compliance
    {},                    // gear_harmonic
    {},                    // joint_curve
    {0},                   // backlash
    {0},                   // readout_lag
    {-5e-3, 5e-3},         // encoder_scale
    {-5e-3, 5e-3},         // joint_coupling
    {},                    // axis_wobble
    {0},                   // link_bending
    {0, 40e-6, 3},         // thermal_growth: K^-1; K
    {},                    // base_drift
    {0},                   // base_compliance
    {-0.5, 0.5, 0, true},  // payload_error
    {},                    // reflector_slip
    {},                    // unnamed
    {},                    // reflector_drift
}};
}  // namespace detail

/// Of the measurement and not of the robot: never sent to a controller.
constexpr bool belongs_to_measurement(Effect effect) {
  return effect == Effect::base_drift || effect == Effect::readout_lag || effect == Effect::reflector_slip ||
         effect == Effect::reflector_drift;
}

/// Bounds of an effect; of a number that is not registered, none.
constexpr EffectBounds effect_bounds(Effect effect) {
  const auto number = static_cast<std::size_t>(effect);
  return number < detail::effect_bounds_table.size() ? detail::effect_bounds_table[number] : EffectBounds{};
}

}  // namespace flexcomp

#endif
