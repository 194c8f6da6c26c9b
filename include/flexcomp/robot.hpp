// SPDX-License-Identifier: Apache-2.0
/// \file
/// The nominal robot (docs/model.md, section 1) and the context of one instant. The robot is double on every
/// target (data, not arithmetic), so that its hash is the same everywhere.
#ifndef FLEXCOMP_ROBOT_HPP
#define FLEXCOMP_ROBOT_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexcomp/bytes.hpp"
#include "flexcomp/sha256.hpp"

namespace flexcomp {

/// One nominal link (M2): Rot(z,theta) Trans(z,d) Trans(x,a) Rot(x,alpha) Rot(y,beta); theta is added to the
/// joint reading.
struct NominalLink {
  double theta_rad = 0;  ///< about z, added to the reading
  double d_m = 0;        ///< along z
  double a_m = 0;        ///< along x
  double alpha_rad = 0;  ///< about x
  double beta_rad = 0;   ///< about y (Hayati)
};

/// Range of a joint reading.
struct JointLimits {
  double min_rad = -2 * 3.14159265358979323846;  ///< least reading
  double max_rad = 2 * 3.14159265358979323846;   ///< greatest reading
};

/// A SHA-256 digest, bytes in order.
using Sha256Digest = std::array<std::uint8_t, 32>;

/// Nominal geometry, load and limits of an arm with N revolute joints. A plain value: assign the members.
template <std::size_t N = 6>
struct NominalRobot {
  std::array<NominalLink, N> links{};                ///< from the base outward
  std::array<JointLimits, N> limits{};               ///< of the joint readings
  std::array<double, 3> gravity_m_s2{{0, 0, -9.8}};  ///< in F0
  std::array<double, 3> tool_xyz_m{{0, 0, 0}};       ///< origin of Ftool in the flange frame F6
  std::array<double, 4> tool_wxyz{{1, 0, 0, 0}};     ///< Hamilton, maps Ftool to F6, norm 1
  double payload_kg = 0;                             ///< default load where the context names none
  std::array<double, 3> payload_com_m{{0, 0, 0}};    ///< its centre of mass in F6
  double reference_temperature_c = 20;               ///< of the nominal lengths
  Sha256Digest name_hash{};                          ///< SHA-256 of the robot's name (UTF-8)
  Sha256Digest unit_hash{};  ///< SHA-256 of the unit's serial number (UTF-8); zeros: it has none
};

/// Nominal hash: SHA-256 over "flexcomp-nominal-1", a zero byte, N as one byte, then per link theta, d, a,
/// alpha, beta in rad and m as little-endian binary64, negative zero as zero. Limits, tool, payload and
/// gravity are left out: they may change without making the arm another one.
template <std::size_t N>
inline Sha256Digest nominal_hash(const NominalRobot<N>& robot) {
  Sha256 sha;
  static const char tag[] = "flexcomp-nominal-1";
  for (std::size_t i = 0; i < sizeof(tag); ++i) sha.update(static_cast<std::uint8_t>(tag[i]));
  sha.update(static_cast<std::uint8_t>(N));
  for (const NominalLink& link : robot.links) {
    const double values[5] = {link.theta_rad, link.d_m, link.a_m, link.alpha_rad, link.beta_rad};
    for (const double v : values) {
      std::uint64_t bits = bits_of(v);
      if (bits == 0x8000000000000000ULL) bits = 0;
      for (unsigned k = 0; k < 8; ++k) sha.update(static_cast<std::uint8_t>(bits >> (8U * k)));
    }
  }
  return sha.finish();
}

/// SHA-256 of a name or a serial number given as `size` bytes.
inline Sha256Digest name_hash(const char* name, std::size_t size) { return sha256(name, size); }

/// Context of one instant: load, temperature, time and the last motion before the pose (docs/model.md,
/// section 2).
template <class S, std::size_t N = 6>
struct Context {
  S payload_kg = S(0);                ///< mass of the payload
  std::array<S, 3> payload_com_m{};   ///< its centre of mass in F6
  std::array<S, 3> force_n{};         ///< external force at the origin of Ftool, in F0
  S temperature_c = S(20);            ///< of the arm
  S time_s = S(0);                    ///< since the start of the measurement
  std::array<S, N> direction{};       ///< +1, -1, or 0 where unknown
  std::array<S, N> relative_speed{};  ///< u_j = move_j / max_k |move_k|
};

/// Context of a robot at rest at its reference: default payload, no force, directions unknown.
template <class S, std::size_t N>
inline Context<S, N> default_context(const NominalRobot<N>& robot) {
  Context<S, N> context;
  context.payload_kg = from_binary64<S>(robot.payload_kg);
  for (std::size_t k = 0; k < 3; ++k) context.payload_com_m[k] = from_binary64<S>(robot.payload_com_m[k]);
  context.temperature_c = from_binary64<S>(robot.reference_temperature_c);
  return context;
}

}  // namespace flexcomp

#endif
