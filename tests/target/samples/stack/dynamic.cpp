// SPDX-License-Identifier: Apache-2.0
// Refused by figures.py: a frame whose size is known only at run time.
void use(char*, int);
void use(char* p, int n) { p[n - 1] = 1; }
extern "C" int sample(int n) {
  char* p = static_cast<char*>(__builtin_alloca(static_cast<unsigned>(n)));
  use(p, n);
  return p[0];
}
