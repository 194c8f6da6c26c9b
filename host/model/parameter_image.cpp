// SPDX-License-Identifier: Apache-2.0
#include "model/parameter_image.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "flexcomp/image.hpp"
#include "flexcomp/signature.hpp"
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

/// Passes over what it is given.
struct NoVisitor {
  Refusal table(const Table&, const std::uint8_t*) { return Refusal::none; }
  Refusal term(const Term<double>&) { return Refusal::none; }
};

/// Offsets of what the records of schema 1.1 hold in a well-formed image; 0: it has none.
struct Offsets {
  std::size_t unit = 0;
  std::size_t signature = 0;
};

/// From record to record: the last bytes of a term or table may look like a signature.
Offsets offsets_of(std::span<const std::uint8_t> image, const std::string& source) {
  ImageHeader header;
  Refusal refusal = read_header(image.data(), image.size(), header);
  ImageCursor cursor;
  NoVisitor nothing;
  Offsets out;
  while (refusal == Refusal::none && !at_end(cursor, image.size())) {
    const std::size_t at = cursor.at;
    refusal = visit_record<double>(image.data(), image.size(), cursor, nothing);
    if (refusal != Refusal::none) break;
    const std::uint16_t type = load_u16(image.data() + at);
    if (type == image::record_unit) out.unit = at + image::record_head_bytes;
    if (type == image::record_signature) out.signature = at + image::record_head_bytes;
  }
  if (refusal != Refusal::none)
    throw InputError(source, 0, "", "a parameter image", fmt::format("that {}", text(refusal)));
  return out;
}

}  // namespace

ImageRecords image_records(std::span<const std::uint8_t> image, const std::string& source) {
  const Offsets offsets = offsets_of(image, source);
  ImageRecords out;
  if (offsets.unit != 0)
    std::copy_n(image.subspan(offsets.unit).begin(), out.unit_hash.size(), out.unit_hash.begin());
  if (offsets.signature != 0) {
    const auto record = image.subspan(offsets.signature);
    out.is_signed = true;
    out.counter = load_u64(record.data() + signing::record_counter);
    std::copy_n(record.begin() + signing::record_key_id, out.key_id.size(), out.key_id.begin());
  }
  return out;
}

std::vector<std::uint8_t> without_signature(std::span<const std::uint8_t> image, const std::string& source) {
  // Bytes 92 … 95 of the header (image.hpp): number of joints, from schema 1.1.
  constexpr std::size_t joints_at = 92;
  const Offsets offsets = offsets_of(image, source);
  std::vector<std::uint8_t> out(image.begin(), image.end());
  if (offsets.signature == 0) return out;
  out.resize(offsets.signature - image::record_head_bytes + image::crc_bytes);
  // An image in which nothing of schema 1.1 is left is one of 1.0 (encode_image()).
  if (offsets.unit == 0 && out[joints_at] == 0) out[5] = 0;
  store_u32(out.data() + 8, static_cast<std::uint32_t>(out.size()));
  const std::size_t crc_at = out.size() - image::crc_bytes;
  store_u32(out.data() + crc_at, crc32(out.data(), crc_at));
  return out;
}

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
  header.unit_hash = robot.nominal.unit_hash;
  std::vector<std::uint8_t> bytes(image_size(pushed.list(), is_given(header.unit_hash)));
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
  const Sha256Digest unit = image_records(bytes, source).unit_hash;
  if (is_given(unit) && is_given(robot.nominal.unit_hash) && unit != robot.nominal.unit_hash) {
    throw refuse(fmt::format("one for {}, not for {}", unit_text("", unit),
                             unit_text(robot.serial, robot.nominal.unit_hash)));
  }
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
