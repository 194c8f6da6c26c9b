// SPDX-License-Identifier: Apache-2.0
// A robot file: what is read is written so that the identical robot is read; put into links of another form it is read, too.
#include "exchange/imported_arm.hpp"
#include "host_text.hpp"

namespace fuzz::robot_yaml_target {
namespace {

using namespace flexcomp::host;

/// The numbers that a robot file holds.
std::vector<double> numbers(const Robot& r) {
  std::vector<double> all;
  const auto add = [&all](const auto& values) { all.insert(all.end(), values.begin(), values.end()); };
  for (const auto& l : r.nominal.links) add(std::array{l.theta_rad, l.d_m, l.a_m, l.alpha_rad, l.beta_rad});
  for (const auto& l : r.nominal.limits) add(std::array{l.min_rad, l.max_rad});
  add(r.nominal.gravity_m_s2);
  add(r.nominal.tool_xyz_m);
  add(r.nominal.tool_wxyz);
  add(r.nominal.payload_com_m);
  add(std::array{r.nominal.payload_kg, r.nominal.reference_temperature_c, r.position_sigma_m,
                 r.orientation_sigma_rad});
  for (const auto& p : r.reflectors_m) add(p);
  add(r.max_speed_rad_s);
  add(r.gear_ratio);
  for (const Capsule& c : r.capsules) {
    add(c.from_m);
    add(c.to_m);
    add(std::array{static_cast<double>(c.frame), c.radius_m});
  }
  return all;
}

void run(Input input) {
  const std::string text = input.text();
  Robot robot;
  if (!reads([&] { robot = parse_robot(text, "fuzzed.yaml"); })) return;
  for (const double v : numbers(robot)) require(std::isfinite(v), "a number that is not finite was read");
  const std::string written = robot_text(robot, {"of a fuzz target"});
  Robot again;
  must_read(written, [&] { again = parse_robot(written, "again.yaml"); });
  require(again.name == robot.name && again.nominal.name_hash == robot.nominal.name_hash &&
              numbers(again) == numbers(robot),
          "another robot is read from what was written");
  require_same(written, robot_text(again, {"of a fuzz target"}), "a robot file");
  ImportedArm arm;
  if (!reads([&] { arm = import_robot(path_of(text)); })) return;
  const std::string other = robot_text(arm.robot, {});
  must_read(other, [&] { again = load_robot(path_of(other), LongLinks::taken); });
}

std::vector<Bytes> seeds() {
  std::vector<Bytes> all;
  for (const char* name : {"tx60l", "rx160l", "ur5", "ur10", "abb-irb120", "kuka-kr6-r900"})
    all.push_back(bytes_of(file_of(std::string("host/robots/") + name + ".yaml")));
  const std::string text = file_of("host/robots/tx60l.yaml");
  const auto add = [&](const std::string& what, const std::string& by) {
    std::string out = text;
    const std::size_t at = out.find(what);
    require(at != std::string::npos, "a seed of a text that is not there");
    all.push_back(bytes_of(out.replace(at, what.size(), by)));
  };
  add("name: ", "serial: \"arm 5\"\nname: ");
  add("name: ", "serial: \"\"\nname: ");
  add("name: ", "serial: [1]\nname: ");
  add("d_mm: 450", "d_mm: 123456");
  add("min_deg: -180", "min_deg: 190");
  add("max_speed_deg_s: 435", "gear_ratio: 100");
  add("max_speed_deg_s: 435", "gear_ratio: -1");
  add("quaternion_wxyz: [1, 0, 0, 0]", "quaternion_wxyz: [1, 1, 0, 0]");
  add("quaternion_wxyz: [1, 0, 0, 0]", "quaternion_wxyz: &a [1, 0, 0, 0], xyz_mm: *a");
  return all;
}

const Register registered({"robot_yaml", run, seeds, mutate_words<yaml_words>});

}  // namespace
}  // namespace fuzz::robot_yaml_target
