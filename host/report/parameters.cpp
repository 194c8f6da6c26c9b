#include "report/parameters.hpp"

#include <cmath>

#include "catalogue/catalogue.hpp"

namespace flexcomp::host {

void add_parameters(Page& page, const Calibration& calibration, const RobotFile& robot) {
  for (const Parameter& p : parameters_of(calibration.terms, robot.nominal)) {
    PageParameter shown;
    shown.name = p.name;
    shown.value = p.get(calibration.terms) / p.si_per_file_unit();
    const std::vector<double>& sigmas = p.value ? calibration.value_sigma : calibration.sigma;
    const std::size_t at = p.value ? *p.value : p.terms.front();
    if (at < sigmas.size() && std::isfinite(sigmas[at])) shown.sigma = sigmas[at] / p.si_per_file_unit();
    page.parameters.push_back(shown);
  }
  for (const Confounded& c : calibration.confounded) page.confounded.push_back({c.parameter, c.with});
}

}  // namespace flexcomp::host
