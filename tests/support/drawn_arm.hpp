// SPDX-License-Identifier: Apache-2.0
/// \file
/// Arms as drawings state them: joint origins and axes. Written as URDF for the program, and as a chain of KDL, which
/// shares no code with it, for the judge.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <iomanip>
#include <kdl/chain.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include <flexcomp/linear.hpp>

namespace drawn {

using Vec3 = std::array<double, 3>;

/// A joint of a URDF; fixed where it has no axis.
struct Joint {
  Vec3 xyz_m{};
  Vec3 rpy_rad{};
  Vec3 axis{};

  bool is_fixed() const { return axis == Vec3{}; }
};

using Arm = std::vector<Joint>;  ///< from the base to the tip

inline KDL::Vector vector(const Vec3& t) { return {t[0], t[1], t[2]}; }

/// `origin` of the joint in the frame before; the axis, of a joint that moves, in the joint's own frame.
inline void add_joint(KDL::Chain& chain, const KDL::Frame& origin, bool moves, const KDL::Vector& axis) {
  // KDL turns about a line of the frame before, as URDF's parser for KDL does.
  chain.addSegment(KDL::Segment(
      moves ? KDL::Joint(origin.p, origin.M * axis, KDL::Joint::RotAxis) : KDL::Joint(KDL::Joint::None),
      origin));
}

inline KDL::Chain chain_of(const Arm& arm) {
  KDL::Chain chain;
  for (const Joint& j : arm)
    add_joint(chain, {KDL::Rotation::RPY(j.rpy_rad[0], j.rpy_rad[1], j.rpy_rad[2]), vector(j.xyz_m)},
              !j.is_fixed(), vector(j.axis));
  return chain;
}

/// The tip in the base.
class Judge {
 public:
  explicit Judge(const KDL::Chain& chain) : chain_(chain), solver_(chain_) {}
  explicit Judge(const Arm& arm) : Judge(chain_of(arm)) {}
  Judge(const Judge&) = delete;  // the solver keeps a reference to the chain

  flexcomp::Pose<double> operator()(const std::array<double, 6>& q) {
    KDL::JntArray joints(6);
    for (unsigned i = 0; i < 6; ++i) joints(i) = q[i];
    KDL::Frame frame;
    if (solver_.JntToCart(joints, frame) < 0) throw std::runtime_error("KDL");
    flexcomp::Pose<double> pose;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) pose.rotation(r, c) = frame.M(r, c);
      pose.position[r] = frame.p(r);
    }
    return pose;
  }

 private:
  KDL::Chain chain_;
  KDL::ChainFkSolverPos_recursive solver_;
};

inline std::string text(const Vec3& t) {
  std::ostringstream out;
  out << std::setprecision(std::numeric_limits<double>::max_digits10) << t[0] << ' ' << t[1] << ' ' << t[2];
  return out.str();
}

/// Links l0 … ln, joints j1 … jn.
inline std::string urdf(const Arm& arm) {
  std::string out = "<robot name=\"drawn\">\n";
  for (std::size_t k = 0; k <= arm.size(); ++k) out += "<link name=\"l" + std::to_string(k) + "\"/>\n";
  for (std::size_t k = 1; k <= arm.size(); ++k) {
    const Joint& j = arm[k - 1];
    out += "<joint name=\"j" + std::to_string(k) + "\" type=\"" + (j.is_fixed() ? "fixed" : "revolute") +
           "\">\n";
    out += "<parent link=\"l" + std::to_string(k - 1) + "\"/><child link=\"l" + std::to_string(k) + "\"/>\n";
    out += "<origin xyz=\"" + text(j.xyz_m) + "\" rpy=\"" + text(j.rpy_rad) + "\"/>\n";
    if (!j.is_fixed()) {
      out += "<axis xyz=\"" + text(j.axis) + "\"/>\n";
      out += "<limit lower=\"-3\" upper=\"3\" effort=\"0\" velocity=\"2\"/>\n";
    }
    out += "</joint>\n";
  }
  return out + "</robot>\n";
}

inline double length(const Vec3& t) { return std::hypot(t[0], t[1], t[2]); }

/// Sum of all offsets: no point of the arm is further from the base.
inline double size_m(const Arm& arm) {
  double sum = 0;
  for (const Joint& j : arm) sum += length(j.xyz_m);
  return sum;
}

constexpr double quarter = 1.57079632679489661923;

/// KUKA KR 6 R900 sixx, base_link to tool0: ROS-Industrial's kuka_experimental,
/// kuka_kr6_support/urdf/kr6r900sixx_macro.xacro, read off by hand.
inline Arm kuka_kr6_r900() {
  return {{{0, 0, 0.400}, {}, {0, 0, -1}}, {{0.025, 0, 0}, {}, {0, 1, 0}}, {{0.455, 0, 0}, {}, {0, 1, 0}},
          {{0, 0, 0.035}, {}, {-1, 0, 0}}, {{0.420, 0, 0}, {}, {0, 1, 0}}, {{0.080, 0, 0}, {}, {-1, 0, 0}},
          {{}, {0, quarter, 0}, {}}};
}

/// ABB IRB 120-3/0.58, base_link to tool0: ROS-Industrial's abb, abb_irb120_support/urdf/irb120_3_58_macro.xacro.
inline Arm abb_irb120() {
  return {{{0, 0, 0}, {}, {0, 0, 1}},
          {{0, 0, 0.29}, {}, {0, 1, 0}},
          {{0, 0, 0.27}, {}, {0, 1, 0}},
          {{0, 0, 0.07}, {}, {1, 0, 0}},
          {{0.302, 0, 0}, {}, {0, 1, 0}},
          {{0.072, 0, 0}, {}, {1, 0, 0}},
          {{}, {}, {}},
          {{}, {0, quarter, 0}, {}}};
}

/// UR5, base_link to ee_link: ROS-Industrial's universal_robot, ur_description/urdf/ur5_robot.urdf, whose right angles
/// are 1.570796325.
inline Arm ur5() {
  constexpr double right = 1.570796325;
  return {{{0, 0, 0.089159}, {}, {0, 0, 1}},    {{0, 0.13585, 0}, {0, right, 0}, {0, 1, 0}},
          {{0, -0.1197, 0.425}, {}, {0, 1, 0}}, {{0, 0, 0.39225}, {0, right, 0}, {0, 1, 0}},
          {{0, 0.093, 0}, {}, {0, 0, 1}},       {{0, 0, 0.09465}, {}, {0, 1, 0}},
          {{0, 0.0823, 0}, {0, 0, right}, {}}};
}

/// Staubli TX60L, base_link (the foot) to tool0: ROS-Industrial's staubli_experimental,
/// staubli_tx60_support/urdf/tx60l_macro.xacro.
inline Arm tx60l() {
  return {{{0, 0, 0.375}, {}, {0, 0, 1}},   {{0, 0.2175, 0}, {}, {0, 1, 0}}, {{0, 0, 0.40}, {}, {0, 1, 0}},
          {{0, -0.1975, 0}, {}, {0, 0, 1}}, {{0, 0, 0.45}, {}, {0, 1, 0}},   {{0, 0, 0.07}, {}, {0, 0, 1}},
          {{}, {0, -quarter, 0}, {}},       {{}, {0, quarter, 0}, {}}};
}

/// Staubli RX160L, base (at the height of joint 2) to tool0: ROS-Industrial's staubli,
/// staubli_rx160_support/urdf/rx160l_macro.xacro, whose base is 0.55 m above base_link, as joint 1 is.
inline Arm rx160l() {
  return {{{0, 0, 0}, {}, {0, 0, 1}}, {{0.15, 0, 0}, {}, {0, 1, 0}},  {{0, 0, 0.825}, {}, {0, 1, 0}},
          {{0, 0, 0}, {}, {0, 0, 1}}, {{0, 0, 0.925}, {}, {0, 1, 0}}, {{0, 0, 0.11}, {}, {0, 0, 1}}};
}

}  // namespace drawn
