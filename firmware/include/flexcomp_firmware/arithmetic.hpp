// SPDX-License-Identifier: Apache-2.0
/// \file
/// Instances of the core's templates, compiled once (inlined into each caller they would be in flash three
/// times) and for speed: functions that the control cycle shares with the preparation of a model (sine and
/// cosine, products of poses) must not come from a source that is compiled for size.
#ifndef FLEXCOMP_FIRMWARE_ARITHMETIC_HPP
#define FLEXCOMP_FIRMWARE_ARITHMETIC_HPP

#include <cstddef>
#include <cstdint>

#include "flexcomp/arm_state.hpp"
#include "flexcomp/forward.hpp"
#include "flexcomp/image.hpp"
#include "flexcomp/status.hpp"
#include "flexcomp_firmware/config.hpp"

namespace flexcomp {
namespace firmware {

/// compensate() of the core (docs/compensation.md, C1).
void corrected_command(const FirmwareModel& model, const Joints& q_command_rad,
                       const FirmwareContext& context, const CompensationSettings<Scalar>& settings,
                       Compensated<Scalar, joints>& out);

/// compensate_rate() of the core (C22).
bool corrected_rate(const FirmwareModel& model, const Joints& q_command_rad, const Joints& q_rate_rad_s,
                    const FirmwareContext& context, const CompensationSettings<Scalar>& settings,
                    Compensated<Scalar, joints>& out, Joints& q_rate_out_rad_s);

/// uncorrect() of the core (C21).
bool nominal_command(const FirmwareModel& model, const Joints& q_reading_rad, const FirmwareContext& context,
                     const CompensationSettings<Scalar>& settings, Joints& q_command_rad);

/// forward() of the core (M15).
Pose<Scalar> tool_pose(const FirmwareModel& model, const Joints& q_reading_rad,
                       const FirmwareContext& context);

/// joint_loads() of the core.
JointLoads<Scalar, joints> loads_of_joints(const FirmwareModel& model, const Joints& q_reading_rad,
                                           const FirmwareContext& context);

/// remaining_error() of the core.
RemainingError<Scalar> remaining_error(const FirmwareModel& model, const Joints& q_rad,
                                       const Joints& q_command_rad, const FirmwareContext& context);

/// Model::begin() of the core.
void begin_model(const Robot& robot, FirmwareModel& model);
/// Adds the record at the cursor, which is not at the end, to a model.
Refusal add_record(const std::uint8_t* image, std::size_t size, ImageCursor& cursor, FirmwareModel& model);
/// Model::finish_chain() of the core.
void finish_chain(FirmwareModel& model);
/// Model::finish_bounds() of the core.
void finish_bounds(FirmwareModel& model);
/// Model::finish_size() of the core.
void finish_size(FirmwareModel& model);

}  // namespace firmware
}  // namespace flexcomp

#endif
