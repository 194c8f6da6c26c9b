/* SPDX-License-Identifier: Apache-2.0 */
/* Two arms in one program. C90 with <stdint.h>, no operating system, no output.
 *
 * Each arm has memory, slots and a context of its own; nothing is shared, so their cycles may run in different interrupts or
 * on different cores. The set comes in by bytes, as from a fieldbus that the library does not know or from a file, and one
 * arm's panel permits it only while its drives stand. Ends with 0 where one arm corrects and the other passes through.
 */
#include "tx60l.h"
#include "tx60l_set.h"

typedef struct arm_program {
  flexcomp_memory memory;
  flexcomp_arm* fc;
  uint8_t slots[2][FLEXCOMP_SLOT_BYTES];
  int drives_move;
  unsigned events; /* bits 1 << flexcomp_event */
} arm_program;

static arm_program left;
static arm_program right;

static flexcomp_storage_result read_slot(void* user, unsigned slot, uint32_t offset, uint8_t* to,
                                         uint32_t size) {
  const arm_program* arm = (const arm_program*)user;
  uint32_t k;
  for (k = 0; k < size; ++k) to[k] = arm->slots[slot][offset + k];
  return FLEXCOMP_STORAGE_DONE;
}

static flexcomp_storage_result erase_slot(void* user, unsigned slot) {
  arm_program* arm = (arm_program*)user;
  uint32_t k;
  for (k = 0; k < FLEXCOMP_SLOT_BYTES; ++k) arm->slots[slot][k] = 0xFF;
  return FLEXCOMP_STORAGE_DONE;
}

static flexcomp_storage_result write_slot(void* user, unsigned slot, uint32_t offset, const uint8_t* from,
                                          uint32_t size) {
  arm_program* arm = (arm_program*)user;
  uint32_t k;
  for (k = 0; k < size; ++k) arm->slots[slot][offset + k] = from[k];
  return FLEXCOMP_STORAGE_DONE;
}

/* Whoever asks: no other set while the drives move. */
static unsigned permit(void* user, unsigned command, unsigned is_local) {
  const arm_program* arm = (const arm_program*)user;
  (void)is_local;
  if (!arm->drives_move) return FLEXCOMP_ALLOW;
  return command != FLEXCOMP_COMMAND_COMMIT && command != FLEXCOMP_COMMAND_COMMIT_TRIAL &&
         command != FLEXCOMP_COMMAND_ROLLBACK && command != FLEXCOMP_COMMAND_RESTORE_DEFAULTS;
}

static void log_event(void* user, unsigned event, uint32_t detail) {
  (void)detail; /* a real one writes both, with the time */
  ((arm_program*)user)->events |= 1U << event;
}

static int start(arm_program* arm) {
  flexcomp_storage storage;
  flexcomp_hooks hooks;
  unsigned error;
  erase_slot(arm, 0);
  erase_slot(arm, 1);
  storage.user = arm;
  storage.read = read_slot;
  storage.erase = erase_slot;
  storage.write = write_slot;
  arm->fc = flexcomp_init_explained(&arm->memory, sizeof arm->memory, &staubli_tx60l, NULL, &storage, &error);
  if (arm->fc == NULL) return 0; /* flexcomp_init_error_text(error) says why */
  hooks.user = arm;
  hooks.permit = permit;
  hooks.log = log_event;
  flexcomp_set_hooks(arm->fc, &hooks);
  flexcomp_boot(arm->fc);
  return 1;
}

/* The set of tx60l_set.h in portions, as mailbox messages bring them. */
static unsigned receive_set(arm_program* arm) {
  const uint32_t size = sizeof tx60l_image;
  unsigned answer = flexcomp_stage_begin(arm->fc, size);
  uint32_t at;
  for (at = 0; answer == 0 && at < size; at += 64) {
    const uint32_t portion = size - at < 64 ? size - at : 64;
    answer = flexcomp_stage_write(arm->fc, at, tx60l_image + at, portion);
  }
  return answer;
}

int main(void) {
  flexcomp_real left_rad[FLEXCOMP_JOINTS];
  flexcomp_real right_rad[FLEXCOMP_JOINTS];
  flexcomp_status left_status = FLEXCOMP_REFUSED;
  flexcomp_status right_status = FLEXCOMP_REFUSED;
  flexcomp_state state;
  uint32_t now_ms;
  unsigned joint;

  if (!start(&left) || !start(&right)) return 1;
  if (receive_set(&left) != 0) return 2;
  left.drives_move = 1;
  if (flexcomp_stage_commit(left.fc) != 4) return 3; /* not authorised */
  left.drives_move = 0;
  if (flexcomp_stage_commit(left.fc) != 0) return 4;

  /* Two cycles of 1 kHz and the background of both, for two seconds. */
  for (now_ms = 0; now_ms < 2000; ++now_ms) {
    left_status = flexcomp_step(left.fc, tx60l_command_rad, NULL, left_rad);
    right_status = flexcomp_step(right.fc, tx60l_command_rad, NULL, right_rad);
    flexcomp_poll(left.fc, now_ms);
    flexcomp_poll(right.fc, now_ms);
  }
  flexcomp_get_state(left.fc, &state);
  if (state.active_sequence == 0 || left_status != FLEXCOMP_OK) return 5;
  if ((left.events & (1U << FLEXCOMP_EVENT_ACTIVATED)) == 0) return 6;
  if (right_status != FLEXCOMP_NO_SET || right.events != (1U << FLEXCOMP_EVENT_BOOTED)) return 7;
  for (joint = 0; joint < FLEXCOMP_JOINTS; ++joint) {
    const flexcomp_real off = left_rad[joint] - tx60l_corrected_rad[joint];
    const flexcomp_real allowed = sizeof off == sizeof(double) ? (flexcomp_real)1e-12 : (flexcomp_real)4e-6;
    if (!(off <= allowed && -off <= allowed)) return 8;
    if (right_rad[joint] < tx60l_command_rad[joint] || right_rad[joint] > tx60l_command_rad[joint]) return 9;
  }
  return 0;
}
