/* SPDX-License-Identifier: Apache-2.0 */
/* A controller elsewhere, with nothing but the installed flexcomp.h: without a set it passes commands through, and
 * says so. */
#include <flexcomp.h>

static flexcomp_memory memory;
static flexcomp_can_memory can_memory;

static unsigned frames;

static int send_frame(void* user, uint16_t id, const uint8_t* bytes, uint8_t size) {
  (void)user;
  (void)bytes;
  if (id == 0x701 && size == 1) ++frames; /* the boot-up message of node 1 */
  return 1;
}

int main(void) {
  static flexcomp_robot robot;
  const flexcomp_real command[FLEXCOMP_JOINTS] = {0, 1, 0, -1, 1, 0};
  flexcomp_real corrected[FLEXCOMP_JOINTS];
  flexcomp_arm* arm;
  flexcomp_can* can;
  unsigned j;
  flexcomp_robot_default(&robot);
  robot.name = "consumer";
  arm = flexcomp_init(&memory, sizeof memory, &robot, NULL, NULL);
  if (arm == NULL) return 1;
  can = flexcomp_can_init(&can_memory, sizeof can_memory, arm, 1, 0, send_frame, NULL);
  if (can == NULL) return 2;
  if (flexcomp_boot(arm) != 1) return 3;
  flexcomp_can_poll(can, 0);
  if (frames != 1) return 4;
  if (flexcomp_step(arm, command, NULL, corrected) != FLEXCOMP_NO_SET) return 5;
  for (j = 0; j < FLEXCOMP_JOINTS; ++j)
    if (corrected[j] < command[j] || corrected[j] > command[j]) return 6;
  return 0;
}
