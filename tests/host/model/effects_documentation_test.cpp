// SPDX-License-Identifier: Apache-2.0
// docs/effects.md is what the descriptors say. With FLEXCOMP_WRITE_DOCS set the page is written anew.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <set>
#include <string>
#include <utility>

#include "files/calibration_file.hpp"
#include "files/read_file.hpp"
#include "files/write_file.hpp"
#include "model/effects.hpp"
#include "model/place.hpp"
#include "support/robot_files.hpp"

namespace {

using namespace flexcomp::host;
using namespace flexcomp;

const std::string page = FLEXCOMP_SOURCE_DIR "/docs/effects.md";
const std::string begin_mark = "<!-- from the descriptors: begin -->\n";
const std::string end_mark = "<!-- from the descriptors: end -->\n";

/// Of joint {0}; {1} times its reading, to joint {2}.
const auto bases = std::to_array<std::pair<Basis, const char*>>({
    {Basis::one, "1"},
    {Basis::load_torque, "τ{0}"},
    {Basis::load_torque_cubed, "τ{0}³"},
    {Basis::link_weight, "s of joint {0} to joint {2}"},
    {Basis::joint_position, "q{0}"},
    {Basis::sine, "sin {1}q{0}"},
    {Basis::cosine, "cos {1}q{0}"},
    {Basis::direction, "−direction of joint {0}"},
    {Basis::relative_speed, "u{0}"},
    {Basis::thermal, "(temperature − reference) × length"},
    {Basis::time, "time"},
    {Basis::load_moment_x, "load moment about x{0}"},
    {Basis::load_moment_y, "load moment about y{0}"},
    {Basis::base_moment_x, "load moment about x of F0 through the pivot"},
    {Basis::base_moment_y, "load moment about y of F0 through the pivot"},
    {Basis::curve, "curve of q{0}"},
    {Basis::step, "step at `after_s`"},
    {Basis::grid, "grid of two covariates"},
});

const auto needed = std::to_array<std::pair<Needs, const char*>>({
    {Needs::poses, "–"},
    {Needs::load, "`payload_kg`, or `fx_n fy_n fz_n`"},
    {Needs::direction, "`dir1 … dir6`, or `move1_deg … move6_deg`"},
    {Needs::moves, "`move1_deg … move6_deg`, all of them"},
    {Needs::temperature, "`temp_c`"},
    {Needs::time, "`time_s`"},
});

/// The test fails where the table has no text for the value.
template <class Table, class Value>
const char* text_in(const Table& table, Value value) {
  const auto at = std::find_if(table.begin(), table.end(), [&](const auto& e) { return e.first == value; });
  EXPECT_NE(at, table.end()) << static_cast<int>(value);
  return at == table.end() ? "" : at->second;
}

std::string basis_text(const Term<double>& t, const EffectId& id) {
  const std::string order = id.order == 1 ? "" : fmt::format("{:g}·", id.order);
  return fmt::format(fmt::runtime(text_in(bases, t.basis)), t.joint + 1, order, t.distal_joint + 1);
}

std::string bounds_text(const EffectBounds& b) {
  const bool below = std::isfinite(b.least), above = std::isfinite(b.greatest);
  if (b.of_declared_mass) return fmt::format("mass: {:g} … {:g} of the declared one", b.least, b.greatest);
  if (below && above) return fmt::format("{:g} … {:g}", b.least, b.greatest);
  return below ? fmt::format("≥ {:g}", b.least) : "–";
}

/// The example of an effect with coefficients of their usual size, as a line of a calibration file.
std::string example_line(const EffectDescriptor& d, const Robot& robot) {
  ParametricModel model;
  add_effect(model, d.example, robot.nominal);
  for (const Parameter& p : model.parameters)
    p.set(model.set, d.usual_size == nullptr ? 1e-4 : d.usual_size(model.set.terms[p.terms.front()].place));
  Calibration calibration;
  calibration.terms = model.set;
  const std::string text = calibration_text(calibration, robot);
  const std::size_t at = text.find("  - {effect");
  return text.substr(at, text.find('\n', at) - at + 1);
}

std::string section(const EffectDescriptor& d, const Robot& robot) {
  std::string text = fmt::format("### `{}`\n\n{}\n\n", d.name, d.physics);
  text += fmt::format("```yaml\neffects:\n{}```\n\n", example_line(d, robot));
  text += "| key | unit | place | φ |\n|---|---|---|---|\n";
  for (const EffectKey& key : keys(d.example, robot.nominal)) {
    std::string places;
    for (const Term<double>& t : key.terms)
      places += (places.empty() ? "" : ", ") + fmt::format("`{}`", place_name(t.place));
    const std::string unit = !key.unit.name.empty()        ? std::string(key.unit.name)
                             : key.key.starts_with("gain") ? "rad/rad"
                             : key.key == "per_k"          ? "1/K"
                             : key.key.ends_with("_nm3")   ? "rad/(N·m)³"
                             : key.key.ends_with("_nm")    ? "rad/(N·m)"
                                                           : "rad";
    text += fmt::format("| `{}` | {} | {} | {} |\n", key.key, unit, places,
                        basis_text(key.terms.front(), d.example));
  }
  return text + fmt::format("\nTo record: {}. Confounded with: {}.\n\n", d.record, d.confounded_with);
}

std::string generated() {
  const Robot& robot = support::tx60l();
  std::string text =
      "\n| effect | needs columns | bounds | least span | sent to the controller |\n|---|---|---|---|---|\n";
  for (const EffectDescriptor& d : all_effects()) {
    const EffectBounds bounds = effect_bounds(d.effect);
    const std::string sent = belongs_to_measurement(d.effect) ? "no: of the measurement"
                             : d.effect == Effect::unnamed    ? "with `--allow-unnamed`"
                                                              : "yes";
    text += fmt::format("| [`{0}`](#{0}) | {1} | {2} | {3} | {4} |\n", d.name, text_in(needed, d.needs),
                        bounds_text(bounds),
                        bounds.least_span > 0 ? fmt::format("{:g} K", bounds.least_span) : "–", sent);
  }
  text += "\nThe examples below are of the TX60L, each coefficient at its usual size.\n\n";
  for (const EffectDescriptor& d : all_effects()) text += section(d, robot);
  return text;
}

TEST(EffectsDocumentation, PageIsWhatTheDescriptorsSay) {
  const std::string text = read_file(page);
  const std::size_t from = text.find(begin_mark) + begin_mark.size();
  const std::size_t to = text.find(end_mark);
  ASSERT_LE(from, to);
  const std::string wanted = generated();
  if (std::getenv("FLEXCOMP_WRITE_DOCS") != nullptr)
    write_file(page, text.substr(0, from) + wanted + text.substr(to));
  else
    EXPECT_EQ(text.substr(from, to - from), wanted) << "run this program with FLEXCOMP_WRITE_DOCS=1";
}

TEST(EffectsDocumentation, EveryDescriptorIsComplete) {
  std::set<Effect> numbers;
  const Robot& robot = support::tx60l();
  for (const EffectDescriptor& d : all_effects()) {
    EXPECT_TRUE(numbers.insert(d.effect).second) << d.name;
    EXPECT_EQ(&descriptor(d.effect), &d);
    EXPECT_EQ(d.example.effect, d.effect) << d.name;
    EXPECT_FALSE(validation_error(d.example, robot.nominal)) << d.name;
    EXPECT_TRUE(d.place != nullptr && d.follows != nullptr && d.sentence != nullptr) << d.name;
    EXPECT_FALSE(d.physics.empty() || d.record.empty() || d.confounded_with.empty()) << d.name;
    EXPECT_EQ(d.has(Selector::order), d.orders != nullptr) << d.name;
    // A sign that the search enforces is one of the physical bounds.
    EXPECT_TRUE(!d.is_nonnegative || effect_bounds(d.effect).least == 0) << d.name;
  }
  EXPECT_TRUE(descriptor(Effect::geometric).name.empty());
}

}  // namespace
