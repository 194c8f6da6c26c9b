#include "diagnosis/diagnose.hpp"

#include "identification/identify.hpp"

namespace flexcomp::host {

Diagnosis diagnose(const RobotFile& robot, const std::vector<Observation>& rows, const std::string& source,
                   const DiagnoseOptions& options) {
  Diagnosis out;
  IdentifyOptions identify_options;
  identify_options.force = options.force;
  const Identification base = identify(robot, rows, source, identify_options);
  out.before = out.after = base.calibration;
  out.residuals_before = out.residuals_after = base.residuals;
  out.error_before = out.error_after = base.after;
  return out;
}

}  // namespace flexcomp::host
