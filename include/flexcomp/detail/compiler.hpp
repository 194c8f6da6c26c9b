// SPDX-License-Identifier: Apache-2.0
/// \file
/// What the core asks of the compiler beyond the language. All of it is only about speed and size.
#ifndef FLEXCOMP_DETAIL_COMPILER_HPP
#define FLEXCOMP_DETAIL_COMPILER_HPP

/// Before a short loop over the joints: on a small controller counting would cost as much as what is counted.
#if defined(__clang__)
#define FLEXCOMP_UNROLL _Pragma("clang loop unroll(full)")
#elif defined(__GNUC__)
#define FLEXCOMP_UNROLL _Pragma("GCC unroll 8")
#else
#define FLEXCOMP_UNROLL
#endif

/// For what is called from several places: once in flash.
#if defined(__GNUC__)
#define FLEXCOMP_ONCE __attribute__((noinline))
#else
#define FLEXCOMP_ONCE
#endif

/// For what runs at the start, in the background, or for some cycles after an event: small rather than fast.
#if defined(__GNUC__)
#define FLEXCOMP_RARE __attribute__((noinline, cold))
#else
#define FLEXCOMP_RARE
#endif

#endif
