/* SPDX-License-Identifier: Apache-2.0 */
/* A whole controller in one file: the control cycle corrects joint commands in a timer interrupt, the background
 * serves Modbus RTU and the parameter store in what time is left. Plain C; what is particular to a board is
 * behind modbus_rtu_board.h, what measures the cycle is in cycle_monitor.h. */
#include <flexcomp.h>

#include "cycle_monitor.h"
#include "modbus_rtu_board.h"
#include "tx60l.h"

enum { UNIT = 1 }; /* of this controller on the bus */

static flexcomp_memory memory;
static flexcomp_rtu_memory rtu_memory;
static flexcomp_arm* arm;

/* --- the control cycle --------------------------------------------------------------------------- */

/* Where a robot has its path planner: the arm goes from one pose to another and back, smoothly, once in PATH_CYCLES. */
enum { PATH_CYCLES = 1000 };
static const flexcomp_real from_rad[FLEXCOMP_JOINTS] = {-0.35, -0.30, 1.20, -0.40, 0.70, -0.50};
static const flexcomp_real to_rad[FLEXCOMP_JOINTS] = {0.35, 0.25, 1.60, 0.40, 1.10, 0.50};
static volatile int standing; /* written by the background */

static void plan_command(flexcomp_real q_rad[FLEXCOMP_JOINTS]) {
  static uint32_t phase;
  const uint32_t half = PATH_CYCLES / 2;
  const uint32_t there = phase < half ? phase : PATH_CYCLES - phase;
  const flexcomp_real s = (flexcomp_real)there / (flexcomp_real)half;
  const flexcomp_real fraction = s * s * s * (10 + s * (6 * s - 15));
  for (unsigned j = 0; j < FLEXCOMP_JOINTS; ++j)
    q_rad[j] = from_rad[j] + (to_rad[j] - from_rad[j]) * fraction;
  if (!standing) phase = (phase + 1) % PATH_CYCLES;
}

static void control_cycle(void) {
  flexcomp_real q_command_rad[FLEXCOMP_JOINTS];
  flexcomp_real q_corrected_rad[FLEXCOMP_JOINTS];
  plan_command(q_command_rad);

  const uint32_t start = board_ticks();
  flexcomp_step(arm, q_command_rad, NULL, q_corrected_rad);
  const uint32_t end = board_ticks();

  /* Here q_corrected_rad goes to the drives. */

  monitor_cycle(start, end, flexcomp_step_flags(arm), q_command_rad, q_corrected_rad, board_cycle_is_late());
}

/* --- the background ------------------------------------------------------------------------------ */

static void send_to_bus(void* user, const uint8_t* bytes, size_t size) {
  (void)user;
  /* On a two-wire line: switch the transceiver to sending before and back to receiving after. */
  board_send(BOARD_BUS, bytes, size);
}

/* Whether the background waits by polling instead of sleeping: where time must not depend on how exactly a
 * sleeping processor is woken, as in an emulator. */
static int awake;

/* For a person, or a test, at the second serial line: one letter, one line of answer. */
static void serve_console(void) {
  static char report[MONITOR_REPORT_BYTES];
  uint8_t letter;
  if (board_receive(BOARD_CONSOLE, &letter, 1) == 0) return;
  switch (letter) {
    case 's':
      standing = 1;
      break;
    case 'm':
      standing = 0;
      break;
    case 'a':
      awake = 1;
      break;
    case 'w':
      awake = 0;
      break;
    case '0':
      monitor_clear();
      break;
    case '?':
      break;
    default:
      return;
  }
  board_send(BOARD_CONSOLE, (const uint8_t*)report, monitor_report(report, sizeof report));
}

int main(void) {
  flexcomp_settings settings;
  flexcomp_settings_default(&settings);
  settings.cycle_us = BOARD_CYCLE_US;
  /* Slow, so that a change of set sees the whole path. */
  settings.offset_rate_rad_s = (flexcomp_real)0.003;

  board_init();
  arm = flexcomp_init(&memory, sizeof memory, &staubli_tx60l, &settings, board_storage);
  if (arm == NULL) return 1;
  flexcomp_boot(arm);
  flexcomp_rtu* rtu =
      flexcomp_rtu_init(&rtu_memory, sizeof rtu_memory, arm, UNIT, board_bus_gap_us(), send_to_bus, NULL);
  if (rtu == NULL) return 1;
  board_start_cycle(control_cycle);

  for (;;) {
    uint8_t bytes[64];
    const size_t size = board_receive(BOARD_BUS, bytes, sizeof bytes);
    if (size != 0) {
      monitor_bus_heard();
      flexcomp_rtu_receive(rtu, bytes, size, board_now_us());
    }
    flexcomp_rtu_poll(rtu, board_now_us());

    flexcomp_state state;
    monitor_before_poll();
    flexcomp_poll(arm, board_now_ms());
    flexcomp_get_state(arm, &state);
    monitor_after_poll(&state);

    serve_console();
    if (!awake) board_sleep();
  }
}
