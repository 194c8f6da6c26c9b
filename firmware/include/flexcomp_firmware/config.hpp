// SPDX-License-Identifier: Apache-2.0
/// \file
/// Types of this build; see flexcomp_config.h.
#ifndef FLEXCOMP_FIRMWARE_CONFIG_HPP
#define FLEXCOMP_FIRMWARE_CONFIG_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexcomp/admission.hpp"
#include "flexcomp/model.hpp"
#include "flexcomp/robot.hpp"
#include "flexcomp_config.h"

namespace flexcomp {
namespace firmware {

using Scalar = FLEXCOMP_SCALAR;    ///< float or double
constexpr std::size_t joints = 6;  ///< of an arm
/// Capacity of a prepared set.
using FirmwareCapacity = Capacity<FLEXCOMP_TERMS, FLEXCOMP_TABLES, FLEXCOMP_TABLE_VALUES>;
/// A prepared set.
using FirmwareModel = Model<Scalar, joints, FirmwareCapacity>;
/// Bounds of a prepared set.
using FirmwareCertificate = Certificate<Scalar, joints>;
/// Context of one command.
using FirmwareContext = Context<Scalar, joints>;
using Joints = std::array<Scalar, joints>;  ///< rad
using Robot = NominalRobot<joints>;         ///< nominal robot

constexpr std::uint32_t staging_bytes = FLEXCOMP_STAGING_BYTES;  ///< longest image
constexpr std::uint32_t slot_bytes = FLEXCOMP_SLOT_BYTES;        ///< of non-volatile memory
static_assert(staging_bytes % 32 == 0, "non-volatile memory is written 32 bytes at a time");

/// Version as major << 16 | minor << 8 | patch.
constexpr std::uint32_t firmware_version = (0U << 16U) | (1U << 8U) | 0U;
/// Version as text.
constexpr char firmware_version_text[] = "0.1.0";

}  // namespace firmware
}  // namespace flexcomp

#endif
