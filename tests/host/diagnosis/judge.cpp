// SPDX-License-Identifier: Apache-2.0
#include "judge.hpp"

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <boost/math/distributions/binomial.hpp>
#include <chrono>
#include <cmath>

#include "identification/fitted_calibration.hpp"
#include "model/covariate.hpp"
#include "model/place.hpp"

namespace judging {

using namespace flexcomp::host;
using flexcomp::Effect;

namespace {

double processor_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

bool is_among(const EffectId& id, const std::vector<Hidden>& hidden) {
  return std::ranges::any_of(hidden, [&](const Hidden& h) { return names_match(h.id, id); });
}

bool finds(const Diagnosis& d, const EffectId& id) {
  return std::ranges::any_of(d.effects, [&](const FoundEffect& f) { return names_match(f.id, id); });
}

bool lists(const Diagnosis& d, const EffectId& id) {
  return finds(d, id) || std::ranges::any_of(d.effects, [&](const FoundEffect& f) {
           return std::ranges::any_of(f.confounded_with,
                                      [&](const Rival& r) { return names_match(r.id, id); });
         });
}

/// Neither true, nor confounded with a truth that these data do not decide.
bool is_wrong(const FoundEffect& found, const Oracle& oracle) {
  if (is_among(found.id, oracle.hidden)) return false;
  return std::ranges::none_of(oracle.hidden, [&](const Hidden& h) {
    return !h.decidable() && std::ranges::any_of(found.confounded_with,
                                                 [&](const Rival& r) { return names_match(r.id, h.id); });
  });
}

bool exactly_named(const Diagnosis& d, const Oracle& oracle) {
  return d.verdict == Verdict::named && d.effects.size() == oracle.hidden.size() &&
         std::ranges::all_of(oracle.hidden, [&](const Hidden& h) { return finds(d, h.id); });
}

bool finds_kind(const Diagnosis& d, Effect kind) {
  return std::ranges::any_of(d.effects, [&](const FoundEffect& f) { return f.id.effect == kind; });
}

/// Everything decidable is named and nothing wrong is; what cannot be tested for want of a column is said to be so.
bool as_good_as_it_can(const hidden::Case& c, const Diagnosis& d, const Oracle& oracle) {
  for (const Hidden& h : oracle.hidden) {
    if (hidden::needs_what_is_missing(h.id.effect, c.roughness)) {
      const bool told = std::ranges::any_of(
          d.not_testable, [&](const NotTestable& n) { return n.effect == h.id.effect && !n.needs.empty(); });
      if (!told) return false;
    } else if (h.decidable() && !finds(d, h.id)) {
      return false;
    }
  }
  return std::ranges::none_of(d.effects, [&](const FoundEffect& f) { return is_wrong(f, oracle); });
}

bool is_right(const hidden::Case& c, const Diagnosis& d, const Oracle& oracle) {
  switch (c.row) {
    case hidden::Row::none:
      return d.verdict == Verdict::none && d.effects.empty();
    case hidden::Row::outside:
      return d.verdict == Verdict::unnamed && d.effects.empty() && d.where &&
             d.where->joint == c.outside->joint;
    case hidden::Row::geometry:
      // Which of the small compliances of the wrist show is the data's to say.
      return d.verdict == Verdict::named && finds_kind(d, Effect::joint_compliance) &&
             finds_kind(d, Effect::link_gravity) && std::ranges::all_of(d.effects, [](const FoundEffect& f) {
               return f.id.effect == Effect::joint_compliance || f.id.effect == Effect::link_gravity;
             });
    case hidden::Row::rough:
      return as_good_as_it_can(c, d, oracle);
    default:
      return exactly_named(d, oracle);
  }
}

std::string group_of(const hidden::Case& c) {
  switch (c.row) {
    case hidden::Row::one:
    case hidden::Row::third:
      return effect_name(c.hidden.front().id.effect);
    case hidden::Row::rough:
      // Where the effect itself needs the column that is missing, the oracle is blind too.
      return hidden::name(c.roughness) +
             (hidden::needs_what_is_missing(c.hidden.front().id.effect, c.roughness) ? ", needed" : "");
    case hidden::Row::outside:
      if (c.outside->covariate[1] != flexcomp::Covariate::joint_position)
        return covariate_name(c.outside->covariate[1], 0) + " and an angle";
      return c.outside->formula.substr(0, 4) == "bump" ? "a bump of two joints" : "two joints";
    case hidden::Row::local:
      return c.inside_the_bump < 3
                 ? "1 or 2 poses inside"
                 : (c.inside_the_bump < 6 ? "3 to 5 poses inside" : "6 or more poses inside");
    default:
      return c.arm_name;
  }
}

}  // namespace

std::string words_of(const Diagnosis& d) {
  std::string text =
      d.verdict == Verdict::none ? "none" : (d.verdict == Verdict::named ? "named" : "unnamed");
  for (const FoundEffect& f : d.effects) {
    text += " " + name(f.id);
    for (const Rival& r : f.confounded_with) text += fmt::format(" ~{}({:.1f})", name(r.id), r.delta_bic);
  }
  if (d.verdict == Verdict::unnamed && d.where)
    text += fmt::format(" @{} of {}", place_name(d.where->place), fmt::join(d.where->covariates, "+"));
  return text;
}

Outcome judge(const hidden::Case& c, const Oracle& oracle, const Diagnosis& d) {
  Outcome out;
  out.row = c.row;
  out.seed = c.seed;
  out.arm = c.arm_name;
  out.what = c.what;
  out.group = group_of(c);
  out.decidable = oracle.decidable();
  out.oracle_converged = oracle.converged;
  out.margin = 0;
  for (const Hidden& h : oracle.hidden) {
    if (!h.detectable()) out.detectable = false;
    if (!out.rival.empty() && h.margin >= out.margin) continue;
    out.margin = h.margin;
    out.untold_margin = h.untold_margin;
    out.rival = h.rival;
  }
  out.said = words_of(d);
  out.right = is_right(c, d, oracle);
  out.listed = std::ranges::all_of(oracle.hidden, [&](const Hidden& h) { return lists(d, h.id); });
  out.complete =
      std::ranges::all_of(oracle.hidden, [&](const Hidden& h) { return !h.decidable() || finds(d, h.id); });
  out.wrong = std::ranges::any_of(d.effects, [&](const FoundEffect& f) { return is_wrong(f, oracle); });
  out.rms_m = rms_m(estimate_of(d.after), c.robot, c.held_out);
  out.rms_before_m = rms_m(oracle.before.fit.estimate, c.robot, c.held_out);
  out.rms_oracle_m = rms_m(oracle.estimate, c.robot, c.held_out);
  out.floor_m = std::sqrt(3.0) * c.robot.position_sigma_m;
  return out;
}

Outcome judge(const hidden::Case& c) {
  const Oracle oracle = oracle_of(c);
  DiagnoseOptions options;
  options.columns = c.columns;
  if (c.row == hidden::Row::geometry) options.start = oracle.before.calibration;
  const auto begin = std::chrono::steady_clock::now();
  const double start = processor_seconds();
  const Diagnosis diagnosis = diagnose(c.robot, c.train, "training rows", options);
  const double processor = processor_seconds() - start;
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
  Outcome out = judge(c, oracle, diagnosis);
  out.seconds = elapsed.count();
  out.processor_seconds = processor;
  return out;
}

namespace {
using Binomial = boost::math::binomial_distribution<double>;
}

double Rate::low() const {
  return of == 0 ? 0
                 : Binomial::find_lower_bound_on_p(static_cast<double>(of), static_cast<double>(hits), 0.025);
}
double Rate::high() const {
  return of == 0 ? 1
                 : Binomial::find_upper_bound_on_p(static_cast<double>(of), static_cast<double>(hits), 0.025);
}

}  // namespace judging
