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

struct Duel {
  Eigen::VectorXd truth;  ///< what the chosen name predicts at all rows, whitened
  Eigen::MatrixXd rival;  ///< columns of the model with the rival's name, the same rows
};

}  // namespace

std::vector<SuggestedPose> discriminating_poses(const Robot& robot, const std::vector<Observation>& rows,
                                                const Estimate& start, const Unknowns& fitted,
                                                const CandidateSet& candidates, const Explanation& found,
                                                const std::vector<FoundEffect>& effects, std::uint64_t seed) {
  constexpr std::size_t offered = 400;
  constexpr std::size_t most = 20;
  std::vector<SuggestedPose> chosen;
  if (std::all_of(effects.begin(), effects.end(),
                  [](const FoundEffect& e) { return e.confounded_with.empty(); }))
    return chosen;
  const std::vector<Observation> offers = random_observations(robot, rows, offered, seed);
  std::vector<Observation> all = rows;
  all.insert(all.end(), offers.begin(), offers.end());
  Estimate at = start;
  at.set = candidates.set;
  const auto model = prepare(at.set, robot, "diagnosis");
  const auto columns = [&](const std::vector<std::size_t>& parameters, bool with_model) {
    Unknowns unknowns;
    if (with_model) unknowns = fitted;
    for (const std::size_t p : parameters) unknowns.parameters.push_back(candidates.parameters[p]);
    return linearised(at, *model, all, unknowns).derivative;
  };
  std::vector<Duel> duels;
  for (const FoundEffect& effect : effects) {
    const auto piece = std::find_if(found.pieces.begin(), found.pieces.end(),
                                    [&](const Hypothesis& p) { return same_name(p.id, effect.id); });
    if (piece == found.pieces.end() || piece->parameters.empty()) continue;
    Eigen::VectorXd value = piece->value;
    for (Eigen::Index k = 0; k < value.size(); ++k)
      value[k] /= unit_of(candidates.parameters[piece->parameters[static_cast<std::size_t>(k)]], at.set);
    const Eigen::VectorXd truth = columns(piece->parameters, false) * value;
    for (const Rival& rival : effect.confounded_with) {
      const std::vector<std::size_t> parameters = parameters_of_name(candidates, rival.id);
      if (!parameters.empty()) duels.push_back({truth, columns(parameters, true)});
      if (duels.size() >= 4) break;
    }
  }
  std::set<std::size_t> taken;
  const Eigen::Index measured = 6 * static_cast<Eigen::Index>(rows.size());
  while (chosen.size() < most && !duels.empty()) {
    Eigen::VectorXd worth = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(offered));
    bool told = true;
    for (const Duel& duel : duels) {
      Eigen::MatrixXd normal = duel.rival.topRows(measured).transpose() * duel.rival.topRows(measured);
      Eigen::VectorXd right = duel.rival.topRows(measured).transpose() * duel.truth.head(measured);
      for (const std::size_t k : taken) {
        const Eigen::Index row = measured + 6 * static_cast<Eigen::Index>(k);
        normal += duel.rival.middleRows<6>(row).transpose() * duel.rival.middleRows<6>(row);
        right += duel.rival.middleRows<6>(row).transpose() * duel.truth.segment<6>(row);
      }
      normal.diagonal().array() += 1e-9 * normal.diagonal().mean();
      const Eigen::VectorXd missed = duel.truth - duel.rival * Ldlt(normal).solve(right);
      double by_now = missed.head(measured).squaredNorm();
      for (const std::size_t k : taken)
        by_now += missed.segment<6>(measured + 6 * static_cast<Eigen::Index>(k)).squaredNorm();
      if (by_now >= 2 * telling_bic) continue;
      told = false;
      for (std::size_t k = 0; k < offered; ++k)
        worth[static_cast<Eigen::Index>(k)] +=
            missed.segment<6>(measured + 6 * static_cast<Eigen::Index>(k)).squaredNorm();
    }
    if (told) break;
    for (const std::size_t k : taken) worth[static_cast<Eigen::Index>(k)] = -1;
    Eigen::Index best = 0;
    if (!(worth.maxCoeff(&best) > 1e-9)) break;  // the same everywhere: no pose of this kind tells them apart
    taken.insert(static_cast<std::size_t>(best));
    const Observation& row = offers[static_cast<std::size_t>(best)];
    chosen.push_back({row.q_rad, row.context.payload_kg});
  }
  return chosen;
}

}  // namespace flexcomp::host
