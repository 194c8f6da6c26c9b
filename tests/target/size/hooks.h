/* SPDX-License-Identifier: Apache-2.0 */
/* The least that a program has to bring: hooks that do nothing, and a robot that the compiler knows nothing of. */
#ifndef FLEXCOMP_TEST_SIZE_HOOKS_H
#define FLEXCOMP_TEST_SIZE_HOOKS_H

#include <flexcomp.h>

/* Set by nobody: these images are measured, not run. */
static const flexcomp_robot* volatile unknown_robot;

static flexcomp_storage_result read_slot(void* user, unsigned slot, uint32_t offset, uint8_t* to,
                                         uint32_t size) {
  (void)user, (void)slot, (void)offset, (void)to, (void)size;
  return FLEXCOMP_STORAGE_FAILED;
}
static flexcomp_storage_result erase_slot(void* user, unsigned slot) {
  (void)user, (void)slot;
  return FLEXCOMP_STORAGE_FAILED;
}
static flexcomp_storage_result write_slot(void* user, unsigned slot, uint32_t offset, const uint8_t* from,
                                          uint32_t size) {
  (void)user, (void)slot, (void)offset, (void)from, (void)size;
  return FLEXCOMP_STORAGE_FAILED;
}
static const flexcomp_storage storage = {NULL, read_slot, erase_slot, write_slot};

#endif
