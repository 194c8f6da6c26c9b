// SPDX-License-Identifier: Apache-2.0
/// \file
/// Places in a text and replacements there that leave every other byte as it was.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <utility>

namespace flexcomp::host {

/// Bytes of a text, from `begin` to before `end`.
struct TextSpan {
  std::size_t begin = 0;
  std::size_t end = 0;
};

class TextEdits {
 public:
  /// An empty span inserts. Spans must not overlap; at each `begin` the last replacement counts.
  void replace(const TextSpan& span, std::string by) { edits_[span.begin] = {span.end, std::move(by)}; }

  std::string applied_to(const std::string& text) const {
    std::string out;
    std::size_t at = 0;
    for (const auto& [begin, edit] : edits_) {
      out.append(text, at, begin - at).append(edit.second);
      at = edit.first;
    }
    return out.append(text, at);
  }

 private:
  std::map<std::size_t, std::pair<std::size_t, std::string>> edits_;  ///< begin -> end, replacement
};

}  // namespace flexcomp::host
