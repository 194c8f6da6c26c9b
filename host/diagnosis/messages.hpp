// SPDX-License-Identifier: Apache-2.0
/// \file
/// What a diagnosis says, in sentences and in the units of those who maintain the arm: for the terminal and for the page.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/held_out.hpp"
#include "diagnosis/result.hpp"

namespace flexcomp::host {

/// "joint 3: an error that comes once per turn of the joint"
std::string in_words(const EffectId& id);

/// The verdict in one plain sentence.
std::string verdict_sentence(const Diagnosis& d);
/// The mean position error before and after, on held-out rows where there are any.
std::string error_sentence(const Diagnosis& d, const std::optional<HeldOut>& others);
/// What is carried without a name; empty where nothing is.
std::string remainder_sentence(const Remainder& remainder);

/// "a, b and c".
std::string list_of(const std::vector<std::string>& items);

/// Where the model fails, and what the failure follows.
std::string where_sentence(const Misfit& where);

/// The coefficients of an effect that stand under one key in files: one, or all of a curve.
struct KeyedCoefficients {
  std::string key;  ///< sin_rad; coefficients_rad
  bool list = false;
  std::vector<EffectCoefficient> values;
};
std::vector<KeyedCoefficients> by_key(const FoundEffect& effect);

/// The sizes of an effect, a line each: in the unit of files with one standard deviation, angles of joints in arcsec too.
std::vector<std::string> sizes(const FoundEffect& effect);

/// "axis_wobble[joint=3,order=1] (delta BIC 3.2), …"; empty where it has no rival.
std::string rivals_text(const FoundEffect& effect);

/// An effect that the data could not speak of, and the columns that it needs, series of joints drawn together:
/// "readout_lag needs move1_deg … move6_deg".
std::string not_testable_text(const NotTestable& n);

/// The calibration's effects that nobody has named, as they stand in `after`.
std::vector<EffectId> unnamed_effects(const Diagnosis& d, const Robot& robot);

/// sqrt(max(0, rms^2 - floor^2)): what is left of an error when the noise is taken away.
double gap_of(double rms_m, double noise_floor_m);

}  // namespace flexcomp::host
