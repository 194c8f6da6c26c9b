// SPDX-License-Identifier: Apache-2.0
/// \file
/// Readers of robot, truth and CSV files, independent of the host's. Unknown keys are refused.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "true_robot.hpp"

namespace plant {

/// \throws std::runtime_error (as all here)
Nominal read_robot(const std::string& path);
Truth read_truth(const std::string& path, const Nominal& nominal);

/// Row of a file with joint columns q1_deg … q6_deg.
struct Row {
  JointVector q_rad{};
  Context context;
};
std::vector<Row> read_joints(const std::string& path, const Nominal& nominal);

void save(const std::string& path, const std::string& text);

/// CSV file, written at the end.
class Table {
 public:
  explicit Table(std::vector<std::string> header) : header_(std::move(header)) {}
  void row(const std::vector<double>& values);
  void save(const std::string& path) const;

 private:
  std::vector<std::string> header_;
  std::vector<std::vector<double>> rows_;
};

}  // namespace plant
