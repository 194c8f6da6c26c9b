// SPDX-License-Identifier: Apache-2.0
/// \file
/// YAML: a node with its file, line and field path for error messages; numbers and strings as text.
#pragma once

#include <yaml-cpp/yaml.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "input_error.hpp"
#include "units.hpp"

namespace flexcomp::host {

/// YAML node with typed access; every accessor throws InputError with file, line and path.
class YamlField {
 public:
  /// Loads the root of a file. \throws InputError  absent, unreadable, no YAML, empty
  static YamlField load(const std::string& path);
  /// Parses the root of a text. \param name  file name in messages \throws InputError  no YAML, empty
  static YamlField parse(const std::string& text, const std::string& name);

  std::size_t line() const;
  const std::string& path() const { return path_; }  ///< joints[3].a_mm
  const std::string& file() const { return file_; }

  /// Error of this field, to be thrown; by default `found` describes the node.
  InputError error(const std::string& expected) const;
  InputError error(const std::string& expected, const std::string& found) const;

  /// Requires a mapping with no keys beyond `known` and none twice. \throws InputError
  void require_keys(const std::vector<std::string>& known) const;
  bool has(const std::string& key) const { return find(key).has_value(); }
  std::optional<YamlField> find(const std::string& key) const;
  YamlField at(const std::string& key) const;  ///< \throws InputError where the key is missing
  bool is_mapping() const { return node_.IsMap(); }
  std::vector<std::string> keys() const;  ///< of a mapping, in the order of the file

  /// Items of a sequence, counted from 1 in paths (joints[3] is joint 3). \throws InputError
  std::vector<YamlField> items() const;

  std::string text() const;  ///< a non-empty scalar
  double number(const Unit& unit) const;
  double number(const Unit& unit, double above, const std::string& expected) const;  ///< greater than `above`
  unsigned integer(unsigned least, unsigned most) const;
  bool boolean() const;                 ///< true or false
  int whole_number(int largest) const;  ///< of either sign
  Eigen::Vector3d vector3(const Unit& unit) const;
  /// w x y z; norm within 1e-3 of 1, normalised, w >= 0
  Eigen::Quaterniond quaternion() const;

  /// Number of a member that may be absent.
  double number_or(const std::string& key, const Unit& unit, double otherwise) const;

 private:
  YamlField(const YAML::Node& node, std::string file, std::string path, std::size_t line);

  YAML::Node node_;
  std::string file_;
  std::string path_;
  std::size_t line_;
};

/// Formats a number for YAML 1.1 readers, to which 1e-05 is text and 1.0e-05 a number.
std::string yaml_number(std::string text);
/// Formats a number with the digits from which the identical double is read back.
std::string yaml_number(double si, const Unit& unit);

/// Quotes a text with double quotes and escapes.
std::string yaml_quoted(const std::string& text);

}  // namespace flexcomp::host
