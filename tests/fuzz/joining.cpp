// SPDX-License-Identifier: Apache-2.0
// A point list and a robot's log joined into a data file, which is read again. Six bytes of options, then both texts with a zero
// byte between.
#include "tables.hpp"

namespace fuzz::joining_target {
namespace {

using namespace flexcomp::host;

void run(Input input) {
  const PointListOptions list_options = point_options(input.u16());
  const LogMap map = log_options(input.u16());
  JoinOptions options;
  const unsigned how = input.u8();
  options.by = static_cast<JoinBy>(how % 3);
  const unsigned more = input.u8();
  if ((more & 1U) != 0) options.names = "{pose}_{reflector}";
  if ((more & 2U) != 0) options.names = "*::{pose}";
  if ((more & 3U) == 3) options.names = "{pose}{reflector}";
  if ((more & 12U) != 0) options.reflectors = (more & 4U) != 0 ? 3 : 4;
  options.repeats = (more & 16U) != 0;
  if ((more & 32U) != 0) options.shift_s = 0.2;
  const std::string both = input.text();
  const std::size_t end = std::min(both.find('\0'), both.size());
  const std::string log_text = end < both.size() ? both.substr(end + 1) : "";
  reads([&] {
    const PointList points = read_point_list(path_of(both.substr(0, end), 0), list_options);
    const RobotLog log = read_robot_log(path_of(log_text, 1), map, tx60l());
    const Joining joined = join(points, log, options);
    require(!joined.data.rows.empty() && joined.log_lines.size() == joined.data.rows.size() &&
                joined.point_lines.size() == joined.data.rows.size(),
            "rows without their lines");
    const std::string text = data_text(joined.data);
    check_joined(text, "out.csv", tx60l(), points, log, joined, (more & 64U) == 0);
    to_json(joined, points, log, options.by).dump();
    // Columns of the log that a data file knows stand at its end; once read they stand where they belong.
    MeasuredData again;
    must_read(text, [&] { again = load_data(path_of(text), tx60l(), {true}); });
    const std::string second = data_text(again);
    must_read(second, [&] { again = load_data(path_of(second), tx60l(), {true}); });
    require_same(second, data_text(again), "a joined data file");
  });
}

std::vector<Bytes> seeds() {
  std::vector<Bytes> all;
  for (const std::string& points : point_lists) {
    for (const std::string& log : robot_logs) {
      const unsigned by = static_cast<unsigned>(all.size());
      Output out;
      out.u16(all.size() % 4 == 0 ? 7 : 1)
          .u16(by % 5 == 2 ? 8 : 1)
          .u8(by % 5 == 2   ? 2
              : by % 3 == 0 ? 1
                            : 0)
          .u8(by % 7 == 0 ? 5 : 0);
      all.push_back(out.add(bytes_of(points)).u8(0).add(bytes_of(log)).out);
    }
  }
  // In each way, with each pattern of names.
  for (const std::string& points : point_lists) {
    for (unsigned how = 0; how < 15; ++how) {
      const unsigned more = how / 3 + (how % 2) * 16 + (how % 5 == 0 ? 64 : 0) + (how % 4 == 1 ? 32 : 0);
      const std::string& log = robot_logs[how == 0       ? 0
                                          : how == 3     ? 5
                                          : how == 6     ? 13
                                          : how == 9     ? 16
                                          : how % 3 == 2 ? 8 + how / 6
                                                         : 0];
      all.push_back(Output()
                        .u16(1)
                        .u16(how == 14 ? 8192 : 0)
                        .u8(how % 3)
                        .u8(more)
                        .add(bytes_of(points))
                        .u8(0)
                        .add(bytes_of(log))
                        .out);
    }
  }
  for (unsigned by = 0; by < 3; ++by) {
    for (const std::string& log : robot_logs) {
      for (const unsigned list : {2U, 6U, 13U, 26U, 27U, 28U})
        all.push_back(Output()
                          .u16(1)
                          .u16(0)
                          .u8(by)
                          .u8(64)
                          .add(bytes_of(point_lists[list]))
                          .u8(0)
                          .add(bytes_of(log))
                          .out);
    }
  }
  all.push_back(Output()
                    .u16(1)
                    .u16(1)
                    .u8(0)
                    .u8(1)
                    .add(bytes_of(point_lists[5]))
                    .u8(0)
                    .add(bytes_of(robot_logs[0]))
                    .out);
  all.push_back(Output()
                    .u16(1)
                    .u16(8)
                    .u8(2)
                    .u8(0)
                    .add(bytes_of(point_lists[2]))
                    .u8(0)
                    .add(bytes_of(robot_logs[2]))
                    .out);
  return all;
}

const Register registered({"joining", run, seeds, mutate_words<table_words>});

}  // namespace
}  // namespace fuzz::joining_target
