// SPDX-License-Identifier: Apache-2.0
// Refused by figures.py: a call of whatever a pointer points to.
extern "C" int sample(int (*hook)(int)) { return hook(1) + 1; }
