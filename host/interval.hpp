// SPDX-License-Identifier: Apache-2.0
/// \file
/// Confidence interval.
#pragma once

namespace flexcomp::host {

/// 95 % unless said otherwise, in the unit of what it is an interval of.
struct Interval {
  double low = 0;
  double high = 0;
};

}  // namespace flexcomp::host
