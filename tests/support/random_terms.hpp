// SPDX-License-Identifier: Apache-2.0
/// \file
/// Terms at every place with every basis, at sizes that occur in factories.
#pragma once

#include <vector>

#include "support/arms.hpp"

namespace arms {

/// All 55 places of a six-axis arm: 36 on links, 6 on the base, 6 on the tool, 4 on the load, 3 of the point.
inline std::vector<flexcomp::Place> all_places() {
  std::vector<flexcomp::Place> places;
  for (std::size_t i = 1; i <= 6; ++i)
    for (std::uint8_t s = 0; s < 6; ++s) places.push_back(on_link(i, s));
  for (std::uint8_t s = 0; s < 6; ++s) places.push_back(on_base(s));
  for (std::uint8_t s = 0; s < 6; ++s) places.push_back(on_tool(s));
  for (std::uint8_t s = 0; s < 4; ++s) places.push_back(on_load(s));
  for (std::uint8_t s = 0; s < 3; ++s) places.push_back(on_point(s));
  return places;
}

inline bool turns(flexcomp::Place p) {
  namespace slot = flexcomp::slot;
  if (p.body == flexcomp::body::base || p.body == flexcomp::body::tool) return p.slot >= slot::rx;
  if (p.body == flexcomp::body::load || p.body == flexcomp::body::point) return false;
  return p.slot != slot::d && p.slot != slot::a;
}

/// A usual error at a place: 0.5 mrad, 0.5 mm, 0.1 kg.
inline double usual_size(flexcomp::Place p) {
  if (p.body == flexcomp::body::load) return p.slot == flexcomp::slot::mass ? 0.1 : 5 * mm;
  return 5e-4;
}

/// What a basis usually comes to, in its own unit: coefficient = usual_size / usual_value.
inline double usual_value(const flexcomp::Term<double>& t) {
  using flexcomp::Basis;
  switch (t.basis) {
    case Basis::load_torque:
    case Basis::load_moment_x:
    case Basis::load_moment_y:
      return 40;  // N·m
    case Basis::base_moment_x:
    case Basis::base_moment_y:
      return 100;  // N·m
    case Basis::load_torque_cubed:
      return 64000;  // (N·m)^3
    case Basis::joint_position:
      return 3;  // rad
    case Basis::thermal:
      return 5;  // K·m
    case Basis::time:
      return 7200;  // s
    case Basis::curve:
      switch (t.factor) {
        case flexcomp::Factor::load_torque:
          return 40;
        case flexcomp::Factor::temperature:
          return 20;
        case flexcomp::Factor::payload:
          return 8;
        default:
          return 1;
      }
    default:
      return 1;
  }
}

/// Tables of order 1: three curves (6, 17 and 64 values) and three grids that read every covariate.
inline void add_usual_tables(TermSet<double>& set, Random& random) {
  for (const std::size_t size : {6U, 17U, 64U}) set.add_curve(random.around(1, size));
  const auto grid = [&](const std::vector<double>& rows, const std::vector<double>& columns,
                        flexcomp::Covariate row, std::uint8_t row_joint, flexcomp::Covariate column,
                        std::uint8_t column_joint) {
    set.add_grid(rows, columns, random.around(1, rows.size() * columns.size()));
    set.tables.back().row_covariate = row;
    set.tables.back().row_joint = row_joint;
    set.tables.back().column_covariate = column;
    set.tables.back().column_joint = column_joint;
  };
  using flexcomp::Covariate;
  grid({-2, -0.5, 0.25, 1.5}, {0, 3, 6}, Covariate::joint_position, 1, Covariate::payload, 0);
  grid({12, 20, 35}, {0, 1800, 3600, 7200}, Covariate::temperature, 0, Covariate::time, 0);
  grid({-1, 0, 1}, {-1, -0.1, 0.1, 1}, Covariate::direction, 2, Covariate::relative_speed, 4);
}

/// Every basis in every variant, at one place, where the model takes it; tables of add_usual_tables().
inline std::vector<flexcomp::Term<double>> all_bases(flexcomp::Place place, Random& random) {
  using flexcomp::Basis;
  namespace slot = flexcomp::slot;
  std::vector<flexcomp::Term<double>> list;
  const auto push = [&](Basis basis, double argument = 0, int joint = -1,
                        flexcomp::Factor factor = flexcomp::Factor::one,
                        std::uint16_t table = flexcomp::no_table) {
    flexcomp::Term<double> t;
    t.place = place;
    t.basis = basis;
    t.joint = static_cast<std::uint8_t>(joint < 0 ? static_cast<int>(random.below(6)) : joint);
    t.factor = factor;
    t.table = table;
    t.argument = argument;
    t.coefficient =
        random.uniform(0.3, 1) * (random.below(2) == 0 ? 1 : -1) * usual_size(place) / usual_value(t);
    list.push_back(t);
  };
  push(Basis::one);
  if (place.body == flexcomp::body::load) return list;
  for (int joint = 0; joint < 6; ++joint) push(Basis::load_torque, 0, joint);
  push(Basis::load_torque_cubed);
  for (int joint = 0; joint < 5; ++joint) {
    const std::size_t beyond = random.below(static_cast<std::size_t>(5 - joint));
    push(Basis::link_weight, 0, joint);
    list.back().distal_joint = static_cast<std::uint8_t>(static_cast<std::size_t>(joint) + 1 + beyond);
  }
  push(Basis::joint_position);
  push(Basis::sine, 2);
  push(Basis::cosine, 100);
  push(Basis::direction);
  push(Basis::relative_speed);
  if (place.body >= 1 && place.body <= 6 && (place.slot == slot::d || place.slot == slot::a))
    push(Basis::thermal);
  push(Basis::time);
  for (int joint = 0; joint < 6; ++joint) {
    push(Basis::load_moment_x, 0, joint);
    push(Basis::load_moment_y, 0, joint);
  }
  push(Basis::base_moment_x, -0.375);
  push(Basis::base_moment_y, 0.6);
  for (const flexcomp::Factor f : {flexcomp::Factor::one, flexcomp::Factor::load_torque,
                                   flexcomp::Factor::temperature, flexcomp::Factor::payload}) {
    push(Basis::curve, 0, -1, f, static_cast<std::uint16_t>(random.below(3)));
  }
  push(Basis::step, random.uniform(0, 7200));
  for (std::uint16_t table = 3; table < 6; ++table) push(Basis::grid, 0, 0, flexcomp::Factor::one, table);
  return list;
}

/// A background in which everything is wrong at once: Table 1, tool and load errors, and `effects` more terms
/// at random places with random bases.
inline TermSet<double> everything(const Arm& arm, Random& random, std::size_t effects = 24) {
  TermSet<double> set = table1(arm);
  add_usual_tables(set, random);
  for (const flexcomp::Place p : all_places()) {
    if (p.body == flexcomp::body::tool || p.body == flexcomp::body::load)
      set.add(p, flexcomp::Basis::one, random.around(usual_size(p)));
  }
  const std::vector<flexcomp::Place> places = all_places();
  while (effects != 0) {
    const flexcomp::Place p = places[random.below(places.size())];
    const std::vector<flexcomp::Term<double>> list = all_bases(p, random);
    const flexcomp::Term<double>& t = list[random.below(list.size())];
    if (t.basis == flexcomp::Basis::one) continue;
    set.terms.push_back(t);
    --effects;
  }
  return set;
}

}  // namespace arms
