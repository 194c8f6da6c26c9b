// SPDX-License-Identifier: Apache-2.0
/// \file
/// The numbers of a page for its script.
#pragma once

#include <cstddef>
#include <string>

#include "report/page.hpp"

namespace flexcomp::host {

/// JSON that may stand in a <script> element: no '<' in it. Keys and units are those of report/web/src/data.js, which
/// reads it. Of more poses than `most` in all sets together, shown_poses() says which are in it.
std::string web_data(const Page& page, std::size_t most);

}  // namespace flexcomp::host
