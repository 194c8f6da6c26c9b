/* SPDX-License-Identifier: Apache-2.0 */
/* canopen_board.h on a Cortex-R5F of the Zynq UltraScale+ (the ZCU102 board). */
#include "canopen_board.h"
#include "machine.h"
#include "slots_in_ram.h"
#include "zynqmp_can.h"

/* The processor counts its own cycles; QEMU counts nanoseconds in their place. */
#if FLEXCOMP_ZYNQMP_IN_QEMU
#define COUNTS_PER_MS 1000000U
#else
#define COUNTS_PER_MS 500000U
#endif
#define COUNTS_PER_CYCLE COUNTS_PER_MS /* 1 kHz */

static uint64_t next_cycle;

/* Control periods that could not be served since the start; for a debugger. */
volatile uint32_t board_periods_left_out;

/* PMCR: count, from zero, every cycle; PMCNTENSET: the cycle counter. */
static void start_counter(void) {
  __asm__ volatile("mcr p15, 0, %0, c9, c12, 0" ::"r"(5U));
  __asm__ volatile("mcr p15, 0, %0, c9, c12, 1" ::"r"(1U << 31U));
}

/* PMCCNTR has 32 bits, which wrap after some seconds: this is called far more often. */
static uint64_t count(void) {
  static uint32_t low;
  static uint64_t whole;
  uint32_t now;
  __asm__ volatile("mrc p15, 0, %0, c9, c13, 0" : "=r"(now));
  whole += (uint32_t)(now - low);
  low = now;
  return whole;
}

void board_init(unsigned node) {
  start_counter();
  next_cycle = count() + COUNTS_PER_CYCLE;
  /* CiA 301: network management, and SDO requests to this node. */
  zynqmp_can_init(0x000, (uint16_t)(0x600U + node));
}

uint32_t board_now_ms(void) { return (uint32_t)(count() / COUNTS_PER_MS); }

int board_cycle_due(void) {
  const uint64_t now = count();
  if (now < next_cycle) return 0;
  next_cycle += COUNTS_PER_CYCLE;
  /* More than a whole period late (an emulator on a busy machine): not made up for in a burst. */
  if (next_cycle <= now) {
    board_periods_left_out += (uint32_t)((now - next_cycle) / COUNTS_PER_CYCLE) + 1U;
    next_cycle = now + COUNTS_PER_CYCLE;
  }
  return 1;
}

int board_can_send(void* user, uint16_t id, const uint8_t* bytes, uint8_t size) {
  (void)user;
  return zynqmp_can_send(id, bytes, size);
}

int board_can_receive(board_can_frame* frame) {
  return zynqmp_can_receive(&frame->id, frame->bytes, &frame->size);
}

uint32_t board_can_overflows(void) { return zynqmp_can_overflows(); }

const flexcomp_storage* const board_storage = &flexcomp_slots_in_ram;
