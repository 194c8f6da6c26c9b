// SPDX-License-Identifier: Apache-2.0
/// \file
/// The types that the library is built for; see flexcomp_config.h.
#ifndef FLEXCOMP_FIRMWARE_CONFIG_HPP
#define FLEXCOMP_FIRMWARE_CONFIG_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "flexcomp/model.hpp"
#include "flexcomp/robot.hpp"
#include "flexcomp_config.h"

namespace flexcomp {
namespace firmware {

using Scalar = FLEXCOMP_SCALAR;
constexpr std::size_t joints = 6;
using FirmwareCapacity = Capacity<FLEXCOMP_TERMS, FLEXCOMP_TABLES, FLEXCOMP_TABLE_VALUES>;
using FirmwareModel = Model<Scalar, joints, FirmwareCapacity>;
using FirmwareContext = Context<Scalar, joints>;
using Joints = std::array<Scalar, joints>;  ///< rad
using Robot = NominalRobot<joints>;

constexpr std::uint32_t staging_bytes = FLEXCOMP_STAGING_BYTES;
constexpr std::uint32_t slot_bytes = FLEXCOMP_SLOT_BYTES;
static_assert(staging_bytes % 32 == 0, "non-volatile memory is written 32 bytes at a time");

constexpr std::uint32_t firmware_version =
    (0U << 16U) | (1U << 8U) | 0U;  ///< major << 16 | minor << 8 | patch
constexpr char firmware_version_text[] = "0.1.0";

}  // namespace firmware
}  // namespace flexcomp

#endif
