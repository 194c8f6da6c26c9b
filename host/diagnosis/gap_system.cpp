// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/gap_system.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "linalg/blas.hpp"
#include "linalg/decompositions.hpp"
#include "model/effects/descriptor.hpp"
#include "model/place.hpp"

namespace flexcomp::host {

namespace {

/// A column is dropped where less than this share of its norm is left after the projection (docs/model.md, M33).
constexpr double nothing_left = 1e-3;

/// Indices of the columns of which enough is left after the projection.
std::vector<Eigen::Index> identifiable_columns(const Eigen::MatrixXd& columns,
                                               const Eigen::MatrixXd& projected) {
  std::vector<Eigen::Index> kept;
  for (Eigen::Index c = 0; c < columns.cols(); ++c) {
    const double whole = columns.col(c).norm();
    if (whole > 0 && projected.col(c).norm() > nothing_left * whole) kept.push_back(c);
  }
  return kept;
}

/// Rank of a block after the projection (the sum of a curve's splines is the offset of its joint).
double rank(const Eigen::MatrixXd& projected, const std::vector<Eigen::Index>& columns,
            const Eigen::Ref<const Eigen::MatrixXd>& whole, const std::vector<Eigen::Index>& whole_index) {
  const Eigen::Index n = static_cast<Eigen::Index>(columns.size());
  if (n == 1) return 1;
  Eigen::MatrixXd scaled(projected.rows(), n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::Index c = columns[static_cast<std::size_t>(k)];
    scaled.col(k) = projected.col(c) / whole.col(whole_index[static_cast<std::size_t>(c)]).norm();
  }
  return static_cast<double>(
      (symmetric_eigenvalues(gram(scaled)).array() > nothing_left * nothing_left).count());
}

std::vector<Place> all_places() {
  std::vector<Place> places;
  for (std::uint8_t link = 1; link <= joint_count; ++link) {
    for (std::uint8_t s = slot::theta; s <= slot::gamma; ++s) places.push_back({link, s});
  }
  for (const std::uint8_t b : {body::base, body::tool}) {
    for (std::uint8_t s = slot::x; s <= slot::rz; ++s) places.push_back({b, s});
  }
  return places;
}

/// Columns of the candidates (whitened), projected (D1) and sorted into blocks, one per form of an effect.
void add_candidates(GapSystem& system, const CandidateSet& all, const Eigen::MatrixXd& columns) {
  const Eigen::MatrixXd projected =
      columns - product(system.nuisance, transposed_product(system.nuisance, columns));
  // One column per parameter; forms of a name share them.
  std::vector<Eigen::Index> column_of(all.parameters.size(), -1);
  const std::vector<Eigen::Index> kept = identifiable_columns(columns, projected);
  for (std::size_t k = 0; k < kept.size(); ++k)
    column_of[static_cast<std::size_t>(kept[k])] = static_cast<Eigen::Index>(k);
  system.columns = projected(Eigen::all, kept);
  for (std::size_t c = 0; c < all.list.size(); ++c) {
    const Candidate& candidate = all.list[c];
    if (candidate.steps) continue;  // a scan makes blocks of it
    Block block;
    block.id = candidate.id;
    block.candidate = c;
    block.positive = candidate.positive;
    for (const std::size_t p : candidate.parameters) {
      if (column_of[p] < 0) continue;
      block.columns.push_back(column_of[p]);
      block.fitted.push_back(p);
    }
    if (block.columns.empty()) {
      const bool known = std::ranges::any_of(system.dropped,
                                             [&](const EffectId& id) { return same_name(id, candidate.id); });
      if (!known) system.dropped.push_back(candidate.id);
      continue;
    }
    block.parameters = rank(system.columns, block.columns, columns, kept);
    // Every arm bends: what the paper's model has needs no more than its BIC.
    block.margin = descriptor(block.id.effect).in_paper_model ? 0 : least_gain;
    if (candidate.prior_rad > 0) {
      block.precision = std::pow(curve_unit_rad / candidate.prior_rad, 2);
      block.parameters = 0;
    }
    system.blocks.push_back(std::move(block));
  }
}

}  // namespace

Eigen::VectorXd times(const Eigen::VectorXd& place, const Eigen::VectorXd& per_row) {
  Eigen::VectorXd out(place.size());
  for (Eigen::Index k = 0; k < per_row.size(); ++k)
    out.segment<6>(6 * k) = place.segment<6>(6 * k) * per_row[k];
  return out;
}

const Eigen::VectorXd& place_column(const GapSystem& system, Place place) {
  for (const PlaceColumn& p : system.places) {
    if (p.place == place) return p.column;
  }
  throw std::logic_error("a place without a column");
}

void add_block(GapSystem& system, Block block, const Eigen::MatrixXd& columns) {
  const Eigen::MatrixXd projected =
      columns - product(system.nuisance, transposed_product(system.nuisance, columns));
  const Eigen::Index first = system.columns.cols();
  const std::vector<Eigen::Index> kept = identifiable_columns(columns, projected);
  if (kept.empty()) return;
  system.columns.conservativeResize(columns.rows(), first + static_cast<Eigen::Index>(kept.size()));
  block.columns.clear();
  for (std::size_t k = 0; k < kept.size(); ++k) {
    const Eigen::Index to = first + static_cast<Eigen::Index>(k);
    system.columns.col(to) = projected.col(kept[k]);
    block.columns.push_back(to);
  }
  system.blocks.push_back(std::move(block));
}

GapSystem gap_system(const Robot& robot, const std::vector<Observation>& rows,
                     const std::vector<bool>& counts, const Estimate& estimate, const Unknowns& fitted,
                     const CandidateSet& all) {
  GapSystem out;
  out.rows = rows.size();
  out.counts = counts;
  // Places are terms of their own: constants at zero, which move nothing.
  Estimate with_places = estimate;
  Unknowns everything = fitted;
  everything.parameters.insert(everything.parameters.end(), all.parameters.begin(), all.parameters.end());
  const std::vector<Place> places = all_places();
  for (const Place place : places) {
    Term<double> t;
    t.place = place;
    t.coefficient = 0;
    everything.parameters.push_back(
        {geometric_name(place), place_unit(place), {with_places.set.terms.size()}, {}});
    with_places.set.terms.push_back(t);
  }
  const auto model = prepare(with_places.set, robot, "diagnosis");
  Linearised lin = linearised(with_places, *model, rows, everything);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (counts[k]) {
      out.numbers += rows[k].has_orientation ? 6 : 3;
      continue;
    }
    lin.residual.segment<6>(first_number(k)).setZero();
    lin.derivative.middleRows<6>(first_number(k)).setZero();
  }
  const Eigen::Index moved = static_cast<Eigen::Index>(fitted.count());
  const Eigen::Index asked = static_cast<Eigen::Index>(all.parameters.size());
  out.nuisance = orthonormal_basis(lin.derivative.leftCols(moved));
  const Eigen::VectorXd units = units_of(everything, with_places.set);
  for (std::size_t p = 0; p < places.size(); ++p) {
    const Eigen::Index c = moved + asked + static_cast<Eigen::Index>(p);
    out.places.push_back({places[p], lin.derivative.col(c) / units[c]});
  }
  const Eigen::MatrixXd candidate_columns = lin.derivative.middleCols(moved, asked);
  out.residual = lin.residual;
  for (Eigen::Index p = 0; p < asked; ++p) {
    const double value = all.parameters[static_cast<std::size_t>(p)].get(estimate.set);
    if (value != 0) out.residual += candidate_columns.col(p) * (value / units[moved + p]);
  }
  out.residual -= out.nuisance * (out.nuisance.transpose() * out.residual);
  add_candidates(out, all, candidate_columns);
  return out;
}

}  // namespace flexcomp::host
