// SPDX-License-Identifier: Apache-2.0
/// \file
/// Patterns by which the names of points tell pose and reflector: "*::{pose}_{reflector}".
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace flexcomp::host {

/// {pose} stands for any text but none, {reflector} for a … d or 1 … 4, * for any text. Of several matches each, from the left,
/// takes as much as it can.
class NamePattern {
 public:
  /// \throws InputError  no {pose}, {pose} or {reflector} twice, or * beside {pose}
  explicit NamePattern(const std::string& pattern);

  bool has_reflectors() const { return has(Kind::reflector); }

  /// Pose and reflector (0 … 3); nothing where the name does not match. Time and memory grow with the product of the
  /// lengths of name and pattern.
  std::optional<std::pair<std::string, std::size_t>> read(const std::string& name) const;

 private:
  enum class Kind { text, anything, pose, reflector };
  struct Part {
    Kind kind;
    std::string text;
  };

  bool has(Kind kind) const;

  std::vector<Part> parts_;
};

}  // namespace flexcomp::host
