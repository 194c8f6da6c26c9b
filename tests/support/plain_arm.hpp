// SPDX-License-Identifier: Apache-2.0
/// \file
/// The flexible arm of docs/model.md and docs/effects.md as 4x4 matrices, one after the other: slow, obvious, and without a
/// line of the core. SI units: m, rad, kg, N, N·m, K, s. Joints and links are counted from 1, as in the files.
#pragma once

#include <Eigen/Dense>

#include <array>
#include <cmath>
#include <functional>
#include <vector>

namespace plain {

using Matrix = Eigen::Matrix4d;
using Vector = Eigen::Vector3d;
using Joints = std::array<double, 6>;

constexpr double pi = 3.14159265358979323846;

inline Matrix trans(double x, double y, double z) {
  Matrix m = Matrix::Identity();
  m(0, 3) = x;
  m(1, 3) = y;
  m(2, 3) = z;
  return m;
}

/// Turns axis `from` (0 … 2) towards axis `to`.
inline Matrix turned(int from, int to, double a) {
  Matrix m = Matrix::Identity();
  m(from, from) = m(to, to) = std::cos(a);
  m(from, to) = -std::sin(a);
  m(to, from) = std::sin(a);
  return m;
}
inline Matrix rot_x(double a) { return turned(1, 2, a); }
inline Matrix rot_y(double a) { return turned(2, 0, a); }
inline Matrix rot_z(double a) { return turned(0, 1, a); }

struct Link {
  double theta = 0, d = 0, a = 0, alpha = 0, beta = 0;
};

/// x y z in m, rx ry rz in rad: Trans · Rot(z) · Rot(y) · Rot(x).
struct Small {
  double x = 0, y = 0, z = 0, rx = 0, ry = 0, rz = 0;
  Matrix matrix() const { return trans(x, y, z) * rot_z(rz) * rot_y(ry) * rot_x(rx); }
};

/// The arm as drawn.
struct Nominal {
  std::array<Link, 6> links{};
  Vector gravity{0, 0, -9.8};
  Vector tool_xyz{0, 0, 0};
  std::array<double, 4> tool_wxyz{{1, 0, 0, 0}};
  double reference_temperature_c = 20;
};

/// One row of a data file.
struct Situation {
  double payload_kg = 0;
  Vector payload_com{0, 0, 0};
  Vector force_n{0, 0, 0};
  double temperature_c = 20;
  double time_s = 0;
  std::array<double, 6> direction{};
  std::array<double, 6> relative_speed{};
};

// The effects by the names and keys of docs/effects.md, angles in rad.
struct JointCompliance {
  int joint;
  double rad_per_nm;
};
struct LinkGravity {
  double k1 = 0, k2 = 0, k3 = 0;
};
struct NonlinearCompliance {
  int joint;
  double rad_per_nm3;
};
struct GearHarmonic {
  int joint;
  double order, sin_rad, cos_rad;
};
struct JointCurve {
  int joint;
  std::vector<double> coefficients;
};
struct Backlash {
  int joint;
  double half_gap_rad;
};
struct ReadoutLag {
  int joint;
  double rad;
};
struct EncoderScale {
  int joint;
  double gain;
};
struct JointCoupling {
  int joint, from;
  double gain;
};
struct AxisWobble {
  int joint;
  double order, alpha_sin, alpha_cos, gamma_sin, gamma_cos;
};
struct LinkBending {
  int link;
  double alpha_rad_per_nm, beta_rad_per_nm;
};
struct ThermalGrowth {
  int link;  ///< 0: all links
  double per_k;
};
struct BaseDrift {
  Small per_s;
};
struct BaseCompliance {
  double pivot_z, rx_rad_per_nm, ry_rad_per_nm;
};
struct PayloadError {
  double mass_kg = 0;
  Vector com{0, 0, 0};
};
struct ReflectorSlip {
  double after_s;
  Vector shift;
};
/// An effect without a name: the theta of a joint by a table of two readings.
struct Grid {
  int joint, row_joint;
  std::vector<double> rows, columns;  ///< nodes: reading of row_joint, payload
  std::vector<double> values;         ///< row by row
};

/// Values of the slots of one link that effects add; gamma comes between Trans(x, a) and Rot(x, alpha).
struct Moved {
  double theta = 0, d = 0, a = 0, alpha = 0, beta = 0, gamma = 0;
};

/// An effect that no catalogue has: moves links by anything that a row holds.
using Hook = std::function<void(const Joints&, const Situation&, std::array<Moved, 6>&)>;

/// A true arm.
struct Truth {
  std::array<Link, 6> geometric{};
  Small base, tool;
  std::vector<JointCompliance> joint_compliance;
  std::vector<LinkGravity> link_gravity;
  std::vector<NonlinearCompliance> nonlinear_compliance;
  std::vector<GearHarmonic> gear_harmonic;
  std::vector<JointCurve> joint_curve;
  std::vector<Backlash> backlash;
  std::vector<ReadoutLag> readout_lag;
  std::vector<EncoderScale> encoder_scale;
  std::vector<JointCoupling> joint_coupling;
  std::vector<AxisWobble> axis_wobble;
  std::vector<LinkBending> link_bending;
  std::vector<ThermalGrowth> thermal_growth;
  std::vector<BaseDrift> base_drift;
  std::vector<BaseCompliance> base_compliance;
  std::vector<PayloadError> payload_error;
  std::vector<ReflectorSlip> reflector_slip;
  std::vector<Grid> grid;
  std::vector<Hook> hook;
};

/// The cardinal cubic B-spline centred at 0 (de Boor).
inline double cardinal_spline(double x) {
  x = std::abs(x);
  if (x < 1) return (4 - 6 * x * x + 3 * x * x * x) / 6;
  return x < 2 ? std::pow(2 - x, 3) / 6 : 0;
}

/// δ(q) = Σ c_k B(M q / 2π − k), B the cardinal spline, q folded to a turn: summed over the images of each knot on three
/// turns.
inline double curve(const std::vector<double>& c, double q) {
  const double m = static_cast<double>(c.size());
  const double folded = q - 2 * pi * std::floor(q / (2 * pi));
  double sum = 0;
  for (std::size_t k = 0; k < c.size(); ++k) {
    for (int turn = -1; turn <= 1; ++turn)
      sum += c[k] * cardinal_spline(m * folded / (2 * pi) - static_cast<double>(k) + m * turn);
  }
  return sum;
}

/// Bilinear between nodes, constant outside.
inline double bilinear(const Grid& g, double row, double column) {
  const auto place = [](const std::vector<double>& nodes, double x, std::size_t& k) {
    x = std::min(std::max(x, nodes.front()), nodes.back());
    k = 0;
    while (k + 2 < nodes.size() && x > nodes[k + 1]) ++k;
    return (x - nodes[k]) / (nodes[k + 1] - nodes[k]);
  };
  std::size_t i = 0;
  std::size_t j = 0;
  const double u = place(g.rows, row, i);
  const double v = place(g.columns, column, j);
  const auto at = [&](std::size_t r, std::size_t c) { return g.values[r * g.columns.size() + c]; };
  return (1 - u) * ((1 - v) * at(i, j) + v * at(i, j + 1)) +
         u * ((1 - v) * at(i + 1, j) + v * at(i + 1, j + 1));
}

/// F0 and the frames after each link.
inline std::array<Matrix, 7> chain(const Nominal& n, const Truth& t, const Joints& q,
                                   const std::array<Moved, 6>& e) {
  std::array<Matrix, 7> f;
  f[0] = Matrix::Identity();
  for (std::size_t i = 0; i < 6; ++i) {
    const Link& l = n.links[i];
    const Link& g = t.geometric[i];
    f[i + 1] = f[i] * rot_z(q[i] + l.theta + g.theta + e[i].theta) * trans(0, 0, l.d + g.d + e[i].d) *
               trans(l.a + g.a + e[i].a, 0, 0) * rot_y(e[i].gamma) * rot_x(l.alpha + g.alpha + e[i].alpha) *
               rot_y(l.beta + g.beta + e[i].beta);
  }
  return f;
}

inline Vector origin(const Matrix& m) { return m.block<3, 1>(0, 3); }
inline Vector axis(const Matrix& m, int k) { return m.block<3, 1>(0, k); }

inline Matrix nominal_tool(const Nominal& n) {
  Matrix m = trans(n.tool_xyz.x(), n.tool_xyz.y(), n.tool_xyz.z());
  m.block<3, 3>(0, 0) =
      Eigen::Quaterniond(n.tool_wxyz[0], n.tool_wxyz[1], n.tool_wxyz[2], n.tool_wxyz[3]).toRotationMatrix();
  return m;
}

/// Link-weight lever of joint i (from 1) with the origin of joint `far` (from 1).
inline double lever(const std::array<Matrix, 7>& f, const Vector& gravity, int i, int far) {
  const Matrix& own = f[static_cast<std::size_t>(i - 1)];
  const Vector z = axis(own, 2);
  const Vector arm = origin(f[static_cast<std::size_t>(far - 1)]) - origin(own);
  const Vector across = arm - z * z.dot(arm);
  if (across.norm() < 1e-3) return 0;
  return z.dot(arm.cross(gravity.normalized())) / across.norm();
}

struct Result {
  Matrix pose;                   ///< Ftool in Fb
  Vector measured_point;         ///< shift of the measured point in Ftool
  std::array<double, 6> torque;  ///< of the load about each joint's axis, N·m
};

/// The pose that the true arm takes at joint readings q.
inline Result forward(const Nominal& n, const Truth& t, const Joints& q, const Situation& s) {
  // 1. The load with its error, before any torque is taken.
  double mass = s.payload_kg;
  Vector com = s.payload_com;
  for (const PayloadError& p : t.payload_error) {
    mass += p.mass_kg;
    com += p.com;
  }
  // 2. Torques, levers and moments once, in the chain with constant geometric and tool terms only.
  const std::array<Moved, 6> still{};
  const std::array<Matrix, 7> f = chain(n, t, q, still);
  const Matrix tool_before = nominal_tool(n) * t.tool.matrix();
  const Vector at_com = (f[6] * com.homogeneous()).head<3>();
  const Vector at_tool = origin(f[6] * tool_before);
  const auto moment = [&](const Vector& about) {
    return Vector((at_com - about).cross(mass * n.gravity) + (at_tool - about).cross(s.force_n));
  };
  Result r;
  for (std::size_t i = 0; i < 6; ++i) r.torque[i] = axis(f[i], 2).dot(moment(origin(f[i])));
  const auto torque = [&](int joint) { return r.torque[static_cast<std::size_t>(joint - 1)]; };
  const auto reading = [&](int joint) { return q[static_cast<std::size_t>(joint - 1)]; };

  // 3. All effects on their slots.
  std::array<Moved, 6> e{};
  const auto on = [&](int link) -> Moved& { return e[static_cast<std::size_t>(link - 1)]; };
  Small base = t.base;
  for (const auto& x : t.joint_compliance) on(x.joint).theta += x.rad_per_nm * torque(x.joint);
  for (const auto& x : t.link_gravity) {
    const double s2 = lever(f, n.gravity, 2, 3);
    const double s23 = lever(f, n.gravity, 3, 5);
    on(2).theta += x.k1 * s2 + x.k2 * s23;
    on(3).theta += x.k3 * s23;
  }
  for (const auto& x : t.nonlinear_compliance)
    on(x.joint).theta += x.rad_per_nm3 * std::pow(torque(x.joint), 3);
  for (const auto& x : t.gear_harmonic) {
    on(x.joint).theta +=
        x.sin_rad * std::sin(x.order * reading(x.joint)) + x.cos_rad * std::cos(x.order * reading(x.joint));
  }
  for (const auto& x : t.joint_curve) on(x.joint).theta += curve(x.coefficients, reading(x.joint));
  for (const auto& x : t.backlash)
    on(x.joint).theta -= x.half_gap_rad * s.direction[static_cast<std::size_t>(x.joint - 1)];
  for (const auto& x : t.readout_lag)
    on(x.joint).theta += x.rad * s.relative_speed[static_cast<std::size_t>(x.joint - 1)];
  for (const auto& x : t.encoder_scale) on(x.joint).theta += x.gain * reading(x.joint);
  for (const auto& x : t.joint_coupling) on(x.joint).theta += x.gain * reading(x.from);
  for (const auto& x : t.axis_wobble) {
    const double sine = std::sin(x.order * reading(x.joint));
    const double cosine = std::cos(x.order * reading(x.joint));
    on(x.joint).alpha += x.alpha_sin * sine + x.alpha_cos * cosine;
    on(x.joint).gamma += x.gamma_sin * sine + x.gamma_cos * cosine;
  }
  for (const auto& x : t.link_bending) {
    const Matrix& end = f[static_cast<std::size_t>(x.link)];
    on(x.link).alpha += x.alpha_rad_per_nm * axis(end, 0).dot(moment(origin(end)));
    on(x.link).beta += x.beta_rad_per_nm * axis(end, 1).dot(moment(origin(end)));
  }
  for (const auto& x : t.thermal_growth) {
    for (int link = 1; link <= 6; ++link) {
      if (x.link != 0 && x.link != link) continue;
      const Link& l = n.links[static_cast<std::size_t>(link - 1)];
      on(link).a += x.per_k * (s.temperature_c - n.reference_temperature_c) * l.a;
      on(link).d += x.per_k * (s.temperature_c - n.reference_temperature_c) * l.d;
    }
  }
  for (const auto& x : t.base_drift) {
    base.x += x.per_s.x * s.time_s;
    base.y += x.per_s.y * s.time_s;
    base.z += x.per_s.z * s.time_s;
    base.rx += x.per_s.rx * s.time_s;
    base.ry += x.per_s.ry * s.time_s;
    base.rz += x.per_s.rz * s.time_s;
  }
  for (const auto& x : t.base_compliance) {
    const Vector m = moment(Vector(0, 0, x.pivot_z));
    base.rx += x.rx_rad_per_nm * m.x();
    base.ry += x.ry_rad_per_nm * m.y();
  }
  for (const auto& x : t.grid) on(x.joint).theta += bilinear(x, reading(x.row_joint), s.payload_kg);
  for (const Hook& hook : t.hook) hook(q, s, e);
  r.measured_point = Vector::Zero();
  for (const auto& x : t.reflector_slip)
    if (s.time_s >= x.after_s) r.measured_point += x.shift;

  // 4. The chain again.
  r.pose = base.matrix() * chain(n, t, q, e)[6] * tool_before;
  return r;
}

}  // namespace plain
