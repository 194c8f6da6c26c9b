/* SPDX-License-Identifier: Apache-2.0 */
/* How long the control cycle's step takes and how evenly it comes, separated by what the controller is doing.
 * It stands beside the flexcomp library and costs the cycle some hundred instructions after the step. */
#ifndef FLEXCOMP_EXAMPLES_CYCLE_MONITOR_H
#define FLEXCOMP_EXAMPLES_CYCLE_MONITOR_H

#include <flexcomp.h>

#ifdef __cplusplus
extern "C" {
#endif

/* CYCLE: one step with its flags, between two readings of board_ticks(). `late`: the next cycle was due before the end. */
void monitor_cycle(uint32_t start_ticks, uint32_t end_ticks, uint32_t flags,
                   const flexcomp_real q_command_rad[FLEXCOMP_JOINTS],
                   const flexcomp_real q_corrected_rad[FLEXCOMP_JOINTS], int late);

/* BACKGROUND: around each flexcomp_poll, because a set changes hands in there. */
void monitor_before_poll(void);
void monitor_after_poll(const flexcomp_state* state);
/* BACKGROUND: bytes came in on the bus. */
void monitor_bus_heard(void);

/* BACKGROUND, while the cycle runs: everything from here on anew. */
void monitor_clear(void);
/* BACKGROUND, while the cycle runs: all figures as one line of JSON, zero-terminated. Returns its length, 0 where
 * `size` is not enough (MONITOR_REPORT_BYTES is). Times are in ticks of the board, angles in nrad. */
enum { MONITOR_REPORT_BYTES = 4096 };
size_t monitor_report(char* to, size_t size);

#ifdef __cplusplus
}
#endif

#endif
