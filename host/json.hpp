// SPDX-License-Identifier: Apache-2.0
/// \file
/// JSON of results and of stored searches: keys in the order in which they were written. Instantiated once (json.cpp).
#ifndef FLEXCOMP_HOST_JSON_HPP
#define FLEXCOMP_HOST_JSON_HPP

#include <nlohmann/json.hpp>

extern template class nlohmann::basic_json<nlohmann::ordered_map>;

namespace flexcomp::host {

using Json = nlohmann::ordered_json;

}  // namespace flexcomp::host

#endif
