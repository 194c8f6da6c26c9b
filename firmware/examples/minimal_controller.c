/* SPDX-License-Identifier: Apache-2.0 */
/* The smallest controller: one arm, two slots, a control cycle. C90 with <stdint.h>, no operating system, no output.
 *
 * It starts with a parameter set that lies in its non-volatile memory already (here: RAM, filled as a programmer would
 * fill flash on the production line), steps for some seconds, and ends with 0 where the corrected command is the one
 * that the host computes for the same set. A real controller never ends, and its sets come over a bus.
 */
#include "tx60l.h"
#include "tx60l_set.h"

/* --- non-volatile memory: replace these three by your flash driver ---------------------------------------- */

#define SEAL_BYTES 32

static uint8_t slots[2][FLEXCOMP_SLOT_BYTES];

static void copy(uint8_t* to, const uint8_t* from, uint32_t size) {
  uint32_t k;
  for (k = 0; k < size; ++k) to[k] = from[k];
}

static flexcomp_storage_result read_slot(void* user, unsigned slot, uint32_t offset, uint8_t* to,
                                         uint32_t size) {
  (void)user;
  copy(to, slots[slot] + offset, size);
  return FLEXCOMP_STORAGE_DONE;
}

static flexcomp_storage_result erase_slot(void* user, unsigned slot) {
  uint32_t k;
  (void)user;
  for (k = 0; k < FLEXCOMP_SLOT_BYTES; ++k) slots[slot][k] = 0xFF;
  return FLEXCOMP_STORAGE_DONE;
}

static flexcomp_storage_result write_slot(void* user, unsigned slot, uint32_t offset, const uint8_t* from,
                                          uint32_t size) {
  (void)user;
  copy(slots[slot] + offset, from, size);
  return FLEXCOMP_STORAGE_DONE;
}

/* --- the controller ----------------------------------------------------------------------------------------- */

/* All memory of the library: here, and nowhere else. */
static flexcomp_memory memory;
static flexcomp_arm* arm;

/* The timer interrupt: command of the motion planner in, command for the drives out. */
static flexcomp_status control_cycle(const flexcomp_real planned_rad[FLEXCOMP_JOINTS],
                                     flexcomp_real drive_rad[FLEXCOMP_JOINTS]) {
  return flexcomp_step(arm, planned_rad, NULL, drive_rad);
}

/* The main loop, whenever nothing else is to be done. */
static void background(uint32_t now_ms) { flexcomp_poll(arm, now_ms); }

int main(void) {
  flexcomp_storage storage;
  flexcomp_real planned_rad[FLEXCOMP_JOINTS];
  flexcomp_real drive_rad[FLEXCOMP_JOINTS];
  flexcomp_status status = FLEXCOMP_NO_SET;
  uint32_t cycle;
  unsigned joint;

  erase_slot(NULL, 0);
  erase_slot(NULL, 1);
  copy(slots[0], tx60l_image, sizeof tx60l_image);
  copy(slots[0] + FLEXCOMP_SLOT_BYTES - SEAL_BYTES, tx60l_seal, SEAL_BYTES);

  storage.user = NULL;
  storage.read = read_slot;
  storage.erase = erase_slot;
  storage.write = write_slot;
  arm = flexcomp_init(&memory, sizeof memory, &staubli_tx60l, NULL, &storage);
  if (arm == NULL) return 1;             /* the robot is not sensible, or the memory too small */
  if (flexcomp_boot(arm) != 0) return 2; /* no set: a real controller goes on and passes commands through */

  for (joint = 0; joint < FLEXCOMP_JOINTS; ++joint) planned_rad[joint] = tx60l_command_rad[joint];
  /* 1 kHz for two seconds. The correction starts at 0 and is the set's after some hundredths of a second; a real arm
   * tells where it stands by flexcomp_start and does not move at all. */
  for (cycle = 0; cycle < 2000; ++cycle) {
    status = control_cycle(planned_rad, drive_rad);
    if (cycle % 10 == 0) background(cycle);
  }

  if (status != FLEXCOMP_OK) return 3;
  for (joint = 0; joint < FLEXCOMP_JOINTS; ++joint) {
    /* The same to the last bit in double (tests/target shows it); float resolves less than 4e-6 rad of a joint. */
    const flexcomp_real off = drive_rad[joint] - tx60l_corrected_rad[joint];
    const flexcomp_real allowed = sizeof off == sizeof(double) ? (flexcomp_real)1e-12 : (flexcomp_real)4e-6;
    if (!(off <= allowed && -off <= allowed)) return 4;
  }
  return 0;
}
