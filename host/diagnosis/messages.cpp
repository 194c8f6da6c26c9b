// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "model/covariate.hpp"
#include "model/effects/descriptor.hpp"
#include "model/place.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

/// Of more effects than these the verdict gives the number: the table below names them.
constexpr std::size_t named_in_full = 5;
constexpr double arcsec_per_rad = 180.0 * 3600.0 / pi;

std::string with_sigma(double value, double sigma) { return fmt::format("{:.4g} +- {:.2g}", value, sigma); }

/// The same number as mechanics speak of it; empty where the file's unit is that already.
std::string for_mechanics(const std::string& key, double value, double sigma) {
  const std::string_view k = key;
  const double v = value * arcsec_per_rad, s = sigma * arcsec_per_rad;
  if (k.ends_with("rad_per_nm")) return with_sigma(v, s) + " arcsec per N m";
  if (k.ends_with("rad_per_nm3")) return with_sigma(v, s) + " arcsec per (N m)^3";
  if (k == "gain") return with_sigma(v * pi / 2, s * pi / 2) + " arcsec over 90 deg";
  if (k == "per_k") return with_sigma(value * 1e6, sigma * 1e6) + " um per metre and K";
  if (k == "rad" || k.ends_with("_rad")) return with_sigma(v, s) + " arcsec";
  return "";
}

/// The size of a harmonic as one number: sine and cosine are of no interest to who looks for a bad gear.
std::string amplitude(const FoundEffect& effect) {
  const auto& c = effect.coefficients;
  const double size = std::hypot(c[0].value, c[1].value);
  if (!(size > 0)) return "";
  const double sigma = std::hypot(c[0].value * c[0].sigma, c[1].value * c[1].sigma) / size;
  const double at = degrees(std::atan2(c[0].value, c[1].value) / effect.id.order);
  return fmt::format("amplitude {} arcsec, largest at {:.0f} deg{}",
                     with_sigma(size * arcsec_per_rad, sigma * arcsec_per_rad), at,
                     effect.id.order > 1 ? fmt::format(" and every {:.4g} deg", 360 / effect.id.order) : "");
}

std::string curve_size(const CurveSpan& span) {
  return fmt::format("{:.0f} … {:+.0f} arcsec at the measured readings, +- {:.0f}",
                     span.low_rad * arcsec_per_rad, span.high_rad * arcsec_per_rad,
                     span.sigma_rad * arcsec_per_rad);
}

}  // namespace

std::string list_of(const std::vector<std::string>& items) {
  std::string text;
  for (std::size_t k = 0; k < items.size(); ++k) {
    text += items[k];
    if (k + 1 < items.size()) text += k + 2 == items.size() ? " and " : ", ";
  }
  return text;
}

std::string in_words(const EffectId& id) {
  const auto sentence = descriptor(id.effect).sentence;
  return sentence == nullptr ? "geometry" : sentence(id);
}

std::string where_sentence(const Misfit& where) {
  std::vector<std::string> follows;
  for (std::size_t k = 0; k < where.covariates.size(); ++k) {
    const bool around = k < where.around_deg.size() && where.around_deg[k];
    follows.push_back(where.covariates[k] +
                      (around ? fmt::format(" (around {:.0f} deg)", *where.around_deg[k]) : ""));
  }
  return fmt::format("at {}{}: it follows {}; a motion of this place alone explains {:.0f} % of it",
                     place_name(where.place),
                     where.joint > 0 ? fmt::format(", joint {} moves wrongly", where.joint) : "",
                     follows.empty() ? "nothing that was recorded" : list_of(follows), 100 * where.explains);
}

std::string verdict_sentence(const Diagnosis& d) {
  if (d.verdict == Verdict::none) {
    if (!d.doubts.empty()) return "Nothing was found, but these data cannot say that nothing is missing.";
    return fmt::format("Nothing is missing: the model explains these data down to their noise{}.",
                       d.outliers.empty()
                           ? ""
                           : fmt::format(", but for {} outliers far outside it, which are down-weighted",
                                         d.outliers.size()));
  }
  std::vector<std::string> named;
  for (const FoundEffect& e : d.effects) {
    if (named.size() == named_in_full) break;
    named.push_back(in_words(e.id));
  }
  if (named.size() < d.effects.size())
    named.push_back(fmt::format("and {} more", d.effects.size() - named.size()));
  if (d.verdict == Verdict::named) {
    return fmt::format(
        "{} missing and {} a name: {}. Nothing else is left above the noise.",
        named.size() == 1 ? "One effect was" : fmt::format("{} effects were", d.effects.size()),
        named.size() == 1 ? "has" : "have", fmt::format("{}", fmt::join(named, "; ")));
  }
  std::string text = "Something is wrong that no effect of the catalogue explains";
  if (d.where) text += ", " + where_sentence(*d.where);
  text += ".";
  if (!named.empty()) text += fmt::format(" Besides: {}.", fmt::join(named, "; "));
  return text;
}

std::string error_sentence(const Diagnosis& d, const std::optional<HeldOut>& others) {
  const ErrorStatistics& before = others ? others->before : d.error_before;
  const ErrorStatistics& after = others ? others->after : d.error_after;
  return fmt::format("Position error {:.3f} -> {:.3f} mm (mean of {}).", before.mean_m * 1e3,
                     after.mean_m * 1e3,
                     others ? fmt::format("{} rows that were not fitted", others->rows) : "the fitted rows");
}

std::string remainder_sentence(const Remainder& remainder) {
  std::vector<std::string> joints;
  for (const CarriedCurve& c : remainder.curves) {
    if (!c.named)
      joints.push_back(fmt::format("{} ({:.0f} arcsec rms)", c.joint, c.size_rad * arcsec_per_rad));
  }
  if (joints.empty()) return "";
  return fmt::format(
      "carried without a name: smooth curves of {} {}; poses that are left out are predicted {:.0f} % better",
      joints.size() == 1 ? "joint" : "joints", list_of(joints),
      100 * (1 - std::sqrt(std::max(0.0, 1 - remainder.cross_validation))));
}

std::vector<KeyedCoefficients> by_key(const FoundEffect& effect) {
  std::vector<KeyedCoefficients> list;
  for (const EffectCoefficient& c : effect.coefficients) {
    const std::size_t bracket = c.key.find('[');
    const std::string key = c.key.substr(0, bracket);
    if (list.empty() || list.back().key != key) list.push_back({key, bracket != std::string::npos, {}});
    list.back().values.push_back(c);
  }
  return list;
}

std::vector<std::string> sizes(const FoundEffect& effect) {
  std::vector<std::string> lines;
  if (effect.curve) return {curve_size(*effect.curve)};
  if (effect.id.order != 0 && effect.coefficients.size() == 2) {
    const std::string text = amplitude(effect);
    if (!text.empty()) lines.push_back(text);
  }
  for (const KeyedCoefficients& c : by_key(effect)) {
    if (c.list) {
      lines.push_back(fmt::format("{}: {} numbers", c.key, c.values.size()));
      continue;
    }
    const EffectCoefficient& v = c.values.front();
    const double unit = v.unit.si_per_file_unit();
    const std::string also = for_mechanics(c.key, v.value, v.sigma);
    lines.push_back(fmt::format("{} {}{}", c.key, with_sigma(v.value / unit, v.sigma / unit),
                                also.empty() ? "" : "  (" + also + ")"));
  }
  return lines;
}

std::string rivals_text(const FoundEffect& effect) {
  std::vector<std::string> names;
  for (const Rival& r : effect.confounded_with)
    names.push_back(fmt::format("{} (delta BIC {:.1f})", name(r.id), r.delta_bic));
  return fmt::format("{}", fmt::join(names, ", "));
}

std::string not_testable_text(const NotTestable& n) {
  // move1_deg … move6_deg as one.
  std::vector<std::string> needs;
  for (std::size_t k = 0; k < n.needs.size(); ++k) {
    std::size_t last = k;
    const auto digit = n.needs[k].find('1');
    while (digit != std::string::npos && last + 1 < n.needs.size()) {
      std::string expected = n.needs[k];
      expected[digit] = static_cast<char>('1' + (last + 1 - k));
      if (n.needs[last + 1] != expected) break;
      ++last;
    }
    if (last > k + 1) {
      needs.push_back(n.needs[k] + " … " + n.needs[last]);
      k = last;
    } else {
      needs.push_back(n.needs[k]);
    }
  }
  return fmt::format("{} needs {}", effect_name(n.effect), needs.empty() ? "other poses" : list_of(needs));
}

std::vector<EffectId> unnamed_effects(const Diagnosis& d, const Robot& robot) {
  std::vector<EffectId> ids;
  for (const EffectGroup& group : effects_of(d.after.terms, robot.nominal)) {
    if (group.id.effect == Effect::unnamed) ids.push_back(group.id);
  }
  return ids;
}

double gap_of(double rms_m, double noise_floor_m) {
  return std::sqrt(std::max(0.0, rms_m * rms_m - noise_floor_m * noise_floor_m));
}

}  // namespace flexcomp::host
