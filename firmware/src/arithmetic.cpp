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

// Not by target_residual(): the trace needs its poses as well, and a call of it takes more stack.
RemainingError remaining_error(const FirmwareModel& model, const Joints& q_rad, const Joints& q_command_rad,
                               const FirmwareContext& context) {
  Workspace<Scalar, joints> workspace;
  const Pose<Scalar> nominal = nominal_forward(model, q_command_rad);
  const Pose<Scalar> flexible = forward(model, q_rad, context, workspace);
  const Vector3<Scalar> p = nominal.position - flexible.position;
  Vec3<Scalar> r;
  detail::rotation_error(columns_of(nominal.rotation), columns_of(flexible.rotation), r);
  const Scalar trace = dot<Scalar>(nominal.rotation.col(0), flexible.rotation.col(0)) +
                       dot<Scalar>(nominal.rotation.col(1), flexible.rotation.col(1)) +
                       dot<Scalar>(nominal.rotation.col(2), flexible.rotation.col(2));
  using std::sqrt;
  return {sqrt(dot<Scalar>(p, p)), sqrt(dot(r, r)), !(trace > Scalar(1))};
}

Refusal add_record(const std::uint8_t* image, std::size_t size, ImageCursor& cursor, FirmwareModel& model) {
  return visit_record<Scalar>(image, size, cursor, ModelBuilder<Scalar, joints, FirmwareCapacity>{model});
}

void begin_model(const Robot& robot, FirmwareModel& model) { model.begin(robot); }

void finish_model(FirmwareModel& model) { model.finish(); }

}  // namespace firmware
}  // namespace flexcomp
