// SPDX-License-Identifier: Apache-2.0
/// \file
/// The misfit of a fitted model as one linear system: what is left of the whitened residuals after everything that the
/// model may still move is projected out, and what each candidate would do to it.
#ifndef FLEXCOMP_HOST_DIAGNOSIS_GAP_SYSTEM_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_GAP_SYSTEM_HPP

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "diagnosis/candidates.hpp"
#include "identification/residuals.hpp"
#include "measurement/observation.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

/// What an effect must gain in BIC to be named at all: a little more than decisive, for some two hundred names are tried.
constexpr double least_gain = 12;

/// Columns that enter and leave together, and what they cost.
struct Block {
  EffectId id;
  std::size_t candidate = 0;          ///< index into CandidateSet::list; of a scanned one: list.size()
  std::vector<Eigen::Index> columns;  ///< of GapSystem::columns
  std::vector<std::size_t> fitted;    ///< the candidate's parameters that have a column, in their order
  double parameters = 0;              ///< that a BIC counts
  bool positive = false;
  /// Prior precision of each coefficient (per square of its unit). Of blocks with a prior the evidence is taken
  /// instead of the BIC: smooth functions of many coefficients.
  double precision = 0;
  double margin = 0;  ///< what it must gain beyond its cost to be there at all
  /// What an unnamed function turns and what it follows: names that it contains do not stand beside it.
  unsigned function_joint = 0;
  std::vector<unsigned> function_readings;  ///< joints from 1
  bool function_load = false;
  double centre_rad = 0;    ///< of a local curve
  double width_rad = 0;     ///< of a local curve: spacing of its knots; 0: no local curve
  std::size_t scanned = 0;  ///< of a local curve or an unnamed function: index into what the caller keeps
};

/// A place of the chain and how the whitened residual of each row follows it: six numbers per row and rad or m.
struct PlaceColumn {
  Place place;
  Eigen::VectorXd column;
};

/// All of it at one estimate. Rows of the matrices: six per row of data; rows that are left out are zero.
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

  double degrees_of_freedom() const { return numbers - static_cast<double>(nuisance.cols()); }
};

/// \param estimate  its set is that of `all`, with present values
/// \param fitted    what the model moves, without the candidates
GapSystem gap_system(const Robot& robot, const std::vector<Observation>& rows,
                     const std::vector<bool>& counts, const Estimate& estimate, const Unknowns& fitted,
                     const CandidateSet& all);

/// Appends columns (whitened, not projected) as a block.
void add_block(GapSystem& system, Block block, const Eigen::MatrixXd& columns);

/// The column of a place times a number per row.
Eigen::VectorXd times(const Eigen::VectorXd& place, const Eigen::VectorXd& per_row);

const PlaceColumn& place_column(const GapSystem& system, Place place);

}  // namespace flexcomp::host

#endif
