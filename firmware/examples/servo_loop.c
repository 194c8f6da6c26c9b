/* SPDX-License-Identifier: Apache-2.0 */
/* A servo loop with feed-forward: corrected position and corrected velocity for the drives, the way back from the encoders
 * for the start and for the following error. C90 with <stdint.h>, no operating system, no output.
 *
 * The drives are simulated: each follows the velocity that it is given and is pulled to the position. Ends with 0 where the
 * arm never jumped, follows its command closely, and stands at the end where the correction wants it.
 */
#include "tx60l.h"
#include "tx60l_set.h"

#define SEAL_BYTES 32
#define CYCLE_S ((flexcomp_real)0.001)

static uint8_t slot_bytes[FLEXCOMP_SLOT_BYTES];
static flexcomp_memory memory;
static flexcomp_arm* arm;

/* A slot that was filled on the production line; this program never writes one, so the other hooks are missing. */
static flexcomp_storage_result read_slot(void* user, unsigned slot, uint32_t offset, uint8_t* to,
                                         uint32_t size) {
  uint32_t k;
  (void)user;
  for (k = 0; k < size; ++k) to[k] = slot == 0 ? slot_bytes[offset + k] : 0xFF;
  return FLEXCOMP_STORAGE_DONE;
}

/* --- yours: the drives, here a simulation ------------------------------------------------------------------- */

static flexcomp_real encoder_rad[FLEXCOMP_JOINTS];

static void drives(const flexcomp_real q_rad[FLEXCOMP_JOINTS],
                   const flexcomp_real q_rate_rad_s[FLEXCOMP_JOINTS]) {
  unsigned j;
  for (j = 0; j < FLEXCOMP_JOINTS; ++j) {
    const flexcomp_real error = q_rad[j] - encoder_rad[j];
    encoder_rad[j] += (q_rate_rad_s[j] + 20 * error) * CYCLE_S;
  }
}

/* --- yours: the planner: there and back in two seconds, at rest at both ends ---------------------------------- */

static void plan(const flexcomp_real from[FLEXCOMP_JOINTS], uint32_t cycle,
                 flexcomp_real q_rad[FLEXCOMP_JOINTS], flexcomp_real q_rate_rad_s[FLEXCOMP_JOINTS]) {
  const flexcomp_real t = (flexcomp_real)cycle * CYCLE_S;
  const flexcomp_real s = t < 2 ? t * (2 - t) : 0; /* 0 ... 1 ... 0 */
  const flexcomp_real s_rate = t < 2 ? 2 - 2 * t : 0;
  unsigned j;
  for (j = 0; j < FLEXCOMP_JOINTS; ++j) {
    const flexcomp_real way = j % 2 == 0 ? (flexcomp_real)0.2 : (flexcomp_real)-0.2;
    q_rad[j] = from[j] + way * s * s;
    q_rate_rad_s[j] = way * 2 * s * s_rate;
  }
}

static flexcomp_real greatest_difference(const flexcomp_real a[FLEXCOMP_JOINTS],
                                         const flexcomp_real b[FLEXCOMP_JOINTS]) {
  flexcomp_real greatest = 0;
  unsigned j;
  for (j = 0; j < FLEXCOMP_JOINTS; ++j) {
    const flexcomp_real d = a[j] > b[j] ? a[j] - b[j] : b[j] - a[j];
    if (d > greatest) greatest = d;
  }
  return greatest;
}

int main(void) {
  flexcomp_storage storage;
  flexcomp_settings settings;
  flexcomp_diagnostics diagnostics;
  flexcomp_real from[FLEXCOMP_JOINTS];
  flexcomp_real planned[FLEXCOMP_JOINTS];
  flexcomp_real planned_rate[FLEXCOMP_JOINTS];
  flexcomp_real drive[FLEXCOMP_JOINTS];
  flexcomp_real drive_rate[FLEXCOMP_JOINTS];
  flexcomp_real seen[FLEXCOMP_JOINTS];
  flexcomp_real xyz_m[3];
  flexcomp_real wxyz[4];
  flexcomp_real following = 0;
  uint32_t cycle;
  uint32_t k;

  for (k = 0; k < FLEXCOMP_SLOT_BYTES; ++k) slot_bytes[k] = 0xFF;
  for (k = 0; k < sizeof tx60l_image; ++k) slot_bytes[k] = tx60l_image[k];
  for (k = 0; k < SEAL_BYTES; ++k) slot_bytes[FLEXCOMP_SLOT_BYTES - SEAL_BYTES + k] = tx60l_seal[k];
  storage.user = NULL;
  storage.read = read_slot;
  storage.erase = NULL;
  storage.write = NULL;
  flexcomp_settings_default(&settings);
  settings.cycle_us = 1000;
  settings.steepest = 20; /* the drives of this cell do not like fast corrections near singularities */
  arm = flexcomp_init(&memory, sizeof memory, &staubli_tx60l, &settings, &storage);
  if (arm == NULL) return 1;
  if (flexcomp_boot(arm) != 0) return 2;

  /* The start: the planner begins at the command that belongs to where the arm stands. */
  for (k = 0; k < FLEXCOMP_JOINTS; ++k) encoder_rad[k] = tx60l_corrected_rad[k];
  if (!flexcomp_uncorrect(arm, encoder_rad, NULL, from)) return 3;
  if (!flexcomp_start(arm, encoder_rad)) return 4;

  diagnostics.struct_size = sizeof diagnostics;
  for (cycle = 0; cycle < 2500; ++cycle) {
    flexcomp_real last[FLEXCOMP_JOINTS];
    for (k = 0; k < FLEXCOMP_JOINTS; ++k) last[k] = cycle == 0 ? encoder_rad[k] : drive[k];
    plan(from, cycle, planned, planned_rate);
    if (flexcomp_step_rate(arm, planned, planned_rate, NULL, drive, drive_rate) == FLEXCOMP_REFUSED) return 5;
    if (greatest_difference(drive, last) > (flexcomp_real)0.002) return 6; /* it never jumps */
    drives(drive, drive_rate);
    if (greatest_difference(drive, encoder_rad) > following)
      following = greatest_difference(drive, encoder_rad);
    if (!flexcomp_get_diagnostics(arm, &diagnostics)) return 7;
    /* The background, here every 10 ms: what a panel shows is the command that belongs to the encoders. */
    if (cycle % 10 != 0) continue;
    flexcomp_poll(arm, cycle);
    if (!flexcomp_uncorrect(arm, encoder_rad, NULL, seen)) return 8;
    if (greatest_difference(seen, planned) > (flexcomp_real)0.002) return 9;
    if (!flexcomp_tool_pose(arm, encoder_rad, NULL, xyz_m, wxyz)) return 10;
  }
  /* Without feed-forward the drives would be 0.3 / 20 rad behind. */
  if (following > (flexcomp_real)0.001) return 11;
  return diagnostics.status == FLEXCOMP_OK ? 0 : 12;
}
