// SPDX-License-Identifier: Apache-2.0
/// \file
/// The sections of a page as HTML. Each is empty where the page has nothing to say in it.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "report/page.hpp"

namespace flexcomp::host {

/// Why the result must not be relied on: what the page says, and errors that are larger after than before.
std::string doubts_section(const Page& page);
std::string facts_list(const Page& page);
/// \param number  of this set, for the script
/// \param sets    that share the page
std::string poses_section(const PagePoses& set, std::size_t number, std::size_t sets);
std::string plan_sections(const PagePlan& plan);
std::string free_section(const PageSection& section);
/// Joint readings as a table, one pose per row. \param payload_kg  of each, or empty
PageSection poses_table(const std::string& title, const std::vector<std::array<double, joint_count>>& q_rad,
                        const std::vector<double>& payload_kg, int decimals);
std::string results_section(const Page& page);
/// Parameters that cannot be told from others, and those that these data do not determine.
std::string identifiability_sections(const Page& page);
std::string parameters_section(const Page& page);
std::string links_list(const Page& page);

}  // namespace flexcomp::host
