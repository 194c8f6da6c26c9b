// SPDX-License-Identifier: Apache-2.0
#include "kinematics/compensated_targets.hpp"

#include <memory>

#include "flexcomp/arm_state.hpp"
#include "flexcomp/image.hpp"
#include "flexcomp/model.hpp"
#include "input_error.hpp"

namespace flexcomp::host {

std::vector<Answer> compensated(const TargetsFile& targets,
                                const std::vector<std::array<double, joint_count>>& commands,
                                const Calibration& calibration, const Robot& robot,
                                const ImageOptions& options) {
  // Through the image and a model of the controller's size: what is answered here is what the controller answers.
  const std::vector<std::uint8_t> image =
      make_image(calibration, robot, calibration.sequence.value_or(0), options);
  const auto model = std::make_unique<Model<double, joint_count>>();
  const Refusal refusal = model_from_image(image.data(), image.size(), robot.nominal, *model);
  if (refusal != Refusal::none)
    throw InputError(calibration.path, 0, "", "a set that a controller can hold", text(refusal));

  std::vector<Answer> answers;
  for (std::size_t k = 0; k < commands.size(); ++k) {
    const auto& context = targets.rows[k].context;
    const auto result = compensate(*model, commands[k], context, CompensationSettings<double>{});
    // Of a command that is passed through the controller says nothing, and 0 on the wire.
    RemainingError<double> residual{};
    if (result.status != StepStatus::refused) {
      residual = remaining_error(*model, result.q, commands[k], context);
    }
    answers.push_back({result.q, residual.position_m, residual.orientation_rad, result.status, result.flags});
  }
  return answers;
}

}  // namespace flexcomp::host
