// SPDX-License-Identifier: Apache-2.0
/// \file
/// Admission on the host: the core's certify(), which the controller calls as well, with names.
#pragma once

#include <string>

#include "flexcomp/admission.hpp"
#include "json.hpp"
#include "model/robot.hpp"
#include "model/term_set.hpp"

namespace flexcomp::host {

using HostCertificate = Certificate<double, joint_count>;

/// The bounds of a set, with the default limits and ranges of the robot; `source` is named in the message.
/// \throws InputError  a set beyond the limits: the effect, the bound and the limit
HostCertificate certified(const TermSet& set, const Robot& robot, const std::string& source);

/// certified() of what a controller is given of a set: without effects of the measurement and those that have no name.
/// \throws InputError  as certified()
void refuse_inadmissible(const TermSet& set, const Robot& robot, const std::string& source);

/// Two lines for people: what the set can do at most, and what a step costs.
std::string certificate_text(const HostCertificate& certificate);

/// In the units of files.
Json to_json(const HostCertificate& certificate);

}  // namespace flexcomp::host
