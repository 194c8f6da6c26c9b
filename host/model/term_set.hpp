// SPDX-License-Identifier: Apache-2.0
/// \file
/// A list of terms that owns its memory, and the named parameters that drive it.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "flexcomp/term.hpp"
#include "units.hpp"

namespace flexcomp::host {

struct TermSet {
  std::vector<Term<double>> terms;
  std::vector<Table> tables;
  std::vector<double> values;

  /// A view for the core; valid until the set changes.
  TermList<double> list() const {
    return {terms.data(), terms.size(), tables.data(), tables.size(), values.data(), values.size()};
  }
};

/// One number that is identified, and the terms that it drives: several for thermal growth, none but a table's value for
/// a curve. Indices are those of the TermSet it was made with.
struct Parameter {
  std::string name;                ///< contract name, e.g. link3.d_mm, gear_harmonic[joint=3,order=1].sin_rad
  Unit unit;                       ///< of the number in files
  std::vector<std::size_t> terms;  ///< each has this parameter as its coefficient
  std::optional<std::size_t>
      value;  ///< index into TermSet::values; `terms` then names the term that reads the table

  double si_per_file_unit() const { return unit.si_per_file_unit(); }
  double get(const TermSet& set) const {
    return value ? set.values[*value] : set.terms[terms.front()].coefficient;
  }
  void set(TermSet& set, double si) const {
    if (value) {
      set.values[*value] = si;
    } else {
      for (const std::size_t t : terms) set.terms[t].coefficient = si;
    }
  }
};

/// Terms and what may be identified in them.
struct ParametricModel {
  TermSet set;
  std::vector<Parameter> parameters;
};

}  // namespace flexcomp::host
