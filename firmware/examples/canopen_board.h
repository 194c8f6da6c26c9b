/* SPDX-License-Identifier: Apache-2.0 */
/* What canopen_controller.c asks of a board: a clock, a control period and a CAN controller. Nothing here waits:
 * every function returns at once, whatever the hardware does. Bind it to your own drivers, or see
 * firmware/boards/xlnx-zcu102-r5/ for one that is there. */
#ifndef FLEXCOMP_EXAMPLES_CANOPEN_BOARD_H
#define FLEXCOMP_EXAMPLES_CANOPEN_BOARD_H

#include <flexcomp.h>

/* Starts the clock and the CAN controller, which lets through only what concerns this CANopen node (network
 * management and its SDO requests). */
void board_init(unsigned node);

/* Milliseconds since the start; wraps. */
uint32_t board_now_ms(void);

/* 1 once for each control period that has begun, else 0. Periods that could not be served are left out. */
int board_cycle_due(void);

/* Puts a data frame into the transmit FIFO. 0 where it is full; the CANopen node offers it again. */
int board_can_send(void* user, uint16_t id, const uint8_t* bytes, uint8_t size);

typedef struct board_can_frame {
  uint16_t id;
  uint8_t size;
  uint8_t bytes[8];
} board_can_frame;

/* Takes the oldest frame out of the receive FIFO. 0 where there is none. */
int board_can_receive(board_can_frame* frame);

/* Frames lost by a full receive FIFO since the start. */
uint32_t board_can_overflows(void);

/* The two slots of non-volatile memory. */
extern const flexcomp_storage* const board_storage;

#endif
