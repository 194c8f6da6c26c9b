// SPDX-License-Identifier: Apache-2.0
/// \file
/// Pages of what `identify`, `validate`, `diagnose` and `plan` found.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/held_out.hpp"
#include "identification/identify.hpp"
#include "identification/validate.hpp"
#include "planning/plan_result.hpp"
#include "report/models.hpp"
#include "report/page.hpp"

namespace flexcomp::host {

/// \param compared        compare_models(), or none
/// \param without_priors  the run fixed parameters or had tolerances, which compare_models() drops
Page page_of(const Identification& r, const std::vector<Observation>& rows, const Robot& robot,
             const std::string& data, const std::vector<ModelFit>& compared, bool without_priors = false);
Page page_of(const Validation& v, const std::vector<Observation>& rows, const Robot& robot,
             const Calibration& calibration, const std::string& data);

/// \param others  rows that were kept out, where there are any
Page page_of(const Diagnosis& d, const std::vector<Observation>& rows, const Robot& robot,
             const std::string& data, const std::optional<HeldOut>& others);

Page page_of(const PlanTask& task, const PlanResult& result);

/// Appends the parameters and the fitted frame parameters with their uncertainty, and what could not be told apart.
void add_parameters(Page& page, const Calibration& calibration, const Robot& robot);
/// What pages of results have in common: a page with its title and who made it when, and the rows as poses of a page.
Page titled_page(const std::string& title, const Robot& robot);
PagePoses page_poses(const std::vector<RowResidual>& before, const std::vector<RowResidual>& after,
                     const std::vector<Observation>& rows, const std::vector<std::size_t>& outliers,
                     bool frames_fitted);

}  // namespace flexcomp::host
