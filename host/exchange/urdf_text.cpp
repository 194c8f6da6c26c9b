// SPDX-License-Identifier: Apache-2.0
#include "exchange/urdf_text.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <stdexcept>

#include "exchange/rotation_angles.hpp"
#include "exchange/text_edits.hpp"
#include "exchange/xml.hpp"

namespace flexcomp::host {

namespace {

std::string numbers(const Eigen::Vector3d& v) {
  // To 1e-15: what arithmetic made 0.29999999999999993 is 0.3 again, and a zero is a zero.
  const auto plain = [](double x) {
    const double rounded = std::round(x * 1e15) / 1e15;
    return rounded == 0 ? std::string("0") : fmt::format("{:.15g}", rounded);
  };
  return fmt::format("{} {} {}", plain(v.x()), plain(v.y()), plain(v.z()));
}

std::string xyz(const Pose<double>& pose) { return numbers(pose.position); }
std::string rpy(const Pose<double>& pose) { return numbers(roll_pitch_yaw(pose.rotation)); }

std::string origin_tag(const Pose<double>& pose) {
  return fmt::format("<origin xyz=\"{}\" rpy=\"{}\"/>", xyz(pose), rpy(pose));
}

void set_origin(const XmlElement& joint, const Pose<double>& pose, TextEdits& edits) {
  const XmlElement* const origin = joint.child("origin");
  if (origin == nullptr) return edits.replace({joint.start_tag.end, joint.start_tag.end}, origin_tag(pose));
  std::string missing;
  const auto set = [&](const char* name, const std::string& value) {
    if (const XmlAttribute* const attribute = origin->attribute(name)) {
      edits.replace(attribute->span, value);
    } else {
      missing += fmt::format(" {}=\"{}\"", name, value);
    }
  };
  set("xyz", xyz(pose));
  set("rpy", rpy(pose));
  const std::size_t behind_name = origin->start_tag.begin + 1 + origin->name.size();
  if (!missing.empty()) edits.replace({behind_name, behind_name}, missing);
}

void add_link(const XmlElement& robot, const std::string& text, const AddedLink& added, TextEdits& edits) {
  for (const XmlElement& link : robot.children) {
    const XmlAttribute* const name = link.attribute("name");
    if (link.name != "link" || name == nullptr || name->value != added.parent) continue;
    // As written there, thus in the document's encoding and with its references.
    const std::string parent = text.substr(name->span.begin, name->span.end - name->span.begin);
    const char quote = text[name->span.end];
    const std::string child = parent + added.suffix;
    return edits.replace(
        {robot.end_tag, robot.end_tag},
        fmt::format("  <link name={0}{2}{0}/>\n  <joint name={0}{2}_joint{0} type=\"fixed\"><parent "
                    "link={0}{1}{0}/><child link={0}{2}{0}/>{3}</joint>\n",
                    quote, parent, child, origin_tag(added.origin)));
  }
  throw std::invalid_argument("a link that is not in the text");
}

}  // namespace

std::string with_origins(const std::string& path, const std::string& text,
                         const std::map<std::string, Pose<double>>& origins,
                         const std::optional<AddedLink>& added) {
  const XmlElement robot = parse_xml(path, text);
  TextEdits edits;
  std::size_t found = 0;
  for (const XmlElement& joint : robot.children) {
    const XmlAttribute* const name = joint.attribute("name");
    if (joint.name != "joint" || name == nullptr) continue;
    const auto origin = origins.find(name->value);
    if (origin == origins.end()) continue;
    ++found;
    set_origin(joint, origin->second, edits);
  }
  if (found != origins.size()) throw std::invalid_argument("a joint that is not in the text, or twice");
  if (added) add_link(robot, text, *added, edits);
  return edits.applied_to(text);
}

}  // namespace flexcomp::host
