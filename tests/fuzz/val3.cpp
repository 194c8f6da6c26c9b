// SPDX-License-Identifier: Apache-2.0
// Programs of Staubli (VAL 3, .dtx).
#include "programs.hpp"

namespace fuzz::val3_target {
namespace {

constexpr const char* words[] = {"<Data name=\"a\" type=\"jointRx\">",
                                 "</Data>",
                                 "<Value key=\"0\" j1=\"1\" j2=\"2\" j3=\"3\" j4=\"4\" j5=\"5\" j6=\"6\"/>",
                                 "<valueJoint j1=\"1\" j2=\"2\" j3=\"3\" j4=\"4\" j5=\"5\" j6=\"6\"/>",
                                 "<Datas>",
                                 "</Datas>",
                                 "<Database>",
                                 "</Database>",
                                 "type=\"pointRx\"",
                                 "type=\"joint\"",
                                 "<!--",
                                 "-->",
                                 "<![CDATA[",
                                 "]]>",
                                 "<!DOCTYPE a>",
                                 "&amp;",
                                 "&#x31;",
                                 "j1=\"",
                                 "\"",
                                 "'",
                                 "/>",
                                 ">",
                                 "<",
                                 "<?xml version=\"1.0\" encoding=\"iso-8859-1\"?>",
                                 "nan",
                                 "1e999",
                                 "\n",
                                 "\t",
                                 " ",
                                 "x:"};

void run(Input input) { play_program(input, flexcomp::host::ProgramLanguage::val3); }

std::vector<Bytes> seeds() {
  const std::string j = R"( j1="1" j2="2" j3="3" j4="4" j5="5" j6="6")";
  return {
      ticket_seed(1, file_of("docs/examples/weld.dtx")),
      ticket_seed(1, "<Data name=\"g\" type=\"joint\"><Value\nkey=\"0\"" + j + "/></Data>"),
      ticket_seed(
          0, "<?xml version=\"1.0\"?>\n<Database>\n<Data name=\"a>b\" type=\"jointRx\"><Value key=\"0\"" + j +
                 "/></Data>\n<Data name=\"vel\" type=\"mdesc\"><Value" + j + "/></Data>\n<!-- <Value" + j +
                 "/> --><Data name=\"p\" type=\"pointRx\"><Value key=\"0\" x=\"1\" y=\"2\" z=\"3\" "
                 "rx=\"0\" ry=\"0\" rz=\"0\"/></Data><valueJoint" +
                 j + "/></Database>")};
}

const Register registered({"val3", run, seeds, mutate_words<words>});

}  // namespace
}  // namespace fuzz::val3_target
