// SPDX-License-Identifier: Apache-2.0
// The core alone, in C++17: headers, no library to link, no heap, no exceptions. From the bytes of a parameter set to a
// corrected joint command, in double or (FLEXCOMP_SCALAR=float) in float. Ends with 0 where the command is the one that the host
// computes.
//
// Of flexcomp.h this takes nothing but two types: the struct in which `flexcomp export` writes down the nominal robot,
// and the scalar.
#include <flexcomp/compensate.hpp>
#include <flexcomp/image.hpp>

#include "tx60l.h"
#include "tx60l_set.h"

namespace {

using Scalar = flexcomp_real;

flexcomp::NominalRobot<6> nominal(const flexcomp_robot& from) {
  flexcomp::NominalRobot<6> to;
  std::size_t length = 0;
  while (from.name[length] != 0) ++length;
  to.name_hash = flexcomp::name_hash(from.name, length);
  for (std::size_t j = 0; j < 6; ++j) {
    const flexcomp_link& link = from.links[j];
    to.links[j] = {link.theta_rad, link.d_m, link.a_m, link.alpha_rad, link.beta_rad};
    to.limits[j] = {from.min_rad[j], from.max_rad[j]};
  }
  for (std::size_t k = 0; k < 3; ++k) {
    to.gravity_m_s2[k] = from.gravity_m_s2[k];
    to.tool_xyz_m[k] = from.tool_xyz_m[k];
    to.payload_com_m[k] = from.payload_com_m[k];
  }
  for (std::size_t k = 0; k < 4; ++k) to.tool_wxyz[k] = from.tool_wxyz[k];
  to.payload_kg = from.payload_kg;
  to.reference_temperature_c = from.reference_temperature_c;
  return to;
}

// 6 kB in float, 11 kB in double: static memory, never a stack. Prepared once, read in every cycle.
flexcomp::Model<Scalar> model;

}  // namespace

int main() {
  const flexcomp::NominalRobot<6> robot = nominal(staubli_tx60l);

  // Is it whole, and is it for this robot? Then prepare it.
  flexcomp::ImageHeader header;
  if (check_image(tx60l_image, sizeof tx60l_image, nominal_hash(robot), robot.name_hash, header) !=
      flexcomp::Refusal::none)
    return 1;
  if (model_from_image(tx60l_image, sizeof tx60l_image, robot, model) != flexcomp::Refusal::none) return 2;

  // Every cycle: the load, and the command.
  const flexcomp::Context<Scalar> context = flexcomp::default_context<Scalar>(robot);
  std::array<Scalar, 6> q_rad;
  for (std::size_t j = 0; j < 6; ++j) q_rad[j] = tx60l_command_rad[j];
  const auto corrected = compensate(model, q_rad, context);

  if (corrected.status != flexcomp::StepStatus::ok) return 3;
  constexpr Scalar allowed_rad = sizeof(Scalar) == sizeof(float) ? Scalar(4e-6F) : Scalar(1e-12);
  for (std::size_t j = 0; j < 6; ++j) {
    const Scalar off = corrected.q[j] - tx60l_corrected_rad[j];
    if (!(off <= allowed_rad && -off <= allowed_rad)) return 4;
  }
  return 0;
}
