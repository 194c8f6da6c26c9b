// SPDX-License-Identifier: Apache-2.0
// Logs of robots. The first two bytes hold the map.
#include "tables.hpp"

namespace fuzz::robot_log_target {
namespace {

using namespace flexcomp::host;

void run(Input input) {
  const LogMap map = log_options(input.u16());
  const std::string path = path_of(input.text());
  reads([&] {
    const RobotLog log = read_robot_log(path, map, tx60l());
    require(!log.rows.empty(), "a log without a row");
    for (const LogRow& row : log.rows) {
      require(row.context.size() == log.context.size(), "a row of another length");
      for (std::size_t j = 0; j < joint_count; ++j) {
        const auto& limit = tx60l().nominal.limits[j];
        require(row.q_rad[j] >= limit.min_rad - 1e-6 && row.q_rad[j] <= limit.max_rad + 1e-6,
                "a reading beyond its limit");
      }
    }
  });
}

std::vector<Bytes> seeds() {
  std::vector<Bytes> all;
  for (const std::string& text : robot_logs) {
    for (const unsigned what : {0U, 1U, 12U, 64U, 128U, 384U, 512U, 1024U, 2048U, 4096U, 8192U})
      all.push_back(with_options({what & 0xFFU, what >> 8U}, text));
  }
  return all;
}

const Register registered({"robot_log", run, seeds, mutate_words<table_words>});

}  // namespace
}  // namespace fuzz::robot_log_target
