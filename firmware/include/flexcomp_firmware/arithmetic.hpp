// SPDX-License-Identifier: Apache-2.0
/// \file
/// Instances of the core's templates, compiled once (inlined into each caller they would be in flash three
/// times) and for speed: functions that the control cycle shares with the preparation of a model (sine and
/// cosine, products of poses) must not come from a source that is compiled for size.
#ifndef FLEXCOMP_FIRMWARE_ARITHMETIC_HPP
#define FLEXCOMP_FIRMWARE_ARITHMETIC_HPP

#include <cstddef>
#include <cstdint>

#include "flexcomp/compensate.hpp"
#include "flexcomp/image.hpp"
#include "flexcomp/status.hpp"
#include "flexcomp_firmware/config.hpp"

namespace flexcomp {
namespace firmware {

/// compensate() of the core (docs/compensation.md, C1).
void corrected_command(const FirmwareModel& model, const Joints& q_command_rad,
                       const FirmwareContext& context, const CompensationSettings<Scalar>& settings,
                       Compensated<Scalar, joints>& out);

/// Remaining error of a pose, with the range of its angle.
struct RemainingError {
  Scalar position_m;           ///< 3-D distance
  Scalar orientation_rad;      ///< sine of the angle, as in target_residual()
  bool is_beyond_right_angle;  ///< of the angle: its sine decreases again
};
/// Remaining error at q_rad: forward model against the nominal pose at q_command_rad, as target_residual().
RemainingError remaining_error(const FirmwareModel& model, const Joints& q_rad, const Joints& q_command_rad,
                               const FirmwareContext& context);

/// Model::begin() of the core.
void begin_model(const Robot& robot, FirmwareModel& model);
/// Adds the record at the cursor, which is not at the end, to a model.
Refusal add_record(const std::uint8_t* image, std::size_t size, ImageCursor& cursor, FirmwareModel& model);
/// Model::finish() of the core.
void finish_model(FirmwareModel& model);

}  // namespace firmware
}  // namespace flexcomp

#endif
