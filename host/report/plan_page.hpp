// SPDX-License-Identifier: Apache-2.0
/// \file
/// The page of a plan of measurement poses.
#ifndef FLEXCOMP_HOST_REPORT_PLAN_PAGE_HPP
#define FLEXCOMP_HOST_REPORT_PLAN_PAGE_HPP

#include "planning/plan_result.hpp"
#include "report/page.hpp"

namespace flexcomp::host {

Page page_of(const PlanTask& task, const PlanResult& result);

}  // namespace flexcomp::host

#endif
