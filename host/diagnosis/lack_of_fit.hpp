// SPDX-License-Identifier: Apache-2.0
/// \file
/// Lack of fit after a search (D14): whether and where a misfit is left that no named effect explains.
#ifndef FLEXCOMP_HOST_DIAGNOSIS_LACK_OF_FIT_HPP
#define FLEXCOMP_HOST_DIAGNOSIS_LACK_OF_FIT_HPP

#include "diagnosis/hypothesis.hpp"

namespace flexcomp::host {

/// Sets `unnamed` and `misfit`: of the largest unnamed function that was selected, else of a residual whose chi-square or
/// share at one place is beyond chance (D14).
void test_lack_of_fit(SearchResult& found);

}  // namespace flexcomp::host

#endif
