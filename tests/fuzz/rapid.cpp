// SPDX-License-Identifier: Apache-2.0
// Programs of ABB (RAPID).
#include "programs.hpp"

namespace fuzz::rapid_target {
namespace {

constexpr const char* words[] = {"CONST ",
                                 "PERS ",
                                 "VAR ",
                                 "LOCAL ",
                                 "robtarget ",
                                 "jointtarget ",
                                 "MoveJ ",
                                 "MoveL ",
                                 "MoveC ",
                                 "MoveAbsJ ",
                                 "TriggL ",
                                 "SearchL\\Stop,",
                                 "[",
                                 "]",
                                 "[[300,0,500],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]",
                                 "[[1,2,3,4,5,6],[9E9,9E9,9E9,9E9,9E9,9E9]]",
                                 ":=",
                                 ";",
                                 ",",
                                 "Offs(",
                                 "RelTool(",
                                 ")",
                                 "\\Conc",
                                 "!",
                                 "\"",
                                 "{2}",
                                 "PDispOn",
                                 "\n",
                                 "tooldata",
                                 "wobjdata",
                                 "RECORD",
                                 "ENDRECORD",
                                 "9E+09",
                                 "-",
                                 "8",
                                 "MODULE m\n",
                                 "ENDMODULE\n"};

void run(Input input) { play_program(input, flexcomp::host::ProgramLanguage::rapid); }

std::vector<Bytes> seeds() {
  const std::string rest = "[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";
  const std::string point = "[[300,0,500]," + rest;
  const std::string joints = "[[1,2,3,4,5,6],[9E9,9E9,9E9,9E9,9E9,9E9]]";
  return {
      with_options({0}, "MODULE m\nCONST robtarget p:=" + point + ";\nPERS jointtarget j{2}:=[" + joints +
                            "," + joints + "];\nPROC main()\nMoveAbsJ \\Conc, " + joints +
                            ",v1,z1,t;\nMoveL " + point +
                            ",v1000,fine,tool0\\WObj:=w;\nTriggL p,v1,tr,z1,t; ! " + joints +
                            "\nSearchL\\Stop,di,s,p,v1,t;\nENDPROC\nENDMODULE\n"),
      with_options({1}, "MoveAbsJ " + joints + ",v1,z1,t;\n"),
      // Among the ways to a pose cfx chooses.
      with_options({1}, "MoveL [[400,100,500],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1,z1,t;\n"),
      with_options({1}, "MoveL [[400,100,500],[0,0,1,0],[0,0,0,1],[9E9,9E9,9E9,9E9,9E9,9E9]],v1,z1,t;\n"),
      with_options({1}, "MoveL [[400,100,300],[0,0.6,0.8,0],[0,0,0,2],[9E9,9E9,9E9,9E9,9E9,9E9]],v1,z1,t;\n"),
      with_options({1}, "MoveL [[400,100,500],[0,0,1,0],[0,-1,0,1],[9E9,9E9,9E9,9E9,9E9,9E9]],v1,z1,t;\n"),
      with_options({1}, "CONST robtarget p:=" + point +
                            ";\nMoveC p,p,v1,z1,t;\nMoveL Offs(q,0,0,1),v1,z1,t;\nPDispOn p,t;\n"),
      with_options(
          {0},
          "RECORD r\nrobtarget p;\nnum n;\nENDRECORD\nVAR r x:=[" + point +
              ",1];\nMoveJ p,v1,z1,t;\nMoveAbsJ " + joints +
              ",v1,z1,t;\nPERS tooldata t:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n")};
}

const Register registered({"rapid", run, seeds, mutate_words<words>});

}  // namespace
}  // namespace fuzz::rapid_target
