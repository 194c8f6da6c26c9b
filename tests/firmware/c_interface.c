/* SPDX-License-Identifier: Apache-2.0 */
/* A controller in C99 that sees nothing but flexcomp.h: builds an arm, takes a set in over Modbus TCP, keeps it in a
 * memory of its own, and starts again from it. Ends with 0 where all went as documented. */
#include "flexcomp.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static unsigned failures;

static void expect(int ok, const char* what, int line) {
  if (ok) return;
  ++failures;
  printf("line %d: %s\n", line, what);
}
#define EXPECT(condition) expect((condition) != 0, #condition, __LINE__)

static uint8_t slots[2][FLEXCOMP_SLOT_BYTES];

static flexcomp_storage_result read_slot(void* user, unsigned slot, uint32_t offset, uint8_t* to,
                                         uint32_t size) {
  (void)user;
  memcpy(to, slots[slot] + offset, size);
  return FLEXCOMP_STORAGE_DONE;
}

/* Busy every other time, as flash is. */
static flexcomp_storage_result erase_slot(void* user, unsigned slot) {
  unsigned* calls = user;
  if (++*calls % 2 != 0) return FLEXCOMP_STORAGE_BUSY;
  memset(slots[slot], 0xFF, sizeof slots[slot]);
  return FLEXCOMP_STORAGE_DONE;
}

static flexcomp_storage_result write_slot(void* user, unsigned slot, uint32_t offset, const uint8_t* from,
                                          uint32_t size) {
  unsigned* calls = user;
  if (++*calls % 2 != 0) return FLEXCOMP_STORAGE_BUSY;
  memcpy(slots[slot] + offset, from, size);
  return FLEXCOMP_STORAGE_DONE;
}

static uint8_t answer[512];
static size_t answer_size;

static void send_bytes(void* user, const uint8_t* bytes, size_t size) {
  (void)user;
  memcpy(answer, bytes, size);
  answer_size = size;
}

static uint16_t frames[16];
static uint8_t last_frame[8];
static unsigned frame_count;

static int send_frame(void* user, uint16_t id, const uint8_t* bytes, uint8_t size) {
  (void)user;
  memset(last_frame, 0, sizeof last_frame);
  memcpy(last_frame, bytes, size);
  if (frame_count < 16) frames[frame_count++] = id;
  return 1;
}

static uint8_t communication[8];

static int load_communication(void* user, uint8_t* bytes) {
  (void)user;
  memcpy(bytes, communication, sizeof communication);
  return 1;
}

static int save_communication(void* user, const uint8_t* bytes) {
  (void)user;
  memcpy(communication, bytes, sizeof communication);
  return 1;
}

static uint32_t crc32_of(const uint8_t* bytes, size_t size) {
  uint32_t crc = 0xFFFFFFFFu;
  size_t i;
  for (i = 0; i < size; ++i) {
    unsigned k;
    crc ^= bytes[i];
    for (k = 0; k < 8; ++k) crc = (crc >> 1) ^ ((crc & 1u) != 0 ? 0xEDB88320u : 0u);
  }
  return ~crc;
}

static void put16(uint8_t* p, unsigned v) {
  p[0] = (uint8_t)(v >> 8);
  p[1] = (uint8_t)v;
}

/* One request over Modbus TCP; returns the function code of the answer. */
static unsigned ask(flexcomp_tcp* tcp, const uint8_t* pdu, size_t size) {
  uint8_t frame[300];
  memset(frame, 0, sizeof frame);
  put16(frame + 4, (unsigned)size + 1u);
  frame[6] = 1;
  memcpy(frame + 7, pdu, size);
  answer_size = 0;
  EXPECT(flexcomp_tcp_receive(tcp, frame, size + 7) == 1);
  return answer_size < 8 ? 0 : answer[7];
}

static unsigned run(flexcomp_tcp* tcp, unsigned command, unsigned argument) {
  uint8_t pdu[12] = {0x10, 0x00, 0xA0, 0, 3, 6, 0, 0, 0, 0, 0, 0};
  put16(pdu + 8, argument);
  put16(pdu + 10, command);
  return ask(tcp, pdu, sizeof pdu);
}

int main(void) {
  static flexcomp_memory memory;
  static flexcomp_can_memory can_memory;
  static flexcomp_rtu_memory rtu_memory;
  static flexcomp_tcp_memory tcp_memory;
  static const double table[6][4] = {{0, 0, 0, -1.57079632679489662},
                                     {-1.57079632679489662, 0, 0.4, 0},
                                     {1.57079632679489662, 0.02, 0, 1.57079632679489662},
                                     {0, 0.45, 0, -1.57079632679489662},
                                     {0, 0, 0, 1.57079632679489662},
                                     {0, 0.07, 0, 0}};
  unsigned calls = 0;
  flexcomp_storage storage;
  flexcomp_robot robot;
  flexcomp_settings settings;
  flexcomp_context context;
  flexcomp_state state;
  flexcomp_arm* fc;
  flexcomp_tcp* tcp;
  flexcomp_rtu* rtu;
  flexcomp_can* can;
  flexcomp_real q[FLEXCOMP_JOINTS] = {0};
  flexcomp_real out[FLEXCOMP_JOINTS];
  uint8_t image[100];
  uint8_t pdu[128];
  uint32_t now;
  unsigned j;

  memset(slots, 0xFF, sizeof slots);
  storage.user = &calls;
  storage.read = read_slot;
  storage.erase = erase_slot;
  storage.write = write_slot;

  flexcomp_robot_default(&robot);
  EXPECT(flexcomp_init(&memory, sizeof memory, &robot, NULL, &storage) == NULL); /* no name */
  robot.name = "c-arm";
  for (j = 0; j < 6; ++j) {
    robot.links[j].theta_rad = table[j][0];
    robot.links[j].d_m = table[j][1];
    robot.links[j].a_m = table[j][2];
    robot.links[j].alpha_rad = table[j][3];
  }
  EXPECT(flexcomp_init(NULL, sizeof memory, &robot, NULL, &storage) == NULL);
  EXPECT(flexcomp_init(&memory, 100, &robot, NULL, &storage) == NULL);
  EXPECT(flexcomp_init(memory.bytes + 1, sizeof memory - 1, &robot, NULL, &storage) == NULL);
  robot.links[2].a_m = HUGE_VAL;
  EXPECT(flexcomp_init(&memory, sizeof memory, &robot, NULL, &storage) == NULL);
  robot.links[2].a_m = 0;
  robot.tool_wxyz[0] = 0.9;
  EXPECT(flexcomp_init(&memory, sizeof memory, &robot, NULL, &storage) == NULL);
  robot.tool_wxyz[0] = 1;
  robot.max_rad[0] = robot.min_rad[0];
  EXPECT(flexcomp_init(&memory, sizeof memory, &robot, NULL, &storage) == NULL);
  robot.max_rad[0] = 3;

  memset(&settings, 0, sizeof settings);
  {
    unsigned error = 0;
    EXPECT(flexcomp_init_explained(&memory, sizeof memory, &robot, &settings, &storage, &error) == NULL);
    EXPECT(error == FLEXCOMP_INIT_SETTINGS && strlen(flexcomp_init_error_text(error)) > 10);
  }
  flexcomp_settings_default(&settings);
  EXPECT(settings.struct_size == sizeof settings);
  settings.cycle_us = 0;
  EXPECT(flexcomp_init(&memory, sizeof memory, &robot, &settings, &storage) == NULL);
  settings.cycle_us = 2000;
  settings.correction_rate_rad_s[5] = 0;
  EXPECT(flexcomp_init(&memory, sizeof memory, &robot, &settings, &storage) == NULL);
  settings.correction_rate_rad_s[5] = (flexcomp_real)NAN;
  EXPECT(flexcomp_init(&memory, sizeof memory, &robot, &settings, &storage) == NULL);
  settings.correction_rate_rad_s[5] = 2;
  settings.offset_rate_rad_s = -1;
  EXPECT(flexcomp_init(&memory, sizeof memory, &robot, &settings, &storage) == NULL);
  settings.offset_rate_rad_s = 1;
  settings.offset_acceleration_rad_s2 = 0;
  EXPECT(flexcomp_init(&memory, sizeof memory, &robot, &settings, &storage) == NULL);
  settings.offset_acceleration_rad_s2 = 20;
  fc = flexcomp_init(&memory, sizeof memory, &robot, &settings, &storage);
  EXPECT(fc != NULL);
  if (fc == NULL) return 1;
  EXPECT(flexcomp_boot(fc) == 1); /* no valid set */
  flexcomp_context_default(fc, &context);
  EXPECT(flexcomp_step(fc, q, &context, out) == FLEXCOMP_NO_SET);
  EXPECT(memcmp(q, out, sizeof q) == 0);
  EXPECT(flexcomp_step(fc, q, NULL, q) == FLEXCOMP_NO_SET);

  EXPECT(flexcomp_can_init(&can_memory, sizeof can_memory, fc, 128, 0, send_frame, NULL) == NULL);
  can = flexcomp_can_init(&can_memory, sizeof can_memory, fc, 3, 1000, send_frame, NULL);
  flexcomp_can_set_memory(can, load_communication, save_communication, &calls);
  flexcomp_can_set_block_size(can, 16);
  EXPECT(flexcomp_can_channel(can) == 0);
  EXPECT(flexcomp_can_set_channel(can, 0x603, 0x6B2) == 0);
  EXPECT(flexcomp_can_set_channel(can, 0x80000682U, 0x6B2) == 0);
  EXPECT(flexcomp_can_channel(can) == 0);
  EXPECT(flexcomp_can_set_channel(can, 0x682, 0x6B2) != 0);
  EXPECT(flexcomp_can_channel(can) == 0x682);
  flexcomp_can_poll(can, 0);
  /* Boot-up message, EMCY: no valid set. */
  EXPECT(frame_count == 2 && frames[0] == 0x703 && frames[1] == 0x083);
  {
    const uint8_t upload[8] = {0x40, 0x00, 0x10, 0, 0, 0, 0, 0};
    flexcomp_can_receive(can, 0x603, upload, 8);
    EXPECT(frame_count == 3 && frames[2] == 0x583);
  }
  {
    /* 1010h:2 "save": heartbeat time 1000 ms, inhibit time 100 ms, CRC. */
    const uint8_t save[8] = {0x23, 0x10, 0x10, 2, 's', 'a', 'v', 'e'};
    const uint8_t begin[8] = {0xC4, 0x10, 0x20, 1, 0, 0, 0, 0};
    flexcomp_can_receive(can, 0x603, save, 8);
    EXPECT(frame_count == 4 && communication[0] == 1 && communication[2] == 0xE8 && communication[3] == 3);
    flexcomp_can_receive(can, 0x603, begin, 8);
    EXPECT(frame_count == 5 && last_frame[0] == 0xA4 && last_frame[4] == 16);
    {
      const uint8_t end[8] = {0x80, 0x10, 0x20, 1, 0, 0, 0, 8};
      flexcomp_can_receive(can, 0x603, end, 8);
      EXPECT(frame_count == 5);
    }
  }

  EXPECT(flexcomp_rtu_init(&rtu_memory, sizeof rtu_memory, fc, 248, 1750, send_bytes, NULL) == NULL);
  rtu = flexcomp_rtu_init(&rtu_memory, sizeof rtu_memory, fc, 1, 1750, send_bytes, NULL);
  {
    const uint8_t request[8] = {1, 3, 0, 0, 0, 1, 0x84, 0x0A};
    flexcomp_rtu_receive(rtu, request, sizeof request, 0);
    EXPECT(answer_size == 7 && answer[0] == 1 && answer[1] == 3 && answer[3] == 1);
    flexcomp_rtu_poll(rtu, 10000);
    flexcomp_rtu_line_error(rtu, 1);
  }

  tcp = flexcomp_tcp_init(&tcp_memory, sizeof tcp_memory, fc, 1, send_bytes, NULL);
  memset(image, 0, sizeof image);
  memcpy(image, "FLXC", 4);
  image[4] = 1;
  image[6] = 96;
  image[8] = 100;
  image[12] = 1;
  {
    /* The hashes of the capability record are what a set must carry. */
    const uint8_t read[5] = {3, 0, 0, 0, 64};
    EXPECT(ask(tcp, read, sizeof read) == 3);
    memcpy(image + 16, answer + 9 + 40, 64);
  }
  {
    const uint32_t crc = crc32_of(image, 96);
    for (j = 0; j < 4; ++j) image[96 + j] = (uint8_t)(crc >> (8 * j));
  }
  EXPECT(run(tcp, 1, sizeof image) == 0x10);
  memset(pdu, 0, sizeof pdu);
  pdu[0] = 0x10;
  put16(pdu + 1, 0x100);
  put16(pdu + 3, 52);
  pdu[5] = 104;
  memcpy(pdu + 10, image, sizeof image);
  EXPECT(ask(tcp, pdu, 110) == 0x10);
  EXPECT(run(tcp, 3, 0) == 0x10);
  for (now = 0; now < 100; ++now) {
    flexcomp_poll(fc, now);
    flexcomp_step(fc, q, &context, out);
  }
  flexcomp_get_state(fc, &state);
  EXPECT(state.active_sequence == 1 && state.active_bytes == sizeof image && state.faults == 0);
  EXPECT(strcmp(flexcomp_answer_text(state.answer), "accepted") == 0);
  EXPECT(flexcomp_step(fc, q, &context, out) != FLEXCOMP_NO_SET);
  for (j = 0; j < 6; ++j)
    EXPECT(fabs((double)(out[j] - q[j])) < 1e-6); /* a set without terms corrects nothing */

  /* Half a transfer, and the connection goes. */
  EXPECT(run(tcp, 1, 200) == 0x10);
  flexcomp_tcp_reset(tcp);
  flexcomp_get_state(fc, &state);
  EXPECT(state.store == 0);
  {
    const uint8_t rubbish[12] = {0, 0, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9};
    EXPECT(flexcomp_tcp_receive(tcp, rubbish, sizeof rubbish) == 0);
    flexcomp_tcp_reset(tcp);
  }
  /* Connections come and go while CAN stages: none of them is ever taken for the CAN node. */
  {
    const uint8_t download[8] = {0x21, 0x10, 0x20, 1, 200, 0, 0, 0};
    const uint8_t abort[8] = {0x80, 0x10, 0x20, 1, 0, 0, 0, 8};
    flexcomp_can_receive(can, 0x603, download, 8);
    for (j = 0; j < 600; ++j) {
      tcp = flexcomp_tcp_init(&tcp_memory, sizeof tcp_memory, fc, 1, send_bytes, NULL);
      flexcomp_tcp_reset(tcp);
    }
    flexcomp_get_state(fc, &state);
    EXPECT(state.store == 1);
    EXPECT(run(tcp, 7, 0) == 0x90);
    flexcomp_can_receive(can, 0x603, abort, 8);
    flexcomp_get_state(fc, &state);
    EXPECT(state.store == 0);
  }
  EXPECT(flexcomp_command(fc, FLEXCOMP_COMMAND_ROLLBACK) == 7);

  /* The calls beside the step. */
  {
    static const flexcomp_real rate[FLEXCOMP_JOINTS] = {1, 0, 0, 0, 0, (flexcomp_real)0.5};
    flexcomp_real out_rate[FLEXCOMP_JOINTS];
    flexcomp_real wxyz[4];
    flexcomp_diagnostics diagnostics;
    diagnostics.struct_size = 0;
    EXPECT(flexcomp_get_diagnostics(fc, &diagnostics) == 0);
    diagnostics.struct_size = sizeof diagnostics;
    for (j = 0; j < 6; ++j) q[j] = (flexcomp_real)(0.2 + 0.1 * j);
    for (j = 0; j < 2000; ++j) flexcomp_step_rate(fc, q, rate, NULL, out, out_rate);
    EXPECT(flexcomp_step_flags(fc) == 0);
    for (j = 0; j < 6; ++j) EXPECT(fabs((double)(out_rate[j] - rate[j])) < 1e-5); /* a set without terms */
    EXPECT(flexcomp_get_diagnostics(fc, &diagnostics) == 1 && diagnostics.status == FLEXCOMP_OK);
    EXPECT(diagnostics.cycles > 2000 && diagnostics.remaining_position_m < 1e-6);
    EXPECT(flexcomp_uncorrect(fc, q, NULL, out) == 1 && fabs((double)(out[3] - q[3])) < 1e-5);
    EXPECT(flexcomp_tool_pose(fc, q, &context, out, wxyz) == 1);
    EXPECT(fabs((double)(wxyz[0] * wxyz[0] + wxyz[1] * wxyz[1] + wxyz[2] * wxyz[2] + wxyz[3] * wxyz[3]) - 1) <
           1e-5);
    EXPECT(flexcomp_joint_loads(fc, q, &context, out, out_rate) == 1 && fabs((double)out_rate[1]) < 1e-12);
    EXPECT(flexcomp_stage_begin(fc, sizeof image) == 0);
    EXPECT(flexcomp_stage_write(fc, 0, image, sizeof image) == 0);
    flexcomp_stage_verify(fc);
    for (now = 0; now < 100; ++now) flexcomp_poll(fc, now);
    flexcomp_get_state(fc, &state);
    EXPECT(state.answer == 1 && state.refusal == 17); /* the sequence is not above the active one */
    for (j = 0; j < 6; ++j) q[j] = 0;
  }

  /* The next start. */
  fc = flexcomp_init(&memory, sizeof memory, &robot, NULL, &storage);
  EXPECT(flexcomp_boot(fc) == 0);
  flexcomp_get_state(fc, &state);
  EXPECT(state.active_sequence == 1);

  q[0] = (flexcomp_real)NAN;
  EXPECT(flexcomp_step(fc, q, NULL, out) == FLEXCOMP_REFUSED);
  EXPECT(strcmp(flexcomp_status_text(FLEXCOMP_NEAR_SINGULAR), "near_singular") == 0);
  EXPECT(strcmp(flexcomp_refusal_text(999), "unknown refusal") == 0);
  EXPECT(strlen(flexcomp_version()) >= 5);
  printf("%u failures\n", failures);
  return failures == 0 ? 0 : 1;
}
