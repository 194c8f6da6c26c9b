// SPDX-License-Identifier: Apache-2.0
/// \file
/// What a diagnosis said of a hidden case, held against the truth and the oracle.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/diagnose.hpp"
#include "oracle.hpp"

namespace judging {

/// One case, judged.
struct Outcome {
  hidden::Row row = hidden::Row::none;
  std::uint64_t seed = 0;
  std::string arm, what, group;  ///< group: the kind of what is hidden, for tables
  bool decidable = true;         ///< all of what is hidden
  bool detectable = true;        ///< the oracle's BIC beats leaving any of it out
  double margin = 0;             ///< least over what is hidden
  double untold_margin = 0;      ///< the same where the shape of a bump is not told
  std::string rival;             ///< of that
  bool oracle_converged = true;

  /// Another name explains the data better, and by so much that nobody would name the truth.
  bool beaten() const { return margin <= -10; }

  std::string said;
  bool right = false;     ///< what the row asks for
  bool listed = false;    ///< every hidden name is in `effects` or in a `confounded_with`
  bool complete = false;  ///< every decidable hidden name is in `effects`
  bool wrong = false;     ///< a name that is neither true nor confounded with an undecidable truth
  double rms_before_m = 0, rms_oracle_m = 0, rms_m = 0;  ///< of the held-out rows
  double floor_m = 0;
  double seconds = 0;            ///< by the clock
  double processor_seconds = 0;  ///< of this thread

  double ratio() const { return rms_m / rms_oracle_m; }
  /// Squared gap of an rms.
  double gap2(double rms) const { return std::max(0.0, rms * rms - floor_m * floor_m); }
};

Outcome judge(const hidden::Case& c);
/// The same of a diagnosis that is already there.
Outcome judge(const hidden::Case& c, const Oracle& oracle, const flexcomp::host::Diagnosis& diagnosis);

/// Names, coefficients and place in a line.
std::string words_of(const flexcomp::host::Diagnosis& diagnosis);

/// 95 % interval of a rate (Clopper and Pearson).
struct Rate {
  std::size_t hits = 0, of = 0;
  double low() const;
  double high() const;
  double value() const { return of == 0 ? 0 : static_cast<double>(hits) / static_cast<double>(of); }
  void count(bool hit) {
    ++of;
    if (hit) ++hits;
  }
};

}  // namespace judging
