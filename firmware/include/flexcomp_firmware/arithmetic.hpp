/// \file
/// The core's evaluations, compiled once: inlined into each of their callers they would lie in flash
/// three times.
#ifndef FLEXCOMP_FIRMWARE_ARITHMETIC_HPP
#define FLEXCOMP_FIRMWARE_ARITHMETIC_HPP

#include "flexcomp/compensate.hpp"
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

}  // namespace firmware
}  // namespace flexcomp

#endif
