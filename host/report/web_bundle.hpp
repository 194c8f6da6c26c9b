// SPDX-License-Identifier: Apache-2.0
/// \file
/// The script and style sheet of the page's interactive parts. Made by the build from report/web and the npm packages that
/// its lock file names; empty where the program was configured with FLEXCOMP_REPORT_WEB=OFF.
#pragma once

#include <string_view>

namespace flexcomp::host {

/// As it goes between <script> and </script>, which it does not contain.
std::string_view web_script();
/// As it goes between <style> and </style>.
std::string_view web_style();

}  // namespace flexcomp::host
