// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/residual_analysis.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "distributions.hpp"
#include "linalg/blas.hpp"
#include "linalg/decompositions.hpp"
#include "model/covariate.hpp"

namespace flexcomp::host {

namespace {

/// One place seen by a remainder, a scalar per row: what a motion of the place there would explain.
struct Scalar {
  Eigen::VectorXd square;   ///< |u|^2
  Eigen::VectorXd product;  ///< u . r
  Eigen::MatrixXd basis;    ///< one column per row: basis^T u
};

Scalar scalar(const GapSystem& system, const ResidualAnalysis& left, const Eigen::VectorXd& column) {
  const Eigen::Index n = static_cast<Eigen::Index>(system.rows);
  Scalar s{Eigen::VectorXd(n), Eigen::VectorXd(n), Eigen::MatrixXd(left.basis.cols(), n)};
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto u = column.segment<6>(6 * k);
    s.square[k] = u.squaredNorm();
    s.product[k] = u.dot(left.residual.segment<6>(6 * k));
    s.basis.col(k).noalias() = left.basis.middleRows<6>(6 * k).transpose() * u;
  }
  return s;
}

std::vector<Scalar> turns_of_joints(const GapSystem& system, const ResidualAnalysis& left) {
  std::vector<Scalar> joints;
  for (std::uint8_t j = 1; j <= joint_count; ++j)
    joints.push_back(scalar(system, left, place_column(system, {j, slot::theta}).column));
  return joints;
}

double spline(double x) {
  x = std::abs(x);
  if (x < 1) return 2.0 / 3 - x * x + x * x * x / 2;
  return x < 2 ? std::pow(2 - x, 3) / 6 : 0;
}

double turn_apart(double a, double b) { return std::remainder(a - b, 2 * pi); }

double value_of(const Bump& bump, double x, double y) {
  // 1 in the middle: 9/4 times the product of two splines of 2/3.
  return 2.25 * spline(turn_apart(x, bump.centre_rad[0]) / bump.spacing_rad) *
         spline(turn_apart(y, bump.centre_rad[1]) / bump.spacing_rad);
}

}  // namespace

ResidualAnalysis remainder(const SubsetSearch& search, const Scored& solution) {
  const GapSystem& system = search.system();
  ResidualAnalysis out;
  out.noise_scale2 = search.noise_scale2();
  out.residual = system.residual;
  Eigen::Index count = 0;
  for (const std::size_t b : solution.blocks)
    count += static_cast<Eigen::Index>(system.blocks[b].columns.size());
  Eigen::MatrixXd added(system.columns.rows(), count);
  Eigen::Index at = 0;
  Eigen::VectorXd precision(count);
  for (const std::size_t b : solution.blocks) {
    for (const Eigen::Index c : system.blocks[b].columns) {
      out.residual -= system.columns.col(c) * solution.solution[at];
      precision[at] = out.noise_scale2 * search.precision_of(system.blocks[b], c);
      added.col(at++) = system.columns.col(c);
    }
  }
  out.basis = system.nuisance;
  out.fitted_numbers = static_cast<double>(system.nuisance.cols());
  if (count == 0) return out;
  // basis basis^T is the matrix that takes the residuals to their fit; with priors its trace counts what they leave free.
  Eigen::MatrixXd normal = gram(added);
  normal.diagonal() += precision;
  if (!factor_in_place(normal)) return out;
  orthonormalise(normal, added);
  out.fitted_numbers += added.squaredNorm();
  out.basis.resize(added.rows(), system.nuisance.cols() + count);
  out.basis << system.nuisance, added;
  return out;
}

ResidualAnalysis remainder(const GapSystem& system) {
  ResidualAnalysis out;
  out.residual = system.residual;
  out.basis = system.nuisance;
  out.fitted_numbers = static_cast<double>(system.nuisance.cols());
  return out;
}

std::vector<PlaceShare> place_shares(const GapSystem& system, const ResidualAnalysis& left) {
  std::vector<PlaceShare> shares;
  const double dof = system.numbers - left.fitted_numbers;
  const double beyond = left.chi2() - dof;
  for (const PlaceColumn& place : system.places) {
    const Scalar s = scalar(system, left, place.column);
    double found = 0;
    double expected = 0;
    double square = 0;
    for (Eigen::Index k = 0; k < s.square.size(); ++k) {
      if (!(s.square[k] > 0)) continue;
      const double freedom = std::max(0.0, 1 - s.basis.col(k).squaredNorm() / s.square[k]);
      if (freedom < 1e-6) continue;
      found += s.product[k] * s.product[k] / s.square[k] / left.noise_scale2;
      expected += freedom;
      square += freedom * freedom;
    }
    if (!(expected > 0.5)) continue;
    // Satterthwaite: a multiple of a chi-square with the same mean and variance.
    const double factor = square / expected;
    PlaceShare share;
    share.place = place.place;
    share.p_value = chi2_above(found / factor, expected / factor);
    share.explains = beyond > 0 ? std::clamp((found - expected) / beyond, 0.0, 1.0) : 0;
    shares.push_back(share);
  }
  std::stable_sort(shares.begin(), shares.end(),
                   [](const PlaceShare& a, const PlaceShare& b) { return a.explains > b.explains; });
  return shares;
}

Eigen::VectorXd local_values(const LocalCurve& curve, const std::vector<Observation>& rows) {
  Eigen::VectorXd v(static_cast<Eigen::Index>(rows.size()));
  const double per_rad = static_cast<double>(curve.knots) / (2 * pi);
  for (std::size_t k = 0; k < rows.size(); ++k)
    v[static_cast<Eigen::Index>(k)] =
        spline(turn_apart(rows[k].q_rad[curve.joint - 1], curve.centre_rad) * per_rad);
  return v;
}

std::vector<LocalCurve> local_curves(const GapSystem& system, const ResidualAnalysis& left,
                                     const std::vector<Observation>& rows, std::size_t per_joint,
                                     std::size_t least_touched) {
  std::vector<LocalCurve> chosen;
  const double log_n = std::log(std::max(2.0, system.numbers));
  for (unsigned joint = 1; joint <= joint_count; ++joint) {
    const Place place{static_cast<std::uint8_t>(joint), slot::theta};
    const Scalar s = scalar(system, left, place_column(system, place).column);
    std::vector<std::pair<double, Eigen::Index>> order;
    for (std::size_t k = 0; k < rows.size(); ++k)
      order.emplace_back(turn_apart(rows[k].q_rad[joint - 1], 0), static_cast<Eigen::Index>(k));
    std::sort(order.begin(), order.end());
    std::vector<LocalCurve> all;
    for (const std::size_t knots : {24U, 36U, 48U, 72U, 96U}) {
      const double spacing = 2 * pi / static_cast<double>(knots);
      for (std::size_t c = 0; c < 2 * knots; ++c) {
        const double centre = -pi + 0.5 * spacing * static_cast<double>(c);
        double b = 0;
        double square = 0;
        std::size_t touched = 0;
        Eigen::VectorXd w = Eigen::VectorXd::Zero(left.basis.cols());
        // Rows inside the support, over the end of the turn as well.
        const auto visit = [&](double from, double to) {
          for (auto at = std::lower_bound(order.begin(), order.end(), std::pair{from, Eigen::Index{-1}});
               at != order.end() && at->first < to; ++at) {
            const double phi = spline(turn_apart(at->first, centre) / spacing);
            if (phi <= 0 || !(s.square[at->second] > 0)) continue;
            b += phi * s.product[at->second];
            square += phi * phi * s.square[at->second];
            w += phi * s.basis.col(at->second);
            if (phi > 0.1) ++touched;
          }
        };
        visit(centre - 2 * spacing, centre + 2 * spacing);
        if (centre - 2 * spacing < -pi) visit(centre - 2 * spacing + 2 * pi, pi + 1e-9);
        if (centre + 2 * spacing > pi) visit(-pi - 1e-9, centre + 2 * spacing - 2 * pi);
        const double norm = square - w.squaredNorm();
        if (touched < least_touched || !(norm > 0.05 * square)) continue;
        all.push_back({joint, knots, centre, b * b / norm / left.noise_scale2 - 2 * log_n});
      }
    }
    std::sort(all.begin(), all.end(),
              [](const LocalCurve& a, const LocalCurve& b) { return a.gain > b.gain; });
    std::size_t taken = 0;
    for (const LocalCurve& c : all) {
      if (taken >= per_joint || !(c.gain > 0)) break;
      const bool near = std::any_of(chosen.begin(), chosen.end(), [&](const LocalCurve& other) {
        return other.joint == joint &&
               std::abs(turn_apart(other.centre_rad, c.centre_rad)) <
                   2 * pi / static_cast<double>(other.knots) + 2 * pi / static_cast<double>(c.knots);
      });
      if (near) continue;
      chosen.push_back(c);
      ++taken;
    }
  }
  return chosen;
}

std::vector<Slip> slips(const GapSystem& system, const ResidualAnalysis& left,
                        const std::vector<Observation>& rows,
                        const std::array<Eigen::VectorXd, 3>& point_columns, std::size_t most) {
  const Eigen::Index n = static_cast<Eigen::Index>(rows.size());
  std::vector<Eigen::Index> order(rows.size());
  std::iota(order.begin(), order.end(), Eigen::Index{0});
  const auto time = [&](Eigen::Index k) { return rows[static_cast<std::size_t>(k)].context.time_s; };
  std::stable_sort(order.begin(), order.end(),
                   [&](Eigen::Index a, Eigen::Index b) { return time(a) > time(b); });
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(left.basis.cols(), 3);
  std::vector<Slip> all;
  const double log_n = std::log(std::max(2.0, system.numbers));
  // A step of a handful of rows is a handful of outliers.
  for (Eigen::Index i = 0; i + 1 < n; ++i) {
    const Eigen::Index k = order[static_cast<std::size_t>(i)];
    Eigen::Matrix<double, 6, 3> u;
    for (int c = 0; c < 3; ++c) u.col(c) = point_columns[static_cast<std::size_t>(c)].segment<6>(6 * k);
    normal += u.transpose() * u;
    right += u.transpose() * left.residual.segment<6>(6 * k);
    basis += left.basis.middleRows<6>(6 * k).transpose() * u;
    const Eigen::Index before = order[static_cast<std::size_t>(i + 1)];
    if (!(time(before) < time(k)) || i < 4 || i + 6 > n) continue;
    const Eigen::Matrix3d a = normal - basis.transpose() * basis;
    const Eigen::LLT<Eigen::Matrix3d> factor(a);
    if (factor.info() != Eigen::Success) continue;
    all.push_back(
        {0.5 * (time(before) + time(k)), right.dot(factor.solve(right)) / left.noise_scale2 - 4 * log_n});
  }
  std::sort(all.begin(), all.end(), [](const Slip& a, const Slip& b) { return a.gain > b.gain; });
  if (all.size() > most) all.resize(most);
  return all;
}

// --- smooth functions -------------------------------------------------------------------------------------------------

std::string Variable::name() const { return is_order ? "order" : covariate_name(kind, joint); }

std::vector<Variable> variables(const std::vector<Observation>& rows, const Testable& can) {
  std::vector<Variable> list;
  const Eigen::Index n = static_cast<Eigen::Index>(rows.size());
  const auto add = [&](Covariate kind, unsigned joint, auto value) {
    Variable v;
    v.kind = kind;
    v.joint = joint;
    v.value.resize(n);
    for (Eigen::Index k = 0; k < n; ++k) v.value[k] = value(rows[static_cast<std::size_t>(k)]);
    if (v.value.maxCoeff() - v.value.minCoeff() > 1e-9) list.push_back(std::move(v));
  };
  for (unsigned j = 1; j <= joint_count; ++j)
    add(Covariate::joint_position, j, [j](const Observation& r) { return r.q_rad[j - 1]; });
  add(Covariate::payload, 0, [](const Observation& r) { return r.context.payload_kg; });
  if (can.temperature)
    add(Covariate::temperature, 0, [](const Observation& r) { return r.context.temperature_c; });
  if (can.time) add(Covariate::time, 0, [](const Observation& r) { return r.context.time_s; });
  for (unsigned j = 1; j <= joint_count; ++j) {
    if (can.direction[j - 1])
      add(Covariate::direction, j, [j](const Observation& r) { return r.context.direction[j - 1]; });
  }
  Variable order;
  order.is_order = true;
  order.value = Eigen::VectorXd::LinSpaced(n, 0, 1);
  list.push_back(std::move(order));
  return list;
}

namespace {

/// Members of a function of one variable, without the constant, and the prior standard deviation of each.
Eigen::MatrixXd members_of_one(const Variable& range, const Eigen::VectorXd& at, int harmonics) {
  const double low = range.value.minCoeff();
  const double high = range.value.maxCoeff();
  const Eigen::ArrayXd x = (2 * at.array() - low - high) / std::max(high - low, 1e-12);  // -1 … 1
  if (range.kind == Covariate::joint_position && !range.is_order) {
    Eigen::MatrixXd m(at.size(), 1 + 2 * harmonics);
    m.col(0) = x;
    for (int h = 1; h <= harmonics; ++h) {
      m.col(2 * h - 1) = (h * at.array()).sin() / std::sqrt(h);
      m.col(2 * h) = (h * at.array()).cos() / std::sqrt(h);
    }
    return m;
  }
  if (range.kind == Covariate::direction) return x.matrix();
  // Few values of a payload carry few powers.
  std::vector<double> distinct(range.value.data(), range.value.data() + range.value.size());
  std::sort(distinct.begin(), distinct.end());
  distinct.erase(std::unique(distinct.begin(), distinct.end(),
                             [&](double a, double b) { return b - a < 1e-6 * (high - low); }),
                 distinct.end());
  Eigen::MatrixXd m(at.size(), distinct.size() > 2 ? 2 : 1);
  m.col(0) = x;
  if (m.cols() > 1) m.col(1) = 0.5 * x.square();
  return m;
}

}  // namespace

Eigen::MatrixXd members(const SmoothFunction& function, const std::vector<Variable>& variables,
                        const std::vector<Eigen::VectorXd>& at) {
  const Variable& first = variables[function.of[0]];
  Eigen::MatrixXd all;
  if (function.bump) {
    all.resize(at[0].size(), 1);
    for (Eigen::Index k = 0; k < all.rows(); ++k) all(k, 0) = value_of(*function.bump, at[0][k], at[1][k]);
  } else if (function.of.size() == 1) {
    all = members_of_one(first, at[0], 2 * function.harmonics);
  } else {
    const Eigen::MatrixXd a = members_of_one(first, at[0], function.harmonics);
    const Eigen::MatrixXd b = members_of_one(variables[function.of[1]], at[1], function.harmonics);
    all.resize(a.rows(), a.cols() + b.cols() + a.cols() * b.cols());
    all << a, b, Eigen::MatrixXd(a.rows(), a.cols() * b.cols());
    for (Eigen::Index i = 0; i < a.cols(); ++i) {
      for (Eigen::Index k = 0; k < b.cols(); ++k)
        all.col(a.cols() + b.cols() + i * b.cols() + k) = a.col(i).cwiseProduct(b.col(k));
    }
  }
  if (function.share.size() == 0) return all;
  std::vector<Eigen::Index> stay;
  for (Eigen::Index k = 0; k < all.cols(); ++k) {
    if (function.share[k] > 0) stay.push_back(k);
  }
  return all(Eigen::all, stay) * function.share(stay).asDiagonal();
}

Eigen::MatrixXd members(const SmoothFunction& function, const std::vector<Variable>& variables) {
  std::vector<Eigen::VectorXd> at;
  for (const std::size_t v : function.of) at.push_back(variables[v].value);
  return members(function, variables, at);
}

namespace {

/// Rows that a spline touches, and its value there.
using Touched = std::vector<std::pair<Eigen::Index, double>>;

Touched touched_by(const Eigen::VectorXd& x, double centre, double spacing) {
  Touched out;
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const double value = 1.5 * spline(turn_apart(x[k], centre) / spacing);
    if (value > 0) out.emplace_back(k, value);
  }
  return out;
}

/// What a bump of a joint would take from chi-square less what its four numbers cost; none where it is not above `least`.
/// \param y  value of the second spline at every row
std::optional<double> gain_above(double least, const Scalar& s, const Touched& x, const Eigen::VectorXd& y,
                                 double noise_scale2, double log_n) {
  double b = 0;
  double square = 0;
  std::size_t touched = 0;
  for (const auto& [k, value] : x) {
    const double phi = value * y[k];
    if (phi <= 0 || !(s.square[k] > 0)) continue;
    b += phi * s.product[k];
    square += phi * phi * s.square[k];
    if (phi > 0.05) ++touched;
  }
  // Two poses would do for a line. What the rest of the model takes of a bump is seldom more than half.
  if (touched < 4 || !(b * b / (0.4 * square) / noise_scale2 - 4 * log_n > least)) return {};
  Eigen::VectorXd w = Eigen::VectorXd::Zero(s.basis.rows());
  for (const auto& [k, value] : x) {
    if (y[k] > 0 && s.square[k] > 0) w += value * y[k] * s.basis.col(k);
  }
  const double norm = square - w.squaredNorm();
  if (!(norm > 0.05 * square)) return {};
  const double gain = b * b / norm / noise_scale2 - 4 * log_n;
  if (!(gain > least)) return {};
  return gain;
}

Eigen::VectorXd at_every_row(const Touched& touched, Eigen::Index rows) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(rows);
  for (const auto& [k, value] : touched) out[k] = value;
  return out;
}

/// Splines of one reading side by side over the turn.
struct Row {
  std::vector<double> centre_rad;
  std::vector<Touched> touched;
  std::vector<Eigen::VectorXd> value;
  Row(const Eigen::VectorXd& x, double spacing) {
    const int count = static_cast<int>(std::ceil(4 * pi / spacing));
    for (int c = 0; c < count; ++c) {
      centre_rad.push_back(-pi + 2 * pi * c / count);
      touched.push_back(touched_by(x, centre_rad.back(), spacing));
      value.push_back(at_every_row(touched.back(), x.size()));
    }
  }
};

}  // namespace

std::vector<SmoothFunction> bumps(const GapSystem& system, const ResidualAnalysis& left,
                                  const std::vector<Variable>& of, std::size_t most) {
  constexpr std::array<double, 3> spacings{0.5, 0.8, 1.2};
  const double log_n = std::log(std::max(2.0, system.numbers));
  const std::vector<Scalar> joints = turns_of_joints(system, left);
  std::vector<std::vector<Row>> rows_of(of.size());
  for (std::size_t v = 0; v < of.size(); ++v) {
    if (of[v].is_order || of[v].kind != Covariate::joint_position) continue;
    for (const double spacing : spacings) rows_of[v].emplace_back(of[v].value, spacing);
  }
  std::vector<SmoothFunction> all;
  for (std::size_t a = 0; a < of.size(); ++a) {
    for (std::size_t b = a + 1; b < of.size(); ++b) {
      if (of[a].is_order || of[b].is_order || of[a].kind != Covariate::joint_position ||
          of[b].kind != Covariate::joint_position)
        continue;
      for (unsigned j = 1; j <= joint_count; ++j) {
        SmoothFunction best;
        best.place = {static_cast<std::uint8_t>(j), slot::theta};
        best.of = {a, b};
        best.size_rad = 1e-4;
        best.gain = 0;
        const Scalar& joint = joints[j - 1];
        for (std::size_t w = 0; w < spacings.size(); ++w) {
          const Row& first = rows_of[a][w];
          const Row& second = rows_of[b][w];
          for (std::size_t x = 0; x < first.touched.size(); ++x) {
            for (std::size_t y = 0; y < second.value.size(); ++y) {
              const auto gain =
                  gain_above(best.gain, joint, first.touched[x], second.value[y], left.noise_scale2, log_n);
              if (!gain) continue;
              best.gain = *gain;
              best.bump = Bump{{first.centre_rad[x], second.centre_rad[y]}, spacings[w]};
            }
          }
        }
        // Place and width more closely.
        double step = 0.25;
        for (int round = 0; best.bump && round < 5; ++round, step /= 2) {
          const Bump from = *best.bump;
          for (const double dx : {-step, 0.0, step}) {
            for (const double dy : {-step, 0.0, step}) {
              for (const double wider : {1 - step, 1.0, 1 + step}) {
                const Bump bump{
                    {from.centre_rad[0] + dx * from.spacing_rad, from.centre_rad[1] + dy * from.spacing_rad},
                    from.spacing_rad * wider};
                const auto gain = gain_above(
                    best.gain, joint, touched_by(of[a].value, bump.centre_rad[0], bump.spacing_rad),
                    at_every_row(touched_by(of[b].value, bump.centre_rad[1], bump.spacing_rad),
                                 of[b].value.size()),
                    left.noise_scale2, log_n);
                if (!gain) continue;
                best.gain = *gain;
                best.bump = bump;
              }
            }
          }
        }
        if (best.bump) all.push_back(best);
      }
    }
  }
  std::sort(all.begin(), all.end(),
            [](const SmoothFunction& x, const SmoothFunction& y) { return x.gain > y.gain; });
  if (all.size() > most) all.resize(most);
  return all;
}

Eigen::VectorXd relevance(const Eigen::MatrixXd& information, const Eigen::VectorXd& right, double& gain) {
  constexpr int rounds = 100;
  constexpr double gone = 1e-8;
  const Eigen::Index n = right.size();
  Eigen::VectorXd variance = Eigen::VectorXd::Ones(n);
  gain = 0;
  for (int round = 0; round <= rounds; ++round) {
    // In members of which each has the prior 1: never singular.
    const Eigen::VectorXd size = variance.cwiseSqrt();
    Eigen::MatrixXd normal = size.asDiagonal() * information * size.asDiagonal();
    normal.diagonal().array() += 1;
    const Llt factor(normal);
    if (!factor.is_positive_definite()) break;
    const Eigen::VectorXd scaled = size.asDiagonal() * right;
    const Eigen::VectorXd mean = factor.solve(scaled);
    const Eigen::MatrixXd covariance = factor.inverse();
    const Eigen::VectorXd determined = 1 - covariance.diagonal().array();
    gain = mean.dot(scaled) - factor.log_det() - 2 * static_cast<double>((variance.array() > gone).count());
    if (round == rounds) break;
    for (Eigen::Index k = 0; k < n; ++k) {
      const double square = mean[k] * mean[k];
      variance[k] *= variance[k] > gone && square > 0 ? square / std::max(determined[k], 1e-12) : 0;
      variance[k] = variance[k] > gone ? std::min(variance[k], 1e4) : 0;
    }
  }
  return variance.cwiseSqrt();
}

std::vector<SmoothFunction> smooth_functions(const GapSystem& system, const ResidualAnalysis& left,
                                             const std::vector<Variable>& of, std::size_t most) {
  constexpr std::array<double, 4> sizes{30e-6, 100e-6, 300e-6, 1000e-6};  // rad
  std::vector<std::vector<std::size_t>> sets;
  for (std::size_t a = 0; a < of.size(); ++a) {
    sets.push_back({a});
    if (of[a].is_order) continue;
    for (std::size_t b = a + 1; b < of.size(); ++b) {
      if (of[b].is_order || of[a].kind == Covariate::direction) continue;
      sets.push_back({a, b});
    }
  }
  const double tried = 2 * std::log(static_cast<double>(sets.size() * joint_count * sizes.size()));
  const std::vector<Scalar> joints = turns_of_joints(system, left);
  std::vector<SmoothFunction> all;
  for (const std::vector<std::size_t>& set : sets) {
    SmoothFunction kind;
    kind.of = set;
    const Eigen::MatrixXd phi = members(kind, of);
    for (unsigned j = 1; j <= joint_count; ++j) {
      // A coupling of the direction of one joint to another is nobody's.
      if (set.size() == 1 && of[set[0]].kind == Covariate::direction && of[set[0]].joint == j) continue;
      const Scalar& s = joints[j - 1];
      const Eigen::MatrixXd weighted = s.square.cwiseSqrt().asDiagonal() * phi;
      const Eigen::MatrixXd a = (gram(weighted) - gram(product(s.basis, phi))) / left.noise_scale2;
      const Eigen::VectorXd b = phi.transpose() * s.product / left.noise_scale2;
      const SymmetricEigen eigen = symmetric_eigen(a);
      const Eigen::VectorXd along = eigen.vectors.transpose() * b;
      SmoothFunction f = kind;
      f.place = {static_cast<std::uint8_t>(j), slot::theta};
      f.gain = -1e300;
      for (const double size : sizes) {
        double gain = -tried;
        for (Eigen::Index k = 0; k < along.size(); ++k) {
          const double l = std::max(0.0, eigen.values[k]);
          gain += along[k] * along[k] / (l + 1 / (size * size)) - std::log1p(size * size * l);
        }
        if (gain > f.gain) {
          f.gain = gain;
          f.size_rad = size;
        }
      }
      all.push_back(f);
    }
  }
  std::sort(all.begin(), all.end(),
            [](const SmoothFunction& a, const SmoothFunction& b) { return a.gain > b.gain; });
  if (all.size() > most) all.resize(most);
  return all;
}

}  // namespace flexcomp::host
