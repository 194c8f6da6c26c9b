// SPDX-License-Identifier: Apache-2.0
#include "true_robot.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace plant {
namespace {

using KDL::Frame;
using KDL::Rotation;
using KDL::Vector;

/// F0 and the frame after each link.
using Frames = std::array<Frame, joints + 1>;

Frame through(const Link& link, double q) {
  return Frame(Rotation::RotZ(link.theta + q)) * Frame(Vector(link.a, 0, link.d)) *
         Frame(Rotation::RotY(link.gamma)) * Frame(Rotation::RotX(link.alpha)) *
         Frame(Rotation::RotY(link.beta));
}

Frames chain(const std::array<Link, joints>& links, const JointVector& q) {
  Frames frames;
  for (std::size_t i = 0; i < joints; ++i) frames[i + 1] = frames[i] * through(links[i], q[i]);
  return frames;
}

/// The weight of the payload and the external force, each with its point, in F0.
struct Loads {
  Vector weight, weight_at;
  Vector force, force_at;

  Vector moment_about(const Vector& point) const {
    return (weight_at - point) * weight +
           (force_at - point) * force;  // KDL: * of vectors is the cross product
  }
};

/// Joint i (from 0) turns about z of the frame before link i.
double torque(const Frames& frames, const Loads& loads, std::size_t i) {
  return KDL::dot(frames[i].M.UnitZ(), loads.moment_about(frames[i].p));
}

/// Link-weight lever, Eq. (M13): sine of the angle between the link and the vertical.
double weight_lever(const Frames& frames, const Vector& gravity, std::size_t joint, std::size_t far) {
  const Vector z = frames[joint].M.UnitZ();
  const Vector arm = frames[far].p - frames[joint].p;
  const double across = (arm - KDL::dot(arm, z) * z).Norm();
  if (across < 1e-3 || gravity.Norm() == 0) return 0;
  return KDL::dot(z, arm * gravity) / (across * gravity.Norm());
}

/// The cardinal cubic B-spline, centred at 0.
double b_spline(double t) {
  const double x = std::abs(t);
  if (x >= 2) return 0;
  if (x >= 1) return std::pow(2 - x, 3) / 6;
  return 2.0 / 3 - x * x + x * x * x / 2;
}

double curve(const std::vector<double>& coefficients, double q) {
  const auto period = static_cast<double>(coefficients.size());
  const double t = period * q / (2 * std::numbers::pi);
  double sum = 0;
  for (std::size_t k = 0; k < coefficients.size(); ++k) {
    // The nearest of the periodic images; with six coefficients or more no other one reaches here.
    sum += coefficients[k] * b_spline(std::remainder(t - static_cast<double>(k), period));
  }
  return sum;
}

std::size_t index_of(const Effect& effect, const std::string& key, std::size_t otherwise = 0) {
  const auto n = static_cast<long>(std::lround(effect.of(key, static_cast<double>(otherwise))));
  if (n < 1 || n > static_cast<long>(joints)) {
    throw std::runtime_error(effect.name + ": " + key + " is 1 to 6, not " + std::to_string(n));
  }
  return static_cast<std::size_t>(n - 1);
}

/// Inputs and outputs of the effects at one pose.
struct Arm {
  const Nominal& nominal;
  const JointVector& q;
  const Context& context;
  Frames frames;  ///< with the constant errors only, for loads and levers, Eq. (M15)
  Loads loads;

  std::array<Link, joints> link;
  SmallMove base, tool;
  Vector slip;

  void apply(const Effect& effect);
  void apply_to_joint(const Effect& effect);
  void apply_to_lengths(const Effect& effect);
  void apply_to_base(const Effect& effect);
};

void Arm::apply_to_joint(const Effect& e) {
  const std::size_t j = index_of(e, "joint");
  double& theta = link[j].theta;
  if (e.name == "joint_compliance") {
    theta += e.of("rad_per_nm") * torque(frames, loads, j);
  } else if (e.name == "nonlinear_compliance") {
    theta += e.of("rad_per_nm3") * std::pow(torque(frames, loads, j), 3);
  } else if (e.name == "gear_harmonic") {
    const double angle = e.of("order") * q[j];
    theta += e.of("sin") * std::sin(angle) + e.of("cos") * std::cos(angle);
  } else if (e.name == "joint_curve") {
    theta += curve(e.curve_rad, q[j]);
  } else if (e.name == "backlash") {
    theta -= e.of("half_gap") * context.direction[j];
  } else if (e.name == "readout_lag") {
    double largest = 0;
    for (const double move : context.move_rad) largest = std::max(largest, std::abs(move));
    if (largest > 0) theta += e.of("lag") * context.move_rad[j] / largest;
  } else if (e.name == "encoder_scale") {
    theta += e.of("gain") * q[j];
  } else if (e.name == "joint_coupling") {
    theta += e.of("gain") * q[index_of(e, "from")];
  } else if (e.name == "axis_wobble") {
    const double angle = e.of("order") * q[j];
    link[j].alpha += e.of("alpha_sin") * std::sin(angle) + e.of("alpha_cos") * std::cos(angle);
    link[j].gamma += e.of("gamma_sin") * std::sin(angle) + e.of("gamma_cos") * std::cos(angle);
  } else {
    throw std::runtime_error("the plant does not know the effect " + e.name);
  }
}

void Arm::apply_to_lengths(const Effect& e) {
  const double growth = e.of("per_k") * (context.temperature_c - nominal.reference_temperature_c);
  for (std::size_t i = 0; i < joints; ++i) {
    if (e.value.contains("link") && index_of(e, "link") != i) continue;
    link[i].a += growth * nominal.link[i].a;
    link[i].d += growth * nominal.link[i].d;
  }
}

void Arm::apply_to_base(const Effect& e) {
  if (e.name == "base_compliance") {
    const Vector moment = loads.moment_about(Vector(0, 0, e.of("pivot_z")));
    base.rx += e.of("rx_per_nm") * moment.x();
    base.ry += e.of("ry_per_nm") * moment.y();
    return;
  }
  base.x += e.of("x_per_s") * context.time_s;
  base.y += e.of("y_per_s") * context.time_s;
  base.z += e.of("z_per_s") * context.time_s;
  base.rx += e.of("rx_per_s") * context.time_s;
  base.ry += e.of("ry_per_s") * context.time_s;
  base.rz += e.of("rz_per_s") * context.time_s;
}

void Arm::apply(const Effect& e) {
  if (e.name == "link_gravity") {
    const double upper = weight_lever(frames, nominal.gravity, 1, 2);
    const double fore = weight_lever(frames, nominal.gravity, 2, 4);
    link[1].theta += e.of("k1") * upper + e.of("k2") * fore;
    link[2].theta += e.of("k3") * fore;
  } else if (e.name == "link_bending") {
    const std::size_t i = index_of(e, "link");
    const Vector moment = loads.moment_about(frames[i + 1].p);
    link[i].alpha += e.of("alpha_per_nm") * KDL::dot(frames[i + 1].M.UnitX(), moment);
    link[i].beta += e.of("beta_per_nm") * KDL::dot(frames[i + 1].M.UnitY(), moment);
  } else if (e.name == "thermal_growth") {
    apply_to_lengths(e);
  } else if (e.name == "base_drift" || e.name == "base_compliance") {
    apply_to_base(e);
  } else if (e.name == "reflector_slip") {
    if (context.time_s >= e.of("after")) slip += Vector(e.of("x"), e.of("y"), e.of("z"));
  } else if (e.name != "payload_error") {  // is part of the load
    apply_to_joint(e);
  }
}

}  // namespace

Frame SmallMove::frame() const {
  return Frame(Vector(x, y, z)) * Frame(Rotation::RotZ(rz)) * Frame(Rotation::RotY(ry)) *
         Frame(Rotation::RotX(rx));
}

double Effect::of(const std::string& key, double otherwise) const {
  const auto found = value.find(key);
  return found == value.end() ? otherwise : found->second;
}

Context usual_context(const Nominal& nominal) {
  Context context;
  context.payload_kg = nominal.payload_kg;
  context.payload_com_m = nominal.payload_com_m;
  context.temperature_c = nominal.reference_temperature_c;
  return context;
}

Reached reached(const Nominal& nominal, const Truth& truth, const JointVector& q, const Context& context) {
  Arm arm{.nominal = nominal,
          .q = q,
          .context = context,
          .frames = {},
          .loads = {},
          .link = nominal.link,
          .base = truth.base,
          .tool = truth.tool,
          .slip = {}};
  for (std::size_t i = 0; i < joints; ++i) {
    arm.link[i].theta += truth.error[i].theta;
    arm.link[i].d += truth.error[i].d;
    arm.link[i].a += truth.error[i].a;
    arm.link[i].alpha += truth.error[i].alpha;
    arm.link[i].beta += truth.error[i].beta;
  }
  // Two passes, Eq. (M15): loads and levers by the constant errors, then all effects.
  arm.frames = chain(arm.link, q);
  double mass = context.payload_kg;
  Vector com = context.payload_com_m;
  for (const Effect& e : truth.effects) {
    if (e.name != "payload_error") continue;
    mass += e.of("mass");
    com += Vector(e.of("com_x"), e.of("com_y"), e.of("com_z"));
  }
  const Frame& flange = arm.frames[joints];
  arm.loads.weight = mass * nominal.gravity;
  arm.loads.weight_at = flange * com;
  arm.loads.force = context.force_n;
  arm.loads.force_at = (flange * nominal.tool * truth.tool.frame()).p;
  for (const Effect& e : truth.effects) arm.apply(e);

  return {arm.base.frame() * chain(arm.link, q)[joints] * nominal.tool * arm.tool.frame(), arm.slip};
}

Frame drawn(const Nominal& nominal, const JointVector& q) {
  return chain(nominal.link, q)[joints] * nominal.tool;
}

double angle_of(const Rotation& r) {
  const Vector twice_sine(r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1));
  return std::atan2(twice_sine.Norm(), r(0, 0) + r(1, 1) + r(2, 2) - 1);
}

}  // namespace plant
