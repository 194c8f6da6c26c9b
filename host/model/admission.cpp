// SPDX-License-Identifier: Apache-2.0
#include "model/admission.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <vector>

#include "input_error.hpp"
#include "model/effects.hpp"
#include "model/host_model.hpp"
#include "model/place.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

/// What is bounded, in words and in its unit.
struct MeasureText {
  const char* what;
  const char* unit;
};
MeasureText text_of(Measure measure) {
  switch (measure) {
    case Measure::value:
      return {"a deflection that depends on the pose", "rad"};
    case Measure::slope:
      return {"a slope", "rad/rad"};
    case Measure::scale:
      return {"a share of the joint readings", "rad/rad"};
    case Measure::direction:
      return {"a deflection by the direction of motion", "rad"};
    case Measure::compliance:
      return {"a compliance", "rad/(N m)"};
    case Measure::per_kg:
      return {"a deflection by the payload", "rad/kg"};
    case Measure::per_n:
      return {"a deflection by the external force", "rad/N"};
    case Measure::load:
      return {"a deflection by the largest load", "rad"};
    case Measure::per_k:
      return {"a growth by temperature", "1/K"};
    default:
      return {"a slope, loads included", "rad/rad"};
  }
}

/// Name of the effect that the k-th term that is not constant belongs to.
std::string effect_at(const TermSet& set, const Robot& robot, std::size_t k) {
  std::size_t index = 0;
  for (; index < set.terms.size(); ++index) {
    if (!is_constant(set.terms[index]) && k-- == 0) break;
  }
  if (index == set.terms.size()) return "effects";
  for (const EffectGroup& group : effects_of(set, robot.nominal)) {
    for (const Parameter& p : group.parameters) {
      if (std::find(p.terms.begin(), p.terms.end(), index) != p.terms.end()) return name(group.id);
    }
  }
  return place_name(set.terms[index].place);
}

}  // namespace

HostCertificate certified(const TermSet& set, const Robot& robot, const std::string& source) {
  const std::unique_ptr<HostModel> model = prepare(set, robot, source);
  const AdmissionLimits<double> limits;
  Admission<double, joint_count> admission;
  admission.begin(*model, limits, default_ranges<double>(robot.nominal));
  while (admission.advance(*model)) {
  }
  HostCertificate certificate;
  std::uint32_t detail = 0;
  const Refusal refusal = admission.finish(*model, certificate, detail);
  if (refusal == Refusal::none) return certificate;
  if (refusal == Refusal::too_costly) {
    throw InputError(source, 0, "effects",
                     fmt::format("a step of at most {} instructions on a Cortex-M7", limits.instructions),
                     fmt::format("terms that take {}", detail));
  }
  if (refusal == Refusal::implausible) {
    const Excess<double>& e = admission.excess();
    const bool is_length = e.limit == LargestConstant<double>::m;
    throw InputError(
        source, 0, place_name(admission.constant()),
        is_length ? fmt::format("a constant of at most {:.0f} mm", e.limit * 1e3)
                  : fmt::format("a constant of at most {:.3g} deg", degrees(e.limit)),
        is_length ? fmt::format("{:.6g} mm", e.bound * 1e3) : fmt::format("{:.6g} deg", degrees(e.bound)));
  }
  const std::string effect = effect_at(set, robot, detail);
  if (refusal == Refusal::not_allowed_covariate) {
    throw InputError(source, 0, effect, "readings, loads, temperature or direction, which a controller knows",
                     "time or speed");
  }
  const Excess<double>& e = admission.excess();
  const MeasureText what = text_of(e.measure);
  const std::string where = e.place < joint_count
                                ? fmt::format("joint {}", e.place + 1)
                                : std::string("links, base and tool, lengths by the reach,");
  throw InputError(
      source, 0, effect,
      fmt::format("{} of {} of at most {:.3g} {}, as arms have", what.what, where, e.limit, what.unit),
      fmt::format("{:.3g} {}, most of it by this effect", e.bound, what.unit));
}

void refuse_inadmissible(const TermSet& set, const Robot& robot, const std::string& source) {
  TermSet pushed = set;
  std::erase_if(pushed.terms, [](const Term<double>& t) {
    return belongs_to_measurement(t.effect) || t.place.body == body::point || t.effect == Effect::unnamed;
  });
  certified(pushed, robot, source);
}

std::string certificate_text(const HostCertificate& c) {
  std::array<double, joint_count> deg{};
  for (std::size_t i = 0; i < joint_count; ++i) deg[i] = degrees(c.deflection_rad[i]);
  return fmt::format(
      "bounds: joints deflect by at most {:.4f} deg, slope at most {:.3f}; at the tool the set is at most "
      "{:.2f} mm and "
      "{:.3f} deg; {:.4f} deg/kg, {:.5f} deg/N, {:.6f} deg/K\n"
      "cost: at most {} instructions a step on a Cortex-M7",
      fmt::join(deg, " "), std::max(*std::max_element(c.slope.begin(), c.slope.end()), c.off_joint_slope),
      c.position_m * 1e3, degrees(c.orientation_rad), degrees(c.rad_per_kg), degrees(c.rad_per_n),
      degrees(c.rad_per_k), c.instructions);
}

Json to_json(const HostCertificate& c) {
  std::vector<double> deg;
  for (const double v : c.deflection_rad) deg.push_back(degrees(v));
  return {{"deflection_deg", deg},
          {"slope", c.slope},
          {"off_joint_deg", degrees(c.off_joint_rad)},
          {"off_joint_slope", c.off_joint_slope},
          {"deg_per_kg", degrees(c.rad_per_kg)},
          {"deg_per_n", degrees(c.rad_per_n)},
          {"deg_per_m", degrees(c.rad_per_m)},
          {"deg_per_k", degrees(c.rad_per_k)},
          {"position_mm", c.position_m * 1e3},
          {"orientation_deg", degrees(c.orientation_rad)},
          {"reach_mm", c.reach_m * 1e3},
          {"instructions", c.instructions}};
}

}  // namespace flexcomp::host
