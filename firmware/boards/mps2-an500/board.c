/* SPDX-License-Identifier: Apache-2.0 */
/* modbus_rtu_board.h on an Arm MPS2 with the Cortex-M7 image AN500: SysTick, a CMSDK timer as a clock and two CMSDK
 * serial lines. The machine has no non-volatile memory. */
#include "modbus_rtu_board.h"
#include "slots_in_ram.h"

#define REGISTER(address) (*(volatile uint32_t*)(address))

/* System control (Armv7-M architecture reference manual, B3). */
#define SYST_CSR REGISTER(0xE000E010U)
#define SYST_RVR REGISTER(0xE000E014U)
#define SYST_CVR REGISTER(0xE000E018U)
#define NVIC_ISER0 REGISTER(0xE000E100U)
#define NVIC_IPR(n) (*(volatile uint8_t*)(0xE000E400U + (n)))
#define ICSR REGISTER(0xE000ED04U)
#define SHPR3 REGISTER(0xE000ED20U)
enum { SYST_ENABLE = 1, SYST_TICKINT = 2, SYST_CLKSOURCE = 4 };
static const uint32_t icsr_pendstset = 1U << 26;

/* CMSDK timer 0: counts down at the processor's clock. */
#define TIMER_CTRL REGISTER(0x40000000U)
#define TIMER_VALUE REGISTER(0x40000004U)
#define TIMER_RELOAD REGISTER(0x40000008U)

/* CMSDK serial lines 0 and 1. Each takes one byte at a time in either direction. */
typedef struct serial_line {
  uint32_t base;
  unsigned interrupt; /* that a byte has come in */
} serial_line;
static const serial_line lines[2] = {{0x40004000U, 0}, {0x40005000U, 2}};
enum { UART_DATA = 0x00, UART_STATE = 0x04, UART_CTRL = 0x08, UART_INTSTATUS = 0x0C, UART_BAUDDIV = 0x10 };
enum { STATE_TX_FULL = 1, STATE_RX_FULL = 2, CTRL_TX = 1, CTRL_RX = 2, CTRL_RX_INTERRUPT = 8, INT_RX = 2 };
enum { CPU_HZ = 1000000 * BOARD_TICKS_PER_US, BAUD = 115200 };

#define UART(line, offset) REGISTER(lines[line].base + (offset))

/* --- interrupts ---------------------------------------------------------------------------------- */

/* The names are those of firmware/boards/common/reset_cortex_m.cpp. */
void flexcomp_board_systick(void);
void flexcomp_board_interrupt(void);

static void (*control_cycle)(void);

void flexcomp_board_systick(void) { control_cycle(); }

/* One writer (the interrupt) and one reader (the background): each index has one owner. More than the longest
 * Modbus frame, so that nothing is lost while the background checks a set. */
enum { RING = 1024 };
static volatile uint8_t ring[2][RING];
static volatile uint32_t ring_in[2];
static volatile uint32_t ring_out[2];

void flexcomp_board_interrupt(void) {
  for (unsigned line = 0; line < 2; ++line) {
    if ((UART(line, UART_INTSTATUS) & INT_RX) == 0) continue;
    UART(line, UART_INTSTATUS) = INT_RX;
    while ((UART(line, UART_STATE) & STATE_RX_FULL) != 0) {
      const uint8_t byte = (uint8_t)UART(line, UART_DATA);
      const uint32_t in = ring_in[line];
      if (in - ring_out[line] < RING) {
        ring[line][in % RING] = byte;
        ring_in[line] = in + 1;
      } /* else the byte is lost, and the bus resynchronises by checksum and gap */
    }
  }
}

/* --- clock and cycle ----------------------------------------------------------------------------- */

void board_init(void) {
  TIMER_RELOAD = 0xFFFFFFFFU;
  TIMER_VALUE = 0xFFFFFFFFU;
  TIMER_CTRL = 1;
  for (unsigned line = 0; line < 2; ++line) {
    UART(line, UART_BAUDDIV) = CPU_HZ / BAUD;
    UART(line, UART_CTRL) = CTRL_TX | CTRL_RX | CTRL_RX_INTERRUPT;
    /* Below the control cycle, so that a cycle interrupts the reception of a byte and never waits for it. On a
     * line without a FIFO a byte must be fetched within 87 us at 115200 baud: where a cycle takes longer than
     * that, receive by DMA. */
    NVIC_IPR(lines[line].interrupt) = 0x80;
    NVIC_ISER0 = 1U << lines[line].interrupt;
  }
  SHPR3 &= 0x00FFFFFFU; /* SysTick: the highest priority, 0 */
}

void board_start_cycle(void (*cycle)(void)) {
  control_cycle = cycle;
  SYST_RVR = (uint32_t)BOARD_CYCLE_US * BOARD_TICKS_PER_US - 1U;
  SYST_CVR = 0;
  SYST_CSR = SYST_ENABLE | SYST_TICKINT | SYST_CLKSOURCE;
}

int board_cycle_is_late(void) { return (ICSR & icsr_pendstset) != 0; }

uint32_t board_ticks(void) { return ~TIMER_VALUE; }

uint32_t board_now_us(void) {
  static uint32_t us;
  static uint32_t counted;
  const uint32_t more = (board_ticks() - counted) / BOARD_TICKS_PER_US;
  counted += more * BOARD_TICKS_PER_US;
  us += more;
  return us;
}

uint32_t board_now_ms(void) {
  static uint32_t ms;
  static uint32_t counted;
  const uint32_t more = (board_now_us() - counted) / 1000U;
  counted += more * 1000U;
  ms += more;
  return ms;
}

void board_sleep(void) { __asm volatile("wfi" ::: "memory"); }

/* --- serial lines -------------------------------------------------------------------------------- */

size_t board_receive(unsigned line, uint8_t* to, size_t size) {
  size_t n = 0;
  while (n < size && ring_out[line] != ring_in[line]) {
    to[n++] = ring[line][ring_out[line] % RING];
    ring_out[line] = ring_out[line] + 1;
  }
  return n;
}

void board_send(unsigned line, const uint8_t* bytes, size_t size) {
  for (size_t k = 0; k < size; ++k) {
    while ((UART(line, UART_STATE) & STATE_TX_FULL) != 0) {
    }
    UART(line, UART_DATA) = bytes[k];
  }
}

/* On a wire 1750 us above 19200 baud. Here bytes come from another process of a machine that may have other things
 * to do, so a pause within a frame says nothing. Below the second after which a client asks again. */
uint32_t board_bus_gap_us(void) { return 500000; }

const flexcomp_storage* const board_storage = &flexcomp_slots_in_ram;
