// SPDX-License-Identifier: Apache-2.0
// Rates of the diagnosis over hundreds of hidden cases, beside what the data allow.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <mutex>
#include <thread>

#include "judge.hpp"

namespace {

using judging::Outcome;
using judging::Rate;

/// Seeds from here on are never looked at while the algorithm is being made.
constexpr std::uint64_t first_held_back = 1000000;

struct Options {
  std::string row = "all";
  std::size_t cases = 200;
  std::uint64_t seed = 1;
  unsigned jobs = 2;
  std::string csv;
  bool verbose = false;
  std::vector<std::string> dump;
};

Outcome failed(const hidden::Case& c, const std::string& why) {
  Outcome out;
  out.row = c.row;
  out.seed = c.seed;
  out.arm = c.arm_name;
  out.what = c.what;
  out.said = "failed: " + why;
  out.wrong = true;
  out.rms_oracle_m = out.rms_m = std::nan("");
  return out;
}

std::string line_of(const Outcome& o) {
  return fmt::format(
      "{} {} {}: hidden {}; said {}; {} (BIC {:.1f} to {}); held-out rms {:.1f} of {:.1f} um (before "
      "{:.1f}), "
      "{:.2f} s",
      hidden::name(o.row), o.seed, o.arm, o.what, o.said,
      o.decidable ? "decidable" : (o.detectable ? "undecidable" : "undetectable"), o.margin,
      o.rival.empty() ? "nothing" : o.rival, o.rms_m * 1e6, o.rms_oracle_m * 1e6, o.rms_before_m * 1e6,
      o.seconds);
}

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

constexpr const char* csv_header =
    "row,seed,arm,hidden,group,decidable,detectable,margin,untold_margin,rival,said,right,listed,wrong,rms_"
    "before_um,"
    "rms_oracle_um,rms_um,seconds,processor_seconds\n";

std::string csv_line(const Outcome& o) {
  return fmt::format(
      "{},{},{},{},{},{:d},{:d},{:.2f},{:.2f},{},{},{:d},{:d},{:d},{:.2f},{:.2f},{:.2f},{:.3f},{:.3f}\n",
      hidden::name(o.row), o.seed, o.arm, quoted(o.what), quoted(o.group), o.decidable, o.detectable,
      o.margin, o.untold_margin, quoted(o.rival), quoted(o.said), o.right, o.listed, o.wrong,
      o.rms_before_m * 1e6, o.rms_oracle_m * 1e6, o.rms_m * 1e6, o.seconds, o.processor_seconds);
}

/// A case whose answer a reader wants to look into.
bool is_remarkable(const Outcome& o) {
  if (o.wrong || (o.detectable && !o.oracle_converged)) return true;
  if (o.right) return false;
  return o.decidable || (o.detectable && !o.beaten() && !o.listed);
}

std::vector<Outcome> run(hidden::Row row, const Options& options, std::ofstream& csv) {
  std::vector<Outcome> outcomes(options.cases);
  std::atomic<std::size_t> next{0};
  std::mutex writing;
  const auto work = [&] {
    for (;;) {
      const std::size_t k = next++;
      if (k >= options.cases) return;
      const hidden::Case c = hidden::draw(row, options.seed + k);
      Outcome o;
      try {
        o = judging::judge(c);
      } catch (const std::exception& e) {
        o = failed(c, e.what());
      }
      const std::lock_guard<std::mutex> lock(writing);
      if (options.verbose || is_remarkable(o)) std::cout << line_of(o) << std::endl;
      outcomes[k] = std::move(o);
    }
  };
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < std::max(1U, options.jobs); ++t) threads.emplace_back(work);
  for (std::thread& t : threads) t.join();
  if (csv.is_open()) {
    for (const Outcome& o : outcomes) csv << csv_line(o);
  }
  return outcomes;
}

/// The value below which a share of the values lies; of values that are numbers.
double quantile(std::vector<double> values, double share) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  if (values.empty()) return std::nan("");
  std::ranges::sort(values);
  const double at = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (at - static_cast<double>(below)) * (values[above] - values[below]);
}

/// A rate that shall be `goal` or more (or, of errors, or less).
void print_rate(const std::string& what, const Rate& rate, double goal, bool at_most = false) {
  std::string verdict;
  if (goal > 0 && rate.of > 0)
    verdict = fmt::format("  goal {} {:.0f} %: {}", at_most ? "<=" : ">=", 100 * goal,
                          (at_most ? rate.low() <= goal : rate.high() >= goal) ? "met" : "MISSED");
  fmt::print("  {:<44} {:>4}/{:<4} {:>6.1f} % [{:.1f}, {:.1f}]{}\n", what, rate.hits, rate.of,
             100 * rate.value(), 100 * rate.low(), 100 * rate.high(), verdict);
}

bool all(const Outcome&) { return true; }

/// \param which, hit  functions or members of an Outcome
template <class Which, class Hit>
Rate rate_of(const std::vector<Outcome>& outcomes, const Which& which, const Hit& hit) {
  Rate rate;
  for (const Outcome& o : outcomes) {
    if (std::invoke(which, o)) rate.count(std::invoke(hit, o));
  }
  return rate;
}

void print_rates(hidden::Row row, const std::vector<Outcome>& outcomes) {
  constexpr auto decidable = &Outcome::decidable;
  constexpr auto right = &Outcome::right;
  constexpr auto listed = &Outcome::listed;
  constexpr auto wrong = &Outcome::wrong;
  const auto undecidable = [](const Outcome& o) { return !o.decidable && o.detectable && !o.beaten(); };
  const auto beaten = [](const Outcome& o) { return !o.decidable && o.detectable && o.beaten(); };
  const auto undetectable = [](const Outcome& o) { return !o.decidable && !o.detectable; };
  using hidden::Row;
  switch (row) {
    case Row::one:
      print_rate("decidable: exactly that", rate_of(outcomes, decidable, right), 0.97);
      print_rate("undecidable: among the confounded", rate_of(outcomes, undecidable, listed), 0);
      print_rate("another name is better by 10: listed", rate_of(outcomes, beaten, listed), 0);
      print_rate("undetectable: found all the same", rate_of(outcomes, undetectable, listed), 0);
      break;
    case Row::none:
      print_rate("says none", rate_of(outcomes, all, right), 0.98);
      break;
    case Row::local:
      print_rate("decidable: a curve of that joint alone", rate_of(outcomes, decidable, right), 0.95);
      print_rate("decidable without being told its place",
                 rate_of(
                     outcomes, [](const Outcome& o) { return o.untold_margin >= 10; }, right),
                 0);
      print_rate("all: a curve of that joint alone", rate_of(outcomes, all, right), 0);
      break;
    case Row::outside:
      print_rate("decidable: unnamed, the right joint", rate_of(outcomes, decidable, right), 0.95);
      print_rate("all: unnamed, the right joint", rate_of(outcomes, all, right), 0);
      break;
    case Row::two:
      print_rate("decidable: both and nothing else", rate_of(outcomes, decidable, right), 0.90);
      break;
    case Row::third:
      print_rate("decidable: found", rate_of(outcomes, decidable, &Outcome::complete), 0.80);
      print_rate("all: a wrong name", rate_of(outcomes, all, wrong), 0.03, true);
      break;
    case Row::geometry:
      print_rate("compliance and gravity, nothing else", rate_of(outcomes, all, right), 0.95);
      print_rate("and all of them that are decidable",
                 rate_of(outcomes, all, [](const Outcome& o) { return o.right && o.complete; }), 0);
      break;
    case Row::rough:
      print_rate("all that is decidable, or what is missing", rate_of(outcomes, all, right), 0);
      break;
  }
  if (row != Row::third) print_rate("all: a wrong name", rate_of(outcomes, all, wrong), 0);
  if (row == Row::one || row == Row::third || row == Row::two) {
    print_rate("all: a wrong name though the truth is better",
               rate_of(outcomes, all, [](const Outcome& o) { return o.wrong && o.margin > 0; }), 0);
  }
}

/// How far the model with what was found is off on the held-out rows, beside the oracle's.
void print_gap(hidden::Row row, const std::vector<Outcome>& outcomes) {
  std::vector<double> ratio;
  double before = 0;
  double after = 0;
  double oracle = 0;
  for (const Outcome& o : outcomes) {
    if (!std::isfinite(o.rms_m)) continue;
    ratio.push_back(o.ratio());
    before += o.gap2(o.rms_before_m);
    after += o.gap2(o.rms_m);
    oracle += o.gap2(o.rms_oracle_m);
  }
  const double median = quantile(ratio, 0.5);
  const double late = quantile(ratio, 0.95);
  fmt::print(
      "  held-out rms over the oracle's: median {:.3f} ({}), 95 % quantile {:.3f} ({}), largest {:.3f}\n",
      median, median <= 1.02 ? "met" : "MISSED", late, late <= 1.10 ? "met" : "MISSED", quantile(ratio, 1));
  if (row == hidden::Row::none) return;
  const double shrink = 1 - after / before;
  const double best = 1 - oracle / before;
  const double goal = row == hidden::Row::outside ? 0.5 : 0.9;
  fmt::print("  pooled shrink of the gap: {:.3f}, the oracle's {:.3f}: {:.3f} of it (goal {}: {})\n", shrink,
             best, shrink / best, goal, shrink / best >= goal ? "met" : "MISSED");
}

void print_groups(const std::vector<Outcome>& outcomes) {
  std::map<std::string, std::vector<Outcome>> groups;
  for (const Outcome& o : outcomes) groups[o.group].push_back(o);
  fmt::print("  {:<26} {:>6} {:>10} {:>12} {:>10} {:>8} {:>12}\n", "by kind", "cases", "decidable",
             "right of it", "listed", "wrong", "median ratio");
  for (const auto& [name, list] : groups) {
    const Rate right = rate_of(list, &Outcome::decidable, &Outcome::right);
    const Rate listed = rate_of(list, all, &Outcome::listed);
    const Rate wrong = rate_of(list, all, &Outcome::wrong);
    std::vector<double> ratio;
    for (const Outcome& o : list) ratio.push_back(o.ratio());
    fmt::print("  {:<26} {:>6} {:>10} {:>12} {:>10} {:>8} {:>12.3f}\n", name, list.size(), right.of,
               right.hits, listed.hits, wrong.hits, quantile(ratio, 0.5));
  }
}

void print_table(hidden::Row row, const std::vector<Outcome>& outcomes) {
  double sum = 0;
  double processor = 0;
  double longest = 0;
  for (const Outcome& o : outcomes) {
    processor += o.processor_seconds / static_cast<double>(outcomes.size());
    sum += o.seconds / static_cast<double>(outcomes.size());
    longest = std::max(longest, o.seconds);
  }
  const Rate decidable = rate_of(outcomes, all, &Outcome::decidable);
  const Rate detectable = rate_of(outcomes, all, &Outcome::detectable);
  fmt::print(
      "\n{}: {} cases, {} decidable, {} undetectable; {:.2f} s per diagnosis by the clock ({:.2f} s "
      "of the thread), longest {:.2f} s\n",
      hidden::name(row), outcomes.size(), decidable.hits, detectable.of - detectable.hits, sum, processor,
      longest);
  print_rates(row, outcomes);
  print_gap(row, outcomes);
  print_groups(outcomes);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("Rates of the diagnosis over hidden cases, beside an oracle");
  app.add_option("--row", options.row, "one none local outside two third geometry rough, or all");
  app.add_option("--cases", options.cases, "per row");
  app.add_option("--seed", options.seed, "of the first case; from 1,000,000 on they are held back");
  app.add_option("--jobs", options.jobs, "threads");
  app.add_option("--csv", options.csv, "a line per case goes there");
  app.add_flag("--verbose", options.verbose, "a line for every case, not only for those that went wrong");
  app.add_option("--dump", options.dump,
                 "SEED DIR: writes that case of --row as D.csv, H.csv, R.yaml and T.yaml, and runs nothing")
      ->expected(2);
  CLI11_PARSE(app, argc, argv);
  try {
    std::vector<hidden::Row> rows = hidden::all_rows();
    if (options.row != "all") {
      const auto row = hidden::row_of(options.row);
      if (!row) throw std::runtime_error("no such row: " + options.row);
      rows = {*row};
    }
    if (!options.dump.empty()) {
      std::filesystem::create_directories(options.dump[1]);
      const hidden::Case c = hidden::draw(rows.front(), std::stoull(options.dump[0]));
      hidden::dump(c, options.dump[1]);
      fmt::print("{} {} {}: {}\n", hidden::name(c.row), c.seed, c.arm_name, c.what);
      return 0;
    }
    std::ofstream csv;
    if (!options.csv.empty()) {
      csv.open(options.csv);
      csv << csv_header;
    }
    const std::uint64_t last = options.seed + options.cases - 1;
    fmt::print("seeds {} to {}: {}\n", options.seed, last,
               options.seed >= first_held_back
                   ? "held back"
                   : (last >= first_held_back ? "for development AND held back" : "for development"));
    std::fflush(stdout);
    std::map<hidden::Row, std::vector<Outcome>> results;
    for (const hidden::Row row : rows) {
      results[row] = run(row, options, csv);
      print_table(row, results[row]);
    }
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "{}\n", e.what());
    return 3;
  }
}
