// SPDX-License-Identifier: Apache-2.0
#include "oracle.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>

#include "identification/identifiability.hpp"
#include "identification/prior_knowledge.hpp"
#include "model/covariate.hpp"
#include "model/paper_model.hpp"

namespace judging {

using namespace flexcomp::host;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using flexcomp::Effect;

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
  Unknowns unknowns{.parameters = model.parameters};
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
    std::ranges::sort(times);
    times.erase(std::unique(times.begin(), times.end()), times.end());
    for (std::size_t t = 1; t < times.size(); ++t) {
      Candidate slip = k;
      slip.id.after_s = times[t];
      slip.further_parameters = 1;
      for (std::size_t n = 0; n < rows.size(); ++n) {
        if (rows[n].context.time_s < times[t])
          slip.columns.middleRows(6 * static_cast<Index>(n), 6).setZero();
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

/// A model with its fit: every row has weight 1.
struct Fitted {
  Estimate estimate;
  Unknowns unknowns;
  double chi2 = 0;
  double bic = 0;
  bool converged = false;
};

Fitted fitted(const Estimate& start, const Unknowns& unknowns, const std::vector<Observation>& rows,
              const Robot& robot) {
  Fitted out;
  out.unknowns = unknowns;
  out.unknowns.prior = prior_knowledge(start.set, unknowns.parameters, true, {});
  // Directions that the data leave open must not run off: a centre of mass on axis 6 with no stiffness there, a curve
  // beyond the last reading. How large such things are is known to whoever drew them.
  for (std::size_t p = 0; p < unknowns.parameters.size(); ++p) {
    const flexcomp::Term<double>& t = start.set.terms[unknowns.parameters[p].terms.front()];
    if (t.effect == Effect::payload_error) {
      const bool mass = t.place.slot == flexcomp::slot::mass;
      out.unknowns.prior[p].tolerance = mass ? 0.2 * robot.nominal.payload_kg : 0.02;
    } else if (t.effect == Effect::joint_curve && unknowns.parameters[p].value) {
      out.unknowns.prior[p].tolerance = 5e-4;
    }
  }
  const Fit result = fit(start, out.unknowns, rows, robot, {.robust = false});
  out.estimate = result.estimate;
  out.chi2 = result.chi2;
  out.converged = result.converged;
  out.bic = out.chi2 + static_cast<double>(unknowns.count()) * std::log(measured_numbers(rows));
  return out;
}

/// Parameters from `first` on that the earlier columns do not carry; the others are set to zero and left out.
Unknowns independent(Estimate& start, const Unknowns& all, std::size_t first,
                     const std::vector<Observation>& rows, const Robot& robot) {
  const auto model = prepare(start.set, robot, "oracle");
  const MatrixXd columns = linearised(start, *model, rows, all).derivative;
  Span span(columns.rows());
  span.add(columns.leftCols(static_cast<Index>(all.frames.size() + first)));
  Unknowns kept{.frames = all.frames};
  for (std::size_t p = 0; p < all.parameters.size(); ++p) {
    if (p >= first) {
      const Index rank = span.basis().cols();
      span.add(columns.col(static_cast<Index>(all.frames.size() + p)));
      if (span.basis().cols() == rank) {
        all.parameters[p].set(start.set, 0);
        continue;
      }
    }
    kept.parameters.push_back(all.parameters[p]);
  }
  return kept;
}

/// The best of the curves of one joint that are zero but for a bump: one to four neighbouring coefficients of 16 to 64.
/// Its place and its width are parameters too. BIC gained, in the linearised model.
double gain_of_a_bump(const hidden::Case& c, const Estimate& at, const std::vector<Observation>& rows,
                      unsigned joint, const Span& span, const VectorXd& left, double log_n) {
  double best = 0;
  for (const std::size_t size : {16U, 24U, 36U, 48U, 64U}) {
    ParametricModel model{at.set, {}};
    add_effect(model, {.effect = Effect::joint_curve, .joint = joint, .coefficients = size}, c.robot.nominal);
    Estimate estimate = at;
    estimate.set = model.set;
    Unknowns unknowns{.parameters = model.parameters};
    const auto prepared = prepare(estimate.set, c.robot, "oracle");
    const MatrixXd columns = linearised(estimate, *prepared, rows, unknowns).derivative;
    const MatrixXd projected = columns - span.basis() * (span.basis().transpose() * columns);
    const Index count = projected.cols();
    for (Index first = 0; first < count; ++first) {
      MatrixXd fresh(projected.rows(), 4);
      Index rank = 0;
      double gain = 0;
      for (Index k = 0; k < 4; ++k) {
        VectorXd v = projected.col((first + k) % count);
        const double norm = columns.col((first + k) % count).norm();
        for (int twice = 0; twice < 2; ++twice)
          v -= fresh.leftCols(rank) * (fresh.leftCols(rank).transpose() * v);
        if (!(v.norm() > structural_tolerance * norm)) continue;
        fresh.col(rank) = v.normalized();
        gain += std::pow(fresh.col(rank).dot(left), 2);
        ++rank;
        best = std::max(best, gain - (static_cast<double>(rank) + 2) * log_n);
      }
    }
  }
  return best;
}

/// A candidate with its gain in the linearised model, compliances allowed below zero: it may do worse, not better.
struct Promise {
  const Candidate* candidate = nullptr;
  double bic = 0;
};

/// The best of the other names beside `rest`, by the fit itself. Where something local is hidden, bumps of all joints
/// are among them, and `best_bump` gets the BIC of the best one of the true joint.
void find_rival(const hidden::Case& c, const Fitted& rest, const std::vector<Observation>& rows,
                const std::vector<Group>& groups, double& best, std::string& name_of_best,
                std::optional<double>& best_bump) {
  const auto model = prepare(rest.estimate.set, c.robot, "oracle");
  const Linearised lin = linearised(rest.estimate, *model, rows, rest.unknowns);
  Span span(lin.residual.size());
  span.add(lin.derivative);
  const VectorXd left = lin.residual - span.basis() * (span.basis().transpose() * lin.residual);
  const double log_n = std::log(measured_numbers(rows));
  const double without = left.squaredNorm() + static_cast<double>(rest.unknowns.count()) * log_n;
  const std::vector<Candidate> candidates = candidates_of(c, rest.estimate, rows);
  std::vector<Promise> promises;
  for (const Candidate& candidate : candidates) {
    const bool true_name =
        std::ranges::any_of(groups, [&](const Group& g) { return names_match(g.id, candidate.id); });
    if (!true_name) promises.push_back({&candidate, without - bic_gain(candidate, span, left, log_n)});
  }
  std::ranges::sort(promises, {}, &Promise::bic);
  constexpr std::size_t most_fits = 10;
  for (std::size_t k = 0; k < std::min(most_fits, promises.size()) && promises[k].bic < best; ++k) {
    const Candidate& candidate = *promises[k].candidate;
    ParametricModel with{rest.estimate.set, rest.unknowns.parameters};
    const std::size_t first = with.parameters.size();
    add_effect(with, candidate.id, c.robot.nominal);
    Estimate start = rest.estimate;
    start.set = with.set;
    Unknowns all{.frames = rest.unknowns.frames, .parameters = with.parameters};
    const Unknowns unknowns = independent(start, all, first, rows, c.robot);
    const double bic = fitted(start, unknowns, rows, c.robot).bic + candidate.further_parameters * log_n;
    if (bic >= best) continue;
    best = bic;
    name_of_best = name(candidate.id);
  }
  if (!c.bump && !c.outside) return;
  for (unsigned joint = 1; joint <= joint_count; ++joint) {
    const double bic = rest.bic - gain_of_a_bump(c, rest.estimate, rows, joint, span, left, log_n);
    if (c.bump && c.bump->joint == joint) {
      best_bump = bic;
    } else if (bic < best) {
      best = bic;
      name_of_best = "bump of joint " + std::to_string(joint);
    }
  }
}

/// Parameters of the oracle's model by what they belong to: those from `of_paper` on in the order in which
/// append_hidden() made them. One that was left out of the fit is in no group.
std::vector<Group> groups_of(const hidden::Case& c, const ParametricModel& model, std::size_t of_paper,
                             const Fitted& truth) {
  const std::vector<Parameter>& in_fit = truth.unknowns.parameters;
  const auto place_of = [&](const Parameter& p) {
    return static_cast<std::size_t>(
        std::ranges::find_if(in_fit,
                             [&](const Parameter& q) { return q.terms == p.terms && q.value == p.value; }) -
        in_fit.begin());
  };
  std::vector<Group> groups;
  std::size_t next = of_paper;
  const auto take = [&](const EffectId& id, std::size_t count) {
    Group g{id, {}};
    for (std::size_t k = 0; k < count; ++k, ++next) {
      const std::size_t place = place_of(model.parameters[next]);
      if (place < in_fit.size()) g.parameters.push_back(place);
    }
    groups.push_back(g);
  };
  for (const hidden::Effect& e : c.hidden) take(e.id, e.values.size());
  if (c.bump) take({.effect = Effect::joint_curve, .joint = c.bump->joint}, 1);
  if (c.outside) {
    const auto link = static_cast<std::uint8_t>(c.outside->joint);
    take({.effect = Effect::unnamed, .place = {link, flexcomp::slot::theta}}, 1);
  }
  if (c.row != hidden::Row::geometry) return groups;
  for (std::size_t p = 0; p < of_paper; ++p) {
    const flexcomp::Term<double>& t = model.set.terms[model.parameters[p].terms.front()];
    if (t.effect == Effect::geometric) continue;
    const EffectId id{.effect = t.effect, .joint = t.effect == Effect::joint_compliance ? t.place.body : 0U};
    const auto same = std::ranges::find_if(groups, [&](const Group& g) { return names_match(g.id, id); });
    if (same == groups.end()) {
      groups.push_back({id, {p}});
    } else {
      same->parameters.push_back(p);
    }
  }
  return groups;
}

}  // namespace

bool Oracle::decidable() const { return std::ranges::all_of(hidden, &Hidden::decidable); }

bool names_match(const EffectId& a, const EffectId& b) {
  return a.effect == b.effect && a.joint == b.joint && a.from == b.from && a.link == b.link &&
         a.order == b.order && a.factor == b.factor;
}

std::vector<EffectId> every_name(const Nominal& robot, double pivot_z_m) {
  std::vector<EffectId> names;
  const auto add = [&](EffectId id) {
    if (!validation_error(id, robot)) names.push_back(std::move(id));
  };
  for (unsigned j = 1; j <= joint_count; ++j) {
    for (const Effect kind :
         {Effect::nonlinear_compliance, Effect::backlash, Effect::readout_lag, Effect::encoder_scale})
      add({.effect = kind, .joint = j});
    add({.effect = Effect::joint_curve, .joint = j, .coefficients = 12});
    for (int order = 1; order <= 8; ++order)
      add({.effect = Effect::gear_harmonic, .joint = j, .order = static_cast<double>(order)});
    for (int order = 1; order <= 2; ++order)
      add({.effect = Effect::axis_wobble, .joint = j, .order = static_cast<double>(order)});
    for (unsigned from = 1; from <= joint_count; ++from)
      add({.effect = Effect::joint_coupling, .joint = j, .from = from});
  }
  for (unsigned link = 0; link <= joint_count; ++link) {
    add({.effect = Effect::thermal_growth, .link = link});
    if (link != 0) add({.effect = Effect::link_bending, .link = link});
  }
  for (const Effect kind : {Effect::base_drift, Effect::payload_error, Effect::reflector_slip})
    add({.effect = kind});
  add({.effect = Effect::base_compliance, .pivot_z_m = pivot_z_m});
  return names;
}

double rms_m(const Estimate& estimate, const Robot& robot, const std::vector<Observation>& rows) {
  double sum = 0;
  for (const RowResidual& r : residuals(estimate, robot, rows, "judged rows"))
    sum += r.position_m.squaredNorm();
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
  ParametricModel model{full.fit.estimate.set, full.identifiability.fitted.parameters};
  const std::size_t of_paper = model.parameters.size();
  hidden::append_hidden(model, c, true);
  Estimate start = full.fit.estimate;
  start.set = model.set;
  Unknowns all{.frames = full.identifiability.fitted.frames, .parameters = model.parameters};
  const Fitted truth = fitted(start, independent(start, all, of_paper, rows, c.robot), rows, c.robot);
  out.estimate = truth.estimate;
  out.converged = truth.converged;
  out.chi2 = truth.chi2;

  const std::vector<Group> groups = groups_of(c, model, of_paper, truth);
  for (const Group& g : groups) out.hidden.push_back({g.id, 0, "nothing", 0, 0});
  for (std::size_t g = 0; g < groups.size(); ++g) {
    Estimate without = truth.estimate;
    Unknowns others{.frames = truth.unknowns.frames};
    for (std::size_t p = 0; p < truth.unknowns.parameters.size(); ++p) {
      const std::vector<std::size_t>& own = groups[g].parameters;
      if (std::ranges::find(own, p) == own.end()) {
        others.parameters.push_back(truth.unknowns.parameters[p]);
      } else {
        truth.unknowns.parameters[p].set(without.set, 0);
      }
    }
    const Fitted rest = fitted(without, others, rows, c.robot);
    Hidden& h = out.hidden[g];
    h.detection = rest.bic - truth.bic;
    double best = rest.bic;
    std::optional<double> best_bump;
    find_rival(c, rest, rows, groups, best, h.rival, best_bump);
    h.margin = best - truth.bic;
    h.untold_margin = best_bump ? best - *best_bump : h.margin;
  }
  return out;
}

}  // namespace judging
