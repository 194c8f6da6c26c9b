// SPDX-License-Identifier: Apache-2.0
/// \file True robot of a closed loop: nominal chain plus hidden errors, unknown to the calibrator. Implemented
/// from docs/model.md and Chen et al. 2019 on KDL's frames; it shares no code with the core, so that each
/// validates the other. SI inside.
#pragma once

#include <array>
#include <kdl/frames.hpp>
#include <map>
#include <string>
#include <vector>

namespace plant {

constexpr std::size_t joints = 6;
using JointVector = std::array<double, joints>;

/// One link: Rot(z, theta) Trans(z, d) Trans(x, a) Rot(y, gamma) Rot(x, alpha) Rot(y, beta).
struct Link {
  double theta = 0, d = 0, a = 0, alpha = 0, beta = 0, gamma = 0;
};

/// Trans(x, y, z) Rot(z, rz) Rot(y, ry) Rot(x, rx)
struct SmallMove {
  double x = 0, y = 0, z = 0, rx = 0, ry = 0, rz = 0;
  KDL::Frame frame() const;
};

struct Nominal {
  std::string name;
  std::array<Link, joints> link;
  JointVector min_rad{}, max_rad{};
  KDL::Vector gravity{0, 0, -9.8};
  KDL::Frame tool;
  std::vector<KDL::Vector> reflector_m;  ///< A, B, C(, D) in Ftool
  double payload_kg = 0;
  KDL::Vector payload_com_m;  ///< in F6
  double reference_temperature_c = 20;
};

/// Effect of the catalogue: values in SI by their keys without the unit.
struct Effect {
  std::string name;
  std::map<std::string, double> value;
  std::vector<double> curve_rad;
  double of(const std::string& key, double otherwise = 0) const;
};

struct Truth {
  std::array<Link, joints> error;  ///< added to the nominal links
  SmallMove base;
  SmallMove tool;
  std::vector<Effect> effects;
};

struct Context {
  double payload_kg = 0;
  KDL::Vector payload_com_m;
  JointVector move_rad{};   ///< last motion of each joint
  JointVector direction{};  ///< its sign, 0 where unknown
  double temperature_c = 20;
  double time_s = 0;
  KDL::Vector force_n;  ///< at the origin of Ftool, in F0
};

Context usual_context(const Nominal& nominal);

struct Reached {
  KDL::Frame tool;   ///< Ftool in Fb
  KDL::Vector slip;  ///< of the measured point, in Ftool
};

/// Pose that the true arm reaches, Eq. (M1).
Reached reached(const Nominal& nominal, const Truth& truth, const JointVector& q_rad, const Context& context);

/// Pose by the nominal chain.
KDL::Frame drawn(const Nominal& nominal, const JointVector& q_rad);

/// Angle of a rotation, accurate for small ones too.
double angle_of(const KDL::Rotation& rotation);

}  // namespace plant
