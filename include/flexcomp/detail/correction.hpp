// SPDX-License-Identifier: Apache-2.0
/// \file
/// The corrected command of any set (docs/compensation.md, sections 2 to 5).
///
/// 1. undo_constant_terms(): the nominal chain gives target and Jacobian; the constant terms are one twist to first
///    order, whose solution is the first correction (C3).
/// 2. solve_chain(): joint angles psi at which the chain, with its links where effects have moved them, reaches the
///    target (C5, C6).
/// 3. find_readings(): the readings x that lead to psi, by fixed point of the deflection (C11 to C15); effects that move
///    links are evaluated with it, and the chain is solved again.
#ifndef FLEXCOMP_DETAIL_CORRECTION_HPP
#define FLEXCOMP_DETAIL_CORRECTION_HPP

#include <array>
#include <cmath>
#include <cstddef>

#include "flexcomp/bounds.hpp"
#include "flexcomp/detail/damped_jacobian_solver.hpp"
#include "flexcomp/detail/effect_values.hpp"
#include "flexcomp/detail/linearised_deflection.hpp"
#include "flexcomp/detail/own_deflection.hpp"
#include "flexcomp/detail/rigid_chain.hpp"

namespace flexcomp {
namespace detail {

/// Most refinements of a linear solution (C6). The error of the factored Jacobian, some 1e-2, is the ratio of each
/// remainder to the one before.
constexpr int most_refinements = 3;
/// Most fixed-point steps of the deflection (C15); of a set that moves links, each of which solves the chain as well.
constexpr int most_deflection_steps = 6;
constexpr int most_moving_steps = 5;

/// Rounds and refinements of the rate (C22).
constexpr int rate_rounds = 4;
constexpr int rate_refinements = 3;

/// Ends of the iterations (C7).
template <class S>
struct Tolerance {
  static constexpr S joint_rad = S(1.5e-10);  ///< what an iteration may leave of a joint angle
  static constexpr S turn_rad = S(3e-4);      ///< correction after which the chain is not evaluated again
  static constexpr S linearised = S(0);       ///< square of what (C13) may leave: in double it never suffices
  static constexpr S pose = S(1e-6);          ///< what an undamped chain may leave of the pose, m and rad
  static constexpr S own_rad = S(1e-8);       ///< curvature's part of the last step of the own deflections
};
template <>
struct Tolerance<float> {
  static constexpr float joint_rad = 3e-7F;
  static constexpr float turn_rad = 1e-3F;
  static constexpr float linearised = 1e-14F;
  static constexpr float pose = 1e-5F;
  static constexpr float own_rad = 3e-6F;
};

/// Rate of a command, and what its derivative needs (C22).
template <class S, std::size_t N>
struct CommandRate {
  const std::array<S, N>& command;  ///< rad/s
  SmallMotion<S> target;            ///< of tool point and flange by it, m/s and rad/s
  std::array<S, N> effects{};       ///< of all effects but the own ones, rad/s
};

/// See the head of the file.
template <class S, std::size_t N, class Cap>
class Correction {
 public:
  Correction(const Model<S, N, Cap>& model, const Context<S, N>& context,
             const CompensationSettings<S>& settings, CommandRate<S, N>* rate = nullptr)
      : model_(model), context_(context), settings_(settings), rate_(rate) {}

  /// Corrected command for the command q (rad), in place; rate() may follow where the rate of the command (rad/s) is
  /// given. Work: at most 8 chain passes, 2 factorisations, 29 linear solutions and 7 evaluations of the effects.
  void run(std::array<S, N>& q) {
    undo_constant_terms(q);
    const CyclePlan<S, N, Cap>& plan = model_.plan();
    take_load();
    for (std::size_t i = 0; i < N; ++i) deflection_[i] = S(0);
    if (moves_) evaluate(q, true);
    solve_chain(q, 1, most_corrections - 1);
    for (std::size_t i = 0; i < N; ++i) {
      psi_[i] = q[i];
      share_[i] = S(1);
    }
    if (loaded_ || moves_ || plan.size(group::own) + plan.size(group::other) != 0) find_readings(q);
    using std::sqrt;
    const S joints = sqrt(joint_left_ * S(static_cast<float>(N)));
    position_left_ += joints * plan.reach();
    orientation_left_ += joints;
  }

  /// Rate of the readings (rad/s) for the command's rate (C22), the derivative of what run() gave as q where nothing was
  /// given up; context and set stand still. False where the rounds do not end. Work: at most 9 chain passes, 20 linear solutions, 8 evaluations of the
  /// effects.
  FLEXCOMP_RARE bool rate(const std::array<S, N>& q, std::array<S, N>& out) {
    // J of the chain as it stands, linear in the rates.
    std::array<S, N> turn;
    for (std::size_t i = 0; i < N; ++i) turn[i] = psi_[i] - q[i] + ahead_[i];
    rotate_all(angle_, turn, square_of(turn));
    const std::array<SinCos<S>, N> chain = angle_;
    FlangePose<S> flange;
    Vec3<S> point;
    pass(flange);
    flange_point(flange, tool_point_, point);
    const std::array<JointAxis<S>, N> joints = joints_;
    const Mat3<S> b =
        columns_of(model_.base_moves() ? small_pose(moved_.base).rotation : model_.base_pose().rotation);
    const auto into_base = [&b](const Vec3<S>& v) { return Vec3<S>{dot(b.a, v), dot(b.b, v), dot(b.c, v)}; };
    const SmallMotion<S> target = {into_base(rate_->target.linear), into_base(rate_->target.angular)};
    SmallMotion<S> rest = target;
    // The slopes of the own deflections at the solution.
    std::array<Expansion<S>, N> own;
    own_deflections(model_, context_, q, own);
    for (std::size_t i = 0; i < N; ++i) share_[i] = S(1) / (S(1) + own[i].slope);
    const S without_limit = S(1e9F);
    for (int round = 0;; ++round) {
      std::array<S, N> psi_rate;
      solver_.solve(rest.linear, rest.angular, without_limit, without_limit, psi_rate);
      for (int n = 0; n < rate_refinements; ++n) {
        SmallMotion<S> done;
        linear_motion(joints, point, psi_rate, done);
        std::array<S, N> more;
        solver_.solve(rest.linear - done.linear, rest.angular - done.angular, without_limit, without_limit,
                      more);
        for (std::size_t i = 0; i < N; ++i) psi_rate[i] += more[i];
      }
      S square = S(0), changed = S(0);
      for (std::size_t i = 0; i < N; ++i) {
        const S v = (psi_rate[i] - rate_->effects[i]) * share_[i];
        const S change = round == 0 ? v : v - out[i];
        out[i] = v;
        square += v * v;
        changed += change * change;
      }
      // The remainder is smaller by the slope of the effects.
      if (!(changed > S(1e-12F) * square)) return true;
      if (round == rate_rounds) return false;
      rest = target;
      effect_rates(q, out, chain, rest);
    }
  }

  /// Rest (C5) at the readings q (rad) for a command: position (m), orientation (rad), and the trace of its rotation. Work:
  /// two chain passes, one evaluation of the effects.
  FLEXCOMP_RARE S rest(const std::array<S, N>& q_command, const std::array<S, N>& q, Vec3<S>& shift,
                       Vec3<S>& turn) {
    take_nominal(q_command);
    take_load();
    sin_cos_all(q, model_.shapes(), angle_);
    evaluate(q, false);
    std::array<Expansion<S>, N> own;
    own_deflections(model_, context_, q, own);
    for (std::size_t i = 0; i < N; ++i) ahead_[i] = deflection_[i] + own[i].value;
    turn_chain();
    FlangePose<S> flange;
    Vec3<S> point;
    chain_rest(flange, point, shift, turn);
    return dot(target_axes_.a, flange.axes.a) + dot(target_axes_.b, flange.axes.b) +
           dot(target_axes_.c, flange.axes.c);
  }

  bool is_damped() const { return solver_.is_damped(); }    ///< near a singularity
  bool has_converged() const { return converged_; }         ///< every iteration ended below its tolerance
  S position_left() const { return position_left_; }        ///< m, as the last iterate shows it
  S orientation_left() const { return orientation_left_; }  ///< rad, likewise

 private:
  void take_load() {
    loaded_ = model_.needs_loads();
    moves_ = model_.plan().size(group::move) != 0;
    if (loaded_) static_load(model_, context_, load_);
    linear_ = loaded_ && load_.is_plain;
  }

  /// Nominal pose of the command and, by the constant terms, target (C4). `angle_` belongs to the nominal chain.
  void take_nominal(const std::array<S, N>& q) {
    sin_cos_all(q, model_.nominals(), angle_);
    rigid_pass(model_.nominals(), angle_, solver_.joints(), nominal_);
    flange_point(nominal_, vec3<S>(model_.nominal_tool().position), nominal_point_);
    set_target(model_.base_pose(), model_.plan().tool_turn());
    tool_point_ = vec3<S>(model_.tool_pose().position);
  }

  void undo_constant_terms(std::array<S, N>& q) {
    take_nominal(q);
    region_ = singular_region(model_.tool_motion(), settings_);
    factor(nominal_point_);
    if (rate_ != nullptr) solver_.motion_by(rate_->command, rate_->target);
    SmallMotion<S> move;
    constant_twist(model_, angle_, move);
    const SmallMotion<S>& base = model_.plan().base_twist();
    const Vec3<S> turn = {-move.angular.x - base.angular.x, -move.angular.y - base.angular.y,
                          -move.angular.z - base.angular.z};
    const S tx = nominal_point_.x, ty = nominal_point_.y, tz = nominal_point_.z;
    const Vec3<S> shift = {turn.y * tz - turn.z * ty - move.linear.x - base.linear.x,
                           turn.z * tx - turn.x * tz - move.linear.y - base.linear.y,
                           turn.x * ty - turn.y * tx - move.linear.z - base.linear.z};
    const S largest = settings_.largest_correction_rad;
    std::array<S, N> by;
    solver_.solve(shift, turn, largest, largest, by);
    turned_ = S(0);
    for (std::size_t i = 0; i < N; ++i) {
      const S d = by[i];
      q[i] += d;
      const S b = d + model_.constant_theta(i);
      by[i] = b;
      turned_ += b * b;
      ahead_[i] = S(0);
    }
    rotate_all(angle_, by, turned_);
  }

  /// Target of flange and tool point (C4): the nominal pose without B and without the tool's own turn.
  void set_target(const Pose<S>& base, const Matrix3<S>& tool_turn) {
    const Matrix3<S>& b = base.rotation;
    const S xx = b(0, 0), xy = b(1, 0), xz = b(2, 0);
    const S yx = b(0, 1), yy = b(1, 1), yz = b(2, 1);
    const S zx = b(0, 2), zy = b(1, 2), zz = b(2, 2);
    const auto into_base = [=](S x, S y, S z, Vec3<S>& to) {
      to.x = xx * x + xy * y + xz * z;
      to.y = yx * x + yy * y + yz * z;
      to.z = zx * x + zy * y + zz * z;
    };
    Vec3<S>* const to[3] = {&target_axes_.a, &target_axes_.b, &target_axes_.c};
    for (int k = 0; k < 3; ++k) {
      const S u = tool_turn(0, k), v = tool_turn(1, k), w = tool_turn(2, k);
      const Mat3<S>& n = nominal_.axes;
      into_base(n.a.x * u + n.b.x * v + n.c.x * w, n.a.y * u + n.b.y * v + n.c.y * w,
                n.a.z * u + n.b.z * v + n.c.z * w, *to[k]);
    }
    into_base(nominal_point_.x - base.position[0], nominal_point_.y - base.position[1],
              nominal_point_.z - base.position[2], target_point_);
  }

  /// Effects at the readings q: deflections (all but the own ones) and, where there are such, motions of links, base and
  /// tool. `angle_` belongs to q. At the first chain q is still psi: the readings are off by the deflection of the loads.
  FLEXCOMP_ONCE void evaluate(const std::array<S, N>& q, bool at_chain) {
    LinkLoads<S, N> loads;
    if (loaded_) {
      compute_loads(model_, angle_, load_, loads);
      load_deflection(model_, context_, q, angle_, load_, loads, deflection_);
    } else {
      for (S& y : deflection_) y = S(0);
    }
    if (moves_ && at_chain) {
      std::array<S, N> x;
      for (std::size_t i = 0; i < N; ++i) x[i] = q[i] - deflection_[i];
      add_other_deflections(model_, x, context_, deflection_);
      move(x, loads);
    } else {
      add_other_deflections(model_, q, context_, deflection_);
      if (moves_) move(q, loads);
    }
  }

  /// Links, base and tool as the effects move them at the readings x.
  FLEXCOMP_ONCE void move(const std::array<S, N>& x, const LinkLoads<S, N>& loads) {
    move_parts(model_, context_, x, angle_, load_, loads, moved_);
    if (!model_.base_moves() && !model_.tool_moves()) return;
    const Pose<S> tool = model_.nominal_tool() * small_pose(moved_.tool);
    tool_point_ = vec3<S>(tool.position);
    set_target(small_pose(moved_.base), turn_between(model_.nominal_tool().rotation, tool.rotation));
  }

  /// Axes and flange of the chain at `angle_`, with its links as the effects have moved them.
  void pass(FlangePose<S>& flange) {
    if (moves_) {
      rigid_pass(moved_.links, angle_, joints_, flange);
    } else {
      rigid_pass(model_.shapes(), angle_, joints_, flange);
    }
  }

  /// Flange and tool point of a pass, and what they miss of the target (C5): position, m, and orientation, rad.
  void chain_rest(FlangePose<S>& flange, Vec3<S>& point, Vec3<S>& shift, Vec3<S>& turn) {
    pass(flange);
    flange_point(flange, tool_point_, point);
    shift = target_point_ - point;
    rotation_error(target_axes_, flange.axes, turn);
  }

  /// Factors the Jacobian of solver_.joints() at the tool point.
  void factor(const Vec3<S>& tool) {
    if (solver_.set(tool, region_)) return;
    solver_.set_damped(region_);
    near_ = true;
  }

  /// Turns the chain's joints, psi, until the flange is at the target (C5, C6): corrections `first` to `last`. q
  /// takes the same turns.
  void solve_chain(std::array<S, N>& q, int first, int last) {
    const S largest = settings_.largest_correction_rad;
    const S tolerance = Tolerance<S>::joint_rad * Tolerance<S>::joint_rad;
    for (int k = first;; ++k) {
      FlangePose<S> flange;
      Vec3<S> point, shift, turn;
      chain_rest(flange, point, shift, turn);
      if (linear_ && first == 1) linearise(flange);
      // Near a singularity the first correction can turn the wrist by 20 mrad, which changes the Jacobian by some percent:
      // from there on the Jacobian of this chain is used, which is close to that of the solution. Already where nothing is
      // damped yet: a change of Jacobian at the edge of the damping would be a step.
      if (!fresh_ && (near_ || solver_.is_damped() || solver_.jacobian_is_stale(turned_))) {
        solver_.joints() = joints_;
        factor(point);
        fresh_ = true;
        turned_ = S(0);
      }
      const S largest_turn = largest * allowed_turn<S>(k);
      std::array<S, N> dq;
      S square = solver_.solve(shift, turn, largest, largest_turn, dq);
      // The linear solution is off by the relative error of the factored Jacobian: the turn since then over the smallest
      // singular value. One of this chain is not refined: what is left is of second order, and where it is large, near a
      // singularity, the refinements would not converge.
      S left = fresh_ ? S(0) : turned_ * square;
      S limit = tolerance * solver_.regular();
      for (int n = 0; n < most_refinements && left > limit; ++n) {
        SmallMotion<S> move;
        motion(joints_, point, dq, move);
        const Vec3<S> shift_left = shift - move.linear, turn_left = turn - move.angular;
        std::array<S, N> rest;
        const S size = solver_.solve(shift_left, turn_left, largest, largest_turn, rest);
        // The remainders are a geometric sequence.
        left = size * size;
        limit = tolerance * square;
        square = S(0);
        for (std::size_t i = 0; i < N; ++i) {
          const S d = dq[i] + rest[i];
          dq[i] = d;
          square += d * d;
        }
      }
      for (std::size_t i = 0; i < N; ++i) {
        q[i] += dq[i];
        ahead_[i] += dq[i];
      }
      // Where the solution is damped, the last correction decides how much of the error remains: it is never left out.
      const bool ends = !solver_.is_damped() &&
                        square <= (fresh_ ? S(0.02) : S(1)) * Tolerance<S>::turn_rad * Tolerance<S>::turn_rad;
      if (ends || k >= last) {
        if (ends) {
          joint_left_ = fresh_ ? square * square : left * tolerance / limit;
        } else {
          chain_left(shift, turn, point, dq);
          if (!solver_.is_damped() &&
              !(position_left_ <= Tolerance<S>::pose && orientation_left_ <= Tolerance<S>::pose)) {
            converged_ = false;
          }
        }
        return;
      }
      turn_chain();
    }
  }

  /// Deflection by loads of the chain of the last pass, unless it is known, and its first-order change (C13).
  void linearise(const FlangePose<S>& flange) {
    std::array<S, N> deflection;
    linearised_.set(model_, joints_, flange, load_, deflection);
    if (!moves_) deflection_ = deflection;
  }

  /// Rates of the effects for rates of the readings, by central differences along them: deflections (rad/s) and, where
  /// links move, what they add to the rate at which the chain (its angles in `chain`) has to follow its target.
  FLEXCOMP_RARE void effect_rates(const std::array<S, N>& q, const std::array<S, N>& q_rate,
                                  const std::array<SinCos<S>, N>& chain, SmallMotion<S>& rest) {
    const S greatest = greatest_of(q_rate);
    if (!(greatest > S(0)) || !(loaded_ || moves_ || model_.plan().size(group::other) != 0)) return;
    // A step of 0.3 mrad leaves 1e-8 of the slope of sines of some rad, and in float 1e-7 rad of rounding.
    const S h = S(3e-4F) / greatest, half = S(0.5) / h;
    for (int side = 0; side < 2; ++side) {
      const S step = side == 0 ? -h : h, weight = side == 0 ? -half : half;
      std::array<S, N> x;
      for (std::size_t i = 0; i < N; ++i) x[i] = q[i] + step * q_rate[i];
      sin_cos_all(x, model_.shapes(), angle_);
      evaluate(x, false);
      for (std::size_t i = 0; i < N; ++i) {
        rate_->effects[i] = (side == 0 ? S(0) : rate_->effects[i]) + weight * deflection_[i];
      }
      if (!moves_) continue;
      angle_ = chain;
      FlangePose<S> flange;
      Vec3<S> point, shift, turn;
      chain_rest(flange, point, shift, turn);
      rest.linear = rest.linear + shift * weight;
      rest.angular = rest.angular + turn * weight;
    }
  }

  /// What the last correction of the chain leaves.
  FLEXCOMP_RARE void chain_left(const Vec3<S>& shift, const Vec3<S>& turn, const Vec3<S>& point,
                                const std::array<S, N>& dq) {
    SmallMotion<S> move;
    motion(joints_, point, dq, move);
    const Vec3<S> p = shift - move.linear, o = turn - move.angular;
    using std::sqrt;
    position_left_ = sqrt(dot(p, p));
    orientation_left_ = sqrt(dot(o, o));
  }

  /// `angle_` follows q.
  void turn_chain() {
    rotate_all(angle_, ahead_, square_of(ahead_));
    for (std::size_t i = 0; i < N; ++i) ahead_[i] = S(0);
  }

  /// Readings for the joint angles psi (C11). On entry q is psi; `deflection_` is that of the chain where it is known.
  void find_readings(std::array<S, N>& q) {
    if (!moves_ && linear_) {
      add_other_deflections(model_, q, context_, deflection_);
    } else if (!moves_) {
      turn_chain();
      evaluate(q, true);
    }
    for (std::size_t i = 0; i < N; ++i) {
      const S y = deflection_[i];
      q[i] -= y;
      ahead_[i] -= y;
    }
    if (model_.plan().size(group::own) != 0 &&
        !subtract_own_deflections(model_, context_, Tolerance<S>::own_rad, q, ahead_, share_)) {
      converged_ = false;
    }
    if (linear_) {
      std::array<S, N> change;
      linearised_.change(model_, joints_, ahead_, change);
      for (std::size_t i = 0; i < N; ++i) {
        const S step = change[i] * share_[i];
        deflection_[i] += change[i];
        q[i] -= step;
        ahead_[i] -= step;
      }
      // The first-order change leaves out the curvature of the deflection, which is of its own size (sines of some rad).
      const S square = square_of(ahead_);
      const S left = square_of(deflection_) * square * square;
      const CyclePlan<S, N, Cap>& plan = model_.plan();
      if (left <= Tolerance<S>::linearised && !moves_ &&
          plan.size(group::loaded) + plan.size(group::other) == 0) {
        joint_left_ += left;
        return;
      }
    }
    if (!loaded_ && !moves_ && model_.plan().size(group::other) == 0) return;
    // Before the first step the bound of their slope stands for the ratio of the steps.
    S ratio = model_.plan().slope_square();
    S before_square = S(0);
    const int most = moves_ ? most_moving_steps : most_deflection_steps;
    for (int n = 0; n < most; ++n) {
      std::array<S, N> step;
      for (std::size_t i = 0; i < N; ++i) step[i] = deflection_[i];
      if (loaded_ || moves_) turn_chain();
      evaluate(q, false);
      S size = S(0);
      for (std::size_t i = 0; i < N; ++i) {
        const S y = deflection_[i];
        size += y * y;
        step[i] = (step[i] - y) * share_[i];
      }
      // Near a singularity the links that follow the wrist that follows the links would not come to rest: there the chain
      // follows them once, and farther off, by and by, until it does.
      if (moves_) follow_links(q, n == 0 ? S(1) : solver_.undamped_share(), step);
      S square = S(0);
      for (std::size_t i = 0; i < N; ++i) {
        const S d = step[i];
        q[i] += d;
        ahead_[i] += d;
        square += d * d;
      }
      // The remainders are a geometric sequence, whose ratio is the slope of the effects: at least their own size, as for
      // sines of some rad, and what the last two steps show.
      const S tolerance = Tolerance<S>::joint_rad * Tolerance<S>::joint_rad;
      if (n != 0) ratio = square / before_square;
      const S left = square * (ratio > size ? ratio : size);
      if (left <= tolerance) {
        joint_left_ += left + unfollowed_;
        return;
      }
      before_square = square;
    }
    joint_left_ += before_square + unfollowed_;
    converged_ = false;
  }

  /// Solves the chain again, whose links have moved: psi, and with it the step of the readings q, take `share` of the
  /// change. `angle_` belongs to q.
  FLEXCOMP_ONCE void follow_links(const std::array<S, N>& q, const S& share, std::array<S, N>& step) {
    const std::array<S, N> from = psi_;
    std::array<S, N> to_psi;
    for (std::size_t i = 0; i < N; ++i) to_psi[i] = psi_[i] - q[i];
    rotate_all(angle_, to_psi, square_of(to_psi));
    solve_chain(psi_, most_corrections - 1, most_corrections - 1);
    unfollowed_ = S(0);
    for (std::size_t i = 0; i < N; ++i) {
      const S whole = psi_[i] - from[i];
      const S change = whole * share;
      unfollowed_ += (whole - change) * (whole - change);
      psi_[i] = from[i] + change;
      step[i] += change * share_[i];
      ahead_[i] = q[i] - from[i];
    }
  }

  const Model<S, N, Cap>& model_;
  const Context<S, N>& context_;
  const CompensationSettings<S>& settings_;
  CommandRate<S, N>* rate_;  ///< null where rate() is not asked for

  SingularRegion<S> region_;  ///< where the Jacobian is damped
  DampedJacobianSolver<S, N> solver_;
  std::array<SinCos<S>, N> angle_;        ///< of the chain's joints
  std::array<S, N> ahead_;                ///< what q is ahead of `angle_`, rad
  std::array<JointAxis<S>, N> joints_;    ///< of the last pass
  FlangePose<S> nominal_;                 ///< of the nominal chain at the command
  Mat3<S> target_axes_;                   ///< of the flange
  Vec3<S> nominal_point_, target_point_;  ///< of the tool point
  Vec3<S> tool_point_;                    ///< in the flange frame
  S turned_;                              ///< square of the turns since the Jacobian was factored
  std::array<S, N> deflection_;           ///< y of (C11), rad
  std::array<S, N> psi_;                  ///< joint angles of the chain, rad
  std::array<S, N> share_;                ///< w of (C15): change of the reading per change of the deflection
  StaticLoad<S> load_;
  LinearisedDeflection<S, N> linearised_;
  MovedParts<S, N> moved_;
  bool loaded_ = false;  ///< some effect follows loads
  bool linear_ = false;  ///< the first-order change of the deflection is known (C13)
  bool moves_ = false;   ///< some effect moves links, base or tool
  bool fresh_ = false;   ///< the Jacobian is that of the chain
  bool near_ = false;    ///< a Jacobian was near a singularity
  bool converged_ = true;
  S unfollowed_ = S(0);  ///< square of what the chain has not followed its links, rad^2
  S joint_left_ = S(0);  ///< square of what the last iterates leave of the joints, rad^2
  S position_left_ = S(0), orientation_left_ = S(0);
};

}  // namespace detail
}  // namespace flexcomp

#endif
