// SPDX-License-Identifier: Apache-2.0
/// \file
/// The prepared model: nominal chain and terms, with the constant terms added up once (docs/model.md, M2,
/// M5). It is built by begin(), add_table(), add(), finish() and only read afterwards. Evaluation is in
/// forward.hpp.
#ifndef FLEXCOMP_MODEL_HPP
#define FLEXCOMP_MODEL_HPP

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "flexcomp/detail/cycle_plan.hpp"
#include "flexcomp/detail/link_shape.hpp"
#include "flexcomp/linear.hpp"
#include "flexcomp/robot.hpp"
#include "flexcomp/singular_region.hpp"
#include "flexcomp/status.hpp"
#include "flexcomp/term.hpp"
#include "flexcomp/trigonometry.hpp"

namespace flexcomp {

/// Capacity of a model: terms that are not constant (constant ones take no memory), tables, and values of all
/// tables.
template <std::size_t Terms, std::size_t Tables, std::size_t Values>
struct Capacity {
  static constexpr std::size_t terms = Terms;    ///< that are not constant
  static constexpr std::size_t tables = Tables;  ///< curves and grids
  static constexpr std::size_t values = Values;  ///< of all tables
};

/// Capacity for the paper's nine flexible terms, a curve of 128 values on each of six joints, and 50 more
/// effects.
using DefaultCapacity = Capacity<64, 8, 768>;

/// Nominal chain and terms of an arm with N revolute joints, prepared for the scalar S. Complete failures:
/// Refusal of add_table_from() and add().
template <class S, std::size_t N = 6, class Cap = DefaultCapacity>
class Model {
 public:
  using Scalar = S;                                        ///< of all numbers
  static constexpr std::size_t joints = N;                 ///< revolute
  static constexpr std::size_t most_tables = Cap::tables;  ///< that it holds

  /// Resets to the nominal robot without terms.
  FLEXCOMP_RARE void begin(const NominalRobot<N>& robot) {
    // Member by member: a temporary of this size does not fit on a controller's stack.
    robot_ = robot;
    constant_ = {};
    base_ = {};
    tool_ = {};
    load_edit_ = {};
    link_moves_ = {};
    has_base_ = base_moves_ = tool_moves_ = needs_loads_ = reads_direction_ = false;
    effect_count_ = table_count_ = value_count_ = 0;
    for (std::size_t i = 0; i < N; ++i) {
      const NominalLink& link = robot.links[i];
      nominal_[i].offset = sin_cos(from_binary64<S>(link.theta_rad));
      nominal_[i].alpha = sin_cos(from_binary64<S>(link.alpha_rad));
      nominal_[i].beta = sin_cos(from_binary64<S>(link.beta_rad));
      nominal_[i].d = from_binary64<S>(link.d_m);
      nominal_[i].a = from_binary64<S>(link.a_m);
      nominal_[i].has_beta = bits_of(link.beta_rad) << 1U != 0;
    }
    const S w = from_binary64<S>(robot.tool_wxyz[0]);
    const S x = from_binary64<S>(robot.tool_wxyz[1]);
    const S y = from_binary64<S>(robot.tool_wxyz[2]);
    const S z = from_binary64<S>(robot.tool_wxyz[3]);
    nominal_tool_.rotation << S(1) - S(2) * (y * y + z * z), S(2) * (x * y - w * z), S(2) * (x * z + w * y),
        S(2) * (x * y + w * z), S(1) - S(2) * (x * x + z * z), S(2) * (y * z - w * x), S(2) * (x * z - w * y),
        S(2) * (y * z + w * x), S(1) - S(2) * (x * x + y * y);
    for (std::size_t k = 0; k < 3; ++k) {
      nominal_tool_.position[static_cast<int>(k)] = from_binary64<S>(robot.tool_xyz_m[k]);
      gravity_[static_cast<int>(k)] = from_binary64<S>(robot.gravity_m_s2[k]);
    }
    for (std::size_t i = 0; i < N; ++i) {
      // No wider than sines and cosines reach: a command beyond that is beyond its limit.
      lower_[i] = from_binary64<S>(robot.limits[i].min_rad);
      upper_[i] = from_binary64<S>(robot.limits[i].max_rad);
      const S reach = LargestAngle<S>::value();
      if (lower_[i] < -reach) lower_[i] = -reach;
      if (upper_[i] > reach) upper_[i] = reach;
    }
    reference_temperature_ = from_binary64<S>(robot.reference_temperature_c);
    const double g0 = robot.gravity_m_s2[0];
    const double g1 = robot.gravity_m_s2[1];
    axial_gravity_ = is_zero(g0) && is_zero(g1);
  }

  /// Appends a table; value(k) gives its k-th value, which is copied. Tables are numbered in the order of the
  /// calls. Refusal: table_too_large, bad_value.
  template <class Value>
  Refusal add_table_from(const Value& value, const Table& table) {
    if (table_count_ >= Cap::tables || value_count_ + table.size > Cap::values)
      return Refusal::table_too_large;
    if (table.rows == 0 ? (table.size < 6 || table.size > 256)
                        : (table.rows < 2 || table.columns < 2 || table.rows > 64 || table.columns > 64 ||
                           table.size != table.rows + table.columns + table.rows * table.columns)) {
      return Refusal::bad_value;
    }
    if (table.row_joint >= N || table.column_joint >= N ||
        static_cast<std::uint8_t>(table.row_covariate) >
            static_cast<std::uint8_t>(Covariate::relative_speed) ||
        static_cast<std::uint8_t>(table.column_covariate) >
            static_cast<std::uint8_t>(Covariate::relative_speed)) {
      return Refusal::bad_value;
    }
    for (unsigned side = 0, from = 0; table.rows != 0 && side < 2; ++side) {
      const unsigned nodes = side == 0 ? table.rows : table.columns;
      for (unsigned k = 1; k < nodes; ++k) {
        if (!(value(from + k) > value(from + k - 1))) return Refusal::bad_value;
      }
      from += nodes;
    }
    tables_[table_count_] = table;
    tables_[table_count_].offset = static_cast<std::uint16_t>(value_count_);
    for (std::size_t k = 0; k < table.size; ++k) values_[value_count_ + k] = value(k);
    value_count_ += table.size;
    ++table_count_;
    return Refusal::none;
  }

  /// add_table_from() of an array.
  Refusal add_table(const Table& table, const S* values) {
    return add_table_from([values](std::size_t k) { return values[k]; }, table);
  }

  /// Appends a term. Tables come before the terms that read them. Refusal: bad_place, unknown_basis,
  /// bad_value, mounting, too_many_terms.
  FLEXCOMP_RARE Refusal add(const Term<S>& term) {
    const Place p = term.place;
    const bool link = p.body >= 1 && p.body <= N;
    if (!(link && p.slot <= slot::gamma) && !(p.body == body::base && p.slot <= slot::rz) &&
        !(p.body == body::tool && p.slot <= slot::rz) && !(p.body == body::load && p.slot <= slot::com_z) &&
        !(p.body == body::point && p.slot <= slot::z)) {
      return Refusal::bad_place;
    }
    if (static_cast<std::uint8_t>(term.basis) >= basis_count) return Refusal::unknown_basis;
    if (static_cast<std::uint8_t>(term.factor) > static_cast<std::uint8_t>(Factor::payload))
      return Refusal::bad_value;
    if (term.joint >= N) return Refusal::bad_value;
    // The payload is changed before torques are computed, so its change cannot depend on the pose.
    if (p.body == body::load && term.basis != Basis::one) return Refusal::bad_place;
    if (term.basis == Basis::thermal && !(link && (p.slot == slot::a || p.slot == slot::d)))
      return Refusal::bad_place;
    if (term.basis == Basis::link_weight) {
      if (!axial_gravity_) return Refusal::mounting;
      if (term.distal_joint <= term.joint || term.distal_joint >= N) return Refusal::bad_value;
    }
    if (term.basis == Basis::curve || term.basis == Basis::grid) {
      if (term.table >= table_count_) return Refusal::bad_value;
      if ((tables_[term.table].rows != 0) != (term.basis == Basis::grid)) return Refusal::bad_value;
    }
    if (is_constant(term)) {
      if (p.body == body::load) {
        load_edit_[p.slot] += term.coefficient;
      } else if (p.body == body::base) {
        base_[p.slot] += term.coefficient;
        has_base_ = true;
      } else if (p.body == body::tool) {
        tool_[p.slot] += term.coefficient;
      } else {
        constant_[p.body - 1U][p.slot] += term.coefficient;
      }
      return Refusal::none;
    }
    if (effect_count_ >= Cap::terms) return Refusal::too_many_terms;
    effects_[effect_count_++] = term;
    if (reads_direction(term)) reads_direction_ = true;
    if (flexcomp::needs_loads(term.basis, term.factor)) needs_loads_ = true;
    if (p.body == body::base) {
      has_base_ = true;
      base_moves_ = true;
    } else if (p.body == body::tool) {
      tool_moves_ = true;
    } else if (link) {
      link_moves_[p.body - 1U] = static_cast<std::uint8_t>(link_moves_[p.body - 1U] | (1U << p.slot));
    }
    return Refusal::none;
  }

  /// Adds up the constant terms and plans the control cycle. Called once, after the last add(). A controller that may not
  /// stay away long calls its parts, finish_chain(), finish_bounds() and finish_size().
  void finish() {
    finish_chain();
    finish_bounds();
    finish_size();
  }
  /// First part of finish().
  FLEXCOMP_RARE void finish_chain() {
    for (std::size_t i = 0; i < N; ++i) {
      shape_[i] = nominal_[i];
      shape_[i].offset = rotate(nominal_[i].offset, constant_[i][slot::theta]);
      shape_[i].d += constant_[i][slot::d];
      shape_[i].a += constant_[i][slot::a];
      shape_[i].alpha = rotate(nominal_[i].alpha, constant_[i][slot::alpha]);
      shape_[i].beta = rotate(nominal_[i].beta, constant_[i][slot::beta]);
      shape_[i].has_beta = nominal_[i].has_beta || !is_zero(constant_[i][slot::beta]) ||
                           (link_moves_[i] & (1U << slot::beta)) != 0;
    }
    base_pose_ = small_pose(base_);
    tool_pose_ = nominal_tool_ * small_pose(tool_);
    plan_.set(*this);
  }
  /// Second part of finish().
  void finish_bounds() { plan_.bound_derivatives(*this); }
  /// Third part of finish().
  void finish_size() { tool_motion_ = detail::tool_motion_of(*this); }

  /// begin(), all tables and terms of a list, finish(); the first refusal ends it.
  Refusal prepare(const NominalRobot<N>& robot, const TermList<S>& list) {
    begin(robot);
    for (std::size_t k = 0; k < list.table_count; ++k) {
      if (!has_values(list, list.tables[k])) return Refusal::bad_value;
      const Refusal r = add_table(list.tables[k], list.values + list.tables[k].offset);
      if (r != Refusal::none) return r;
    }
    for (std::size_t k = 0; k < list.count; ++k) {
      const Refusal r = add(list.terms[k]);
      if (r != Refusal::none) return r;
    }
    finish();
    return Refusal::none;
  }

  const NominalRobot<N>& robot() const { return robot_; }                   ///< of begin()
  const LinkShape<S>& nominal(std::size_t i) const { return nominal_[i]; }  ///< link i (from 0) without terms
  const LinkShape<S>& shape(std::size_t i) const { return shape_[i]; }  ///< link i with its constant terms
  const Pose<S>& nominal_tool() const { return nominal_tool_; }         ///< Ftool in F6 without terms
  const Pose<S>& tool_pose() const { return tool_pose_; }  ///< Ftool in F6 with its constant terms
  const Pose<S>& base_pose() const { return base_pose_; }  ///< B with its constant terms
  const std::array<S, 6>& base() const { return base_; }   ///< constant part, m and rad
  const std::array<S, 6>& tool() const { return tool_; }   ///< constant part, m and rad
  /// Constant parts of the slots of link i (from 0), m and rad.
  const std::array<S, 6>& constant(std::size_t i) const { return constant_[i]; }
  S lower(std::size_t i) const { return lower_[i]; }                  ///< joint limit, rad
  S upper(std::size_t i) const { return upper_[i]; }                  ///< joint limit, rad
  const Vector3<S>& gravity() const { return gravity_; }              ///< m/s^2, in F0
  S reference_temperature() const { return reference_temperature_; }  ///< deg C
  const std::array<S, 4>& load_edit() const { return load_edit_; }    ///< kg, m
  bool has_base() const { return has_base_; }                         ///< B is not 1
  bool base_moves() const { return base_moves_; }                     ///< some effect acts on B
  bool tool_moves() const { return tool_moves_; }                     ///< some effect acts on the tool
  bool needs_loads() const { return needs_loads_; }          ///< some effect needs the unloaded pass (M15)
  bool reads_direction() const { return reads_direction_; }  ///< of the context
  /// Slots of link i (from 0) that effects act on, as bits 1 << slot.
  std::uint8_t link_moves(std::size_t i) const { return link_moves_[i]; }
  std::size_t effect_count() const { return effect_count_; }          ///< terms that are not constant
  const Term<S>& effect(std::size_t k) const { return effects_[k]; }  ///< term k of them
  const Table& table(std::size_t k) const { return tables_[k]; }      ///< table k
  std::size_t table_count() const { return table_count_; }            ///< number of tables
  /// Values of a table.
  const S* values(const Table& table) const { return values_.data() + table.offset; }

  const std::array<LinkShape<S>, N>& nominals() const { return nominal_; }  ///< links without terms
  const std::array<LinkShape<S>, N>& shapes() const { return shape_; }  ///< links with their constant terms
  bool has_axial_gravity() const { return axial_gravity_; }             ///< along z of F0
  /// Constant part of the offset of joint i, rad.
  S constant_theta(std::size_t i) const { return constant_[i][slot::theta]; }
  /// What the control cycle needs beside the chain.
  const detail::CyclePlan<S, N, Cap>& plan() const { return plan_; }
  /// Effect k of one of the plan's groups (detail::group).
  const Term<S>& effect_of(std::uint8_t group, std::size_t k) const {
    return effects_[plan_.index(group, k)];
  }
  /// How far the set moves the tool at most, for the thresholds of (C9).
  const ToolMotion<S>& tool_motion() const { return tool_motion_; }

 private:
  bool reads_direction(const Term<S>& t) const {
    if (t.basis == Basis::direction) return true;
    return t.basis == Basis::grid && (tables_[t.table].row_covariate == Covariate::direction ||
                                      tables_[t.table].column_covariate == Covariate::direction);
  }

  static bool is_zero(double v) { return bits_of(v) << 1U == 0; }
  static bool is_zero(float v) { return to_binary64_bits(v) << 1U == 0; }
  template <class T>
  static bool is_zero(const T&) {
    return false;  // a dual number's derivative counts although its value is zero
  }

  NominalRobot<N> robot_{};
  std::array<LinkShape<S>, N> nominal_{};
  std::array<LinkShape<S>, N> shape_{};
  std::array<std::array<S, 6>, N> constant_{};
  std::array<S, N> lower_{};
  std::array<S, N> upper_{};
  std::array<S, 6> base_{};
  std::array<S, 6> tool_{};
  std::array<S, 4> load_edit_{};
  Pose<S> nominal_tool_{};
  Pose<S> tool_pose_{};
  Pose<S> base_pose_{};
  Vector3<S> gravity_ = Vector3<S>::Zero();
  S reference_temperature_ = S(20);
  bool has_base_ = false;
  bool base_moves_ = false;
  bool tool_moves_ = false;
  bool needs_loads_ = false;
  bool reads_direction_ = false;
  bool axial_gravity_ = true;
  std::array<std::uint8_t, N> link_moves_{};
  ToolMotion<S> tool_motion_{};
  detail::CyclePlan<S, N, Cap> plan_{};
  std::size_t effect_count_ = 0;
  std::size_t table_count_ = 0;
  std::size_t value_count_ = 0;
  std::array<Term<S>, Cap::terms> effects_{};
  std::array<Table, Cap::tables> tables_{};
  std::array<S, Cap::values> values_{};
};

}  // namespace flexcomp

#endif
