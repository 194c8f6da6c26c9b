// SPDX-License-Identifier: Apache-2.0
// The table of effects. To add one: its number and bounds in flexcomp/effect.hpp, its descriptor here, its test, and
// the page docs/effects.md written anew by tests/host/model/effects_documentation_test.
#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "model/covariate.hpp"
#include "model/effects/descriptor.hpp"
#include "model/paper_model.hpp"
#include "model/place.hpp"

namespace flexcomp::host {

namespace {

using Keys = std::vector<EffectKey>;
using Error = std::optional<std::string>;

Place link_place(unsigned link, std::uint8_t slot) { return {static_cast<std::uint8_t>(link), slot}; }
Place theta(const EffectId& id) { return link_place(id.joint, slot::theta); }

/// A term whose basis reads joint or link `from_1` (0: none), with coefficient zero.
Term<double> term(const EffectId& id, Place place, Basis basis, unsigned from_1 = 0, double argument = 0) {
  Term<double> t;
  t.place = place;
  t.basis = basis;
  t.joint = static_cast<std::uint8_t>(from_1 == 0 ? 0 : from_1 - 1);
  t.effect = id.effect;
  t.argument = argument;
  t.coefficient = 0;
  return t;
}

/// A link-weight lever (M13) from joint `from_1` to joint `distal_1`, on theta of a link.
Term<double> lever(const EffectId& id, unsigned link, unsigned from_1, unsigned distal_1) {
  Term<double> t = term(id, link_place(link, slot::theta), Basis::link_weight, from_1);
  t.distal_joint = static_cast<std::uint8_t>(distal_1 - 1);
  return t;
}

/// One SI key with one term.
EffectKey key(std::string name, const Term<double>& t, const Unit& unit = unit::si) {
  return {std::move(name), unit, {t}};
}

/// One key that turns the joint by `basis` of joint `from_1`.
Keys turning(const char* name, const EffectId& id, Basis basis, unsigned from_1) {
  return {key(name, term(id, theta(id), basis, from_1))};
}

/// A term that reads table 0, whose values are its coefficients.
Term<double> table_term(Term<double> t, Factor factor = Factor::one) {
  t.factor = factor;
  t.table = 0;
  t.coefficient = 1;
  return t;
}

double twist_sine(const Nominal& robot, unsigned link) {
  return std::abs(std::sin(robot.links[link - 1].alpha_rad));
}

/// One coefficient for the lengths of one link, or of all (0). The basis has the nominal length: a zero has no term.
Keys growth(const EffectId& id, const Nominal& robot) {
  EffectKey per_k{"per_k", unit::si, {}};
  for (unsigned link = 1; link <= joint_count; ++link) {
    if (id.link != 0 && id.link != link) continue;
    const NominalLink& l = robot.links[link - 1];
    if (l.d_m != 0) per_k.terms.push_back(term(id, link_place(link, slot::d), Basis::thermal, link));
    if (l.a_m != 0) per_k.terms.push_back(term(id, link_place(link, slot::a), Basis::thermal, link));
  }
  return {per_k};
}

Error grid_error(const EffectId& id) {
  if (place_name(id.place).empty() || id.place.body == body::load) return "a place such as link3.theta";
  for (std::size_t side = 0; side < 2; ++side) {
    const unsigned joint = id.covariate_joint[side];
    if (is_joint_covariate(id.covariate[side]) && (joint < 1 || joint > joint_count))
      return "a joint from 1 to 6";
    const std::vector<double>& nodes = id.node[side];
    if (nodes.size() < 2 || nodes.size() > 64) return "2 to 64 nodes along each side of the grid";
    if (std::adjacent_find(nodes.begin(), nodes.end(), [](double a, double b) { return !(a < b); }) !=
        nodes.end())
      return "nodes of the grid in ascending order";
  }
  return {};
}

template <std::uint8_t of_body, std::uint8_t of_slot>
Place always(const EffectId&) {
  return {of_body, of_slot};
}

template <Covariate of_the_arm>
Follows the(const EffectId&) {
  return {of_the_arm, {}};
}
template <Covariate of_a_joint>
Follows own(const EffectId& id) {
  return {of_a_joint, {id.joint}};
}

/// Three keys that move the measured point by `basis`.
Keys moving_the_point(const EffectId& id, Basis basis, const char* suffix, const Unit& unit) {
  Keys keys;
  for (std::uint8_t s = slot::x; s <= slot::z; ++s) {
    const Place place{body::point, s};
    keys.push_back(key(slot_name(place) + suffix, term(id, place, basis, 0, id.after_s), unit));
  }
  return keys;
}

std::string joint_name(const EffectId& id) { return fmt::format("joint {}", id.joint); }

/// once, twice, 3 times, 2.5 times
std::string times(double n) {
  if (n == 1) return "once";
  if (n == 2) return "twice";
  return fmt::format("{:g} times", n);
}

EffectDescriptor joint_compliance() {
  return {
      .effect = Effect::joint_compliance,
      .name = "joint_compliance",
      .selectors = {Selector::joint},
      .keys = [](const EffectId& id,
                 const Nominal&) { return turning("rad_per_nm", id, Basis::load_torque, id.joint); },
      .usual_size = [](Place) { return 1e-5; },
      .in_paper_model = true,
      .is_nonnegative = true,
      // On an upright arm the load has no torque about joint 1: what looks like it is another parameter's.
      .elimination_rank = [](Place p) { return p.body == 1 ? 12 : 3; },
      .needs = Needs::load,
      .place = theta,
      .follows = the<Covariate::payload>,
      .sentence = [](const EffectId& id) { return joint_name(id) + " deflects under the load"; },
      .physics =
          "The joint is a linear torsional spring: it turns in proportion to the torque of payload "
          "and external force about its axis (M11, M12). The coefficient is a compliance, 1/K. Usual: "
          "1e-8 to 2e-3 rad/(N·m).",
      .record = "two payloads, one of them small",
      .confounded_with = "`payload_error` (a scale of all loads), unless one load is trusted",
      .example = {.effect = Effect::joint_compliance, .joint = 2},
  };
}

EffectDescriptor nonlinear_compliance() {
  return {
      .effect = Effect::nonlinear_compliance,
      .name = "nonlinear_compliance",
      .selectors = {Selector::joint},
      .keys = [](const EffectId& id,
                 const Nominal&) { return turning("rad_per_nm3", id, Basis::load_torque_cubed, id.joint); },
      .usual_size = [](Place) { return 1e-6; },
      .needs = Needs::load,
      .place = theta,
      .follows = the<Covariate::payload>,
      .sentence =
          [](const EffectId& id) {
            return joint_name(id) + " deflects under the load otherwise than in proportion";
          },
      .physics =
          "Gears stiffen with torque: a cubic part of the joint's deflection beside the linear one "
          "(M11). Negative where the joint stiffens. Usual: 0.3 to 1 arcmin at rated torque.",
      .record = "three payloads over the rated range",
      .confounded_with = "`joint_compliance` of the same joint, where all torques are of one size",
      .example = {.effect = Effect::nonlinear_compliance, .joint = 3},
  };
}

EffectDescriptor link_bending() {
  return {
      .effect = Effect::link_bending,
      .name = "link_bending",
      .selectors = {Selector::link},
      .keys = [](const EffectId& id, const Nominal& robot) -> Keys {
        EffectKey beta =
            key("beta_rad_per_nm", term(id, link_place(id.link, slot::beta), Basis::load_moment_y, id.link));
        // On a link whose twist is large the tilt about y is the joint's own motion.
        beta.identified = twist_sine(robot, id.link) <= 0.1;
        return {key("alpha_rad_per_nm",
                    term(id, link_place(id.link, slot::alpha), Basis::load_moment_x, id.link)),
                beta};
      },
      .usual_size = [](Place) { return 1e-6; },
      .needs = Needs::load,
      .place = [](const EffectId& id) { return link_place(id.link, slot::alpha); },
      .follows = the<Covariate::payload>,
      .sentence =
          [](const EffectId& id) { return fmt::format("link {} bends sideways under the load", id.link); },
      .physics =
          "The link, and the bearing at its end, tilt under the moment of the load about x and y of "
          "the frame after the link (M10). The tilt about y is identified only where the link's twist "
          "is small (\\|sin α\\| ≤ 0.1): elsewhere it is the joint's own motion. Of link 6 it is the "
          "bending of the tool flange.",
      .record = "two payloads, the load far from the flange, the wrist turned",
      .confounded_with = "`joint_compliance` of neighbouring joints, `base_compliance` for link 1",
      .example = {.effect = Effect::link_bending, .link = 3},
  };
}

EffectDescriptor base_compliance() {
  return {
      .effect = Effect::base_compliance,
      .name = "base_compliance",
      .selectors = {Selector::pivot},
      .keys = [](const EffectId& id, const Nominal&) -> Keys {
        return {
            key("rx_rad_per_nm", term(id, {body::base, slot::rx}, Basis::base_moment_x, 0, id.pivot_z_m)),
            key("ry_rad_per_nm", term(id, {body::base, slot::ry}, Basis::base_moment_y, 0, id.pivot_z_m))};
      },
      .usual_size = [](Place) { return 1e-7; },
      .needs = Needs::load,
      .place = always<body::base, slot::rx>,
      .follows = the<Covariate::payload>,
      .sentence =
          [](const EffectId& id) {
            return fmt::format("the base tilts under the load, about a pivot at z = {:.0f} mm",
                               id.pivot_z_m * 1e3);
          },
      .physics =
          "Pedestal or rail: the base tilts under the moment of payload and external force about x "
          "and y of F0 through the pivot (0, 0, `pivot_z_mm`) (M10). The search takes the lowest "
          "point of the bodies that stand on the base for the pivot.",
      .record = "two payloads, the arm stretched out in several directions",
      .confounded_with = "`joint_compliance` of joint 2 where the pivot is near that joint's height",
      .example = {.effect = Effect::base_compliance, .pivot_z_m = -0.375},
  };
}

EffectDescriptor payload_error() {
  return {
      .effect = Effect::payload_error,
      .name = "payload_error",
      .keys =
          [](const EffectId& id, const Nominal&) {
            Keys keys;
            for (std::uint8_t s = slot::mass; s <= slot::com_z; ++s) {
              const Place place{body::load, s};
              keys.push_back(key(fmt::format("{}_{}", slot_name(place), place_unit(place).name),
                                 term(id, place, Basis::one), place_unit(place)));
            }
            return keys;
          },
      .usual_size = [](Place p) { return p.slot == slot::mass ? 0.1 : 0.01; },
      .needs = Needs::load,
      .forms = {{0}, {1, 2, 3}, {0, 1, 2, 3}},
      .place = always<body::load, slot::mass>,
      .follows = the<Covariate::payload>,
      .sentence = [](const EffectId&) { return std::string("the payload is not what was declared"); },
      .physics =
          "Mass and centre of mass of the payload are corrected by the same amounts in every row, "
          "before torques are taken (section 3). 10 % of the mass is 10 % of the sag.",
      .record = "two payloads of which one is trusted (none at all, say)",
      .confounded_with =
          "`joint_compliance`: a scale error of all loads is exactly a scale of all compliances",
      .example = {.effect = Effect::payload_error},
  };
}

EffectDescriptor link_gravity() {
  return {
      .effect = Effect::link_gravity,
      .name = "link_gravity",
      .rule = [](const EffectId&, const Nominal& robot) -> Error {
        if (gravity_is_axial(robot)) return {};
        return "gravity along the axis of joint 1 (on other mountings the weight also loads joint 1, which "
               "has no term yet)";
      },
      .keys = [](const EffectId& id, const Nominal&) -> Keys {
        // s_2, the upper arm's lever, ends at the origin of joint 3; s_23, the forearm's, at that of joint 5.
        return {key("k1_rad", lever(id, 2, 2, 3)), key("k2_rad", lever(id, 2, 3, 5)),
                key("k3_rad", lever(id, 3, 3, 5))};
      },
      .usual_size = [](Place) { return 1e-3; },
      .in_paper_model = true,
      .elimination_rank = [](Place) { return 3; },
      .place = always<2, slot::theta>,
      .follows =
          [](const EffectId&) {
            return Follows{Covariate::joint_position, {2, 3}};
          },
      .sentence =
          [](const EffectId&) { return std::string("upper arm and forearm sag under their own weight"); },
      .physics =
          "Upper arm and forearm load joints 2 and 3 with their weight, in proportion to the lever s "
          "(M13, M14). A positive coefficient sags. Only where gravity is along the axis of joint 1. "
          "3 to 14 % of the error of UR and IRB 120 arms.",
      .record = "poses over the whole range of joints 2 and 3",
      .confounded_with = "in part `gear_harmonic` of joint 2, order 1, and `encoder_scale` of joint 2",
      .example = {.effect = Effect::link_gravity},
  };
}

EffectDescriptor gear_harmonic() {
  return {
      .effect = Effect::gear_harmonic,
      .name = "gear_harmonic",
      .selectors = {Selector::joint, Selector::order},
      .rule = [](const EffectId& id, const Nominal&) -> Error {
        if (id.order > 0 && id.order <= 1e5) return {};
        return "an order above 0";
      },
      .keys = [](const EffectId& id, const Nominal&) -> Keys {
        return {key("sin_rad", term(id, theta(id), Basis::sine, id.joint, id.order)),
                key("cos_rad", term(id, theta(id), Basis::cosine, id.joint, id.order))};
      },
      .orders =
          [](const Robot& robot, unsigned joint) {
            std::vector<double> orders{1, 2, 3, 4, 5, 6, 7, 8};
            const double ratio = robot.gear_ratio[joint - 1];
            for (const double order : {ratio, 2 * ratio}) {
              if (order > 8) orders.push_back(order);
            }
            return orders;
          },
      .place = theta,
      .follows = own<Covariate::joint_position>,
      .sentence =
          [](const EffectId& id) {
            return fmt::format("{} has an error that comes {} per turn of the joint", joint_name(id),
                               times(id.order));
          },
      .physics =
          "Eccentric wheels and flexible splines: δθ = sin_rad · sin(n q) + cos_rad · cos(n q), ids 5 "
          "and 6 of section 2. Orders n from 1 to 8 are tried, and the motor's N and 2N where the "
          "robot file has the gear ratio N. Harmonic drives: 30 to 90 arcsec.",
      .record = "poses over the whole range of the joint",
      .confounded_with =
          "order 1 of joint 2 in part with `link_gravity`; a `joint_curve` of the joint contains it",
      .example = {.effect = Effect::gear_harmonic, .joint = 3, .order = 1},
  };
}

EffectDescriptor encoder_scale() {
  return {
      .effect = Effect::encoder_scale,
      .name = "encoder_scale",
      .selectors = {Selector::joint},
      .keys = [](const EffectId& id,
                 const Nominal&) { return turning("gain", id, Basis::joint_position, id.joint); },
      .place = theta,
      .follows = own<Covariate::joint_position>,
      .sentence =
          [](const EffectId& id) { return joint_name(id) + " turns a little more or less than it reads"; },
      .physics =
          "A wrong gear ratio or encoder resolution: δθ = gain · q, id 4 of section 2. Usual: 1e-5 to 5e-4.",
      .record = "poses over the whole range of the joint",
      .confounded_with =
          "a `joint_curve` of a joint that turns less than 360° contains it; of joint 2 "
          "within 3 to 5 % geometry with `link_gravity` and `gear_harmonic` of order 2",
      .example = {.effect = Effect::encoder_scale, .joint = 3},
  };
}

EffectDescriptor joint_coupling() {
  return {
      .effect = Effect::joint_coupling,
      .name = "joint_coupling",
      .selectors = {Selector::joint, Selector::from},
      .rule = [](const EffectId& id, const Nominal&) -> Error {
        if (id.joint != id.from) return {};
        return "two joints (of a joint with itself the name is encoder_scale)";
      },
      .keys = [](const EffectId& id,
                 const Nominal&) { return turning("gain", id, Basis::joint_position, id.from); },
      .place = theta,
      .follows =
          [](const EffectId& id) {
            return Follows{Covariate::joint_position, {id.from}};
          },
      .sentence =
          [](const EffectId& id) {
            return fmt::format("{} turns along when joint {} does", joint_name(id), id.from);
          },
      .physics =
          "Gear trains of wrists: joint `joint` turns in proportion to joint `from`, where the controller's "
          "decoupling is wrong: δθ_joint = gain · q_from, id 4 of section 2. Usual: 1e-4 to 1e-3.",
      .record = "both joints over their whole ranges, independently of each other",
      .confounded_with = "`encoder_scale`, where the poses turn both joints together",
      .example = {.effect = Effect::joint_coupling, .joint = 6, .from = 5},
  };
}

EffectDescriptor axis_wobble() {
  return {
      .effect = Effect::axis_wobble,
      .name = "axis_wobble",
      .selectors = {Selector::joint, Selector::order},
      .rule = [](const EffectId& id, const Nominal&) -> Error {
        if (id.order == 1 || id.order == 2) return {};
        return "order 1 or 2";
      },
      .keys = [](const EffectId& id, const Nominal&) -> Keys {
        const Place alpha = link_place(id.joint, slot::alpha);
        const Place gamma = link_place(id.joint, slot::gamma);
        return {key("alpha_sin_rad", term(id, alpha, Basis::sine, id.joint, id.order)),
                key("alpha_cos_rad", term(id, alpha, Basis::cosine, id.joint, id.order)),
                key("gamma_sin_rad", term(id, gamma, Basis::sine, id.joint, id.order)),
                key("gamma_cos_rad", term(id, gamma, Basis::cosine, id.joint, id.order))};
      },
      .orders =
          [](const Robot&, unsigned) {
            return std::vector<double>{1, 2};
          },
      .place = [](const EffectId& id) { return link_place(id.joint, slot::alpha); },
      .follows = own<Covariate::joint_position>,
      .sentence =
          [](const EffectId& id) {
            return fmt::format("the axis of {} wobbles {} per turn", joint_name(id), times(id.order));
          },
      .physics =
          "Tilt error of the bearing: α and γ of the link, the tilts about the two axes perpendicular "
          "to the joint's, follow sin n q and cos n q, n = 1 or 2 (M2). Usual: 5 to 30 arcsec.",
      .record = "poses over the whole range of the joint; orientations help",
      .confounded_with =
          "order 1 with a tilted base or tool frame and with α of the link, which geometry takes up",
      .example = {.effect = Effect::axis_wobble, .joint = 2, .order = 1},
  };
}

EffectDescriptor joint_curve() {
  return {
      .effect = Effect::joint_curve,
      .name = "joint_curve",
      .selectors = {Selector::joint, Selector::size, Selector::factor},
      .table = TableKind::curve,
      .rule = [](const EffectId& id, const Nominal&) -> Error {
        if (id.coefficients >= 6 && id.coefficients <= 256) return {};
        return "6 to 256 coefficients";
      },
      .keys = [](const EffectId& id, const Nominal&) -> Keys {
        return {key("coefficients_rad", table_term(term(id, theta(id), Basis::curve, id.joint), id.factor))};
      },
      .place = theta,
      .follows = own<Covariate::joint_position>,
      .sentence =
          [](const EffectId& id) {
            return fmt::format("{} has an error that is a curve over its angle{}", joint_name(id),
                               id.factor == Factor::load_torque   ? ", times the load's torque"
                               : id.factor == Factor::temperature ? ", times the warming"
                               : id.factor == Factor::payload     ? ", times the payload"
                                                                  : "");
          },
      .physics =
          "Any periodic error of a gear or encoder, a damaged tooth among them: a uniform periodic cubic "
          "B-spline of the reading (M6), if wanted times load torque, temperature difference or payload mass "
          "(`factor: load_torque`, `temperature`, `payload`). Its mean over the reachable range is 0. Named "
          "only where it beats every name with fewer numbers. Measured on UR5 and UR10: 200 to 500 µrad.",
      .record = "many poses over the whole range of the joint",
      .confounded_with = "contains `gear_harmonic` and `encoder_scale` of the same joint",
      .example = {.effect = Effect::joint_curve, .joint = 1, .coefficients = 6},
  };
}

EffectDescriptor backlash() {
  return {
      .effect = Effect::backlash,
      .name = "backlash",
      .selectors = {Selector::joint},
      .keys = [](const EffectId& id,
                 const Nominal&) { return turning("half_gap_rad", id, Basis::direction, id.joint); },
      .is_nonnegative = true,
      .needs = Needs::direction,
      .place = theta,
      .follows = own<Covariate::direction>,
      .sentence =
          [](const EffectId& id) {
            return joint_name(id) + " stays behind by half a gap, on the side it comes from";
          },
      .physics =
          "Play of the gear: the link stays behind the motion by half the gap, δθ = −half_gap · "
          "direction, id 7 of section 2. A negative half gap is not backlash. The controller changes "
          "the direction only after the joint has moved back by a dead band. Usual: 10 to 60 arcsec.",
      .record = "the joint approached from both sides",
      .confounded_with = "`readout_lag`, where only directions and no motions are recorded",
      .example = {.effect = Effect::backlash, .joint = 2},
  };
}

EffectDescriptor readout_lag() {
  return {
      .effect = Effect::readout_lag,
      .name = "readout_lag",
      .selectors = {Selector::joint},
      .keys = [](const EffectId& id,
                 const Nominal&) { return turning("rad", id, Basis::relative_speed, id.joint); },
      .usual_size = [](Place) { return 1e-3; },
      .is_nonnegative = true,
      .needs = Needs::moves,
      .place = theta,
      .follows = own<Covariate::relative_speed>,
      .sentence = [](const EffectId& id) { return joint_name(id) + " was read before the arm had stopped"; },
      .physics =
          "The readings were taken while the arm still moved: δθ in proportion to the relative speed "
          "u of the joint in a synchronised motion, id 8 of section 2. A fault of the measurement. "
          "About 1 mrad (IRB 120).",
      .record =
          "motions of different length and mixture of joints before the poses; better, wait before reading",
      .confounded_with = "`backlash`, where the joint always moves by the same share",
      .example = {.effect = Effect::readout_lag, .joint = 1},
  };
}

EffectDescriptor thermal_growth() {
  return {
      .effect = Effect::thermal_growth,
      .name = "thermal_growth",
      .selectors = {Selector::link},
      .all_links_by_default = true,
      .rule = [](const EffectId& id, const Nominal& robot) -> Error {
        if (id.link == 0 || robot.links[id.link - 1].a_m != 0 || robot.links[id.link - 1].d_m != 0) return {};
        return "a link with a nominal length (d or a)";
      },
      .keys = growth,
      .usual_size = [](Place) { return 1e-5; },
      .needs = Needs::temperature,
      .place = [](const EffectId& id) { return link_place(std::max(1U, id.link), slot::a); },
      .follows = the<Covariate::temperature>,
      .sentence =
          [](const EffectId& id) {
            return id.link == 0 ? std::string("all links grow with the temperature")
                                : fmt::format("link {} grows with the temperature", id.link);
          },
      .physics =
          "a and d of one link (`link`) or of all links grow in proportion to their nominal lengths and to "
          "temperature − reference, one coefficient, id 9 of section 2. Aluminium 23e-6, steel 12e-6 per K.",
      .record = "temperatures over some kelvin, in an order that does not follow the pose",
      .confounded_with = "`base_drift`, where temperature and time go together (\\|correlation\\| above 0.9)",
      .example = {.effect = Effect::thermal_growth},
  };
}

EffectDescriptor base_drift() {
  return {
      .effect = Effect::base_drift,
      .name = "base_drift",
      .keys =
          [](const EffectId& id, const Nominal&) {
            Keys keys;
            for (std::uint8_t s = slot::x; s <= slot::rz; ++s) {
              const Place place{body::base, s};
              keys.push_back(
                  key(fmt::format("{}_{}_per_h", slot_name(place), is_length(place) ? "mm" : "deg"),
                      term(id, place, Basis::time),
                      is_length(place) ? unit::mm_per_hour : unit::degree_per_hour));
            }
            return keys;
          },
      .usual_size = [](Place p) { return (is_length(p) ? 1e-5 : radians(0.001)) / 3600; },
      .needs = Needs::time,
      .forms = {{0, 1, 2}, {3, 4, 5}, {0, 1, 2, 3, 4, 5}},
      .place = always<body::base, slot::x>,
      .follows = the<Covariate::time>,
      .sentence =
          [](const EffectId&) {
            return std::string("the base drifts against the instrument while time passes");
          },
      .physics =
          "The stand of the robot or of the instrument moves uniformly in time: B follows `time_s`, "
          "id 10 of section 2. A fault of the measurement. Usual: 30 to 60 µm in a session.",
      .record = "times of the rows; some early poses once more at the end",
      .confounded_with = "`thermal_growth`, where temperature and time go together; `reflector_slip`",
      .example = {.effect = Effect::base_drift},
  };
}

EffectDescriptor reflector_slip() {
  return {
      .effect = Effect::reflector_slip,
      .name = "reflector_slip",
      .selectors = {Selector::after},
      .keys = [](const EffectId& id,
                 const Nominal&) { return moving_the_point(id, Basis::step, "_mm", unit::mm); },
      .needs = Needs::time,
      .place = always<body::point, slot::x>,
      .follows = the<Covariate::time>,
      .sentence =
          [](const EffectId& id) {
            return fmt::format("the measured point slipped after {:.0f} s", id.after_s);
          },
      .physics =
          "A reflector was knocked: from the time `after_s` on the measured point is elsewhere in "
          "Ftool, id 16 of section 2, E of (M1). A fault of the measurement.",
      .record = "times of the rows; some early poses once more at the end",
      .confounded_with = "`base_drift`, where few rows were measured after the step",
      .example = {.effect = Effect::reflector_slip, .after_s = 3600},
  };
}

EffectDescriptor reflector_drift() {
  return {
      .effect = Effect::reflector_drift,
      .name = "reflector_drift",
      .keys =
          [](const EffectId& id, const Nominal&) {
            return moving_the_point(id, Basis::time, "_mm_per_h", unit::mm_per_hour);
          },
      .usual_size = [](Place) { return 1e-5 / 3600; },
      .needs = Needs::time,
      .place = always<body::point, slot::x>,
      .follows = the<Covariate::time>,
      .sentence =
          [](const EffectId&) {
            return std::string("the measured point drifts in the tool's frame while time passes");
          },
      .physics =
          "The reflector creeps in its nest, or its holder warms up: the measured point moves uniformly in "
          "Ftool with `time_s`, id 10 of section 2, E of (M1). A fault of the measurement.",
      .record = "times of the rows; some early poses once more at the end, in several orientations",
      .confounded_with =
          "`base_drift`, where all rows have nearly one orientation; `reflector_slip`, where rows are few",
      .example = {.effect = Effect::reflector_drift},
  };
}

EffectDescriptor unnamed() {
  return {
      .effect = Effect::unnamed,
      .name = "unnamed",
      .selectors = {Selector::place, Selector::grid},
      .table = TableKind::grid,
      .rule = [](const EffectId& id, const Nominal&) { return grid_error(id); },
      .keys = [](const EffectId& id, const Nominal&) -> Keys {
        const bool length = place_unit(id.place).name == "mm";
        return {key(length ? "values_mm" : "values_rad", table_term(term(id, id.place, Basis::grid)),
                    length ? unit::mm : unit::si)};
      },
      .place = [](const EffectId& id) { return id.place; },
      .follows =
          [](const EffectId& id) {
            return Follows{id.covariate[0], {id.covariate_joint[0]}};
          },
      .sentence =
          [](const EffectId& id) {
            return fmt::format("{} moves as a function of {} and {} that no effect of the catalogue is",
                               place_name(id.place), covariate_name(id.covariate[0], id.covariate_joint[0]),
                               covariate_name(id.covariate[1], id.covariate_joint[1]));
          },
      .physics =
          "Whatever is there and has no name: a function of two covariates at one place, bilinear on "
          "a grid (M7). Nodes of joint readings are in degrees. `predict` and `validate` use it, "
          "`push` only with `--allow-unnamed`.",
      .record = "more rows where it is concentrated",
      .confounded_with = "not compared with names: it stands where none of them explains the rows",
      .example = {.effect = Effect::unnamed,
                  .place = {3, slot::theta},
                  .covariate = {Covariate::joint_position, Covariate::payload},
                  .covariate_joint = {2, 0},
                  .node = {std::vector<double>{radians(-90), radians(90)}, std::vector<double>{0, 2}}},
  };
}

}  // namespace

const std::vector<EffectDescriptor>& all_effects() {
  static const std::vector<EffectDescriptor> list{
      joint_compliance(), nonlinear_compliance(), link_bending(),
      base_compliance(),  payload_error(),        link_gravity(),
      gear_harmonic(),    encoder_scale(),        joint_coupling(),
      axis_wobble(),      joint_curve(),          backlash(),
      readout_lag(),      thermal_growth(),       base_drift(),
      reflector_slip(),   reflector_drift(),      unnamed()};
  return list;
}

const EffectDescriptor& descriptor(Effect effect) {
  static const EffectDescriptor none;
  static const std::array<const EffectDescriptor*, 256> by_number = [] {
    std::array<const EffectDescriptor*, 256> table;
    table.fill(&none);
    for (const EffectDescriptor& d : all_effects()) table[static_cast<std::uint8_t>(d.effect)] = &d;
    return table;
  }();
  return *by_number[static_cast<std::uint8_t>(effect)];
}

bool follows_own_joint(const EffectId& id) {
  const EffectDescriptor& d = descriptor(id.effect);
  if (id.joint == 0 || d.place(id) != theta(id)) return false;
  const Follows f = d.follows(id);
  return f.covariate == Covariate::joint_position && f.joint == std::array<unsigned, 2>{id.joint, 0};
}

}  // namespace flexcomp::host
