/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FLEXCOMP_BOARDS_SLOTS_IN_RAM_H
#define FLEXCOMP_BOARDS_SLOTS_IN_RAM_H

#include <flexcomp.h>

extern const flexcomp_storage flexcomp_slots_in_ram;

#endif
