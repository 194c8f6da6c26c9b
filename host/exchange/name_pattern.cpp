// SPDX-License-Identifier: Apache-2.0
#include "exchange/name_pattern.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "input_error.hpp"

namespace flexcomp::host {

namespace {

std::optional<std::size_t> reflector_of(char c) {
  const auto at = std::string_view("abcdABCD1234").find(c);
  return at == std::string_view::npos ? std::optional<std::size_t>() : at % 4;
}

}  // namespace

NamePattern::NamePattern(const std::string& pattern) {
  const auto refuse = [&pattern](const std::string& expected) {
    throw InputError("", 0, "names", expected, "'" + pattern + "'", ErrorCode::argument);
  };
  for (std::size_t k = 0; k < pattern.size();) {
    const auto take = [&](std::string_view word, Kind kind) {
      if (pattern.compare(k, word.size(), word) != 0) return false;
      if (kind != Kind::anything && has(kind)) refuse(fmt::format("{} once", word));
      // Two stars are one.
      if (parts_.empty() || parts_.back().kind != kind) parts_.push_back({kind, {}});
      k += word.size();
      return true;
    };
    if (take("{pose}", Kind::pose) || take("{reflector}", Kind::reflector) || take("*", Kind::anything))
      continue;
    if (parts_.empty() || parts_.back().kind != Kind::text) parts_.push_back({Kind::text, {}});
    parts_.back().text += pattern[k++];
  }
  if (!has(Kind::pose)) refuse("{pose} where the name of the pose stands");
  for (std::size_t k = 1; k < parts_.size(); ++k) {
    const auto beside = [&](Kind a, Kind b) { return parts_[k - 1].kind == a && parts_[k].kind == b; };
    if (beside(Kind::anything, Kind::pose) || beside(Kind::pose, Kind::anything))
      refuse("something between * and {pose}, or nobody knows where the pose's name begins and ends");
  }
}

std::optional<std::pair<std::string, std::size_t>> NamePattern::read(const std::string& name) const {
  // matches[p][k]: whether the parts from p on match the name from k on.
  std::vector<std::vector<bool>> matches(parts_.size() + 1, std::vector<bool>(name.size() + 1));
  matches.back()[name.size()] = true;
  for (std::size_t p = parts_.size(); p-- > 0;) {
    const Part& part = parts_[p];
    const std::vector<bool>& after = matches[p + 1];
    for (std::size_t k = name.size() + 1; k-- > 0;) {
      const bool more = k < name.size();
      if (part.kind == Kind::text) {
        matches[p][k] = k + part.text.size() <= name.size() && after[k + part.text.size()] &&
                        name.compare(k, part.text.size(), part.text) == 0;
      } else if (part.kind == Kind::reflector) {
        matches[p][k] = more && reflector_of(name[k]) && after[k + 1];
      } else if (part.kind == Kind::pose) {
        matches[p][k] = more && (after[k + 1] || matches[p][k + 1]);
      } else {
        matches[p][k] = after[k] || (more && matches[p][k + 1]);
      }
    }
  }
  if (!matches.front()[0]) return {};
  std::pair<std::string, std::size_t> out;
  std::size_t from = 0;
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    const Part& part = parts_[p];
    std::size_t to = name.size();
    if (part.kind == Kind::text) to = from + part.text.size();
    if (part.kind == Kind::reflector) to = from + 1;
    while (!matches[p + 1][to]) --to;
    if (part.kind == Kind::pose) out.first = name.substr(from, to - from);
    if (part.kind == Kind::reflector) out.second = *reflector_of(name[from]);
    from = to;
  }
  return out;
}

bool NamePattern::has(Kind kind) const {
  return std::any_of(parts_.begin(), parts_.end(), [kind](const Part& p) { return p.kind == kind; });
}

}  // namespace flexcomp::host
