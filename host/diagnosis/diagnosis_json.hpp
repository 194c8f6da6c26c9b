// SPDX-License-Identifier: Apache-2.0
/// \file
/// A diagnosis for machines: keys in docs/diagnosis.md.
#pragma once

#include <optional>
#include <vector>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/held_out.hpp"
#include "json.hpp"

namespace flexcomp::host {

/// \param rows  those that were diagnosed: outliers are given by their lines
Json to_json(const Diagnosis& d, const std::vector<Observation>& rows, const std::optional<HeldOut>& holdout,
             const Robot& robot);

}  // namespace flexcomp::host
