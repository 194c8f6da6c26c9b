// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "diagnosis/effect_profile.hpp"
#include "diagnosis/messages.hpp"
#include "model/covariate.hpp"
#include "model/place.hpp"
#include "report/numbers.hpp"
#include "report/plots.hpp"
#include "report/pose_errors.hpp"
#include "report/results.hpp"
#include "report/sections.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

constexpr double arcsec = pi / (180.0 * 3600.0);
constexpr std::size_t shown_places = 10;

std::string chance(double p) { return p < 1e-3 ? "< 0.001" : fmt::format("{:.2g}", p); }

/// The gap of an error when the noise is taken away, mm.
std::string gap_text(const ErrorStatistics& error, double noise_floor_m) {
  return mm_text(gap_of(error.rms_m, noise_floor_m));
}

/// From the model at the start to the last one, and the same on rows that nobody fitted.
PageSection shrinking(const Diagnosis& d, const std::optional<HeldOut>& others) {
  PageSection section{"How the gap shrinks"};
  section.paragraphs = {fmt::format(
      "Position error (rms) {} mm before and {} mm after on the fitted rows; noise alone would give {} mm. "
      "The gap, "
      "noise taken away: {} mm before, {} mm after.",
      mm_text(d.error_before.rms_m), mm_text(d.error_after.rms_m), mm_text(d.noise_floor_m),
      gap_text(d.error_before, d.noise_floor_m), gap_text(d.error_after, d.noise_floor_m))};
  Curves curves{"Position error after each step of the diagnosis", "step", "rms [mm]"};
  if (d.noise_floor_m > 0) curves.floor = d.noise_floor_m * 1e3;
  if (!d.steps.empty())
    section.columns = {"step", "what", "rms [mm]", "chi-square per dof", "chi-square, left-out poses"};
  Curve fitted{"fitted rows", {}, CurveStyle::joined, "before"};
  for (std::size_t k = 0; k < d.steps.size(); ++k) {
    const DiagnosisStep& s = d.steps[k];
    fitted.points.push_back({static_cast<double>(k), s.train_rms_m * 1e3});
    section.rows.push_back({fmt::format("{}", k), s.what, mm_text(s.train_rms_m),
                            fmt::format("{:.3g}", s.chi2_per_dof), fmt::format("{:.3g}", s.cross_validated)});
  }
  if (fitted.points.empty())
    fitted.points = {{0, d.error_before.rms_m * 1e3}, {1, d.error_after.rms_m * 1e3}};
  const double last = fitted.points.back()[0];
  for (std::size_t k = 0; k < fitted.points.size(); ++k) curves.x_texts.push_back(fmt::format("{}", k));
  curves.curves.push_back(fitted);
  if (others && last > 0) {
    curves.curves.push_back({"held-out rows, first and last",
                             {{0, others->before.rms_m * 1e3}, {last, others->after.rms_m * 1e3}},
                             CurveStyle::dots,
                             "after"});
  }
  if (others) {
    section.paragraphs.push_back(fmt::format(
        "On {} rows that were not fitted: {} mm before, {} mm after; the gap {} mm before, {} mm after.",
        others->rows, mm_text(others->before.rms_m), mm_text(others->after.rms_m),
        gap_text(others->before, others->noise_floor_m), gap_text(others->after, others->noise_floor_m)));
  }
  // One dot has no course.
  if (last > 0)
    section.figures.emplace_back(
        plot_curves(curves), d.steps.empty() ? "Root mean square of the 3-D position error before and after."
                                             : "Root mean square of the 3-D position error at the start and "
                                               "after each step of the table.");
  return section;
}

PageSection place(const Diagnosis& d) {
  PageSection section{"Where"};
  if (d.where) {
    const std::string text = where_sentence(*d.where);
    section.paragraphs.push_back(
        (d.verdict == Verdict::unnamed ? "The gap that is left is " : "The gap was ") + text + ".");
  }
  section.paragraphs.emplace_back(
      "How much of the gap a free motion of one place alone could explain, beyond what it would explain of "
      "noise. "
      "Neighbours share: an arm's places move the tool in similar ways.");
  Bars bars{"What each place could explain of the gap, before and after", "mm of the gap (rms)", {}, {}, {}};
  // In mm: shares of a gap that is nearly gone would look as large as those of the whole.
  const double gap_mm = gap_of(d.error_before.rms_m, d.noise_floor_m) * 1e3;
  const double left_mm = gap_of(d.error_after.rms_m, d.noise_floor_m) * 1e3;
  for (const PlaceShare& p : d.places) {
    if (bars.names.size() == shown_places) break;
    bars.names.push_back(place_name(p.place));
    bars.before.push_back(gap_mm * std::sqrt(std::max(0.0, p.explains)));
    const auto left = std::ranges::find(d.places_left, p.place, &PlaceShare::place);
    // Nothing found, nothing changed.
    if (d.places_left.empty() || d.error_after.rms_m == d.error_before.rms_m) continue;
    bars.after.push_back(left == d.places_left.end() ? 0
                                                     : left_mm * std::sqrt(std::max(0.0, left->explains)));
  }
  if (std::string drawing = plot_bars(bars); !drawing.empty()) {
    section.figures.emplace_back(std::move(drawing),
                                 bars.after.empty()
                                     ? "The model at the start."
                                     : "Orange: the model at the start. Blue: with what was found.");
  }
  return section;
}

/// The effect with its band, and the rows that speak of it.
std::vector<std::pair<std::string, std::string>> figures_of(const EffectProfile& profile,
                                                            const std::string& title) {
  // A row that sees the joint from near its axis says nothing of it, and would set the scale.
  std::vector<double> sigmas;
  for (const ProfileRow& r : profile.rows) sigmas.push_back(r.sigma_rad);
  const double enough = 3 * median(sigmas);
  Curve line{"effect, 95 %", {}, profile.cases ? CurveStyle::usual : CurveStyle::line, "x"};
  Curve without{"rows without it", {}, CurveStyle::dots, "before"};
  Curve left{"rows, what is left", {}, CurveStyle::dots, "after"};
  for (const ProfilePoint& p : profile.line) {
    line.points.push_back({p.x, p.value_rad / arcsec});
    line.band.push_back(
        {(p.value_rad - 1.96 * p.sigma_rad) / arcsec, (p.value_rad + 1.96 * p.sigma_rad) / arcsec});
  }
  // The bulk sets the scale; what lies far off is drawn at the edge.
  std::vector<double> without_sizes, left_sizes;
  for (const ProfileRow& r : profile.rows) {
    without_sizes.push_back(std::abs(r.without_rad));
    left_sizes.push_back(std::abs(r.left_rad));
  }
  const double far_without = 2 * ninth_decile(without_sizes), far_left = 2 * ninth_decile(left_sizes);
  for (const ProfileRow& r : profile.rows) {
    if (r.sigma_rad > enough) continue;
    without.points.push_back({r.x, std::clamp(r.without_rad, -far_without, far_without) / arcsec});
    left.points.push_back({r.x, std::clamp(r.left_rad, -far_left, far_left) / arcsec});
  }
  Curves seen{title, profile.x_name, "arcsec", {}, false, {without, line}};
  Curves remains{title + ": what is left", profile.x_name, "arcsec", {}, false, {left}};
  return {{plot_curves(seen),
           title + ": by how much the joint turns otherwise. Dots: what each row says, with this effect "
                   "alone taken out of the model; line: the effect with its 95 % band (of its shape: a turn "
                   "that is the same everywhere is geometry)."},
          {plot_curves(remains),
           title + ": what each row says with the effect in the model. Noise has no shape."}};
}

/// An effect without a name as curves over its first covariate, one per node of the second.
std::pair<std::string, std::string> unnamed_figure(const Calibration& set, const EffectGroup& group) {
  const EffectId& id = group.id;
  const Unit unit = place_unit(id.place).name == "mm" ? unit::mm : unit::si;
  const bool length = unit.name == "mm";
  Curves curves{name(id), covariate_name(id.covariate[0], id.covariate_joint[0]), length ? "mm" : "arcsec"};
  const std::size_t columns = id.node[1].size();
  const std::size_t step = std::max<std::size_t>(1, (columns + 4) / 5);
  const auto shown = [](Covariate c, double v) { return c == Covariate::joint_position ? degrees(v) : v; };
  for (std::size_t c = 0; c < columns; c += step) {
    Curve curve;
    curve.name = fmt::format("{} = {:.4g}", covariate_name(id.covariate[1], id.covariate_joint[1]),
                             shown(id.covariate[1], id.node[1][c]));
    for (std::size_t r = 0; r < id.node[0].size(); ++r) {
      const double v = group.parameters[r * columns + c].get(set.terms);
      curve.points.push_back({shown(id.covariate[0], id.node[0][r]), length ? v * 1e3 : v / arcsec});
    }
    curves.curves.push_back(curve);
  }
  return {plot_curves(curves), fmt::format("{}: {}.", place_name(id.place), in_words(id))};
}

PageSection effects_section(const Diagnosis& d, const Robot& robot, const std::vector<Observation>& rows) {
  PageSection section{.title = "What was found",
                      .columns = {"effect", "largest [mm]", "rms [mm]", "p", "delta BIC", "to the controller",
                                  "cannot be told from"}};
  for (const FoundEffect& e : d.effects) {
    section.rows.push_back({name(e.id), mm_text(e.largest_m), mm_text(e.rms_m), chance(e.p_value),
                            fmt::format("{:.1f}", e.delta_bic), e.pushed ? "yes" : "no", rivals_text(e)});
    std::string text = name(e.id) + ": " + in_words(e.id) + ".";
    for (const std::string& line : sizes(e)) text += " " + line + ".";
    section.paragraphs.push_back(text);
    if (const auto profile = profile_of(robot, d.after, e.id, rows)) {
      for (auto& figure : figures_of(*profile, name(e.id))) section.figures.push_back(std::move(figure));
    }
  }
  for (const EffectGroup& group : effects_of(d.after.terms, robot.nominal)) {
    if (group.id.effect != Effect::unnamed) continue;
    section.paragraphs.push_back(
        name(group.id) + ": " + in_words(group.id) +
        ". It is described so that the error still shrinks; nobody has understood it.");
    section.figures.push_back(unnamed_figure(d.after, group));
  }
  for (const EffectGroup& group : effects_of(d.after.terms, robot.nominal)) {
    if (group.id.effect != Effect::joint_curve || !d.after.is_regularised(group.id.joint)) continue;
    if (const auto profile = profile_of(robot, d.after, group.id, rows)) {
      for (auto& figure : figures_of(*profile, name(group.id) + ", without a name"))
        section.figures.push_back(std::move(figure));
    }
  }
  if (d.remainder && !remainder_sentence(*d.remainder).empty())
    section.paragraphs.push_back("What no name explains is " + remainder_sentence(*d.remainder) + ".");
  if (d.effects.empty()) {
    section.columns.clear();
    if (section.paragraphs.empty()) section.paragraphs.emplace_back("No effect of the catalogue.");
  }
  return section;
}

PageSection open_section(const Diagnosis& d) {
  PageSection section{"What these data could not be asked"};
  if (!d.not_testable.empty()) section.columns = {"effect", "what it needs"};
  for (const NotTestable& n : d.not_testable) {
    const std::string text = not_testable_text(n);
    const std::string effect = effect_name(n.effect);
    section.rows.push_back({effect, text.substr(std::min(text.size(), effect.size() + 7))});
  }
  if (!d.dropped.empty()) {
    std::vector<std::string> names;
    for (const EffectId& id : d.dropped) names.push_back(name(id));
    section.paragraphs.push_back(fmt::format(
        "Carried by geometry and frames already, whatever the data say: {}.", fmt::join(names, ", ")));
  }
  for (const std::string& note : d.notes) section.paragraphs.push_back(note);
  return section;
}

PageSection telling_section(const Diagnosis& d) {
  std::vector<std::array<double, joint_count>> q_rad;
  std::vector<double> payload_kg;
  for (const SuggestedPose& p : d.discriminating_poses) {
    q_rad.push_back(p.q_rad);
    payload_kg.push_back(p.payload_kg);
  }
  return poses_table("Poses that would tell the rivals apart", q_rad, payload_kg, 2);
}

}  // namespace

Page page_of(const Diagnosis& d, const std::vector<Observation>& rows, const Robot& robot,
             const std::string& data, const std::optional<HeldOut>& others) {
  Page p = titled_page("Diagnosis of " + robot.name, robot);
  p.summary = error_sentence(d, others) + " " + verdict_sentence(d);
  p.doubts = d.doubts;
  p.facts = {{"data", data},
             {"poses", fmt::format("{}", rows.size())},
             {"chi-square per degree of freedom",
              fmt::format("{:.3g} → {:.3g}", d.chi2_per_dof_before, d.chi2_per_dof_after)},
             {"gap, fitted rows [mm]", fmt::format("{} → {}", gap_text(d.error_before, d.noise_floor_m),
                                                   gap_text(d.error_after, d.noise_floor_m))},
             {"rows outside the bulk", fmt::format("{}", d.outliers.size())}};
  if (others) {
    p.facts.push_back(
        {"gap, held-out rows [mm]", fmt::format("{} → {}", gap_text(others->before, others->noise_floor_m),
                                                gap_text(others->after, others->noise_floor_m))});
  }
  p.sections.push_back(shrinking(d, others));
  p.sections.push_back(place(d));
  p.sections.push_back(effects_section(d, robot, rows));
  if (!d.not_testable.empty() || !d.dropped.empty() || !d.notes.empty())
    p.sections.push_back(open_section(d));
  if (!d.discriminating_poses.empty()) p.sections.push_back(telling_section(d));
  if (d.residuals_before.size() == rows.size() && d.residuals_after.size() == rows.size()) {
    PagePoses set = page_poses(d.residuals_before, d.residuals_after, rows, d.outliers, false);
    set.title = "Poses that were fitted";
    set.before = "the model at the start";
    set.after = "with what was found";
    set.frames = d.after.frames;
    if (d.noise_floor_m > 0) set.noise_floor_m = d.noise_floor_m;
    p.poses.push_back(set);
  }
  add_parameters(p, d.after, robot);
  return p;
}

}  // namespace flexcomp::host
