// SPDX-License-Identifier: Apache-2.0
#include "files/calibration_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <random>
#include <utility>

#include "flexcomp/image.hpp"
#include "identification/fitted_calibration.hpp"
#include "model/effects.hpp"
#include "model/parameter_image.hpp"
#include "support/curved_fit.hpp"
#include "support/robot_files.hpp"
#include "support/text_file.hpp"

namespace calibration_files {

using namespace flexcomp::host;
using namespace flexcomp;
using support::expect_refused;
using support::replaced;
using support::tx60l;
using testing::HasSubstr;

// Every key of docs/effects.md.
const std::string full =
    "robot: staubli-tx60l\n"                                                                             // 1
    "geometric:\n"                                                                                       // 2
    "  - {link: 1, theta_deg: -0.08, d_mm: -0.4, a_mm: 0.09, alpha_deg: 0.03}\n"                         // 3
    "  - {link: 2, theta_deg: -0.04, a_mm: -0.05, alpha_deg: 0.02, beta_deg: 0.03, sigma_a_mm: 0.01}\n"  // 4
    "base: {x_mm: 0.3, y_mm: -0.2, z_mm: 0.1, rx_deg: 0.02, ry_deg: 0.01, rz_deg: 0.01}\n"               // 5
    "tool: {x_mm: 0, y_mm: 0, z_mm: 0, rx_deg: 0, ry_deg: 0, rz_deg: 0.5}\n"                             // 6
    "effects:\n"                                                                                         // 7
    "  - {effect: joint_compliance, joint: 2, rad_per_nm: 1.5e-5, sigma_rad_per_nm: 1.0e-7}\n"           // 8
    "  - {effect: link_gravity, k1_rad: 0.0015, k2_rad: 0.00123, k3_rad: 0.00054}\n"
    "  - {effect: nonlinear_compliance, joint: 3, rad_per_nm3: 3.5e-7}\n"                      // 10
    "  - {effect: gear_harmonic, joint: 3, order: 1, sin_rad: 1.0e-4, cos_rad: 2.0e-5}\n"      // 11
    "  - {effect: gear_harmonic, joint: 3, order: 100.5, sin_rad: 1.0e-4}\n"                   // 12
    "  - {effect: joint_curve, joint: 1, coefficients_rad: [0, 1.0e-4, 0, -1.0e-4, 0, 0], "    // 13
    "sigma_coefficients_rad: [1.0e-6, 1.0e-6, 1.0e-6, 1.0e-6, 1.0e-6, 1.0e-6]}\n"              //
    "  - {effect: backlash, joint: 2, half_gap_rad: 7.0e-5}\n"                                 // 14
    "  - {effect: readout_lag, joint: 1, rad: 1.2e-3}\n"                                       // 15
    "  - {effect: encoder_scale, joint: 3, gain: 2.0e-4}\n"                                    // 16
    "  - {effect: joint_coupling, joint: 6, from: 5, gain: 2.0e-4}\n"                          // 17
    "  - {effect: axis_wobble, joint: 2, order: 1, alpha_sin_rad: 1.0e-4, alpha_cos_rad: 0, "  // 18
    "gamma_sin_rad: 0, gamma_cos_rad: 0}\n"
    "  - {effect: link_bending, link: 3, alpha_rad_per_nm: 1.0e-6, beta_rad_per_nm: 0}\n"  // 19
    "  - {effect: thermal_growth, per_k: 12.0e-6}\n"                                       // 20
    "  - {effect: thermal_growth, link: 4, per_k: 1.0e-6}\n"                               // 21
    "  - {effect: base_drift, x_mm_per_h: 0.02, y_mm_per_h: 0, z_mm_per_h: 0, rx_deg_per_h: 0, "
    "ry_deg_per_h: 0, rz_deg_per_h: 0}\n"                                                              // 22
    "  - {effect: base_compliance, pivot_z_mm: -375, rx_rad_per_nm: 1.0e-7, ry_rad_per_nm: 1.0e-7}\n"  // 23
    "  - {effect: payload_error, mass_kg: 0.1, com_x_mm: 0, com_y_mm: 0, com_z_mm: 0}\n"               // 24
    "  - {effect: reflector_slip, after_s: 3600, x_mm: 0.1, y_mm: 0, z_mm: 0}\n"                       // 25
    "  - {effect: unnamed, place: link3.theta, of: [q2, payload_kg], grid: [[-30, 0, 30], [0, 5]], "   // 26
    "values_rad: [[0, 1.0e-4], [2.0e-4, 0], [0, 3.0e-4]]}\n"                                           //
    "frames:\n"                                                                                        // 27
    "  f: {xyz_mm: [1000, -2000, 300], quaternion_wxyz: [0.5, 0.5, 0.5, 0.5]}\n"                       // 28
    "  e: {xyz_mm: [1, 2, 3], quaternion_wxyz: [1, 0, 0, 0]}\n"                                        // 29
    "confounded: [{parameter: base.z_mm, with: [link1.d_mm, \"joint_compliance[joint=1].rad_per_nm\"]}]\n"  // 30
    "residuals: {before_mean_mm: 1.4, after_mean_mm: 0.15}\n"  // 31
    "sequence: 4294967295\n";                                  // 32

Calibration load(const std::string& text) {
  return load_calibration(support::write("calibration.yaml", text), tx60l());
}

void refused(const std::string& text, std::size_t line, const std::string& field,
             const std::vector<std::string>& parts = {}) {
  expect_refused([&] { load(text); }, line, field, parts);
}

bool same_bits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

void expect_identical(const TermSet& a, const TermSet& b) {
  ASSERT_EQ(a.terms.size(), b.terms.size());
  for (std::size_t k = 0; k < a.terms.size(); ++k) {
    const Term<double>& x = a.terms[k];
    const Term<double>& y = b.terms[k];
    EXPECT_TRUE(x.place == y.place && x.basis == y.basis && x.joint == y.joint && x.factor == y.factor &&
                x.effect == y.effect && x.instance == y.instance && x.table == y.table &&
                x.distal_joint == y.distal_joint)
        << k;
    EXPECT_TRUE(same_bits(x.argument, y.argument)) << k;
    EXPECT_TRUE(same_bits(x.coefficient, y.coefficient)) << k << " " << x.coefficient << " " << y.coefficient;
  }
  ASSERT_EQ(a.values.size(), b.values.size());
  for (std::size_t k = 0; k < a.values.size(); ++k) EXPECT_TRUE(same_bits(a.values[k], b.values[k])) << k;
  ASSERT_EQ(a.tables.size(), b.tables.size());
}

TEST(CalibrationFile, OneDocumentAndEachParameterOfTheCovarianceOnce) {
  const std::string factor =
      "covariance_factor:\n  - {parameter: link1.d_mm, row: [1.0e-6]}\n  - {parameter: link1.theta_deg, row: "
      "[0, 1.0e-6]}\n";
  EXPECT_TRUE(load("robot: staubli-tx60l\n" + factor).covariance.has_value());
  refused("robot: staubli-tx60l\n" + replaced(factor, "link1.theta_deg", "link1.d_mm"), 4,
          "covariance_factor[2].parameter", {"each parameter once"});
  refused("robot: staubli-tx60l\n---\nrobot: another\n", 3, "", {"one YAML document"});
  // What is left behind a document, which yaml-cpp's own list of documents never ends with.
  EXPECT_THROW(load("\",\"\nname: Pose\ntime: {cem\"}\n"), InputError);
}

/// Rows of a low-rank factor: two dense ones, two of whole numbers.
const std::string compact =
    "covariance_factor:\n"                                                         // 1
    "  - {parameter: link1.d_mm, row: [1.0e-6]}\n"                                 // 2
    "  - {parameter: a_curve, scale: 2.5e-9, row: [-12, 3, 0, 7], own: 3.0e-6}\n"  // 3
    "  - {parameter: link1.theta_deg, row: [5.0e-7, 2.0e-6], own: 0}\n"            // 4
    "  - {parameter: another, scale: 1.0e-8, row: []}\n"                           // 5
    "robot: staubli-tx60l\n";                                                      // 6

TEST(CalibrationFile, ReadsALowRankFactor) {
  const Calibration c = load(compact);
  ASSERT_TRUE(c.covariance);
  ASSERT_EQ(c.covariance->factor.rows(), 4);
  ASSERT_EQ(c.covariance->factor.cols(), 4);
  EXPECT_EQ(c.covariance->factor.row(0), Eigen::RowVector4d(1e-6, 0, 0, 0));
  EXPECT_EQ(c.covariance->factor.row(1), Eigen::RowVector4d(-12 * 2.5e-9, 3 * 2.5e-9, 0, 7 * 2.5e-9));
  EXPECT_EQ(c.covariance->factor.row(2), Eigen::RowVector4d(5e-7, 2e-6, 0, 0));
  EXPECT_EQ(c.covariance->factor.row(3), Eigen::RowVector4d::Zero());
  EXPECT_EQ(c.covariance->own, Eigen::Vector4d(0, 3e-6, 0, 0));
  EXPECT_EQ(c.covariance->scale, Eigen::Vector4d(0, 2.5e-9, 0, 1e-8));
  const std::string text = calibration_text(c, tx60l());
  EXPECT_THAT(text, HasSubstr("scale: 2.5e-09, row: [-12,3,0,7], own: 3.0e-06}"));
  EXPECT_EQ(calibration_text(load(text), tx60l()), text);
  // `own` alone says that the rows need not be a lower triangle, even where it is zero.
  const Calibration zero = load(
      "covariance_factor:\n  - {parameter: a, row: [1.0e-6, 2.0e-6], own: 0}\n"
      "  - {parameter: b, row: []}\n");
  const std::string again = calibration_text(zero, tx60l());
  EXPECT_EQ(load(again).covariance->factor, zero.covariance->factor);
  EXPECT_EQ(calibration_text(load(again), tx60l()), again);
}

TEST(CalibrationFile, RefusesAWrongLowRankFactor) {
  const auto wrong = [](const std::string& from, const std::string& to, std::size_t line,
                        const std::string& field, const std::vector<std::string>& parts = {}) {
    refused(replaced(compact, from, to), line, "covariance_factor" + field, parts);
  };
  wrong("[-12, 3, 0, 7]", "[-12, 3, 0, 7, 1]", 3, "[2].row", {"at most 4 numbers", "5"});
  wrong("[1.0e-6]", "[1, 2, 3, 4, 5]", 2, "[1].row", {"at most 4 numbers", "5"});
  wrong("[-12, 3", "[-12, 3.5", 3, "[2].row[2]", {"an integer from -999999 to 999999", "'3.5'"});
  wrong("[-12, 3", "[-1000000, 3", 3, "[2].row[1]", {"an integer from -999999 to 999999"});
  wrong("[-12, 3", "[-12, three", 3, "[2].row[2]", {"an integer"});
  wrong("[-12, 3", "[[-12], 3", 3, "[2].row[1]", {"an integer", "a list of 1"});
  wrong("row: [-12, 3, 0, 7]", "row: 7", 3, "[2].row", {"a list"});
  wrong("row: [-12, 3, 0, 7], ", "", 3, "[2].row", {"this key"});
  wrong("[5.0e-7, 2.0e-6]", "[5.0e-7, .inf]", 4, "[3].row[2]", {"a finite number"});
  wrong("2.5e-9", "0", 3, "[2].scale", {"a number above 0", "'0'"});
  wrong("2.5e-9", "-2.5e-9", 3, "[2].scale", {"a number above 0"});
  wrong("2.5e-9", ".inf", 3, "[2].scale", {"a finite number"});
  wrong("2.5e-9", ".nan", 3, "[2].scale", {"a finite number"});
  wrong("2.5e-9", "1.0e+308", 3, "[2].row[1]", {"a finite number, times scale"});
  wrong("own: 3.0e-6", "own: -3.0e-6", 3, "[2].own", {"a standard deviation of 0 or more", "'-3.0e-6'"});
  wrong("own: 3.0e-6", "own: .nan", 3, "[2].own", {"a finite number"});
  wrong("own: 3.0e-6", "own: 3.0e-6, own: 0", 3, "[2].own", {"each key once"});
  wrong("scale: 1.0e-8", "scale: 1.0e-8, scale: 1.0e-8", 5, "[4].scale", {"each key once"});
  wrong("own: 3.0e-6", "owns: 3.0e-6", 3, "[2].owns", {"did you mean 'own'"});
  wrong("another", "a_curve", 5, "[4].parameter", {"each parameter once"});
  // Without the keys of a low-rank factor a lower triangle, as ever.
  refused("covariance_factor:\n  - {parameter: a, row: [1]}\n  - {parameter: b, row: [1]}\n", 3,
          "covariance_factor[2]", {"2 numbers: a lower triangle", "1"});
}

TEST(CalibrationFile, OfSixCurvesIsSmallAndQuicklyRead) {
  const support::CurvedFit many(tx60l(), 100);
  const Calibration c = fitted_calibration(many.fit, many.unknowns, many.robot, many.rows);
  ASSERT_EQ(c.covariance->parameters.size(), 6 * curve_coefficients + 45);
  const std::string path = support::path_of("six_curves.yaml");
  save_calibration(path, c, tx60l());
  const auto bytes = std::filesystem::file_size(path);
  const std::clock_t begin = std::clock();
  const Calibration again = load_calibration(path, tx60l());
  const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  std::printf("  six curves: %zu bytes, read in %.2f s\n", static_cast<std::size_t>(bytes), seconds);
  EXPECT_LE(bytes, 500'000U);
  // Measured: 0.4 s, with a sanitizer on a busy machine 1.4 s.
  EXPECT_LT(seconds, 5);
  EXPECT_EQ(calibration_text(again, tx60l()), support::read(path));
  // The curves' rows are read to the last bit; the others have nine digits, `own` six.
  ASSERT_EQ(again.covariance->factor.cols(), c.covariance->factor.cols());
  EXPECT_EQ(again.covariance->scale, c.covariance->scale);
  EXPECT_EQ(again.covariance->factor.bottomRows(768), c.covariance->factor.bottomRows(768));
  for (Eigen::Index i = 0; i < c.covariance->factor.rows(); ++i) {
    EXPECT_NEAR(again.covariance->sigma(i) / c.covariance->sigma(i), 1, 1e-5);
    EXPECT_NEAR((again.covariance->factor.row(i) - c.covariance->factor.row(i)).norm(), 0,
                1e-8 * c.covariance->sigma(i));
  }
}

TEST(CalibrationFile, ReadsEveryKeyOfTheCatalogue) {
  const Calibration c = load(full);
  EXPECT_EQ(c.robot, "staubli-tx60l");
  EXPECT_EQ(effects_of(c.terms, tx60l().nominal).size(), 19U);
  EXPECT_EQ(c.terms.terms[0].coefficient, radians(-0.08));
  EXPECT_EQ(c.sigma.size(), c.terms.terms.size());
  EXPECT_TRUE(std::isnan(c.sigma[0]));
  EXPECT_DOUBLE_EQ(c.sigma[5], 1e-5);
  ASSERT_TRUE(c.frames);
  EXPECT_EQ(c.frames->f.position_m, Eigen::Vector3d(1, -2, 0.3));
  EXPECT_EQ(c.confounded.at(0).with.at(1), "joint_compliance[joint=1].rad_per_nm");
  EXPECT_EQ(c.residuals.at(1).second, 0.15);
  EXPECT_EQ(c.sequence, 4294967295U);
  const auto drift = std::find_if(c.terms.terms.begin(), c.terms.terms.end(),
                                  [](const auto& t) { return t.effect == Effect::base_drift; });
  EXPECT_DOUBLE_EQ(drift->coefficient * 3600, 0.02e-3);
  EXPECT_DOUBLE_EQ(c.terms.values[6], radians(-30));  // nodes in radians, after the curve's six values
}

TEST(CalibrationFile, TextReadsBackIdentically) {
  Calibration c = load(full);
  stamp(c, tx60l());
  const std::string text = calibration_text(c, tx60l());
  const Calibration again = load(text);
  expect_identical(c.terms, again.terms);
  EXPECT_EQ(calibration_text(again, tx60l()), text);
  EXPECT_EQ(again.nominal_hash, nominal_hash(tx60l().nominal));
  EXPECT_EQ(again.frames->f.orientation.coeffs(), c.frames->f.orientation.coeffs());
  EXPECT_FALSE(again.tool_version.empty());
  EXPECT_DOUBLE_EQ(again.sigma[5], 1e-5);
  EXPECT_DOUBLE_EQ(again.value_sigma[2], 1e-6);
}

/// Coefficients with random bits, of sizes that occur and of all others.
double random_coefficient(std::mt19937_64& random) {
  if (random() % 3 == 0) return std::uniform_real_distribution<double>(-1e-3, 1e-3)(random);
  for (;;) {
    const double v = double_of(random());
    if (std::abs(v) < 1e-3 && (std::abs(v) > 1e-290 || v == 0)) return v;
  }
}

/// With what is not understood.
std::vector<std::uint8_t> image_of(const Calibration& calibration, std::uint32_t sequence = 1) {
  return make_image(calibration, tx60l(), sequence, {.allow_unnamed = true});
}

TEST(CalibrationFile, ImageToFileToImageIsTheIdentityOnBytes) {
  std::mt19937_64 random(3);
  for (int round = 0; round < 200; ++round) {
    Calibration c = load(full);
    c.frames.reset();
    for (Term<double>& t : c.terms.terms) {
      if (t.table == no_table && t.effect != Effect::thermal_growth)
        t.coefficient = random_coefficient(random);
    }
    for (std::size_t k = 0; k < 6; ++k) c.terms.values[k] = random_coefficient(random);
    // No arm has such coefficients.
    const ImageOptions any{.allow_unnamed = true, .allow_inadmissible = true};
    const auto image = make_image(c, tx60l(), 7, any);
    Calibration pulled = calibration_from_image(image, tx60l(), "bus");
    stamp(pulled, tx60l());
    const std::string path = support::path_of("pulled.yaml");
    save_calibration(path, pulled, tx60l());
    const Calibration read = load_calibration(path, tx60l());
    ASSERT_EQ(make_image(read, tx60l(), read.sequence.value(), any), image);
  }
}

TEST(Image, LeavesOutWhatBelongsToTheMeasurement) {
  const Calibration c = load(full);
  const Calibration pulled = calibration_from_image(image_of(c), tx60l(), "bus");
  for (const Term<double>& t : pulled.terms.terms) {
    EXPECT_FALSE(belongs_to_measurement(t.effect));
    EXPECT_FALSE(t.effect == Effect::geometric && t.place.body == body::base) << "frames are fitted";
  }
  Calibration nominal_frames = c;
  nominal_frames.frames.reset();
  const Calibration with_base = calibration_from_image(image_of(nominal_frames), tx60l(), "bus");
  EXPECT_EQ(with_base.terms.terms.size(), pulled.terms.terms.size() + 6);
}

TEST(Image, IsTheSameWhateverTheOrderOfTheTerms) {
  const Calibration c = load(full);
  Calibration turned = c;
  std::reverse(turned.terms.terms.begin(), turned.terms.terms.begin() + 20);
  std::reverse(turned.terms.terms.begin(), turned.terms.terms.begin() + 4);
  EXPECT_NE(turned.terms.terms[0].place, c.terms.terms[0].place);
  EXPECT_EQ(image_of(turned), image_of(c));
}

TEST(Image, RefusesWhatIsNotUnderstoodOrTooLarge) {
  const Calibration c = load(full);
  expect_refused([&] { make_image(c, tx60l(), 1); }, 0, "effects",
                 {"effects that are understood", "link3.theta"});
  Calibration large = c;
  for (Term<double>& t : large.terms.terms) {
    if (t.place == Place{body::tool, slot::rz}) t.coefficient = radians(3);
  }
  expect_refused([&] { image_of(large); }, 0, "tool.rz_deg", {"20 mm"});
}

TEST(Image, RefusesEveryTruncationAndEveryAlteredByte) {
  const auto image = image_of(load(full));
  for (std::size_t size = 0; size < image.size(); ++size) {
    EXPECT_THROW(calibration_from_image(std::span(image).first(size), tx60l(), "file"), InputError) << size;
  }
  for (std::size_t k = 0; k < image.size(); ++k) {
    auto altered = image;
    altered[k] = static_cast<std::uint8_t>(altered[k] ^ 0x10U);
    EXPECT_THROW(calibration_from_image(altered, tx60l(), "file"), InputError) << k;
  }
  const Robot other = support::robot("ur5");
  expect_refused([&] { calibration_from_image(image, other, "can:vcan0"); }, 0, "",
                 {"can:vcan0", "another robot"});
}

TEST(Image, IsBoundToTheUnitThatTheRobotFileNames) {
  const Calibration c = load(full);
  Robot here = tx60l();
  set_serial(here, "A-1");
  Robot there = tx60l();
  set_serial(there, "B-2");
  const auto image = make_image(c, here, 1, {.allow_unnamed = true});
  const auto unbound = image_of(c);
  EXPECT_EQ(image_records(image, "i").unit_hash, here.nominal.unit_hash);
  EXPECT_FALSE(is_given(image_records(unbound, "i").unit_hash));
  EXPECT_EQ(image[5], 1);
  EXPECT_EQ(unbound[5], 0);
  EXPECT_EQ(image.size(), unbound.size() + 36);
  // The terms are the same; a robot that names no unit reads any, and an image for any unit is read with any.
  for (const Robot* robot : {&std::as_const(here), &tx60l()}) {
    Calibration back = calibration_from_image(image, *robot, "bus");
    EXPECT_EQ(image_of(back), unbound);
  }
  EXPECT_NO_THROW(calibration_from_image(unbound, there, "bus"));
  expect_refused([&] { calibration_from_image(image, there, "a.bin"); }, 0, "",
                 {"a.bin", hex(here.nominal.unit_hash).substr(0, 12), "not for unit 'B-2'"});
  EXPECT_EQ(without_signature(image, "i"), image);
  for (std::size_t size = 0; size < image.size(); ++size) {
    EXPECT_THROW(image_records(std::span(image).first(size), "i"), InputError) << size;
    EXPECT_THROW(without_signature(std::span(image).first(size), "i"), InputError) << size;
  }
}

TEST(Image, RefusesATableThatSaysItIsLarger) {
  std::vector<std::uint8_t> image = make_image(load(full), tx60l(), 1, {.allow_unnamed = true});
  int tables = 0;
  for (std::size_t at = image::header_bytes; !at_end({.at = at}, image.size());
       at += image::record_head_bytes + load_u16(image.data() + at + 2)) {
    if (load_u16(image.data() + at) != image::record_table || load_u16(image.data() + at + 4) == 0) continue;
    ++tables;
    std::vector<std::uint8_t> altered = image;
    store_u16(altered.data() + at + 4, 60);
    store_u32(altered.data() + altered.size() - 4, crc32(altered.data(), altered.size() - 4));
    EXPECT_THROW(calibration_from_image(altered, tx60l(), "bus"), InputError);
  }
  EXPECT_GT(tables, 0);
}

TEST(CalibrationFile, RefusesUnknownNamesWithTheNearest) {
  refused(replaced(full, "geometric:", "geometrics:"), 2, "geometrics", {"did you mean 'geometric'"});
  refused(replaced(full, "a_mm: 0.09", "a_m: 0.09"), 3, "geometric[1].a_m", {"a_mm"});
  refused(replaced(full, "gear_harmonic, joint: 3, order: 1,", "gear_harmonics, joint: 3, order: 1,"), 11,
          "effects[4].effect", {"did you mean 'gear_harmonic'"});
  refused(replaced(full, "half_gap_rad", "gap_rad"), 14, "effects[7].gap_rad", {"half_gap_rad"});
  refused(replaced(full, "x_mm: 0.3", "sigma_q_mm: 0.3"), 5, "base.sigma_q_mm");
  refused(replaced(full, "link3.theta", "link3.thata"), 26, "effects[19].place");
  refused(replaced(full, "[q2, payload_kg]", "[q7, payload_kg]"), 26, "effects[19].of[1]");
}

TEST(CalibrationFile, RefusesWhatIsOutOfRange) {
  refused(replaced(full, "link: 2,", "link: 7,"), 4, "geometric[2].link", {"from 1 to 6"});
  refused(replaced(full, "link: 2,", "link: 1,"), 4, "geometric[2]", {"link 1 again (first in line 3)"});
  refused(replaced(full, "x_mm: 0.3", "x_mm: 20.1"), 5, "base.x_mm", {"20 mm and 2 deg"});
  refused(replaced(full, "rz_deg: 0.5", "rz_deg: -2.1"), 6, "tool.rz_deg", {"20 mm and 2 deg"});
  refused(replaced(full, "1.5e-5", ".nan"), 8, "effects[1].rad_per_nm", {"finite"});
  refused(replaced(full, "sigma_rad_per_nm: 1.0e-7", "sigma_rad_per_nm: -1"), 8,
          "effects[1].sigma_rad_per_nm");
  refused(replaced(full, "rad_per_nm: 1.5e-5, ", ""), 8, "effects[1].sigma_rad_per_nm",
          {"beside rad_per_nm"});
  refused(replaced(full, "order: 1,", "order: 0,"), 11, "effects[4].order", {"above 0"});
  refused(replaced(full, "order: 100.5, sin_rad: 1.0e-4", "order: 1, sin_rad: 1.0e-4"), 12, "effects[5]",
          {"gear_harmonic[joint=3,order=1] again (first in line 11)"});
  refused(replaced(full, "[0, 1.0e-4, 0, -1.0e-4, 0, 0]", "[0, 1.0e-4, 0]"), 13, "effects[6]",
          {"6 to 256 coefficients"});
  refused(replaced(full, "from: 5", "from: 6"), 17, "effects[10]", {"two joints"});
  refused(replaced(full, "link: 4, per_k", "link: 1, per_k"), 21, "effects[14]", {"nominal length"});
  refused(replaced(full, "[[-30, 0, 30]", "[[-30, 30, 0]"), 26, "effects[19]", {"ascending"});
  refused(replaced(full, "[2.0e-4, 0]", "[2.0e-4]"), 26, "effects[19].values_rad[2]", {"2 values"});
  refused(replaced(full, "[0.5, 0.5, 0.5, 0.5]", "[0.5, 0.5, 0.5, 0.6]"), 28, "frames.f.quaternion_wxyz",
          {"norm"});
  refused(replaced(full, "4294967295", "4294967296"), 32, "sequence");
}

TEST(CalibrationFile, RefusesAnotherRobot) {
  refused(replaced(full, "staubli-tx60l", "ur5"), 1, "robot", {"'staubli-tx60l'", "'ur5'"});
  Calibration c = load(full);
  stamp(c, tx60l());
  const std::string text = calibration_text(c, tx60l());
  Robot other = tx60l();
  other.nominal.links[1].a_m += 1e-6;
  const std::string path = support::write("calibration.yaml", text);
  expect_refused([&] { load_calibration(path, other); }, 3, "nominal_hash", {"another geometry"});
  refused(replaced(text, hex(*c.nominal_hash), "12"), 3, "nominal_hash", {"64 hexadecimal digits"});
}

TEST(CalibrationFile, IsWrittenWholeOrNotAtAll) {
  const Calibration c = load(full);
  EXPECT_THROW(save_calibration(support::path_of("no/such/folder.yaml"), c, tx60l()), std::runtime_error);
  const std::string path = support::path_of("whole.yaml");
  save_calibration(path, c, tx60l());
  save_calibration(path, c, tx60l());
  for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::path(path).parent_path())) {
    EXPECT_THAT(entry.path().string(), testing::Not(HasSubstr(".new-")));
  }
}

}  // namespace calibration_files
