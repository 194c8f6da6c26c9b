// SPDX-License-Identifier: Apache-2.0
// Programs of ABB (RAPID).
#include <fmt/format.h>

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
  using namespace flexcomp::host;
  const std::string rest = "[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";
  const std::string point = "[[300,0,500]," + rest;
  const std::string joints = "[[1,2,3,4,5,6],[9E9,9E9,9E9,9E9,9E9,9E9]]";
  std::vector<Bytes> all{
      ticket_seed(0, "MODULE m\nCONST robtarget p:=" + point + ";\nPERS jointtarget j{2}:=[" + joints + "," +
                         joints + "];\nPROC main()\nMoveAbsJ \\Conc, " + joints + ",v1,z1,t;\nMoveL " +
                         point + ",v1000,fine,tool0\\WObj:=w;\nTriggL p,v1,tr,z1,t; ! " + joints +
                         "\nSearchL\\Stop,di,s,p,v1,t;\nENDPROC\nENDMODULE\n"),
      ticket_seed(1, "MoveAbsJ " + joints + ",v1,z1,t;\n"),
      // Among the ways to a pose cfx chooses.
      ticket_seed(1, "MoveL [[400,100,500],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1,z1,t;\n"),
      ticket_seed(1, "MoveL [[400,100,500],[0,0,1,0],[0,0,0,1],[9E9,9E9,9E9,9E9,9E9,9E9]],v1,z1,t;\n"),
      ticket_seed(1, "MoveL [[400,100,300],[0,0.6,0.8,0],[0,0,0,2],[9E9,9E9,9E9,9E9,9E9,9E9]],v1,z1,t;\n"),
      ticket_seed(1, "MoveL [[400,100,500],[0,0,1,0],[0,-1,0,1],[9E9,9E9,9E9,9E9,9E9,9E9]],v1,z1,t;\n"),
      ticket_seed(1, "CONST robtarget p:=" + point +
                         ";\nMoveC p,p,v1,z1,t;\nMoveL Offs(q,0,0,1),v1,z1,t;\nPDispOn p,t;\n"),
      ticket_seed(
          0, "RECORD r\nrobtarget p;\nnum n;\nENDRECORD\nVAR r x:=[" + point +
                 ",1];\nMoveJ p,v1,z1,t;\nMoveAbsJ " + joints +
                 ",v1,z1,t;\nPERS tooldata t:=[TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"),
      ticket_seed(0, "MoveL [[1,2,3],[1,0,0,0],[0,9,0.5,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1,z1,t;\n"),
      ticket_seed(0, "CONST robtarget p:=" + std::string(70, '[') + ";\n"),
      ticket_seed(0, "RECORD r\njointtarget p;\nENDRECORD\nVAR r x:=[" + joints + "];\nMoveAbsJ " + joints +
                         ",v1,z1,t;\n")};
  // Postures of an IRB 120 with their quarters, and with their own and others' sides: few, as the ways to a pose take their time.
  for (std::size_t k = 0; k < std::size(postures); k += 3) {
    for (const unsigned what : {3U, 19U, 23U}) {
      const auto at = nominal_pose(irb120(), postures[k]);
      const Eigen::Quaterniond o(at.rotation);
      const auto cf = quadrants_of(postures[k], {0, 0, 0});
      all.push_back(ticket_seed(
          what, fmt::format("MoveL [[{:.6f},{:.6f},{:.6f}],[{:.9f},{:.9f},{:.9f},{:.9f}],[{},{},{},{}],[9E9,"
                            "9E9,9E9,9E9,9E9,9E9]],v1,z1,t;\n",
                            at.position.x() * 1e3, at.position.y() * 1e3, at.position.z() * 1e3, o.w(), o.x(),
                            o.y(), o.z(), cf[0], cf[1], cf[2], (what / 2 + k) % 8)));
    }
  }
  return all;
}

const Register registered({"rapid", run, seeds, mutate_words<words>});

}  // namespace
}  // namespace fuzz::rapid_target
