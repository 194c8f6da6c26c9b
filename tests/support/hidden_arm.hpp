// SPDX-License-Identifier: Apache-2.0
/// \file
/// True arms with hidden effects, measured: what the diagnosis is judged by. The arm moves by plain_arm.hpp, without a
/// line of the core; the catalogue gives nothing but names. SI units.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "measurement/measured_data.hpp"
#include "measurement/observation.hpp"
#include "model/effects.hpp"
#include "model/robot.hpp"
#include "support/plain_case.hpp"

namespace hidden {

using plain::situation_of;

/// What is hidden. The names are those of the rows of the table of rates.
enum class Row {
  one,       ///< one effect of the catalogue
  none,      ///< nothing beyond the model of the paper
  local,     ///< a damaged tooth: a bump of one joint
  outside,   ///< a function of two things that the catalogue does not have
  two,       ///< two effects of the catalogue
  third,     ///< one effect of a third of the size
  geometry,  ///< nothing, but only geometry was modelled before
  rough      ///< one effect, and something wrong with the data
};
const std::vector<Row>& all_rows();
std::string name(Row row);
std::optional<Row> row_of(const std::string& wanted);

/// An effect by its name, with its true coefficients in the order of the catalogue's keys.
struct Effect {
  flexcomp::host::EffectId id;
  std::vector<double> values;
};

/// A motion of joint `joint` (from 1) that the catalogue has no name for: amplitude_rad * shape(readings, row).
struct Outside {
  unsigned joint = 0;
  double amplitude_rad = 0;
  std::string formula;
  /// What it depends on, as `unnamed` describes it.
  std::array<flexcomp::Covariate, 2> covariate{};
  std::array<unsigned, 2> covariate_joint{};  ///< from 1
  std::function<double(double, double)> shape;
};

/// A raised cosine of one joint (from 1), folded to a turn.
struct Bump {
  unsigned joint = 0;
  double centre_rad = 0;
  double width_rad = 0.25;  ///< full
  double height_rad = 0;
  double at(double q_rad) const;
};

/// What is wrong with the data of a rough case.
enum class Roughness { nothing, outliers, slip, drift, no_time, no_temperature, no_moves };
std::string name(Roughness roughness);
/// Whether an effect cannot be seen without the columns that this roughness takes away.
bool needs_what_is_missing(flexcomp::Effect effect, Roughness roughness);

struct Case {
  Row row = Row::none;
  std::uint64_t seed = 0;
  std::size_t arm = 0;  ///< of arms::all()
  std::string arm_name;
  flexcomp::host::Robot robot;
  plain::Nominal nominal;
  plain::Truth truth;          ///< everything: geometry, compliances, gravity, and what is hidden
  std::vector<Effect> hidden;  ///< effects of the catalogue that are hidden
  std::optional<Outside> outside;
  std::optional<Bump> bump;
  Roughness roughness = Roughness::nothing;
  std::string what;  ///< for people
  flexcomp::host::ContextColumns columns;
  std::vector<flexcomp::host::Observation> train, held_out;
  std::vector<bool> wild;           ///< per training row: an outlier
  std::vector<double> move_rad;     ///< six per row, training rows first
  std::size_t inside_the_bump = 0;  ///< training rows

  /// Without the outliers.
  std::vector<flexcomp::host::Observation> clean_train() const;
};

/// Poses that are diagnosed, and poses that only judge.
constexpr std::size_t training_poses = 90;
constexpr std::size_t held_out_poses = 45;

/// The case of a seed, always the same.
Case draw(Row row, std::uint64_t seed);

/// The pose that the true arm shows, without noise: measured point and orientation in Fb.
plain::Matrix true_pose(const Case& c, const plain::Joints& q, const plain::Situation& s);

/// Truth as the program's own terms: for what stands outside the catalogue, a curve or a grid that comes near it.
flexcomp::host::TermSet terms_of(const Case& c);
/// The terms of what is hidden alone, appended to a model. An outside effect and a bump drive one parameter each: their
/// size, 1 being the true one.
void append_hidden(flexcomp::host::ParametricModel& model, const Case& c, bool with_values);

/// D.csv, H.csv (held out), R.yaml, T.yaml (the truth) in a folder.
void dump(const Case& c, const std::string& folder);

}  // namespace hidden
