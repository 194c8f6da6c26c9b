// SPDX-License-Identifier: Apache-2.0
#include "planning/plan_task.hpp"

#include <fmt/format.h>

#include <utility>

#include "errors.hpp"
#include "measurement/reflectors.hpp"
#include "named_values.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

constexpr std::size_t most_candidates = 100000;

}  // namespace

PlanTask::PlanTask(const Robot& of, std::optional<Cell> in, const PlanSettings& with,
                   const std::optional<MeasuredData>& candidates, const std::optional<MeasuredData>& measured)
    : robot(of), cell(std::move(in)), settings(with), feasibility_(robot, cell) {
  const auto add_warnings = [this](const std::vector<std::string>& more) {
    warnings.insert(warnings.end(), more.begin(), more.end());
  };
  if (!robot.has_noise) {
    warnings.push_back(fmt::format("{}: no noise given; {:.3g} mm and {:.3g} deg are assumed", robot.path,
                                   robot.position_sigma_m * 1e3, degrees(robot.orientation_sigma_rad)));
  }
  add_warnings(feasibility_.warnings());
  if (measured) add_warnings(measured->warnings);
  problem.poses = settings.poses;
  problem.limits = robot.nominal.limits;
  problem.feasible = [this](const Joints& q) { return feasibility_.allows(q); };
  payload_column = !settings.payloads_kg.empty();
  PoseContext context = default_context<double>(robot.nominal);
  if (settings.payloads_kg.empty()) problem.payloads = {context};
  for (const double kg : settings.payloads_kg) {
    context.payload_kg = kg;
    problem.payloads.push_back(context);
  }
  take_measured(measured);
  if (candidates) {
    add_warnings(candidates->warnings);
    take_candidates(*candidates);
  }
  method = settings.method.value_or(candidates ? Method::exchange : Method::refine);
  sample_feasibility();
  // Names the obstructions where nearly nothing is feasible.
  if (!candidates) feasible_poses(feasibility_, robot, 1, settings.seed);

  std::vector<PlannedMeasurement> like;
  for (const PoseContext& c : problem.payloads) like.push_back({Joints{}, c, problem.instrument});
  like.insert(like.end(), known.begin(), known.end());
  problem.information =
      std::make_shared<PoseInformation>(robot, settings.model, settings.fit_frames, like, settings.seed);
  std::vector<Block> blocks(known.size());
  for (std::size_t k = 0; k < known.size(); ++k) problem.information->block(known[k], blocks[k]);
  problem.set_measured(std::move(blocks));
  check_number();
}

Instrument PlanTask::instrument(MeasurementKind kind, std::size_t reflectors, double position_sigma_m,
                                double orientation_sigma_rad) const {
  if (kind == MeasurementKind::position) return Instrument::position(position_sigma_m);
  if (kind == MeasurementKind::pose) return Instrument::pose(position_sigma_m, orientation_sigma_rad);
  const Points points(reflectors_m_.begin(), reflectors_m_.begin() + static_cast<std::ptrdiff_t>(reflectors));
  if (on_one_line(points)) {
    throw InputError(robot.path, 0, "tool.reflectors_mm", "three reflectors that are not on one line",
                     "A, B, C on one line");
  }
  return Instrument::reflectors(points, position_sigma_m);
}

/// What has been measured, with the contexts and the noise it was measured with; and how the rest will be.
void PlanTask::take_measured(const std::optional<MeasuredData>& data) {
  measure = settings.measure.value_or(MeasurementKind::pose);
  if (!settings.measure && data && data->kind != MeasurementKind::joints) measure = data->kind;
  reflectors_m_ = robot.reflectors_m;
  if (reflectors_m_.empty() && data && data->kind == MeasurementKind::reflectors) {
    std::vector<Points> seen;
    for (const Measurement& row : data->rows) {
      seen.emplace_back(row.reflector_m.begin(),
                        row.reflector_m.begin() + static_cast<std::ptrdiff_t>(data->reflectors));
    }
    reflectors_m_ = estimate_template(seen);
  }
  if (measure == MeasurementKind::reflectors && reflectors_m_.empty()) {
    throw InputError(robot.path, 0, "tool.reflectors_mm", "reflectors a, b, c (, d)", "nothing",
                     ErrorCode::no_reflectors);
  }
  problem.instrument =
      instrument(measure, reflectors_m_.size(), robot.position_sigma_m, robot.orientation_sigma_rad);
  if (!data) return;
  measured_file = data->path;
  for (const Measurement& row : data->rows) {
    if (data->kind == MeasurementKind::joints) {
      known.push_back({row.q_rad, row.context, problem.instrument});
      continue;
    }
    if (data->kind == MeasurementKind::reflectors && reflectors_m_.size() < data->reflectors) {
      throw InputError(robot.path, 0, "tool.reflectors_mm.d",
                       fmt::format("reflector D, which {} has", measured_file), "nothing");
    }
    known.push_back(
        {row.q_rad, row.context,
         instrument(data->kind, data->reflectors, row.position_sigma_m, row.orientation_sigma_rad)});
  }
}

void PlanTask::take_candidates(const MeasuredData& file) {
  candidates_file = file.path;
  if (file.rows.size() > most_candidates) {
    throw InputError(candidates_file, 0, "", fmt::format("at most {} candidates", most_candidates),
                     fmt::format("{}", file.rows.size()));
  }
  payload_column = payload_column || file.columns.payload_mass;
  std::vector<PoseContext> contexts;
  std::string left_out;
  std::size_t left_out_count = 0;
  for (const Measurement& row : file.rows) {
    if (!feasibility_.allows(row.q_rad)) {
      if (++left_out_count <= 5) {
        left_out += fmt::format("\n  line {}: {}", row.line, feasibility_.why(row.q_rad));
      }
      continue;
    }
    if (!file.columns.payload_mass) {
      for (std::size_t p = 0; p < problem.payloads.size(); ++p) problem.candidates.push_back({row.q_rad, p});
      continue;
    }
    // The payloads of the list take the place of those to choose from.
    std::size_t which = 0;
    while (which < contexts.size() && contexts[which].payload_kg != row.context.payload_kg) ++which;
    if (which == contexts.size()) {
      contexts.push_back(problem.payloads.front());
      contexts.back().payload_kg = row.context.payload_kg;
    }
    problem.candidates.push_back({row.q_rad, which});
  }
  if (file.columns.payload_mass && !contexts.empty()) problem.payloads = contexts;
  if (left_out_count > 0) {
    warnings.push_back(fmt::format("{}: {} of {} candidates cannot be taken and are left out:{}{}",
                                   candidates_file, left_out_count, file.rows.size(), left_out,
                                   left_out_count > 5 ? "\n  …" : ""));
  }
  const std::size_t rest = file.rows.size() - left_out_count;
  if (rest * (file.columns.payload_mass ? 1 : problem.payloads.size()) < settings.poses) {
    throw InputError(candidates_file, 0, "",
                     fmt::format("{} candidates or more that can be taken", settings.poses),
                     fmt::format("{} of {}", rest, file.rows.size()));
  }
}

/// Also where no candidate is random: what the cell leaves of the joint space, and what takes the rest.
void PlanTask::sample_feasibility() {
  std::map<Obstruction, std::size_t> count;
  std::mt19937_64 random = random_of(settings.seed, 3);
  for (std::size_t k = 0; k < feasibility_samples; ++k) {
    Joints q;
    for (std::size_t j = 0; j < joint_count; ++j) {
      const JointLimits& limits = problem.limits[j];
      q[j] = limits.min_rad + (limits.max_rad - limits.min_rad) * uniform(random);
    }
    ++count[feasibility_.check(q)];
  }
  for (const auto& [obstruction, n] : count) {
    (obstruction == Obstruction::none ? feasible_share : obstructed[obstruction]) =
        static_cast<double>(n) / feasibility_samples;
  }
}

/// Fewer poses than unknowns need give a singular information matrix.
void PlanTask::check_number() {
  const PoseInformation& information = *problem.information;
  const auto least = least_poses(problem, settings.seed);
  if (!least) {
    throw InputError(
        candidates_file.empty() ? robot.path : candidates_file, 0, "",
        fmt::format("poses that make {} parameters of {} known", information.parameters(), robot.name),
        "all of them together do not");
  }
  if (settings.poses < *least) {
    throw ArgumentError(
        ErrorCode::too_few_poses,
        fmt::format(
            "{} {} of kind '{}' cannot know {} parameters{} of {}; the least number is {}", settings.poses,
            settings.poses == 1 ? "pose" : "poses", name_in(measurement_kinds, measure),
            information.parameters(),
            information.nuisance() > 0 ? fmt::format(" and {} frame parameters", information.nuisance()) : "",
            robot.name, *least));
  }
  const std::size_t numbers =
      (settings.poses + known.size()) * static_cast<std::size_t>(problem.instrument.rows());
  if (numbers <= static_cast<std::size_t>(information.unknowns())) {
    warnings.push_back(
        fmt::format("{} measured numbers for {} unknowns: nothing will be left to check the result against",
                    numbers, information.unknowns()));
  }
}

}  // namespace flexcomp::host
