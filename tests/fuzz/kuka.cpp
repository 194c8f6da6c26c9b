// SPDX-License-Identifier: Apache-2.0
// Programs of KUKA (KRL).
#include "programs.hpp"

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
  return {with_options({0}, many), with_options({1}, "PTP " + axes + "\n"),
          with_options({1}, "LIN " + pose + "\n"),
          with_options({1}, "DECL E6POS XP7={X 500,Y 50,Z 600,A 10,B 80,C 5,S 2,T 35,E1 0,E2 0}\nLIN XP7\n"),
          // Turns that the corrected joints change, in each spelling.
          with_options({1}, "XP1={X 500,Y 50,Z 600,A 10,B 80,C 5,S 2,T 'B100011'}\nLIN XP1\n"),
          with_options({1}, "XP1={X 500,Y 0,Z 600,A 10,B 80,C 5,S 2,T 'H23'}\nLIN XP1\n"),
          with_options({1},
                       "XP1={X 500,Y 0.01,Z 600,A 0,B 90,C 0,T 0}\nLIN XP1\nXP2={X 500,Y -0.01,Z 600,A 0,B "
                       "90,C 0,T 1}\nLIN XP2\n"),
          with_options({0}, left), with_options({0}, "LIN_REL {X 5}\nLIN P1:" + pose + "\n")};
}

const Register registered({"kuka", run, seeds, mutate_words<words>});

}  // namespace
}  // namespace fuzz::kuka_target
