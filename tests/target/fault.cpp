// SPDX-License-Identifier: Apache-2.0
// An undefined instruction: the board's fault entry must end the run, not hang until a time limit.
int main() {
  asm volatile("udf #0");
  return 0;
}
