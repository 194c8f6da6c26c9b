// SPDX-License-Identifier: Apache-2.0
#include "planning/feasibility.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "flexcomp/trigonometry.hpp"
#include "input_error.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

using Joints = std::array<double, joint_count>;

constexpr std::size_t sample_count = 4096;
constexpr std::uint64_t sample_seed = 1;
constexpr double not_tested = -1;

/// Random joint positions, uniform within the limits.
class RandomPoses {
 public:
  RandomPoses(const std::array<JointLimits, joint_count>& limits, std::uint64_t seed) : random_(seed) {
    for (std::size_t j = 0; j < joint_count; ++j) {
      position_[j] = std::uniform_real_distribution<double>(limits[j].min_rad, limits[j].max_rad);
    }
  }
  Joints operator()() {
    Joints q;
    for (std::size_t j = 0; j < joint_count; ++j) q[j] = position_[j](random_);
    return q;
  }

 private:
  std::mt19937_64 random_;
  std::array<std::uniform_real_distribution<double>, joint_count> position_;
};

bool nearer(double squared_m2, double clearance_m) {
  return clearance_m >= 0 && squared_m2 <= clearance_m * clearance_m;
}

}  // namespace

std::string name_of(Obstruction obstruction) {
  static constexpr std::array<const char*, 6> names{"allowed",      "beyond a joint limit",
                                                    "bodies touch", "tool too near to a body",
                                                    "beam blocked", "reflectors face away"};
  return names.at(static_cast<std::size_t>(obstruction));
}

Feasibility::Feasibility(const Robot& robot, const std::optional<Cell>& cell)
    : source_(cell ? cell->path : robot.path), limits_(robot.nominal.limits) {
  for (std::size_t i = 0; i < joint_count; ++i) {
    const NominalLink& link = robot.nominal.links[i];
    links_[i] = {sin_cos(link.theta_rad), sin_cos(link.alpha_rad), sin_cos(link.beta_rad), link.d_m, link.a_m,
                 link.beta_rad != 0};
  }
  const auto& [w, x, y, z] = robot.nominal.tool_wxyz;
  const Eigen::Matrix3d tool = Eigen::Quaterniond(w, x, y, z).toRotationMatrix();
  centre_ = Eigen::Vector3d(robot.nominal.tool_xyz_m.data());
  normal_ = tool.col(2);
  for (const Eigen::Vector3d& r : robot.reflectors_m) reflector_.emplace_back(centre_ + tool * r);
  tool_point_only_ = reflector_.empty();
  if (tool_point_only_) reflector_.push_back(centre_);
  for (const Eigen::Vector3d& r : reflector_) tool_radius_m_ = std::max(tool_radius_m_, (r - centre_).norm());

  const Cell settings = cell.value_or(Cell());
  tracker_m_ = settings.tracker_m;
  cos_acceptance_ = std::cos(settings.acceptance_rad);
  safety_ = settings.safety;
  smr_radius_m_ = settings.smr_radius_m;
  const auto add_bodies = [this](const std::vector<Capsule>& capsules, const std::string& list,
                                 const std::string& path, bool obstacles) {
    for (std::size_t k = 0; k < capsules.size(); ++k)
      bodies_.push_back({.capsule = capsules[k],
                         .name = fmt::format("{}[{}] of {}", list, k + 1, path),
                         .obstacle = obstacles,
                         .half_length_m = (capsules[k].to_m - capsules[k].from_m).norm() / 2});
  };
  add_bodies(robot.capsules, "capsules", robot.path, false);
  add_bodies(settings.obstacles, "obstacles", settings.path, true);

  if (robot.capsules.empty()) {
    warnings_.push_back(
        fmt::format("{}: no capsules: the arm has no bodies, collisions are not tested.", robot.path));
  }
  if (!tracker_m_) {
    warnings_.push_back(fmt::format("{}: no tracker_mm: neither beam nor angle of the reflectors is tested.",
                                    cell ? cell->path : "no cell file"));
  } else if (tool_point_only_) {
    warnings_.push_back(
        fmt::format("{}: no tool.reflectors_mm: the tool point is tested as the reflector.", robot.path));
  }
  std::vector<LinkFrames> samples(bodies_.empty() ? 0 : sample_count);
  RandomPoses random(limits_, sample_seed);
  for (LinkFrames& frames : samples) place(random(), frames);
  choose_pairs(robot, samples);
  choose_clearances(samples);
  warn_of_tracker();
}

/// Selects the pairs of bodies whose distance depends on the joints and may fall below their radii.
void Feasibility::choose_pairs(const Robot& robot, const std::vector<LinkFrames>& samples) {
  std::array<bool, joint_count + 1> occupied{};
  for (const Capsule& capsule : robot.capsules) occupied[capsule.frame] = true;
  const auto neighbours = [&](std::size_t f, std::size_t g) {
    for (std::size_t k = std::min(f, g) + 1; k < std::max(f, g); ++k) {
      if (occupied[k]) return false;
    }
    return true;
  };
  for (std::size_t i = 0; i < robot.capsules.size(); ++i) {
    for (std::size_t j = i + 1; j < bodies_.size(); ++j) {
      const std::size_t f = bodies_[i].capsule.frame;
      const std::size_t g = bodies_[j].capsule.frame;
      const bool obstacle = bodies_[j].obstacle;
      if (f == g || (!obstacle && neighbours(f, g))) continue;
      double least = std::numeric_limits<double>::infinity();
      double most = 0;
      for (const LinkFrames& frames : samples) {
        const double d = std::sqrt(squared_distance(placed(bodies_[i], frames), placed(bodies_[j], frames)));
        least = std::min(least, d);
        most = std::max(most, d);
      }
      const double touch = bodies_[i].capsule.radius_m + bodies_[j].capsule.radius_m;
      const bool fixed = most - least < 1e-9;
      if (!fixed && (obstacle || most > touch)) {
        pairs_.push_back({i, j});
      } else if (obstacle && most <= touch) {
        warnings_.push_back(fmt::format("{} and {} touch at every pose: not tested against each other.",
                                        bodies_[i].name, bodies_[j].name));
      }
    }
  }
}

/// Sets the clearance of reflectors, arms and beams from each body, Eq. (M48), relaxed where no pose can keep it.
void Feasibility::choose_clearances(const std::vector<LinkFrames>& samples) {
  for (Body& body : bodies_) {
    const bool moves_with_tool = body.capsule.frame == joint_count;
    const bool is_fixed = body.capsule.frame == 0;
    const double radius = body.capsule.radius_m;
    const std::array<double, 3> factors{safety_, std::min(safety_, 1.0), 0};
    std::array<std::vector<std::string>, 4> kept;  // by factor, the last: not tested
    const auto clearance = [&](double most, const std::string& part) {
      for (std::size_t n = 0; n < factors.size(); ++n) {
        const double needed = radius + factors[n] * smr_radius_m_;
        if (!is_fixed && !(most > needed)) continue;
        kept[n].push_back(part);
        return needed;
      }
      kept.back().push_back(part);
      return not_tested;
    };
    for (std::size_t k = 0; k < reflector_.size(); ++k) {
      double reflector = 0;
      double arm = 0;
      for (std::size_t n = 0; !is_fixed && n < samples.size(); ++n) {
        const Segment axis = placed(body, samples[n]);
        const Segment arm_axis{placed(centre_, samples[n]), placed(reflector_[k], samples[n])};
        reflector = std::max(reflector, squared_distance(arm_axis.to, axis));
        arm = std::max(arm, squared_distance(arm_axis, axis));
      }
      body.beam_clearance_m.push_back(
          tracker_m_ || !moves_with_tool ? clearance(std::sqrt(reflector), reflector_name(k)) : not_tested);
      body.reflector_clearance_m.push_back(moves_with_tool ? not_tested : body.beam_clearance_m.back());
      body.arm_clearance_m.push_back(moves_with_tool || tool_point_only_
                                         ? not_tested
                                         : clearance(std::sqrt(arm), fmt::format("arm {}", "ABCD"[k])));
    }
    body.largest_clearance_m = radius + safety_ * smr_radius_m_;
    std::string relaxed;
    for (std::size_t n = 1; n < kept.size(); ++n) {
      if (kept[n].empty()) continue;
      relaxed +=
          fmt::format("; {}: {}", n < factors.size() ? fmt::format("{:.3g}", factors[n]) : "not tested",
                      fmt::join(kept[n], ", "));
    }
    if (!relaxed.empty()) {
      warnings_.push_back(fmt::format(
          "{} is so near to the tool at every pose that not all of it can keep {:.3g} reflector radii away. "
          "Kept instead{}.",
          body.name, safety_, relaxed));
    }
  }
}

void Feasibility::warn_of_tracker() {
  if (!tracker_m_) return;
  for (const Body& body : bodies_) {
    if (body.capsule.frame != 0) continue;
    const double d = std::sqrt(squared_distance(*tracker_m_, {body.capsule.from_m, body.capsule.to_m}));
    if (!(d > body.largest_clearance_m)) {
      warnings_.push_back(
          fmt::format("{}: tracker_mm is {:.1f} mm from the axis of {}, and a beam must keep {:.1f} mm: "
                      "every pose is refused.",
                      source_, d * 1e3, body.name, body.largest_clearance_m * 1e3));
    }
  }
}

std::string Feasibility::reflector_name(std::size_t k) const {
  return tool_point_only_ ? "the tool point" : fmt::format("reflector {}", "ABCD"[k]);
}

void Feasibility::place(const Joints& q_rad, LinkFrames& frames) const {
  frames.rotation[0].setIdentity();
  frames.origin[0].setZero();
  for (std::size_t i = 0; i < joint_count; ++i) {
    const LinkShape<double>& link = links_[i];
    detail::advance<double>(frames.rotation[i], frames.origin[i], compose(sin_cos(q_rad[i]), link.offset),
                            link.d, link.a, link.alpha, link.has_beta ? &link.beta : nullptr, nullptr,
                            frames.rotation[i + 1], frames.origin[i + 1]);
  }
}

Segment Feasibility::placed(const Body& body, const LinkFrames& frames) const {
  const std::size_t f = body.capsule.frame;
  if (f == 0) return {body.capsule.from_m, body.capsule.to_m};
  return {frames.origin[f] + frames.rotation[f] * body.capsule.from_m,
          frames.origin[f] + frames.rotation[f] * body.capsule.to_m};
}

Eigen::Vector3d Feasibility::placed(const Eigen::Vector3d& in_flange_m, const LinkFrames& frames) const {
  return frames.origin[joint_count] + frames.rotation[joint_count] * in_flange_m;
}

bool Feasibility::find_facing(const LinkFrames& frames, Finding& finding) const {
  const Eigen::Vector3d normal = frames.rotation[joint_count] * normal_;
  for (std::size_t k = 0; k < reflector_.size(); ++k) {
    const Eigen::Vector3d beam = placed(reflector_[k], frames) - *tracker_m_;
    const double length = beam.norm();
    const double against = -normal.dot(beam);
    if (against >= cos_acceptance_ * length) continue;
    finding = {Obstruction::facing_away, k, 0, std::acos(std::clamp(against / length, -1.0, 1.0)),
               std::acos(cos_acceptance_)};
    return true;
  }
  return false;
}

bool Feasibility::find_collision(const Axes& axes, Finding& finding) const {
  for (const Pair& pair : pairs_) {
    const Body& a = bodies_[pair.first];
    const Body& b = bodies_[pair.second];
    const Segment& at = axes[pair.first];
    const Segment& bt = axes[pair.second];
    const double needed = a.capsule.radius_m + b.capsule.radius_m;
    // Bounding spheres first: most pairs are far apart.
    const double apart = 0.25 * (at.from + at.to - bt.from - bt.to).squaredNorm();
    if (!nearer(apart, needed + a.half_length_m + b.half_length_m)) continue;
    const double square = squared_distance(at, bt);
    if (!nearer(square, needed)) continue;
    finding = {Obstruction::bodies_touch, pair.first, pair.second, std::sqrt(square), needed};
    return true;
  }
  return false;
}

bool Feasibility::find_tool(const LinkFrames& frames, const Axes& axes, Finding& finding) const {
  const Eigen::Vector3d centre = placed(centre_, frames);
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const Body& body = bodies_[i];
    if (body.capsule.frame == joint_count) continue;
    const Segment& axis = axes[i];
    // No part of the tool is farther from its centre than this.
    if (!nearer(squared_distance(centre, axis), body.largest_clearance_m + tool_radius_m_)) continue;
    for (std::size_t k = 0; k < reflector_.size(); ++k) {
      const Segment arm{centre, placed(reflector_[k], frames)};
      double square = squared_distance(arm.to, axis);
      if (nearer(square, body.reflector_clearance_m[k])) {
        finding = {Obstruction::tool_too_near, k, i, std::sqrt(square), body.reflector_clearance_m[k]};
        return true;
      }
      if (body.arm_clearance_m[k] < 0) continue;
      square = squared_distance(arm, axis);
      if (nearer(square, body.arm_clearance_m[k])) {
        finding = {Obstruction::tool_too_near, k, i, std::sqrt(square), body.arm_clearance_m[k], true};
        return true;
      }
    }
  }
  return false;
}

bool Feasibility::find_beam(const LinkFrames& frames, const Axes& axes, Finding& finding) const {
  const Segment middle{*tracker_m_, placed(centre_, frames)};
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const Body& body = bodies_[i];
    const Segment& axis = axes[i];
    // At the same fraction of their lengths no beam is farther from the one to the tool's centre than tool_radius_m_.
    if (!nearer(squared_distance(middle, axis), body.largest_clearance_m + tool_radius_m_)) continue;
    for (std::size_t k = 0; k < reflector_.size(); ++k) {
      if (body.beam_clearance_m[k] < 0) continue;
      const double square = squared_distance(Segment{*tracker_m_, placed(reflector_[k], frames)}, axis);
      if (nearer(square, body.beam_clearance_m[k])) {
        finding = {Obstruction::beam_blocked, k, i, std::sqrt(square), body.beam_clearance_m[k]};
        return true;
      }
    }
  }
  return false;
}

Feasibility::Finding Feasibility::find(const Joints& q_rad) const {
  Finding finding;
  for (std::size_t j = 0; j < joint_count; ++j) {
    const double q = q_rad[j];
    if (q >= limits_[j].min_rad && q <= limits_[j].max_rad) continue;
    return {Obstruction::joint_limit, j, 0, q,
            q < limits_[j].min_rad ? limits_[j].min_rad : limits_[j].max_rad};
  }
  LinkFrames frames;
  place(q_rad, frames);
  if (tracker_m_ && find_facing(frames, finding)) return finding;
  thread_local Axes axes;  // called a million times: no allocation
  axes.clear();
  for (const Body& body : bodies_) axes.push_back(placed(body, frames));
  if (find_collision(axes, finding) || find_tool(frames, axes, finding)) return finding;
  if (tracker_m_) find_beam(frames, axes, finding);
  return finding;
}

Obstruction Feasibility::check(const Joints& q_rad) const { return find(q_rad).obstruction; }

std::string Feasibility::why(const Joints& q_rad) const {
  const Finding f = find(q_rad);
  switch (f.obstruction) {
    case Obstruction::joint_limit:
      return fmt::format("joint {} at {:.3f} deg is beyond its limit of {:.3f} deg", f.first + 1,
                         degrees(f.actual), degrees(f.allowed));
    case Obstruction::bodies_touch:
      return fmt::format("{} and {} touch: {:.1f} mm between their axes, more than {:.1f} mm are needed",
                         bodies_[f.first].name, bodies_[f.second].name, f.actual * 1e3, f.allowed * 1e3);
    case Obstruction::tool_too_near:
      return fmt::format("{}{} is {:.1f} mm from the axis of {}, more than {:.1f} mm are needed",
                         f.arm ? "the tool's arm to " : "", reflector_name(f.first), f.actual * 1e3,
                         bodies_[f.second].name, f.allowed * 1e3);
    case Obstruction::beam_blocked:
      return fmt::format(
          "the beam to {} passes {:.1f} mm from the axis of {}, more than {:.1f} mm are needed",
          reflector_name(f.first), f.actual * 1e3, bodies_[f.second].name, f.allowed * 1e3);
    case Obstruction::facing_away:
      return fmt::format("the beam meets {} at {:.1f} deg from straight on, at most {:.1f} deg are accepted",
                         reflector_name(f.first), degrees(f.actual), degrees(f.allowed));
    case Obstruction::none:
      break;
  }
  return {};
}

std::vector<Joints> feasible_poses(const Feasibility& feasibility, const Robot& robot, std::size_t count,
                                   std::uint64_t seed) {
  const std::size_t most_tries = 100000 + 1000 * count;
  RandomPoses random(robot.nominal.limits, seed);
  std::array<std::size_t, 6> frequency{};
  std::vector<Joints> poses;
  std::size_t tries = 0;
  for (; poses.size() < count && tries < most_tries; ++tries) {
    const Joints q = random();
    const Obstruction obstruction = feasibility.check(q);
    ++frequency[static_cast<std::size_t>(obstruction)];
    if (obstruction == Obstruction::none) poses.push_back(q);
  }
  if (poses.size() == count) return poses;
  std::string reasons;
  for (std::size_t k = 1; k < frequency.size(); ++k) {
    if (frequency[k] == 0) continue;
    reasons +=
        fmt::format(", {:.1f} % {}", 100.0 * static_cast<double>(frequency[k]) / static_cast<double>(tries),
                    name_of(static_cast<Obstruction>(k)));
  }
  throw InputError(
      feasibility.source(), 0, "", fmt::format("a cell with {} feasible poses of {}", count, robot.path),
      fmt::format("{} among {} random poses within the joint limits{}", poses.size(), tries, reasons));
}

}  // namespace flexcomp::host
