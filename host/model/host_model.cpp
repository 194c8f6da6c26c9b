// SPDX-License-Identifier: Apache-2.0
#include "model/host_model.hpp"

#include "flexcomp/status.hpp"
#include "input_error.hpp"

namespace flexcomp::host {

std::unique_ptr<HostModel> prepare(const TermSet& set, const Robot& robot, const std::string& source) {
  auto model = std::make_unique<HostModel>();
  const Refusal refusal = model->prepare(robot.nominal, set.list());
  if (refusal != Refusal::none) {
    throw InputError(source, 0, "", std::string("terms that can be evaluated on ") + robot.path,
                     text(refusal));
  }
  return model;
}

}  // namespace flexcomp::host
