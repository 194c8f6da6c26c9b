/// \file
/// The numbers of a page for its script.
#ifndef FLEXCOMP_HOST_REPORT_WEB_DATA_HPP
#define FLEXCOMP_HOST_REPORT_WEB_DATA_HPP

#include <string>

#include "report/page.hpp"

namespace flexcomp::host {

/// JSON that may stand in a <script> element: no '<' in it. Keys and units are those of report/web/src/data.js, which
/// reads it. Of more than 3,000 poses in all, shown_poses() says which are in it.
std::string web_data(const Page& page);

}  // namespace flexcomp::host

#endif
