// SPDX-License-Identifier: Apache-2.0
#include "support/hidden_arm.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "files/calibration_file.hpp"
#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "files/write_file.hpp"
#include "identification/residuals.hpp"

namespace hidden {

using flexcomp::Covariate;
using flexcomp::host::EffectId;
using flexcomp::host::Observation;
using Kind = flexcomp::Effect;

namespace {

constexpr double arcsec = arms::deg / 3600;
constexpr double turn = 2 * plain::pi;
constexpr double seconds_per_pose = 60;

/// Normal numbers beside the uniform ones, the same with every standard library (Box and Muller).
class Random : public arms::Random {
 public:
  using arms::Random::Random;
  double normal() {
    const double radius = std::sqrt(-2 * std::log(1 - uniform(0, 1)));
    return radius * std::cos(uniform(0, turn));
  }
  double sign() { return below(2) == 0 ? -1 : 1; }
  /// Between low and high, of either sign.
  double signed_size(double low, double high) { return sign() * uniform(low, high); }
  unsigned joint() { return static_cast<unsigned>(1 + below(6)); }
  plain::Vector direction() {
    const plain::Vector v(normal(), normal(), normal());
    return v.normalized();
  }
  template <class T>
  void shuffle(std::vector<T>& v) {
    for (std::size_t k = v.size(); k > 1; --k) std::swap(v[k - 1], v[below(k)]);
  }
  /// The numbers from 0 in random order.
  std::vector<std::size_t> order(std::size_t count) {
    std::vector<std::size_t> v(count);
    std::iota(v.begin(), v.end(), std::size_t{0});
    shuffle(v);
    return v;
  }
};

/// SplitMix64: neighbouring seeds shall have nothing in common.
std::uint64_t mixed(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31U);
}

struct ArmData {
  double payload_kg;
  double softness;  ///< compliances over those of Table 1: the heavy arm is stiffer, both sag by 1 to 2 mm
  double foot_z_m;  ///< where the arm stands: what a pedestal tilts about
  double column_radius_m;
};
constexpr std::array<ArmData, 3> arm_data{
    {{1.108, 1, -0.375, 0.115}, {6.23, 0.25, -0.55, 0.235}, {5, 0.5, 0, 0.095}}};

void set_arm(Case& c) {
  const arms::Arm& arm = arms::all()[c.arm];
  const ArmData& data = arm_data[c.arm];
  c.arm_name = arm.name;
  c.robot.name = arm.name;
  c.robot.nominal = arm.robot;
  c.robot.nominal.payload_kg = data.payload_kg;
  c.robot.nominal.name_hash = flexcomp::name_hash(c.robot.name.data(), c.robot.name.size());
  c.robot.has_noise = true;
  c.robot.position_sigma_m = 0.035e-3;
  c.robot.orientation_sigma_rad = 0.007 * arms::deg;
  flexcomp::host::Capsule column;
  column.from_m = {0, 0, std::min(data.foot_z_m, 0.0)};
  column.to_m = {0, 0, data.foot_z_m < 0 ? 0 : arm.robot.links[0].d_m};
  column.radius_m = data.column_radius_m;
  c.robot.capsules = {column};
  c.nominal = plain::nominal_of(c.robot.nominal);
}

/// Joints and contexts of a session in the order in which it ran.
struct Session {
  std::vector<arms::Joints> q;
  std::vector<plain::Situation> situation;
  std::vector<std::array<double, 6>> move;
};

/// Of time and temperature.
double correlation(const std::vector<plain::Situation>& rows) {
  Eigen::MatrixX2d columns(rows.size(), 2);
  for (std::size_t k = 0; k < rows.size(); ++k)
    columns.row(static_cast<Eigen::Index>(k)) << rows[k].time_s, rows[k].temperature_c;
  columns.rowwise() -= columns.colwise().mean().eval();
  return columns.col(0).dot(columns.col(1)) / (columns.col(0).norm() * columns.col(1).norm());
}

Session draw_session(const Case& c, Random& random) {
  const std::size_t count = training_poses + held_out_poses;
  Session out;
  std::vector<int> loaded(count, 0);
  std::fill(loaded.begin(), loaded.begin() + static_cast<std::ptrdiff_t>(count / 2), 1);
  random.shuffle(loaded);
  for (std::size_t k = 0; k < count; ++k) {
    out.q.push_back(random.pose(c.robot.nominal));
    plain::Situation s;
    s.payload_kg = loaded[k] != 0 ? c.robot.nominal.payload_kg : 0;
    const auto& com = c.robot.nominal.payload_com_m;
    s.payload_com = {com[0], com[1], com[2]};
    s.time_s = std::round(seconds_per_pose * (static_cast<double>(k) + random.uniform(0, 0.3)));
    std::array<double, 6> move{};
    double largest = 0;
    for (double& m : move) {
      m = random.signed_size(2, 90) * arms::deg;
      largest = std::max(largest, std::abs(m));
    }
    for (std::size_t j = 0; j < 6; ++j) {
      s.direction[j] = move[j] > 0 ? 1 : -1;
      s.relative_speed[j] = move[j] / largest;
    }
    out.move.push_back(move);
    out.situation.push_back(s);
  }
  do {
    const double swing = random.uniform(2.5, 5);
    const double periods = random.uniform(0.5, 1.5);
    const double phase = random.uniform(0, turn);
    const double end = seconds_per_pose * static_cast<double>(count);
    for (plain::Situation& s : out.situation) {
      const double t = 25 + swing * std::sin(turn * periods * s.time_s / end + phase) + random.around(2);
      s.temperature_c = std::min(32.0, std::max(18.0, t));
    }
  } while (std::abs(correlation(out.situation)) > 0.85);
  return out;
}

/// Errors like those of Table 1, each scaled at random and of random sign.
void draw_rigid_arm(Case& c, Random& random) {
  namespace t1 = arms::of_table1;
  const auto scaled = [&](double size) { return size * random.signed_size(0.5, 1.5); };
  for (std::size_t i = 0; i < 6; ++i) {
    const bool parallel = i == 1 || (i == 2 && arms::all()[c.arm].parallel_3);
    plain::Link& l = c.truth.geometric[i];
    l.theta = scaled(t1::theta[i]) * arms::deg;
    l.a = scaled(t1::a[i]) * arms::mm;
    l.alpha = scaled(t1::alpha[i]) * arms::deg;
    if (parallel) {
      l.beta = scaled(0.03) * arms::deg;
    } else {
      l.d = scaled(t1::d[i]) * arms::mm;
    }
  }
  c.truth.base = {scaled(0.3) * arms::mm,   scaled(0.2) * arms::mm,   scaled(0.1) * arms::mm,
                  scaled(0.02) * arms::deg, scaled(0.01) * arms::deg, scaled(0.01) * arms::deg};
}

void draw_flexible_arm(Case& c, Random& random) {
  for (int j = 0; j < 6; ++j) {
    c.truth.joint_compliance.push_back({j + 1, arm_data[c.arm].softness * random.uniform(0.5, 1.5) /
                                                   (arms::of_table1::stiffness[j] * 1e-3)});
  }
  c.truth.link_gravity.push_back({0.0015 * random.uniform(0.5, 1.5), 0.00123 * random.uniform(0.5, 1.5),
                                  0.00054 * random.uniform(0.5, 1.5)});
}

std::array<double, 6> largest_torques(const Case& c, const Session& session) {
  std::array<double, 6> largest{};
  for (std::size_t k = 0; k < session.q.size(); ++k) {
    const plain::Result r = plain::forward(c.nominal, c.truth, session.q[k], session.situation[k]);
    for (std::size_t j = 0; j < 6; ++j) largest[j] = std::max(largest[j], std::abs(r.torque[j]));
  }
  return largest;
}

/// Share of a curve over the joint's range that a constant and a line, or a constant and one harmonic, take away.
double simple_share(const std::vector<double>& curve, double low, double high) {
  constexpr Eigen::Index points = 200;
  Eigen::VectorXd value(points);
  Eigen::VectorXd q(points);
  for (Eigen::Index k = 0; k < points; ++k) {
    q[k] = low + (high - low) * static_cast<double>(k) / static_cast<double>(points - 1);
    value[k] = plain::curve(curve, q[k]);
  }
  const double all = (value.array() - value.mean()).matrix().squaredNorm();
  double best = 0;
  for (int order = 0; order <= 8; ++order) {
    Eigen::MatrixXd basis(points, 3);
    basis.col(0).setOnes();
    basis.col(1) = order == 0 ? q : Eigen::VectorXd((order * q.array()).sin());
    basis.col(2) = order == 0 ? Eigen::VectorXd::Zero(points) : Eigen::VectorXd((order * q.array()).cos());
    const Eigen::VectorXd left = value - basis * basis.completeOrthogonalDecomposition().solve(value);
    best = std::max(best, 1 - left.squaredNorm() / all);
  }
  return best;
}

/// A smooth curve that is no harmonic, rms 20 to 80 arcsec over the joint's range, mean 0 there.
std::vector<double> draw_curve(const Case& c, unsigned joint, Random& random) {
  const flexcomp::JointLimits& limits = c.robot.nominal.limits[joint - 1];
  for (;;) {
    std::vector<double> curve(6 + random.below(19));
    for (double& v : curve) v = random.normal();
    if (simple_share(curve, limits.min_rad, limits.max_rad) > 0.6) continue;
    constexpr int points = 400;
    double mean = 0;
    double square = 0;
    for (int k = 0; k < points; ++k) {
      const double v =
          plain::curve(curve, limits.min_rad + (limits.max_rad - limits.min_rad) * (k + 0.5) / points);
      mean += v / points;
      square += v * v / points;
    }
    const double scale = random.uniform(20, 80) * arcsec / std::sqrt(square - mean * mean);
    for (double& v : curve) v = (v - mean) * scale;
    return curve;
  }
}

constexpr std::array<Kind, 14> kinds{
    Kind::nonlinear_compliance, Kind::gear_harmonic,  Kind::joint_curve,    Kind::backlash,
    Kind::readout_lag,          Kind::encoder_scale,  Kind::joint_coupling, Kind::axis_wobble,
    Kind::link_bending,         Kind::thermal_growth, Kind::base_drift,     Kind::base_compliance,
    Kind::payload_error,        Kind::reflector_slip};

/// What one effect does at most.
struct Reach {
  double moved_m = 0;  ///< the tool's point
  double tilt_rad = 0;
};

void hide(plain::Truth& truth, const Effect& effect);

Reach reach_of(const Case& c, const Session& session, const Effect& effect) {
  plain::Truth with = c.truth;
  hide(with, effect);
  Reach r;
  for (std::size_t k = 0; k < session.q.size(); ++k) {
    const plain::Matrix change = plain::forward(c.nominal, with, session.q[k], session.situation[k]).pose -
                                 plain::forward(c.nominal, c.truth, session.q[k], session.situation[k]).pose;
    r.moved_m = std::max(r.moved_m, plain::origin(change).norm());
    r.tilt_rad = std::max(r.tilt_rad, change.topLeftCorner<3, 3>().norm() / std::sqrt(2.0));
  }
  return r;
}

bool has_length(const Case& c, unsigned link) {
  const plain::Link& l = c.nominal.links[link - 1];
  return l.a != 0 || l.d != 0;
}

/// One effect of the catalogue; readout_lag may be of all joints at once, which are six entries.
std::vector<Effect> draw_effect(const Case& c, const Session& session, Random& random) {
  EffectId id;
  id.effect = kinds[random.below(kinds.size())];
  const double first_s = session.situation.front().time_s;
  const double last_s = session.situation.back().time_s;
  switch (id.effect) {
    case Kind::nonlinear_compliance: {
      const std::array<double, 6> torque = largest_torques(c, session);
      const double largest = *std::max_element(torque.begin(), torque.end());
      do {
        id.joint = random.joint();
      } while (torque[id.joint - 1] < 0.01 * largest);
      return {{id, {random.uniform(0.3, 1) * 60 * arcsec / std::pow(torque[id.joint - 1], 3)}}};
    }
    case Kind::gear_harmonic: {
      id.joint = random.joint();
      id.order = static_cast<double>(1 + random.below(8));
      const double size = random.uniform(20, 80) * arcsec;
      const double phase = random.uniform(0, turn);
      return {{id, {size * std::cos(phase), size * std::sin(phase)}}};
    }
    case Kind::joint_curve: {
      id.joint = random.joint();
      const std::vector<double> curve = draw_curve(c, id.joint, random);
      id.coefficients = curve.size();
      return {{id, curve}};
    }
    case Kind::backlash:
      id.joint = random.joint();
      return {{id, {random.uniform(10, 60) * arcsec}}};
    case Kind::readout_lag: {
      if (random.below(2) == 0) {
        id.joint = random.joint();
        return {{id, {random.uniform(0.7e-3, 1.3e-3)}}};
      }
      std::vector<Effect> all;
      for (id.joint = 1; id.joint <= 6; ++id.joint) all.push_back({id, {random.uniform(0.7e-3, 1.3e-3)}});
      return all;
    }
    case Kind::encoder_scale:
      id.joint = random.joint();
      return {{id, {random.signed_size(5e-5, 5e-4)}}};
    case Kind::joint_coupling:
      id.joint = random.joint();
      do {
        id.from = random.joint();
      } while (id.from == id.joint);
      return {{id, {random.signed_size(1e-4, 1e-3)}}};
    case Kind::axis_wobble: {
      id.joint = random.joint();
      id.order = static_cast<double>(1 + random.below(2));
      std::vector<double> values;
      for (int tilt = 0; tilt < 2; ++tilt) {
        const double size = random.uniform(20, 80) * arcsec;
        const double phase = random.uniform(0, turn);
        values.push_back(size * std::cos(phase));
        values.push_back(size * std::sin(phase));
      }
      return {{id, values}};
    }
    case Kind::link_bending: {
      id.link = random.joint();
      const bool both = std::abs(std::sin(c.nominal.links[id.link - 1].alpha)) <= 0.1;
      const double angle = both ? random.uniform(0, turn) : (random.below(2) == 0 ? 0 : plain::pi);
      Effect e{id, {std::cos(angle)}};
      if (both) e.values.push_back(std::sin(angle));
      // A millionth first: the size follows from what it does, and a tilt beyond a milliradian is no link's.
      for (double& v : e.values) v *= 1e-6;
      const double wanted = random.uniform(0.1e-3, 0.4e-3);
      const Reach reach = reach_of(c, session, e);
      const double scale = std::min(wanted / reach.moved_m, 1e-3 / std::max(reach.tilt_rad, 1e-12));
      for (double& v : e.values) v *= scale;
      return {e};
    }
    case Kind::thermal_growth:
      if (random.uniform(0, 1) < 0.3) {
        do {
          id.link = random.joint();
        } while (!has_length(c, id.link));
      }
      return {{id, {random.uniform(12e-6, 25e-6)}}};
    case Kind::base_drift: {
      const plain::Vector shift = random.uniform(30e-6, 60e-6) / (last_s - first_s) * random.direction();
      const plain::Vector tilt = random.uniform(10e-6, 40e-6) / (last_s - first_s) * random.direction();
      return {{id, {shift.x(), shift.y(), shift.z(), tilt.x(), tilt.y(), tilt.z()}}};
    }
    case Kind::base_compliance: {
      id.pivot_z_m = arm_data[c.arm].foot_z_m;
      Effect e{id, {1e-6, 0}};
      const double rx = 1e-6 / reach_of(c, session, e).tilt_rad;
      e.values = {0, 1e-6};
      const double ry = 1e-6 / reach_of(c, session, e).tilt_rad;
      e.values = {rx * random.uniform(50e-6, 300e-6), ry * random.uniform(50e-6, 300e-6)};
      return {e};
    }
    case Kind::payload_error: {
      if (random.below(2) == 0)
        return {{id, {c.robot.nominal.payload_kg * random.signed_size(0.1, 0.2), 0, 0, 0}}};
      const plain::Vector r = random.uniform(5e-3, 20e-3) * random.direction();
      return {{id, {0, r.x(), r.y(), r.z()}}};
    }
    default: {
      id.effect = Kind::reflector_slip;
      // Between two poses: a slip has no finer time than that.
      id.after_s = std::round(first_s + random.uniform(0.25, 0.75) * (last_s - first_s)) + 0.5;
      const plain::Vector r = random.uniform(0.1e-3, 0.3e-3) * random.direction();
      return {{id, {r.x(), r.y(), r.z()}}};
    }
  }
}

Effect draw_slip_or_drift(const Case& c, const Session& session, Kind kind, Random& random) {
  for (;;) {
    for (Effect& e : draw_effect(c, session, random)) {
      if (e.id.effect == kind) return e;
    }
  }
}

/// The same entry of the catalogue, or one that holds the other.
bool collide(const EffectId& a, const EffectId& b) {
  return a.effect == b.effect &&
         (a.effect == Kind::thermal_growth ||
          (a.joint == b.joint && a.from == b.from && a.link == b.link && a.order == b.order));
}

void hide(plain::Truth& truth, const Effect& effect) {
  const EffectId& id = effect.id;
  const std::vector<double>& v = effect.values;
  const int joint = static_cast<int>(id.joint);
  switch (id.effect) {
    case Kind::nonlinear_compliance:
      return truth.nonlinear_compliance.push_back({joint, v.at(0)});
    case Kind::gear_harmonic:
      return truth.gear_harmonic.push_back({joint, id.order, v.at(0), v.at(1)});
    case Kind::joint_curve:
      return truth.joint_curve.push_back({joint, v});
    case Kind::backlash:
      return truth.backlash.push_back({joint, v.at(0)});
    case Kind::readout_lag:
      return truth.readout_lag.push_back({joint, v.at(0)});
    case Kind::encoder_scale:
      return truth.encoder_scale.push_back({joint, v.at(0)});
    case Kind::joint_coupling:
      return truth.joint_coupling.push_back({joint, static_cast<int>(id.from), v.at(0)});
    case Kind::axis_wobble:
      return truth.axis_wobble.push_back({joint, id.order, v.at(0), v.at(1), v.at(2), v.at(3)});
    case Kind::link_bending:
      return truth.link_bending.push_back({static_cast<int>(id.link), v.at(0), v.size() > 1 ? v[1] : 0});
    case Kind::thermal_growth:
      return truth.thermal_growth.push_back({static_cast<int>(id.link), v.at(0)});
    case Kind::base_drift:
      return truth.base_drift.push_back({{v.at(0), v.at(1), v.at(2), v.at(3), v.at(4), v.at(5)}});
    case Kind::base_compliance:
      return truth.base_compliance.push_back({id.pivot_z_m, v.at(0), v.at(1)});
    case Kind::payload_error:
      return truth.payload_error.push_back({v.at(0), {v.at(1), v.at(2), v.at(3)}});
    case Kind::reflector_slip:
      return truth.reflector_slip.push_back({id.after_s, {v.at(0), v.at(1), v.at(2)}});
    default:
      throw std::logic_error("an effect that is not drawn");
  }
}

double folded(double q) { return q - turn * std::round(q / turn); }

double value_of(Covariate kind, unsigned joint, const plain::Joints& q, const plain::Situation& s) {
  if (kind == Covariate::payload) return s.payload_kg;
  if (kind == Covariate::temperature) return s.temperature_c;
  return q[joint - 1];
}

/// Of an effect of amplitude 1.
double shape_at(const Outside& o, const plain::Joints& q, const plain::Situation& s) {
  return o.shape(value_of(o.covariate[0], o.covariate_joint[0], q, s),
                 value_of(o.covariate[1], o.covariate_joint[1], q, s));
}

Outside draw_outside(const Case& c, const Session& session, Random& random) {
  Outside out;
  out.joint = random.joint();
  // Half of the functions of two joints read the joint that they move.
  unsigned a = random.below(2) == 0 ? out.joint : random.joint();
  unsigned b = a;
  while (b == a) b = random.joint();
  if (random.below(2) == 0) std::swap(a, b);
  out.covariate = {Covariate::joint_position, Covariate::joint_position};
  out.covariate_joint = {a, b};
  const double phase = random.uniform(0, turn);
  const double full_kg = c.robot.nominal.payload_kg;
  const auto normalised = [&](unsigned joint) {
    const flexcomp::JointLimits& l = c.robot.nominal.limits[joint - 1];
    return [middle = (l.min_rad + l.max_rad) / 2, half = (l.max_rad - l.min_rad) / 2](double q) {
      return (q - middle) / half;
    };
  };
  const std::size_t which = random.below(8);
  double peak = 0;
  switch (which) {
    case 0:
      out.formula = fmt::format("sin q{} cos q{}", a, b);
      out.shape = [](double x, double y) { return std::sin(x) * std::cos(y); };
      break;
    case 1:
      out.formula = fmt::format("sin q{} sin 2q{}", a, b);
      out.shape = [](double x, double y) { return std::sin(x) * std::sin(2 * y); };
      break;
    case 2:
      out.formula = fmt::format("q{} q{}", a, b);
      out.shape = [u = normalised(a), v = normalised(b)](double x, double y) { return u(x) * v(y); };
      break;
    case 3:
      out.formula = fmt::format("sin(q{} + q{})", a, b);
      out.shape = [](double x, double y) { return std::sin(x + y); };
      break;
    case 4: {
      const plain::Joints& at = session.q[random.below(session.q.size())];
      const double x0 = at[a - 1];
      const double y0 = at[b - 1];
      out.formula =
          fmt::format("bump at q{} = {:.0f}, q{} = {:.0f} deg", a, x0 / arms::deg, b, y0 / arms::deg);
      out.shape = [x0, y0](double x, double y) {
        const double u = folded(x - x0);
        const double v = folded(y - y0);
        return std::exp(-(u * u + v * v) / (2 * 0.5 * 0.5));
      };
      // Few poses lie inside: its rms over all of them would ask for a peak that no arm has.
      peak = random.signed_size(100, 300) * arcsec;
      break;
    }
    case 5:
    case 6: {
      const unsigned k = which == 5 ? out.joint : random.joint();
      out.covariate = {Covariate::joint_position, Covariate::payload};
      out.covariate_joint = {k, 0};
      if (which == 5) {
        out.formula = fmt::format("payload sin(q{} + {:.2f})", k, phase);
        out.shape = [phase, full_kg](double x, double m) { return m / full_kg * std::sin(x + phase); };
      } else {
        out.formula = fmt::format("payload sin 2q{}", k);
        out.shape = [full_kg](double x, double m) { return m / full_kg * std::sin(2 * x); };
      }
      break;
    }
    default:
      out.covariate = {Covariate::joint_position, Covariate::temperature};
      out.covariate_joint = {out.joint, 0};
      out.formula = fmt::format("dT sin(q{} + {:.2f})", out.joint, phase);
      out.shape = [phase, reference = c.nominal.reference_temperature_c](double x, double t) {
        return (t - reference) / 10 * std::sin(x + phase);
      };
  }
  if (peak != 0) {
    out.amplitude_rad = peak;
    return out;
  }
  double square = 0;
  for (std::size_t k = 0; k < session.q.size(); ++k) {
    const double f = shape_at(out, session.q[k], session.situation[k]);
    square += f * f / static_cast<double>(session.q.size());
  }
  out.amplitude_rad = random.signed_size(20, 80) * arcsec / std::sqrt(square);
  return out;
}

Observation measured(const Case& c, const Session& session, std::size_t k, std::size_t line, Random& random) {
  const plain::Joints& q = session.q[k];
  const plain::Situation& s = session.situation[k];
  const plain::Matrix pose = true_pose(c, q, s);
  const auto noise = [&](double sigma) {
    return plain::Vector(sigma * random.normal(), sigma * random.normal(), sigma * random.normal());
  };
  Observation row;
  row.q_rad = q;
  row.line = line;
  row.p_m = plain::origin(pose) + noise(c.robot.position_sigma_m);
  const plain::Vector w = noise(c.robot.orientation_sigma_rad);
  row.R = Eigen::AngleAxisd(w.norm(), w.normalized()).toRotationMatrix() * pose.topLeftCorner<3, 3>();
  row.has_orientation = true;
  row.whitening.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() / c.robot.position_sigma_m;
  row.whitening.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() / c.robot.orientation_sigma_rad;
  row.context.payload_kg = s.payload_kg;
  row.context.payload_com_m = {s.payload_com.x(), s.payload_com.y(), s.payload_com.z()};
  row.context.temperature_c = c.columns.temperature ? s.temperature_c : c.nominal.reference_temperature_c;
  row.context.time_s = c.columns.time ? s.time_s : 0;
  if (c.columns.all_moves()) {
    row.context.direction = s.direction;
    row.context.relative_speed = s.relative_speed;
  }
  return row;
}

void spoil(Case& c, Random& random) {
  c.wild.assign(c.train.size(), false);
  if (c.roughness != Roughness::outliers) return;
  const std::vector<std::size_t> order = random.order(c.train.size());
  const auto count = static_cast<std::size_t>(std::lround(0.03 * static_cast<double>(c.train.size())));
  for (std::size_t k = 0; k < count; ++k) {
    Observation& row = c.train[order[k]];
    c.wild[order[k]] = true;
    row.p_m += random.uniform(0.5e-3, 3e-3) * random.direction();
    row.R = Eigen::AngleAxisd(random.uniform(0.1, 0.5) * arms::deg, random.direction()).toRotationMatrix() *
            row.R;
  }
}

std::string words(const Case& c) {
  std::string text;
  const auto add = [&](const std::string& part) { text += (text.empty() ? "" : " + ") + part; };
  for (const Effect& e : c.hidden) add(flexcomp::host::name(e.id));
  if (c.outside) {
    add(fmt::format("joint {}: {:.0f}\" x {}", c.outside->joint, c.outside->amplitude_rad / arcsec,
                    c.outside->formula));
  }
  if (c.bump) {
    add(fmt::format("bump of joint {} at {:.0f} deg, {:.0f}\", {} training poses inside", c.bump->joint,
                    c.bump->centre_rad / arms::deg, c.bump->height_rad / arcsec, c.inside_the_bump));
  }
  if (c.roughness != Roughness::nothing) add(name(c.roughness));
  return text.empty() ? "nothing" : text;
}

constexpr std::array<const char*, 8> row_names{"one", "none",  "local",    "outside",
                                               "two", "third", "geometry", "rough"};
constexpr std::array<const char*, 7> roughness_names{"nothing",         "3 % outliers", "a slip besides",
                                                     "a drift besides", "no time_s",    "no temp_c",
                                                     "no move columns"};

}  // namespace

const std::vector<Row>& all_rows() {
  static const std::vector<Row> rows{Row::one, Row::none,  Row::local,    Row::outside,
                                     Row::two, Row::third, Row::geometry, Row::rough};
  return rows;
}

std::string name(Row row) { return row_names.at(static_cast<std::size_t>(row)); }

std::optional<Row> row_of(const std::string& wanted) {
  for (const Row row : all_rows()) {
    if (name(row) == wanted) return row;
  }
  return {};
}

std::string name(Roughness roughness) { return roughness_names.at(static_cast<std::size_t>(roughness)); }

bool needs_what_is_missing(Kind effect, Roughness roughness) {
  switch (roughness) {
    case Roughness::no_time:
      return effect == Kind::base_drift || effect == Kind::reflector_slip;
    case Roughness::no_temperature:
      return effect == Kind::thermal_growth;
    case Roughness::no_moves:
      return effect == Kind::backlash || effect == Kind::readout_lag;
    default:
      return false;
  }
}

double Bump::at(double q_rad) const {
  const double x = folded(q_rad - centre_rad);
  return std::abs(x) >= width_rad / 2 ? 0 : height_rad * 0.5 * (1 + std::cos(turn * x / width_rad));
}

std::vector<Observation> Case::clean_train() const {
  std::vector<Observation> rows;
  for (std::size_t k = 0; k < train.size(); ++k) {
    if (!wild[k]) rows.push_back(train[k]);
  }
  return rows;
}

Case draw(Row row, std::uint64_t seed) {
  Case c;
  c.row = row;
  c.seed = seed;
  c.arm = static_cast<std::size_t>(seed % 3);
  Random random(mixed(seed * 16 + static_cast<std::uint64_t>(row)));
  set_arm(c);
  draw_rigid_arm(c, random);
  draw_flexible_arm(c, random);
  const Session session = draw_session(c, random);
  c.columns.payload_mass = true;
  c.columns.move.fill(true);
  c.columns.temperature = c.columns.time = true;

  switch (row) {
    case Row::none:
    case Row::geometry:
      break;
    case Row::one:
    case Row::third:
    case Row::rough:
      c.hidden = draw_effect(c, session, random);
      break;
    case Row::two: {
      c.hidden = draw_effect(c, session, random);
      std::vector<Effect> second;
      do {
        second = draw_effect(c, session, random);
      } while (std::any_of(second.begin(), second.end(), [&](const Effect& s) {
        return std::any_of(c.hidden.begin(), c.hidden.end(),
                           [&](const Effect& f) { return collide(f.id, s.id); });
      }));
      c.hidden.insert(c.hidden.end(), second.begin(), second.end());
      break;
    }
    case Row::local: {
      Bump bump;
      bump.joint = random.joint();
      bump.height_rad = random.signed_size(100, 200) * arcsec;
      bump.centre_rad = 0;  // follows when it is known which poses are for training
      c.bump = bump;
      break;
    }
    case Row::outside:
      c.outside = draw_outside(c, session, random);
      break;
  }
  if (row == Row::third) {
    for (Effect& e : c.hidden) {
      for (double& v : e.values) v /= 3;
    }
  }
  if (row == Row::rough) {
    c.roughness = static_cast<Roughness>(1 + random.below(6));
    const Kind more = c.roughness == Roughness::slip ? Kind::reflector_slip : Kind::base_drift;
    if ((c.roughness == Roughness::slip || c.roughness == Roughness::drift) &&
        c.hidden.front().id.effect != more) {
      c.hidden.push_back(draw_slip_or_drift(c, session, more, random));
    }
    // Half of the time it is the effect itself that the missing column would have shown.
    if (random.below(2) == 0 &&
        (c.roughness == Roughness::no_time || c.roughness == Roughness::no_temperature ||
         c.roughness == Roughness::no_moves)) {
      while (!needs_what_is_missing(c.hidden.front().id.effect, c.roughness))
        c.hidden = draw_effect(c, session, random);
    }
    if (c.roughness == Roughness::no_time) c.columns.time = false;
    if (c.roughness == Roughness::no_temperature) c.columns.temperature = false;
    if (c.roughness == Roughness::no_moves) c.columns.move.fill(false);
  }
  for (const Effect& e : c.hidden) hide(c.truth, e);

  std::vector<std::size_t> order = random.order(session.q.size());
  std::sort(order.begin(), order.begin() + training_poses);
  std::sort(order.begin() + training_poses, order.end());
  if (c.bump) {
    const std::size_t k = order[random.below(training_poses)];
    c.bump->centre_rad = folded(session.q[k][c.bump->joint - 1] + random.around(0.06));
    c.truth.hook.emplace_back(
        [bump = *c.bump](const plain::Joints& q, const plain::Situation&, std::array<plain::Moved, 6>& e) {
          e[bump.joint - 1].theta += bump.at(q[bump.joint - 1]);
        });
  }
  if (c.outside) {
    c.truth.hook.emplace_back(
        [o = *c.outside](const plain::Joints& q, const plain::Situation& s, std::array<plain::Moved, 6>& e) {
          e[o.joint - 1].theta += o.amplitude_rad * shape_at(o, q, s);
        });
  }
  for (std::size_t n = 0; n < order.size(); ++n) {
    const bool train = n < training_poses;
    std::vector<Observation>& rows = train ? c.train : c.held_out;
    rows.push_back(measured(c, session, order[n], rows.size() + 2, random));
    c.move_rad.insert(c.move_rad.end(), session.move[order[n]].begin(), session.move[order[n]].end());
    if (train && c.bump && c.bump->at(session.q[order[n]][c.bump->joint - 1]) != 0) ++c.inside_the_bump;
  }
  spoil(c, random);
  c.what = words(c);
  return c;
}

plain::Matrix true_pose(const Case& c, const plain::Joints& q, const plain::Situation& s) {
  const plain::Result r = plain::forward(c.nominal, c.truth, q, s);
  return r.pose * plain::trans(r.measured_point.x(), r.measured_point.y(), r.measured_point.z());
}

namespace {

using flexcomp::host::ParametricModel;

void append_values(ParametricModel& model, const EffectId& id, const std::vector<double>& values,
                   const Case& c) {
  const std::size_t first = model.parameters.size();
  flexcomp::host::add_effect(model, id, c.robot.nominal);
  if (model.parameters.size() - first != values.size())
    throw std::logic_error(flexcomp::host::name(id) + ": other keys than were drawn");
  for (std::size_t k = 0; k < values.size(); ++k) model.parameters[first + k].set(model.set, values[k]);
}

/// A table's term whose coefficient is the parameter.
void append_shape(ParametricModel& model, const EffectId& id, const std::vector<double>& values, double size,
                  const Case& c) {
  const std::size_t first = model.parameters.size();
  append_values(model, id, values, c);
  model.parameters.resize(first);
  model.set.terms.back().coefficient = size;
  model.parameters.push_back(
      {flexcomp::host::name(id) + ".size", flexcomp::host::unit::si, {model.set.terms.size() - 1}, {}});
}

std::vector<double> nodes_of(const Case& c, Covariate kind, unsigned joint) {
  if (kind == Covariate::payload) return {0, c.robot.nominal.payload_kg};
  if (kind == Covariate::temperature) return {15, 35};
  const flexcomp::JointLimits& l = c.robot.nominal.limits[joint - 1];
  constexpr std::size_t count = 64;
  std::vector<double> nodes;
  for (std::size_t k = 0; k < count; ++k)
    nodes.push_back(l.min_rad + (l.max_rad - l.min_rad) * static_cast<double>(k) / (count - 1));
  return nodes;
}

}  // namespace

void append_hidden(ParametricModel& model, const Case& c, bool with_values) {
  for (const Effect& e : c.hidden) {
    append_values(model, e.id, with_values ? e.values : std::vector<double>(e.values.size(), 0.0), c);
  }
  if (c.bump) {
    EffectId id;
    id.effect = Kind::joint_curve;
    id.joint = c.bump->joint;
    id.coefficients = 256;
    std::vector<double> values;
    for (std::size_t k = 0; k < id.coefficients; ++k) {
      const double step = turn / static_cast<double>(id.coefficients);
      const double q = step * static_cast<double>(k);
      // The spline smooths by a sixth of the second difference: take it away beforehand.
      const double f = c.bump->at(q);
      values.push_back(f - (c.bump->at(q + step) - 2 * f + c.bump->at(q - step)) / 6);
    }
    append_shape(model, id, values, with_values ? 1 : 0, c);
  }
  if (c.outside) {
    EffectId id;
    id.effect = Kind::unnamed;
    id.place = {static_cast<std::uint8_t>(c.outside->joint), flexcomp::slot::theta};
    id.covariate = c.outside->covariate;
    id.covariate_joint = c.outside->covariate_joint;
    for (std::size_t side = 0; side < 2; ++side)
      id.node[side] = nodes_of(c, id.covariate[side], id.covariate_joint[side]);
    std::vector<double> values;
    for (const double x : id.node[0]) {
      for (const double y : id.node[1]) values.push_back(c.outside->amplitude_rad * c.outside->shape(x, y));
    }
    append_shape(model, id, values, with_values ? 1 : 0, c);
  }
}

flexcomp::host::TermSet terms_of(const Case& c) {
  namespace slot = flexcomp::slot;
  ParametricModel model;
  const auto constant = [&](flexcomp::Place place, double value) {
    if (value == 0) return;
    flexcomp::Term<double> t;
    t.place = place;
    t.coefficient = value;
    model.set.terms.push_back(t);
  };
  for (std::size_t i = 0; i < 6; ++i) {
    const plain::Link& l = c.truth.geometric[i];
    constant(arms::on_link(i + 1, slot::theta), l.theta);
    constant(arms::on_link(i + 1, slot::d), l.d);
    constant(arms::on_link(i + 1, slot::a), l.a);
    constant(arms::on_link(i + 1, slot::alpha), l.alpha);
    constant(arms::on_link(i + 1, slot::beta), l.beta);
  }
  for (std::uint8_t k = 0; k < 6; ++k) constant(arms::on_base(k), plain::six(c.truth.base)[k]);
  for (const plain::JointCompliance& x : c.truth.joint_compliance) {
    EffectId id;
    id.effect = Kind::joint_compliance;
    id.joint = static_cast<unsigned>(x.joint);
    append_values(model, id, {x.rad_per_nm}, c);
  }
  for (const plain::LinkGravity& x : c.truth.link_gravity) {
    EffectId id;
    id.effect = Kind::link_gravity;
    append_values(model, id, {x.k1, x.k2, x.k3}, c);
  }
  append_hidden(model, c, true);
  return model.set;
}

void dump(const Case& c, const std::string& folder) {
  namespace host = flexcomp::host;
  const auto save_rows = [&](const std::string& file, const std::vector<Observation>& rows,
                             std::size_t first) {
    host::MeasuredData data;
    data.kind = host::MeasurementKind::pose;
    data.columns = c.columns;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      host::Measurement m;
      m.line = k + 2;
      m.q_rad = rows[k].q_rad;
      m.context = rows[k].context;
      m.position_m = rows[k].p_m;
      m.orientation = Eigen::Quaterniond(rows[k].R).normalized();
      if (m.orientation.w() < 0) m.orientation.coeffs() *= -1;
      for (std::size_t j = 0; j < 6; ++j) m.move_rad[j] = c.move_rad[6 * (first + k) + j];
      m.position_sigma_m = c.robot.position_sigma_m;
      m.orientation_sigma_rad = c.robot.orientation_sigma_rad;
      data.rows.push_back(m);
    }
    host::save_data(folder + "/" + file, data);
  };
  save_rows("D.csv", c.train, 0);
  save_rows("H.csv", c.held_out, c.train.size());
  host::write_file(folder + "/R.yaml", host::robot_text(c.robot, {}));
  host::Calibration truth;
  truth.terms = terms_of(c);
  host::write_file(folder + "/T.yaml", "# " + c.what + "\n" + host::calibration_text(truth, c.robot));
}

}  // namespace hidden
