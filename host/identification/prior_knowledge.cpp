// SPDX-License-Identifier: Apache-2.0
#include "identification/prior_knowledge.hpp"

#include "model/effects/descriptor.hpp"

#include <cstddef>

namespace flexcomp::host {

std::vector<PriorKnowledge> prior_knowledge(const TermSet& set, const std::vector<Parameter>& parameters,
                                            bool physical, const std::vector<Tolerance>& tolerances) {
  std::vector<PriorKnowledge> list(parameters.size());
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    const EffectDescriptor& d = descriptor(set.terms[parameters[p].terms.front()].effect);
    if (physical && d.in_paper_model && d.is_nonnegative) list[p].least = 0;
  }
  for (const Tolerance& tolerance : tolerances) {
    for (const std::size_t p : parameters_meant(tolerance, parameters)) {
      list[p].expected = tolerance.expected * parameters[p].si_per_file_unit();
      list[p].tolerance = tolerance.sigma * parameters[p].si_per_file_unit();
    }
  }
  return list;
}

}  // namespace flexcomp::host
