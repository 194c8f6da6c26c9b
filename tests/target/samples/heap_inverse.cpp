// SPDX-License-Identifier: Apache-2.0
// Refused at link time: a solve with a matrix right-hand side calls malloc even at fixed size.
#include <Eigen/Dense>
volatile int size = 1;
int main() {
  Eigen::Matrix<float, 6, 6> a = Eigen::Matrix<float, 6, 6>::Identity() * static_cast<float>(size);
  return static_cast<int>(a.inverse()(0, 0)) - 1;
}
