// SPDX-License-Identifier: Apache-2.0
// An index beyond a vector: Eigen's assertion must end in the firmware's fault hook.
#include "flexcomp/linear.hpp"

volatile int beyond = 3;
int main() {
  const flexcomp::Vector3<float> v = flexcomp::Vector3<float>::Zero();
  return static_cast<int>(v[beyond]);
}
