// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "exchange/program_text.hpp"
#include "exchange/xml.hpp"
#include "units.hpp"

namespace flexcomp::host {

namespace {

class Val3 : public ProgramText {
 public:
  using ProgramText::ProgramText;

  void read() {
    visit(parse_xml(program_.path, program_.text), "", "");
    if (cartesian_ != 0) {
      program_.warnings.push_back(fmt::format(
          "{}: {} Cartesian points are left as they are: their configuration does not tell one solution; "
          "teach joint points.",
          program_.path, cartesian_));
    }
  }

 private:
  /// Name and type are those of the enclosing <Data>.
  void visit(const XmlElement& element, std::string name, std::string type) {
    if (const XmlAttribute* const own = element.attribute("name")) name = own->value;
    if (element.name == "Data") {
      const XmlAttribute* const own = element.attribute("type");
      type = own == nullptr ? "" : own->value;
    }
    value(element, name, type);
    for (const XmlElement& child : element.children) visit(child, name, type);
  }

  void value(const XmlElement& element, const std::string& name, const std::string& type) {
    std::vector<TextSpan> joints;
    for (std::size_t j = 1; j <= joint_count; ++j) {
      if (const XmlAttribute* const joint = element.attribute(fmt::format("j{}", j)))
        joints.push_back(joint->span);
    }
    const auto has = [&element](const char* attribute) { return element.attribute(attribute) != nullptr; };
    const std::size_t at = element.start_tag.begin;
    if (joints.empty()) {
      const bool is_point = type.starts_with("point") || element.name == "valuePoint" || has("shoulder");
      if (is_point && has("x") && has("y") && has("z")) ++cartesian_;
    } else if (type.starts_with("joint") || element.name == "valueJoint") {
      if (joints.size() != joint_count)
        throw error(at, name, "all of j1 … j6", fmt::format("{} of them", joints.size()));
      ProgramTarget found;
      found.line = element.line;
      found.name = name;
      for (std::size_t j = 0; j < joint_count; ++j)
        found.q_rad[j] = number(joints[j], unit::degree, fmt::format("j{}", j + 1));
      found.numbers = std::move(joints);
      program_.targets.push_back(std::move(found));
    } else if (joints.size() == joint_count) {
      warn(at, fmt::format("j1 … j6 of {} {} left as they are: no joint positions, by their type.",
                           name.empty() ? "<" + element.name + ">" : name,
                           type.empty() ? "are" : "(" + type + ") are"));
    }
  }

  std::size_t cartesian_ = 0;
};

}  // namespace

void read_val3(TargetProgram& program) { Val3(program).read(); }

}  // namespace flexcomp::host
