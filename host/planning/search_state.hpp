// SPDX-License-Identifier: Apache-2.0
/// \file
/// A search that is stopped is stored with the task it belongs to, and resumed to the result of an unbroken search.
#ifndef FLEXCOMP_HOST_PLANNING_SEARCH_STATE_HPP
#define FLEXCOMP_HOST_PLANNING_SEARCH_STATE_HPP

#include <string>

#include "json.hpp"
#include "planning/plan_task.hpp"

namespace flexcomp::host {

/// {"task": all that the result depends on, with a hash of each input file, "search": Search::save()}.
class SearchState {
 public:
  explicit SearchState(const PlanTask& task);

  void save(const std::string& path, const Search& search) const;
  /// \throws InputError  no state of this very task (search_state)
  void load(const std::string& path, Search& search) const;

 private:
  Json task_;
};

}  // namespace flexcomp::host

#endif
