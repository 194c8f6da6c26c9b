// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/permutation_null.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "linalg/blas.hpp"

namespace flexcomp::host {

namespace {

using Rows = std::vector<std::size_t>;

/// The rows in an order without structure: every second permutation moves whole runs, which keeps drift within them.
Rows permuted_order(const Rows& live, bool in_runs, std::mt19937_64& random) {
  if (!in_runs) {
    Rows order = live;
    std::shuffle(order.begin(), order.end(), random);
    return order;
  }
  const std::size_t run = std::max<std::size_t>(2, static_cast<std::size_t>(std::sqrt(double(live.size()))));
  Rows order;
  Rows starts;
  const std::size_t shift = random() % live.size();
  for (std::size_t s = 0; s < live.size(); s += run) starts.push_back(s);
  std::shuffle(starts.begin(), starts.end(), random);
  for (const std::size_t s : starts) {
    for (std::size_t k = s; k < std::min(s + run, live.size()); ++k)
      order.push_back(live[(k + shift) % live.size()]);
  }
  return order;
}

}  // namespace

PermutationNull::PermutationNull(const SubsetSearch& search, const ResidualAnalysis& left,
                                 std::uint64_t seed) {
  const GapSystem& system = search.system();
  const std::size_t count = system.rows > many_rows ? 100 : 200;
  std::mt19937_64 random(seed);
  Rows live;
  for (std::size_t k = 0; k < system.rows; ++k) {
    if (system.counts[k]) live.push_back(k);
  }
  if (live.size() < 8) return;
  Eigen::MatrixXd permuted = Eigen::MatrixXd::Zero(left.residual.size(), static_cast<Eigen::Index>(count));
  for (std::size_t p = 0; p < count; ++p) {
    const Rows order = permuted_order(live, p % 2 == 1, random);
    for (std::size_t k = 0; k < live.size(); ++k) {
      permuted.col(static_cast<Eigen::Index>(p)).segment<6>(first_number(live[k])) =
          left.residual.segment<6>(first_number(order[k]));
    }
  }
  permuted -= product(system.nuisance, transposed_product(system.nuisance, permuted));
  const Eigen::VectorXd largest = search.largest_single_gains(permuted);
  maxima_.assign(largest.data(), largest.data() + largest.size());
}

double PermutationNull::p_value(double gain) const {
  if (maxima_.empty()) return 1;
  const double n = static_cast<double>(maxima_.size());
  const auto above =
      static_cast<double>(std::count_if(maxima_.begin(), maxima_.end(), [&](double m) { return m >= gain; }));
  if (above >= 10) return (1 + above) / (1 + n);
  double mean = 0;
  double square = 0;
  for (const double m : maxima_) mean += m / n;
  for (const double m : maxima_) square += (m - mean) * (m - mean) / (n - 1);
  const double beta = std::sqrt(6 * square) / pi;
  const double mu = mean - 0.57721566490153286 * beta;
  return -std::expm1(-std::exp(-(gain - mu) / std::max(beta, 1e-9)));
}

}  // namespace flexcomp::host
