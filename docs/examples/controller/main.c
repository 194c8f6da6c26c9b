/* A controller with flexcomp in it, to be made yours: docs/firmware.md. */
#include <flexcomp.h>

#include "robot.h"        /* written by: flexcomp export --robot ROBOT.yaml --as c -o robot.h */
#include "slots_in_ram.h" /* yours: read, erase and write two slots of your flash */

static flexcomp_memory memory;
static flexcomp_can_memory can_memory;
static flexcomp_arm* arm;
static flexcomp_can* can;

/* Yours: puts a frame into a mailbox of your CAN controller; 0 where none is free. */
static int send_frame(void* user, uint16_t id, const uint8_t* bytes, uint8_t size) {
  (void)user;
  (void)id;
  (void)bytes;
  (void)size;
  return 1;
}

/* Yours: takes the next frame out of the queue that your CAN interrupt fills; 0 where there is none. */
static int receive_frame(uint16_t* id, uint8_t bytes[8], size_t* size) {
  static volatile int frames_waiting; /* nothing is connected to the emulated board */
  if (frames_waiting == 0) return 0;
  *id = 0;
  bytes[0] = 0;
  *size = 1;
  return 1;
}

/* Yours: the timer interrupt. Here main() calls it. */
static flexcomp_status every_millisecond(flexcomp_real q_rad[FLEXCOMP_JOINTS]) {
  return flexcomp_step(arm, q_rad, NULL, q_rad); /* the command of your planner in, that for the drives out */
}

/* Yours: where the encoders say that the arm stands. */
static const flexcomp_real standing_rad[FLEXCOMP_JOINTS] = {0.1f, -0.2f, 1.2f, 0.3f, 0.4f, 0.5f};

int main(void) {
  uint32_t now_ms;
  uint16_t id;
  uint8_t bytes[8];
  size_t size;
  flexcomp_status status = FLEXCOMP_REFUSED;
  arm = flexcomp_init(&memory, sizeof memory, &staubli_tx60l, NULL, &flexcomp_slots_in_ram);
  if (arm == NULL) return 1;
  can = flexcomp_can_init(&can_memory, sizeof can_memory, arm, 1, 1000, send_frame, NULL);
  if (can == NULL) return 2;
  flexcomp_boot(arm); /* the newest valid set of the two slots; none: commands pass through */
  if (!flexcomp_start(arm, standing_rad)) return 4; /* before the drives are switched on: then nothing moves */

  /* Yours: for (;;), with your clock. Here a second of it, so that the image ends by itself in the emulator. */
  for (now_ms = 0; now_ms < 1000; ++now_ms) {
    flexcomp_real q_rad[FLEXCOMP_JOINTS] = {0.1f, -0.2f, 1.2f, 0.3f, 0.4f, 0.5f};
    status = every_millisecond(q_rad);
    flexcomp_poll(arm, now_ms);
    while (receive_frame(&id, bytes, &size)) flexcomp_can_receive(can, id, bytes, size);
    flexcomp_can_poll(can, now_ms);
  }
  return status == FLEXCOMP_NO_SET ? 0 : 3; /* nobody has pushed a set yet */
}
