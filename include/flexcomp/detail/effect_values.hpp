// SPDX-License-Identifier: Apache-2.0
/// \file
/// Values of all effects at given readings (docs/compensation.md, sections 4 and 5): what they turn the joints by, and how
/// they move links, base and tool. A joint's own deflections are in own_deflection.hpp.
#ifndef FLEXCOMP_DETAIL_EFFECT_VALUES_HPP
#define FLEXCOMP_DETAIL_EFFECT_VALUES_HPP

#include <array>
#include <cstddef>

#include "flexcomp/detail/basis.hpp"
#include "flexcomp/detail/statics.hpp"

namespace flexcomp {
namespace detail {

/// Basis (M5) of a term, where the loads in the links' frames are those at the readings q (rad), whose sines and
/// cosines are in `angle`.
template <class S, std::size_t N, class Cap>
inline S loaded_basis_value(const Model<S, N, Cap>& model, const Term<S>& term, const Context<S, N>& context,
                            const std::array<S, N>& q, const std::array<SinCos<S>, N>& angle,
                            const StaticLoad<S>& load, const LinkLoads<S, N>& loads, Wave<S>& wave) {
  const std::size_t j = term.joint;
  const S torque = loads.torque[j];
  switch (term.basis) {
    case Basis::load_torque:
      return torque;
    case Basis::load_torque_cubed:
      return torque * torque * torque;
    case Basis::link_weight:
      return lever_in_link_frame(model, angle, loads, j, term.distal_joint);
    case Basis::load_moment_x:
      return loads.moment_x[j];
    case Basis::load_moment_y:
      return loads.moment_y[j];
    case Basis::base_moment_x:
      return loads.base_moment_x + term.argument * load.total_force().y;
    case Basis::base_moment_y:
      return loads.base_moment_y - term.argument * load.total_force().x;
    default: {
      const S value = plain_basis_value(model, term, context, q, wave);
      return term.basis == Basis::curve && term.factor == Factor::load_torque ? value * torque : value;
    }
  }
}

/// Deflection of every joint by load and link weight, rad: compliances (M12), levers (M14), and what else needs loads.
template <class S, std::size_t N, class Cap>
inline void load_deflection(const Model<S, N, Cap>& model, const Context<S, N>& context,
                            const std::array<S, N>& q, const std::array<SinCos<S>, N>& angle,
                            const StaticLoad<S>& load, const LinkLoads<S, N>& loads,
                            std::array<S, N>& delta) {
  FLEXCOMP_UNROLL
  for (std::size_t i = 0; i < N; ++i) delta[i] = model.plan().compliance(i) * loads.torque[i];
  add_levers(
      model,
      [&](std::size_t joint, std::size_t distal) {
        return lever_in_link_frame(model, angle, loads, joint, distal);
      },
      delta);
  Wave<S> wave;
  const std::size_t count = model.plan().size(group::loaded);
  for (std::size_t k = 0; k < count; ++k) {
    const Term<S>& term = model.effect_of(group::loaded, k);
    delta[term.place.body - 1U] +=
        term.coefficient * loaded_basis_value(model, term, context, q, angle, load, loads, wave);
  }
}

/// Adds the deflections by other readings and the context (group::other) at the readings q, rad.
template <class S, std::size_t N, class Cap>
inline void add_other_deflections(const Model<S, N, Cap>& model, const std::array<S, N>& q,
                                  const Context<S, N>& context, std::array<S, N>& delta) {
  Wave<S> wave;
  const std::size_t count = model.plan().size(group::other);
  for (std::size_t k = 0; k < count; ++k) {
    const Term<S>& term = model.effect_of(group::other, k);
    delta[term.place.body - 1U] += term.coefficient * plain_basis_value(model, term, context, q, wave);
  }
}

/// Links, base and tool as terms and effects have moved them.
template <class S, std::size_t N>
struct MovedParts {
  std::array<MovedLink<S>, N> links;
  std::array<S, 6> base, tool;  ///< by slot, m and rad
};

/// Evaluates the effects that move links, base and tool at the readings q (rad).
template <class S, std::size_t N, class Cap>
FLEXCOMP_ONCE void move_parts(const Model<S, N, Cap>& model, const Context<S, N>& context,
                              const std::array<S, N>& q, const std::array<SinCos<S>, N>& angle,
                              const StaticLoad<S>& load, const LinkLoads<S, N>& loads,
                              MovedParts<S, N>& out) {
  for (std::size_t i = 0; i < N; ++i) {
    // Number by number: as a whole it would go through memcpy. The offset is in the angles.
    const LinkShape<S>& from = model.shape(i);
    MovedLink<S>& link = out.links[i];
    link.d = from.d;
    link.a = from.a;
    link.alpha.s = from.alpha.s;
    link.alpha.c = from.alpha.c;
    link.beta.s = from.beta.s;
    link.beta.c = from.beta.c;
    link.gamma.s = S(0);
    link.gamma.c = S(1);
    link.has_beta = from.has_beta;
  }
  for (std::size_t k = 0; k < 6; ++k) {
    out.base[k] = model.base()[k];
    out.tool[k] = model.tool()[k];
  }
  Wave<S> wave;
  const std::size_t count = model.plan().size(group::move);
  for (std::size_t k = 0; k < count; ++k) {
    const Term<S>& term = model.effect_of(group::move, k);
    const S value = term.coefficient * loaded_basis_value(model, term, context, q, angle, load, loads, wave);
    const std::uint8_t at = term.place.slot;
    if (term.place.body == body::base) {
      out.base[at] += value;
    } else if (term.place.body == body::tool) {
      out.tool[at] += value;
    } else {
      MovedLink<S>& link = out.links[term.place.body - 1U];
      if (at == slot::d) {
        link.d += value;
      } else if (at == slot::a) {
        link.a += value;
      } else {
        SinCos<S>& turned = at == slot::alpha ? link.alpha : at == slot::beta ? link.beta : link.gamma;
        turned = rotate(turned, value);
      }
    }
  }
}

}  // namespace detail
}  // namespace flexcomp

#endif
