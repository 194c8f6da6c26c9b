// SPDX-License-Identifier: Apache-2.0
#include "studies/study.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "json.hpp"
#include "report/page.hpp"

namespace flexcomp::host {
namespace {

struct StudyCommand {
  CommonOptions common;
  std::string name;
  std::string arm = "both";
  std::string noise = "both";
  std::size_t repeats = 500;
  std::string report;

  void run() const;
};

std::string figure_text(const std::optional<double>& value) {
  return value ? fmt::format("{:.4g}", *value) : std::string("–");
}

/// Cells of the table, without those columns that are empty in every row.
struct Table {
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;
};

/// \param remark  heading of the last column, if there are remarks
Table table_of(const Study& study, const std::string& remark) {
  Table table;
  table.columns = study.label_names;
  const auto has = [&](auto member) {
    return std::any_of(study.rows.begin(), study.rows.end(),
                       [&](const StudyRow& row) { return (row.*member).has_value(); });
  };
  const bool uncertain = has(&StudyRow::uncertainty);
  const bool limited = has(&StudyRow::limit);
  table.columns.insert(table.columns.end(), {"paper", "ours"});
  if (uncertain) table.columns.emplace_back("±");
  if (limited) table.columns.emplace_back("Cramér-Rao limit");
  const bool remarked = std::any_of(study.rows.begin(), study.rows.end(),
                                    [](const StudyRow& row) { return !row.remark.empty(); });
  if (remarked) table.columns.push_back(remark);
  for (const StudyRow& row : study.rows) {
    std::vector<std::string> cells = row.labels;
    cells.push_back(figure_text(row.paper));
    cells.push_back(figure_text(row.ours));
    if (uncertain) cells.push_back(row.uncertainty ? fmt::format("{:.2g}", *row.uncertainty) : "–");
    if (limited) cells.push_back(figure_text(row.limit));
    if (remarked) cells.push_back(row.remark);
    table.rows.push_back(cells);
  }
  return table;
}

/// Characters, not bytes: é is one.
std::size_t length(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

std::string text_of(const Table& table) {
  std::vector<std::size_t> width;
  for (const std::string& name : table.columns) width.push_back(length(name));
  for (const auto& row : table.rows) {
    for (std::size_t k = 0; k < row.size(); ++k) width[k] = std::max(width[k], length(row[k]));
  }
  const auto line = [&](const std::vector<std::string>& cells) {
    std::string text = " ";
    for (std::size_t k = 0; k < cells.size(); ++k) {
      text += " " + cells[k];
      if (k + 1 < cells.size()) text += std::string(width[k] - length(cells[k]) + 1, ' ');
    }
    return text.erase(text.find_last_not_of(' ') + 1) + "\n";
  };
  std::string text = line(table.columns);
  for (const auto& row : table.rows) text += line(row);
  return text;
}

Json json_of(const Study& study, const StudyOptions& options) {
  Json rows = Json::array();
  for (const StudyRow& row : study.rows) {
    Json j;
    for (std::size_t k = 0; k < row.labels.size(); ++k) j[study.label_names[k]] = row.labels[k];
    const auto put = [&](const char* key, const std::optional<double>& value) {
      j[key] = value ? Json(*value) : Json();
    };
    put("paper", row.paper);
    put("ours", row.ours);
    put("sigma", row.uncertainty);
    put("cramer_rao", row.limit);
    j["remark"] = row.remark;
    rows.push_back(j);
  }
  return {{"study", study.name},        {"title", study.title}, {"quantity", study.quantity},
          {"repeats", options.repeats}, {"seed", options.seed}, {"rows", rows},
          {"notes", study.notes}};
}

Page page_of(const Study& study) {
  Page page;
  page.title = study.title;
  page.summary =
      "The paper's figures, ours, and what no unbiased estimator can better: " + study.quantity + ".";
  const Table table = table_of(study, "remark");
  PageSection section;
  section.title = "Result";
  section.columns = table.columns;
  section.rows = table.rows;
  for (const StudyFigure& figure : study.figures)
    section.figures.emplace_back(plot_curves(figure.curves), figure.caption);
  page.sections.push_back(section);
  page.sections.push_back({"How it was done", study.notes, {}, {}, {}});
  page.made_by = "flexcomp " FLEXCOMP_VERSION ", Chen, Zhang and Sun 2019";
  return page;
}

void StudyCommand::run() const {
  refuse_same_file({}, {{"--report", report}, {"--json", common.json}});
  StudyOptions options;
  if (arm != "rx160l") options.arms.push_back(paper_tx60l());
  if (arm != "tx60l") options.arms.push_back(paper_rx160l());
  if (noise == "N1") options.noises = {noise_n1};
  if (noise == "N2") options.noises = {noise_n2};
  options.repeats = repeats;
  options.seed = common.seed;
  const bool watched = !common.quiet && ::isatty(STDERR_FILENO) == 1;
  if (watched) {
    options.progress = [](const std::string& what, double done) {
      std::fputs(fmt::format("\r\033[K{:3.0f} %  {}", 100 * done, what).c_str(), stderr);
    };
  }
  const auto& all = studies();
  const auto entry =
      std::find_if(all.begin(), all.end(), [&](const StudyEntry& e) { return name == e.name; });
  const Study study = entry->run(options);
  if (watched) std::fputs("\r\033[K", stderr);
  common.say(fmt::format("{}\n  {}\n\n{}", study.title, study.quantity, text_of(table_of(study, ""))));
  for (const std::string& note : study.notes) common.say("  " + note);
  common.write_json(json_of(study, options));
  common.write_report(report, [&] { return page_of(study); });
}

}  // namespace

void add_study(CLI::App& app) {
  auto [command, options] = add_command<StudyCommand>(
      app, "study",
      "The studies of Chen, Zhang and Sun 2019: the paper's figure, ours and the Cramér-Rao limit");
  std::vector<std::string> names;
  std::string list = "Which one:";
  for (const StudyEntry& entry : studies()) {
    names.emplace_back(entry.name);
    list += fmt::format("\n  {:<8} {}", entry.name, entry.about);
  }
  command.add_option("name", options.name, list)->check(CLI::IsMember(names))->required();
  command.add_option("--arm", options.arm, "Which arm of the paper: tx60l, rx160l or both")
      ->check(CLI::IsMember({"tx60l", "rx160l", "both"}))
      ->capture_default_str();
  command.add_option("--noise", options.noise, "N1 (0.035 mm, 0.007 deg), N2 (twice that) or both")
      ->check(CLI::IsMember({"N1", "N2", "both"}))
      ->capture_default_str();
  command.add_option("--repeats", options.repeats, "Calibrations with fresh noise behind each figure")
      ->check(CLI::Range(20, 1000000))
      ->capture_default_str();
  add_value(command, "--report", options.report, "F.html", "Self-contained page with the table and plots");
  options.common.add_seed_to(command);
  options.common.add_to(command);
  command.footer(
      "Example:\n  flexcomp study fig2 --json fig2.json --report fig2.html\nStudies with calibrations (fig4, "
      "fig8, …) take up to some minutes; --repeats 50 makes them shorter.");
}

}  // namespace flexcomp::host
