// SPDX-License-Identifier: Apache-2.0
#include "model/admission.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/calibration_file.hpp"
#include "input_error.hpp"
#include "model/parameter_image.hpp"
#include "support/robot_files.hpp"
#include "support/text_file.hpp"
#include "support/thrown.hpp"

namespace {

using namespace flexcomp::host;
using namespace flexcomp;
using support::thrown;
using support::tx60l;
using testing::HasSubstr;

Calibration with_effect(const std::string& effect) {
  const std::string text =
      "robot: staubli-tx60l\neffects:\n  - {effect: joint_compliance, joint: 2, rad_per_nm: 1.5e-5}\n  - {" +
      effect + "}\n";
  return load_calibration(support::write("admission.yaml", text), tx60l());
}

TEST(HostAdmission, NamesEffectJointBoundAndLimit) {
  const auto refused = [](const std::string& effect) {
    const Calibration c = with_effect(effect);
    const InputError e = thrown<InputError>([&] { make_image(c, tx60l(), 1, {.allow_unnamed = true}); });
    EXPECT_EQ(e.file(), c.path);
    return e;
  };
  InputError e = refused("effect: gear_harmonic, joint: 6, order: 100, sin_rad: 0.015, cos_rad: 0");
  EXPECT_EQ(e.field(), "gear_harmonic[joint=6,order=100]");
  EXPECT_THAT(e.expected(), HasSubstr("a slope of joint 6 of at most 0.25 rad/rad"));
  EXPECT_THAT(e.found(), HasSubstr("1.5 rad/rad"));
  e = refused("effect: joint_compliance, joint: 5, rad_per_nm: 1");
  EXPECT_EQ(e.field(), "joint_compliance[joint=5]");
  EXPECT_THAT(e.expected(), HasSubstr("a compliance of joint 5 of at most 0.005 rad/(N m)"));
  e = refused(
      "effect: unnamed, place: link3.theta, of: [q2, time_s], grid: [[-1, 1], [0, 3600]], values_rad: [[0, "
      "0], [0, 1.0e-4]]");
  EXPECT_THAT(e.field(), HasSubstr("unnamed"));
  EXPECT_THAT(e.found(), HasSubstr("time or speed"));
  EXPECT_EQ(certified(with_effect("effect: backlash, joint: 2, half_gap_rad: 7.0e-5").terms, tx60l(), "")
                .deflection_rad[2],
            0);
}

TEST(HostAdmission, WhatIsNeverPushedIsNotJudged) {
  const Calibration c = with_effect(
      "effect: unnamed, place: link3.theta, of: [q2, time_s], grid: [[-1, 1], [0, 3600]], values_rad: [[0, "
      "0], [0, 1.0e-4]]");
  EXPECT_THROW(certified(c.terms, tx60l(), ""), InputError);
  EXPECT_NO_THROW(refuse_inadmissible(c.terms, tx60l(), ""));
  const Calibration steep =
      with_effect("effect: gear_harmonic, joint: 6, order: 100, sin_rad: 0.015, cos_rad: 0");
  EXPECT_THROW(refuse_inadmissible(steep.terms, tx60l(), ""), InputError);
}

TEST(HostAdmission, ThePapersSetHasACertificate) {
  const Calibration c = load_calibration(support::data + "tx60l_table1.yaml", tx60l());
  const HostCertificate certificate = certified(c.terms, tx60l(), "");
  EXPECT_GT(certificate.position_m, 1e-3);
  EXPECT_LT(certificate.instructions, 30000U);
  const Json json = to_json(certificate);
  EXPECT_EQ(json["instructions"], certificate.instructions);
  EXPECT_EQ(json["deflection_deg"].size(), 6U);
  EXPECT_THAT(certificate_text(certificate), HasSubstr("cost: at most "));
}

}  // namespace
