// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/candidates.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include "model/effects/descriptor.hpp"

namespace flexcomp::host {

namespace {

constexpr double everything_after_s = -1e300;

bool varies(const std::vector<Observation>& rows, double (*value)(const Observation&)) {
  for (const Observation& row : rows) {
    if (std::abs(value(row) - value(rows.front())) > 1e-9) return true;
  }
  return false;
}

/// Numbers of coefficients that are tried: no more than half as many as there are poses, and no finer than 128, which
/// follows structure down to 6 degrees.
std::vector<std::size_t> curve_sizes(std::size_t poses) {
  if (poses >= 600) return {12, 36, 128};
  if (poses >= 300) return {8, 12, 24, 72};
  std::vector<std::size_t> sizes;
  for (const std::size_t size : {6U, 8U, 12U, 16U, 24U, 36U}) {
    if (2 * size <= poses) sizes.push_back(size);
  }
  return sizes;
}

/// Standard deviations of the coefficients of fine curves, rad: a prior lets them follow structure that is finer than
/// the data would bear without one.
constexpr std::size_t finest_free_curve = 24;
constexpr std::array<double, 3> smooth_sizes_rad{5e-5, 1.5e-4, 5e-4};

/// Columns that the rows lack for an effect, or that never vary.
std::vector<std::string> lacking(const EffectDescriptor& d, const Testable& can,
                                 const ContextColumns& columns) {
  std::vector<std::string> needs;
  const auto need = [&needs](bool there, const std::string& column) {
    if (!there) needs.push_back(column);
  };
  if (d.needs == Needs::load) need(can.payload, "payload_kg");
  if (d.needs == Needs::temperature) need(can.temperature, "temp_c");
  if (d.needs == Needs::time) need(can.time, "time_s");
  for (std::size_t j = 0; j < joint_count; ++j) {
    const std::string joint = std::to_string(j + 1);
    if (d.needs == Needs::direction) need(can.direction[j], "dir" + joint);
    if (d.needs == Needs::moves) need(can.relative_speed || columns.move[j], "move" + joint + "_deg");
  }
  return needs;
}

/// The lowest body that stands on the floor: where a pedestal gives way.
double pivot_of(const Robot& robot) {
  double lowest = 0;
  for (const auto& c : robot.capsules) {
    if (c.frame == 0) lowest = std::min({lowest, c.from_m[2], c.to_m[2]});
  }
  return lowest;
}

/// Every id of an effect on this arm; those that its rule refuses among them.
std::vector<EffectId> ids_of(const EffectDescriptor& d, const Robot& robot, std::size_t poses) {
  std::vector<EffectId> ids{{.effect = d.effect}};
  const auto each = [&ids](const auto& expand) {
    std::vector<EffectId> all;
    for (const EffectId& id : ids) expand(id, all);
    ids = std::move(all);
  };
  const auto numbers = [&each](unsigned EffectId::*member, unsigned first) {
    each([&](EffectId id, std::vector<EffectId>& all) {
      for (id.*member = first; id.*member <= joint_count; ++(id.*member)) all.push_back(id);
    });
  };
  for (const Selector s : d.selectors) {
    switch (s) {
      case Selector::joint:
        numbers(&EffectId::joint, 1);
        break;
      case Selector::from:
        numbers(&EffectId::from, 1);
        break;
      case Selector::link:
        numbers(&EffectId::link, d.all_links_by_default ? 0 : 1);
        break;
      case Selector::order:
        each([&](EffectId id, std::vector<EffectId>& all) {
          for (const double order : d.orders(robot, id.joint)) {
            id.order = order;
            all.push_back(id);
          }
        });
        break;
      case Selector::size:
        each([&](EffectId id, std::vector<EffectId>& all) {
          for (const std::size_t size : curve_sizes(poses)) {
            id.coefficients = size;
            all.push_back(id);
          }
        });
        break;
      case Selector::pivot:
        ids.front().pivot_z_m = pivot_of(robot);
        break;
      case Selector::after:
        ids.front().after_s = everything_after_s;
        break;
      case Selector::factor:
        break;
      case Selector::place:
      case Selector::grid:
        return {};  // smooth functions stand in for them
    }
  }
  return ids;
}

}  // namespace

Testable testable(const std::vector<Observation>& rows, const ContextColumns& columns) {
  Testable t;
  t.payload = std::ranges::any_of(rows, [](const Observation& r) {
    const auto& f = r.context.force_n;
    return r.context.payload_kg != 0 || f[0] != 0 || f[1] != 0 || f[2] != 0;
  });
  t.temperature =
      columns.temperature && varies(rows, [](const Observation& r) { return r.context.temperature_c; });
  t.time = columns.time && varies(rows, [](const Observation& r) { return r.context.time_s; });
  t.relative_speed = columns.all_moves();
  for (std::size_t j = 0; j < joint_count; ++j) {
    bool up = false;
    bool down = false;
    for (const Observation& row : rows) {
      up = up || row.context.direction[j] > 0;
      down = down || row.context.direction[j] < 0;
    }
    t.direction[j] = up && down;
  }
  return t;
}

CandidateSet candidates(const Robot& robot, const std::vector<Observation>& rows,
                        const ContextColumns& columns, const TermSet& set) {
  const Testable can = testable(rows, columns);
  CandidateSet out;
  ParametricModel model;
  model.set = set;
  const std::vector<EffectGroup> present = effects_of(set, robot.nominal);
  for (const EffectDescriptor& d : all_effects()) {
    const std::vector<std::string> needs = lacking(d, can, columns);
    if (!needs.empty()) out.not_testable.push_back({d.effect, needs});
    for (const EffectId& id : ids_of(d, robot, rows.size())) {
      const bool is_testable = d.needs == Needs::direction ? can.direction[id.joint - 1] : needs.empty();
      if (!is_testable || validation_error(id, robot.nominal) ||
          std::ranges::any_of(present, [&](const EffectGroup& group) { return same_name(group.id, id); }))
        continue;
      Candidate c;
      c.id = id;
      c.positive = d.is_nonnegative;
      c.first = model.parameters.size();
      c.steps = d.has(Selector::after);
      add_effect(model, id, robot.nominal);
      std::vector<std::vector<std::size_t>> forms = d.forms;
      if (forms.empty()) {
        forms.emplace_back(model.parameters.size() - c.first);
        std::iota(forms.back().begin(), forms.back().end(), std::size_t{0});
      }
      for (const std::vector<std::size_t>& form : forms) {
        c.parameters.clear();
        for (const std::size_t k : form) c.parameters.push_back(c.first + k);
        out.list.push_back(c);
      }
      if (id.coefficients < finest_free_curve) continue;
      for (const double size : smooth_sizes_rad) {
        c.prior_rad = size;
        out.list.push_back(c);
      }
    }
  }
  out.set = std::move(model.set);
  out.parameters = std::move(model.parameters);
  return out;
}

}  // namespace flexcomp::host
