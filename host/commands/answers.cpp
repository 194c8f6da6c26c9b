// SPDX-License-Identifier: Apache-2.0
#include "commands/answers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "files/csv.hpp"
#include "json.hpp"
#include "units.hpp"

namespace flexcomp::host {

std::string status_words(std::uint16_t flags) {
  std::vector<std::string> words;
  for (unsigned bit = 0; bit < 16; ++bit) {
    if ((flags >> bit & 1U) != 0) words.emplace_back(flag_name(bit));
  }
  return words.empty() ? name(StepStatus::ok) : fmt::format("{}", fmt::join(words, "+"));
}

std::string answers_text(const TargetsFile& targets, const std::vector<Answer>& answers) {
  std::vector<std::string> cells;
  for (std::size_t j = 0; j < joint_count; ++j) cells.push_back(fmt::format("q{}_deg", j + 1));
  cells.insert(cells.end(), answer_columns.begin(), answer_columns.end());
  for (const std::string& extra : targets.extra) cells.push_back(csv_cell(extra));
  std::string text = fmt::format("{}\n", fmt::join(cells, ","));
  for (std::size_t k = 0; k < answers.size(); ++k) {
    const Answer& a = answers[k];
    cells.clear();
    for (const double q : a.q_rad) cells.push_back(format_si(q, unit::degree));
    cells.push_back(format_si(a.residual_m, unit::mm));
    cells.push_back(format_si(a.residual_rad, unit::degree));
    cells.push_back(status_words(a.flags));
    for (const std::string& extra : targets.rows[k].extra) cells.push_back(csv_cell(extra));
    text += fmt::format("{}\n", fmt::join(cells, ","));
  }
  return text;
}

Json answers_summary(const std::vector<std::array<double, joint_count>>& commands,
                     const std::vector<Answer>& answers) {
  Json status;
  for (const StepStatus s : {StepStatus::ok, StepStatus::near_singular, StepStatus::limited,
                             StepStatus::at_limit, StepStatus::no_set, StepStatus::refused}) {
    status[name(s)] =
        std::count_if(answers.begin(), answers.end(), [s](const Answer& a) { return a.status == s; });
  }
  double correction = 0;
  double mean = 0;
  double largest = 0;
  double largest_turn = 0;
  for (std::size_t k = 0; k < answers.size(); ++k) {
    for (std::size_t j = 0; j < joint_count; ++j) {
      correction = std::max(correction, std::abs(answers[k].q_rad[j] - commands[k][j]));
    }
    mean += answers[k].residual_m / static_cast<double>(answers.size());
    largest = std::max(largest, answers[k].residual_m);
    largest_turn = std::max(largest_turn, answers[k].residual_rad);
  }
  return {{"targets", answers.size()},
          {"status", status},
          {"largest_correction_deg", degrees(correction)},
          {"residual_mean_mm", mean * 1e3},
          {"residual_max_mm", largest * 1e3},
          {"residual_max_deg", degrees(largest_turn)}};
}

}  // namespace flexcomp::host
