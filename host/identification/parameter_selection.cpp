// SPDX-License-Identifier: Apache-2.0
#include "identification/parameter_selection.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "linalg/decompositions.hpp"

namespace flexcomp::host {

namespace {

constexpr std::size_t reference_count = 1000;

/// Standard deviations in units from an information matrix.
Eigen::VectorXd sigmas(const Eigen::MatrixXd& information) {
  return Ldlt(information).inverse().diagonal().cwiseMax(0).cwiseSqrt();
}

Eigen::MatrixXd information(const Eigen::MatrixXd& matrix) { return matrix.transpose() * matrix; }

/// Test of weak identifiability: the rows' columns against the information of as many random rows.
struct WeaknessTest {
  Eigen::MatrixXd data;       ///< identification matrix of the rows, or its triangular factor
  Eigen::MatrixXd reference;  ///< information matrix of as many random rows
  std::size_t frames = 0;     ///< leading columns of frame parameters: never dropped

  /// Drops, last in `order` first, parameters whose standard deviation exceeds 30 units (3 mm, 1.5 degrees) and
  /// 30 times that from as many random poses. Nearly confounded ones would diverge together (a5 = 43 mm +- 40
  /// mm).
  std::vector<std::size_t> drop_weakly_identifiable(const std::vector<std::size_t>& order,
                                                    std::vector<std::size_t>& kept) const {
    constexpr double too_many = 30;
    const Eigen::MatrixXd here_all = information(data);
    std::vector<std::size_t> dropped;
    while (!kept.empty()) {
      const Eigen::VectorXd here = sigmas(here_all(kept, kept));
      const Eigen::VectorXd there = sigmas(reference(kept, kept));
      std::size_t worst = kept.size();
      std::size_t latest = 0;
      for (std::size_t k = 0; k < kept.size(); ++k) {
        const Eigen::Index i = static_cast<Eigen::Index>(k);
        if (kept[k] < frames || !(here[i] > too_many && here[i] > too_many * there[i])) continue;
        const std::size_t position =
            static_cast<std::size_t>(std::ranges::find(order, kept[k]) - order.begin());
        if (worst == kept.size() || position > latest) {
          worst = k;
          latest = position;
        }
      }
      if (worst == kept.size()) break;
      dropped.push_back(kept[worst]);
      kept.erase(kept.begin() + static_cast<std::ptrdiff_t>(worst));
    }
    return dropped;
  }

  /// True where all columns are identifiable.
  bool identifies_all() const {
    std::vector<std::size_t> order(static_cast<std::size_t>(data.cols()));
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::vector<std::size_t> kept = eliminate(data, order).kept;
    return kept.size() == order.size() && drop_weakly_identifiable(order, kept).empty();
  }
};

/// Chooses poses from the reference greedily by D-optimality, with rank-six updates, until all columns are
/// identifiable.
std::vector<SuggestedPose> suggest_poses(WeaknessTest test, const Eigen::MatrixXd& reference,
                                         const std::vector<Observation>& reference_rows) {
  constexpr std::size_t most = 40;
  constexpr Eigen::Index candidates = 300;
  const Eigen::Index columns = test.data.cols();
  // A weak prior of 100 units makes the singular information matrix invertible.
  Eigen::MatrixXd covariance =
      inverse(information(test.data) + 1e-4 * Eigen::MatrixXd::Identity(columns, columns));
  std::vector<SuggestedPose> chosen;
  std::set<Eigen::Index> taken;
  while (chosen.size() < most && !test.identifies_all()) {
    double best = -1;
    Eigen::Index which = 0;
    for (Eigen::Index c = 0; c < candidates; ++c) {
      if (taken.count(c) != 0) continue;
      const auto h = reference.middleRows<6>(6 * c);
      const Eigen::Matrix<double, 6, 6> gain =
          Eigen::Matrix<double, 6, 6>::Identity() + h * covariance * h.transpose();
      const double gained = Llt(gain).log_det();
      if (gained > best) {
        best = gained;
        which = c;
      }
    }
    taken.insert(which);
    const Eigen::MatrixXd h = reference.middleRows<6>(6 * which);
    const Eigen::MatrixXd ch = covariance * h.transpose();
    const Eigen::MatrixXd gain = Eigen::MatrixXd::Identity(6, 6) + h * ch;
    covariance -= ch * Ldlt(gain).solve(Eigen::MatrixXd(ch.transpose()));
    test.data.conservativeResize(test.data.rows() + 6, Eigen::NoChange);
    test.data.bottomRows<6>() = h;
    const Observation& row = reference_rows[static_cast<std::size_t>(which)];
    chosen.push_back({row.q_rad, row.context.payload_kg});
  }
  return chosen;
}

bool has_stiffness(const Unknowns& unknowns, const TermSet& set) {
  return std::ranges::any_of(unknowns.parameters, [&](const Parameter& p) {
    return set.terms[p.terms.front()].effect == Effect::joint_compliance;
  });
}

bool one_payload(const std::vector<Observation>& rows) {
  return std::ranges::all_of(rows, [&](const Observation& row) {
    return std::abs(row.context.payload_kg - rows.front().context.payload_kg) < 1e-6;
  });
}

bool without_any_load(const std::vector<Observation>& rows) {
  return std::ranges::all_of(rows, [](const Observation& row) {
    const auto& f = row.context.force_n;
    return row.context.payload_kg == 0 && f[0] == 0 && f[1] == 0 && f[2] == 0;
  });
}

std::vector<Observation> reference_like(const Robot& robot, const std::vector<Observation>& rows,
                                        std::uint64_t seed) {
  std::vector<Observation> reference = random_observations(robot, rows, reference_count, seed);
  if (robot.nominal.payload_kg > 0 && without_any_load(rows)) {
    for (std::size_t k = 1; k < reference.size(); k += 2)
      reference[k].context.payload_kg = robot.nominal.payload_kg;
  }
  return reference;
}

/// Gains in standard deviation if every second row had no payload; ratios from random poses, applied to these rows.
std::vector<PayloadGain> second_payload_gains(std::vector<Observation> reference, const Estimate& start,
                                              const HostModel& model, const Unknowns& fitted,
                                              const Eigen::VectorXd& sigma) {
  constexpr double least_gain = 1.5;
  std::vector<PayloadGain> gains;
  const Eigen::VectorXd one = sigmas(information(linearised(start, model, reference, fitted).derivative));
  for (std::size_t k = 0; k < reference.size(); k += 2) reference[k].context.payload_kg = 0;
  const Eigen::VectorXd both = sigmas(information(linearised(start, model, reference, fitted).derivative));
  const Eigen::VectorXd units = units_of(fitted, start.set);
  for (std::size_t p = 0; p < fitted.parameters.size(); ++p) {
    const Eigen::Index i = static_cast<Eigen::Index>(fitted.frames.size() + p);
    if (!(one[i] > least_gain * both[i])) continue;
    gains.push_back({fitted.parameters[p].name, sigma[i] * units[i], sigma[i] * units[i] * both[i] / one[i]});
  }
  return gains;
}

}  // namespace

Elimination possible_columns(const Robot& robot, const std::vector<Observation>& like, const Estimate& start,
                             const Unknowns& all, std::uint64_t seed) {
  const auto model = prepare(start.set, robot, "identification");
  const Eigen::MatrixXd reference =
      linearised(start, *model, reference_like(robot, like, seed), all).derivative;
  return eliminate(reference, elimination_order(all, start.set), structural_tolerance);
}

Identifiability analyse_identifiability(const Robot& robot, const std::vector<Observation>& rows,
                                        const Estimate& start, const Unknowns& all, std::uint64_t seed) {
  Identifiability out;
  const std::vector<std::string> names = names_of(all);
  const std::vector<std::size_t> order = elimination_order(all, start.set);
  const std::vector<Observation> reference = reference_like(robot, rows, seed);
  const auto model = prepare(start.set, robot, "identification");
  const Eigen::MatrixXd reference_matrix = linearised(start, *model, reference, all).derivative;
  const Eigen::MatrixXd data_matrix = triangular_factor(linearised(start, *model, rows, all).derivative);
  const Elimination possible = eliminate(reference_matrix, order, structural_tolerance);
  for (const DependentColumn& column : possible.dependent) {
    Confounded entry{names[column.column], {}};
    for (const std::size_t c : column.with) entry.with.push_back(names[c]);
    out.confounded.push_back(entry);
  }
  std::vector<std::size_t> possible_order;
  for (const std::size_t c : order) {
    if (std::ranges::binary_search(possible.kept, c)) possible_order.push_back(c);
  }
  WeaknessTest test;
  test.data = data_matrix;
  test.reference = information(reference_matrix) * (static_cast<double>(rows.size()) / reference_count);
  test.frames = all.frames.size();
  Elimination identified = eliminate(data_matrix, possible_order);
  std::set<std::size_t> missing;
  for (const DependentColumn& column : identified.dependent) missing.insert(column.column);
  for (const std::size_t c : test.drop_weakly_identifiable(possible_order, identified.kept))
    missing.insert(c);
  for (const std::size_t c : missing) out.missing.push_back(names[c]);

  std::vector<std::size_t> fitted_columns;
  for (const std::size_t c : possible.kept) {
    const bool is_frame = c < test.frames;
    const PriorKnowledge prior = is_frame ? PriorKnowledge() : all.prior_of(c - test.frames);
    if (missing.count(c) != 0 && !std::isfinite(prior.tolerance)) continue;
    fitted_columns.push_back(c);
    if (is_frame) {
      out.fitted.frames.push_back(all.frames[c]);
    } else {
      out.fitted.parameters.push_back(all.parameters[c - test.frames]);
      out.fitted.prior.push_back(prior);
    }
  }
  if (!missing.empty()) {
    // In the elimination order, so that the same columns are tested as above; frames come first in it.
    WeaknessTest selected;
    selected.data = data_matrix(Eigen::all, possible_order);
    selected.reference = test.reference(possible_order, possible_order);
    selected.frames = static_cast<std::size_t>(
        std::ranges::count_if(possible_order, [&](std::size_t c) { return c < test.frames; }));
    out.suggested_poses = suggest_poses(selected, reference_matrix(Eigen::all, possible_order), reference);
  } else if (one_payload(rows) && rows.front().context.payload_kg > 0 && has_stiffness(all, start.set)) {
    out.payload_gains = second_payload_gains(reference, start, *model, out.fitted,
                                             sigmas(information(data_matrix(Eigen::all, fitted_columns))));
  }
  return out;
}

}  // namespace flexcomp::host
