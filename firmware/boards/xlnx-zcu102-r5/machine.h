/* SPDX-License-Identifier: Apache-2.0 */
/* The one switch between the real Zynq UltraScale+ and QEMU's model of it (xlnx-zcu102, QEMU 7.2). Hardware is the
 * default; the build of the emulated image sets the other. Everything that differs asks this and nothing else:
 *   - the identifier word of a CAN frame and the order of its bytes in the data words (zynqmp_can_frame.h);
 *   - the rate of the processor's cycle counter (board.c). */
#ifndef FLEXCOMP_ZCU102_MACHINE_H
#define FLEXCOMP_ZCU102_MACHINE_H

#ifndef FLEXCOMP_ZYNQMP_IN_QEMU
#define FLEXCOMP_ZYNQMP_IN_QEMU 0
#endif

#endif
