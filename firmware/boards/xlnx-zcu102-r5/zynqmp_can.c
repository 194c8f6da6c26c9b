/* SPDX-License-Identifier: Apache-2.0 */
#include "zynqmp_can.h"

#include "machine.h"
#include "zynqmp_can_frame.h"

/* UG1085, "CAN Controller"; UG1087, module CAN. Four words to a FIFO: each read or write moves it on, so all four are
 * touched in this order, once. */
typedef struct can_fifo {
  volatile uint32_t id;
  volatile uint32_t dlc;
  volatile uint32_t data1;
  volatile uint32_t data2;
} can_fifo;

typedef struct can_filter {
  volatile uint32_t mask;
  volatile uint32_t id;
} can_filter;

typedef struct can_registers {
  volatile uint32_t software_reset;   /* 0x00 */
  volatile uint32_t mode;             /* 0x04 */
  volatile uint32_t prescaler;        /* 0x08 */
  volatile uint32_t bit_timing;       /* 0x0C */
  volatile uint32_t error_counter;    /* 0x10 */
  volatile uint32_t error_status;     /* 0x14 */
  volatile uint32_t status;           /* 0x18 */
  volatile uint32_t interrupt_status; /* 0x1C */
  volatile uint32_t interrupt_enable; /* 0x20 */
  volatile uint32_t interrupt_clear;  /* 0x24 */
  volatile uint32_t timestamp;        /* 0x28 */
  volatile uint32_t watermark;        /* 0x2C */
  can_fifo transmit;                  /* 0x30 */
  can_fifo transmit_high_priority;    /* 0x40 */
  can_fifo receive;                   /* 0x50 */
  volatile uint32_t filter_enable;    /* 0x60 */
  can_filter filter[4];               /* 0x64 */
} can_registers;

/* A test puts its own memory here. */
#ifndef FLEXCOMP_ZYNQMP_CAN0
#define FLEXCOMP_ZYNQMP_CAN0 ((can_registers*)0xFF060000U)
#endif
#define CAN0 FLEXCOMP_ZYNQMP_CAN0

#define RESET_RESET (1U << 0U)
#define RESET_ENABLE (1U << 1U)
#define STATUS_TRANSMIT_FULL (1U << 10U)
#define STATUS_FILTER_BUSY (1U << 11U)
#define INTERRUPT_RECEIVE_OVERFLOW (1U << 6U)
#define INTERRUPT_RECEIVE_NOT_EMPTY (1U << 7U)

/* 100 MHz / 5 = 20 quanta of 50 ns to a bit of 1 us: 1 of synchronisation, 16 before and 3 after the sample point,
 * which is thus at 85 %. Each field holds its value less one. */
#define PRESCALER (5U - 1U)
#define BIT_TIMING (((1U - 1U) << 7U) | ((3U - 1U) << 4U) | (16U - 1U))

static uint32_t overflows;

static void set_filter(unsigned number, uint16_t id) {
  CAN0->filter[number].mask = zynqmp_can_id_mask(FLEXCOMP_ZYNQMP_IN_QEMU);
  CAN0->filter[number].id = zynqmp_can_id_word(id, FLEXCOMP_ZYNQMP_IN_QEMU);
}

void zynqmp_can_init(uint16_t first_id, uint16_t second_id) {
  CAN0->software_reset = RESET_RESET;
  CAN0->mode = 0; /* normal: neither loopback, snoop nor sleep */
  CAN0->prescaler = PRESCALER;
  CAN0->bit_timing = BIT_TIMING;
  /* Filters may be written only while they are off and not at work. */
  CAN0->filter_enable = 0;
  while ((CAN0->status & STATUS_FILTER_BUSY) != 0) {
  }
  set_filter(0, first_id);
  set_filter(1, second_id);
  CAN0->filter_enable = 3U;
  CAN0->software_reset = RESET_ENABLE;
  overflows = 0;
}

int zynqmp_can_send(uint16_t id, const uint8_t* bytes, uint8_t size) {
  uint8_t data[8] = {0};
  unsigned k;
  if (size > 8 || (CAN0->status & STATUS_TRANSMIT_FULL) != 0) return 0;
  for (k = 0; k < size; ++k) data[k] = bytes[k];
  CAN0->transmit.id = zynqmp_can_id_word(id, FLEXCOMP_ZYNQMP_IN_QEMU);
  CAN0->transmit.dlc = (uint32_t)size << ZYNQMP_CAN_DLC_SHIFT;
  CAN0->transmit.data1 = zynqmp_can_data_word(data, FLEXCOMP_ZYNQMP_IN_QEMU);
  CAN0->transmit.data2 = zynqmp_can_data_word(data + 4, FLEXCOMP_ZYNQMP_IN_QEMU);
  return 1;
}

int zynqmp_can_receive(uint16_t* id, uint8_t bytes[8], uint8_t* size) {
  const uint32_t interrupts = CAN0->interrupt_status;
  uint32_t id_word, dlc;
  if ((interrupts & INTERRUPT_RECEIVE_OVERFLOW) != 0) {
    ++overflows;
    CAN0->interrupt_clear = INTERRUPT_RECEIVE_OVERFLOW;
  }
  if ((interrupts & INTERRUPT_RECEIVE_NOT_EMPTY) == 0) return 0;
  id_word = CAN0->receive.id;
  dlc = CAN0->receive.dlc >> ZYNQMP_CAN_DLC_SHIFT;
  zynqmp_can_data(CAN0->receive.data1, FLEXCOMP_ZYNQMP_IN_QEMU, bytes);
  zynqmp_can_data(CAN0->receive.data2, FLEXCOMP_ZYNQMP_IN_QEMU, bytes + 4);
  /* Comes back at once where there are more. */
  CAN0->interrupt_clear = INTERRUPT_RECEIVE_NOT_EMPTY;
  *size = (uint8_t)(dlc <= 8 ? dlc : 8);
  return zynqmp_can_id(id_word, FLEXCOMP_ZYNQMP_IN_QEMU, id);
}

uint32_t zynqmp_can_overflows(void) { return overflows; }
