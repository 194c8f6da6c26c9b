/// \file
/// Pages of what `identify` and `validate` found.
#ifndef FLEXCOMP_HOST_REPORT_RESULTS_HPP
#define FLEXCOMP_HOST_REPORT_RESULTS_HPP

#include <string>
#include <vector>

#include "identification/identify.hpp"
#include "identification/validate.hpp"
#include "report/page.hpp"

namespace flexcomp::host {

Page page_of(const Identification& result, const std::vector<Observation>& rows, const RobotFile& robot,
             const std::string& data);
Page page_of(const Validation& result, const std::vector<Observation>& rows, const RobotFile& robot,
             const Calibration& calibration, const std::string& data);

}  // namespace flexcomp::host

#endif
