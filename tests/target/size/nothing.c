/* SPDX-License-Identifier: Apache-2.0 */
/* What an image holds before the library comes in: the board's start. */
int main(void) { return 0; }
