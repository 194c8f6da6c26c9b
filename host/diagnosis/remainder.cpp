// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/remainder.hpp"

#include <algorithm>

#include "diagnosis/residual_analysis.hpp"
#include "identification/statistics.hpp"
#include "model/covariate.hpp"

namespace flexcomp::host {

namespace {

using Joints = std::array<bool, joint_count>;

/// Least gain of the curves where names leave something over: strong evidence (Kass and Raftery 1995).
constexpr double least_carried_gain = 6;

/// Share of the chi-square on left-out poses that curves must take away.
constexpr double least_prediction = 0.02;

bool is_whole_curve(const Block& block) {
  return block.id.effect == Effect::joint_curve && !block.is_local();
}

Joints joints_of(const CurvePrior& prior) {
  Joints out{};
  for (std::size_t j = 0; j < joint_count; ++j) out[j] = prior.has(j);
  return out;
}

/// Curves and blocks at their maximum, with what may still leave.
class Weighing {
 public:
  Weighing(const SubsetSearch& search, const std::vector<Observation>& rows, const Subset& blocks)
      : search_(search), evidence_(search, rows, blocks), blocks_(blocks) {}

  /// False: no curves.
  bool begin() {
    const auto best = evidence_.maximum_where_any_gains();
    if (best) at_ = *best;
    return best.has_value();
  }

  double gain_of_all() const { return at_.value - evidence_.maximum(blocks_, {}).value; }

  /// Curves of joints that have none, by the evidence: their own size costs nothing.
  void drop_idle_joints() {
    for (std::size_t j = 0; j < joint_count; ++j) {
      if (!at_.prior.has(j)) continue;
      Joints joints = joints_of(at_.prior);
      joints[j] = false;
      if (const auto less = without(joints, 0)) at_ = *less;
    }
  }

  /// Whether the curve of a joint gains more than a margin.
  bool is_sure(std::size_t joint, double margin) const {
    Joints joints = joints_of(at_.prior);
    joints[joint] = false;
    return !without(joints, margin);
  }

  /// Blocks that gain less than their margin: all at once, else the least first; blocks of one effect together.
  void drop_unsure_names() {
    const std::vector<Block>& all = search_.system().blocks;
    Joints every;
    every.fill(true);
    // From a scan: a joint whose curve names replaced has none to begin with.
    const CurveMaximum alone = evidence_.maximum({}, every);
    if (at_.value - alone.value <= search_.margins(blocks_)) {
      at_ = alone;
      blocks_.clear();
    }
    while (!blocks_.empty()) {
      double least = 0;
      std::optional<CurveMaximum> best;
      Subset left;
      for (const std::size_t b : blocks_) {
        const Subset less = without_if(blocks_, [&](std::size_t other) {
          return other == b || (!all[b].is_function() && same_name(all[other].id, all[b].id));
        });
        const CurveMaximum there = evidence_.maximum(less, joints_of(at_.prior), &at_);
        const double surplus = at_.value - there.value - (search_.margins(blocks_) - search_.margins(less));
        if (surplus >= least) continue;
        least = surplus;
        best = there;
        left = less;
      }
      if (!best) return;
      at_ = *best;
      blocks_ = left;
    }
  }

  const CurveMaximum& at() const { return at_; }
  const Subset& blocks() const { return blocks_; }
  ChosenColumns curves() const { return evidence_.columns_of(at_); }

 private:
  /// The maximum with less curves; nothing where those that are left out gain more than the margin.
  std::optional<CurveMaximum> without(const Joints& joints, double margin) const {
    // With the other sizes and the noise as they are it gains more, by a factor of three to five on measured arms.
    constexpr double replaced = 100;
    if (at_.value - evidence_.value_without(blocks_, joints, at_) > 10 * margin + replaced) return {};
    CurveMaximum less = evidence_.maximum(blocks_, joints, &at_);
    if (at_.value - less.value > margin) return {};
    return less;
  }

  const SubsetSearch& search_;
  CurveEvidence evidence_;
  Subset blocks_;
  CurveMaximum at_;
};

/// Keeps these blocks of a search's selection; joint curves that are not among the free ones are no local faults any more.
void keep(SearchResult& found, const Subset& blocks, const Subset& free) {
  const auto has = [](const Subset& all, std::size_t b) { return std::ranges::find(all, b) != all.end(); };
  std::vector<Hypothesis> hypotheses;
  for (std::size_t h = 0; h < found.hypotheses.size(); ++h) {
    const std::size_t b = found.solution.blocks[h];
    if (!has(blocks, b)) continue;
    hypotheses.push_back(std::move(found.hypotheses[h]));
    if (!has(free, b)) hypotheses.back().local.reset();
  }
  found.hypotheses = std::move(hypotheses);
  found.solution =
      found.search->score(without_if(found.solution.blocks, [&](std::size_t b) { return !has(blocks, b); }));
}

/// The largest curve without a name as the place of what is not explained.
Misfit misfit_of(const Remainder& remainder, const SearchResult& found) {
  const CarriedCurve* most = nullptr;
  for (const CarriedCurve& c : remainder.curves) {
    if (c.sure && !c.named && (most == nullptr || c.size_rad > most->size_rad)) most = &c;
  }
  Misfit m;
  m.joint = most->joint;
  m.place = {static_cast<std::uint8_t>(most->joint), slot::theta};
  m.covariates = {covariate_name(Covariate::joint_position, most->joint)};
  m.around_deg = {std::nullopt};
  for (const PlaceShare& share : place_shares(*found.system, residual_after(*found.search, found.solution))) {
    if (share.place != m.place) continue;
    m.explains = share.explains;
    m.p_value = share.p_value;
  }
  return m;
}

/// Whether chi-square says that the refit leaves more than the declared noise (D14).
bool leaves_more_than_noise(const Refit& refit, const Robot& robot, const std::vector<Observation>& rows,
                            double noise_scale2) {
  const double chi2 = chi2_of(residuals(refit.fit.estimate, robot, rows, "diagnosis"), rows,
                              refit.fit.has_full_weight(rows.size()));
  const double dof = refit.fit.degrees_of_freedom;
  return dof >= 1 && chi2 / noise_scale2 > chi2_quantile(0.9995, dof);
}

}  // namespace

std::optional<Remainder> carry_remainder(Selection& selection, const Robot& robot,
                                         const std::vector<Observation>& rows, const LeftOutPoses& left_out) {
  SearchResult& found = selection.found;
  const SubsetSearch& search = *found.search;
  const std::vector<Block>& all = found.system->blocks;
  Weighing weighing(search, rows,
                    without_if(found.solution.blocks, [&](std::size_t b) { return is_whole_curve(all[b]); }));
  if (!weighing.begin()) return {};
  // Names that explain the rows by their chi-square stay.
  const bool is_explained = !found.unnamed;
  if (!is_explained) weighing.drop_unsure_names();
  weighing.drop_idle_joints();
  Remainder out;
  out.gain = weighing.gain_of_all();
  if (!(out.gain > (is_explained ? least_gain : least_carried_gain))) return {};
  const double without = left_out.chi2_per_number(search, search.score(weighing.blocks()));
  const double with = left_out.chi2_per_number(search, search.score(weighing.blocks()), weighing.curves());
  out.cross_validated = with;
  out.cross_validation = 1 - with / without;
  if (!(out.cross_validation > least_prediction)) return {};
  const CurveMaximum& at = weighing.at();
  out.corner = at.prior.corner;
  out.position_noise = at.position_noise;
  out.orientation_noise = at.orientation_noise;
  Subset stay = weighing.blocks();
  for (unsigned joint = 1; joint <= joint_count; ++joint) {
    if (!at.prior.has(joint - 1)) continue;
    CarriedCurve curve{joint, at.prior.size_rad[joint - 1], weighing.is_sure(joint - 1, least_gain), false};
    for (const std::size_t b : found.solution.blocks) {
      if (all[b].id.effect != Effect::joint_curve || all[b].id.joint != joint) continue;
      const bool stays = std::ranges::find(stay, b) != stay.end();
      curve.named = curve.named || stays || curve.sure || is_explained;
      if (!stays && curve.named) stay.push_back(b);
    }
    out.curves.push_back(curve);
  }
  // A named curve that the evidence does not have: the selection is the better answer.
  if (is_explained && stay.size() < found.solution.blocks.size()) return {};
  keep(found, stay, weighing.blocks());
  selection.refit = refit_model(robot, rows, selection.start, found, &at);
  if (is_explained) return out;
  const bool function =
      std::ranges::any_of(found.hypotheses, [](const Hypothesis& h) { return h.function.has_value(); });
  if (!function) {
    found.unnamed =
        out.is_unnamed() || leaves_more_than_noise(selection.refit, robot, rows, search.noise_scale2());
    if (!found.unnamed) found.misfit.reset();
    if (out.is_unnamed()) found.misfit = misfit_of(out, found);
    found.notes.clear();
  }
  return out;
}

}  // namespace flexcomp::host
