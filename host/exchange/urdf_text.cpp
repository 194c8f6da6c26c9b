// SPDX-License-Identifier: Apache-2.0
#include "exchange/urdf_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "files/text.hpp"

namespace flexcomp::host {

namespace {

/// A start tag, or a tag that is both.
struct Tag {
  std::size_t begin = 0;  ///< of '<'
  std::size_t end = 0;    ///< behind '>'
  std::size_t depth = 0;  ///< 1: the root
  std::string name;
  bool closed = false;  ///< <x/>
};

/// The start tags of a text that liburdfdom has read: well-formed XML, comments and CDATA left out.
std::vector<Tag> tags_of(std::string_view text) {
  std::vector<Tag> tags;
  std::size_t depth = 0;
  for (std::size_t at = text.find('<'); at < text.size(); at = text.find('<', at)) {
    const std::string_view rest = text.substr(at);
    const auto skip = [&](std::string_view begin, std::string_view end) {
      if (!rest.starts_with(begin)) return false;
      const auto to = text.find(end, at + begin.size());
      at = to == std::string_view::npos ? text.size() : to + end.size();
      return true;
    };
    if (skip("<!--", "-->") || skip("<![CDATA[", "]]>") || skip("<?", "?>") || skip("<!", ">")) continue;
    if (rest.starts_with("</")) {
      if (depth > 0) --depth;
      ++at;
      continue;
    }
    Tag tag;
    tag.begin = at;
    tag.depth = depth + 1;
    std::size_t k = at + 1;
    while (k < text.size() && std::string_view(" \t\r\n/>").find(text[k]) == std::string_view::npos)
      tag.name += text[k++];
    k = std::min(tag_close(text, k), text.size());
    tag.closed = k > at && text[k - 1] == '/';
    tag.end = std::min(k + 1, text.size());
    if (!tag.closed) ++depth;
    at = tag.end;
    tags.push_back(std::move(tag));
  }
  return tags;
}

/// The value of an attribute within a tag, without its quotes.
std::optional<TextSpan> attribute(std::string_view text, const Tag& tag, std::string_view name) {
  std::size_t at = tag.begin + 1 + tag.name.size();
  while (at < tag.end) {
    while (at < tag.end && std::string_view(" \t\r\n").find(text[at]) != std::string_view::npos) ++at;
    const std::size_t start = at;
    while (at < tag.end && std::string_view(" \t\r\n=/>").find(text[at]) == std::string_view::npos) ++at;
    if (at == start) return {};
    const std::string_view found = text.substr(start, at - start);
    at = text.find_first_of("\"'", at);
    if (at >= tag.end) return {};
    const std::size_t end = text.find(text[at], at + 1);
    if (end >= tag.end) return {};
    if (found == name) return TextSpan{at + 1, end};
    at = end + 1;
  }
  return {};
}

std::string numbers(const Eigen::Vector3d& v) {
  // To 1e-15: what arithmetic made 0.29999999999999993 is 0.3 again, and a zero is a zero.
  const auto plain = [](double x) {
    const double rounded = std::round(x * 1e15) / 1e15;
    return rounded == 0 ? std::string("0") : fmt::format("{:.15g}", rounded);
  };
  return fmt::format("{} {} {}", plain(v.x()), plain(v.y()), plain(v.z()));
}

std::string attributes(const Pose<double>& pose) {
  return fmt::format("xyz=\"{}\" rpy=\"{}\"", numbers(pose.position), numbers(roll_pitch_yaw(pose.rotation)));
}

std::string unescaped(std::string_view text) {
  std::string out;
  for (std::size_t k = 0; k < text.size(); ++k) {
    bool replaced = false;
    for (const auto& [entity, c] : {std::pair<std::string_view, char>{"&amp;", '&'},
                                    {"&lt;", '<'},
                                    {"&gt;", '>'},
                                    {"&quot;", '"'},
                                    {"&apos;", '\''}}) {
      if (text.substr(k).starts_with(entity)) {
        out += c;
        k += entity.size() - 1;
        replaced = true;
        break;
      }
    }
    if (!replaced) out += text[k];
  }
  return out;
}

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text)
    out += c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '"' ? "&quot;" : std::string(1, c);
  return out;
}

}  // namespace

Eigen::Vector3d roll_pitch_yaw(const Eigen::Matrix3d& r) {
  // Yaw first, and roll of what is left when yaw is undone: where pitch is 90 degrees yaw is arbitrary, and roll makes up
  // for whatever it is.
  const double yaw = std::atan2(r(1, 0), r(0, 0));
  const double s = std::sin(yaw);
  const double c = std::cos(yaw);
  const double pitch = std::atan2(-r(2, 0), c * r(0, 0) + s * r(1, 0));
  const double roll = std::atan2(s * r(0, 2) - c * r(1, 2), c * r(1, 1) - s * r(0, 1));
  return {roll, pitch, yaw};
}

std::string with_origins(const std::string& text, const std::map<std::string, Pose<double>>& origins) {
  const std::vector<Tag> tags = tags_of(text);
  std::map<std::size_t, std::pair<std::size_t, std::string>> edits;  // begin -> end, what comes there
  std::size_t found = 0;
  for (std::size_t k = 0; k < tags.size(); ++k) {
    const Tag& joint = tags[k];
    if (joint.depth != 2 || joint.name != "joint") continue;
    const auto name = attribute(text, joint, "name");
    if (!name) continue;
    const auto wanted =
        origins.find(unescaped(std::string_view(text).substr(name->begin, name->end - name->begin)));
    if (wanted == origins.end()) continue;
    ++found;
    const Tag* origin = nullptr;
    for (std::size_t m = k + 1; m < tags.size() && tags[m].depth > 2 && origin == nullptr; ++m) {
      if (tags[m].depth == 3 && tags[m].name == "origin") origin = &tags[m];
    }
    if (origin == nullptr) {
      edits[joint.end] = {joint.end, fmt::format("<origin {}/>", attributes(wanted->second))};
      continue;
    }
    const auto xyz = attribute(text, *origin, "xyz");
    const auto rpy = attribute(text, *origin, "rpy");
    const std::size_t behind_name = origin->begin + 1 + origin->name.size();
    std::string missing;
    const auto put = [&](const std::optional<TextSpan>& span, const char* attribute_name,
                         const std::string& value) {
      if (span) {
        edits[span->begin] = {span->end, value};
      } else {
        missing += fmt::format(" {}=\"{}\"", attribute_name, value);
      }
    };
    put(xyz, "xyz", numbers(wanted->second.position));
    put(rpy, "rpy", numbers(roll_pitch_yaw(wanted->second.rotation)));
    if (!missing.empty()) edits[behind_name] = {behind_name, missing};
  }
  if (found != origins.size()) throw std::invalid_argument("a joint that is not in the text, or twice");
  std::string out;
  std::size_t at = 0;
  for (const auto& [begin, edit] : edits) {
    out.append(text, at, begin - at);
    out += edit.second;
    at = edit.first;
  }
  return out.append(text, at);
}

std::string with_fixed_link(const std::string& text, const std::string& parent, const std::string& link,
                            const Pose<double>& origin) {
  const auto end = text.rfind("</robot");
  if (end == std::string::npos) throw std::invalid_argument("no </robot>");
  return fmt::format(
      "{0}  <link name=\"{2}\"/>\n  <joint name=\"{2}_joint\" type=\"fixed\"><parent link=\"{1}\"/><child "
      "link=\"{2}\"/><origin {3}/></joint>\n{4}",
      text.substr(0, end), escaped(parent), escaped(link), attributes(origin), text.substr(end));
}

}  // namespace flexcomp::host
