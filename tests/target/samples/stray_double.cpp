// SPDX-License-Identifier: Apache-2.0
// Refused after the link on a float unit: one double constant, and the arithmetic happens in software.
volatile float input = 2.0F;
int main() { return static_cast<int>(input * 0.5) - 1; }
