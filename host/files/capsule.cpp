// SPDX-License-Identifier: Apache-2.0
#include "files/capsule.hpp"

#include "files/yaml_field.hpp"

namespace flexcomp::host {

namespace {

Capsule read_shape(const YamlField& field) {
  Capsule capsule;
  capsule.from_m = field.at("from_mm").vector3(unit::mm);
  capsule.to_m = field.at("to_mm").vector3(unit::mm);
  capsule.radius_m = field.at("radius_mm").number(unit::mm, 0, "a radius above 0");
  return capsule;
}

void require_keys(const YamlField& field) { field.require_keys({"frame", "from_mm", "to_mm", "radius_mm"}); }

}  // namespace

Capsule read_capsule(const YamlField& field) {
  require_keys(field);
  const std::size_t frame = field.at("frame").integer(0, joint_count);
  Capsule capsule = read_shape(field);
  capsule.frame = frame;
  return capsule;
}

Capsule read_fixed_capsule(const YamlField& field) {
  require_keys(field);
  const auto frame = field.find("frame");
  if (frame && frame->text() != "0") throw frame->error("0 or no frame at all (an obstacle stands still)");
  return read_shape(field);
}

}  // namespace flexcomp::host
