/* SPDX-License-Identifier: Apache-2.0 */
/* Driver of a Zynq UltraScale+ CAN controller (CAN 2.0, the one in the processing system), polled. */
#ifndef FLEXCOMP_ZYNQMP_CAN_H
#define FLEXCOMP_ZYNQMP_CAN_H

#include <stdint.h>

/* Resets controller 0, sets 1 Mbit/s and lets in data frames of the two identifiers. Its clock (100 MHz), its pins
 * and its release from reset are what the first-stage boot loader sets up. */
void zynqmp_can_init(uint16_t first_id, uint16_t second_id);

/* Into the transmit FIFO; 0 where it is full. size <= 8. */
int zynqmp_can_send(uint16_t id, const uint8_t* bytes, uint8_t size);

/* The oldest frame of the receive FIFO; 0 where it is empty or where that one was not for us. */
int zynqmp_can_receive(uint16_t* id, uint8_t bytes[8], uint8_t* size);

/* How often the receive FIFO (64 frames) was seen to have overflowed. */
uint32_t zynqmp_can_overflows(void);

#endif
