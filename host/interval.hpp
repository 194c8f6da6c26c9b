// SPDX-License-Identifier: Apache-2.0
/// \file
/// Confidence interval.
#ifndef FLEXCOMP_HOST_INTERVAL_HPP
#define FLEXCOMP_HOST_INTERVAL_HPP

namespace flexcomp::host {

/// 95 % unless said otherwise, in the unit of what it is an interval of.
struct Interval {
  double low = 0;
  double high = 0;
};

}  // namespace flexcomp::host

#endif
