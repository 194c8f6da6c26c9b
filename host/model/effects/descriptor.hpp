// SPDX-License-Identifier: Apache-2.0
/// \file
/// One descriptor per effect: terms, keys, units, needed columns, sign, place, sentence and rank. Whatever else knows
/// something about one effect asks its descriptor; only number and physical bounds are in flexcomp/effect.hpp, because
/// the controller shares them.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "flexcomp/effect.hpp"
#include "flexcomp/robot.hpp"
#include "flexcomp/term.hpp"
#include "model/robot.hpp"
#include "units.hpp"

namespace flexcomp::host {

using Nominal = NominalRobot<joint_count>;

/// Which effect, and of which joint, order …: what stands in the brackets of a parameter's name. Members that an effect
/// does not use stay at their defaults.
struct EffectId {
  Effect effect = Effect::joint_compliance;
  unsigned joint = 0;                         ///< from 1
  unsigned from = 0;                          ///< the joint that is followed where it is another one, from 1
  unsigned link = 0;                          ///< from 1; 0 means all links where the effect allows it
  double order = 0;                           ///< periods per turn, may be a fraction
  double pivot_z_m = 0;                       ///< height in F0
  double after_s = 0;                         ///< time of a step
  std::size_t coefficients = 0;               ///< of a curve: 6 … 256
  Factor factor = Factor::one;                ///< of a curve
  Place place{};                              ///< unnamed
  std::array<Covariate, 2> covariate{};       ///< unnamed: along rows, along columns
  std::array<unsigned, 2> covariate_joint{};  ///< unnamed: from 1 where the covariate is a joint's
  std::array<std::vector<double>, 2> node{};  ///< unnamed: ascending, SI
};

/// One key of an effect in files, its unit and the terms that its coefficient drives.
struct EffectKey {
  std::string key;  ///< e.g. sin_rad
  Unit unit;
  std::vector<Term<double>>
      terms;               ///< with coefficient 0; a curve's or grid's term with coefficient 1 and table 0
  bool identified = true;  ///< false: accepted from files, but not a parameter on this arm
};

/// Members of EffectId that tell two effects of one name apart. Each has its keys in files; `size` is the number of
/// coefficients and has none.
enum class Selector { joint, from, link, order, pivot, after, size, factor, place, grid };

/// What the rows have to record, and to vary, before an effect can be tested.
enum class Needs { poses, load, direction, moves, temperature, time };

enum class TableKind { none, curve, grid };

/// The quantity that an effect follows, and of which joints (from 1; 0: none) where it is a joint's.
struct Follows {
  Covariate covariate = Covariate::joint_position;
  std::array<unsigned, 2> joint{};
};

/// Everything the host knows about one effect. A pointer that is null stands for the default named beside it.
struct EffectDescriptor {
  Effect effect = Effect::geometric;
  std::string_view name;

  // Terms, (M5).
  std::vector<Selector> selectors{};  ///< in the order of files
  bool all_links_by_default = false;  ///< the selector `link` may be left out
  TableKind table = TableKind::none;
  /// What is wrong with an id whose joint and link are in range, or nothing. Null: any is valid.
  std::optional<std::string> (*rule)(const EffectId&, const Nominal&) = nullptr;
  std::vector<EffectKey> (*keys)(const EffectId&, const Nominal&) = nullptr;
  /// Usual size of a coefficient at a place (SI), its unit in the estimator. Null: 1e-4.
  double (*usual_size)(Place) = nullptr;

  // Estimation.
  bool in_paper_model = false;  ///< identified from the start, every arm has it
  bool is_nonnegative = false;  ///< the search admits no negative coefficient
  int (*elimination_rank)(Place) =
      nullptr;  ///< of parameters that are absorbed, the highest go first. Null: 4

  // Search.
  Needs needs = Needs::poses;
  /// Orders that are tried for a joint (from 1). Null where the effect has none.
  std::vector<double> (*orders)(const Robot&, unsigned joint) = nullptr;
  /// Subsets of the coefficients that are tried; none: all together.
  std::vector<std::vector<std::size_t>> forms{};
  Place (*place)(const EffectId&) = nullptr;  ///< where it acts, for messages
  Follows (*follows)(const EffectId&) = nullptr;

  // Messages and documentation.
  std::string (*sentence)(const EffectId&) = nullptr;
  std::string_view physics;          ///< Markdown, with the number of its equation in docs/model.md
  std::string_view record;           ///< what to measure, so that it can be told from others
  std::string_view confounded_with;  ///< Markdown
  EffectId example{};

  bool has(Selector s) const { return std::find(selectors.begin(), selectors.end(), s) != selectors.end(); }
};

/// Every effect in the order of the search: of two that explain the same, the first one is preferred.
const std::vector<EffectDescriptor>& all_effects();

/// In constant time. Of `geometric` and of a number that is not registered: a descriptor without name and terms.
const EffectDescriptor& descriptor(Effect effect);

/// Where an effect acts and what it follows; false for everything that is not the joint's own reading.
bool follows_own_joint(const EffectId& id);

}  // namespace flexcomp::host
