// SPDX-License-Identifier: Apache-2.0
#include "files/yaml_field.hpp"

#include <fmt/format.h>

#include <yaml-cpp/eventhandler.h>

#include <algorithm>
#include <charconv>
#include <sstream>
#include <utility>

#include "files/read_file.hpp"
#include "nearest.hpp"
#include "quaternion.hpp"

namespace flexcomp::host {

namespace {

std::size_t line_of(const YAML::Mark& mark) {
  return mark.line < 0 ? 0 : static_cast<std::size_t>(mark.line) + 1;
}

std::string describe(const YAML::Node& node) {
  switch (node.Type()) {
    case YAML::NodeType::Scalar:
      return "'" + node.Scalar() + "'";
    case YAML::NodeType::Sequence:
      return fmt::format("a list of {}", node.size());
    case YAML::NodeType::Map:
      return "a mapping";
    default:
      return "nothing";
  }
}

template <class Integer>
Integer integer_of(const YamlField& field, const YAML::Node& node, Integer least, Integer most) {
  Integer value = 0;
  const std::string& text = node.IsScalar() ? node.Scalar() : std::string();
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || failure != std::errc() || end != text.data() + text.size() || value < least ||
      value > most) {
    throw field.error(fmt::format("an integer from {} to {}", least, most));
  }
  return value;
}

/// Where the first node of a document stands.
class FirstNode : public YAML::EventHandler {
 public:
  const YAML::Mark& mark() const { return mark_; }
  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override { see(mark); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override { see(mark); }
  void OnScalar(const YAML::Mark& mark, const std::string&, YAML::anchor_t, const std::string&) override {
    see(mark);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {
    see(mark);
  }
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                  YAML::EmitterStyle::value) override {
    see(mark);
  }
  void OnMapEnd() override {}

 private:
  void see(const YAML::Mark& mark) {
    if (mark_.is_null()) mark_ = mark;
  }
  YAML::Mark mark_ = YAML::Mark::null_mark();
};

/// Whether the text is the same when it is written and read again: YAML has U+FFFD for bytes that are not UTF-8, and for the code
/// points that stand for no character.
bool can_be_written(const std::string& text) {
  const bool is_plain = std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c <= '~'; });
  return is_plain || YAML::Load(yaml_quoted(text)).Scalar() == text;
}

}  // namespace

YamlField::YamlField(const YAML::Node& node, std::string file, std::string path, std::size_t line)
    : node_(node), file_(std::move(file)), path_(std::move(path)), line_(line) {}

YamlField YamlField::load(const std::string& path) { return parse(read_file(path), path); }

YamlField YamlField::parse(const std::string& text, const std::string& name) {
  try {
    // Not YAML::LoadAll(): yaml-cpp 0.7 takes what is left behind a document ("a"\nb: {) for endless empty ones.
    std::istringstream stream(text);
    YAML::Parser parser(stream);
    FirstNode first;
    FirstNode second;
    if (parser.HandleNextDocument(first) && parser.HandleNextDocument(second)) {
      throw InputError(name, line_of(second.mark()), "", "one YAML document", "another one behind it");
    }
    YamlField root(YAML::Load(text), name, "", 1);
    if (!root.node_.IsMap()) throw InputError(name, 0, "", "a mapping (key: value)", describe(root.node_));
    return root;
  } catch (const YAML::Exception& e) {
    throw InputError(name, line_of(e.mark), "", "YAML", e.msg);
  }
}

std::size_t YamlField::line() const { return line_; }

InputError YamlField::error(const std::string& expected) const { return error(expected, describe(node_)); }

InputError YamlField::error(const std::string& expected, const std::string& found) const {
  return {file_, line_, path_, expected, found};
}

std::vector<std::string> YamlField::keys() const {
  if (!node_.IsMap()) throw error("a mapping (key: value)");
  std::vector<std::string> names;
  for (const auto& pair : node_) names.push_back(pair.first.IsScalar() ? pair.first.Scalar() : std::string());
  return names;
}

void YamlField::require_keys(const std::vector<std::string>& known) const {
  if (!node_.IsMap()) throw error("a mapping (key: value)");
  std::vector<std::string> seen;
  for (const auto& pair : node_) {
    const std::string key = pair.first.IsScalar() ? pair.first.Scalar() : describe(pair.first);
    const std::string field = path_.empty() ? key : path_ + "." + key;
    const std::size_t line = line_of(pair.first.Mark());
    if (std::find(known.begin(), known.end(), key) == known.end()) {
      throw InputError(file_, line, field, expected_name(key, known, "one of the keys", "a known key"),
                       "the unknown key '" + key + "'");
    }
    if (std::find(seen.begin(), seen.end(), key) != seen.end()) {
      throw InputError(file_, line, field, "each key once", "'" + key + "' a second time");
    }
    seen.push_back(key);
  }
}

std::optional<YamlField> YamlField::find(const std::string& key) const {
  if (!node_.IsMap()) throw error("a mapping (key: value)");
  for (const auto& pair : node_) {
    if (pair.first.IsScalar() && pair.first.Scalar() == key) {
      const std::string field = path_.empty() ? key : path_ + "." + key;
      return YamlField(pair.second, file_, field, line_of(pair.first.Mark()));
    }
  }
  return {};
}

YamlField YamlField::at(const std::string& key) const {
  const auto field = find(key);
  if (!field) throw InputError(file_, line_, path_.empty() ? key : path_ + "." + key, "this key", "nothing");
  return *field;
}

std::vector<YamlField> YamlField::items() const {
  if (!node_.IsSequence()) throw error("a list");
  std::vector<YamlField> fields;
  for (std::size_t k = 0; k < node_.size(); ++k) {
    const YAML::Node item = node_[k];
    const std::size_t line = line_of(item.Mark());
    fields.push_back(YamlField(item, file_, fmt::format("{}[{}]", path_, k + 1), line == 0 ? line_ : line));
  }
  return fields;
}

std::string YamlField::text() const {
  if (!node_.IsScalar() || node_.Scalar().empty()) throw error("a name or text");
  if (!can_be_written(node_.Scalar())) throw error("text in UTF-8", "other bytes");
  return node_.Scalar();
}

double YamlField::number(const Unit& unit) const {
  const auto value = node_.IsScalar() ? parse_si(node_.Scalar(), unit) : std::nullopt;
  if (!value) throw error("a finite number");
  return *value;
}

double YamlField::number(const Unit& unit, double above, const std::string& expected) const {
  const double value = number(unit);
  if (!(value > above)) throw error(expected);
  return value;
}

bool YamlField::boolean() const {
  const std::string value = text();
  if (value != "true" && value != "false") throw error("true or false");
  return value == "true";
}

unsigned YamlField::integer(unsigned least, unsigned most) const {
  return integer_of(*this, node_, least, most);
}

int YamlField::whole_number(int largest) const { return integer_of(*this, node_, -largest, largest); }

Eigen::Vector3d YamlField::vector3(const Unit& unit) const {
  if (!node_.IsSequence() || node_.size() != 3) throw error("a list of three numbers");
  const std::vector<YamlField> parts = items();
  return {parts[0].number(unit), parts[1].number(unit), parts[2].number(unit)};
}

Eigen::Quaterniond YamlField::quaternion() const {
  if (!node_.IsSequence() || node_.size() != 4) throw error("a list of four numbers, w x y z");
  const std::vector<YamlField> parts = items();
  const std::array<double, 4> wxyz{parts[0].number(unit::si), parts[1].number(unit::si),
                                   parts[2].number(unit::si), parts[3].number(unit::si)};
  if (const auto q = unit_quaternion(wxyz)) return *q;
  throw error("a quaternion w x y z of norm 1 (within 0.001)", norm_text(wxyz));
}

double YamlField::number_or(const std::string& key, const Unit& unit, double otherwise) const {
  const auto field = find(key);
  return field ? field->number(unit) : otherwise;
}

std::string yaml_number(std::string text) {
  const std::size_t e = text.find('e');
  if (e != std::string::npos && text.find('.') == std::string::npos) text.insert(e, ".0");
  return text;
}

std::string yaml_number(double si, const Unit& unit) { return yaml_number(format_si(si, unit)); }

std::string yaml_quoted(const std::string& text) {
  YAML::Emitter emitter;
  emitter << YAML::DoubleQuoted << text;
  return emitter.c_str();
}

}  // namespace flexcomp::host
