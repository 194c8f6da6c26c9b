// SPDX-License-Identifier: Apache-2.0
#include "model/covariate.hpp"

#include <fmt/format.h>

#include "model/robot.hpp"

namespace flexcomp::host {

bool is_joint_covariate(Covariate c) {
  return c == Covariate::joint_position || c == Covariate::direction || c == Covariate::relative_speed;
}

std::string covariate_name(Covariate covariate, unsigned joint) {
  switch (covariate) {
    case Covariate::joint_position:
      return fmt::format("q{}", joint);
    case Covariate::payload:
      return "payload_kg";
    case Covariate::temperature:
      return "temp_c";
    case Covariate::time:
      return "time_s";
    case Covariate::direction:
      return fmt::format("dir{}", joint);
    case Covariate::relative_speed:
      return fmt::format("speed{}", joint);
  }
  return {};
}

std::optional<std::pair<Covariate, unsigned>> covariate_of(std::string_view name) {
  for (const Covariate c : {Covariate::joint_position, Covariate::payload, Covariate::temperature,
                            Covariate::time, Covariate::direction, Covariate::relative_speed}) {
    for (unsigned j = 1; j <= joint_count; ++j) {
      if (covariate_name(c, j) == name) return std::pair{c, is_joint_covariate(c) ? j : 0U};
    }
  }
  return {};
}

Unit covariate_unit(Covariate covariate) {
  return covariate == Covariate::joint_position ? unit::degree : unit::si;
}

std::string factor_name(Factor factor) {
  switch (factor) {
    case Factor::one:
      return "";
    case Factor::load_torque:
      return "load_torque";
    case Factor::temperature:
      return "temperature";
    case Factor::payload:
      return "payload";
  }
  return "";
}

std::optional<Factor> factor_of(std::string_view name) {
  for (const Factor f : {Factor::load_torque, Factor::temperature, Factor::payload}) {
    if (factor_name(f) == name) return f;
  }
  return {};
}

}  // namespace flexcomp::host
