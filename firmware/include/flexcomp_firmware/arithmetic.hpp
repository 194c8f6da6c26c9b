// SPDX-License-Identifier: Apache-2.0
/// \file
/// All of the core that calculates, compiled once: inlined into each of their callers its templates would lie in
/// flash three times. And compiled for speed: what the control cycle shares with the building of a model (sine and
/// cosine, products of poses) must not come from a source that is compiled for size.
#ifndef FLEXCOMP_FIRMWARE_ARITHMETIC_HPP
#define FLEXCOMP_FIRMWARE_ARITHMETIC_HPP

#include <cstddef>
#include <cstdint>

#include "flexcomp/compensate.hpp"
#include "flexcomp/status.hpp"
#include "flexcomp_firmware/config.hpp"

namespace flexcomp {
namespace firmware {

/// compensate() of the core.
void corrected_command(const FirmwareModel& model, const Joints& q_command_rad,
                       const FirmwareContext& context, const CompensationSettings<Scalar>& settings,
                       Compensated<Scalar, joints>& out);

/// What the flexible arm at q_rad still misses of the pose that the nominal arm has at q_command_rad.
struct Miss {
  Scalar position_m;
  Scalar orientation_rad;     ///< sine of the angle, as in target_residual()
  bool beyond_a_right_angle;  ///< where the sine gets smaller again
};
Miss missed(const FirmwareModel& model, const Joints& q_rad, const Joints& q_command_rad,
            const FirmwareContext& context);

/// model_from_image() of the core: prepares a model from an image that check_image() accepted.
Refusal build_model(const std::uint8_t* image, std::size_t size, const Robot& robot, FirmwareModel& model);

}  // namespace firmware
}  // namespace flexcomp

#endif
