// SPDX-License-Identifier: Apache-2.0
#include "model/paper_model.hpp"

#include <cmath>

#include "model/place.hpp"

namespace flexcomp::host {

std::array<bool, joint_count> takes_beta(const Nominal& robot) {
  const double parallel = std::cos(parallel_within_rad);
  std::array<bool, joint_count> beta{};
  for (std::size_t i = 0; i + 1 < joint_count; ++i) {
    // The next axis is Rot(x,alpha) Rot(y,beta) e_z, seen from this one.
    beta[i] = std::abs(std::cos(robot.links[i].alpha_rad) * std::cos(robot.links[i].beta_rad)) > parallel;
  }
  return beta;
}

bool gravity_is_axial(const Nominal& robot) {
  return robot.gravity_m_s2[0] == 0 && robot.gravity_m_s2[1] == 0;
}

ParametricModel paper_model(const Nominal& robot, ModelKind kind, bool with_base) {
  ParametricModel model;
  const auto add = [&model](Place place) {
    model.parameters.push_back({geometric_name(place), place_unit(place), {model.set.terms.size()}, {}});
    Term<double> constant;
    constant.place = place;
    constant.coefficient = 0;
    model.set.terms.push_back(constant);
  };
  const std::array<bool, joint_count> beta = takes_beta(robot);
  for (std::uint8_t link = 1; link <= joint_count; ++link) {
    add({link, slot::theta});
    if (!beta[link - 1]) add({link, slot::d});
    add({link, slot::a});
    add({link, slot::alpha});
    if (beta[link - 1]) add({link, slot::beta});
  }
  for (std::uint8_t s = 0; with_base && s < 6; ++s) add({body::base, s});
  if (kind == ModelKind::full || kind == ModelKind::no_gravity) {
    for (unsigned joint = 1; joint <= joint_count; ++joint)
      add_effect(model, {.effect = Effect::joint_compliance, .joint = joint}, robot);
  }
  if ((kind == ModelKind::full || kind == ModelKind::no_stiffness) && gravity_is_axial(robot)) {
    add_effect(model, {.effect = Effect::link_gravity}, robot);
  }
  return model;
}

}  // namespace flexcomp::host
