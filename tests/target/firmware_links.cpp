// SPDX-License-Identifier: Apache-2.0
// The library itself is what is looked at, by the link-time rules; see CMakeLists.txt.
int main() { return 0; }
