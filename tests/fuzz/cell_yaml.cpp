// SPDX-License-Identifier: Apache-2.0
// The other YAML files: cells, tolerances, maps of logs. The first byte chooses.
#include "exchange/robot_log.hpp"
#include "files/cell_file.hpp"
#include "files/tolerance_file.hpp"
#include "host_text.hpp"

namespace fuzz::cell_yaml_target {
namespace {

using namespace flexcomp::host;

void run(Input input) {
  const unsigned which = input.u8() % 3;
  const std::string path = path_of(input.text());
  reads([&] {
    if (which == 0) {
      const Cell cell = load_cell(path);
      require(std::isfinite(cell.safety) && cell.safety >= 0 && cell.acceptance_rad > 0,
              "a cell that means nothing");
      for (const Capsule& c : cell.obstacles)
        require(c.radius_m > 0 && c.from_m.allFinite() && c.to_m.allFinite(),
                "an obstacle that means nothing");
    } else if (which == 1) {
      for (const Tolerance& t : load_tolerances(path))
        require(t.sigma > 0 && std::isfinite(t.expected), "a tolerance that means nothing");
    } else {
      load_log_map(path);
    }
  });
}

std::vector<Bytes> seeds() {
  return {
      with_options({0}, file_of("docs/examples/cell.yaml")),
      with_options({0},
                   "tracker_mm: [2000, 0, 1000]\nobstacles:\n  - {from_mm: [0, 0, 0], to_mm: [0, 0, 500], "
                   "radius_mm: 20}\nsafety: 2\nacceptance_deg: 45\n"),
      with_options({1}, "tolerances:\n  link*.d_mm: 0.5\n  link3.theta_deg: {expected: 0.1, sigma: 0.05}\n"),
      with_options({2},
                   "delimiter: \";\"\ndecimal: \",\"\nname: Pose\ntime: {column: Zeit, unit: ms}\njoints:\n"
                   "  - {column: A_1, unit: deg}\n  - {column: A_2, unit: deg, sign: -1, offset_deg: 90}\n"
                   "  - {column: A_3, unit: rad, offset_deg: -90}\n  - {column: A_4, unit: deg}\n"
                   "  - {column: A_5, unit: deg}\n  - {column: A_6, unit: deg}\n"
                   "context: {payload_kg: Last, temp_c: Temperatur}\n"),
      with_options({2}, "time: Zeit\ndelimiter: tab\ncontext: {payload: Last}\n"),
      with_options({2}, "delimiter: blanks\ndecimal: x\n"),
      with_options({2}, "delimiter: \"xy\"\n")};
}

const Register registered({"cell_yaml", run, seeds, mutate_words<yaml_words>});

}  // namespace
}  // namespace fuzz::cell_yaml_target
