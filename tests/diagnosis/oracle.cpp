#include "oracle.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "identification/identifiability.hpp"
#include "identification/prior_knowledge.hpp"

namespace judging {

using namespace flexcomp::host;
using flexcomp::Effect;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// An orthonormal basis that grows by what new columns add to it; what adds less than structural_tolerance of its norm
/// adds nothing.
class Span {
 public:
  explicit Span(Index rows) : basis_(rows, 0) {}

  const MatrixXd& basis() const { return basis_; }

  void add(const MatrixXd& columns) {
    MatrixXd fresh(basis_.rows(), 0);
    for (Index k = 0; k < columns.cols(); ++k) {
      const double norm = columns.col(k).norm();
      if (!(norm > 0)) continue;
      VectorXd v = columns.col(k);
      for (int twice = 0; twice < 2; ++twice) {
        v -= basis_ * (basis_.transpose() * v);
        if (fresh.cols() > 0) v -= fresh * (fresh.transpose() * v);
      }
      if (v.norm() < structural_tolerance * norm) continue;
      fresh.conservativeResize(Eigen::NoChange, fresh.cols() + 1);
      fresh.col(fresh.cols() - 1) = v.normalized();
    }
    const Index before = basis_.cols();
    basis_.conservativeResize(Eigen::NoChange, before + fresh.cols());
    basis_.rightCols(fresh.cols()) = fresh;
  }

 private:
  MatrixXd basis_;
};

/// Columns that are added to a model under one name.
struct Candidate {
  EffectId id;
  MatrixXd columns;
  double further_parameters = 0;  ///< of the basis, e.g. the time of a slip
  bool positive = false;          ///< with a negative coefficient it is not this effect
};

/// What a candidate gains over a span: chi-square less the price of its parameters.
double bic_gain(const Candidate& candidate, const Span& span, const VectorXd& left, double log_n) {
  // Against what the span leaves of the columns: one product for all of them, then Gram and Schmidt among themselves.
  const MatrixXd projected =
      candidate.columns - span.basis() * (span.basis().transpose() * candidate.columns);
  MatrixXd fresh(projected.rows(), projected.cols());
  Index rank = 0;
  double gain = 0;
  for (Index k = 0; k < projected.cols(); ++k) {
    const double norm = candidate.columns.col(k).norm();
    if (!(norm > 0)) continue;
    VectorXd v = projected.col(k);
    for (int twice = 0; twice < 2; ++twice)
      v -= fresh.leftCols(rank) * (fresh.leftCols(rank).transpose() * v);
    const double length = v.norm();
    if (length < structural_tolerance * norm) continue;
    fresh.col(rank) = v / length;
    const double along = fresh.col(rank).dot(left);
    if (candidate.positive && along < 0) return 0;
    gain += along * along;
    ++rank;
  }
  return rank == 0 ? 0 : gain - (static_cast<double>(rank) + candidate.further_parameters) * log_n;
}

MatrixXd columns_of(const MatrixXd& all, const std::vector<std::size_t>& which) {
  MatrixXd out(all.rows(), static_cast<Index>(which.size()));
  for (std::size_t k = 0; k < which.size(); ++k)
    out.col(static_cast<Index>(k)) = all.col(static_cast<Index>(which[k]));
  return out;
}

double pivot_of(const hidden::Case& c) {
  for (const hidden::Effect& e : c.hidden) {
    if (e.id.effect == Effect::base_compliance) return e.id.pivot_z_m;
  }
  return c.robot.capsules.empty() ? 0 : c.robot.capsules.front().from_m.z();
}

/// Every wrong name with its columns at the oracle's fit, in the base's rows.
std::vector<Candidate> candidates_of(const hidden::Case& c, const Estimate& at,
                                     const std::vector<Observation>& rows) {
  struct Range {
    EffectId id;
    std::size_t first, count;
  };
  std::vector<Range> ranges;
  ParametricModel model{at.set, {}};
  const auto append = [&](const EffectId& id) {
    const std::size_t first = model.parameters.size();
    add_effect(model, id, c.robot.nominal);
    ranges.push_back({id, first, model.parameters.size() - first});
  };
  for (EffectId id : every_name(c.robot.nominal, pivot_of(c))) {
    if (id.effect != Effect::joint_curve) {
      append(id);
      continue;
    }
    for (const std::size_t size : {6U, 8U, 12U, 16U, 24U, 36U}) {
      id.coefficients = size;
      append(id);
    }
  }
  Estimate estimate = at;
  estimate.set = model.set;
  Unknowns unknowns;
  unknowns.parameters = model.parameters;
  const auto prepared = prepare(estimate.set, c.robot, "oracle");
  const Linearised lin = linearised(estimate, *prepared, rows, unknowns);
  std::vector<Candidate> out;
  for (const Range& r : ranges) {
    Candidate k;
    k.id = r.id;
    k.columns = lin.derivative.middleCols(static_cast<Index>(r.first), static_cast<Index>(r.count));
    k.positive = r.id.effect == Effect::backlash || r.id.effect == Effect::readout_lag;
    if (r.id.effect != Effect::reflector_slip) {
      out.push_back(std::move(k));
      continue;
    }
    // At every time between two rows; which one is a parameter too.
    std::vector<double> times;
    for (const Observation& row : rows) times.push_back(row.context.time_s);
    std::sort(times.begin(), times.end());
    times.erase(std::unique(times.begin(), times.end()), times.end());
    for (std::size_t t = 1; t < times.size(); ++t) {
      Candidate slip = k;
      slip.id.after_s = times[t];
      slip.further_parameters = 1;
      for (std::size_t n = 0; n < rows.size(); ++n) {
        if (rows[n].context.time_s < times[t]) slip.columns.middleRows(6 * static_cast<Index>(n), 6).setZero();
      }
      out.push_back(std::move(slip));
    }
  }
  return out;
}

/// What is hidden, as groups of parameters: effects of the catalogue, one outside, or the paper's own where only
/// geometry was modelled.
struct Group {
  EffectId id;
  std::vector<std::size_t> parameters;  ///< of the oracle's fit
};

}  // namespace

bool Oracle::decidable() const {
  return std::all_of(hidden.begin(), hidden.end(), [](const Hidden& h) { return h.decidable(); });
}

bool same_name(const EffectId& a, const EffectId& b) {
  return a.effect == b.effect && a.joint == b.joint && a.from == b.from && a.link == b.link &&
         a.order == b.order && a.factor == b.factor;
}

std::vector<EffectId> every_name(const Nominal& robot, double pivot_z_m) {
  std::vector<EffectId> names;
  const auto add = [&](EffectId id) {
    if (!fault(id, robot)) names.push_back(std::move(id));
  };
  for (const Effect kind : {Effect::nonlinear_compliance, Effect::backlash, Effect::readout_lag,
                            Effect::encoder_scale, Effect::joint_curve}) {
    for (unsigned j = 1; j <= joint_count; ++j) {
      EffectId id;
      id.effect = kind;
      id.joint = j;
      if (kind == Effect::joint_curve) id.coefficients = 12;
      add(id);
    }
  }
  for (unsigned j = 1; j <= joint_count; ++j) {
    EffectId id;
    id.joint = j;
    id.effect = Effect::gear_harmonic;
    for (int order = 1; order <= 8; ++order) {
      id.order = order;
      add(id);
    }
    id.effect = Effect::axis_wobble;
    for (int order = 1; order <= 2; ++order) {
      id.order = order;
      add(id);
    }
    id.order = 0;
    id.effect = Effect::joint_coupling;
    for (id.from = 1; id.from <= joint_count; ++id.from) add(id);
  }
  for (unsigned link = 0; link <= joint_count; ++link) {
    EffectId id;
    id.link = link;
    id.effect = Effect::thermal_growth;
    add(id);
    id.effect = Effect::link_bending;
    if (link != 0) add(id);
  }
  for (const Effect kind :
       {Effect::base_drift, Effect::base_compliance, Effect::payload_error, Effect::reflector_slip}) {
    EffectId id;
    id.effect = kind;
    if (kind == Effect::base_compliance) id.pivot_z_m = pivot_z_m;
    add(id);
  }
  return names;
}

double rms_m(const Estimate& estimate, const RobotFile& robot, const std::vector<Observation>& rows) {
  const auto model = prepare(estimate.set, robot, "judged rows");
  double sum = 0;
  for (const RowResidual& r : residuals(estimate, *model, rows)) sum += r.position_m.squaredNorm();
  return std::sqrt(sum / static_cast<double>(rows.size()));
}

Oracle oracle_of(const hidden::Case& c) {
  Oracle out;
  const std::vector<Observation> rows = c.clean_train();
  IdentifyOptions options;
  if (c.row == hidden::Row::geometry) options.model = ModelKind::geometric;
  out.before = identify(c.robot, c.train, "training rows", options);
  const Identification full =
      c.row == hidden::Row::geometry ? identify(c.robot, c.train, "training rows", {}) : out.before;

  // The model of the paper first, then what is hidden; columns that the earlier ones carry are left out.
  ParametricModel model{full.fit.estimate.set, full.known.fitted.parameters};
  const std::size_t of_paper = model.parameters.size();
  hidden::append_hidden(model, c, true);
  Estimate start = full.fit.estimate;
  start.set = model.set;
  Unknowns all;
  all.frames = full.known.fitted.frames;
  all.parameters = model.parameters;
  const Index frames = static_cast<Index>(all.frames.size());
  std::vector<bool> kept(model.parameters.size(), true);
  {
    const auto prepared = prepare(start.set, c.robot, "oracle");
    const MatrixXd columns = linearised(start, *prepared, rows, all).derivative;
    Span span(columns.rows());
    span.add(columns.leftCols(frames + static_cast<Index>(of_paper)));
    for (std::size_t p = of_paper; p < model.parameters.size(); ++p) {
      const Index rank = span.basis().cols();
      span.add(columns.col(frames + static_cast<Index>(p)));
      kept[p] = span.basis().cols() > rank;
    }
  }
  Unknowns fitted;
  fitted.frames = all.frames;
  std::vector<std::size_t> place(model.parameters.size());  // in `fitted`
  for (std::size_t p = 0; p < model.parameters.size(); ++p) {
    place[p] = fitted.parameters.size();
    if (kept[p]) {
      fitted.parameters.push_back(model.parameters[p]);
    } else {
      model.parameters[p].set(start.set, 0);
    }
  }
  fitted.prior = prior_knowledge(start.set, fitted.parameters, true, {});
  EstimatorOptions plain_squares;
  plain_squares.robust = false;
  const Fit fit = flexcomp::host::fit(start, fitted, rows, c.robot, plain_squares);
  out.estimate = fit.estimate;
  out.converged = fit.converged;
  out.chi2 = fit.chi2;

  // What is hidden, group by group.
  std::vector<Group> groups;
  std::size_t next = of_paper;
  const auto take = [&](const EffectId& id, std::size_t count) {
    Group g{id, {}};
    for (std::size_t k = 0; k < count; ++k, ++next) {
      if (kept[next]) g.parameters.push_back(place[next]);
    }
    groups.push_back(g);
  };
  for (const hidden::Effect& e : c.hidden) take(e.id, e.values.size());
  if (c.bump) {
    EffectId id;
    id.effect = Effect::joint_curve;
    id.joint = c.bump->joint;
    take(id, 1);
  }
  if (c.outside) {
    EffectId id;
    id.effect = Effect::unnamed;
    id.place = {static_cast<std::uint8_t>(c.outside->joint), flexcomp::slot::theta};
    take(id, 1);
  }
  if (c.row == hidden::Row::geometry) {
    for (std::size_t p = 0; p < of_paper; ++p) {
      const flexcomp::Term<double>& t = start.set.terms[fitted.parameters[p].terms.front()];
      if (t.effect == Effect::geometric) continue;
      EffectId id;
      id.effect = t.effect;
      id.joint = t.effect == Effect::joint_compliance ? t.place.body : 0U;
      const auto same = std::find_if(groups.begin(), groups.end(),
                                     [&](const Group& g) { return same_name(g.id, id); });
      if (same == groups.end()) {
        groups.push_back({id, {p}});
      } else {
        same->parameters.push_back(p);
      }
    }
  }
  if (groups.empty()) return out;

  // Everything else in the model linearised at the oracle's fit.
  const auto prepared = prepare(out.estimate.set, c.robot, "oracle");
  const Linearised lin = linearised(out.estimate, *prepared, rows, fitted);
  const VectorXd units = units_of(fitted, out.estimate.set);
  VectorXd target = lin.residual;  // what a model without any of the hidden has to explain
  std::vector<MatrixXd> columns;
  std::vector<bool> hidden_column(fitted.count(), false);
  for (const Group& g : groups) {
    std::vector<std::size_t> which;
    for (const std::size_t p : g.parameters) {
      const std::size_t column = fitted.frames.size() + p;
      which.push_back(column);
      hidden_column[column] = true;
      target += lin.derivative.col(static_cast<Index>(column)) *
                (fitted.parameters[p].get(out.estimate.set) / units[static_cast<Index>(column)]);
    }
    columns.push_back(columns_of(lin.derivative, which));
  }
  std::vector<std::size_t> others;
  for (std::size_t k = 0; k < fitted.count(); ++k) {
    if (!hidden_column[k]) others.push_back(k);
  }
  Span core(lin.residual.size());
  core.add(columns_of(lin.derivative, others));
  const std::vector<Candidate> candidates = candidates_of(c, out.estimate, rows);
  const double log_n = std::log(measured_numbers(rows));
  for (std::size_t g = 0; g < groups.size(); ++g) {
    Span rest = core;
    for (std::size_t k = 0; k < groups.size(); ++k) {
      if (k != g) rest.add(columns[k]);
    }
    const VectorXd left = target - rest.basis() * (rest.basis().transpose() * target);
    const double gain = bic_gain({groups[g].id, columns[g], 0, false}, rest, left, log_n);
    Hidden h;
    h.id = groups[g].id;
    h.detection = h.margin = gain;
    h.rival = "nothing";
    for (const Candidate& candidate : candidates) {
      const bool true_name = std::any_of(groups.begin(), groups.end(), [&](const Group& other) {
        return same_name(other.id, candidate.id);
      });
      if (true_name) continue;
      const double margin = gain - bic_gain(candidate, rest, left, log_n);
      if (margin >= h.margin) continue;
      h.margin = margin;
      h.rival = name(candidate.id);
    }
    out.hidden.push_back(h);
  }
  return out;
}

}  // namespace judging
