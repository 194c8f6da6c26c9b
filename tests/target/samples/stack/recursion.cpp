// SPDX-License-Identifier: Apache-2.0
// Refused by figures.py: how deep it goes depends on the data.
volatile int depth = 3;
[[gnu::noipa]] int other();
extern "C" [[gnu::noipa]] int sample() { return depth == 0 ? 0 : other() + 1; }
int other() {
  depth = depth - 1;
  return sample() * 3;
}
