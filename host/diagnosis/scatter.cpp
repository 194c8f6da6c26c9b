// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/scatter.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "diagnosis/outlier_hypotheses.hpp"
#include "diagnosis/residual_analysis.hpp"
#include "identification/residuals.hpp"
#include "model/effects/descriptor.hpp"
#include "model/place.hpp"

namespace flexcomp::host {

namespace {

/// A place whose value is drawn from a normal distribution at every pose.
struct Scatter {
  Place place;
  double sigma = 0;  ///< rad or m
  /// 2 ln of the likelihood ratio against no scatter here.
  double gain = 0;
};

/// A model whose noise is the declared one plus the scatter of these places.
struct ScatteredModel {
  std::vector<Scatter> places;    ///< largest gain first; empty: nothing scatters
  std::vector<Observation> rows;  ///< with the wider noise in their whitening
  double log_determinant = 0;     ///< of the wider noise over the declared one, all rows
  Fit fit;                        ///< to these rows
};

constexpr std::size_t most_places = 6;

/// 2 ln of the likelihood ratio of a place that scatters by sigma (D15, by Woodbury's identity).
/// \param square, product  per row: |u|^2 and u . r
double gain_of(double sigma, const std::vector<double>& square, const std::vector<double>& product) {
  double gain = 0;
  for (std::size_t k = 0; k < square.size(); ++k) {
    const double wider = 1 + sigma * sigma * square[k];
    gain += sigma * sigma * product[k] * product[k] / wider - std::log(wider);
  }
  return gain;
}

Scatter best_scatter(Place place, const Eigen::VectorXd& column, const Eigen::VectorXd& residual,
                     const std::vector<bool>& has_full_weight) {
  std::vector<double> square;
  std::vector<double> product;
  double information = 0;
  for (std::size_t k = 0; k < has_full_weight.size(); ++k) {
    if (!has_full_weight[k]) continue;
    const auto u = column.segment<6>(first_number(k));
    square.push_back(u.squaredNorm());
    product.push_back(u.dot(residual.segment<6>(first_number(k))));
    information += square.back();
  }
  Scatter best{place, 0, 0};
  if (!(information > 0)) return best;
  const double unit =
      std::sqrt(static_cast<double>(square.size()) / information);  // standard deviation of one row
  // From a tenth to a thousand of that, refined twice.
  double low = std::log(0.1);
  double high = std::log(1000.0);
  for (int round = 0; round < 3; ++round) {
    constexpr int steps = 24;
    double here = low;
    for (int k = 0; k <= steps; ++k) {
      const double x = low + (high - low) * k / steps;
      const double sigma = unit * std::exp(x);
      const double gain = gain_of(sigma, square, product);
      if (gain <= best.gain) continue;
      best.gain = gain;
      best.sigma = sigma;
      here = x;
    }
    const double width = (high - low) / steps;
    if (best.sigma > 0 && round > 0) here = std::log(best.sigma / unit);
    low = here - width;
    high = here + width;
  }
  return best;
}

/// Where the rows do not separate places, the scatter is that of a joint: joints are what moves.
double bonus(Place place) { return place.slot == slot::theta ? decisive_bic : 0; }

/// Takes the noise of one place out of all rows of some columns: by (I + sigma^2 u u^T)^(-1/2).
class Narrowing {
 public:
  Narrowing(const Eigen::VectorXd& column, double sigma) : column_(column), sigma_(sigma) {}

  Eigen::Matrix<double, 6, 6> matrix(std::size_t row) const {
    const Vector6<double> u = column_.segment<6>(first_number(row));
    const double square = u.squaredNorm();
    Eigen::Matrix<double, 6, 6> m = Eigen::Matrix<double, 6, 6>::Identity();
    if (square > 0) m += (1 / std::sqrt(1 + sigma_ * sigma_ * square) - 1) / square * u * u.transpose();
    return m;
  }

  void apply(Eigen::VectorXd& to) const {
    for (std::size_t k = 0; first_number(k) < to.size(); ++k) {
      const Vector6<double> v = matrix(k) * to.segment<6>(first_number(k));
      to.segment<6>(first_number(k)) = v;
    }
  }

 private:
  Eigen::VectorXd column_;
  double sigma_;
};

/// Adds the scatter of the likeliest places to the noise of the rows, one after the other, while each gains enough.
/// \param residual  whitened, of the present model \param numbers  that were measured
void add_scatter(ScatteredModel& out, std::vector<PlaceColumn> places, Eigen::VectorXd residual,
                 const std::vector<bool>& has_full_weight, double numbers) {
  while (out.places.size() < most_places) {
    Scatter best;
    auto which = places.end();
    for (auto p = places.begin(); p != places.end(); ++p) {
      const Scatter s = best_scatter(p->place, p->column, residual, has_full_weight);
      if (!(s.gain > 0) ||
          !(s.gain + bonus(p->place) > best.gain + (which == places.end() ? 0 : bonus(which->place))))
        continue;
      best = s;
      which = p;
    }
    if (which == places.end() || !(best.gain > std::log(numbers) + least_gain)) return;
    const Narrowing narrow(which->column, best.sigma);
    for (std::size_t k = 0; k < out.rows.size(); ++k) {
      out.log_determinant +=
          std::log1p(best.sigma * best.sigma * which->column.segment<6>(first_number(k)).squaredNorm());
      out.rows[k].whitening = narrow.matrix(k) * out.rows[k].whitening;
    }
    places.erase(which);
    narrow.apply(residual);
    for (PlaceColumn& p : places) narrow.apply(p.column);
    out.places.push_back(best);
  }
}

/// Maximum likelihood, place after place, in turns with the parameters. Down-weighted rows do not count for the scatter.
ScatteredModel scattered_model(const Robot& robot, const std::vector<Observation>& rows,
                               const FittedModel& start) {
  ScatteredModel out;
  out.fit = start.fit;
  for (int round = 0; round < 3; ++round) {
    const Estimate estimate = out.fit.estimate;
    const GapSystem system =
        gap_system(robot, rows, std::vector<bool>(rows.size(), true), estimate, start.fitted);
    out.places.clear();
    out.rows = rows;
    out.log_determinant = 0;
    add_scatter(out, system.places, whitened(residuals(estimate, robot, rows, "diagnosis"), rows),
                out.fit.has_full_weight(rows.size()), system.numbers);
    if (out.places.empty()) return out;
    out.fit = fit(estimate, start.fitted, out.rows, robot, {.spectrum = false});
  }
  return out;
}

std::string size_text(const Scatter& s) {
  if (place_unit(s.place).name == "mm") return fmt::format("{:.3g} mm", s.sigma * 1e3);
  return fmt::format("{:.3g} arcsec", degrees(s.sigma) * 3600);
}

/// -2 ln of the likelihood of the misfit at the start, and what the selection's parameters and outliers cost (D13),
/// against the same noise for all selections of the same rows.
double cost_of(const Selection& selection) {
  const GapSystem& system = *selection.found.system;
  const SubsetSearch& search = *selection.found.search;
  const Scored& s = selection.found.solution;
  const double scale2 = search.noise_scale2();
  const ResidualAnalysis left = residual_after(search, s);
  const auto masked = static_cast<double>(std::ranges::count(system.counts, false));
  return left.residual.squaredNorm() / scale2 + system.numbers * std::log(scale2) + (s.chi2_gain - s.gain) +
         search.margins(s.blocks) + masked * outlier_price;
}

/// The misfit and the notes of a selection under scatter.
void describe_scatter(SearchResult& found, const std::vector<Scatter>& scatter,
                      const std::vector<NotTestable>& not_testable, const std::vector<PlaceShare>& places) {
  const Scatter& most = scatter.front();
  found.unnamed = true;
  if (!found.misfit || found.misfit->covariates.empty()) {
    Misfit m;
    m.place = most.place;
    m.joint = joint_of(most.place);
    m.p_value = std::exp(-0.5 * most.gain);
    for (const PlaceShare& share : places) {
      if (share.place == m.place) m.explains = share.explains;
    }
    found.misfit = m;
  }
  found.notes.clear();
  for (const Scatter& s : scatter) {
    found.notes.push_back(fmt::format(
        "{} moves by {} (standard deviation) from pose to pose and follows nothing that was recorded",
        place_name(s.place), size_text(s)));
  }
  for (const NotTestable& n : not_testable) {
    const Needs needs = descriptor(n.effect).needs;
    if ((needs != Needs::direction && needs != Needs::moves) || n.needs.empty()) continue;
    if (most.place.slot == slot::theta)
      found.notes.push_back(fmt::format("{} would look like this; to test it record {}",
                                        effect_name(n.effect), fmt::join(n.needs, ", ")));
  }
}

}  // namespace

bool prefer_scatter(Selection& selection, const Robot& robot, const std::vector<Observation>& rows,
                    const FittedModel& start, const ContextColumns& columns,
                    const std::vector<PlaceShare>& places, const DiagnosisProgress& progress) {
  // Many rows bear a little scatter without taking it for structure, and each search takes its time.
  const bool many = rows.size() > many_rows;
  if (many && selection.found.search->noise_scale2() < 1.5) return false;
  progress("what moves from pose to pose", 0.6);
  ScatteredModel scattered = scattered_model(robot, rows, start);
  if (scattered.places.empty()) return false;
  const auto under_scatter = [&] {
    return search_and_refit(robot, scattered.rows, columns, {scattered.fit, start.fitted}, true, progress,
                            0.6);
  };
  Selection other = under_scatter();
  // The scatter was that of everything at first: what was named is no scatter, and less scatter lets more be named.
  for (int round = 0; round < (many ? 1 : 3) && !other.found.hypotheses.empty(); ++round) {
    ScatteredModel less = scattered_model(robot, rows, other.refit);
    if (less.places.empty() || less.log_determinant > 0.95 * scattered.log_determinant) break;
    less.fit = fit(scattered.fit.estimate, start.fitted, less.rows, robot, {.spectrum = false});
    scattered = std::move(less);
    other = under_scatter();
  }
  const double cost = scattered.log_determinant +
                      static_cast<double>(scattered.places.size()) * selection.found.search->log_n();
  if (cost_of(other) + cost >= cost_of(selection)) return false;
  describe_scatter(other.found, scattered.places, other.search->not_testable(), places);
  selection = std::move(other);
  return true;
}

}  // namespace flexcomp::host
