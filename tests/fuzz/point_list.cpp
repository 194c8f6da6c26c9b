// SPDX-License-Identifier: Apache-2.0
// Point lists of instruments. The first two bytes hold the options.
#include "tables.hpp"

namespace fuzz::point_list_target {
namespace {

using namespace flexcomp::host;

void run(Input input) {
  const PointListOptions options = point_options(input.u16());
  const std::string path = path_of(input.text());
  reads([&] {
    const PointList list = read_point_list(path, options);
    require(!list.points.empty(), "a list without a point");
    for (const ListedPoint& p : list.points) {
      require(p.line > 0 && p.position_m.allFinite() && std::isfinite(p.time.seconds),
              "a point that is not finite");
      require(std::abs(p.orientation.norm() - 1) < 1e-9, "an orientation of norm other than 1");
      require(!list.sigmas || (p.sigma_m > 0 && std::isfinite(p.sigma_m)),
              "an uncertainty that is not positive");
    }
  });
}

std::vector<Bytes> seeds() {
  std::vector<Bytes> all;
  for (const std::string& text : point_lists) {
    for (const unsigned what : {0U, 1U, 7U, 71U, 135U, 17U, 256U, 512U, 1025U})
      all.push_back(with_options({what & 0xFFU, what >> 8U}, text));
  }
  return all;
}

const Register registered({"point_list", run, seeds, mutate_words<table_words>});

}  // namespace
}  // namespace fuzz::point_list_target
