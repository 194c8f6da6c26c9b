// SPDX-License-Identifier: Apache-2.0
// A URDF: imported, written as a robot file and read again; corrected by a calibration, and the result read again. The first byte
// chooses the links.
#include "exchange/corrected_urdf.hpp"
#include "exchange/imported_arm.hpp"
#include "host_text.hpp"

namespace fuzz::urdf_target {
namespace {

using namespace flexcomp::host;

constexpr const char* words[] = {"<",
                                 ">",
                                 "/>",
                                 "</",
                                 "<!--",
                                 "-->",
                                 "<![CDATA[",
                                 "]]>",
                                 "<!DOCTYPE a>",
                                 "<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>",
                                 "&amp;",
                                 "&#65;",
                                 "&lt;",
                                 "\"",
                                 "'",
                                 "<origin xyz=\"0 0 1\" rpy=\"0 1.5707963 0\"/>",
                                 "<axis xyz=\"0 0 1\"/>",
                                 "<limit lower=\"-1\" upper=\"1\" velocity=\"2\" effort=\"1\"/>",
                                 "<link name=\"l9\"/>",
                                 "type=\"fixed\"",
                                 "type=\"revolute\"",
                                 "type=\"continuous\"",
                                 "type=\"prismatic\"",
                                 "<mimic joint=\"a\"/>",
                                 "<parent link=\"",
                                 "<child link=\"",
                                 "tool0",
                                 "base_link",
                                 "nan",
                                 "inf",
                                 "1e999",
                                 "-1e308",
                                 "0 0 0",
                                 "1 0 0",
                                 "0 1 0",
                                 " "};

void run(Input input) {
  const unsigned which = input.u8();
  const std::string text = input.text();
  UrdfLinks links;
  if ((which & 1U) != 0) links.base = "base_link";
  if ((which & 2U) != 0) links.tip = "tool0";
  if ((which & 4U) != 0) links.flange = "flange";
  ImportedArm arm;
  if (!reads([&] { arm = import_urdf(path_of(text), links); })) return;
  if (arm.robot.name.empty()) return;  // a robot file needs one
  const std::string written = robot_text(arm.robot, {arm.tip});
  Robot again;
  must_read(written, [&] { again = load_robot(path_of(written), LongLinks::taken); });
  require_same(written, robot_text(again, {arm.tip}), "an imported robot");
  require(flexcomp::nominal_hash(again.nominal) == flexcomp::nominal_hash(arm.robot.nominal),
          "another geometry is read");

  Calibration calibration;
  for (std::uint8_t link = 1; link <= 6; ++link) {
    flexcomp::Term<double> term;
    term.place = {link, static_cast<std::uint8_t>(link % 5)};
    term.coefficient = 1e-3;
    calibration.terms.terms.push_back(term);
  }
  CorrectedUrdf corrected;
  if (!reads([&] { corrected = correct_urdf(path_of(text), links, arm.robot, calibration); })) return;
  links.base = corrected.base;
  links.tip = corrected.tip;
  must_read(corrected.text, [&] { load_urdf(path_of(corrected.text), links); });
}

std::vector<Bytes> seeds() {
  std::vector<Bytes> all;
  for (const char* name : {"abb_irb120", "kuka_kr6_r900", "tx60l", "ur5"}) {
    for (unsigned which = 0; which < 4; ++which)
      all.push_back(with_options({which}, file_of(std::string("tests/data/") + name + ".urdf")));
  }
  // A short one, in which a mutation changes more.
  std::string text = "<robot name=\"r\"><link name=\"base_link\"/>";
  for (int k = 1; k <= 6; ++k) {
    const std::string n = std::to_string(k);
    // NOLINTBEGIN(performance-inefficient-string-concatenation)
    text += "<link name=\"l" + n + "\"/><joint name=\"j" + n + "\" type=\"revolute\"><origin xyz=\"0." + n +
            " 0 0.1\" rpy=\"" + (k % 2 == 0 ? "1.5707963267948966" : "0") + " 0 0\"/><parent link=\"" +
            (k == 1 ? "base_link" : "l" + std::to_string(k - 1)) + "\"/><child link=\"l" + n +
            "\"/><axis xyz=\"0 0 1\"/><limit lower=\"-2\" upper=\"2\" velocity=\"1\"/></joint>";
    // NOLINTEND(performance-inefficient-string-concatenation)
  }
  const std::string tool =
      "<link name=\"tool0\"/><joint name=\"f\" type=\"fixed\"><origin xyz=\"0 0 0.1\"/><parent "
      "link=\"l6\"/><child link=\"tool0\"/></joint>";
  for (unsigned which = 0; which < 4; ++which) all.push_back(with_options({which}, text + tool + "</robot>"));
  all.push_back(with_options({1}, text + "</robot>"));
  return all;
}

const Register registered({"urdf", run, seeds, mutate_words<words>});

}  // namespace
}  // namespace fuzz::urdf_target
