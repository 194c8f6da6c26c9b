// SPDX-License-Identifier: Apache-2.0
// Programs of KUKA (KRL).
#include <fmt/format.h>

#include "exchange/rotation_angles.hpp"
#include "programs.hpp"
#include "units.hpp"

namespace fuzz::kuka_target {
namespace {

constexpr const char* words[] = {"PTP ",
                                 "LIN ",
                                 "CIRC ",
                                 "SPTP ",
                                 "SLIN ",
                                 "SPL ",
                                 "SCIRC ",
                                 "_REL ",
                                 "DECL ",
                                 "GLOBAL ",
                                 "E6POS ",
                                 "E6AXIS ",
                                 "AXIS ",
                                 "POS ",
                                 "FRAME ",
                                 "{",
                                 "}",
                                 "{A1 1,A2 2,A3 3,A4 4,A5 5,A6 6}",
                                 "{X 500,Y 50,Z 600,A 10,B 80,C 5,S 2,T 35}",
                                 "{E6POS: ",
                                 ":",
                                 "XP[1]=",
                                 "'B101'",
                                 "'HFF'",
                                 ";",
                                 "\"",
                                 "\n",
                                 "\r\n",
                                 "\t",
                                 "E1 0",
                                 ",",
                                 "T 4095",
                                 "&",
                                 "1.5E3",
                                 "=",
                                 "$BASE",
                                 "DEF P()\n",
                                 "END\n"};

void run(Input input) { play_program(input, flexcomp::host::ProgramLanguage::kuka); }

std::vector<Bytes> seeds() {
  using namespace flexcomp::host;
  const std::string axes = "{A1 10,A2 -80,A3 90,A4 5,A5 30,A6 12}";
  const std::string pose = "{X 500,Y 50,Z 600,A 10,B 80,C 5}";
  const std::string many =
      "DEF P()\nPTP\t" + axes + "\nLIN\t" + pose + "\nSCIRC{X 1,Y 2,Z 3,A 4,B 5,C 6}, " + pose +
      "\nXP[1]={X 1,Y 2,Z 3,A 4,B 5,C 6,S 2,T 2}\nDECL GLOBAL E6POS XQ[3]\nXQ[2]=" + pose +
      "\nJP={E6AXIS: A1 1,A2 2,A3 3,A4 4,A5 5,A6 6}\nXS={P {E6POS: X 1,Y 2,Z 3,A 4,B 5,C 6},V 2}\n"
      "XS={P {X 1,Y 2,Z 3,A 4,B 5,C 6,S 2,T 'B100011'},N \"}\"}\n\tptp  " +
      axes + " C_PTP ; " + axes + "\nERR=\"PTP " + axes + "\"\nEND\n";
  const std::string left = "PTP " + axes + "\nXP[1]=" + pose + "\nS={P " + pose +
                           ",V 2}\n$AXIS_HOME[1]=" + axes + "\nDECL FRAME F=G:" + pose + "\n$TOOL=" + pose +
                           "\n";
  std::vector<Bytes> all{
      ticket_seed(0, many), ticket_seed(1, "PTP " + axes + "\n"), ticket_seed(1, "LIN " + pose + "\n"),
      ticket_seed(1, "DECL E6POS XP7={X 500,Y 50,Z 600,A 10,B 80,C 5,S 2,T 35,E1 0,E2 0}\nLIN XP7\n"),
      // Turns that the corrected joints change, in each spelling.
      ticket_seed(1, "XP1={X 500,Y 50,Z 600,A 10,B 80,C 5,S 2,T 'B100011'}\nLIN XP1\n"),
      ticket_seed(1, "XP1={X 500,Y 0,Z 600,A 10,B 80,C 5,S 2,T 'H23'}\nLIN XP1\n"),
      ticket_seed(1,
                  "XP1={X 500,Y 0.01,Z 600,A 0,B 90,C 0,T 0}\nLIN XP1\nXP2={X 500,Y -0.01,Z 600,A 0,B "
                  "90,C 0,T 1}\nLIN XP2\n"),
      ticket_seed(0, left), ticket_seed(0, "LIN_REL {X 5}\nLIN P1:" + pose + "\n"), ticket_seed(0, ".dat"),
      ticket_seed(0, "a.src"), ticket_seed(0, "a.mod"), ticket_seed(0, "a.dtx"),
      ticket_seed(0, "XP1={X 500,Y 50,Z 600,A 10,B 80,C 5,S 2,T 'B1000110000000'}\n"),
      ticket_seed(0, "XP1={X 500,Y 50,Z 600,A 10,B 80,C 5,S 2,T 4096}\n"),
      ticket_seed(0,
                  "BAS(#TOOL,1)\nBAS(#BASE,2)\nPDAT_ACT={TOOL_NO 1,BASE_NO 2}\nFDAT_ACT={TOOL_NO 3,BASE_NO "
                  "1,IPO_FRAME #BASE}\n$TOOL=tool_data[2]\n$BASE=base_data[1]\nPTP " +
                      axes + "\n"),
      ticket_seed(0, "LIN_REL P1\nXP1=" + pose + "\nLIN XP1:XP1\nLIN_REL XP1\nPTP " + axes + "\n"),
      ticket_seed(0, "X=" + std::string(70, '{') + "\n")};
  // Postures whose turns a correction changes, in each spelling of them: few, as the ways to a pose take their time.
  for (std::size_t k = 0; k < 9; ++k) {
    const unsigned what = k % 3 == 0 ? 17 : k % 3 == 1 ? 19 : 29;
    const Robot& robot = (what & 2U) != 0 ? irb120() : tx60l();
    const auto& q = postures[k < 6 ? k : std::size(postures) - 2 + k % 2];
    const auto at = nominal_pose(robot, q);
    const auto abc = roll_pitch_yaw(at.rotation);
    const unsigned turn = turn_of(q, 0);
    const std::string t = k % 3 == 0   ? fmt::format("{}", turn)
                          : k % 3 == 1 ? fmt::format("'B{:06b}'", turn)
                                       : fmt::format("'H{:02X}'", turn);
    all.push_back(ticket_seed(
        what, fmt::format("XP1={{X {:.6f},Y {:.6f},Z {:.6f},A {:.6f},B {:.6f},C {:.6f},S 2,T {}}}\nLIN XP1\n",
                          at.position.x() * 1e3, at.position.y() * 1e3, at.position.z() * 1e3,
                          degrees(abc.z()), degrees(abc.y()), degrees(abc.x()), t)));
  }
  return all;
}

const Register registered({"kuka", run, seeds, mutate_words<words>});

}  // namespace
}  // namespace fuzz::kuka_target
