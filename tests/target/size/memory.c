/* SPDX-License-Identifier: Apache-2.0 */
/* Compiled, not linked: the memory that the caller gives, as symbols whose sizes can be read. */
#include <flexcomp.h>

#define SETS (2 * FLEXCOMP_SET_BYTES)
unsigned char ram_sets_and_staging[SETS + FLEXCOMP_STAGING_BYTES];
unsigned char ram_arm[FLEXCOMP_MEMORY_BYTES - SETS - FLEXCOMP_STAGING_BYTES];
unsigned char ram_can[FLEXCOMP_CAN_BYTES];
unsigned char ram_rtu[FLEXCOMP_RTU_BYTES];
unsigned char ram_tcp[FLEXCOMP_TCP_BYTES];
