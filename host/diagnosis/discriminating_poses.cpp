// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/discriminating_poses.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <set>

#include "identification/identifiability.hpp"
#include "linalg/decompositions.hpp"

namespace flexcomp::host {

namespace {

/// Parameters of the fullest form of a name; none where the name was found by a scan.
std::vector<std::size_t> parameters_of_name(const CandidateSet& candidates, const EffectId& id) {
  std::vector<std::size_t> fullest;
  for (const Candidate& c : candidates.list) {
    if (!same_name(c.id, id) || c.steps || c.id.coefficients != id.coefficients) continue;
    if (c.parameters.size() > fullest.size()) fullest = c.parameters;
  }
  return fullest;
}

/// Two confounded effects at all rows, measured and offered.
struct Pair {
  Eigen::VectorXd chosen;  ///< what the chosen effect predicts, whitened
  Eigen::MatrixXd rival;   ///< columns of the model with the other effect
};

std::vector<Pair> pairs_of(const Robot& robot, const std::vector<Observation>& rows, const FittedModel& start,
                           const CandidateSet& candidates, const std::vector<Hypothesis>& hypotheses,
                           const std::vector<FoundEffect>& effects) {
  constexpr std::size_t most = 4;
  Estimate at = start.fit.estimate;
  at.set = candidates.set;
  const auto model = prepare(at.set, robot, "diagnosis");
  const auto columns = [&](const std::vector<std::size_t>& parameters, bool with_model) {
    Unknowns unknowns;
    if (with_model) unknowns = start.fitted;
    for (const std::size_t p : parameters) unknowns.parameters.push_back(candidates.parameters[p]);
    return linearised(at, *model, rows, unknowns).derivative;
  };
  std::vector<Pair> pairs;
  for (const FoundEffect& effect : effects) {
    const auto h =
        std::ranges::find_if(hypotheses, [&](const Hypothesis& p) { return same_name(p.id, effect.id); });
    if (h == hypotheses.end() || h->parameters.empty()) continue;
    Eigen::VectorXd value = h->value;
    for (Eigen::Index k = 0; k < value.size(); ++k)
      value[k] /= unit_of(candidates.parameters[h->parameters[static_cast<std::size_t>(k)]], at.set);
    const Eigen::VectorXd chosen = columns(h->parameters, false) * value;
    for (const Rival& rival : effect.confounded_with) {
      const std::vector<std::size_t> parameters = parameters_of_name(candidates, rival.id);
      if (!parameters.empty()) pairs.push_back({chosen, columns(parameters, true)});
      if (pairs.size() >= most) break;
    }
  }
  return pairs;
}

/// What the best fit of the rival to the measured rows and the poses taken misses of the chosen effect, at all rows.
Eigen::VectorXd missed_by_rival(const Pair& pair, Eigen::Index measured, const std::set<std::size_t>& taken) {
  Eigen::MatrixXd normal = pair.rival.topRows(measured).transpose() * pair.rival.topRows(measured);
  Eigen::VectorXd right = pair.rival.topRows(measured).transpose() * pair.chosen.head(measured);
  for (const std::size_t k : taken) {
    const Eigen::Index row = measured + first_number(k);
    normal += pair.rival.middleRows<6>(row).transpose() * pair.rival.middleRows<6>(row);
    right += pair.rival.middleRows<6>(row).transpose() * pair.chosen.segment<6>(row);
  }
  normal.diagonal().array() += 1e-9 * normal.diagonal().mean();
  return pair.chosen - pair.rival * Ldlt(normal).solve(right);
}

}  // namespace

std::vector<SuggestedPose> discriminating_poses(const Robot& robot, const std::vector<Observation>& rows,
                                                const FittedModel& start, const CandidateSet& candidates,
                                                const std::vector<Hypothesis>& hypotheses,
                                                const std::vector<FoundEffect>& effects, std::uint64_t seed) {
  constexpr std::size_t offered = 400;
  constexpr std::size_t most = 20;
  std::vector<SuggestedPose> chosen;
  if (std::ranges::all_of(effects, [](const FoundEffect& e) { return e.confounded_with.empty(); }))
    return chosen;
  const std::vector<Observation> offers = random_observations(robot, rows, offered, seed);
  std::vector<Observation> all = rows;
  all.insert(all.end(), offers.begin(), offers.end());
  const std::vector<Pair> pairs = pairs_of(robot, all, start, candidates, hypotheses, effects);
  std::set<std::size_t> taken;
  const Eigen::Index measured = first_number(rows.size());
  while (chosen.size() < most && !pairs.empty()) {
    Eigen::VectorXd worth = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(offered));
    bool separated = true;
    for (const Pair& pair : pairs) {
      const Eigen::VectorXd missed = missed_by_rival(pair, measured, taken);
      double by_now = missed.head(measured).squaredNorm();
      for (const std::size_t k : taken) by_now += missed.segment<6>(measured + first_number(k)).squaredNorm();
      if (by_now >= 2 * decisive_bic) continue;
      separated = false;
      for (std::size_t k = 0; k < offered; ++k)
        worth[static_cast<Eigen::Index>(k)] += missed.segment<6>(measured + first_number(k)).squaredNorm();
    }
    if (separated) break;
    for (const std::size_t k : taken) worth[static_cast<Eigen::Index>(k)] = -1;
    Eigen::Index best = 0;
    if (!(worth.maxCoeff(&best) > 1e-9)) break;  // the same everywhere: no pose of this kind separates them
    taken.insert(static_cast<std::size_t>(best));
    const Observation& row = offers[static_cast<std::size_t>(best)];
    chosen.push_back({row.q_rad, row.context.payload_kg});
  }
  return chosen;
}

}  // namespace flexcomp::host
