// SPDX-License-Identifier: Apache-2.0
// Refused after the build: an exception, although this file alone was compiled with them.
struct Failure {
  int code;
};
volatile int input = 0;
int main() {
  try {
    if (input == 0) throw Failure{1};
  } catch (const Failure& failure) {
    return failure.code;
  }
  return 0;
}
