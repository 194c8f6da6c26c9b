// SPDX-License-Identifier: Apache-2.0
// Where a correction changes fastest with the command, and what stays at random poses: six arms with Table 1 of the paper. For
// people; slope_test.cpp holds a minute's findings.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "support/slope_search.hpp"

namespace {

struct Options {
  std::string_view arm;
  double seconds = 20;
  long evaluations = 0;
  std::uint64_t seed = 1;
  double scale = 1;
  double step_rad = slopes::step_rad;
  int poses = 20000;
  flexcomp::CompensationSettings<double> settings;
};

int usage() {
  std::fputs(
      "slope_search: greatest slope of the correction over the command, and the poses at which error stays\n"
      "  --arm NAME        only this one of six\n"
      "  --seconds S       of search for each arm (20)\n"
      "  --evaluations N   of search for each arm, in place of seconds\n"
      "  --seed N          of random numbers (1)\n"
      "  --steepest K      setting of the compensation (100)\n"
      "  --largest C       largest correction of a joint, rad (0.1)\n"
      "  --scale X         times Table 1 (1)\n"
      "  --step H          of the differences, rad (5e-6)\n"
      "  --poses N         for the share with error left (20000)\n",
      stderr);
  return 2;
}

bool read(int argc, char** argv, Options& o) {
  for (int k = 1; k < argc; k += 2) {
    if (k + 1 == argc) return false;
    const std::string_view name = argv[k];
    const char* const value = argv[k + 1];
    if (name == "--arm") {
      o.arm = value;
    } else if (name == "--seconds") {
      o.seconds = std::strtod(value, nullptr);
    } else if (name == "--evaluations") {
      o.evaluations = std::strtol(value, nullptr, 10);
    } else if (name == "--seed") {
      o.seed = std::strtoull(value, nullptr, 10);
    } else if (name == "--steepest") {
      o.settings.steepest = std::strtod(value, nullptr);
    } else if (name == "--largest") {
      o.settings.largest_correction_rad = std::strtod(value, nullptr);
    } else if (name == "--scale") {
      o.scale = std::strtod(value, nullptr);
    } else if (name == "--step") {
      o.step_rad = std::strtod(value, nullptr);
    } else if (name == "--poses") {
      o.poses = static_cast<int>(std::strtol(value, nullptr, 10));
    } else {
      return false;
    }
  }
  return true;
}

void search(const arms::Arm& arm, const Options& o) {
  const slopes::Subject s = slopes::subject(arm, o.settings, o.scale);
  arms::Random random(o.seed);
  slopes::Found best;
  long taken = 0;
  const auto from = std::chrono::steady_clock::now();
  const auto elapsed = [from] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - from).count();
  };
  while (o.evaluations > 0 ? taken < o.evaluations : elapsed() < o.seconds) {
    slopes::climb(s, random, o.step_rad, best);
    taken += slopes::climb_evaluations;
  }
  std::printf("%-7s slope %.1f at", arm.name, best.slope);
  for (const double v : best.q) std::printf(" %.9f", v);
  const slopes::Share left = slopes::share(s, o.poses, o.seed + 1);
  std::printf(
      "; not ok %.2f %%; left: %.2f %% above 0.02 mm, %.2f %% above 1 mrad, most %.2f mm, %.0f mrad; worse "
      "than before "
      "%.3f %%, by %.2f mm (%ld evaluations)\n",
      100 * left.held, 100 * left.position, 100 * left.orientation, 1e3 * left.most_m, 1e3 * left.most_rad,
      100 * left.worse, 1e3 * left.worse_m, taken);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) try {
  Options options;
  if (!read(argc, argv, options)) return usage();
  bool found = false;
  for (const arms::Arm& arm : arms::six()) {
    if (!options.arm.empty() && options.arm != arm.name) continue;
    found = true;
    search(arm, options);
  }
  return found ? 0 : usage();
} catch (...) {
  std::fputs("slope_search: out of memory\n", stderr);
  return 1;
}
