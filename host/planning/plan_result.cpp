// SPDX-License-Identifier: Apache-2.0
#include "planning/plan_result.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <stdexcept>

#include "files/read_file.hpp"
#include "files/write_file.hpp"
#include "flexcomp/sha256.hpp"
#include "input_error.hpp"
#include "json.hpp"
#include "named_values.hpp"
#include "planning/exchange.hpp"

namespace flexcomp::host {

namespace {

/// The first 64 bits of a file's SHA-256 in hexadecimal; empty for no file.
std::string fingerprint(const std::string& path) {
  if (path.empty()) return "";
  const std::string content = read_file(path);
  std::string hex;
  for (const std::uint8_t byte : sha256(content.data(), content.size())) hex += fmt::format("{:02x}", byte);
  return hex.substr(0, 16);
}

/// A search that is stopped is stored with the task it belongs to, and resumed to the result of an unbroken search:
/// {"task": all that the result depends on, with a hash of each input file, "search": Search::save()}.
class SearchState {
 public:
  explicit SearchState(const PlanTask& task)
      : task_{{"version", FLEXCOMP_VERSION},
              {"robot", fingerprint(task.robot.path)},
              {"cell", fingerprint(task.cell ? task.cell->path : "")},
              {"candidates", fingerprint(task.candidates_file)},
              {"extend", fingerprint(task.measured_file)},
              {"poses", task.settings.poses},
              {"method", name_in(planning_methods, task.method)},
              {"measure", name_in(measurement_kinds, task.measure)},
              {"model", name_in(model_kinds, task.settings.model)},
              {"frames", task.settings.fit_frames ? "fit" : "nominal"},
              {"payloads", task.settings.payloads_kg},
              {"effort", task.settings.effort},
              {"seed", task.settings.seed}} {}

  void save(const std::string& path, const Search& search) const {
    write_file(path, Json{{"task", task_}, {"search", search.save()}}.dump() + "\n");
  }

  /// \throws InputError  no state of this very task (search_state)
  void load(const std::string& path, Search& search) const {
    const auto no_state = [&path](const std::exception& e) {
      return InputError(path, 0, "", "a state of a search", e.what(), ErrorCode::search_state);
    };
    try {
      const auto found = Json::parse(read_file(path));
      for (const auto& [key, value] : task_.items()) {
        const Json& there = found.at("task").at(key);
        if (there != value)
          throw InputError(path, 0, key, "the state of this very task: " + value.dump(), there.dump());
      }
      search.load(found.at("search"));
    } catch (const InputError&) {
      throw;
    } catch (const Json::exception& e) {
      throw no_state(e);
    } catch (const std::runtime_error& e) {
      throw no_state(e);
    }
  }

 private:
  Json task_;
};

constexpr std::size_t random_sets = 100;
constexpr auto state_every = std::chrono::seconds(2);

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

CriterionValue value_of(const Criterion& criterion, const Figures& figures) {
  return {criterion.fitness(figures), criterion.o1(figures), figures.trace};
}

PlanResult plan_result(const PlanTask& task, const Search& search) {
  const PlanProblem& problem = task.problem;
  PlanResult out;
  out.set = in_order_of_travel(problem, rounded(problem, search.best()), task.robot.max_speed_rad_s);
  const Criterion criterion = problem.criterion();
  const ExactFigures exact = figures_of(problem, out.set);
  out.value = value_of(criterion, exact.figures);
  out.random = random_fitness(problem, random_sets, task.settings.seed);
  out.evaluations = search.evaluations();
  out.history = search.history();
  const PoseInformation& information = *problem.information;
  for (std::size_t p = 0; p < information.names().size(); ++p) {
    const double units = exact.sigma[static_cast<Eigen::Index>(p)];
    out.sigmas.push_back({information.names()[p], units * information.file_units()[p], units});
  }
  if (!problem.measured.empty()) {
    const ExactFigures alone = exact_figures(problem.measured, information.nuisance());
    Criterion of_known = criterion;
    of_known.poses = static_cast<double>(problem.measured.size());
    if (alone.full_rank) out.before = value_of(of_known, alone.figures);
  }
  out.at_payload.resize(problem.payloads.size());
  for (const PlannedPose& p : out.set) ++out.at_payload[p.payload];
  return out;
}

}  // namespace

bool run_search(Search& search, const StopSearch& stop, const std::function<void()>& after_step) {
  while (!search.done()) {
    // Without a set there is nothing to write: the first step is always finished.
    if (stop() && !search.best().empty()) return false;
    search.step();
    after_step();
  }
  return true;
}

std::vector<MethodResult> compare_methods(const PlanTask& task, const PlanResult& result,
                                          const StopSearch& stop, const WatchSearch& watch) {
  const PlanProblem& problem = task.problem;
  const PlanSettings& settings = task.settings;
  std::vector<MethodResult> list{{"random (median)", result.random_median(), 0, 0}};
  for (const Method m : {Method::detmax, Method::sapso, Method::exchange, Method::refine}) {
    if (moves_joints(m) && !problem.candidates.empty()) continue;
    if (stop()) break;
    const std::string& name = name_in(planning_methods, m);
    const double start = cpu_seconds();
    std::unique_ptr<Search> search = make_search(m, problem, settings.effort, settings.seed);
    if (m == Method::exchange) {
      ExchangeOptions options;
      options.restarts = static_cast<std::uint64_t>(std::max(1.0, std::round(200 * settings.effort)));
      options.seed = settings.seed;
      search = std::make_unique<ExchangeSearch>(problem, options);
    }
    run_search(*search, stop, [&] { watch(name, *search); });
    list.push_back({name, problem.criterion().fitness(figures_of(problem, search->best()).figures),
                    cpu_seconds() - start, search->evaluations()});
  }
  return list;
}

PlanResult find_plan(const PlanTask& task, const StateFiles& files, const StopSearch& stop,
                     const std::function<void(const Search&)>& watch) {
  const double start = cpu_seconds();
  const auto search = make_search(task.method, task.problem, task.settings.effort, task.settings.seed);
  const SearchState states(task);
  if (!files.resume.empty()) states.load(files.resume, *search);
  const std::string& file = files.state.empty() ? files.resume : files.state;
  const auto save = [&] {
    if (!file.empty()) states.save(file, *search);
  };
  const std::uint64_t resumed_at = search->evaluations();
  auto next_save = std::chrono::steady_clock::now() + state_every;
  const bool done = run_search(*search, stop, [&] {
    watch(*search);
    if (std::chrono::steady_clock::now() < next_save) return;
    save();
    next_save = std::chrono::steady_clock::now() + state_every;
  });
  save();
  const double seconds = cpu_seconds() - start;
  PlanResult result = plan_result(task, *search);
  result.resumed_at = resumed_at;
  result.stopped = !done;
  result.cpu_seconds = seconds;
  return result;
}

MeasuredData plan_rows(const PlanTask& task, const PlanResult& result) {
  MeasuredData plan;
  plan.columns.payload_mass = task.payload_column;
  for (const PlannedPose& p : result.set) {
    Measurement row;
    row.q_rad = p.q_rad;
    row.context = task.problem.payloads[p.payload];
    plan.rows.push_back(row);
  }
  return plan;
}

}  // namespace flexcomp::host
