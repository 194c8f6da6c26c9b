// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/remainder.hpp"

#include <algorithm>

namespace flexcomp::host {

namespace {

using Joints = std::array<bool, joint_count>;

/// Share of the chi-square on left-out poses that curves must take away.
constexpr double least_prediction = 0.02;

bool is_whole_curve(const Block& block) { return block.id.effect == Effect::joint_curve && !block.is_local(); }

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
    if (!evidence_.is_worth_trying()) return false;
    Joints all;
    all.fill(true);
    at_ = evidence_.maximum(blocks_, all);
    const CurveMaximum without = evidence_.maximum(blocks_, {});
    return at_.value - without.value > least_gain;
  }

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

/// Keeps these blocks of a search's selection.
void keep(SearchResult& found, const Subset& blocks) {
  std::vector<Hypothesis> hypotheses;
  for (std::size_t h = 0; h < found.hypotheses.size(); ++h) {
    if (std::ranges::find(blocks, found.solution.blocks[h]) != blocks.end())
      hypotheses.push_back(std::move(found.hypotheses[h]));
  }
  found.hypotheses = std::move(hypotheses);
  found.solution = found.search->score(without_if(found.solution.blocks, [&](std::size_t b) {
    return std::ranges::find(blocks, b) == blocks.end();
  }));
}

}  // namespace

std::optional<CurveMaximum> carry_remainder(Selection& selection, const Robot& robot,
                                            const std::vector<Observation>& rows,
                                            const LeftOutPoses& left_out) {
  SearchResult& found = selection.found;
  const SubsetSearch& search = *found.search;
  const std::vector<Block>& all = found.system->blocks;
  Weighing weighing(search, rows, without_if(found.solution.blocks,
                                             [&](std::size_t b) { return is_whole_curve(all[b]); }));
  if (!weighing.begin()) return {};
  weighing.drop_unsure_names();
  weighing.drop_idle_joints();
  // Names that were selected, curves among them, against the same and the curves that carry the rest.
  Subset stay = weighing.blocks();
  const double without = left_out.chi2_per_number(search, found.solution);
  const double with = left_out.chi2_per_number(search, search.score(stay), weighing.curves());
  if (!(with < (1 - least_prediction) * without)) return {};
  for (const std::size_t b : found.solution.blocks) {
    if (!is_whole_curve(all[b]) || !weighing.at().prior.has(all[b].id.joint - 1)) continue;
    if (weighing.is_sure(all[b].id.joint - 1, all[b].margin)) stay.push_back(b);
  }
  keep(found, stay);
  found.unnamed = true;
  selection.refit = refit_model(robot, rows, selection.start, found, &weighing.at());
  return weighing.at();
}

}  // namespace flexcomp::host
