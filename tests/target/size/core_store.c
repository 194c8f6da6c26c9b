/* SPDX-License-Identifier: Apache-2.0 */
/* Core and parameter store, no bus: a controller that is loaded by other means. Every call of such a
 * controller but the texts for people. */
#include "hooks.h"

static flexcomp_memory memory;

int main(void) {
  flexcomp_real q[FLEXCOMP_JOINTS] = {0};
  flexcomp_context context;
  flexcomp_state state;
  flexcomp_arm* fc = flexcomp_init(&memory, sizeof memory, unknown_robot, NULL, &storage);
  flexcomp_boot(fc);
  flexcomp_context_default(fc, &context);
  flexcomp_step(fc, q, &context, q);
  flexcomp_poll(fc, 1);
  flexcomp_get_state(fc, &state);
  return (int)flexcomp_command(fc, state.store);
}
