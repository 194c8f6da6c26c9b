// SPDX-License-Identifier: Apache-2.0
// A program is corrected whole or not at all: every target is found however it is written, what is relative is refused, what is
// no target stays, and whatever could be one and is left alone is listed.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <ctime>
#include <string>
#include <utility>
#include <vector>

#include "exchange/target_program.hpp"
#include "support/mutation.hpp"
#include "support/text_file.hpp"
#include "units.hpp"

namespace {

using namespace flexcomp::host;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TargetProgram krl(const std::string& text) {
  return read_program(support::write("p.src", text), ProgramLanguage::kuka);
}
TargetProgram rapid(const std::string& text) {
  return read_program(support::write("p.mod", text), ProgramLanguage::rapid);
}
TargetProgram val3(const std::string& text) {
  return read_program(support::write("p.dtx", text), ProgramLanguage::val3);
}

std::vector<std::size_t> lines(const TargetProgram& program) {
  std::vector<std::size_t> out;
  for (const ProgramTarget& t : program.targets) out.push_back(t.line);
  return out;
}

/// Refused in this line with this word in the message.
template <class Read>
void refuses(const Read& read, const std::string& text, std::size_t line, const std::string& says) {
  try {
    read(text);
    ADD_FAILURE() << "accepted: " << text;
  } catch (const InputError& e) {
    EXPECT_EQ(e.line(), line) << e.what() << "\n" << text;
    EXPECT_THAT(e.what(), HasSubstr(says)) << text;
  }
}

const std::string axes = "{A1 10,A2 -80,A3 90,A4 5,A5 30,A6 12}";
const std::string pose = "{X 500,Y 50,Z 600,A 10,B 80,C 5}";
const std::string home = "PTP " + axes + "\n";
const std::string rest = "[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]";
const std::string point = "[[300,0,500]," + rest + "]";
const std::string joints = "[[1,2,3,4,5,6],[9E9,9E9,9E9,9E9,9E9,9E9]]";

std::string all_replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
  return text;
}

/// The text with %axes% and its like put in.
std::string filled(std::string text) {
  for (const auto& [word, value] : {std::pair{"%tab%", std::string("\t")},
                                    {"%axes%", axes},
                                    {"%pose%", pose},
                                    {"%home%", home},
                                    {"%point%", point},
                                    {"%joints%", joints}})
    text = all_replaced(std::move(text), word, value);
  return text;
}

TEST(Krl, RelativeMovesAreRefusedHoweverTheyAreWritten) {
  for (const char* move :
       {"PTP_REL", "LIN_REL", "CIRC_REL", "SPTP_REL", "SLIN_REL", "SPL_REL", "SCIRC_REL", "spl_rel"}) {
    for (const char* blank : {" ", "\t", "", "  \t "}) {
      refuses(krl, home + move + blank + axes + "\n", 2, "relative");
      refuses(krl, home + move + blank + pose + "\n", 2, "relative");
      refuses(krl, home + move + blank + "{X 5}\n", 2, "relative");
      refuses(krl, home + move + blank + "{E6POS: X 5,Y 2}\n", 2, "relative");
    }
  }
  refuses(krl, home + "SCIRC_REL XP1," + pose + "\n", 2, "relative");
  // By name: the pose itself stands elsewhere.
  refuses(krl, "DECL E6POS XP7=" + pose + "\nLIN_REL XP7 C_DIS\n", 1, "relative");
  refuses(krl, "SCIRC_REL XAUX,\txp7\nDECL E6POS XP7=" + pose + "\n", 2, "line 1");
  EXPECT_THAT(lines(krl("DECL E6POS XP7=" + pose + "\nLIN_REL XP8\nLIN XP7\n")), ElementsAre(1U));
}

TEST(Krl, PartsOfGeometricOperationsAreRefused) {
  refuses(krl, home + "LIN P1:" + pose + "\n", 2, "geometric");
  refuses(krl, home + "LIN P1 : " + pose + "\n", 2, "geometric");
  refuses(krl, home + "LIN P1:{X 10}\n", 2, "geometric");
  refuses(krl, home + "LIN " + pose + ":P1\n", 2, "geometric");
  refuses(krl, home + "PTP XP1:" + axes.substr(0, 1) + "X 10,Y 0,Z 0,A 0,B 0,C 0,S 2,T 2}\n", 2, "geometric");
  refuses(krl, "DECL E6POS XP1=" + pose + "\nLIN XP2:XP1\n", 1, "geometric");
  refuses(krl, "DECL E6POS XP1=" + pose + "\nLIN xp1[2]:SHIFT\n", 1, "geometric");
  // Where a frame is worked out nothing is corrected, and a colon elsewhere is none.
  EXPECT_THAT(
      lines(krl("DEF P(XP1:IN)\nAGAIN:\n" + home + "DECL FRAME F=G:" + pose + "\n$BASE=G:" + pose + "\n")),
      ElementsAre(3U));
}

TEST(Krl, TargetsAreFoundHoweverTheyAreWritten) {
  const TargetProgram program = krl(filled(R"(DEF P()
PTP%tab%%axes%
LIN%tab%%pose%
SPL %pose%
SCIRC{X 1,Y 2,Z 3,A 4,B 5,C 6}, %pose%
XP[1]={X 1,Y 2,Z 3,A 4,B 5,C 6,S 2,T 2}
DECL GLOBAL E6POS XQ[3]
XQ[2]=%pose%
JP={E6AXIS: A1 1,A2 2,A3 3,A4 4,A5 5,A6 6}
XS={P {E6POS: X 1,Y 2,Z 3,A 4,B 5,C 6},V 2}
XS={P {X 1,Y 2,Z 3,A 4,B 5,C 6,S 2,T 35},N "}"}
%tab%ptp  %axes% C_PTP ; %axes%
ERR="PTP %axes%"
)"));
  // Line 8 by the declaration in line 7; two targets in line 5.
  EXPECT_THAT(lines(program), ElementsAre(2U, 3U, 4U, 5U, 5U, 6U, 8U, 9U, 10U, 11U, 12U));
  EXPECT_THAT(program.warnings, IsEmpty());
  EXPECT_EQ(program.targets[5].name, "XP");
  EXPECT_EQ(program.targets[6].name, "XQ");
  EXPECT_TRUE(program.targets[6].pose);
}

TEST(Krl, WhatIsLeftAloneIsListedAndWhatIsNoTargetIsNot) {
  const TargetProgram program = krl(filled(R"(PTP %axes%
XP[1]=%pose%
S={P %pose%,V 2}
S={J %axes%}
F(%axes%)
$AXIS_HOME[1]=%axes%
)"));
  EXPECT_THAT(lines(program), ElementsAre(1U));
  EXPECT_THAT(program.warnings,
              ElementsAre(HasSubstr("p.src:2: "), HasSubstr("p.src:3: "), HasSubstr("p.src:4: "),
                          HasSubstr("p.src:5: "), HasSubstr("p.src:6: ")));
  const TargetProgram quiet = krl(filled(R"(PTP %axes%
DECL FRAME PART=%pose%
PART={FRAME: X 1,Y 2,Z 3,A 4,B 5,C 6}
PART=%pose%
BASE_DATA[1]=%pose%
$BASE=%pose%
$TOOL={X 1,Y 2,Z 3,A 4,B 5,C 6}
$WORKSPACE[1]={X 1,Y 2,Z 3,A 4,B 5,C 6,X1 1,MODE #OFF}
LOAD_DATA[1]={M 3,CM %pose%,J {X 0,Y 0,Z 0}}
DECL PDAT P={VEL 1,ACC 2}
SLIN XP WITH $VEL={CP 1}
DECL FDAT FP={TOOL_NO 1,BASE_NO 0,POINT2[] " "}
)"));
  EXPECT_THAT(lines(quiet), ElementsAre(1U));
  // But more than one tool and one base appear.
  EXPECT_THAT(quiet.warnings, ElementsAre(HasSubstr("several tools"), HasSubstr("several bases")));
}

TEST(Krl, WhatIsBrokenIsRefused) {
  refuses(krl, home + "PTP {A1 0,A2 -80,A3 90,A4 5,A5 30,A6 1\n", 2, "ends with }");
  refuses(krl, home + "PTP {A1 0,A2 -80,A3 90,A4 5,A5 30,A6 1", 2, "ends with }");
  refuses(krl, home + "XHOME={E6AXIS: A1 0,A2 -90,A3 90,\nA4 0,A5 0,A6 0}\n", 2, "ends with }");
  refuses(krl, home + "PTP {A1 0,A2 -80,A3 90,A4 {5},A5 30,A6 1}\n", 2, "'{5}'");
  refuses(krl, home + "PTP {A1 0,A2 -80,A3 90,A4 F(1,2),A5 30,A6 1}\n", 2, "'F(1,2)'");
  refuses(krl, home + "PTP {A1 0,A1 1,A2 -80,A3 90,A4 5,A5 30,A6 1}\n", 2, "once");
  refuses(krl, home + "SPL {X 1,Y 2}\n", 2, "all of X");
  for (const char* t : {"A1 0,5,A2 -80,A3 90,A4 5,A5 30,A6 1", "A1 0,,A2 -80,A3 90,A4 5,A5 30,A6 1",
                        "A1 0,B5,A2 -80,A3 90,A4 5,A5 30,A6 1", "A1 0,A2 -80,A3 90,A4 5,A5 30,A6 1,Q9 3",
                        "A1 0,A2 -80,A3 90,A4 5,A5 30,A6 1,"})
    refuses(krl, home + "PTP {" + t + "}\n", 2, "alone");
  refuses(krl, home + "LIN {X 500,5,Y 50,Z 600,A 10,B 80,C 5}\n", 2, "alone");
  EXPECT_THAT(
      lines(krl(
          "PTP {A1 0,A2 -80,A3 90,A4 5,A5 30,A6 1,E1 0,E6 2}\nLIN {X 1,Y 2,Z 3,A 4,B 5,C 6,S 2,T 3,E1 0}\n")),
      ElementsAre(1U, 2U));
  refuses(krl, home + "PTP " + std::string(300000, '{') + "\n", 2, "at most");
  for (const char* t : {"'B2'", "'B'", "'C1'", "B1", "'B1111111111111'", "-1", "1.5", "'H1000'", "'B1"})
    refuses(krl, fmt::format("PTP {{X 1,Y 2,Z 3,A 4,B 5,C 6,T {}}}\n", t), 1, "T");
}

TEST(Krl, SeveralToolsOrBasesAreListed) {
  for (const char* change :
       {"$TOOL=TOOL_DATA[3]\n%home%$TOOL=TOOL_DATA[4]\n%home%", "BAS (#TOOL,3)\n%home%BAS(#TOOL,4)\n%home%",
        "DECL FDAT A={TOOL_NO 3,BASE_NO 1}\n%home%DECL FDAT B={TOOL_NO 4,BASE_NO 1}\n%home%",
        "$TOOL=TOOL_DATA[3]\n%home%$TOOL.X=$TOOL.X+5\n%home%"}) {
    std::string text = filled(change);
    EXPECT_THAT(krl(text).warnings, ElementsAre(AllOf(HasSubstr("several tools"), HasSubstr("tool_data[3]"))))
        << text;
    text = all_replaced(text, "TOOL", "BASE");
    if (text.find("FDAT") == std::string::npos) {
      EXPECT_THAT(krl(text).warnings, ElementsAre(HasSubstr("several bases"))) << text;
    }
  }
  EXPECT_THAT(krl("$TOOL=TOOL_DATA[3]\n$BASE = BASE_DATA[1]\nBAS(#BASE,1)\nIF $TOOL==TOOL_DATA[4] THEN\n" +
                  home + "$TOOL = tool_data[ 3 ] ; again\n")
                  .warnings,
              IsEmpty());
}

TEST(Words, StayWhereTheyAreRightAndElseKeepTheirNotation) {
  using Q = std::array<double, 6>;
  const double d = radians(1);
  EXPECT_EQ(turn_of(Q{d, -d, d, -1e-9, 1e-9, -d}, 0), 0b100010U);
  EXPECT_EQ(turn_of(Q{d, -d, d, -1e-9, 1e-9, -d}, 0b111101001111), 0b111101101010U);
  // An edge between two quarters is in both.
  EXPECT_EQ(quadrants_of(Q{0, 0, 0, 90 * d, 0, -90 * d}, {-1, 0, -1}), (std::array<int, 3>{-1, 0, -1}));
  EXPECT_EQ(quadrants_of(Q{0, 0, 0, 90 * d - 1e-9, 0, -90 * d}, {0, 1, -2}), (std::array<int, 3>{0, 1, -2}));
  EXPECT_EQ(quadrants_of(Q{-d, 0, 0, 91 * d, 0, -91 * d}, {0, 0, -1}), (std::array<int, 3>{-1, 1, -2}));

  const auto written = [](const char* old, unsigned turn) {
    const TargetProgram program =
        krl(fmt::format("PTP {{X 1,Y 2,Z 3,A 4,B 5,C 6,S 2,T {},E1 -30.0}}\n", old));
    std::vector<ProgramTarget> corrected = program.targets;
    corrected[0].turn = turn;
    const std::string text = program_text(program, corrected);
    const std::size_t at = text.find("T ") + 2;
    return text.substr(at, text.find(',', at) - at);
  };
  EXPECT_EQ(written("'B000010'", 2), "'B000010'");
  EXPECT_EQ(written("'B000010'", 10), "'B001010'");
  EXPECT_EQ(written("'b1'", 10), "'b1010'");
  EXPECT_EQ(written("'H0A'", 0x1F), "'H1F'");
  EXPECT_EQ(written("2.0", 2), "2.0");
  EXPECT_EQ(written("2", 66), "66");
  EXPECT_EQ(krl("PTP {X 1,Y 2,Z 3,A 4,B 5,C 6,T 'H0A'}\n").targets[0].turn, 10U);
}

TEST(Rapid, TargetsAreFoundHoweverTheyAreWritten) {
  const TargetProgram program = rapid(filled(R"(MODULE m ! [[[
CONST robtarget pa{2}:=[ %point%, ! first
  %point% ];
CONST jointtarget ja{2}:=[%joints%, ! [
%joints%];
CONST robtarget pc:=[[300,0,500 ! here
  ], ! and "here
  [1,0, ! x
 0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
RECORD job robtarget p; num n; string s; ENDRECORD
RECORD way jointtarget j; num n; ENDRECORD
PERS job j1:=[%point%,5,"x]"];
PERS way w{1}:=[[%joints%,5]];
VAR jointtarget jv; VAR robtarget pv;
PROC main(VAR num n)
  IF n>1 THEN MoveL %point%,v100,fine,t; ENDIF
  MoveAbsJ \Conc, %joints%\NoEOffs,v1,fine,t;
  jv:=%joints%; pv := %point%;
  MoveC %point%,%point%,[1,2,3,4],fine,t;
ENDPROC ENDMODULE
)"));
  EXPECT_THAT(lines(program), ElementsAre(2U, 3U, 4U, 5U, 6U, 12U, 13U, 16U, 17U, 18U, 18U, 19U, 19U));
  EXPECT_THAT(program.warnings, IsEmpty()) << testing::PrintToString(program.warnings);
  EXPECT_EQ(program.targets[0].name, "pa");
  EXPECT_EQ(program.targets[9].name, "jv");
}

TEST(Rapid, WhatIsNoTargetStaysAndIsListedWhereItLooksLikeOne) {
  const TargetProgram program = rapid(filled(R"(PERS num grid{2,6}:=[[1,2,3,4,5,6],[7,8,9,10,11,12]];
VAR num movel1{2,6}:=%joints%;
x:=%joints%;
MyProc %joints%;
j:=CalcJ(%joints%);
p:=CalcP(%point%,t);
MoveJ %point%,v1,fine,t;
)"));
  EXPECT_THAT(lines(program), ElementsAre(7U));
  ASSERT_EQ(program.warnings.size(), 6U) << testing::PrintToString(program.warnings);
  for (std::size_t k = 0; k < 6; ++k)
    EXPECT_THAT(program.warnings[k], HasSubstr(fmt::format("p.mod:{}: ", k + 1)));
  EXPECT_THAT(rapid("PERS tooldata t:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,50],[1,0,0,0],0,0,0]];\n"
                    "PERS wobjdata w:=[FALSE,TRUE,\"\",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n"
                    "VAR num a{2,3}:=[[1,2,3],[4,5,6]];\nMoveL " +
                    point + ",[100,500,5000,1000],z1,t;\n")
                  .warnings,
              IsEmpty());
}

TEST(Rapid, WhatHoldsNoPlainNumbersIsRefused) {
  refuses(rapid, "MoveJ " + point + ",v1,z1,t;\nMoveL [[300+dx,0,500]," + rest + "],v1,z1,t;\n", 2,
          "'300+dx'");
  refuses(rapid, "CONST robtarget p:=[[300,Max(1,2),500]," + rest + "];\n", 1, "'Max(1,2)'");
  refuses(rapid, "x:=[[300,a{1,2},500]," + rest + "];\n", 1, "'a{1,2}'");
  refuses(rapid, "MoveAbsJ [[1,2,3,4,5,q],[9E9,9E9,9E9,9E9,9E9,9E9]],v1,z1,t;\n", 1, "'q'");
  refuses(rapid, "MoveL [p.trans,[1,0,0,0],c,e],v1,z1,t;\n", 1, "target of numbers");
  refuses(rapid, "CONST robtarget p{2}:=[" + point + ",[[1,2,3],r,c,e]];\n", 1, "target of numbers");
  refuses(rapid, "CONST robtarget p:=[[300,0,500],[1,0,0,0],[0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n", 1,
          "target of numbers");
  refuses(rapid, "MoveJ " + point + ",v1,z1,t;\nCONST robtarget p:=[[300,0,500],[1,0,0,0]\n;\n", 2,
          "ends with ]");
  refuses(rapid, "MoveJ " + point + ",v1,z1,t;\nCONST robtarget p:=[[300,0", 2, "ends with ]");
  for (const char* conf : {"0.5", "1e300", "9", "-8.5", "9E9", "x"}) {
    refuses(rapid, fmt::format("p:=[[300,0,500],[1,0,0,0],[0,{},0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];", conf), 1,
            conf == std::string("x") ? "finite" : "-8 … 8");
  }
  EXPECT_EQ(
      (*rapid("p:=[[300,0,500],[1,0,0,0],[-1,1.0,-8,0],[9E9,9E9,9E9,9E9,9E9,9E9]];").targets[0].quadrant),
      (std::array<int, 3>{-1, 1, -8}));
}

TEST(Rapid, RelativeMovesAreRefused) {
  refuses(rapid, "CONST robtarget p:=" + point + ";\nMoveL Offs(p,0,0,100),v1,fine,t;\n", 2, "Offs");
  refuses(rapid, "CONST robtarget p:=" + point + ";\nMoveJ\\Conc, RelTool (p,0,0,100\\Rz:=90),v1,fine,t;\n",
          2, "RelTool");
  refuses(rapid, "MoveC " + point + ",offs(p,0,0,1),v1,fine,t;\n", 1, "offs");
  EXPECT_THAT(rapid("CONST robtarget p:=" + point + ";\nq:=Offs(p,0,0,1); MoveL q,v1,fine,t;\n").warnings,
              ElementsAre(HasSubstr("p.mod:2: what Offs")));
  EXPECT_THAT(rapid("CONST robtarget p:=" + point + ";\nPDispSet d;\n").warnings,
              ElementsAre(HasSubstr("PDispSet")));
}

TEST(Rapid, SeveralToolsOrWorkObjectsAreListed) {
  const auto moves = [](const std::string& a, const std::string& b) {
    return rapid("MoveJ " + point + ",v1\\T:=5,z1\\Inpos:=i," + a + ";\nMoveC " + point + ",p2,v1,z1," + b +
                 ";\n")
        .warnings;
  };
  EXPECT_THAT(moves("tA", "TA"), IsEmpty());
  EXPECT_THAT(moves("tA", "tB"),
              ElementsAre(AllOf(HasSubstr("several tools"), HasSubstr("ta (line 1), tb (line 2)"))));
  EXPECT_THAT(moves("tA\\WObj:=w1", "tA \\ WObj := w1"), IsEmpty());
  EXPECT_THAT(moves("tA\\WObj:=w1", "tA"),
              ElementsAre(AllOf(HasSubstr("several work objects"), HasSubstr("w1"), HasSubstr("wobj0"))));
  EXPECT_EQ(moves("t{1}\\WObj:=w{1}", "t{2}\\WObj:=w{2}").size(), 2U);
  EXPECT_THAT(rapid("MoveAbsJ \\Conc, " + joints +
                    ",v1,z1,t;\nTriggL p,v1,tr,z1,t;\nSearchL\\Stop,di,s,p,v1,t;\nMoveExtJ e,v1,z9;\n")
                  .warnings,
              IsEmpty());
}

TEST(Val3, OnlyJointPositionsAreRewritten) {
  const std::string j = R"( j1="1" j2="2" j3="3" j4="4" j5="5" j6="6")";
  const TargetProgram program = val3(all_replaced(R"(<?xml version="1.0"?>
<Database>
<Data name="a>b" type="jointRx"><Value key="0"%j%/></Data>
<Data name="vel" type="mdesc"><Value key="0"%j%/></Data>
<Data name="c" type="jointRx"><![CDATA[<Value%j%/>]]></Data>
<!-- <Value%j%/> -->
<Other%j%/>
<Data name="p" type="pointRx"><Value key="0" x="1" y="2" z="3" rx="0" ry="0" rz="0"/><Value x="1" y="2" z="3"/></Data>
<Data name="f" type="frame"><Value key="0" x="1" y="2" z="3" rx="0" ry="0" rz="0"/></Data>
<Data name="g" type="joint"><Value
key="0"%j%/></Data><valueJoint%j%/>
</Database>)",
                                                  "%j%", j));
  EXPECT_THAT(lines(program), ElementsAre(3U, 10U, 11U));
  ASSERT_EQ(program.warnings.size(), 3U) << testing::PrintToString(program.warnings);
  EXPECT_THAT(program.warnings[0], AllOf(HasSubstr("p.dtx:4: "), HasSubstr("vel"), HasSubstr("mdesc")));
  EXPECT_THAT(program.warnings[1], HasSubstr("p.dtx:7: "));
  EXPECT_THAT(program.warnings[2], HasSubstr("2 Cartesian points"));
  refuses(val3, "<Data type=\"jointRx\"><Value j1=\"1\" j2=\"2\"/></Data>", 1, "all of j1");
  refuses(val3, "<Data type=\"jointRx\"><Value" + j + " j1=\"2\"/></Data>", 1, "duplicate attribute");
  refuses(val3, "<Data type=\"jointRx\"><Value" + j + "/>\n<!-- ", 2, "unclosed token");
  refuses(val3, "<Data type=\"jointRx\"><Value" + j + "/>\n<Value j1=\"1>", 2, "unclosed token");
}

/// Seconds of this processor that reading takes, whatever else the machine does; refused or not.
template <class Read>
double seconds(const Read& read, const std::string& text) {
  const std::clock_t start = std::clock();
  try {
    read(text);
  } catch (const InputError&) {
  }
  return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
}

TEST(Programs, AreReadInATimeThatGrowsWithTheirLengthAlone) {
  std::string many = "DEF P()\n";
  for (int k = 0; k < 40000; ++k) many += home;
  EXPECT_EQ(krl(many).targets.size(), 40000U);
  EXPECT_LT(seconds(krl, many), 10);
  std::string one_line = "XS={";
  for (int k = 0; k < 40000; ++k) one_line += "P {E6POS: X 1,Y 2,Z 3,A 4,B 5,C 6},";
  refuses(krl, one_line + "V 1}\n", 1, "once");
  one_line = "PTP ";
  for (int k = 0; k < 40000; ++k) one_line += "P" + axes + " ";
  EXPECT_LT(seconds(krl, one_line), 10);
  std::string modules;
  for (int k = 0; k < 20000; ++k) modules += "MoveAbsJ " + joints + ",v1,z1,t;\n";
  EXPECT_LT(seconds(rapid, modules), 10);
  std::string lists;
  for (int k = 0; k < 300000; ++k) lists += "[1] ";
  EXPECT_LT(seconds(rapid, lists), 10);
  refuses(rapid, "MODULE m\n" + std::string(300000, '['), 2, "at most");
  EXPECT_LT(seconds(rapid, std::string(300000, '[')), 10);
  EXPECT_LT(seconds(rapid, "x:=[" + std::string(300000, '(') + "[" + std::string(300000, '(')), 10);
  std::string tags = "<Data type=\"jointRx\">";
  for (int k = 0; k < 100000; ++k) tags += "<Value/>\n<";
  EXPECT_LT(seconds(val3, tags), 10);
}

/// Whatever is changed in a good program: it is read, or refused with a line; nothing else is thrown, nothing crashes; and
/// written back with its targets as they are it is the same but for their numbers' digits.
TEST(Programs, HaveNoTextThatMakesReadingFailOtherwise) {
  const std::vector<std::pair<ProgramLanguage, std::string>> good{
      {ProgramLanguage::kuka, home + "DECL E6POS P1={X 1,Y 2,Z 3,A 4,B 5,C 6,S 2,T 'B10',E1 0}\nLIN "
                                     "P1:P2\n\"{\" ;{\n$TOOL=TOOL_DATA[3]\n"},
      {ProgramLanguage::rapid, "CONST robtarget p{1}:=[" + point + "];!x\nMoveAbsJ\\Conc," + joints +
                                   "\\NoEOffs,v1,z1,t\\WObj:=w; x:=Offs(p,\"]\");\n"},
      {ProgramLanguage::val3,
       "<?x?><Data type=\"jointRx\"><!-- - --><Value j1=\"1\" j2=\"2\" j3=\"3\" j4=\"4\" j5=\"5\" "
       "j6='6'/><![CDATA[>]]></Data>\n"}};
  int refused = 0;
  for (const auto& [language, text] : good) {
    refused += support::refused_mutations(
        text, {1000, "{}[]()<>,;:=\\\"'!&#$.-+0A \t\n", 20},
        [language = language](const std::string& changed) {
          const TargetProgram program = read_program(support::write("m", changed), language);
          const std::string again = program_text(program, program.targets);
          EXPECT_EQ(read_program(support::write("m", again), language).targets.size(), program.targets.size())
              << changed;
        });
  }
  EXPECT_LT(refused, 3000 - 250);
}

}  // namespace
