// SPDX-License-Identifier: Apache-2.0
/// \file
/// Linear system of a fitted model's misfit (D1): whitened residual and candidates' columns, the model's own columns
/// projected out.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "diagnosis/candidates.hpp"
#include "identification/residuals.hpp"
#include "measurement/observation.hpp"
#include "model/effects/descriptor.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

/// Least gain in BIC at which an effect is named (D4): a little more than decisive, for some two hundred are tried.
constexpr double least_gain = 12;

/// Unit of the coefficients of a curve's columns.
constexpr double curve_unit_rad = 1e-4;

/// Above so many rows, searches that take long and that the mass of the rows decides are cut short.
constexpr std::size_t many_rows = 300;

/// First of the six numbers of a row in a stacked whitened vector.
inline Eigen::Index first_number(std::size_t row) { return 6 * static_cast<Eigen::Index>(row); }

/// Joint of a link's place, from 1; 0: base, tool, point or load.
inline unsigned joint_of(Place place) {
  return place.body >= 1 && place.body <= joint_count ? place.body : 0;
}

/// Whether the effect is a step in time, whose time a scan finds.
inline bool is_step(const EffectId& id) { return descriptor(id.effect).has(Selector::after); }

/// Columns that enter and leave together, and what they cost.
struct Block {
  EffectId id;
  std::size_t candidate = 0;          ///< index into CandidateSet::list; of a scanned one: list.size()
  std::vector<Eigen::Index> columns;  ///< of GapSystem::columns
  std::vector<std::size_t> fitted;    ///< the candidate's parameters that have a column, in their order
  double parameters = 0;              ///< k of the BIC (D2)
  bool positive = false;
  /// Prior precision of each coefficient (per square of its unit); 0: none. Blocks with a prior are scored by their
  /// evidence (D3) instead of the BIC: smooth functions of many coefficients.
  double precision = 0;
  double margin = 0;  ///< least gain beyond its cost (D4)
  /// Joint that an unnamed function turns and its covariates: effects that it contains are incompatible with it.
  unsigned function_joint = 0;
  std::vector<unsigned> function_readings;  ///< joints from 1
  bool function_load = false;
  double centre_rad = 0;    ///< of a local curve
  double width_rad = 0;     ///< of a local curve: spacing of its knots; 0: no local curve
  std::size_t scanned = 0;  ///< of a local curve or an unnamed function: index into what a scan found

  bool is_function() const { return id.effect == Effect::unnamed; }
  bool is_local() const { return width_rad > 0; }
};

/// A place of the chain and how the whitened residual of each row follows it: six numbers per row and rad or m.
struct PlaceColumn {
  Place place;
  Eigen::VectorXd column;
};

/// The system at one estimate. Rows of the matrices: six per row of data; rows that are left out are zero.
struct GapSystem {
  std::size_t rows = 0;
  double numbers = 0;        ///< measured numbers of the rows that count
  std::vector<bool> counts;  ///< per row
  Eigen::VectorXd residual;  ///< whitened, nuisance projected out, candidates' own present values added back
  Eigen::MatrixXd nuisance;  ///< orthonormal basis of what the model may still move
  Eigen::MatrixXd columns;   ///< of the blocks, nuisance projected out
  std::vector<Block> blocks;
  std::vector<EffectId> dropped;    ///< nothing of them is left after the projection
  std::vector<PlaceColumn> places;  ///< not projected
};

/// Linearises the model at an estimate and projects (D1).
/// \param estimate  its set is that of `all`, with present values
/// \param fitted    what the model moves, without the candidates
GapSystem gap_system(const Robot& robot, const std::vector<Observation>& rows,
                     const std::vector<bool>& counts, const Estimate& estimate, const Unknowns& fitted,
                     const CandidateSet& all = {});

/// Appends columns (whitened, not projected) as a block.
void add_block(GapSystem& system, Block block, const Eigen::MatrixXd& columns);

/// Column of a place times a number per row.
Eigen::VectorXd times(const Eigen::VectorXd& place, const Eigen::VectorXd& per_row);

/// \throws std::logic_error  the system does not have the place
const Eigen::VectorXd& place_column(const GapSystem& system, Place place);

}  // namespace flexcomp::host
