// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/candidates.hpp"

#include <algorithm>
#include <cmath>
#include <string>

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

class Builder {
 public:
  Builder(const Robot& robot, const TermSet& set) : robot_(robot) {
    out_.set = set;
    model_.set = set;
    for (EffectGroup& group : effects_of(set, robot.nominal)) present_.push_back(std::move(group.id));
  }

  /// Adds all parameters of an effect in the given forms (indices of its parameters; none: one form of all).
  void add(const EffectId& id, bool positive = false,
           const std::vector<std::vector<std::size_t>>& forms = {}) {
    if (validation_error(id, robot_.nominal)) return;
    for (const EffectId& other : present_) {
      if (same_name(other, id)) return;
    }
    const std::size_t first = model_.parameters.size();
    add_effect(model_, id, robot_.nominal);
    const std::size_t count = model_.parameters.size() - first;
    std::vector<std::vector<std::size_t>> used = forms;
    if (used.empty()) {
      used.emplace_back();
      for (std::size_t k = 0; k < count; ++k) used.back().push_back(k);
    }
    for (const std::vector<std::size_t>& form : used) {
      Candidate c;
      c.id = id;
      c.positive = positive;
      c.first = first;
      for (const std::size_t k : form) c.parameters.push_back(first + k);
      out_.list.push_back(std::move(c));
    }
  }

  /// The effect that was added last once more, its coefficients being of these sizes.
  void smooth_forms(const std::vector<double>& sizes_rad) {
    if (out_.list.empty() || out_.list.back().id.effect != Effect::joint_curve) return;
    const Candidate free = out_.list.back();
    for (const double size : sizes_rad) {
      out_.list.push_back(free);
      out_.list.back().prior_rad = size;
    }
  }

  void lacks(Effect effect, std::vector<std::string> needs) {
    out_.not_testable.push_back({effect, std::move(needs)});
  }

  CandidateSet finish() {
    out_.set = std::move(model_.set);
    out_.parameters = std::move(model_.parameters);
    return std::move(out_);
  }

  CandidateSet& out() { return out_; }

 private:
  const Robot& robot_;
  CandidateSet out_;
  ParametricModel model_;
  std::vector<EffectId> present_;
};

/// The lowest body that stands on the floor: where a pedestal gives way.
double pivot_of(const Robot& robot) {
  double lowest = 0;
  for (const auto& c : robot.capsules) {
    if (c.frame == 0) lowest = std::min({lowest, c.from_m[2], c.to_m[2]});
  }
  return lowest;
}

}  // namespace

bool same_name(const EffectId& a, const EffectId& b) {
  return a.effect == b.effect && a.joint == b.joint && a.from == b.from && a.link == b.link &&
         a.order == b.order && (a.effect != Effect::unnamed || a.place == b.place);
}

Testable testable(const std::vector<Observation>& rows, const ContextColumns& columns) {
  Testable t;
  t.payload = std::any_of(rows.begin(), rows.end(), [](const Observation& r) {
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
  Builder b(robot, set);
  EffectId id;
  const auto each_joint = [&](Effect effect, bool positive) {
    id = EffectId{.effect = effect};
    for (id.joint = 1; id.joint <= joint_count; ++id.joint) b.add(id, positive);
  };
  if (can.payload) {
    each_joint(Effect::joint_compliance, true);
    each_joint(Effect::nonlinear_compliance, false);
    id = EffectId{.effect = Effect::link_bending};
    for (id.link = 1; id.link <= joint_count; ++id.link) b.add(id);
    b.add(EffectId{.effect = Effect::base_compliance, .pivot_z_m = pivot_of(robot)});
    b.add(EffectId{.effect = Effect::payload_error}, false, {{0}, {1, 2, 3}, {0, 1, 2, 3}});
  } else {
    for (const Effect e : {Effect::joint_compliance, Effect::nonlinear_compliance, Effect::link_bending,
                           Effect::base_compliance, Effect::payload_error})
      b.lacks(e, {"payload_kg"});
  }
  b.add(EffectId{.effect = Effect::link_gravity});
  id = EffectId{.effect = Effect::gear_harmonic};
  for (id.joint = 1; id.joint <= joint_count; ++id.joint) {
    for (unsigned order = 1; order <= 8; ++order) {
      id.order = order;
      b.add(id);
    }
    const double ratio = robot.gear_ratio[id.joint - 1];
    for (const double order : {ratio, 2 * ratio}) {
      id.order = order;
      if (order > 8) b.add(id);
    }
  }
  each_joint(Effect::encoder_scale, false);
  id = EffectId{.effect = Effect::joint_coupling};
  for (id.joint = 1; id.joint <= joint_count; ++id.joint) {
    for (id.from = 1; id.from <= joint_count; ++id.from) b.add(id);
  }
  id = EffectId{.effect = Effect::axis_wobble};
  for (id.joint = 1; id.joint <= joint_count; ++id.joint) {
    for (const double order : {1.0, 2.0}) {
      id.order = order;
      b.add(id);
    }
  }
  id = EffectId{.effect = Effect::joint_curve};
  for (id.joint = 1; id.joint <= joint_count; ++id.joint) {
    for (const std::size_t size : curve_sizes(rows.size())) {
      id.coefficients = size;
      b.add(id);
      // Forms with a prior follow structure that is finer than the data would bear without one.
      if (size >= 24) b.smooth_forms({5e-5, 1.5e-4, 5e-4});
    }
  }
  std::vector<std::string> no_direction;
  id = EffectId{.effect = Effect::backlash};
  for (id.joint = 1; id.joint <= joint_count; ++id.joint) {
    if (can.direction[id.joint - 1]) {
      b.add(id, true);
    } else {
      no_direction.push_back("dir" + std::to_string(id.joint));
    }
  }
  if (!no_direction.empty()) b.lacks(Effect::backlash, no_direction);
  if (can.relative_speed) {
    each_joint(Effect::readout_lag, true);
  } else {
    std::vector<std::string> needs;
    for (unsigned j = 1; j <= joint_count; ++j) {
      if (!columns.move[j - 1]) needs.push_back("move" + std::to_string(j) + "_deg");
    }
    b.lacks(Effect::readout_lag, needs);
  }
  if (can.temperature) {
    id = EffectId{.effect = Effect::thermal_growth};
    for (id.link = 0; id.link <= joint_count; ++id.link) b.add(id);
  } else {
    b.lacks(Effect::thermal_growth, {"temp_c"});
  }
  if (can.time) {
    b.add(EffectId{.effect = Effect::base_drift}, false, {{0, 1, 2}, {3, 4, 5}, {0, 1, 2, 3, 4, 5}});
    b.out().has_slip = true;
    // Last, so that its columns are the last three.
    b.add(EffectId{.effect = Effect::reflector_slip, .after_s = everything_after_s});
    b.out().list.back().steps = true;
  } else {
    b.lacks(Effect::base_drift, {"time_s"});
    b.lacks(Effect::reflector_slip, {"time_s"});
  }
  return b.finish();
}

}  // namespace flexcomp::host
