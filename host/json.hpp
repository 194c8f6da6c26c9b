// SPDX-License-Identifier: Apache-2.0
/// \file
/// JSON of results and of stored searches: keys in the order in which they were written. Instantiated once (json.cpp).
#pragma once

#include <functional>
#include <nlohmann/json.hpp>

extern template class nlohmann::basic_json<nlohmann::ordered_map>;

namespace flexcomp::host {

using Json = nlohmann::ordered_json;

/// What `of` (a function or a member) makes of each element of a list.
template <class List, class Of>
Json json_list(const List& list, const Of& of) {
  Json out = Json::array();
  for (const auto& element : list) out.push_back(std::invoke(of, element));
  return out;
}

}  // namespace flexcomp::host
