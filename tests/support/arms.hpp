// SPDX-License-Identifier: Apache-2.0
/// \file
/// What the tests calibrate: three arms, the paper's Table 1, random poses. SI units: m, rad, kg, N, K, s.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Eigenvalues>

#include <flexcomp/forward.hpp>
#include <flexcomp/identification.hpp>
#include <flexcomp/robot.hpp>
#include <flexcomp/term.hpp>

#include "support/plain_arm.hpp"

namespace arms {

constexpr double deg = 3.14159265358979323846 / 180;  // rad
constexpr double mm = 1e-3;                           // m

/// Numbers of poses are divided by this: a sanitizer looks at every access, not at every pose.
#if defined(__SANITIZE_ADDRESS__)
constexpr int part = 20;
#else
constexpr int part = 1;
#endif

using Robot = flexcomp::NominalRobot<6>;
using Joints = std::array<double, 6>;

/// One link as the drawings give it.
inline flexcomp::NominalLink link(double theta_deg, double d_mm, double a_mm, double alpha_deg) {
  flexcomp::NominalLink l;
  l.theta_rad = theta_deg * deg;
  l.d_m = d_mm * mm;
  l.a_m = a_mm * mm;
  l.alpha_rad = alpha_deg * deg;
  return l;
}

inline flexcomp::JointLimits limits(double min_deg, double max_deg) { return {min_deg * deg, max_deg * deg}; }

/// Staubli TX60L (Chen et al. 2019, Table 1): spherical wrist.
inline Robot tx60l() {
  Robot r;
  r.links = {link(0, 0, 0, -90),   link(-90, 0, 400, 0), link(90, 20, 0, 90),
             link(0, 450, 0, -90), link(0, 0, 0, 90),    link(0, 70, 0, 0)};
  r.limits = {limits(-180, 180), limits(-127.5, 127.5), limits(-142.5, 142.5),
              limits(-270, 270), limits(-122.5, 133.5), limits(-270, 270)};
  r.tool_xyz_m = {10 * mm, 30 * mm, 60 * mm};
  r.payload_kg = 1.108;
  r.payload_com_m = {5 * mm, 8 * mm, 60 * mm};
  return r;
}

/// Staubli RX160L: axis 2 does not meet axis 1.
inline Robot rx160l() {
  Robot r;
  r.links = {link(0, 0, 150, -90), link(-90, 0, 825, 0), link(90, 0, 0, 90),
             link(0, 925, 0, -90), link(0, 0, 0, 90),    link(0, 110, 0, 0)};
  r.limits = {limits(-160, 160), limits(-137.5, 137.5), limits(-150, 150),
              limits(-270, 270), limits(-105, 120),     limits(-270, 270)};
  r.tool_xyz_m = {10 * mm, 30 * mm, 60 * mm};
  r.payload_kg = 6.23;
  r.payload_com_m = {5 * mm, 8 * mm, 60 * mm};
  return r;
}

/// Universal Robots UR10: three parallel axes, no spherical wrist. The tool and load of the TX60L, with a
/// turned tool so that no test can mistake its frame for the flange's.
inline Robot ur10() {
  Robot r;
  r.links = {link(0, 127.3, 0, 90),   link(0, 0, -612, 0),    link(0, 0, -572.3, 0),
             link(0, 163.941, 0, 90), link(0, 115.7, 0, -90), link(0, 92.2, 0, 0)};
  for (flexcomp::JointLimits& l : r.limits) l = limits(-360, 360);
  r.gravity_m_s2 = {0, 0, -9.81};
  r.tool_xyz_m = {10 * mm, 30 * mm, 60 * mm};
  r.tool_wxyz = {0.8, 0.36, -0.48, 0.0};
  r.payload_kg = 1.108;
  r.payload_com_m = {5 * mm, 8 * mm, 60 * mm};
  return r;
}

/// Universal Robots UR5: as the UR10, with a plain flange. Lengths: host/robots/ur5.yaml.
inline Robot ur5() {
  Robot r;
  r.links = {link(0, 89.159, 0, 90), link(0, 0, -425, 0),    link(0, 0, -392.25, 0),
             link(0, 109.15, 0, 90), link(0, 94.65, 0, -90), link(0, 82.3, 0, 0)};
  for (flexcomp::JointLimits& l : r.limits) l = limits(-360, 360);
  r.gravity_m_s2 = {0, 0, -9.81};
  r.tool_xyz_m = {10 * mm, 30 * mm, 60 * mm};
  r.payload_kg = 1.108;
  r.payload_com_m = {5 * mm, 8 * mm, 60 * mm};
  return r;
}

/// ABB IRB 120: spherical wrist, offset elbow. host/robots/abb-irb120.yaml.
inline Robot irb120() {
  Robot r;
  r.links = {link(0, 290, 0, -90), link(-90, 0, 270, 0), link(0, 0, 70, -90),
             link(0, 302, 0, 90),  link(0, 0, 0, -90),   link(180, 72, 0, 0)};
  r.limits = {limits(-165, 165), limits(-110, 110), limits(-110, 70),
              limits(-160, 160), limits(-120, 120), limits(-400, 400)};
  r.gravity_m_s2 = {0, 0, -9.81};
  r.tool_xyz_m = {10 * mm, 30 * mm, 60 * mm};
  r.payload_kg = 1.108;
  r.payload_com_m = {5 * mm, 8 * mm, 60 * mm};
  return r;
}

/// KUKA KR 6 R900: offset shoulder and elbow; its first axis points down. host/robots/kuka-kr6-r900.yaml.
inline Robot kr6() {
  Robot r;
  r.links = {link(0, -400, 25, 90), link(0, 0, 455, 0), link(-90, 0, 35, 90),
             link(0, -420, 0, -90), link(0, 0, 0, 90),  link(180, -80, 0, 180)};
  r.limits = {limits(-170, 170), limits(-190, 45),  limits(-120, 156),
              limits(-185, 185), limits(-120, 120), limits(-350, 350)};
  r.gravity_m_s2 = {0, 0, 9.81};
  r.tool_xyz_m = {10 * mm, 30 * mm, 60 * mm};
  r.payload_kg = 3;
  r.payload_com_m = {5 * mm, 8 * mm, 60 * mm};
  return r;
}

struct Arm {
  const char* name;
  Robot robot;
  bool parallel_3;  ///< axis 3 is parallel to axis 4: link 3 takes beta, not d
};

inline const std::array<Arm, 3>& all() {
  static const std::array<Arm, 3> list{
      {{"TX60L", tx60l(), false}, {"RX160L", rx160l(), false}, {"UR10", ur10(), true}}};
  return list;
}

/// all(), and three whose geometry is that of host/robots.
inline const std::array<Arm, 6>& six() {
  static const std::array<Arm, 6> list{{all()[0],
                                        all()[1],
                                        all()[2],
                                        {"UR5", ur5(), true},
                                        {"IRB120", irb120(), false},
                                        {"KR6", kr6(), false}}};
  return list;
}

/// Numbers that are the same with every standard library.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  std::uint64_t bits() { return engine_(); }
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11U) * 0x1p-53);
  }
  double around(double size) { return uniform(-size, size); }
  std::size_t below(std::size_t n) { return static_cast<std::size_t>(engine_() % n); }
  std::vector<double> around(double size, std::size_t count) {
    std::vector<double> v(count);
    for (double& x : v) x = around(size);
    return v;
  }

  /// Each within +-size.
  Joints joints(double size) {
    Joints q{};
    for (double& v : q) v = around(size);
    return q;
  }
  Joints pose(const Robot& robot) {
    Joints q{};
    for (std::size_t i = 0; i < 6; ++i) q[i] = uniform(robot.limits[i].min_rad, robot.limits[i].max_rad);
    return q;
  }

 private:
  std::mt19937_64 engine_;
};

/// A term list that owns what it lists.
template <class S>
struct TermSet {
  std::vector<flexcomp::Term<S>> terms;
  std::vector<flexcomp::Table> tables;
  std::vector<S> values;

  flexcomp::TermList<S> list() const {
    return {terms.data(), terms.size(), tables.data(), tables.size(), values.data(), values.size()};
  }

  flexcomp::Term<S>& add(flexcomp::Place place, flexcomp::Basis basis, S coefficient, std::size_t joint = 0,
                         S argument = S(0)) {
    flexcomp::Term<S> t;
    t.place = place;
    t.basis = basis;
    t.joint = static_cast<std::uint8_t>(joint);
    t.argument = argument;
    t.coefficient = coefficient;
    terms.push_back(t);
    return terms.back();
  }

  /// A link-weight lever (M13) from joint to distal joint, both from 0.
  flexcomp::Term<S>& add_lever(flexcomp::Place place, S coefficient, std::size_t joint, std::size_t distal) {
    flexcomp::Term<S>& t = add(place, flexcomp::Basis::link_weight, coefficient, joint);
    t.distal_joint = static_cast<std::uint8_t>(distal);
    return t;
  }

  /// Curve over a turn; returns the index of its table.
  std::uint16_t add_curve(const std::vector<double>& coefficients) {
    flexcomp::Table t;
    t.offset = static_cast<std::uint16_t>(values.size());
    t.size = static_cast<std::uint16_t>(coefficients.size());
    for (const double c : coefficients) values.push_back(S(c));
    tables.push_back(t);
    return static_cast<std::uint16_t>(tables.size() - 1);
  }

  /// Grid of `value` (rows x columns) over ascending nodes; covariates are set by the caller in tables.back().
  std::uint16_t add_grid(const std::vector<double>& rows, const std::vector<double>& columns,
                         const std::vector<double>& value) {
    flexcomp::Table t;
    t.offset = static_cast<std::uint16_t>(values.size());
    t.rows = static_cast<std::uint16_t>(rows.size());
    t.columns = static_cast<std::uint16_t>(columns.size());
    t.size = static_cast<std::uint16_t>(rows.size() + columns.size() + value.size());
    for (const auto* part : {&rows, &columns, &value})
      for (const double v : *part) values.push_back(S(v));
    tables.push_back(t);
    return static_cast<std::uint16_t>(tables.size() - 1);
  }
};

/// The same commands for another scalar.
template <class To, class From>
inline std::array<To, 6> as(const std::array<From, 6>& from) {
  std::array<To, 6> q;
  for (std::size_t i = 0; i < 6; ++i) q[i] = static_cast<To>(from[i]);
  return q;
}

/// The same context for another scalar.
template <class To>
inline flexcomp::Context<To> as(const flexcomp::Context<double>& from) {
  flexcomp::Context<To> c;
  c.payload_kg = static_cast<To>(from.payload_kg);
  c.temperature_c = static_cast<To>(from.temperature_c);
  c.time_s = static_cast<To>(from.time_s);
  for (std::size_t k = 0; k < 3; ++k) {
    c.payload_com_m[k] = static_cast<To>(from.payload_com_m[k]);
    c.force_n[k] = static_cast<To>(from.force_n[k]);
  }
  c.direction = as<To>(from.direction);
  c.relative_speed = as<To>(from.relative_speed);
  return c;
}

/// The same list for another scalar.
template <class To>
inline TermSet<To> as(const TermSet<double>& from) {
  TermSet<To> r;
  for (const flexcomp::Term<double>& t : from.terms) {
    flexcomp::Term<To> u;
    u.place = t.place;
    u.basis = t.basis;
    u.joint = t.joint;
    u.factor = t.factor;
    u.effect = t.effect;
    u.instance = t.instance;
    u.table = t.table;
    u.distal_joint = t.distal_joint;
    u.argument = To(t.argument);
    u.coefficient = To(t.coefficient);
    r.terms.push_back(u);
  }
  r.tables = from.tables;
  for (const double v : from.values) r.values.push_back(To(v));
  return r;
}

inline flexcomp::Place on_link(std::size_t number, std::uint8_t slot) {
  return {static_cast<std::uint8_t>(number), slot};
}
inline flexcomp::Place on_base(std::uint8_t slot) { return {flexcomp::body::base, slot}; }
inline flexcomp::Place on_tool(std::uint8_t slot) { return {flexcomp::body::tool, slot}; }
inline flexcomp::Place on_load(std::uint8_t slot) { return {flexcomp::body::load, slot}; }
inline flexcomp::Place on_point(std::uint8_t slot) { return {flexcomp::body::point, slot}; }

/// Table 1 of the paper by joint, its stiffness read as N·mm/rad; base as x y z rx ry rz, m and rad.
namespace of_table1 {
constexpr double theta[6] = {-0.08, -0.04, 0.05, 0.03, 0.06, -0.1};   // deg
constexpr double d[6] = {-0.4, 0, 0.2, -0.1, 0.1, -0.3};              // mm
constexpr double a[6] = {0.09, -0.05, -0.1, 0.06, -0.08, 0.03};       // mm
constexpr double alpha[6] = {0.03, 0.02, -0.05, -0.008, 0.01, 0.07};  // deg
constexpr double base[6] = {0.3 * mm, -0.2 * mm, 0.1 * mm, 0.02 * deg, 0.01 * deg, 0.01 * deg};
constexpr double stiffness[6] = {1.47e10, 6.67e7, 3.13e7, 2.22e7, 1.18e6, 7.69e5};  // N·mm/rad
}  // namespace of_table1

/// The rigid half of Table 1 times `scale`. A link whose axis is parallel to the next one takes beta for d.
inline TermSet<double> table1_geometry(const Arm& arm, double scale = 1) {
  using flexcomp::Basis;
  namespace slot = flexcomp::slot;
  TermSet<double> set;
  namespace t1 = of_table1;
  for (std::size_t i = 0; i < 6; ++i) {
    const bool parallel = i == 1 || (i == 2 && arm.parallel_3);
    set.add(on_link(i + 1, slot::theta), Basis::one, scale * t1::theta[i] * deg);
    if (!parallel) set.add(on_link(i + 1, slot::d), Basis::one, scale * t1::d[i] * mm);
    set.add(on_link(i + 1, slot::a), Basis::one, scale * t1::a[i] * mm);
    set.add(on_link(i + 1, slot::alpha), Basis::one, scale * t1::alpha[i] * deg);
    if (parallel) set.add(on_link(i + 1, slot::beta), Basis::one, scale * 0.03 * deg);
  }
  for (std::uint8_t k = 0; k < 6; ++k) set.add(on_base(k), Basis::one, scale * t1::base[k]);
  return set;
}

/// Table 1 of the paper times `scale`: geometry, joint compliance (stiffness read as N·mm/rad), link gravity.
inline TermSet<double> table1(const Arm& arm, double scale = 1) {
  using flexcomp::Basis;
  using flexcomp::Effect;
  namespace slot = flexcomp::slot;
  TermSet<double> set = table1_geometry(arm, scale);
  for (std::size_t i = 0; i < 6; ++i) {
    flexcomp::Term<double>& t =
        set.add(on_link(i + 1, slot::theta), Basis::load_torque, scale * 1e3 / of_table1::stiffness[i], i);
    t.effect = Effect::joint_compliance;
    t.instance = static_cast<std::uint16_t>(i);
  }
  set.add_lever(on_link(2, slot::theta), scale * 0.0015, 1, 2).effect = Effect::link_gravity;
  set.add_lever(on_link(2, slot::theta), scale * 0.00123, 2, 4).effect = Effect::link_gravity;
  set.add_lever(on_link(3, slot::theta), scale * 0.00054, 2, 4).effect = Effect::link_gravity;
  return set;
}

/// Adds a random curve of `size` coefficients on every joint, each reaching exactly +-amplitude_rad.
inline void add_joint_curves(TermSet<double>& set, Random& random, double amplitude_rad,
                             std::size_t size = 18) {
  for (std::size_t i = 0; i < 6; ++i) {
    std::vector<double> c = random.around(1, size);
    double largest = 0;
    for (int k = 0; k < 720; ++k) largest = std::max(largest, std::abs(plain::curve(c, k * 0.5 * deg)));
    for (double& v : c) v *= amplitude_rad / largest;
    const std::uint16_t table = set.add_curve(c);
    flexcomp::Term<double>& t =
        set.add(on_link(i + 1, flexcomp::slot::theta), flexcomp::Basis::curve, 1.0, i);
    t.table = table;
    t.effect = flexcomp::Effect::joint_curve;
    t.instance = static_cast<std::uint16_t>(i);
  }
}

/// A context in which every member matters.
inline flexcomp::Context<double, 6> random_context(const Robot& robot, Random& random) {
  flexcomp::Context<double, 6> c = flexcomp::default_context<double>(robot);
  c.payload_kg = random.uniform(0.5, 8);
  for (double& v : c.payload_com_m) v = random.around(0.15);
  for (double& v : c.force_n) v = random.around(60);
  c.temperature_c = random.uniform(10, 40);
  c.time_s = random.uniform(0, 7200);
  for (double& v : c.direction) v = static_cast<double>(random.below(3)) - 1;
  for (double& v : c.relative_speed) v = random.around(1);
  return c;
}

/// The model of a set that has to be accepted.
template <class S, class Model = flexcomp::Model<S>>
inline Model prepared(const Robot& robot, const TermSet<S>& set) {
  Model model;
  const flexcomp::Refusal refusal = model.prepare(robot, set.list());
  if (refusal != flexcomp::Refusal::none)
    throw std::logic_error("set refused: " + std::to_string(static_cast<int>(refusal)));
  return model;
}

template <class Model>
inline flexcomp::Linearisation<double> linearised(const Model& model, const Joints& q,
                                                  const flexcomp::Context<double>& context) {
  flexcomp::Linearisation<double> at;
  flexcomp::linearise(model, q, context, at);
  return at;
}

template <class Model>
inline flexcomp::Pose<double> forward(const Model& model, const Joints& q,
                                      const flexcomp::Context<double>& context) {
  flexcomp::Workspace<double> ws;
  return flexcomp::forward(model, q, context, ws);
}

/// The nominal Jacobian at the origin of Ftool, in F0: rows m, then rad. (kdl_test judges these screws.)
class NominalJacobian {
 public:
  using Matrix = Eigen::Matrix<double, 6, 6>;

  explicit NominalJacobian(const Robot& robot)
      : model_(prepared(robot, TermSet<double>())), context_(flexcomp::default_context<double>(robot)) {}

  Matrix operator()(const Joints& q) const {
    const flexcomp::Linearisation<double> at = linearised(model_, q, context_);
    Matrix j;
    for (std::size_t i = 0; i < 6; ++i)
      j.col(static_cast<int>(i)) = flexcomp::screw(model_, at, on_link(i + 1, flexcomp::slot::theta));
    return j;
  }

  /// Whether the smallest singular value (m, rad) is at least 0.1.
  bool is_regular(const Joints& q) const {
    const Matrix j = (*this)(q);
    return Eigen::SelfAdjointEigenSolver<Matrix>(j * j.transpose(), Eigen::EigenvaluesOnly)
               .eigenvalues()[0] >= 0.01;
  }

 private:
  flexcomp::Model<double> model_;
  flexcomp::Context<double, 6> context_;
};

/// Angle between two rotations, rad; good for small angles.
template <class A, class B>
inline double angle_between(const A& a, const B& b) {
  const Eigen::Matrix3d r = a.transpose() * b;
  const Eigen::Vector3d w(r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1));
  return std::atan2(0.5 * w.norm(), 0.5 * (r.trace() - 1));
}

}  // namespace arms
