// SPDX-License-Identifier: Apache-2.0
// A URDF: imported, written as a robot file and read again; corrected by a calibration, and the result read again. The first byte
// chooses the links (bits 0 to 2), and what the calibration holds: 3 base and tool, 4 the effects of a whole one (with the
// second byte that of ticket()); 5: it is of another arm.
#include "exchange/corrected_urdf.hpp"
#include "exchange/imported_arm.hpp"
#include "files/calibration_file.hpp"
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
  const unsigned given = input.u8();
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
  if ((which & 8U) != 0) {
    for (const std::uint8_t body : {flexcomp::body::base, flexcomp::body::tool}) {
      for (std::uint8_t slot = 0; slot < 6; ++slot) {
        flexcomp::Term<double> term;
        term.place = {body, slot};
        term.coefficient = 1e-3;
        calibration.terms.terms.push_back(term);
      }
    }
  }
  if ((which & 16U) != 0 && given == ticket(text)) {
    static const std::string paper = [] {
      std::string text_of_paper = file_of("tests/data/tx60l_table1.yaml");
      const std::size_t at = text_of_paper.find("robot:");
      return text_of_paper.erase(at, text_of_paper.find('\n', at) + 1 - at);
    }();
    reads([&] {
      calibration = load_calibration(path_of(paper, 1), arm.robot);
      const LeftOut out = left_out_by_rigid(calibration, arm.robot, 2);
      require(out.largest_m >= 0 && out.largest_rad >= 0 && !out.effects.empty(),
              "effects that have no size");
    });
  }
  if ((which & 32U) != 0) arm.robot = tx60l();
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
      all.push_back(ticket_seed(which, file_of(std::string("tests/data/") + name + ".urdf")));
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
  const auto add = [&all](unsigned which, const std::string& document) {
    all.push_back(ticket_seed(which, document));
  };
  for (unsigned which = 0; which < 64; ++which) add(which, text + tool + "</robot>");
  for (const unsigned which : {1U, 9U, 17U, 33U}) add(which, text + "</robot>");
  // The flange before the tip, on several fixed joints; the base beside the arm.
  const std::string links = "<link name=\"flange\"/><link name=\"m\"/>";
  const auto fixed = [](const std::string& name, const std::string& parent, const std::string& child) {
    return "<joint name=\"" + name + "\" type=\"fixed\"><origin xyz=\"0 0 0.1\"/><parent link=\"" + parent +
           "\"/><child link=\"" + child + "\"/></joint>";
  };
  for (const unsigned which : {4U, 12U, 7U, 15U, 6U})
    add(which, text + links + "<link name=\"tool0\"/>" + fixed("a", "l6", "flange") +
                   fixed("b", "flange", "m") + fixed("c", "m", "tool0") + "</robot>");
  add(4, text + links + "<link name=\"tool0\"/>" + fixed("a", "l1", "flange") + fixed("b", "l6", "m") +
             fixed("c", "m", "tool0") + "</robot>");
  std::string rooted = text;
  for (std::size_t at = rooted.find("\"base_link\"/><link"); at != std::string::npos;) {
    rooted.replace(at, 11, "\"world\"");
    break;
  }
  const std::size_t parent = rooted.find("<parent link=\"base_link\"");
  rooted.replace(parent, 24, "<parent link=\"world\"");
  add(1, rooted + "<link name=\"base_link\"/>" + fixed("r", "world", "base_link") + tool + "</robot>");
  // Refused, each for a reason of its own.
  const auto replaced = [&](const std::string& what, const std::string& by, std::size_t nth = 0) {
    std::string out = text + tool + "</robot>";
    std::size_t at = out.find(what);
    for (; nth != 0 && at != std::string::npos; --nth) at = out.find(what, at + 1);
    if (at != std::string::npos) out.replace(at, what.size(), by);
    return out;
  };
  add(0, "<machine name=\"r\"/>");
  add(0, "<robot/>");
  add(0, "<robot name=\"r\"><xacro:macro/></robot>");
  add(0, replaced("<link name=\"l2\"/>", "<link name=\"l2\"/><link name=\"l2\"/>"));
  add(0, replaced("type=\"revolute\"", "type=\"screw\""));
  add(0, replaced("type=\"revolute\"", "type=\"prismatic\"", 2));
  add(0, replaced("type=\"revolute\"", "type=\"continuous\"", 2));
  add(0, replaced("type=\"revolute\"", "type=\"fixed\"", 2));
  add(2, replaced("type=\"revolute\"", "type=\"fixed\"", 2));
  add(0, replaced("<child link=\"l3\"/>", "<child link=\"l2\"/>"));
  add(0, replaced("<link name=\"l2\"/>", "<link name=\"l2\"/><link name=\"alone\"/>"));
  add(0, replaced("<limit lower=\"-2\" upper=\"2\" velocity=\"1\"/>", ""));
  add(0, replaced("lower=\"-2\"", "lower=\"3\""));
  add(0, replaced("lower=\"-2\"", "lower=\"-1e9\""));
  add(0, replaced("<axis xyz=\"0 0 1\"/>", "<axis xyz=\"0 0 1\"/><mimic joint=\"j2\"/>"));
  add(0, replaced("<axis xyz=\"0 0 1\"/>", "<axis xyz=\"0 0 0\"/>"));
  add(0, replaced("<axis xyz=\"0 0 1\"/>", "<axis xyz=\"0 0 -1\"/>"));
  add(0, replaced("</robot>", "<link name=\"second\"/>" + fixed("s", "l6", "second") + "</robot>"));
  add(0, replaced("<robot", "<?xml version=\"1.0\"?>" + std::string(300, '<')));
  std::string deep = "<robot name=\"r\">";
  for (int k = 0; k < 300; ++k) deep += "<a>";
  add(0, deep);
  return all;
}

const Register registered({"urdf", run, seeds, mutate_words<words>});

}  // namespace
}  // namespace fuzz::urdf_target
