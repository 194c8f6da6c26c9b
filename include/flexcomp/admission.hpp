// SPDX-License-Identifier: Apache-2.0
/// \file
/// Admission (docs/compensation.md, section "Admission"): bounds of what a prepared set can do, from its
/// coefficients alone, and of what a step costs. A set beyond the limits is refused by the index of a term.
///
/// Nothing is sampled: what lies between two probe poses counts. Host and controller call the same function.
#ifndef FLEXCOMP_ADMISSION_HPP
#define FLEXCOMP_ADMISSION_HPP

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "flexcomp/bytes.hpp"
#include "flexcomp/model.hpp"
#include "flexcomp/robot.hpp"
#include "flexcomp/status.hpp"
#include "flexcomp/term.hpp"

namespace flexcomp {

/// What is bounded, for every joint and for everything off the joints together. Lengths count as angles: divided by
/// the arm's reach.
enum class Measure : std::uint8_t {
  value,        ///< rad: of functions of readings, the sum of their greatest values
  slope,        ///< of these, rad per rad, summed over the readings
  scale,        ///< rad per rad: of terms proportional to a reading
  direction,    ///< rad: half the jump at a reversal
  compliance,   ///< rad/(N·m): by any torque or moment
  per_kg,       ///< rad/kg: by the payload's mass
  per_n,        ///< rad/N: by the external force
  load,         ///< rad: by payload, force and link weight at the declared ranges
  per_k,        ///< rad/K: by temperature
  total_slope,  ///< slope, with that of the loads at the declared ranges: contraction of the fixed point
  per_m,        ///< rad/m: by the payload's centre of mass; not limited
  deflection,   ///< rad: of all together; not limited
};
constexpr std::size_t limited_measures = 10;  ///< those that AdmissionLimits has
constexpr std::size_t measure_count = 12;     ///< all

/// Greatest bounds of a set. The defaults are far above what calibrations of arms have shown.
template <class S>
struct AdmissionLimits {
  S value_rad = S(0.02);                ///< Measure::value
  S slope = S(0.25);                    ///< Measure::slope
  S scale = S(0.01);                    ///< Measure::scale: encoder scale and coupling of 5e-3 each
  S direction_rad = S(1e-3);            ///< Measure::direction
  S compliance_rad_per_nm = S(5e-3);    ///< Measure::compliance
  S rad_per_kg = S(5e-3);               ///< Measure::per_kg
  S rad_per_n = S(1e-3);                ///< Measure::per_n
  S load_rad = S(0.05);                 ///< Measure::load
  S rad_per_k = S(5e-5);                ///< Measure::per_k, and any coefficient of thermal growth (1/K)
  S total_slope = S(0.5);               ///< Measure::total_slope
  std::uint32_t instructions = 100000;  ///< of one step, by step_instructions()
  S link_slope =
      S(0.025);  ///< Measure::slope off the joints: near a singularity the arm follows it many times over

  /// The limit of one measure; measures that have none are not asked for.
  S of(Measure m) const {
    switch (m) {
      case Measure::value:
        return value_rad;
      case Measure::slope:
        return slope;
      case Measure::scale:
        return scale;
      case Measure::direction:
        return direction_rad;
      case Measure::compliance:
        return compliance_rad_per_nm;
      case Measure::per_kg:
        return rad_per_kg;
      case Measure::per_n:
        return rad_per_n;
      case Measure::load:
        return load_rad;
      case Measure::per_k:
        return rad_per_k;
      default:
        return total_slope;
    }
  }
};

/// Greatest constant terms, m and rad: those of an arm that was built and mastered by mistake are smaller, and the steps of
/// this library are not derived for larger ones.
template <class S>
struct LargestConstant {
  static constexpr S m = S(0.05);
  static constexpr S rad = S(0.1);
};

/// What the context may say, as the integrator declares it. A load beyond it may move the arm by more than the
/// certificate says.
template <class S>
struct AdmissionRanges {
  S payload_kg = S(5);      ///< mass, greatest
  S com_m = S(0.2);         ///< distance of its centre of mass from the flange, greatest
  S force_n = S(0);         ///< external force at the tool, greatest
  S temperature_k = S(30);  ///< distance of the temperature from the reference, greatest
};

/// Ranges where nothing is declared: twice the robot's own payload, or 5 kg; twice its lever, or 0.2 m; no force; 30 K.
template <class S, std::size_t N>
inline AdmissionRanges<S> default_ranges(const NominalRobot<N>& robot) {
  AdmissionRanges<S> r;
  const S mass = from_binary64<S>(robot.payload_kg);
  if (mass > S(0)) r.payload_kg = mass + mass;
  S square = S(0);
  for (const double x : robot.payload_com_m) square += from_binary64<S>(x) * from_binary64<S>(x);
  using std::sqrt;
  const S com = S(2) * sqrt(square);
  if (com > r.com_m) r.com_m = com;
  return r;
}

/// Ranges of which nothing is declared: negative.
template <class S>
constexpr AdmissionRanges<S> undeclared_ranges() {
  return {S(-1), S(-1), S(-1), S(-1)};
}

/// The declared ranges, with those of default_ranges() for each that is negative.
template <class S, std::size_t N>
inline AdmissionRanges<S> declared_ranges(const AdmissionRanges<S>& declared, const NominalRobot<N>& robot) {
  const AdmissionRanges<S> usual = default_ranges<S>(robot);
  const auto choose = [](const S& x, const S& otherwise) { return x < S(0) ? otherwise : x; };
  return {choose(declared.payload_kg, usual.payload_kg), choose(declared.com_m, usual.com_m),
          choose(declared.force_n, usual.force_n), choose(declared.temperature_k, usual.temperature_k)};
}

/// Bounds of an admitted set, over all poses within the joint limits and all contexts within the declared ranges.
template <class S, std::size_t N = 6>
struct Certificate {
  std::array<S, N> deflection_rad{};  ///< of each joint, by all terms that are not constant
  std::array<S, N> slope{};           ///< its slope: sum over the readings of |derivative|
  S off_joint_rad = S(0);    ///< the same of links, base and tool together, lengths divided by the reach
  S off_joint_slope = S(0);  ///< its slope
  S rad_per_kg = S(0);       ///< greatest of any joint, and what is off the joints: by the payload's mass
  S rad_per_n = S(0);        ///< the same by the external force
  S rad_per_m = S(0);        ///< the same by the payload's centre of mass
  S rad_per_k = S(0);        ///< the same by the temperature
  S position_m = S(0);       ///< size of the whole set at the tool, constant terms with it
  S orientation_rad = S(0);  ///< the same
  S reach_m = S(0);          ///< of the tool from the origin of F0, arm stretched
  std::uint32_t instructions = 0;  ///< of one step, at most, on a Cortex-M7
};

/// The bound that a refused set exceeds.
template <class S>
struct Excess {
  Measure measure = Measure::value;  ///< which
  std::size_t place = 0;             ///< joint (from 0), or N for what is off the joints
  std::size_t term = 0;              ///< with the greatest share in it, among those that are not constant
  S bound = S(0);                    ///< in the measure's unit
  S limit = S(0);                    ///< that it exceeds
};

/// Instructions of a step on a Cortex-M7 by kind of term: the constants of step_instructions(). tests/target/step_cost.cpp
/// searches for sets that exceed it.
namespace step_cost {

/// Kinds of terms by what they take.
enum class Kernel : std::uint8_t {
  compliance,    ///< of a joint to its own torque: added up when the set is prepared
  lever,         ///< link weight
  torque,        ///< other torques and moments, also cubed
  torque_curve,  ///< spline times torque
  wave,          ///< sine, cosine
  curve,         ///< spline
  grid,          ///< bilinear, two searches among 64 nodes at most
  plain,         ///< reading, direction, temperature, constant
  own_wave,      ///< sine, cosine of the reading of the joint that is turned: evaluated once
  own_curve,     ///< spline of it
  own_plain,     ///< proportional to it
};
constexpr std::size_t kernels = 11;

/// What a step takes: once, and for each term with all of its evaluations.
struct Path {
  std::uint32_t base;                       ///< at the worst pose
  std::uint32_t loaded;                     ///< more where some term follows load or link weight
  std::uint32_t iterated;                   ///< more where some term follows other readings or the context
  std::uint32_t frames;                     ///< more where base or tool move
  std::array<std::uint32_t, kernels> term;  ///< by kind
};
/// Sets whose terms all turn joints: at most seven evaluations.
constexpr Path joints_only = {17500, 7500, 3500, 0, {0, 1020, 350, 1380, 920, 1180, 1740, 360, 260, 230, 40}};
/// Sets that also move links, base or tool: at most six evaluations, each with the chain.
constexpr Path off_joints = {32000, 7500, 0, 6000, {0, 1160, 640, 1440, 1280, 1490, 1950, 560, 260, 230, 40}};

/// True where the term turns the joint whose reading it follows.
template <class S>
constexpr bool is_own(const Term<S>& t) {
  return t.place.slot == slot::theta && t.place.body >= 1 && t.place.body <= body::max_link &&
         t.joint + 1U == t.place.body;
}

/// The kind of a term.
template <class S>
constexpr Kernel kernel_of(const Term<S>& t) {
  switch (t.basis) {
    case Basis::load_torque:
      return is_own(t) ? Kernel::compliance : Kernel::torque;
    case Basis::load_torque_cubed:
    case Basis::load_moment_x:
    case Basis::load_moment_y:
    case Basis::base_moment_x:
    case Basis::base_moment_y:
      return Kernel::torque;
    case Basis::link_weight:
      return Kernel::lever;
    case Basis::sine:
    case Basis::cosine:
      return is_own(t) ? Kernel::own_wave : Kernel::wave;
    case Basis::curve:
      if (t.factor == Factor::load_torque) return Kernel::torque_curve;
      return is_own(t) ? Kernel::own_curve : Kernel::curve;
    case Basis::joint_position:
      return is_own(t) ? Kernel::own_plain : Kernel::plain;
    case Basis::grid:
      return Kernel::grid;
    default:
      return Kernel::plain;
  }
}

}  // namespace step_cost

/// Upper bound of the instructions of one step on a Cortex-M7: base + what loads and iterations add + sum
/// over the terms of their kinds' (docs/compensation.md, section "Admission").
template <class S, std::size_t N, class Cap>
inline std::uint32_t step_instructions(const Model<S, N, Cap>& model) {
  const bool joints_only = model.plan().size(detail::group::move) == 0;
  const step_cost::Path& path = joints_only ? step_cost::joints_only : step_cost::off_joints;
  std::uint32_t sum = path.base;
  if (model.needs_loads()) sum += path.loaded;
  if (model.base_moves() || model.tool_moves()) sum += path.frames;
  bool iterated = false;
  for (std::size_t k = 0; k < model.effect_count(); ++k) {
    const step_cost::Kernel kernel = step_cost::kernel_of(model.effect(k));
    sum += path.term[static_cast<std::size_t>(kernel)];
    iterated = iterated || (kernel >= step_cost::Kernel::wave && kernel <= step_cost::Kernel::plain);
  }
  if (iterated) sum += path.iterated;
  return sum;
}

/// The bounds of a prepared set, term by term: begin(), then advance() until it is false, then finish(). Between
/// begin() and finish() the model must stay as it is. Work of one call: one term, of a grid one of three passes over its
/// table.
template <class S, std::size_t N = 6>
class Admission {
 public:
  /// Takes the constant terms into account.
  template <class Cap>
  void begin(const Model<S, N, Cap>& model, const AdmissionLimits<S>& limits,
             const AdmissionRanges<S>& ranges) {
    limits_ = limits;
    for (auto& place : sum_) place.fill(S(0));
    excess_ = {};
    refusal_ = Refusal::none;
    next_ = 0;
    searching_ = false;
    stage_ = 0;
    greatest_ = S(-1);
    measure_arm(model, ranges);
    add_constants(model);
  }

  /// Adds the next term, or a part of it, to the bounds; false where there is none left or the set is refused.
  template <class Cap>
  bool advance(const Model<S, N, Cap>& model) {
    if (next_ >= model.effect_count()) return false;
    const Term<S>& term = model.effect(next_);
    const std::size_t place = place_of(term);
    Share& share = share_;
    if (stage_ == 0) share.fill(S(0));
    if (term.place.body != body::point && !bound(model, term, share)) {
      refusal_ = Refusal::not_allowed_covariate;
      excess_.place = place;
      excess_.term = next_;
      next_ = model.effect_count();
      return false;
    }
    if (term.basis == Basis::grid && stage_ < 2) {
      ++stage_;
      return true;
    }
    stage_ = 0;
    const std::size_t k = next_++;
    if (!searching_ && term.place.body != body::point)
      add_size(term.place, share[static_cast<std::size_t>(Measure::deflection)]);
    if (is_length(term.place)) {
      for (S& x : share) x *= per_length_;
    }
    if (searching_) {
      search(k, place, share);
      return next_ < last_;
    }
    if (term.basis == Basis::thermal && !(magnitude(term.coefficient) <= limits_.rad_per_k)) {
      refuse(Measure::per_k, place, magnitude(term.coefficient));
      excess_.term = k;
      next_ = model.effect_count();
      return false;
    }
    add(place, share);
    if (refusal_ != Refusal::none) {
      // The terms so far are gone through again for the one that has most of the bound.
      searching_ = true;
      last_ = next_;
      next_ = 0;
      return true;
    }
    return next_ < model.effect_count();
  }

  /// True where the next call of advance() reads a table, which takes as long as several other terms.
  template <class Cap>
  bool at_table(const Model<S, N, Cap>& model) const {
    return next_ < model.effect_count() && model.effect(next_).table != no_table;
  }

  /// Fills the certificate; the verdict. `detail` is the term's index, or the number of instructions, or the size of a
  /// constant in um or urad.
  template <class Cap>
  Refusal finish(const Model<S, N, Cap>& model, Certificate<S, N>& out, std::uint32_t& detail) {
    const auto at = [this](std::size_t place, Measure m) { return sum_[place][static_cast<std::size_t>(m)]; };
    const auto sensitivity = [&](Measure m) {
      S greatest = S(0);
      for (std::size_t i = 0; i < N; ++i) {
        if (at(i, m) > greatest) greatest = at(i, m);
      }
      return greatest + at(N, m);
    };
    for (std::size_t i = 0; i < N; ++i) {
      out.deflection_rad[i] = at(i, Measure::deflection);
      out.slope[i] = at(i, Measure::total_slope);
    }
    out.off_joint_rad = at(N, Measure::deflection);
    out.off_joint_slope = at(N, Measure::total_slope);
    out.rad_per_kg = sensitivity(Measure::per_kg);
    out.rad_per_n = sensitivity(Measure::per_n);
    out.rad_per_m = sensitivity(Measure::per_m);
    out.rad_per_k = sensitivity(Measure::per_k);
    // Turned about axes that lie farther out because links are longer: second order, but a bound has it.
    out.position_m = position_ + orientation_ * stretch_;
    out.orientation_rad = orientation_;
    out.reach_m = reach_;
    out.instructions = step_instructions(model);
    detail = 0;
    if (refusal_ == Refusal::implausible) {
      detail = excess_.bound < S(4000) ? static_cast<std::uint32_t>(excess_.bound * S(1e6)) : 0xFFFFFFFFU;
    } else if (refusal_ != Refusal::none) {
      detail = static_cast<std::uint32_t>(excess_.term);
    } else if (out.instructions > limits_.instructions) {
      refusal_ = Refusal::too_costly;
      detail = out.instructions;
    }
    return refusal_;
  }

  const Excess<S>& excess() const { return excess_; }  ///< of a refused set, unless it is too costly
  Place constant() const { return constant_; }         ///< of a set that is refused as implausible

 private:
  using Share = std::array<S, measure_count>;

  static S magnitude(const S& x) { return x < S(0) ? -x : x; }
  static S length(const S& a, const S& b) {
    using std::sqrt;
    return sqrt(a * a + b * b);
  }
  static S length(const Vector3<S>& v) {
    using std::sqrt;
    return sqrt(dot<S>(v, v));
  }

  static std::size_t place_of(const Term<S>& t) {
    return t.place.body >= 1 && t.place.body <= N && t.place.slot == slot::theta ? t.place.body - 1U : N;
  }
  static bool is_length(Place p) {
    if (p.body >= 1 && p.body <= N) return p.slot == slot::d || p.slot == slot::a;
    return p.slot <= slot::z;
  }

  /// Lengths of the arm with its constant terms, and the greatest loads.
  template <class Cap>
  void measure_arm(const Model<S, N, Cap>& model, const AdmissionRanges<S>& ranges) {
    const std::array<S, 4>& edit = model.load_edit();
    tool_ = length(model.nominal_tool().position);
    const S tool = length(model.tool_pose().position);
    if (tool > tool_) tool_ = tool;
    com_ = ranges.com_m + length(Vector3<S>(edit[slot::com_x], edit[slot::com_y], edit[slot::com_z]));
    const S mass = ranges.payload_kg + magnitude(edit[slot::mass]);
    gravity_ = length(model.gravity());
    weight_ = gravity_ * mass;
    payload_ = ranges.payload_kg;
    force_ = ranges.force_n;
    temperature_ = ranges.temperature_k;
    S out = S(0);
    for (std::size_t i = N; i-- > 0;) {
      S a = magnitude(model.nominal(i).a), d = magnitude(model.nominal(i).d);
      if (magnitude(model.shape(i).a) > a) a = magnitude(model.shape(i).a);
      if (magnitude(model.shape(i).d) > d) d = magnitude(model.shape(i).d);
      beyond_[i] = out;
      lever_[i] = out + a;
      out += length(a, d);
    }
    reach_ = out + tool_;
    per_length_ = reach_ > S(1e-3) ? S(1) / reach_ : S(1e3);
    position_ = orientation_ = stretch_ = S(0);
  }

  /// Distance from the origin that a turn of this place is about to the tool, at most.
  S arm_of(Place p) const {
    if (p.body == body::base) return reach_;
    if (p.body == body::tool) return S(0);
    return (p.slot == slot::theta ? lever_[p.body - 1U] : beyond_[p.body - 1U]) + tool_;
  }

  /// Adds a motion at a place, m or rad, to the size at the tool.
  void add_size(Place p, const S& size) {
    if (is_length(p)) {
      position_ += size;
      stretch_ += size;
    } else {
      orientation_ += size;
      position_ += size * arm_of(p);
    }
  }

  template <class Cap>
  void add_constants(const Model<S, N, Cap>& model) {
    for (std::uint8_t s = 0; s < 6; ++s) {
      for (std::size_t i = 0; i < N; ++i)
        add_constant({static_cast<std::uint8_t>(i + 1), s}, magnitude(model.constant(i)[s]));
      add_constant({body::base, s}, magnitude(model.base()[s]));
      add_constant({body::tool, s}, magnitude(model.tool()[s]));
    }
    if (refusal_ != Refusal::none) next_ = model.effect_count();
  }

  /// Each by itself: what cancels at the tool moves the arm all the same.
  void add_constant(Place p, const S& size) {
    add_size(p, size);
    const S most = is_length(p) ? LargestConstant<S>::m : LargestConstant<S>::rad;
    if (size <= most || refusal_ != Refusal::none) return;
    refusal_ = Refusal::implausible;
    excess_.bound = size;
    excess_.limit = most;
    constant_ = p;
  }

  /// Greatest value of a torque or moment and its derivatives, over all poses.
  struct Torque {
    S of_weight = S(0);        ///< per N of weight, m
    S of_force = S(0);         ///< per N of force, m
    S slope_of_weight = S(0);  ///< sum over the readings, per N of weight
    S slope_of_force = S(0);   ///< sum over the readings, per N of force
  };

  /// Moment about an axis that joints 0 … `turning` - 1 carry, of a force at a point at most `arm` away from that axis:
  /// turning the joints before it turns the force, turning those beyond moves the point.
  Torque torque(const S& arm, std::size_t turning) const {
    Torque t;
    t.of_weight = arm + com_;
    t.of_force = arm + tool_;
    const S turns = S(static_cast<float>(turning));
    t.slope_of_weight = turns * t.of_weight;
    t.slope_of_force = turns * t.of_force;
    for (std::size_t i = turning; i < N; ++i) {
      t.slope_of_weight += lever_[i] + com_;
      t.slope_of_force += lever_[i] + tool_;
    }
    return t;
  }

  /// The moment that a basis, or a curve's factor, is.
  Torque torque_of(const Term<S>& t) const {
    switch (t.basis) {
      case Basis::load_moment_x:
      case Basis::load_moment_y:
        return torque(beyond_[t.joint], t.joint + std::size_t{1});
      case Basis::base_moment_x:
      case Basis::base_moment_y:
        return torque(reach_ - tool_ + magnitude(t.argument), 0);
      default:
        return torque(lever_[t.joint], t.joint + std::size_t{1});
    }
  }

  /// Shares of k times a load moment; k is the tangent, `value` the share of the moment that counts: 1, or 1/3 of a cube.
  void add_torque(const S& k, const S& value, const Torque& t, Share& share) const {
    const S moment = t.of_weight * weight_ + t.of_force * force_;
    put(share, Measure::compliance, k);
    put(share, Measure::per_kg, k * t.of_weight * gravity_);
    put(share, Measure::per_n, k * t.of_force);
    put(share, Measure::per_m, k * weight_);
    put(share, Measure::load, k * moment * value);
    put(share, Measure::deflection, k * moment * value);
    put(share, Measure::total_slope, k * (t.slope_of_weight * weight_ + t.slope_of_force * force_));
  }

  static void put(Share& share, Measure m, const S& x) { share[static_cast<std::size_t>(m)] += x; }

  /// Greatest magnitude and slope (per rad) of a curve: a spline lies within its coefficients, its derivative within
  /// their differences (de Boor, A Practical Guide to Splines, IX and X).
  static void curve_bound(const S* c, std::size_t m, S& value, S& slope) {
    value = slope = S(0);
    S before = c[m - 1];
    for (std::size_t k = 0; k < m; ++k) {
      const S v = magnitude(c[k]);
      if (!(v <= value)) value = v;
      const S step = magnitude(c[k] - before);
      if (!(step <= slope)) slope = step;
      before = c[k];
    }
    slope *= S(static_cast<float>(m)) * S(0.15915494309189533577);
  }

  /// Shares of a grid in three passes: a cell's value lies within those of its corners, its slope along a side within those
  /// of its edges.
  bool grid_bound(const Table& table, const S* nodes, const S& k, Share& share) const {
    const S* v = nodes + table.rows + table.columns;
    if (stage_ == 0) {
      S greatest = S(0);
      for (std::size_t n = 0; n < std::size_t{table.rows} * table.columns; ++n) {
        if (!(magnitude(v[n]) <= greatest)) greatest = magnitude(v[n]);
      }
      put(share, Measure::value, k * greatest);
      put(share, Measure::deflection, k * greatest);
      return true;
    }
    const bool along_rows = stage_ == 1;
    const Covariate kind = along_rows ? table.row_covariate : table.column_covariate;
    const S* x = along_rows ? nodes : nodes + table.rows;
    const std::size_t count = along_rows ? table.rows : table.columns;
    const std::size_t lines = along_rows ? table.columns : table.rows;
    const std::size_t step = along_rows ? table.columns : 1;
    const std::size_t line = along_rows ? 1 : table.columns;
    S steepest = S(0), widest = S(0);
    for (std::size_t n = 0; n < lines; ++n) {
      const S* at = v + n * line;
      S low = at[0], high = at[0], before = at[0], from = x[0];
      for (std::size_t i = 1; i < count; ++i) {
        at += step;
        const S y = *at, to = x[i];
        const S slope = magnitude(y - before) / (to - from);
        if (!(slope <= steepest)) steepest = slope;
        if (y < low) low = y;
        if (y > high) high = y;
        before = y;
        from = to;
      }
      if (!(high - low <= widest)) widest = high - low;
    }
    switch (kind) {
      case Covariate::joint_position:
        put(share, Measure::slope, k * steepest);
        put(share, Measure::total_slope, k * steepest);
        return true;
      case Covariate::payload:
        put(share, Measure::per_kg, k * steepest);
        return true;
      case Covariate::temperature:
        put(share, Measure::per_k, k * steepest);
        return true;
      case Covariate::direction:
        // As steep as backlash of this size, whose direction goes from -1 to 1.
        put(share, Measure::direction, k * (steepest > widest * S(0.5) ? steepest : widest * S(0.5)));
        return true;
      case Covariate::time:
      case Covariate::relative_speed:
        break;
    }
    return false;
  }

  /// Slope of a link-weight lever (M13), rad per rad, summed over the readings: the joints before it turn gravity; those
  /// between its ends turn the lever's arm, by the share that they move of its length.
  template <class Cap>
  S lever_slope(const Model<S, N, Cap>& model, std::size_t joint, std::size_t distal) const {
    // The arm with the joints between at their offsets, in the frame of the lever's joint.
    S x = S(0), y = S(0), z = S(0), moved = S(0), reach = S(0), turned = S(0);
    for (std::size_t i = distal; i-- > joint;) {
      const LinkShape<S>& link = model.shape(i);
      if (link.has_beta) {
        const S t = x;
        x = link.beta.c * x + link.beta.s * z;
        z = link.beta.c * z - link.beta.s * t;
      }
      const S t = y;
      y = link.alpha.c * y - link.alpha.s * z;
      z = link.alpha.s * t + link.alpha.c * z;
      x += link.a;
      z += link.d;
      if (i == joint) break;
      const S lever = magnitude(link.a) + reach;
      moved += lever;
      if (lever > S(0)) turned += lever;
      const S u = x;
      x = link.offset.c * x - link.offset.s * y;
      y = link.offset.s * u + link.offset.c * y;
      reach += length(link.a, link.d);
    }
    S across = length(x, y) - S(2) * turned;
    if (!(across > S(1e-3))) across = S(1e-3);  // below, the lever counts as zero (M13)
    return S(static_cast<float>(joint + 1)) + moved / across;
  }

  /// Shares of one term; false where it follows time or speed.
  template <class Cap>
  bool bound(const Model<S, N, Cap>& model, const Term<S>& t, Share& share) const {
    const S k = magnitude(t.coefficient);
    switch (t.basis) {
      case Basis::one:
        put(share, Measure::value, k);
        put(share, Measure::deflection, k);
        break;
      case Basis::load_torque:
      case Basis::load_moment_x:
      case Basis::load_moment_y:
      case Basis::base_moment_x:
      case Basis::base_moment_y:
        add_torque(k, S(1), torque_of(t), share);
        break;
      case Basis::load_torque_cubed: {
        const Torque at = torque_of(t);
        const S moment = at.of_weight * weight_ + at.of_force * force_;
        add_torque(S(3) * k * moment * moment, S(1.0 / 3), at, share);
        break;
      }
      case Basis::link_weight: {
        const S slope = k * lever_slope(model, t.joint, t.distal_joint);
        put(share, Measure::load, k);
        put(share, Measure::deflection, k);
        put(share, Measure::slope, slope);
        put(share, Measure::total_slope, slope);
        break;
      }
      case Basis::joint_position: {
        const S low = magnitude(model.lower(t.joint)), high = magnitude(model.upper(t.joint));
        put(share, Measure::scale, k);
        put(share, Measure::total_slope, k);
        put(share, Measure::deflection, k * (low > high ? low : high));
        break;
      }
      case Basis::sine:
      case Basis::cosine: {
        const S low = magnitude(model.lower(t.joint)), high = magnitude(model.upper(t.joint));
        S slope = k * magnitude(t.argument);
        // Beyond the range of sin_cos() there is no value at all.
        const S farthest = magnitude(t.argument) * ((low > high ? low : high) + S(1));
        if (!(farthest <= LargestAngle<S>::value())) slope = S(1e9F);
        put(share, Measure::value, k);
        put(share, Measure::deflection, k);
        put(share, Measure::slope, slope);
        put(share, Measure::total_slope, slope);
        break;
      }
      case Basis::direction:
        put(share, Measure::direction, k);
        put(share, Measure::deflection, k);
        break;
      case Basis::thermal: {
        const LinkShape<S>& link = model.nominal(t.place.body - 1U);
        const S per_k = k * magnitude(t.place.slot == slot::a ? link.a : link.d);
        put(share, Measure::per_k, per_k);
        put(share, Measure::deflection, per_k * temperature_);
        break;
      }
      case Basis::curve: {
        const Table& table = model.table(t.table);
        S value, slope;
        curve_bound(model.values(table), table.size, value, slope);
        bound_curve(t, k * value, k * slope, share);
        break;
      }
      case Basis::grid: {
        const Table& table = model.table(t.table);
        if (!grid_bound(table, model.values(table), k, share)) return false;
        break;
      }
      default:
        return false;  // time, step, relative speed
    }
    return true;
  }

  /// Shares of a curve of this value and slope times its factor.
  void bound_curve(const Term<S>& t, const S& value, const S& slope, Share& share) const {
    S most = S(1);
    switch (t.factor) {
      case Factor::one:
        put(share, Measure::value, value);
        put(share, Measure::slope, slope);
        break;
      case Factor::load_torque: {
        const Torque at = torque_of(t);
        most = at.of_weight * weight_ + at.of_force * force_;
        add_torque(value, S(1), at, share);
        put(share, Measure::total_slope, slope * most);
        return;
      }
      case Factor::temperature:
        most = temperature_;
        put(share, Measure::per_k, value);
        break;
      case Factor::payload:
        most = payload_;
        put(share, Measure::per_kg, value);
        put(share, Measure::load, value * most);
        break;
    }
    put(share, Measure::deflection, value * most);
    put(share, Measure::total_slope, slope * most);
  }

  S limit_of(Measure m, std::size_t place) const {
    return place == N && m == Measure::slope ? limits_.link_slope : limits_.of(m);
  }

  void add(std::size_t place, const Share& share) {
    for (std::size_t m = 0; m < measure_count; ++m) {
      S& sum = sum_[place][m];
      sum += share[m];
      const Measure measure = static_cast<Measure>(m);
      if (m < limited_measures && refusal_ == Refusal::none && !(sum <= limit_of(measure, place)))
        refuse(measure, place, sum);
    }
  }

  void refuse(Measure m, std::size_t place, const S& bound) {
    switch (m) {
      case Measure::slope:
      case Measure::scale:
      case Measure::total_slope:
        refusal_ = Refusal::too_steep;
        break;
      case Measure::compliance:
      case Measure::per_kg:
      case Measure::per_n:
      case Measure::load:
        refusal_ = Refusal::too_compliant;
        break;
      default:
        refusal_ = Refusal::too_large;
        break;
    }
    excess_.measure = m;
    excess_.place = place;
    excess_.bound = bound;
    excess_.limit = limit_of(m, place);
  }

  void search(std::size_t k, std::size_t place, const Share& share) {
    if (place != excess_.place) return;
    const S part = share[static_cast<std::size_t>(excess_.measure)];
    if (!(part <= greatest_)) {
      greatest_ = part;
      excess_.term = k;
    }
  }

  AdmissionLimits<S> limits_{};
  std::array<Share, N + 1> sum_{};
  std::array<S, N> lever_{};   ///< from the axis of joint i to the flange, at most, m
  std::array<S, N> beyond_{};  ///< from the frame after link i to the flange, at most, m
  S tool_ = S(0), com_ = S(0), reach_ = S(0), per_length_ = S(0);
  S payload_ = S(0), gravity_ = S(0), weight_ = S(0), force_ = S(0), temperature_ = S(0);
  S position_ = S(0), orientation_ = S(0), stretch_ = S(0);
  Excess<S> excess_{};
  Place constant_{};
  S greatest_ = S(-1);
  Refusal refusal_ = Refusal::none;
  bool searching_ = false;
  unsigned stage_ = 0;  ///< of the next term, where it is a grid
  Share share_{};       ///< of the next term, so far
  std::size_t next_ = 0;
  std::size_t last_ = 0;
};

/// Admission of a prepared set: its certificate, or the refusal with the index of the term (among those that are not
/// constant) that has the greatest share in the exceeded bound, or the number of instructions.
template <class S, std::size_t N, class Cap>
inline Refusal certify(const Model<S, N, Cap>& model, const AdmissionLimits<S>& limits,
                       const AdmissionRanges<S>& ranges, Certificate<S, N>& out, std::uint32_t& detail) {
  Admission<S, N> admission;
  admission.begin(model, limits, ranges);
  while (admission.advance(model)) {
  }
  return admission.finish(model, out, detail);
}

}  // namespace flexcomp

#endif
