// SPDX-License-Identifier: Apache-2.0
// A calibration file, written again and read again, and as an image and back.
#include <algorithm>
#include <tuple>
#include <vector>

#include "files/calibration_file.hpp"
#include "host_text.hpp"
#include "model/effects.hpp"
#include "model/parameter_image.hpp"

namespace fuzz::calibration_yaml_target {
namespace {

using namespace flexcomp::host;

/// As `identify` writes it: with standard deviations, the geometry's hash, the date, the covariance and what was not told apart.
/// \param is_compact  the covariance with a diagonal and a row of whole numbers
std::string identified(bool is_compact) {
  Calibration c =
      load_calibration(path_of(file_of("tests/data/tx60l_table1.yaml") +
                               "  - {effect: joint_curve, joint: 1, coefficients_rad: [0, 1.0e-4, 0, "
                               "-1.0e-4, 0, 0], sigma_coefficients_rad: [1e-6, 2e-6, 0, 0, 0, 0]}\n"),
                       tx60l());
  stamp(c, tx60l());
  c.date = "2026-03-01T12:30:05Z";
  c.sequence = 7;
  c.sigma.assign(c.terms.terms.size(), 1e-6);
  CovarianceFactor covariance;
  covariance.parameters = {"link1.theta", "link2.theta"};
  covariance.factor = Eigen::MatrixXd::Identity(2, 2) * 1e-6;
  if (is_compact) {
    covariance.own = Eigen::Vector2d(0, 2e-6);
    covariance.scale = Eigen::Vector2d(0, 1e-8);
  }
  c.covariance = covariance;
  c.confounded.push_back({"base.rz", {"link1.theta"}});
  c.at_bound.push_back({"joint_compliance[2]", 1e-7});
  c.residuals = {{"after_mean_mm", 0.05}};
  return calibration_text(c, tx60l());
}

/// What makes each term, in an order that does not depend on that of the links in the file.
auto sorted(const std::vector<flexcomp::Term<double>>& terms) {
  std::vector<std::tuple<unsigned, unsigned, unsigned, unsigned, unsigned, double, double>> all;
  all.reserve(terms.size());
  for (const auto& t : terms) {
    all.emplace_back(t.place.body, t.place.slot, static_cast<unsigned>(t.basis), t.joint,
                     static_cast<unsigned>(t.effect), t.coefficient, t.argument);
  }
  std::sort(all.begin(), all.end());
  return all;
}

void run(Input input) {
  const Robot& robot = tx60l();
  const std::string text = input.text();
  Calibration calibration;
  if (!reads([&] { calibration = load_calibration(path_of(text), robot); })) return;
  const std::string written = calibration_text(calibration, robot);
  Calibration again;
  must_read(written, [&] { again = load_calibration(path_of(written), robot); });
  require_same(written, calibration_text(again, robot), "a calibration file");
  require(sorted(again.terms.terms) == sorted(calibration.terms.terms),
          "other terms are read from what was written");
  require(calibration.terms.values == again.terms.values,
          "other table values are read from what was written");

  never_pushed(calibration, robot);
  for (const Parameter& p : parameters_of(calibration.terms, robot.nominal)) {
    for (const std::size_t t : p.terms) require(t < calibration.terms.terms.size(), "a parameter of no term");
  }

  // Admitted or not; what is no image at all is refused.
  reads([&] { make_image(calibration, robot, 1); });
  std::vector<std::uint8_t> image;
  if (!reads([&] {
        image = make_image(calibration, robot, 1, {.allow_unnamed = true, .allow_inadmissible = true});
      }))
    return;
  Calibration back;
  must_read("(an image)", [&] { back = calibration_from_image(image, robot, "image"); });
  std::vector<std::uint8_t> second;
  must_read("(an image)", [&] {
    second = make_image(back, robot, 1, {.allow_unnamed = true, .allow_inadmissible = true});
  });
  require(image == second, "an image differs when it is read and made again");
}

std::vector<Bytes> seeds() {
  const std::string paper = file_of("tests/data/tx60l_table1.yaml");
  std::vector<Bytes> all{bytes_of(paper)};
  all.push_back(
      bytes_of(paper +
               "  - {effect: joint_curve, joint: 1, coefficients_rad: [0, 1.0e-4, 0, -1.0e-4, 0, 0]}\n"
               "  - {effect: unnamed, place: link3.theta, of: [q2, payload_kg], grid: [[-30, 30], [0, 5]], "
               "values_rad: [[0, 1], [2, 0]]}\n"
               "  - {effect: thermal_growth, link: 4, per_k: 1.0e-6}\n"
               "frames: {f: {xyz_mm: [1, 2, 3], quaternion_wxyz: [1, 0, 0, 0]}, e: {xyz_mm: [1, 2, 3]}}\n"));
  all.push_back(bytes_of(identified(false)));
  all.push_back(bytes_of(identified(true)));
  // Every example of the list of effects.
  const std::string page = file_of("docs/effects.md");
  std::string effects = "effects:\n";
  for (std::size_t at = page.find("- {effect:"); at != std::string::npos;
       at = page.find("- {effect:", at + 1)) {
    const std::string entry = page.substr(at, page.find('\n', at) - at);
    all.push_back(bytes_of("effects:\n  " + entry + "\n"));
    effects += "  " + entry + "\n";
  }
  all.push_back(bytes_of(effects));
  // Each name that a grid and a curve know; refused, each for a reason of its own.
  for (const char* of : {"q1, payload_kg", "temp_c, q2", "time_s, q3", "dir4, temp_c", "speed5, q1",
                         "payload_kg, time_s", "q1, q1", "q7, q1", "q1"})
    all.push_back(bytes_of(std::string("effects:\n  - {effect: unnamed, place: link3.theta, of: [") + of +
                           "], grid: [[-1, 1], [0, 2]], values_rad: [[0, 1e-4], [1e-4, 0]]}\n"));
  for (const char* factor : {"load_torque", "temperature", "payload", "none"})
    all.push_back(bytes_of(std::string("effects:\n  - {effect: joint_curve, joint: 1, factor: ") + factor +
                           ", coefficients_rad: [0, 1e-4, 0, 1e-4, 0, 0], coefficients_rad_per_nm: [0, 1e-4, "
                           "0, 1e-4, 0, 0], coefficients_rad_per_k: [0, 1e-4, 0, 1e-4, 0, 0]}\n"));
  for (const char* text :
       {"geometric:\n  - {link: 1, d_mm: 1}\n  - {link: 1, a_mm: 1}\n",
        "geometric:\n  - {link: 1, d_mm: 1000}\n",
        "effects:\n  - {effect: backlash, joint: 2, half_gap_rad: 1e-4}\n  - {effect: backlash, joint: 2, "
        "half_gap_rad: 1e-4}\n",
        "effects:\n  - {effect: unnamed, place: link3.theta, of: [q2, q3], grid: [[-1, 1], [0, 2]], "
        "values_rad: [[0, 1]]}\n",
        "effects:\n  - {effect: unnamed, place: link3.theta, of: [q2, q3], grid: [[-1, 1], [0, 2]], "
        "values_rad: [[0], [1]]}\n",
        "effects:\n  - {effect: unnamed, place: link3.theta, of: [q2, q3], grid: [[1, -1], [0, 2]], "
        "values_rad: [[0, 1], [1, 0]]}\n",
        "effects:\n  - {effect: joint_coupling, joint: 6, gain: 1e-4}\n", "robot: another\n",
        "effects:\n  - {effect: joint_coupling, joint: 6, from: 6, gain: 1e-4}\n",
        "nominal_hash: 0000000000000000000000000000000000000000000000000000000000000000\n",
        "covariance_factor:\n  - {parameter: a, row: [1]}\n  - {parameter: a, row: [1, 2]}\n",
        "covariance_factor:\n  - {parameter: a, row: [1]}\n  - {parameter: b, row: [1]}\n",
        "tool: {x_mm: 1, rz_deg: 0.1}\nbase: {z_mm: 1, sigma_z_mm: 0.1}\n"})
    all.push_back(bytes_of(text));
  return all;
}

const Register registered({"calibration_yaml", run, seeds, mutate_words<yaml_words>});

}  // namespace
}  // namespace fuzz::calibration_yaml_target
