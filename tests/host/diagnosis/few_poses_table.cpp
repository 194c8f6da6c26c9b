// SPDX-License-Identifier: Apache-2.0
// The table of docs/diagnosis.md: mean error of rows that were not fitted, by the number of poses, beside the two oracles.
//
//   few_poses [--series ur10-a|ur10-b|ur5] [--poses N] [--draws N] [--without-processes]
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include "diagnosis/diagnose.hpp"
#include "host/diagnosis/few_poses.hpp"

using namespace flexcomp::host;

int main(int count, char** arguments) {
  std::vector<std::string> all_series{"ur10-a", "ur10-b", "ur5"};
  std::vector<std::size_t> all_poses{20, 40, 100, 200, 500};
  unsigned draws = 5;
  bool processes = true;
  for (int k = 1; k < count; ++k) {
    const std::string option = arguments[k];
    if (option == "--without-processes") {
      processes = false;
    } else if (k + 1 < count && option == "--series") {
      all_series = {arguments[++k]};
    } else if (k + 1 < count && option == "--poses") {
      all_poses = {static_cast<std::size_t>(std::atol(arguments[++k]))};
    } else if (k + 1 < count && option == "--draws") {
      draws = static_cast<unsigned>(std::atol(arguments[++k]));
    } else {
      std::fprintf(stderr, "few_poses: unknown option %s\n", arguments[k]);
      return 2;
    }
  }
  std::printf("mean position error of rows that were not fitted, mm; means of %u draws\n", draws);
  std::printf("%-8s %6s %9s %9s %9s %9s %15s\n", "series", "poses", "identify", "diagnose", "ridge",
              "processes", "diagnose/ridge");
  double log_sum = 0;
  int cells = 0;
  for (const std::string& series : all_series) {
    for (const std::size_t poses : all_poses) {
      double identified = 0, diagnosed = 0, ridge = 0, process = 0;
      for (unsigned draw = 0; draw < draws; ++draw) {
        const auto rows = few_poses(series, poses, draw);
        if (!rows) {
          std::puts("REAL DATA: not run");
          return 77;
        }
        const Identification start = identify(rows->robot, rows->train, series, {});
        DiagnoseOptions options;
        options.columns = rows->columns;
        const Diagnosis d = diagnose(rows->robot, rows->train, series, options);
        identified += mean_with(*rows, start.calibration) / draws;
        diagnosed += mean_with(*rows, d.after) / draws;
        ridge += mean_of_ridge(*rows, start) / draws;
        if (processes) process += mean_of_gaussian_processes(*rows, start) / draws;
      }
      std::printf("%-8s %6zu %9.3f %9.3f %9.3f %9.3f %15.3f\n", series.c_str(), poses, identified * 1e3,
                  diagnosed * 1e3, ridge * 1e3, processes ? process * 1e3 : std::nan(""), diagnosed / ridge);
      std::fflush(stdout);
      if (poses > 200) continue;
      log_sum += std::log(diagnosed / ridge);
      ++cells;
    }
  }
  if (cells > 0)
    std::printf("geometric mean of diagnose/ridge up to 200 poses: %.3f\n", std::exp(log_sum / cells));
}
