// SPDX-License-Identifier: Apache-2.0
// Refused by figures.py: a frame that is larger than the control cycle's stack.
void use(volatile float*);
void use(volatile float* p) { p[0] = 1; }
extern "C" int sample() {
  volatile float values[1000];
  use(values);
  return static_cast<int>(values[0]);
}
