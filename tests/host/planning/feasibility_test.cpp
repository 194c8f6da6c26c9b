// SPDX-License-Identifier: Apache-2.0
#include "planning/feasibility.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>
#include <thread>

#include "planning/segments.hpp"
#include "support/robot_files.hpp"
#include "support/text_file.hpp"

namespace {

using namespace flexcomp::host;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using Joints = std::array<double, 6>;
using V = Eigen::Vector3d;

#if defined(__SANITIZE_ADDRESS__)
constexpr int poses_per_cell = 2000;
constexpr int judge_samples = 200;
#else
constexpr int poses_per_cell = 72000;
constexpr int judge_samples = 1000;
#endif

/// Numbers of a seed.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double operator()(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  V vector(double size) { return {(*this)(-size, size), (*this)(-size, size), (*this)(-size, size)}; }
  Joints pose(const Robot& robot, double beyond = 0) {
    Joints q;
    for (std::size_t j = 0; j < 6; ++j) {
      q[j] = (*this)(robot.nominal.limits[j].min_rad - beyond, robot.nominal.limits[j].max_rad + beyond);
    }
    return q;
  }

 private:
  std::mt19937_64 engine_;
};

// ---------------------------------------------------------------------------------------------------------------------
// Distances of segments.

double to_segment(const V& p, const V& a, const V& b) {
  const double length = (b - a).norm();
  if (length == 0) return (p - a).norm();
  const V direction = (b - a) / length;
  return (p - a - direction * std::min(std::max(direction.dot(p - a), 0.0), length)).norm();
}

/// The distance to a segment is convex along a line: three-part search, which knows nothing of perpendiculars.
double searched(const Segment& a, const Segment& b, int steps = 120) {
  double low = 0;
  double high = 1;
  const auto at = [&](double s) { return to_segment(a.from + s * (a.to - a.from), b.from, b.to); };
  for (int k = 0; k < steps; ++k) {
    const double s = low + (high - low) / 3;
    const double t = high - (high - low) / 3;
    (at(s) < at(t) ? high : low) = at(s) < at(t) ? t : s;
  }
  return std::min(std::min(at(0), at(1)), at((low + high) / 2));
}

double distance(const Segment& a, const Segment& b) { return std::sqrt(squared_distance(a, b)); }

TEST(Segments, ByHand) {
  const Segment x{{0, 0, 0}, {2, 0, 0}};
  EXPECT_EQ(distance(x, {{1, 3, -1}, {1, 3, 1}}), 3);   // perpendicular, above the inside
  EXPECT_EQ(distance(x, {{1, -1, 0}, {1, 1, 0}}), 0);   // crossing
  EXPECT_EQ(distance(x, {{2, 0, 0}, {2, 5, 0}}), 0);    // touching at an end
  EXPECT_EQ(distance(x, {{0, 1, 0}, {2, 1, 0}}), 1);    // parallel, side by side
  EXPECT_EQ(distance(x, {{1, 1, 0}, {9, 1, 0}}), 1);    // parallel, overlapping
  EXPECT_EQ(distance(x, {{9, 1, 0}, {1, 1, 0}}), 1);    // the other way round
  EXPECT_EQ(distance(x, {{5, 4, 0}, {9, 4, 0}}), 5);    // parallel, apart
  EXPECT_EQ(distance(x, {{-3, 4, 0}, {-9, 4, 0}}), 5);  // before
  EXPECT_EQ(distance(x, {{3, 0, 0}, {4, 0, 0}}), 1);    // on one line
  EXPECT_EQ(distance(x, {{1, 0, 0}, {4, 0, 0}}), 0);    // on one line, overlapping
  EXPECT_EQ(distance(x, {{1, 2, 0}, {1, 2, 0}}), 2);    // a point
  EXPECT_EQ(distance({{1, 2, 0}, {1, 2, 0}}, x), 2);
  EXPECT_EQ(distance({{1, 2, 2}, {1, 2, 2}}, {{1, 2, 0}, {1, 2, 0}}), 2);  // two points
  EXPECT_EQ(distance(x, x), 0);
}

TEST(Segments, AgreeWithASearchHoweverTheyLie) {
  Random random(11);
  double worst = 0;
  for (int k = 0; k < 40000; ++k) {
    Segment a{random.vector(1), random.vector(1)};
    Segment b{random.vector(1), random.vector(1)};
    const V u = a.to - a.from;
    switch (k % 8) {
      case 1:  // parallel
        b.to = b.from + random(-2, 2) * u;
        break;
      case 2:  // nearly so
        b.to = b.from + random(-2, 2) * u + std::pow(10, random(-14, -2)) * random.vector(1);
        break;
      case 3:  // nearly on one line
        b.from = a.from + random(-2, 2) * u + 1e-9 * random.vector(1);
        b.to = a.from + random(-2, 2) * u + 1e-9 * random.vector(1);
        break;
      case 4:  // short
        b.to = b.from + std::pow(10, random(-16, -1)) * random.vector(1);
        break;
      case 5:  // points
        b.to = b.from;
        if (k % 16 == 5) a.to = a.from;
        break;
      case 6: {  // crossing
        const V at = a.from + random(0, 1) * u;
        const V v = random.vector(1);
        b = {at - random(0, 1) * v, at + random(0, 1) * v};
        break;
      }
      case 7:  // a floor as a thick capsule, far away
        b = {{-3, 0, -1001}, {3, 0, -1001}};
        break;
      default:
        break;
    }
    const double d = distance(a, b);
    const double s = searched(a, b);
    const double size = 1 + d;
    ASSERT_NEAR(d, distance(b, a), 1e-14 * size) << k;
    // What the search finds is a distance of two points of them, so it can only be too long. Lines that cross at 1e-9 rad
    // (case 3) are found to two nanometres.
    ASSERT_LE(d, s + (k % 8 == 3 ? 2e-9 : 1e-12) * size) << k;
    worst = std::max(worst, (s - d) / size);
    ASSERT_GE(d, s - 5e-9 * size) << k;
  }
  std::printf("largest difference from the search %.1e\n", worst);
}

// ---------------------------------------------------------------------------------------------------------------------
// A judge that shares nothing with the tested code but the files' structs: Eq. 1 as five matrices a link, distances by
// halving segments until a bound decides.

Eigen::Matrix4d turn(double angle, const V& axis) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
  return m;
}

Eigen::Matrix4d shift(double x, double y, double z) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topRightCorner<3, 1>() = V(x, y, z);
  return m;
}

V apply(const Eigen::Matrix4d& m, const V& p) {
  return m.topLeftCorner<3, 3>() * p + m.topRightCorner<3, 1>();
}

std::array<Eigen::Matrix4d, 8> chain(const Robot& robot, const Joints& q) {
  std::array<Eigen::Matrix4d, 8> frames;
  frames[0].setIdentity();
  for (std::size_t i = 0; i < 6; ++i) {
    const flexcomp::NominalLink& l = robot.nominal.links[i];
    frames[i + 1] = frames[i] * turn(l.theta_rad + q[i], V::UnitZ()) * shift(0, 0, l.d_m) *
                    shift(l.a_m, 0, 0) * turn(l.alpha_rad, V::UnitX());
    if (l.beta_rad != 0) frames[i + 1] *= turn(l.beta_rad, V::UnitY());
  }
  const auto& t = robot.nominal.tool_xyz_m;
  const auto& w = robot.nominal.tool_wxyz;
  Eigen::Matrix4d tool = shift(t[0], t[1], t[2]);
  tool.topLeftCorner<3, 3>() = Eigen::Quaterniond(w[0], w[1], w[2], w[3]).toRotationMatrix();
  frames[7] = frames[6] * tool;
  return frames;
}

enum class Verdict { clear, undecided, violated };

Verdict worse(Verdict a, Verdict b) { return std::max(a, b); }

/// Whether all of segment a is farther than `needed` from b. Half a piece's length bounds what its middle does not see.
Verdict farther(const Segment& a, const Segment& b, double needed, double low = 0, double high = 1) {
  const double half = 0.5 * (high - low) * (a.to - a.from).norm();
  const double d = to_segment(a.from + 0.5 * (low + high) * (a.to - a.from), b.from, b.to);
  if (d < needed - 1e-9) return Verdict::violated;
  if (d - half > needed + 1e-9) return Verdict::clear;
  if (half < 1e-10) return Verdict::undecided;
  const Verdict left = farther(a, b, needed, low, 0.5 * (low + high));
  if (left == Verdict::violated) return left;
  return worse(left, farther(a, b, needed, 0.5 * (low + high), high));
}

class Judge {
 public:
  Judge(const Robot& robot, const Cell& cell) : robot_(robot), cell_(cell), bodies_(robot.capsules) {
    bodies_.insert(bodies_.end(), cell.obstacles.begin(), cell.obstacles.end());
    reflectors_ = robot.reflectors_m;
    if (reflectors_.empty()) reflectors_.push_back(V::Zero());
    Random random(99);
    std::vector<std::array<Eigen::Matrix4d, 8>> samples;
    for (int k = 0; k < judge_samples; ++k) samples.push_back(chain(robot, random.pose(robot)));
    const std::size_t own = robot.capsules.size();
    for (std::size_t i = 0; i < own; ++i) {
      for (std::size_t j = i + 1; j < bodies_.size(); ++j) {
        double least = 1e9;
        double most = 0;
        for (const auto& frames : samples) {
          const double d = searched(axis(i, frames), axis(j, frames), 40);
          least = std::min(least, d);
          most = std::max(most, d);
        }
        bool tested = most - least > 1e-5;
        if (j < own) {
          const std::size_t f = std::min(bodies_[i].frame, bodies_[j].frame);
          const std::size_t g = std::max(bodies_[i].frame, bodies_[j].frame);
          const bool between = std::ranges::any_of(
              robot.capsules, [&](const Capsule& c) { return c.frame > f && c.frame < g; });
          tested = tested && f != g && between && most > bodies_[i].radius_m + bodies_[j].radius_m;
        }
        if (tested) pairs_.push_back({i, j});
      }
    }
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      for (std::size_t k = 0; k < reflectors_.size(); ++k) {
        double ball = 0;
        double arm = 0;
        for (const auto& frames : samples) {
          const V at = apply(frames[7], reflectors_[k]);
          const Segment line = axis(i, frames);
          ball = std::max(ball, to_segment(at, line.from, line.to));
          arm = std::max(arm, searched({apply(frames[7], V::Zero()), at}, line, 40));
        }
        const bool fixed = bodies_[i].frame == 0;
        ball_.push_back(clearance(bodies_[i].radius_m, fixed ? 1e9 : ball));
        arm_.push_back(robot.reflectors_m.empty() ? -1 : clearance(bodies_[i].radius_m, fixed ? 1e9 : arm));
      }
    }
  }

  /// Indexed by Obstruction.
  std::array<Verdict, 6> operator()(const Joints& q) const {
    std::array<Verdict, 6> v{};
    const auto put = [&v](Obstruction o, Verdict verdict) {
      v[static_cast<std::size_t>(o)] = worse(v[static_cast<std::size_t>(o)], verdict);
    };
    for (std::size_t j = 0; j < 6; ++j) {
      if (q[j] < robot_.nominal.limits[j].min_rad || q[j] > robot_.nominal.limits[j].max_rad)
        put(Obstruction::joint_limit, Verdict::violated);
    }
    const auto frames = chain(robot_, q);
    for (const auto& [i, j] : pairs_) {
      put(Obstruction::bodies_touch,
          farther(axis(i, frames), axis(j, frames), bodies_[i].radius_m + bodies_[j].radius_m));
    }
    const V centre = apply(frames[7], V::Zero());
    for (std::size_t k = 0; k < reflectors_.size(); ++k) {
      const V at = apply(frames[7], reflectors_[k]);
      for (std::size_t i = 0; i < bodies_.size(); ++i) {
        const Segment line = axis(i, frames);
        const double ball = ball_[i * reflectors_.size() + k];
        const double arm = arm_[i * reflectors_.size() + k];
        if (bodies_[i].frame != 6) {
          if (ball >= 0) put(Obstruction::tool_too_near, farther({at, at}, line, ball));
          if (arm >= 0) put(Obstruction::tool_too_near, farther({centre, at}, line, arm));
        }
        if (cell_.tracker_m && ball >= 0)
          put(Obstruction::beam_blocked, farther({*cell_.tracker_m, at}, line, ball));
      }
      if (!cell_.tracker_m) continue;
      // The angle by its tangent, not its cosine.
      const V beam = at - *cell_.tracker_m;
      const V n = -frames[7].block<3, 1>(0, 2);
      const double angle = std::atan2(n.cross(beam).norm(), n.dot(beam));
      put(Obstruction::facing_away, angle > cell_.acceptance_rad + 1e-9   ? Verdict::violated
                                    : angle > cell_.acceptance_rad - 1e-9 ? Verdict::undecided
                                                                          : Verdict::clear);
    }
    return v;
  }

 private:
  double clearance(double radius, double most) const {
    for (const double s : {cell_.safety, std::min(cell_.safety, 1.0), 0.0}) {
      if (most > radius + s * cell_.smr_radius_m) return radius + s * cell_.smr_radius_m;
    }
    return -1;
  }
  Segment axis(std::size_t i, const std::array<Eigen::Matrix4d, 8>& frames) const {
    return {apply(frames[bodies_[i].frame], bodies_[i].from_m),
            apply(frames[bodies_[i].frame], bodies_[i].to_m)};
  }

  const Robot& robot_;
  const Cell& cell_;
  std::vector<Capsule> bodies_;
  std::vector<V> reflectors_;
  std::vector<std::pair<std::size_t, std::size_t>> pairs_;
  std::vector<double> ball_;
  std::vector<double> arm_;
};

Capsule capsule(std::size_t frame, const V& from, const V& to, double radius) {
  return {frame, from, to, radius};
}

/// TX60L, RX160L and UR10, and each once more with a turned tool, three or no reflectors, bodies on wrist and flange and
/// a link with beta.
std::vector<Robot> arms() {
  std::vector<Robot> list;
  for (const char* name : {"tx60l", "rx160l", "ur10"}) {
    list.push_back(support::robot(name));
    Robot other = list.back();
    other.nominal.tool_xyz_m = {0.02, -0.01, 0.16};
    other.nominal.tool_wxyz = {0.8, 0.36, -0.48, 0.0};
    other.reflectors_m = {{0, -0.1, 0.02}, {-0.09, 0, 0}, {0, 0.12, 0}};
    if (list.size() == 5) other.reflectors_m.clear();
    other.nominal.links[1].beta_rad = 0.02;
    other.capsules.push_back(capsule(5, {0, 0, -0.03}, {0, 0, 0.01}, 0.05));
    other.capsules.push_back(capsule(6, {0, 0, -0.02}, {0, 0, 0.03}, 0.04));
    list.push_back(other);
  }
  list[2].reflectors_m = {{0, -0.15, 0}, {-0.15, 0, 0}, {0, 0.15, 0}, {0.15, 0, 0}};
  return list;
}

TEST(Feasibility, AgreesWithBruteForce) {
  const std::vector<Robot> all = arms();
  std::array<std::size_t, 6> frequency{};
  std::size_t undecided = 0;
  std::size_t poses = 0;
  double seconds = 0;
  for (std::size_t n = 0; n < 14; ++n) {
    const Robot& robot = all[n % all.size()];
    const double reach = n % all.size() < 2 ? 0.9 : 1.6;
    Random random(100 + n);
    Cell cell;
    cell.path = "cell.yaml";
    if (n != 12) cell.tracker_m = V(random(1.5, 4), random(-2, 2), random(-1, 2));
    for (int k = 0; k < 3; ++k) {
      const V at = V(random(0.6, 1), 0, 0) * reach;
      const V from = Eigen::AngleAxisd(random(-3, 3), V::UnitZ()) * at + V(0, 0, random(-1, 1));
      cell.obstacles.push_back(
          capsule(0, from, k == 0 ? from : V(from + random.vector(0.5)), random(0.02, 0.2)));
    }
    if (n >= 4) {
      cell.safety = random(0, 4);
      cell.acceptance_rad = random(0.5, pi);
    }
    const Feasibility feasibility(robot, cell);
    const Judge judge(robot, cell);
    for (int k = 0; k < poses_per_cell; ++k) {
      const Joints q = random.pose(robot, k % 20 == 0 ? 0.2 : 0);
      const auto start = std::chrono::steady_clock::now();
      const Obstruction found = feasibility.check(q);
      seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      const std::array<Verdict, 6> verdict = judge(q);
      ++frequency[static_cast<std::size_t>(found)];
      ++poses;
      for (const Obstruction o :
           {Obstruction::joint_limit, Obstruction::facing_away, Obstruction::bodies_touch,
            Obstruction::tool_too_near, Obstruction::beam_blocked}) {
        const Verdict v = verdict[static_cast<std::size_t>(o)];
        undecided += v == Verdict::undecided ? 1U : 0U;
        if (o == found) {
          ASSERT_NE(v, Verdict::clear)
              << "refused without reason, cell " << n << ", pose " << k << ": " << feasibility.why(q);
          break;  // the first reason is told, later ones may stand as well
        }
        ASSERT_NE(v, Verdict::violated)
            << name_of(o) << " overlooked (" << name_of(found) << "), cell " << n << ", pose " << k;
      }
      ASSERT_EQ(feasibility.why(q).empty(), found == Obstruction::none);
    }
  }
  std::printf("%zu poses, %zu undecided, %.2f us a call:", poses, undecided,
              1e6 * seconds / static_cast<double>(poses));
  for (std::size_t k = 0; k < 6; ++k) {
    std::printf(" %s %zu,", name_of(static_cast<Obstruction>(k)).c_str(), frequency[k]);
    EXPECT_GT(frequency[k], poses / 200) << name_of(static_cast<Obstruction>(k));  // none is decoration
  }
  std::printf("\n");
  EXPECT_LT(undecided, poses / 10000 + 1);
}

// ---------------------------------------------------------------------------------------------------------------------
// Single rules.

Cell in_front() {
  Cell cell;
  cell.path = "cell.yaml";
  cell.tracker_m = V(3, 0, 0.5);
  return cell;
}

/// Arm bent forward, flange towards the tracker: shoulder 30, elbow 60 degrees put the forearm level.
Joints towards_tracker() { return {0, radians(30), radians(60), 0, 0, 0}; }

TEST(Feasibility, APoseTowardsTheTrackerIsAllowed) {
  const Feasibility f(support::robot("tx60l"), in_front());
  EXPECT_EQ(f.check(towards_tracker()), Obstruction::none) << f.why(towards_tracker());
  EXPECT_EQ(f.why(towards_tracker()), "");
}

TEST(Feasibility, LimitsIncludeTheirEndsAndNoNan) {
  const Robot robot = support::robot("tx60l");
  const Feasibility f(robot);
  Joints q{0, 0, 0, 0, robot.nominal.limits[4].max_rad, 0};
  EXPECT_NE(f.check(q), Obstruction::joint_limit);
  q[4] = std::nextafter(q[4], 10);
  EXPECT_EQ(f.check(q), Obstruction::joint_limit);
  q[4] = -3;
  EXPECT_THAT(f.why(q), HasSubstr("joint 5 at -171.887 deg is beyond its limit of -122.500 deg"));
  q[4] = std::nan("");
  EXPECT_EQ(f.check(q), Obstruction::joint_limit);
}

TEST(Feasibility, AcceptanceIsTheAngleOfTheBeam) {
  Robot robot = support::robot("tx60l");
  robot.capsules.clear();
  robot.reflectors_m.clear();  // one point, so that one angle says all
  robot.nominal.tool_xyz_m = {0, 0, 0.1};
  Cell cell = in_front();
  const Joints q = towards_tracker();
  // The flange looks along +X from this point: the tracker goes round it.
  const V at = apply(chain(robot, q)[7], V::Zero());
  for (const double acceptance : {30.0, 60.0, 90.0, 120.0}) {
    cell.acceptance_rad = radians(acceptance);
    for (const double off : {-1.0, 1.0}) {
      const double angle = radians(acceptance + off);
      cell.tracker_m = at + 2 * V(std::cos(angle), 0, std::sin(angle));
      EXPECT_EQ(Feasibility(robot, cell).check(q), off < 0 ? Obstruction::none : Obstruction::facing_away);
    }
    EXPECT_THAT(Feasibility(robot, cell).why(q), HasSubstr("deg from straight on"));
  }
}

TEST(Feasibility, EveryReflectorMustBeSeen) {
  Robot robot = support::robot("tx60l");
  const Joints q = towards_tracker();
  Cell cell = in_front();
  const auto frames = chain(robot, q);
  for (std::size_t k = 0; k < 4; ++k) {
    const V at = apply(frames[7], robot.reflectors_m[k]);
    cell.obstacles = {capsule(0, at + 0.8 * (*cell.tracker_m - at), at + 0.8 * (*cell.tracker_m - at), 1e-3)};
    cell.safety = 0.2;  // so thin that the other beams pass
    const Feasibility f(robot, cell);
    EXPECT_EQ(f.check(q), Obstruction::beam_blocked);
    EXPECT_THAT(f.why(q), HasSubstr(std::string("the beam to reflector ") + "ABCD"[k] + " passes 0.0 mm"));
    EXPECT_THAT(f.why(q), HasSubstr("obstacles[1] of cell.yaml"));
  }
}

TEST(Feasibility, TouchingIsTooNear) {
  const Robot robot = support::robot("tx60l");
  const Joints q = towards_tracker();
  const auto frames = chain(robot, q);
  const V elbow = apply(frames[3], V(0, 0, 0));
  // A ball above the forearm's middle: arm and ball touch where their radii fill the distance.
  const V ball = apply(frames[3], V(0, 0, 0.2)) + V(0, 0, 0.3);
  ASSERT_NEAR((ball - elbow).norm(), std::hypot(0.2, 0.3), 1e-12);
  for (const double gap : {-1e-9, 1e-9}) {
    Cell cell;
    cell.path = "cell.yaml";
    cell.obstacles = {capsule(0, ball, ball, 0.3 - 0.095 - gap)};
    const Feasibility f(robot, cell);
    EXPECT_EQ(f.check(q), gap > 0 ? Obstruction::none : Obstruction::bodies_touch) << f.why(q);
  }
  // Exactly, where rounding has no part: a body of a frame that stands at q = 0.
  Robot plain = robot;
  for (flexcomp::NominalLink& l : plain.nominal.links) l = {};
  plain.capsules = {capsule(2, {1, 0, 0}, {1, 0, 1}, 0.25)};
  Cell cell;
  cell.obstacles = {capsule(0, {1.5, 0, 0.5}, {1.5, 1, 0.5}, 0.25)};
  EXPECT_EQ(Feasibility(plain, cell).check({}), Obstruction::bodies_touch);
  cell.obstacles[0].radius_m = 0.25 - 0x1p-50;
  EXPECT_NE(Feasibility(plain, cell).check({}), Obstruction::bodies_touch);
}

TEST(Feasibility, AToolBesideTheWristIsAskedForLessAndSaysSo) {
  // Reflector A of the reference tool is sqrt(10² + 45² + 130²) = 137.9 mm from the wrist's centre, always.
  const Feasibility f(support::robot("tx60l"), in_front());
  ASSERT_EQ(f.warnings().size(), 1U);
  EXPECT_THAT(f.warnings()[0], HasSubstr("capsules[3] of"));
  EXPECT_THAT(f.warnings()[0],
              HasSubstr("Kept instead; 1: reflector A, arm A, reflector B, arm B, arm C, arm D."));
  Cell modest = in_front();
  modest.safety = 1;
  EXPECT_THAT(Feasibility(support::robot("tx60l"), modest).warnings(), IsEmpty());
  Robot longer = support::robot("tx60l");
  longer.nominal.tool_xyz_m = {0, 0, 0.1};
  EXPECT_THAT(Feasibility(longer, in_front()).warnings(), IsEmpty());
}

TEST(Feasibility, ABodyOnTheFlangeDoesNotForbidItsOwnTool) {
  Robot robot = support::robot("tx60l");
  robot.nominal.tool_xyz_m = {0, 0, 0.1};
  robot.capsules.push_back(capsule(6, {0, 0, -0.02}, {0, 0, 0.05}, 0.06));
  EXPECT_EQ(Feasibility(robot, in_front()).check(towards_tracker()), Obstruction::none);
  robot.capsules.back().to_m = {0, 0, 0.12};  // through the middle of the tool
  const Feasibility f(robot, in_front());
  EXPECT_EQ(f.check(towards_tracker()), Obstruction::none) << f.why(towards_tracker());
  EXPECT_THAT(f.warnings(), Contains(HasSubstr("capsules[4] of")));
}

TEST(Feasibility, BodiesThatBelongTogetherDoNotForbidEveryPose) {
  // Column and upper arm overlap at the shoulder; a second body on the upper arm, one on the shoulder, a pedestal.
  Robot robot = support::robot("tx60l");
  robot.capsules.push_back(capsule(2, {-0.3, 0, 0}, {-0.1, 0, 0}, 0.1));
  robot.capsules.push_back(capsule(1, {0, 0, -0.1}, {0, 0, 0.1}, 0.12));
  Cell cell = in_front();
  cell.obstacles = {capsule(0, {0, 0, -0.6}, {0, 0, -0.3}, 0.2)};
  const Feasibility f(robot, cell);
  EXPECT_EQ(f.check(towards_tracker()), Obstruction::none) << f.why(towards_tracker());
  // Folded back, the forearm meets the column.
  const Joints folded{0, radians(125), radians(140), 0, 0, 0};
  EXPECT_EQ(Feasibility(robot).check(folded), Obstruction::bodies_touch);
  EXPECT_THAT(Feasibility(robot).why(folded), HasSubstr("capsules[1] of"));
  EXPECT_THAT(Feasibility(robot).why(folded), HasSubstr("capsules[3] of"));
}

TEST(Feasibility, ATrackerInsideABodySeesNothingAndSaysWhy) {
  const Robot robot = support::robot("tx60l");
  Cell cell = in_front();
  cell.obstacles = {capsule(0, *cell.tracker_m - V(0, 0, 1), *cell.tracker_m - V(0, 0, 0.1), 0.15)};
  const Feasibility f(robot, cell);
  EXPECT_THAT(f.warnings(), Contains(HasSubstr("tracker_mm is 100.0 mm from the axis of obstacles[1]")));
  EXPECT_EQ(f.check(towards_tracker()), Obstruction::beam_blocked);
  cell.obstacles[0].to_m = *cell.tracker_m;  // exactly inside
  EXPECT_EQ(Feasibility(robot, cell).check(towards_tracker()), Obstruction::beam_blocked);
  cell.obstacles.clear();
  cell.tracker_m =
      apply(chain(robot, towards_tracker())[7], robot.reflectors_m[0]);  // at a reflector: no direction
  EXPECT_NO_THROW(Feasibility(robot, cell).why(towards_tracker()));
}

TEST(Feasibility, WhatIsNotTestedIsSaid) {
  Robot robot = support::robot("tx60l");
  robot.capsules.clear();
  const Feasibility bare(robot);
  EXPECT_THAT(bare.warnings(), Contains(HasSubstr("no capsules")));
  EXPECT_THAT(bare.warnings(), Contains(HasSubstr("neither beam nor angle")));
  EXPECT_EQ(bare.source(), robot.path);
  Random random(5);
  for (int k = 0; k < 1000; ++k) EXPECT_TRUE(bare.allows(random.pose(robot)));
  robot.reflectors_m.clear();
  const Feasibility point(robot, in_front());
  EXPECT_THAT(point.warnings(), Contains(HasSubstr("the tool point is tested as the reflector")));
  EXPECT_EQ(point.source(), "cell.yaml");
  EXPECT_THAT(point.why({0, 0, 0, 0, radians(-120), 0}), HasSubstr("the tool point"));
}

TEST(Feasibility, FeasiblePosesAreFeasibleAndRepeatable) {
  const Robot robot = support::robot("tx60l");
  const Feasibility f(robot, in_front());
  const auto poses = feasible_poses(f, robot, 2000, 7);
  ASSERT_EQ(poses.size(), 2000U);
  for (const Joints& q : poses) EXPECT_TRUE(f.allows(q)) << f.why(q);
  EXPECT_EQ(poses, feasible_poses(f, robot, 2000, 7));
  EXPECT_NE(poses, feasible_poses(f, robot, 2000, 8));
  EXPECT_TRUE(feasible_poses(f, robot, 0, 7).empty());
  // Joint 4 is free of everything but the wrist's own symmetry: all of its range comes up.
  double least = 10;
  double most = -10;
  for (const Joints& q : poses) {
    least = std::min(least, q[3]);
    most = std::max(most, q[3]);
  }
  EXPECT_LT(least, radians(-260));
  EXPECT_GT(most, radians(260));
}

TEST(Feasibility, NoRoomIsAnErrorThatSaysWhatWasInTheWay) {
  const Robot robot = support::robot("tx60l");
  Cell cell = in_front();
  cell.acceptance_rad = radians(0.5);
  support::expect_refused(
      [&] { feasible_poses(Feasibility(robot, cell), robot, 14, 1); }, 0, "",
      {"cell.yaml", "a cell with 14 feasible poses", "% reflectors face away", "random poses"});
  cell = in_front();
  cell.obstacles = {capsule(0, *cell.tracker_m, *cell.tracker_m, 0.1)};
  support::expect_refused([&] { feasible_poses(Feasibility(robot, cell), robot, 1, 1); }, 0, "",
                          {"% beam blocked", "0 among"});
}

TEST(Feasibility, ManyThreadsMayAsk) {
  const Robot robot = support::robot("ur10");
  const Feasibility f(robot, in_front());
  Random random(3);
  std::vector<Joints> poses;
  for (int k = 0; k < 5000; ++k) poses.push_back(random.pose(robot));
  const auto ask = [&] {
    std::vector<Obstruction> answers;
    for (const Joints& q : poses) answers.push_back(f.check(q));
    return answers;
  };
  const std::vector<Obstruction> alone = ask();
  std::array<std::vector<Obstruction>, 4> answers;
  std::vector<std::thread> threads;
  for (auto& a : answers) threads.emplace_back([&a, &ask] { a = ask(); });
  for (std::thread& t : threads) t.join();
  for (const auto& a : answers) EXPECT_EQ(a, alone);
}

TEST(Feasibility, BodiesOfTheRobotFilesHangTogether) {
  // Each body begins inside the one before it, however the arm stands: a wrong frame or sign would tear them apart.
  Random random(21);
  for (const char* name : {"tx60l", "rx160l", "ur5", "ur10"}) {
    const Robot robot = support::robot(name);
    ASSERT_GE(robot.capsules.size(), 3U);
    for (int k = 0; k < 200; ++k) {
      const auto frames = chain(robot, random.pose(robot));
      for (std::size_t i = 0; i + 1 < robot.capsules.size(); ++i) {
        const Capsule& a = robot.capsules[i];
        const Capsule& b = robot.capsules[i + 1];
        const V start = apply(frames[b.frame], b.from_m);
        ASSERT_LT(to_segment(start, apply(frames[a.frame], a.from_m), apply(frames[a.frame], a.to_m)),
                  a.radius_m)
            << name << ", capsules " << i + 1 << " and " << i + 2;
      }
      // The last one ends at the wrist: not farther from the flange than link 6 is long.
      const Capsule& last = robot.capsules.back();
      ASSERT_LT((apply(frames[last.frame], last.to_m) - apply(frames[6], V::Zero())).norm(),
                robot.nominal.links[5].d_m + 1e-9)
          << name;
    }
  }
}

TEST(Feasibility, TheReferenceRobotHasThePapersBodies) {
  // Section 3.2: O_f1 O_1 375 mm, r 115; O_f2 O_f3 400 mm, r 88; O_3 O_4 450 mm, r 95.
  const Robot robot = support::robot("tx60l");
  const std::array<double, 3> length{0.375, 0.4, 0.45};
  const std::array<double, 3> radius{0.115, 0.088, 0.095};
  Random random(22);
  const auto frames = chain(robot, random.pose(robot));
  const auto at = [&](std::size_t k, bool end) {
    const Capsule& c = robot.capsules[k];
    return apply(frames[c.frame], end ? c.to_m : c.from_m);
  };
  ASSERT_EQ(robot.capsules.size(), 3U);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR((at(k, true) - at(k, false)).norm(), length[k], 1e-12);
    EXPECT_EQ(robot.capsules[k].radius_m, radius[k]);
  }
  EXPECT_NEAR((at(1, false) - at(0, true)).norm(), 0.02, 1e-12);  // the shoulder offset, along axis 2
  EXPECT_NEAR((at(2, false) - at(1, true)).norm(), 0, 1e-12);
  EXPECT_NEAR((at(2, true) - apply(frames[4], V::Zero())).norm(), 0, 1e-12);
}

TEST(Feasibility, BodiesAndLimitsDoNotMakeAnotherArm) {
  Robot robot = support::robot("rx160l");
  const auto hash = flexcomp::nominal_hash(robot.nominal);
  const std::string text = support::read(support::robots + "rx160l.yaml");
  const std::string without = text.substr(0, text.find("capsules:"));
  const Robot other =
      load_robot(support::write("other.yaml", support::replaced(without, "min_deg: -160", "min_deg: -100")));
  EXPECT_TRUE(other.capsules.empty());
  EXPECT_EQ(robot.capsules.size(), 5U);
  EXPECT_EQ(flexcomp::nominal_hash(other.nominal), hash);
}

}  // namespace
