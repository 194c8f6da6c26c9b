// SPDX-License-Identifier: Apache-2.0
/// \file
/// Every name of the catalogue that these data may be asked about, as columns beside the model's own.
#pragma once

#include <cstddef>
#include <vector>

#include "diagnosis/result.hpp"
#include "measurement/measured_data.hpp"
#include "measurement/observation.hpp"
#include "model/effects.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

/// One form of one effect: the parameters that are fitted together. A curve has a form per number of coefficients, a
/// wrong payload one for its mass, one for its centre and one for both.
struct Candidate {
  EffectId id;
  std::vector<std::size_t> parameters;  ///< indices into CandidateSet::parameters
  std::size_t first = 0;                ///< of these, the first one of the whole effect
  double prior_rad = 0;                 ///< of a smooth curve: standard deviation of a coefficient; 0: free
  bool positive = false;                ///< physics allows no negative coefficient
  /// The columns are those of a step at some time: here, before all rows. A scan finds the time.
  bool steps = false;
};

struct CandidateSet {
  /// The set that was given, and behind it every effect of the list with coefficients zero.
  TermSet set;
  std::vector<Parameter> parameters;  ///< of the effects only
  std::vector<Candidate> list;
  std::vector<NotTestable> not_testable;
};

/// What the context of the rows lets us ask for.
struct Testable {
  bool payload = false;      ///< some load that is not zero
  bool temperature = false;  ///< varies
  bool time = false;         ///< varies
  bool relative_speed = false;
  std::array<bool, joint_count> direction{};  ///< both directions occur
};
Testable testable(const std::vector<Observation>& rows, const ContextColumns& columns);

/// All of them but those that `set` has already.
CandidateSet candidates(const Robot& robot, const std::vector<Observation>& rows,
                        const ContextColumns& columns, const TermSet& set);

}  // namespace flexcomp::host
