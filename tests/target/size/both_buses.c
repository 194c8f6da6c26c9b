/* SPDX-License-Identifier: Apache-2.0 */
/* The same with a CANopen node and a Modbus RTU line. */
#include "hooks.h"

static flexcomp_memory memory;
static flexcomp_can_memory can_memory;
static flexcomp_rtu_memory rtu_memory;

static int send_frame(void* user, uint16_t id, const uint8_t* bytes, uint8_t size) {
  (void)user, (void)id, (void)bytes, (void)size;
  return 1;
}
static void send_bytes(void* user, const uint8_t* bytes, size_t size) { (void)user, (void)bytes, (void)size; }

int main(void) {
  flexcomp_real q[FLEXCOMP_JOINTS] = {0};
  flexcomp_context context;
  flexcomp_state state;
  uint8_t frame[8] = {0};
  flexcomp_arm* fc = flexcomp_init(&memory, sizeof memory, unknown_robot, NULL, &storage);
  flexcomp_can* can = flexcomp_can_init(&can_memory, sizeof can_memory, fc, 1, 1000, send_frame, NULL);
  flexcomp_rtu* rtu = flexcomp_rtu_init(&rtu_memory, sizeof rtu_memory, fc, 1, 1750, send_bytes, NULL);
  flexcomp_boot(fc);
  flexcomp_context_default(fc, &context);
  flexcomp_step(fc, q, &context, q);
  flexcomp_poll(fc, 1);
  flexcomp_can_receive(can, 0x601, frame, sizeof frame);
  flexcomp_can_poll(can, 1);
  flexcomp_rtu_receive(rtu, frame, sizeof frame, 1);
  flexcomp_rtu_poll(rtu, 1);
  flexcomp_get_state(fc, &state);
  return (int)flexcomp_command(fc, state.store);
}
