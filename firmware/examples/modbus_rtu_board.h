/* SPDX-License-Identifier: Apache-2.0 */
/* What modbus_rtu_controller.c asks of a board: a clock, a control cycle, two serial lines, memory that keeps two slots.
 * Bind it to your own drivers, or see firmware/boards/mps2-an500/ for one that is there. */
#ifndef FLEXCOMP_EXAMPLES_MODBUS_RTU_BOARD_H
#define FLEXCOMP_EXAMPLES_MODBUS_RTU_BOARD_H

#include <flexcomp.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { BOARD_CYCLE_US = 1000, BOARD_TICKS_PER_US = 25 };

/* Clock, serial lines and interrupts; the control cycle does not run yet. */
void board_init(void);

/* Calls `cycle` every BOARD_CYCLE_US from a timer interrupt above all others. */
void board_start_cycle(void (*cycle)(void));
/* In the cycle: whether the next one is due already. */
int board_cycle_is_late(void);

/* A free-running counter, BOARD_TICKS_PER_US, wraps at 32 bits. Any context. */
uint32_t board_ticks(void);
/* BACKGROUND; called at least every two minutes. Both wrap at 32 bits. */
uint32_t board_now_us(void);
uint32_t board_now_ms(void);

/* Waits for the next interrupt. One that came just before the call is not waited for, but the control cycle is an
 * interrupt, too: what it left to do waits for one cycle at most. BACKGROUND. */
void board_sleep(void);

/* Serial lines: the bus, and a text console. BACKGROUND. */
enum { BOARD_BUS = 0, BOARD_CONSOLE = 1 };
/* Bytes that came in since the last call, at most `size`. */
size_t board_receive(unsigned line, uint8_t* to, size_t size);
/* Sends all bytes and returns when the line has taken them. */
void board_send(unsigned line, const uint8_t* bytes, size_t size);
/* Silence after which the bus is taken as back in step, us; see flexcomp_rtu_init. */
uint32_t board_bus_gap_us(void);

/* The two slots of non-volatile memory. */
extern const flexcomp_storage* const board_storage;

#ifdef __cplusplus
}
#endif

#endif
