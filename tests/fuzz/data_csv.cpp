// SPDX-License-Identifier: Apache-2.0
// Data files, files of joints and files of targets (bits 0, 1 of the first byte; bit 2: suspicious values are taken; bit 3: for a
// robot of which nothing is known of its noise).
#include "files/data_file.hpp"
#include "host_text.hpp"

namespace fuzz::data_csv_target {
namespace {

using namespace flexcomp::host;

constexpr const char* words[] = {",",         "\n",        "\r\n",   "\"",         "\"\"",
                                 ";",         ".",         "-",      "e",          "1e999",
                                 "nan",       "inf",       "0x1",    "q1_deg",     "x_mm",
                                 "qw",        "ax_mm",     "dz_mm",  "payload_kg", "com_x_mm",
                                 "dir1",      "move1_deg", "temp_c", "fx_n",       "sigma_mm",
                                 "sigma_deg", "time_s",    "point",  "seed1_deg",  "\xEF\xBB\xBF",
                                 "\xFF",      " ",         "\t"};

std::string without_noise(std::string robot) {
  const std::size_t at = robot.find("noise:");
  return robot.erase(at, robot.find('\n', at) + 1 - at);
}

void run(Input input) {
  const unsigned what = input.u8();
  const std::string path = path_of(input.text());
  const LoadOptions options{(what & 4U) != 0};
  static const Robot noiseless = parse_robot(without_noise(file_of("host/robots/tx60l.yaml")), "tx60l.yaml");
  const Robot& robot = (what & 8U) != 0 ? noiseless : tx60l();
  if ((what & 3U) == 0) {
    reads([&] { load_targets(path, robot, options); });
    return;
  }
  const bool measured = (what & 3U) != 1;
  const auto load = [&](const std::string& file) {
    return measured ? load_data(file, robot, options) : load_joints(file, robot, options);
  };
  MeasuredData data;
  if (!reads([&] { data = load(path); })) return;
  for (const Measurement& row : data.rows) {
    for (const double q : row.q_rad) require(std::isfinite(q), "a reading that is not finite was read");
    require(row.position_m.allFinite() && std::abs(row.orientation.norm() - 1) < 1e-9,
            "a measurement that means nothing was read");
  }
  const std::string written = data_text(data);
  MeasuredData again;
  must_read(written, [&] { again = load(path_of(written)); });
  require(again.rows.size() == data.rows.size() && again.kind == data.kind, "rows were lost in writing");
  for (std::size_t k = 0; k < data.rows.size(); ++k) {
    require(data.rows[k].q_rad == again.rows[k].q_rad &&
                data.rows[k].position_m == again.rows[k].position_m &&
                data.rows[k].extra == again.rows[k].extra,
            "another row is read from what was written");
  }
  require_same(written, data_text(again), "a data file");
}

std::vector<Bytes> seeds() {
  const std::string pose =
      "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm,qw,qx,qy,qz,payload_kg,move1_deg,dir2,note\n"
      "10,20,30,40,50,60,100.5,-200,1e2,1,0,0,0,1.108,5,-1,a\n"
      "-10,20,30,-40,50,60,100.5,-200,1e2,0.5,0.5,0.5,0.5,1.108,-5,0,\"b,\"\"c\"\n"
      "10,-20,30,40,50,160,100.5,-200,1e2,0,0,1,0,0,15,1,\n";
  const std::string points =
      "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,ax_mm,ay_mm,az_mm,bx_mm,by_mm,bz_mm,cx_mm,cy_mm,cz_mm,sigma_"
      "mm,temp_c,fx_n,time_s\r\n"
      "10,20,30,40,50,60,1,2,3,11,2,3,1,12,3,0.01,25,1,0\r\n12,20,30,40,50,60,1,2,3,11,2,3,1,12,3,0.01,25,1,"
      "5\r\n";
  const std::string joints =
      "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n10,20,30,40,50,60\n10,20,30,40,50,60\n";
  // Refused, each for a reason of its own, or read with a warning.
  const std::string six = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg";
  const std::string q = "10,20,30,40,50,60";
  const std::string others[] = {
      six + ",x_mm,y_mm,z_mm,ax_mm,ay_mm,az_mm,bx_mm,by_mm,bz_mm,cx_mm,cy_mm,cz_mm\n" + q +
          ",1,2,3,1,2,3,1,2,4,1,5,3\n",
      six + ",x_mm,y_mm,z_mm\n400,20,30,40,50,60,1,2,3\n",
      six + ",x_mm,y_mm,z_mm\n" + q + ",1,2,3\n" + q + ",1,2,3\n",
      six + ",x_mm,y_mm,z_mm\n" + q + ",1,2,3\n\n" + q + ",1,2,4\n",
      six + ",x_mm,y_mm,z_mm\n" + q + ",1,2,\"3\n",
      "",
      "\n",
      six + ",x_mm,y_mm,z_mm,move1_deg,dir1\n" + q + ",1,2,3,5,-1\n",
      six + ",x_mm,y_mm,z_mm,dir1\n" + q + ",1,2,3,2\n",
      six + ",x_mm,y_mm,z_mm,move1_deg,move2_deg,move3_deg,move4_deg,move5_deg,move6_deg\n" + q +
          ",1,2,3,5,-1,0,1,2,3\n" + q + ",1,2,4,0,0,0,0,0,0\n",
      six + ",x_mm,y_mm,z_mm,qw,qx,qy,qz\n" + q + ",1,2,3,1,1,0,0\n",
      six + ",status\n" + q + ",ok\n",
      six + ",dq1_deg\n" + q + ",0.1\n",
      six + ",corrected_q1_deg\n" + q + ",0.1\n",
      six + ",payload_kgs\n" + q + ",1\n",
      "x_mm,y_mm,z_mm,qw,qx,qy,qz,seed1_deg,seed2_deg,seed3_deg,seed4_deg,seed5_deg,seed6_deg\n400,100,500,0,"
      "0,1,0," +
          q + "\n",
      "x_mm,y_mm,z_mm,qw,qx,qy,qz\n400,100,500,0,0,1,0\n",
      "x_mm,y_mm,z_mm\n1,2,3\n",
      six +
          ",x_mm,y_mm,z_mm\n1,2,3,1,2,3,1,2,3\n0.1,0.2,0.3,1,2,3,2,2,3\n0.5,0.6,1,2,3,1,3,3,3\n0.2,0.3,1,2,1,"
          "1,4,4,4\n"
          "1,1,1,1,1,1,5,5,5\n1.1,1,1,1,1,1,6,6,6\n1.2,1,1,1,1,1,7,7,7\n1.3,1,1,1,1,1,8,8,8\n1.4,1,1,1,1,1,9,"
          "9,9\n1.5,1,1,1,1,1,9,9,8\n"};
  std::vector<Bytes> all{with_options({2}, pose),  with_options({10}, pose),  with_options({1}, pose),
                         with_options({0}, pose),  with_options({2}, points), with_options({1}, joints),
                         with_options({4}, joints)};
  for (const std::string& text : others) {
    for (unsigned what = 0; what < 8; ++what) all.push_back(with_options({what}, text));
  }
  for (const char* path : {"docs/examples/work.csv", "docs/examples/plan.csv"}) {
    for (unsigned what = 0; what < 8; what += 2) all.push_back(with_options({what}, file_of(path)));
  }
  return all;
}

const Register registered({"data_csv", run, seeds, mutate_words<words>});

}  // namespace
}  // namespace fuzz::data_csv_target
