// SPDX-License-Identifier: Apache-2.0
/// \file
/// A finished plan: poses in the order of travel, what they will make known, and other methods for comparison.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "planning/plan_task.hpp"

namespace flexcomp::host {

/// Called after every step of a search.
using WatchSearch = std::function<void(const std::string& method, const Search& search)>;
using StopSearch = std::function<bool()>;

/// Steps until the search is done or, with at least one set found, `stop` asks for its end. \return whether it is done
bool run_search(Search& search, const StopSearch& stop, const std::function<void()>& after_step);

/// The work and the result of one method.
struct MethodResult {
  std::string method;
  double criterion = 0;
  double cpu_seconds = 0;
  std::uint64_t evaluations = 0;
};

/// 1 sigma to expect of a parameter.
struct ExpectedSigma {
  std::string name;
  double value = 0;         ///< in the unit of files
  double scaled_units = 0;  ///< in scaled units, comparable between parameters
};

struct CriterionValue {
  double criterion = 0;
  double o1 = 0;
  double omin_expected = 0;
};

struct PlanResult {
  PoseSet set;
  CriterionValue value;
  std::vector<ExpectedSigma> sigmas;
  std::optional<CriterionValue>
      before;                           ///< of what is measured already, where that identifies all parameters
  std::vector<double> random;           ///< criterion of sets of random poses, ascending
  std::vector<std::size_t> at_payload;  ///< poses by payload
  std::uint64_t evaluations = 0;
  std::uint64_t resumed_at = 0;  ///< evaluations before this run
  double cpu_seconds = 0;
  bool stopped = false;
  std::vector<std::pair<std::uint64_t, double>> history;  ///< evaluations and log fitness at each improvement
  std::vector<MethodResult> compared;

  double random_median() const { return random[random.size() / 2]; }
};

/// After random poses every method that suits the task, exchange with 200 restarts, until `stop` asks for the end.
std::vector<MethodResult> compare_methods(const PlanTask& task, const PlanResult& result,
                                          const StopSearch& stop, const WatchSearch& watch);

/// Files of a search's state; an empty path is none.
struct StateFiles {
  std::string resume;  ///< read at the start
  std::string state;   ///< written every two seconds and at the end; default: `resume`
};

/// The best set of the task's method, rounded and in the order of travel.
PlanResult find_plan(const PlanTask& task, const StateFiles& files, const StopSearch& stop,
                     const std::function<void(const Search&)>& watch);
/// The rows of the plan's file.
MeasuredData plan_rows(const PlanTask& task, const PlanResult& result);

}  // namespace flexcomp::host
