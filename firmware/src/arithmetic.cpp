#include "flexcomp_firmware/arithmetic.hpp"

namespace flexcomp {
namespace firmware {

void corrected_command(const FirmwareModel& model, const Joints& q_command_rad,
                       const FirmwareContext& context, const CompensationSettings<Scalar>& settings,
                       Compensated<Scalar, joints>& out) {
  compensate(model, q_command_rad, context, settings, out);
}

Miss missed(const FirmwareModel& model, const Joints& q_rad, const Joints& q_command_rad,
            const FirmwareContext& context) {
  const TargetResidual<Scalar> residual = target_residual(model, q_rad, q_command_rad, context);
  Workspace<Scalar, joints> workspace;
  const Pose<Scalar> nominal = nominal_forward(model, q_command_rad);
  const Pose<Scalar> flexible = forward(model, q_rad, context, workspace);
  const Scalar trace = dot<Scalar>(nominal.rotation.col(0), flexible.rotation.col(0)) +
                       dot<Scalar>(nominal.rotation.col(1), flexible.rotation.col(1)) +
                       dot<Scalar>(nominal.rotation.col(2), flexible.rotation.col(2));
  return {residual.position_m, residual.orientation_rad, !(trace > Scalar(1))};
}

}  // namespace firmware
}  // namespace flexcomp
