// SPDX-License-Identifier: Apache-2.0
#include "model/tolerance.hpp"

#include <fmt/format.h>

#include <string_view>

#include "input_error.hpp"
#include "nearest.hpp"

namespace flexcomp::host {

namespace {

/// `*` stands for any text, also none.
bool matches(std::string_view pattern, std::string_view name) {
  const std::size_t star = pattern.find('*');
  if (star == std::string_view::npos) return pattern == name;
  if (name.substr(0, star) != pattern.substr(0, star)) return false;
  pattern.remove_prefix(star + 1);
  name.remove_prefix(star);
  for (std::size_t skip = 0; skip <= name.size(); ++skip) {
    if (matches(pattern, name.substr(skip))) return true;
  }
  return false;
}

}  // namespace

std::vector<std::size_t> parameters_meant(const Tolerance& tolerance,
                                          const std::vector<Parameter>& parameters) {
  std::vector<std::size_t> meant;
  std::vector<std::string> names;
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    names.push_back(parameters[p].name);
    if (matches(tolerance.pattern, parameters[p].name)) meant.push_back(p);
  }
  if (meant.empty()) {
    const std::string near = nearest(tolerance.pattern, names);
    throw InputError(tolerance.file, tolerance.line, tolerance.pattern,
                     "the name of a parameter of this model, * for any text (link*.d_mm)",
                     near.empty() ? "none of them" : fmt::format("none of them (did you mean {}?)", near));
  }
  return meant;
}

}  // namespace flexcomp::host
