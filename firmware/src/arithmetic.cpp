// SPDX-License-Identifier: Apache-2.0
#include "flexcomp_firmware/arithmetic.hpp"

#include "flexcomp/image.hpp"

namespace flexcomp {
namespace firmware {

void corrected_command(const FirmwareModel& model, const Joints& q_command_rad,
                       const FirmwareContext& context, const CompensationSettings<Scalar>& settings,
                       Compensated<Scalar, joints>& out) {
  compensate(model, q_command_rad, context, settings, out);
}

bool corrected_rate(const FirmwareModel& model, const Joints& q_command_rad, const Joints& q_rate_rad_s,
                    const FirmwareContext& context, const CompensationSettings<Scalar>& settings,
                    Compensated<Scalar, joints>& out, Joints& q_rate_out_rad_s) {
  return compensate_rate(model, q_command_rad, q_rate_rad_s, context, settings, out, q_rate_out_rad_s);
}

bool nominal_command(const FirmwareModel& model, const Joints& q_reading_rad, const FirmwareContext& context,
                     const CompensationSettings<Scalar>& settings, Joints& q_command_rad) {
  return uncorrect(model, q_reading_rad, context, settings, q_command_rad);
}

Pose<Scalar> tool_pose(const FirmwareModel& model, const Joints& q_reading_rad,
                       const FirmwareContext& context) {
  Workspace<Scalar, joints> workspace;
  return forward(model, q_reading_rad, context, workspace);
}

JointLoads<Scalar, joints> loads_of_joints(const FirmwareModel& model, const Joints& q_reading_rad,
                                           const FirmwareContext& context) {
  return joint_loads(model, q_reading_rad, context);
}

RemainingError<Scalar> remaining_error(const FirmwareModel& model, const Joints& q_rad,
                                       const Joints& q_command_rad, const FirmwareContext& context) {
  return flexcomp::remaining_error<Scalar>(model, q_rad, q_command_rad, context);
}

Refusal add_record(const std::uint8_t* image, std::size_t size, ImageCursor& cursor, FirmwareModel& model) {
  return visit_record<Scalar>(image, size, cursor, ModelBuilder<Scalar, joints, FirmwareCapacity>{model});
}

void begin_model(const Robot& robot, FirmwareModel& model) { model.begin(robot); }

void finish_chain(FirmwareModel& model) { model.finish_chain(); }

void finish_bounds(FirmwareModel& model) { model.finish_bounds(); }

void finish_size(FirmwareModel& model) { model.finish_size(); }

}  // namespace firmware
}  // namespace flexcomp
