/* SPDX-License-Identifier: Apache-2.0 */
/* A controller with flexcomp in it, as a CANopen node: the smallest complete program. It corrects the joint
 * commands of a Staubli TX60L a thousand times a second and takes new parameter sets over CAN meanwhile.
 *
 * One loop does all. It looks at the clock before anything else, and between two looks it makes at most one call
 * into the library for the bus or the store. Bus traffic, however dense, therefore delays a cycle by no more than
 * the longest of these calls: a slice of the check of a set, at most 20,000 instructions, or a probe, which takes
 * as long as a step.
 *
 * Where your processor has a timer interrupt, control_cycle() belongs into it, and nothing delays it at all:
 * flexcomp_step() may interrupt everything else here at any point (flexcomp.h, "Threads"). It is polled here
 * because interrupts of the emulated Cortex-R5F were not seen to work. */
#include <flexcomp.h>

#include "canopen_board.h"
#include "tx60l.h"

enum { node = 1, heartbeat_ms = 1000 };

static flexcomp_memory memory;
static flexcomp_can_memory can_memory;

/* Where the motion planner wants the joints. Here the arm stands still; yours writes this every cycle. */
static flexcomp_real planned_rad[FLEXCOMP_JOINTS] = {0.25, -0.5, 1.25, 0.5, 0.75, -0.25};
/* What the drives are told. */
static volatile flexcomp_real drives_rad[FLEXCOMP_JOINTS];
/* For a debugger. */
static volatile flexcomp_status last_status;

static void control_cycle(flexcomp_arm* arm) {
  flexcomp_real q_rad[FLEXCOMP_JOINTS];
  int j;
  last_status = flexcomp_step(arm, planned_rad, NULL, q_rad);
  for (j = 0; j < FLEXCOMP_JOINTS; ++j) drives_rad[j] = q_rad[j];
}

int main(void) {
  flexcomp_settings settings;
  flexcomp_arm* arm;
  flexcomp_can* can;
  board_can_frame frame;
  unsigned turn = 0;

  board_init(node);
  flexcomp_settings_default(&settings);
  settings.cycle_us = 1000;
  arm = flexcomp_init(&memory, sizeof memory, &staubli_tx60l, &settings, board_storage);
  if (arm == NULL) return 1;
  can = flexcomp_can_init(&can_memory, sizeof can_memory, arm, node, heartbeat_ms, board_can_send, NULL);
  if (can == NULL) return 2;
  /* The newest valid set, else none: commands then pass through. */
  flexcomp_boot(arm);

  for (;;) {
    if (board_cycle_due()) {
      control_cycle(arm);
      continue;
    }
    switch (turn) {
      case 0: /* one frame, or none */
        if (board_can_receive(&frame)) flexcomp_can_receive(can, frame.id, frame.bytes, frame.size);
        break;
      case 1: /* heartbeat, timeouts, an answer that could not be sent */
        flexcomp_can_poll(can, board_now_ms());
        break;
      default: /* the next piece of a slot that is being written */
        flexcomp_poll(arm, board_now_ms());
        break;
    }
    turn = (turn + 1) % 3;
  }
}
