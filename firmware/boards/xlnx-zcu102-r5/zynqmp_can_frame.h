/* SPDX-License-Identifier: Apache-2.0 */
/* How a CAN frame lies in the FIFO words of the Zynq UltraScale+ CAN controller (UG1085, chapter "CAN Controller"),
 * and how QEMU's model has it instead. No access to hardware in here. */
#ifndef FLEXCOMP_ZYNQMP_CAN_FRAME_H
#define FLEXCOMP_ZYNQMP_CAN_FRAME_H

#include <stdint.h>

/* Hardware: 11 identifier bits on top, then "substitute remote request" (a remote frame, where the identifier has
 * 11 bits) and "identifier extension". */
#define ZYNQMP_CAN_ID_SHIFT 21U
#define ZYNQMP_CAN_REMOTE (1U << 20U)
#define ZYNQMP_CAN_EXTENDED (1U << 19U)
/* QEMU 7.2: the identifier of Linux' SocketCAN as it is, flags on top. */
#define ZYNQMP_CAN_QEMU_EXTENDED (1U << 31U)
#define ZYNQMP_CAN_QEMU_REMOTE (1U << 30U)

#define ZYNQMP_CAN_LARGEST_ID 0x7FFU

/* The identifier word of a data frame with an 11-bit identifier. */
static inline uint32_t zynqmp_can_id_word(uint16_t id, int in_qemu) {
  const uint32_t bits = id & ZYNQMP_CAN_LARGEST_ID;
  return in_qemu ? bits : bits << ZYNQMP_CAN_ID_SHIFT;
}

/* Of an acceptance filter: all bits by which such frames differ from each other and from all others. */
static inline uint32_t zynqmp_can_id_mask(int in_qemu) {
  const uint32_t flags =
      in_qemu ? ZYNQMP_CAN_QEMU_EXTENDED | ZYNQMP_CAN_QEMU_REMOTE : ZYNQMP_CAN_REMOTE | ZYNQMP_CAN_EXTENDED;
  return zynqmp_can_id_word(ZYNQMP_CAN_LARGEST_ID, in_qemu) | flags;
}

/* 1 and the identifier where the word is that of a data frame with an 11-bit identifier. */
static inline int zynqmp_can_id(uint32_t word, int in_qemu, uint16_t* id) {
  const uint32_t bits = (in_qemu ? word : word >> ZYNQMP_CAN_ID_SHIFT) & ZYNQMP_CAN_LARGEST_ID;
  *id = (uint16_t)bits;
  return (word & zynqmp_can_id_mask(in_qemu)) == zynqmp_can_id_word(*id, in_qemu);
}

/* The data length code lies in the top four bits of its word, on both. */
#define ZYNQMP_CAN_DLC_SHIFT 28U

/* Byte 0 of four is the highest of a data word in hardware, the lowest in QEMU. */
static inline unsigned zynqmp_can_byte_shift(unsigned byte, int in_qemu) {
  return 8U * (in_qemu ? byte : 3U - byte);
}
static inline uint32_t zynqmp_can_data_word(const uint8_t four[4], int in_qemu) {
  uint32_t word = 0;
  unsigned k;
  for (k = 0; k < 4; ++k) word |= (uint32_t)four[k] << zynqmp_can_byte_shift(k, in_qemu);
  return word;
}
static inline void zynqmp_can_data(uint32_t word, int in_qemu, uint8_t four[4]) {
  unsigned k;
  for (k = 0; k < 4; ++k) four[k] = (uint8_t)(word >> zynqmp_can_byte_shift(k, in_qemu));
}

#endif
