// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/joint_curves.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnosis/spline.hpp"
#include "linalg/blas.hpp"
#include "linalg/decompositions.hpp"

namespace flexcomp::host {

namespace {

/// Highest order of a curve: its splines follow no finer structure.
constexpr int highest_order = 48;

/// The spectrum falls by the fourth power of the order beyond the corner, its square root's amplitude by the second.
constexpr double fall = 4;

/// Variance of nuisance parameters, in their orthonormal columns: as good as none is known.
constexpr double flat_variance = 1e12;

/// Weak priors of what the marginal likelihood is maximised over, natural logarithms: size over curve_unit_rad, corner, scale
/// of the noise. They decide only where the rows do not.
constexpr double size_spread = 3;
constexpr double corner_spread = 1;
constexpr double usual_corner = 10;
constexpr double noise_spread = 2;

/// Share of the variance at an order, not normalised.
double spectrum(int order, double corner) { return 1 / (1 + std::pow(order / corner, fall)); }

/// Amplitude that a spline interpolating a harmonic keeps of it.
double spline_gain(int order, std::size_t coefficients) {
  const double x = pi * order / static_cast<double>(coefficients);
  return std::pow(std::sin(x) / x, 4);
}

}  // namespace

Eigen::MatrixXd coefficient_covariance(double size_rad, double corner, std::size_t coefficients) {
  const auto count = static_cast<Eigen::Index>(coefficients);
  const int orders = std::min(highest_order, static_cast<int>(3 * coefficients / 8));
  double sum = 0;
  for (int n = 1; n <= orders; ++n) sum += spectrum(n, corner);
  // A little of every order, the mean among them, keeps the matrix regular.
  Eigen::VectorXd along = Eigen::VectorXd::Zero(count);
  along[0] = 1e-6 * size_rad * size_rad;
  for (int n = 1; n <= orders; ++n) {
    const double variance =
        size_rad * size_rad * spectrum(n, corner) / sum / std::pow(spline_gain(n, coefficients), 2);
    for (Eigen::Index k = 0; k < count; ++k)
      along[k] +=
          variance * std::cos(2 * pi * n * static_cast<double>(k) / static_cast<double>(coefficients));
  }
  Eigen::MatrixXd out(count, count);
  for (Eigen::Index r = 0; r < count; ++r) {
    for (Eigen::Index c = 0; c < count; ++c) out(r, c) = along[(r - c + count) % count];
  }
  return out;
}

std::vector<bool> measured_coefficients(const std::vector<Observation>& rows, std::size_t joint,
                                        std::size_t coefficients) {
  constexpr double widest_gap = 2 * pi / 6;
  const double spacing = 2 * pi / static_cast<double>(coefficients);
  std::vector<double> readings;
  for (const Observation& row : rows) {
    const double q = std::remainder(row.q_rad[joint], 2 * pi);
    readings.push_back(q < 0 ? q + 2 * pi : q);
  }
  std::ranges::sort(readings);
  std::vector<bool> out(coefficients, true);
  for (std::size_t k = 0; k < readings.size(); ++k) {
    const double from = readings[k];
    const double to = k + 1 < readings.size() ? readings[k + 1] : readings.front() + 2 * pi;
    if (!(to - from > widest_gap)) continue;
    // The support of a spline reaches two knots.
    for (std::size_t c = 0; c < 2 * coefficients; ++c) {
      const double at = spacing * static_cast<double>(c);
      if (at > from + 2 * spacing && at < to - 2 * spacing) out[c % coefficients] = false;
    }
  }
  return out;
}

CurveEvidence::CurveEvidence(const SubsetSearch& search, const std::vector<Observation>& rows,
                             const Subset& blocks)
    : blocks_(blocks) {
  const GapSystem& system = search.system();
  const Eigen::Index numbers = system.residual.size();
  constexpr Eigen::Index per_joint = 2 * highest_order;
  curves_.resize(numbers, per_joint * static_cast<Eigen::Index>(joint_count));
  for (std::size_t j = 0; j < joint_count; ++j) {
    const Eigen::VectorXd place =
        place_column(system, {static_cast<std::uint8_t>(j + 1), slot::theta}) * curve_unit_rad;
    Eigen::VectorXd wave(static_cast<Eigen::Index>(rows.size()));
    for (int n = 1; n <= highest_order; ++n) {
      const Eigen::Index at = static_cast<Eigen::Index>(j) * per_joint + 2 * (n - 1);
      for (const bool is_sine : {false, true}) {
        for (std::size_t k = 0; k < rows.size(); ++k) {
          const double angle = n * rows[k].q_rad[j];
          wave[static_cast<Eigen::Index>(k)] = !system.counts[k] ? 0.0
                                               : is_sine         ? std::sin(angle)
                                                                 : std::cos(angle);
        }
        curves_.col(at + is_sine) = times(place, wave);
      }
    }
  }
  // Blocks in coefficients of unit variance.
  std::vector<Eigen::MatrixXd> scaled;
  Eigen::Index at = curves_.cols();
  for (const std::size_t b : blocks_) {
    const Block& block = system.blocks[b];
    Eigen::MatrixXd columns = system.columns(Eigen::all, block.columns);
    if (search.precision_of(block, block.columns.front()) > 0) {
      for (Eigen::Index c = 0; c < columns.cols(); ++c)
        columns.col(c) /= std::sqrt(search.precision_of(block, block.columns[static_cast<std::size_t>(c)]));
    } else {
      Eigen::MatrixXd factor = gram(columns);
      factor.diagonal() *= 1 + 1e-9;
      if (factor_in_place(factor)) orthonormalise(factor, columns);
      columns *= std::sqrt(system.numbers);
    }
    columns_of_block_.emplace_back(at, at + columns.cols());
    at += columns.cols();
    scaled.push_back(std::move(columns));
  }
  flat_ = at;
  Eigen::MatrixXd all(numbers, at + system.nuisance.cols());
  all.leftCols(curves_.cols()) = curves_;
  for (std::size_t b = 0; b < scaled.size(); ++b)
    all.middleCols(columns_of_block_[b].first, scaled[b].cols()) = scaled[b];
  all.rightCols(system.nuisance.cols()) = system.nuisance;
  const auto half_of = [&](Eigen::Index first) {
    Half half;
    std::vector<Eigen::Index> taken;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      if (!system.counts[k] || (first > 0 && !rows[k].has_orientation)) continue;
      for (Eigen::Index c = 0; c < 3; ++c) taken.push_back(first_number(k) + first + c);
    }
    const Eigen::MatrixXd part = all(taken, Eigen::all);
    const Eigen::VectorXd measured = system.residual(taken);
    half.gram = gram(part);
    half.right = part.transpose() * measured;
    half.square = measured.squaredNorm();
    half.numbers = static_cast<double>(taken.size());
    return half;
  };
  position_ = half_of(0);
  orientation_ = half_of(3);
}

CurveEvidence::Features CurveEvidence::features(const Subset& blocks,
                                                const std::array<bool, joint_count>& joints) const {
  Features f;
  const auto add = [&f](Eigen::Index index, int joint, int order) {
    f.index.push_back(index);
    f.joint.push_back(joint);
    f.order.push_back(order);
  };
  for (std::size_t j = 0; j < joint_count; ++j) {
    for (int n = 0; joints[j] && n < 2 * highest_order; ++n)
      add(static_cast<Eigen::Index>(j) * 2 * highest_order + n, static_cast<int>(j), n / 2 + 1);
  }
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    if (std::ranges::find(blocks, blocks_[b]) == blocks.end()) continue;
    for (Eigen::Index c = columns_of_block_[b].first; c < columns_of_block_[b].second; ++c) add(c, -1, 0);
  }
  for (Eigen::Index c = flat_; c < position_.gram.cols(); ++c) add(c, -2, 0);
  return f;
}

/// Logarithms: noise of positions, of orientations, corner, sizes of the joints that have a curve.
struct CurveEvidence::Point {
  Eigen::VectorXd log;
  double value =
      -std::numeric_limits<double>::infinity();  // 2 ln of the marginal likelihood and the weak priors
  Eigen::VectorXd slope;                         // derivative of it
};

namespace {
enum : Eigen::Index { at_position, at_orientation, at_corner, at_sizes };
}

bool CurveEvidence::evaluate(const Features& f, const Eigen::VectorXd& log, bool with_slope,
                             Point& out) const {
  out.log = log;
  const auto count = static_cast<Eigen::Index>(f.index.size());
  const double corner = std::exp(log[at_corner]);
  double sum = 0;
  double sum_slope = 0;                   // d sum / d ln corner
  const auto slope_of = [&](int order) {  // d ln spectrum / d ln corner
    return fall * (1 - spectrum(order, corner));
  };
  for (int n = 1; n <= highest_order; ++n) {
    sum += spectrum(n, corner);
    sum_slope += spectrum(n, corner) * slope_of(n);
  }
  std::array<Eigen::Index, joint_count> size_at{};
  Eigen::Index sizes = at_sizes;
  for (const int j : f.joint) {
    if (j >= 0 && size_at[static_cast<std::size_t>(j)] == 0) size_at[static_cast<std::size_t>(j)] = sizes++;
  }
  Eigen::VectorXd root(count);  // standard deviation of each coefficient
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const int j = f.joint[k];
    root[i] = j == -1   ? 1
              : j == -2 ? std::sqrt(flat_variance)
                        : std::exp(log[size_at[static_cast<std::size_t>(j)]]) *
                              std::sqrt(spectrum(f.order[k], corner) / sum);
  }
  const double p = std::exp(-2 * log[at_position]);
  const double o = std::exp(-2 * log[at_orientation]);
  const Eigen::MatrixXd gram_p = position_.gram(f.index, f.index);
  Eigen::MatrixXd gram_o;
  const bool oriented = orientation_.numbers > 0;
  if (oriented) gram_o = orientation_.gram(f.index, f.index);
  Eigen::MatrixXd normal = oriented ? Eigen::MatrixXd(p * gram_p + o * gram_o) : Eigen::MatrixXd(p * gram_p);
  normal = root.asDiagonal() * normal * root.asDiagonal();
  normal.diagonal().array() += 1;
  const Eigen::VectorXd right_p = position_.right(f.index);
  const Eigen::VectorXd right_o = orientation_.right(f.index);
  Eigen::MatrixXd mean = root.asDiagonal() * (p * right_p + o * right_o);
  if (!factor_in_place(normal)) return false;
  solve_lower(normal, mean);
  const double explained = mean.squaredNorm();
  out.value = -(p * position_.square + o * orientation_.square - explained +
                2 * normal.diagonal().array().log().sum() + 2 * position_.numbers * log[at_position] +
                2 * orientation_.numbers * log[at_orientation]);
  out.slope = Eigen::VectorXd::Zero(log.size());
  const auto weak_prior = [&](Eigen::Index i, double expected, double spread) {
    const double x = (log[i] - expected) / spread;
    out.value -= x * x;
    out.slope[i] -= 2 * x / spread;
  };
  weak_prior(at_position, 0, noise_spread);
  weak_prior(at_orientation, 0, noise_spread);
  weak_prior(at_corner, std::log(usual_corner), corner_spread);
  for (Eigen::Index i = at_sizes; i < log.size(); ++i) weak_prior(i, 0, size_spread);
  if (!with_slope) return std::isfinite(out.value);
  solve_lower_transposed(normal, mean);
  Eigen::MatrixXd covariance = inverse_of_factored(normal);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (f.joint[k] < 0) continue;
    // Derivative of the value by the logarithm of this coefficient's variance.
    const double d = mean(i, 0) * mean(i, 0) + covariance(i, i) - 1;
    out.slope[size_at[static_cast<std::size_t>(f.joint[k])]] += 2 * d;
    out.slope[at_corner] += d * (slope_of(f.order[k]) - sum_slope / sum);
  }
  const Eigen::VectorXd coefficient = root.asDiagonal() * mean.col(0);
  covariance = root.asDiagonal() * covariance * root.asDiagonal();
  const auto left = [&](const Half& half, const Eigen::MatrixXd& g, const Eigen::VectorXd& r) {
    return half.square - 2 * coefficient.dot(r) + coefficient.dot(g * coefficient) +
           covariance.cwiseProduct(g).sum();
  };
  out.slope[at_position] += 2 * (p * left(position_, gram_p, right_p) - position_.numbers);
  if (oriented)
    out.slope[at_orientation] += 2 * (o * left(orientation_, gram_o, right_o) - orientation_.numbers);
  return std::isfinite(out.value);
}

CurveEvidence::Scan CurveEvidence::scan(const Subset& blocks,
                                        const std::array<bool, joint_count>& joints) const {
  // The joints one by one: a few hundred columns less than all at once.
  Scan out{Eigen::VectorXd::Zero(at_sizes + std::ranges::count(joints, true)), 0};
  out.log[at_corner] = std::log(usual_corner);
  Point without;
  evaluate(features(blocks, {}), out.log.head<at_sizes>(), false, without);
  Eigen::Index at = at_sizes;
  for (std::size_t j = 0; j < joint_count; ++j) {
    if (!joints[j]) continue;
    std::array<bool, joint_count> alone{};
    alone[j] = true;
    const Features f = features(blocks, alone);
    double most = -std::numeric_limits<double>::infinity();
    for (const double corner : {2.0, 8.0, 25.0}) {
      for (const double size : {0.3, 1.0, 4.0}) {
        Eigen::VectorXd log = Eigen::VectorXd::Zero(at_sizes + 1);
        log[at_corner] = std::log(corner);
        log[at_sizes] = std::log(size);
        Point here;
        if (!evaluate(f, log, false, here) || here.value - without.value <= most) continue;
        most = here.value - without.value;
        out.log[at] = most > 0 ? log[at_sizes] : std::log(0.3);
      }
    }
    out.gain = std::max(out.gain, most);
    ++at;
  }
  return out;
}

std::optional<CurveMaximum> CurveEvidence::maximum_where_any_gains() const {
  std::array<bool, joint_count> all{};
  all.fill(true);
  const Scan start = scan(blocks_, all);
  if (!(start.gain > 0)) return {};
  return climb(features(blocks_, all), start.log, all);
}

Eigen::VectorXd CurveEvidence::logarithms(const CurveMaximum& at,
                                          const std::array<bool, joint_count>& joints) {
  Eigen::VectorXd log(at_sizes + std::ranges::count(joints, true));
  log.head<at_sizes>() << std::log(at.position_noise), std::log(at.orientation_noise),
      std::log(at.prior.corner);
  Eigen::Index to = at_sizes;
  for (std::size_t j = 0; j < joint_count; ++j) {
    if (joints[j]) log[to++] = std::log(std::max(at.prior.size_rad[j], 1e-6) / curve_unit_rad);
  }
  return log;
}

double CurveEvidence::value_without(const Subset& blocks, const std::array<bool, joint_count>& joints,
                                    const CurveMaximum& at) const {
  Point point;
  evaluate(features(blocks, joints), logarithms(at, joints), false, point);
  return point.value;
}

CurveMaximum CurveEvidence::maximum(const Subset& blocks, const std::array<bool, joint_count>& joints,
                                    const CurveMaximum* start) const {
  return climb(features(blocks, joints),
               start == nullptr ? scan(blocks, joints).log : logarithms(*start, joints), joints);
}

CurveMaximum CurveEvidence::climb(const Features& f, Eigen::VectorXd log,
                                  const std::array<bool, joint_count>& joints) const {
  constexpr int most_steps = 60;
  constexpr double longest_step = 1.5;
  constexpr double converged = 0.05;
  // BFGS (Nocedal and Wright 2006, Algorithm 6.1) on the negative of the value, steps halved until they gain.
  const Eigen::Index n = log.size();
  Point now;
  CurveMaximum out;
  out.value = -std::numeric_limits<double>::infinity();
  if (!evaluate(f, log, true, now)) return out;
  Eigen::MatrixXd inverse_hessian = 0.02 * Eigen::MatrixXd::Identity(n, n);
  for (int step = 0; step < most_steps; ++step) {
    Eigen::VectorXd direction = inverse_hessian * now.slope;
    const double length = direction.cwiseAbs().maxCoeff();
    if (length > longest_step) direction *= longest_step / length;
    Point next;
    double share = 1;
    bool gains = false;
    for (int half = 0; half < 8 && !gains; ++half, share *= 0.4)
      gains = evaluate(f, log + share * direction, true, next) &&
              next.value > now.value + 1e-4 * share * direction.dot(now.slope);
    if (!gains) break;
    const Eigen::VectorXd moved = next.log - now.log;
    const Eigen::VectorXd change = now.slope - next.slope;
    const double along = moved.dot(change);
    if (along > 1e-10) {
      const Eigen::MatrixXd left = Eigen::MatrixXd::Identity(n, n) - moved * change.transpose() / along;
      inverse_hessian = left * inverse_hessian * left.transpose() + moved * moved.transpose() / along;
    }
    const double gain = next.value - now.value;
    log = next.log;
    now = std::move(next);
    if (gain < converged) break;
  }
  out.value = now.value;
  out.position_noise = std::exp(log[at_position]);
  out.orientation_noise = std::exp(log[at_orientation]);
  out.prior.corner = std::exp(log[at_corner]);
  Eigen::Index at = at_sizes;
  for (std::size_t j = 0; j < joint_count; ++j) {
    if (joints[j]) out.prior.size_rad[j] = curve_unit_rad * std::exp(log[at++]);
  }
  return out;
}

ChosenColumns CurveEvidence::columns_of(const CurveMaximum& at) const {
  double sum = 0;
  for (int n = 1; n <= highest_order; ++n) sum += spectrum(n, at.prior.corner);
  ChosenColumns out;
  std::vector<Eigen::Index> taken;
  std::vector<double> precision;
  for (std::size_t j = 0; j < joint_count; ++j) {
    if (!at.prior.has(j)) continue;
    const double size = at.prior.size_rad[j] / curve_unit_rad;
    for (int n = 0; n < 2 * highest_order; ++n) {
      taken.push_back(static_cast<Eigen::Index>(j) * 2 * highest_order + n);
      precision.push_back(sum / (size * size * spectrum(n / 2 + 1, at.prior.corner)));
    }
  }
  out.columns = curves_(Eigen::all, taken);
  out.precision = Eigen::Map<Eigen::VectorXd>(precision.data(), static_cast<Eigen::Index>(precision.size()));
  return out;
}

}  // namespace flexcomp::host
