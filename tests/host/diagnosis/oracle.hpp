// SPDX-License-Identifier: Apache-2.0
/// \file
/// The best that the data of a hidden case allow: the same estimator, told the truth; and by how much the truth beats
/// every other name.
#pragma once

#include <string>
#include <vector>

#include "identification/identify.hpp"
#include "support/hidden_arm.hpp"

namespace judging {

/// A thing that is hidden, and how the data speak of it.
struct Hidden {
  flexcomp::host::EffectId id;  ///< of an outside effect: `unnamed` at its place
  double margin = 0;            ///< BIC of the best other name in its place, or of none, less the oracle's
  std::string rival;            ///< that name; "nothing" where leaving it out is the best
  double detection = 0;         ///< BIC without it less the oracle's
  /// Of a bump: the margin of one whose place, width and height are found, not told. Else the margin.
  double untold_margin = 0;

  bool decidable() const { return margin >= 10; }
  bool detectable() const { return detection >= 10; }
};

struct Oracle {
  flexcomp::host::Identification before;  ///< the model that does not know of it, fitted to all training rows
  flexcomp::host::Estimate estimate;      ///< with it, fitted to the rows that are no outliers
  bool converged = false;
  double chi2 = 0;
  std::vector<Hidden> hidden;

  bool decidable() const;  ///< all of it; a case in which nothing is hidden is
};

Oracle oracle_of(const hidden::Case& c);

/// The catalogue as names that could be given: every joint, orders 1 to 8, every pair. Curves with 12 coefficients,
/// slips at time 0, base_compliance about `pivot_z_m`.
std::vector<flexcomp::host::EffectId> every_name(const flexcomp::host::Nominal& robot, double pivot_z_m);

/// The same name: kind, joint, order, from, link.
bool names_match(const flexcomp::host::EffectId& a, const flexcomp::host::EffectId& b);

/// Root mean square of the 3-D position error.
double rms_m(const flexcomp::host::Estimate& estimate, const flexcomp::host::Robot& robot,
             const std::vector<flexcomp::host::Observation>& rows);

}  // namespace judging
