// SPDX-License-Identifier: Apache-2.0
#include "model/parameter_image.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "flexcomp/image.hpp"
#include "input_error.hpp"
#include "model/admission.hpp"
#include "model/effects.hpp"
#include "model/host_model.hpp"
#include "model/place.hpp"

namespace flexcomp::host {

namespace {

/// Collects the records of an image.
struct Collector {
  TermSet& set;
  Refusal table(const Table& t, const std::uint8_t* values) {
    set.tables.push_back(t);
    for (std::size_t k = 0; k < t.size; ++k) set.values.push_back(load_scalar<double>(values + 8 * k));
    return Refusal::none;
  }
  Refusal term(const Term<double>& t) {
    if (t.place.body == body::point || belongs_to_measurement(t.effect)) return Refusal::bad_place;
    set.terms.push_back(t);
    return Refusal::none;
  }
};

}  // namespace

std::vector<std::uint8_t> make_image(const Calibration& calibration, const Robot& robot,
                                     std::uint32_t sequence, const ImageOptions& options) {
  const std::string& source = calibration.path;
  TermSet pushed;
  pushed.tables = calibration.terms.tables;
  pushed.values = calibration.terms.values;
  for (const Term<double>& t : calibration.terms.terms) {
    if (belongs_to_measurement(t.effect) || t.place.body == body::point) continue;
    // With fitted frames the base is part of F, and the controller's target is in the robot's own base anyway.
    if (t.place.body == body::base && t.effect == Effect::geometric && calibration.frames) continue;
    if (t.effect == Effect::unnamed && !options.allow_unnamed) {
      throw InputError(source, 0, "effects", "effects that are understood",
                       fmt::format("an unnamed one at {}", place_name(t.place)), ErrorCode::unnamed_effect);
    }
    if (t.effect == Effect::geometric && is_beyond_small(t)) {
      throw InputError(source, 0, geometric_name(t.place), small_terms_rule,
                       format_si(t.coefficient, place_unit(t.place)));
    }
    pushed.terms.push_back(t);
  }
  try {
    pushed = canonical(pushed, robot.nominal);
  } catch (const std::invalid_argument& e) {
    throw InputError(source, 0, "", "terms of the catalogue", e.what());
  }
  prepare(pushed, robot, source);
  if (!options.allow_inadmissible) certified(pushed, robot, source);
  ImageHeader header;
  header.sequence = sequence;
  header.nominal_hash = nominal_hash(robot.nominal);
  header.name_hash = robot.nominal.name_hash;
  std::vector<std::uint8_t> bytes(image_size(pushed.list()));
  bytes.resize(encode_image(pushed.list(), header, bytes.data(), bytes.size()));
  return bytes;
}

std::vector<std::string> never_pushed(const Calibration& calibration, const Robot& robot) {
  std::vector<std::string> names;
  for (const EffectGroup& group : effects_of(calibration.terms, robot.nominal)) {
    if (belongs_to_measurement(group.id.effect)) names.push_back(name(group.id));
  }
  return names;
}

Calibration calibration_from_image(std::span<const std::uint8_t> bytes, const Robot& robot,
                                   const std::string& source) {
  const auto refuse = [&](const std::string& found) {
    return InputError(source, 0, "", fmt::format("a parameter image for {} ({})", robot.name, robot.path),
                      found);
  };
  Calibration calibration;
  ImageHeader header;
  Refusal refusal =
      check_image(bytes.data(), bytes.size(), nominal_hash(robot.nominal), robot.nominal.name_hash, header);
  if (refusal == Refusal::none)
    refusal = visit_image<double>(bytes.data(), bytes.size(), Collector{calibration.terms});
  if (refusal != Refusal::none) throw refuse(fmt::format("that {}", text(refusal)));
  // Before names are looked for, which reads the tables as far as they say that they go.
  prepare(calibration.terms, robot, source);
  try {
    canonical(calibration.terms, robot.nominal);
  } catch (const std::invalid_argument& e) {
    throw refuse(fmt::format("terms that have no name in the catalogue: {}", e.what()));
  }
  calibration.path = source;
  calibration.robot = robot.name;
  calibration.nominal_hash = header.nominal_hash;
  calibration.sequence = header.sequence;
  return calibration;
}

}  // namespace flexcomp::host
