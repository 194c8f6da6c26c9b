// SPDX-License-Identifier: Apache-2.0
/// \file
/// Tables of instruments and robots: options from bytes, good examples, words.
#pragma once

#include "exchange/joined_data.hpp"
#include "exchange/joining.hpp"
#include "exchange/point_list.hpp"
#include "exchange/robot_log.hpp"
#include "files/data_file.hpp"
#include "host_text.hpp"

namespace fuzz {

inline constexpr const char* table_words[] = {",",           ";",
                                              "\t",          " ",
                                              "\n",          "\r\n",
                                              "\r",          "\"",
                                              "\"\"",        ".",
                                              "-",           "e5",
                                              "1,234",       "1.234,5",
                                              "nan",         "# ",
                                              "// ",         "! ",
                                              "% ",          "Units: Millimeters, Degrees\n",
                                              "Unit = mm\n", "units are in inches\n",
                                              "X [mm]",      "Measured Y",
                                              "z_mm",        "Name",
                                              "Point",       "Collection::Group::Point",
                                              "Group",       "qw",
                                              "qx,qy,qz",    "rx",
                                              "ry",          "rz",
                                              "A,B,C",       "sigma",
                                              "Ux [µm]",     "uy",
                                              "uz",          "Time [ms]",
                                              "Date",        "2026-03-01T12:30:05.25Z",
                                              "12:30:05.25", "q1_deg",
                                              "J1 [rad]",    "axis1",
                                              "joint1_deg",  "payload_kg",
                                              "temp_c",      "\xB5",
                                              "\xFF\xFE",    "\xEF\xBB\xBF",
                                              "Nominal X",   "::"};

/// Dialect, angles, units, columns.
inline flexcomp::host::PointListOptions point_options(unsigned what) {
  using namespace flexcomp::host;
  PointListOptions options;
  if ((what & 1U) != 0) options.length = {length_unit_of("mm"), "--unit"};
  if ((what & 2U) != 0) options.angle = {angle_unit_of("deg"), "--angle-unit"};
  if ((what & 4U) != 0) options.angles = static_cast<AngleConvention>((what >> 6U & 3U) % 3U);
  if ((what & 8U) != 0) options.dialect.decimal = (what & 16U) != 0 ? ',' : '.';
  if ((what & 32U) != 0) options.dialect.delimiter = ";, \t"[what >> 6U & 3U];
  if ((what & 48U) == 16U) options.columns = {"name", "-", "x", "y", "z", "sigma"};
  if ((what & 256U) != 0) options.columns = {"name", "x", "y", "z", "sigma", "sx", "sy", "sz"};
  if ((what & 512U) != 0) options.columns = {"name", "x", "y", "zz"};
  if ((what & 1024U) != 0) options.coverage = 2;
  return options;
}

inline flexcomp::host::LogMap log_options(unsigned what) {
  using namespace flexcomp::host;
  LogMap map;
  if ((what & 1U) != 0) map.joint_unit = {angle_unit_of((what & 2U) != 0 ? "rad" : "deg"), "--joint-unit"};
  if ((what & 4U) != 0) map.name = "Pose";
  if ((what & 8U) != 0) map.time = "Time";
  if ((what & 16U) != 0) map.dialect.decimal = ',';
  if ((what & 32U) != 0) map.dialect.delimiter = ';';
  if ((what & 64U) != 0) map.context = {{"payload_kg", "Load"}};
  if ((what & 128U) != 0) {
    map.joints.emplace();
    for (std::size_t j = 0; j < joint_count; ++j)
      (*map.joints)[j] = {"A" + std::to_string(j + 1), angle_unit_of("deg"), j % 2 == 0 ? 1.0 : -1.0, 0.1};
    if ((what & 256U) != 0) (*map.joints)[3] = (*map.joints)[2];
  }
  if ((what & 512U) != 0) map.context.emplace_back("temp_c", "Temp");
  if ((what & 1024U) != 0) map.context.emplace_back("com_x_mm", "CoM [mm]");
  if ((what & 2048U) != 0) map.context.emplace_back("fx_n", "Fx [kg]");
  if ((what & 4096U) != 0) map.context.emplace_back("temp_c", "Temp [°C]");
  if ((what & 8192U) != 0) map.time_unit = time_unit_of("ms");
  return map;
}

// NOLINTBEGIN(bugprone-suspicious-missing-comma): long lines are broken.
inline const std::string point_lists[] = {
    "Units: Millimeters, Degrees\nCollection::Group::Point X Y Z\nA::G::P1 100.5 200 300\nA::G::P2 101 201 "
    "301.25\n",
    "Name;X [mm];Y [mm];Z [mm];sigma;Nominal X\nP1;100,5;200;300;0,01;1\nP2;101;201,5;301;0,02;1\n",
    "# "
    "exported\nPoint,x_mm,y_mm,z_mm,qw,qx,qy,qz,Time\nP1,1,2,3,1,0,0,0,12:30:05\nP2,4,5,6,0.5,0.5,0.5,0.5,12:"
    "31:05.5\n",
    "Name,X,Y,Z,rx,ry,rz\nP1,1,2,3,10,20,30\n\"P,2\",4,5,6,40,50,60\n",
    "name\tx\ty\tz\tA\tB\tC\nP1\t1\t2\t3\t10\t20\t30\n",
    "P1_a,1.5,2.5,3.5\nP1_b,4.5,5.5,6.5\nP1_c,7.5,8.5,9.5\n",
    "Name,X [mm],Y [mm],Z [mm],Ux [µm],Uy [µm],Uz [µm],Date,Time\nP1,1,2,3,10,11,12,2026-03-01,12:30:05\n",
    "P1,x,1,2,3,0.1\nP2,y,4,5,6,0.2\n",
    // Refused, each for a reason of its own, or read with a part left out.
    "Name,X [mm],Y [mm],Z [mm],sigma,ux,uy,uz\nP1,1,2,3,0.1,0.1,0.1,0.1\n",
    "Name,X [mm],Y [mm],Z [mm],rx [deg],ry [deg],rz [deg],a [deg],b [deg],c [deg]\nP1,1,2,3,4,5,6,7,8,9\n",
    "Name,X [mm],Y [mm],Z [mm],Measured X\nP1,1,2,3,4\n", "Name,X [mm],Y [mm],Z [mm],sigma\nP1,1,2,3,0\n",
    "Name,X [mm],Y [mm],Z [mm],rx [deg],ry [deg],rz [deg]\nP1,1,2,3,4,5,6\n",
    "Name,X [mm],Y [mm],Z [mm],Time [ms]\nP1,1,2,3,100\nP2,2,3,4,2000\n",
    "Name;X [mm];Y [mm];Z [mm]\nP1;1,234;2,345;3,456\n", "Name;X [mm];Y [mm];Z [mm]\nP1;1,2;2.5;3\n",
    "Name;X [mm];Y [mm];Z [mm]\nP1;1.5;2.5;3,5\nP2;1;2;3\n", "1,234 5,678 9,123\n2,345 6,789 1,234\n",
    "P1,1,2,3\nP2,4,5,6,\"7\n", "Units: furlongs\nP1 1 2 3\n", "Units of length: mm, deg\nP1 1 2 3\n",
    "# lengths are in millimetres (mm)\n# Units in mm\nP1 1 2 3\n", "Unités : mm\nP1 1 2 3\n",
    "Units: mm\nUnit = inch\nP1 1 2 3\n", "# unit\nNAME X_mm Y_mm Z_in\nP1 1 2 3\n",
    "units are degrees celsius\nunits are in mm\nP1 1 2 3\n",
    "Name,X [mm],Y [mm],Z [mm],Time\nP1,1,2,3,2026-03-01T12:30:05\nP2,1,2,4,12:31:05\n",
    "Name,X [mm],Y [mm],Z [mm],Time\nP1,1,2,3,12:30:05\nP2,1,2,4,11:30:05\n",
    "Name,X [mm],Y [mm],Z [mm],Time\nP1,1,2,3,0.5\nP2,1,2,4,1.5\n",
    "P1_a 1 2 3\nP1_b 2 2 3\nP1_c 3 3 3\nP1_d 4 4 4\nP2_a 1 2 3\nP2_b 1 5 3\nP2_c 9 2 3\nP3_a 1 1 1\nother 1 "
    "2 3\n",
    "P1_a 1 2 3\nP1_b 2 2 3\nP1_c 3 3 3\nP1_d 4 4 4\nP2_a 1 2 3\nP2_c 9 2 3\nP2_d 1 2 9\n",
    "P1_a 1 2 3\nP1_a 2 2 3\n", "A::P1 1 2 3\nB::P1 1 2 4\n", "P1 1 2 3\nP1 1 2 3.01\nP2 2 2 2\n"};

inline const std::string robot_logs[] = {
    "Pose,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\nP1,10,20,30,40,50,60\nP2,11,21,31,41,51,61\n",
    "Pose;J1 [rad];J2 [rad];J3 [rad];J4 [rad];J5 [rad];J6 "
    "[rad];payload_kg\nP1;0,1;0,2;0,3;0,4;0,5;0,6;1,5\nP2;0,1;0,2;0,3;0,4;0,5;0,7;1\n",
    "Units: "
    "deg\nTime,a1,a2,a3,a4,a5,a6,Load\n12:30:04.9,10,20,30,40,50,60,1\n12:30:05.1,10,20,30,40,50,60,1\n12:31:"
    "05.4,11,20,30,40,50,60,1\n",
    "Pose,Time,A1,A2,A3,A4,A5,A6,temp_c\nP1,2026-03-01T12:30:05Z,10,20,30,40,50,60,25\n",
    "% log\nname joint1_deg joint2_deg joint3_deg joint4_deg joint5_deg joint6_deg\nP1 1 2 3 4 5 6\n",
    // Refused, each for a reason of its own, or read with a part left out.
    "Name,Point,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\nP1,P2,1,2,3,4,5,6\n",
    "J1_deg,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n1,2,3,4,5,6,7\n",
    "q1_deg,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n1,2,3,4,5,6,7\n",
    "Pose,Time "
    "[ms],q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,Temp,Load\nP1,500,1,2,3,4,5,6,25,1\nP2,1500,1,2,3,"
    "4,5,7,25,2\n",
    "Pose,Time,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,Temp [°C],CoM "
    "[mm]\nP1,0.5,1,2,3,4,5,6,25,1\nP2,1.5,1,2,3,"
    "4,5,7,25,2\n",
    "Pose,Time [furlongs],q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,Fx [kg]\nP1,0.5,1,2,3,4,5,6,25\n",
    "Pose,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\nP1,400,2,3,4,5,6\n",
    "Pose,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n,1,2,3,4,5,6\n",
    "Pose,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\nP1,1,2,3,4,5,6\nP1,2,2,3,4,5,6\n",
    "Time,Timestamp,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n1,2,1,2,3,4,5,6\n",
    "Pose,Time,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\nP1,12:30:05,1,2,3,4,5,6\nP2,12:30:05.2,2,2,3,4,5,"
    "6\n",
    "Pose,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,dir2,move1_deg\nP1,1,2,3,4,5,6,7,1\nP2,1,2,3,4,5,6,1,-"
    "1\n",
    "q1 [deg],q2 [rad],q3 [V],q4 [deg],q5 [deg],q6 [deg]\n1,2,3,4,5,6\n"};
// NOLINTEND(bugprone-suspicious-missing-comma)

}  // namespace fuzz
