/* SPDX-License-Identifier: Apache-2.0 */
/* Cortex-R5F: exception table at address 0, stack, floating-point unit. */
    .syntax unified
    .arm
    .section .vectors, "ax"
    .global flexcomp_vectors
flexcomp_vectors:
    b flexcomp_reset            /* reset */
    b flexcomp_r5_fault         /* undefined instruction */
    b flexcomp_r5_fault         /* svc: the emulator takes semihosting calls before the processor sees them */
    b flexcomp_r5_fault         /* prefetch abort */
    b flexcomp_r5_fault         /* data abort */
    nop
    b flexcomp_r5_fault         /* irq */
    b flexcomp_r5_fault         /* fiq */

    .text
    .global flexcomp_reset
    .type flexcomp_reset, %function
flexcomp_reset:
    ldr sp, =flexcomp_stack_top
    mrc p15, 0, r0, c1, c0, 2   /* CPACR: full access to coprocessors 10 and 11 */
    orr r0, r0, #0xF00000
    mcr p15, 0, r0, c1, c0, 2
    isb
    mov r0, #0x40000000         /* FPEXC.EN */
    vmsr fpexc, r0
    bl flexcomp_board_start

    .type flexcomp_r5_fault, %function
flexcomp_r5_fault:
    ldr sp, =flexcomp_stack_top /* each exception mode has a stack pointer of its own */
    bl flexcomp_board_fault
