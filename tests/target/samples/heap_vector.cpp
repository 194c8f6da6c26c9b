// SPDX-License-Identifier: Apache-2.0
// Refused at link time: a container with a heap behind it.
#include <vector>
volatile unsigned count = 3;
int main() {
  std::vector<int> values(count, 1);
  return values[1] - 1;
}
