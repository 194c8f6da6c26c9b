// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/effect_profile.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "flexcomp/identification.hpp"
#include "identification/fitted_calibration.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

constexpr std::size_t line_points = 181;

/// What an effect is drawn over.
struct Abscissa {
  enum class Kind { reading, direction, speed, torque };
  std::string name;
  Kind kind = Kind::reading;  ///< over a reading the line covers all angles, not only where rows are
  std::size_t joint = 0;      ///< from 0
};

/// The quantity on the x axis: of an effect whose terms all turn its joint and read one quantity of one joint.
std::optional<Abscissa> abscissa(const EffectId& id, const Nominal& robot) {
  std::optional<Abscissa> out;
  for (const EffectKey& key : keys(id, robot)) {
    for (const Term<double>& term : key.terms) {
      if (term.place != Place{static_cast<std::uint8_t>(id.joint), slot::theta}) return std::nullopt;
      const unsigned joint = term.joint + 1U;
      switch (term.basis) {
        case Basis::curve:
          if (term.factor != Factor::one) return std::nullopt;  // a function of two things
          [[fallthrough]];
        case Basis::joint_position:
        case Basis::sine:
        case Basis::cosine:
          out = {fmt::format("q{} [deg]", joint), Abscissa::Kind::reading, term.joint};
          break;
        case Basis::direction:
          out = {fmt::format("direction of joint {} before the pose", joint), Abscissa::Kind::direction,
                 term.joint};
          break;
        case Basis::relative_speed:
          out = {fmt::format("relative speed of joint {}", joint), Abscissa::Kind::speed, term.joint};
          break;
        case Basis::load_torque:
        case Basis::load_torque_cubed:
          out = {fmt::format("load torque on joint {} [N m]", joint), Abscissa::Kind::torque, term.joint};
          break;
        default:
          return std::nullopt;
      }
    }
  }
  return out;
}

double x_of(const Abscissa& a, const HostModel& model, const Observation& row) {
  if (a.kind == Abscissa::Kind::reading) return degrees(row.q_rad[a.joint]);
  if (a.kind == Abscissa::Kind::direction) return row.context.direction[a.joint];
  if (a.kind == Abscissa::Kind::speed) return row.context.relative_speed[a.joint];
  Linearisation<double, joint_count> at;
  linearise(model, row.q_rad, row.context, at);
  return detail::moment_about<double>(at.unloaded.load, at.unloaded.frames.axis(a.joint, 2),
                                      at.unloaded.frames.origin[a.joint]);
}

/// A turn of the joint that follows nothing: cos(0 q). No constant of the chain, or loads would be taken elsewhere.
Parameter add_turn(TermSet& set, Place place) {
  Term<double> t;
  t.place = place;
  t.basis = Basis::cosine;
  t.joint = static_cast<std::uint8_t>(place.body - 1U);
  t.effect = Effect::gear_harmonic;
  t.instance = next_instance(set);
  t.argument = 0;
  t.coefficient = 0;
  set.terms.push_back(t);
  return {"turn", unit::si, {set.terms.size() - 1}, {}};
}

/// The part of `column` along `turn` at row k, per unit of the turn.
double along(const Eigen::VectorXd& column, const Eigen::VectorXd& turn, Eigen::Index k) {
  const auto t = turn.segment<6>(6 * k);
  const double square = t.squaredNorm();
  return square > 0 ? t.dot(column.segment<6>(6 * k)) / square : 0.0;
}

}  // namespace

std::optional<EffectProfile> profile_of(const Robot& robot, const Calibration& calibration,
                                        const EffectId& id, const std::vector<Observation>& rows) {
  const auto what = abscissa(id, robot.nominal);
  if (!what || rows.empty()) return std::nullopt;
  const auto groups = effects_of(calibration.terms, robot.nominal);
  const auto group =
      std::ranges::find_if(groups, [&](const EffectGroup& g) { return name(g.id) == name(id); });
  if (group == groups.end()) return std::nullopt;

  Estimate with = estimate_of(calibration);
  Unknowns unknowns;
  unknowns.parameters.push_back(add_turn(with.set, {static_cast<std::uint8_t>(id.joint), slot::theta}));
  unknowns.parameters.insert(unknowns.parameters.end(), group->parameters.begin(), group->parameters.end());
  Estimate without = with;
  for (const Parameter& p : group->parameters) p.set(without.set, 0);
  const auto model = prepare(with.set, robot, calibration.path);
  const auto bare = prepare(without.set, robot, calibration.path);
  const Eigen::VectorXd units = units_of(unknowns, with.set);

  EffectProfile out;
  out.x_name = what->name;
  out.cases = what->kind == Abscissa::Kind::direction;
  const Linearised now = linearised(with, *model, rows, unknowns);
  const Linearised then = linearised(without, *bare, rows, {{}, {unknowns.parameters.front()}, {}});
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    ProfileRow r;
    r.x = x_of(*what, *model, rows[k]);
    r.without_rad = along(then.residual, then.derivative.col(0), i) * units[0];
    r.left_rad = along(now.residual, now.derivative.col(0), i) * units[0];
    const double stiffness = now.derivative.col(0).segment<6>(6 * i).norm();
    if (!(stiffness > 0)) continue;
    r.sigma_rad = units[0] / stiffness;
    out.rows.push_back(r);
  }

  // The line: over all angles that were measured, or where the rows are.
  std::vector<Observation> places = rows;
  if (what->kind == Abscissa::Kind::reading) {
    const auto [low, high] = std::ranges::minmax_element(
        rows, [&](const auto& a, const auto& b) { return a.q_rad[what->joint] < b.q_rad[what->joint]; });
    const double from = low->q_rad[what->joint], to = high->q_rad[what->joint];
    places.assign(line_points, rows.front());
    for (std::size_t k = 0; k < line_points; ++k) {
      places[k].q_rad[what->joint] = from + (to - from) * static_cast<double>(k) / (line_points - 1);
    }
  } else if (out.cases) {
    places.assign(2, rows.front());
    places[0].context.direction[what->joint] = -1;
    places[1].context.direction[what->joint] = 1;
  }
  // How the value depends on each number of the effect, read off the model's own derivatives.
  Eigen::MatrixXd covariance;
  if (calibration.covariance) {
    const auto& known = calibration.covariance->parameters;
    const Eigen::MatrixXd columns = calibration.covariance->columns();
    Eigen::MatrixXd factor =
        Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(group->parameters.size()), columns.cols());
    for (std::size_t p = 0; p < group->parameters.size(); ++p) {
      const auto at = std::ranges::find(known, group->parameters[p].name);
      if (at != known.end()) factor.row(static_cast<Eigen::Index>(p)) = columns.row(at - known.begin());
    }
    covariance = factor * factor.transpose();
  }
  const Linearised drawn = linearised(with, *model, places, unknowns);
  const auto count = static_cast<Eigen::Index>(places.size());
  Eigen::MatrixXd slopes(count, static_cast<Eigen::Index>(group->parameters.size()));
  for (Eigen::Index k = 0; k < count; ++k) {
    const Observation& row = places[static_cast<std::size_t>(k)];
    ProfilePoint point;
    point.x = x_of(*what, *model, row);
    for (Eigen::Index p = 0; p < slopes.cols(); ++p) {
      slopes(k, p) = along(drawn.derivative.col(p + 1), drawn.derivative.col(0), k) * units[0] / units[p + 1];
      point.value_rad += slopes(k, p) * group->parameters[static_cast<std::size_t>(p)].get(with.set);
    }
    out.line.push_back(point);
  }
  if (covariance.size() > 0) {
    // A turn of the joint that is the same everywhere is geometry: that this is not known is not the effect's doubt.
    const Eigen::RowVectorXd mean = slopes.colwise().mean();
    for (Eigen::Index k = 0; k < count; ++k) {
      const Eigen::RowVectorXd slope = slopes.row(k) - mean;
      out.line[static_cast<std::size_t>(k)].sigma_rad =
          std::sqrt(std::max(0.0, (slope * covariance * slope.transpose()).value()));
    }
  }
  std::ranges::sort(out.line, [](const auto& a, const auto& b) { return a.x < b.x; });
  return out;
}

}  // namespace flexcomp::host
