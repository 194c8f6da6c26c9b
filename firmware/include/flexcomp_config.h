/* SPDX-License-Identifier: Apache-2.0 */
/** \file
 * Settings of the build, for C and C++. Every source must see the values with which the library was compiled:
 * set them for the whole build, not beside one include. */
#ifndef FLEXCOMP_CONFIG_H
#define FLEXCOMP_CONFIG_H

/** Scalar of the library: double, or float where the processor has single precision only. */
#ifndef FLEXCOMP_SCALAR
#define FLEXCOMP_SCALAR double
#endif

/** Most terms of a parameter set that are not constant (constant ones take no memory). */
#ifndef FLEXCOMP_TERMS
#define FLEXCOMP_TERMS 64
#endif
/** Most tables of a parameter set. */
#ifndef FLEXCOMP_TABLES
#define FLEXCOMP_TABLES 8
#endif
/** Most values of all tables of a parameter set. */
#ifndef FLEXCOMP_TABLE_VALUES
#define FLEXCOMP_TABLE_VALUES 768
#endif

/** Longest parameter image, bytes, a multiple of 32. The default holds every table value and 180 terms. */
#ifndef FLEXCOMP_STAGING_BYTES
#define FLEXCOMP_STAGING_BYTES 12288
#endif

/** Non-volatile memory of one of the two slots, bytes: the image, and 640 for its seals and marks. */
#define FLEXCOMP_SLOT_BYTES (FLEXCOMP_STAGING_BYTES + 640)

#endif
