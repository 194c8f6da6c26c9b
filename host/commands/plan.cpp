// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <ctime>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "commands/commands.hpp"
#include "commands/common_options.hpp"
#include "commands/numbers.hpp"
#include "commands/outputs.hpp"
#include "commands/progress_bar.hpp"
#include "files/cell_file.hpp"
#include "files/data_file.hpp"
#include "files/robot_file.hpp"
#include "files/write_file.hpp"
#include "flexcomp/sha256.hpp"
#include "input_error.hpp"
#include "measurement/reflectors.hpp"
#include "model/calibration.hpp"
#include "planning/exchange.hpp"
#include "planning/feasibility.hpp"
#include "planning/planner.hpp"
#include "report/page.hpp"
#include "units.hpp"

namespace flexcomp::host {
namespace {

const std::map<std::string, Method> methods{{"refine", Method::refine},
                                            {"exchange", Method::exchange},
                                            {"detmax", Method::detmax},
                                            {"sapso", Method::sapso}};

constexpr std::size_t random_sets = 100;
constexpr std::size_t sampled_poses = 10000;
constexpr std::size_t most_candidates = 100000;
constexpr auto state_every = std::chrono::seconds(2);

std::atomic<bool> stop_asked{false};
static_assert(std::atomic<bool>::is_always_lock_free, "it is written in a signal handler");

/// The first Ctrl-C stops the search with the best plan so far, the second one the program.
class StopOnSignal {
 public:
  StopOnSignal() {
    stop_asked = false;
    struct sigaction action {};
    action.sa_handler = [](int) { stop_asked = true; };
    action.sa_flags = static_cast<int>(SA_RESETHAND);
    ::sigaction(SIGINT, &action, &before_interrupt_);
    ::sigaction(SIGTERM, &action, &before_terminate_);
  }
  ~StopOnSignal() {
    ::sigaction(SIGINT, &before_interrupt_, nullptr);
    ::sigaction(SIGTERM, &before_terminate_, nullptr);
  }
  StopOnSignal(const StopOnSignal&) = delete;
  StopOnSignal& operator=(const StopOnSignal&) = delete;

 private:
  struct sigaction before_interrupt_ {};
  struct sigaction before_terminate_ {};
};

std::string text_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

/// Short fingerprint of a file's content; empty for no file.
std::string fingerprint(const std::string& path) {
  if (path.empty()) return "";
  const std::string text = text_of(path);
  Sha256 sha;
  for (const char c : text) sha.update(static_cast<std::uint8_t>(c));
  std::string hex;
  for (const std::uint8_t byte : sha.finish()) hex += fmt::format("{:02x}", byte);
  return hex.substr(0, 16);
}

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

struct Comparison {
  std::string method;
  double criterion = 0;
  double seconds = 0;
  std::uint64_t evaluations = 0;
};

struct Sigma {
  std::string name;
  double value = 0;  ///< in the unit of files
  double units = 0;  ///< in scaled units
};

struct Plan {
  CommonOptions common;
  std::string robot;
  std::string cell;
  unsigned poses = 0;
  std::string candidates;
  std::string method;
  std::string extend;
  std::vector<double> payloads;
  std::string measure;
  std::string model = "full";
  std::string frames = "nominal";
  std::string state;
  std::string resume;
  double effort = 1;
  bool compare = false;
  bool force = false;
  std::string report;
  std::string out;

  void run();

 private:
  Instrument instrument(MeasurementKind kind, std::size_t reflectors, double position_sigma,
                        double orientation_sigma, const Points& shape) const;
  void take_data(const Robot& robot_file, const std::optional<MeasuredData>& data);
  void take_candidates(const Robot& robot_file, const Feasibility& feasibility);
  void check_number(const Robot& robot_file);
  void search(Search& search, std::uint64_t& evaluations_before);
  nlohmann::ordered_json task() const;
  void load_state(Search& search) const;
  std::vector<Comparison> comparison(const std::vector<double>& random) const;
  Page page(const Robot& robot_file, const PoseSet& set, const std::vector<Sigma>& sigmas,
            const Search& search, double fitness, double random) const;

  PlanProblem problem_;
  std::optional<Cell> cell_;
  std::vector<PlannedMeasurement> known_;
  std::vector<std::string> warnings_;
  bool payload_column_ = false;
  bool stopped_ = false;
  std::map<Obstruction, std::size_t> refusals_;
  std::size_t allowed_ = 0;
};

Instrument Plan::instrument(MeasurementKind kind, std::size_t reflectors, double position_sigma,
                            double orientation_sigma, const Points& shape) const {
  if (kind == MeasurementKind::position) return Instrument::position(position_sigma);
  if (kind == MeasurementKind::pose) return Instrument::pose(position_sigma, orientation_sigma);
  const Points points(shape.begin(), shape.begin() + static_cast<std::ptrdiff_t>(reflectors));
  if (on_one_line(points)) {
    throw InputError(robot, 0, "tool.reflectors_mm", "three reflectors that are not on one line",
                     "A, B, C on one line");
  }
  return Instrument::reflectors(points, position_sigma);
}

/// What has been measured, with the contexts and the noise it was measured with; and how the rest will be.
void Plan::take_data(const Robot& robot_file, const std::optional<MeasuredData>& data) {
  MeasurementKind kind = measure.empty() ? MeasurementKind::pose : measurement_kinds.at(measure);
  if (measure.empty() && data && data->kind != MeasurementKind::joints) kind = data->kind;
  Points shape = robot_file.reflectors_m;
  if (shape.empty() && data && data->kind == MeasurementKind::reflectors) {
    std::vector<Points> seen;
    for (const Measurement& row : data->rows) {
      seen.emplace_back(row.reflector_m.begin(),
                        row.reflector_m.begin() + static_cast<std::ptrdiff_t>(data->reflectors));
    }
    shape = estimate_template(seen);
  }
  if (kind == MeasurementKind::reflectors && shape.empty()) {
    throw InputError(robot, 0, "tool.reflectors_mm", "reflectors a, b, c (, d) for --measure reflectors",
                     "nothing");
  }
  problem_.instrument =
      instrument(kind, shape.size(), robot_file.position_sigma_m, robot_file.orientation_sigma_rad, shape);
  for (const auto& [name, k] : measurement_kinds) {
    if (k == kind) measure = name;
  }
  if (!data) return;
  for (const Measurement& row : data->rows) {
    if (data->kind == MeasurementKind::joints) {
      known_.push_back({row.q_rad, row.context, problem_.instrument});
      continue;
    }
    if (data->kind == MeasurementKind::reflectors && shape.size() < data->reflectors) {
      throw InputError(robot, 0, "tool.reflectors_mm.d", fmt::format("reflector D, which {} has", extend),
                       "nothing");
    }
    known_.push_back(
        {row.q_rad, row.context,
         instrument(data->kind, data->reflectors, row.position_sigma_m, row.orientation_sigma_rad, shape)});
  }
}

void Plan::take_candidates(const Robot& robot_file, const Feasibility& feasibility) {
  const MeasuredData file = load_joints(candidates, robot_file, {force});
  warnings_.insert(warnings_.end(), file.warnings.begin(), file.warnings.end());
  if (file.rows.size() > most_candidates) {
    throw InputError(candidates, 0, "", fmt::format("at most {} candidates", most_candidates),
                     fmt::format("{}", file.rows.size()));
  }
  payload_column_ = payload_column_ || file.columns.payload_mass;
  std::vector<PoseContext> contexts;
  std::string left_out;
  std::size_t left_out_count = 0;
  for (const Measurement& row : file.rows) {
    if (!feasibility.allows(row.q_rad)) {
      if (++left_out_count <= 5) {
        left_out += fmt::format("\n  line {}: {}", row.line, feasibility.why(row.q_rad));
      }
      continue;
    }
    if (!file.columns.payload_mass) {
      for (std::size_t p = 0; p < problem_.payloads.size(); ++p) {
        problem_.candidates.push_back({row.q_rad, p});
      }
      continue;
    }
    // A list that says which load hangs on at each pose is taken at its word.
    std::size_t which = 0;
    while (which < contexts.size() && contexts[which].payload_kg != row.context.payload_kg) ++which;
    if (which == contexts.size()) {
      contexts.push_back(problem_.payloads.front());
      contexts.back().payload_kg = row.context.payload_kg;
    }
    problem_.candidates.push_back({row.q_rad, which});
  }
  if (file.columns.payload_mass && !contexts.empty()) problem_.payloads = contexts;
  if (left_out_count > 0) {
    warnings_.push_back(fmt::format("{}: {} of {} candidates cannot be taken and are left out:{}{}",
                                    candidates, left_out_count, file.rows.size(), left_out,
                                    left_out_count > 5 ? "\n  …" : ""));
  }
  const std::size_t rest = file.rows.size() - left_out_count;
  if (rest * (file.columns.payload_mass ? 1 : problem_.payloads.size()) < poses) {
    throw InputError(candidates, 0, "", fmt::format("{} candidates or more that can be taken", poses),
                     fmt::format("{} of {}", rest, file.rows.size()));
  }
}

/// Too few poses give numbers that mean nothing.
void Plan::check_number(const Robot& robot_file) {
  const auto least = least_poses(problem_, common.seed);
  if (!least) {
    throw InputError(candidates.empty() ? robot : candidates, 0, "",
                     fmt::format("poses that make {} parameters of {} known",
                                 problem_.information->parameters(), robot_file.name),
                     "all of them together do not");
  }
  if (poses < *least) {
    throw CLI::ValidationError(
        "--poses",
        fmt::format("{} {} of kind '{}' cannot know {} parameters{} of {}; the least number is {}", poses,
                    poses == 1 ? "pose" : "poses", measure, problem_.information->parameters(),
                    problem_.information->nuisance() > 0
                        ? fmt::format(" and {} frame parameters", problem_.information->nuisance())
                        : "",
                    robot_file.name, *least));
  }
  const std::size_t numbers = (poses + known_.size()) * static_cast<std::size_t>(problem_.instrument.rows());
  if (numbers <= static_cast<std::size_t>(problem_.information->unknowns())) {
    warnings_.push_back(
        fmt::format("{} measured numbers for {} unknowns: nothing will be left to check the result against",
                    numbers, problem_.information->unknowns()));
  }
}

/// All that a plan depends on: a state of another task must not be gone on with.
nlohmann::ordered_json Plan::task() const {
  return {{"version", FLEXCOMP_VERSION},
          {"robot", fingerprint(robot)},
          {"cell", fingerprint(cell)},
          {"candidates", fingerprint(candidates)},
          {"extend", fingerprint(extend)},
          {"poses", poses},
          {"method", method},
          {"measure", measure},
          {"model", model},
          {"frames", frames},
          {"payloads", payloads},
          {"effort", effort},
          {"seed", common.seed}};
}

void Plan::load_state(Search& search) const {
  nlohmann::ordered_json found;
  try {
    std::ifstream in(resume);
    if (!in) throw InputError(resume, 0, "", "a file that can be read", "none");
    found = nlohmann::ordered_json::parse(in);
    const nlohmann::ordered_json expected = task();
    for (const auto& [key, value] : expected.items()) {
      if (found.at("task").at(key) != value) {
        throw InputError(resume, 0, key, "the state of this very task: " + value.dump(),
                         found.at("task").at(key).dump());
      }
    }
    search.load(nlohmann::json(found.at("search")));
  } catch (const nlohmann::json::exception& e) {
    throw InputError(resume, 0, "", "a state that `plan --state` wrote", e.what());
  } catch (const InputError&) {
    throw;
  } catch (const std::runtime_error& e) {
    throw InputError(resume, 0, "", "a state that `plan --state` wrote", e.what());
  }
}

void Plan::search(Search& search, std::uint64_t& evaluations_before) {
  const std::string file = !state.empty() ? state : resume;
  if (!resume.empty()) load_state(search);
  evaluations_before = search.evaluations();
  const auto save = [&] {
    if (!file.empty()) {
      write_file(file, nlohmann::ordered_json{{"task", task()}, {"search", search.save()}}.dump() + "\n");
    }
  };
  ProgressBar bar("planning", common.quiet);
  auto next_save = std::chrono::steady_clock::now() + state_every;
  const StopOnSignal signals;
  while (!search.done()) {
    // Without a set there is nothing to write: the first step is always finished.
    if (stop_asked && !search.best().empty()) {
      stopped_ = true;
      break;
    }
    search.step();
    bar.show(static_cast<std::size_t>(1000 * std::min(search.progress(), 1.0)), 1000,
             fmt::format("criterion {:.6g}", std::exp(search.best_log_fitness())));
    if (std::chrono::steady_clock::now() >= next_save) {
      save();
      next_save = std::chrono::steady_clock::now() + state_every;
    }
  }
  save();
}

/// Every method on this very task, with the work that each needs.
std::vector<Comparison> Plan::comparison(const std::vector<double>& random) const {
  std::vector<Comparison> list{{"random (median)", random[random.size() / 2], 0, 0}};
  for (const char* name : {"detmax", "sapso", "exchange", "refine"}) {
    const Method m = methods.at(name);
    if (moves_joints(m) && !problem_.candidates.empty()) continue;
    const double start = cpu_seconds();
    std::unique_ptr<Search> search = make_search(m, problem_, effort, common.seed);
    if (m == Method::exchange) {
      ExchangeOptions options;
      options.restarts = static_cast<std::uint64_t>(std::max(1.0, std::round(200 * effort)));
      options.seed = common.seed;
      search = std::make_unique<ExchangeSearch>(problem_, options);
    }
    ProgressBar bar(name, common.quiet);
    while (!search->done() && !stop_asked) {
      search->step();
      bar.show(static_cast<std::size_t>(1000 * std::min(search->progress(), 1.0)), 1000,
               fmt::format("criterion {:.6g}", std::exp(search->best_log_fitness())));
    }
    if (search->best().empty()) break;
    list.push_back({name, problem_.criterion().fitness(figures_of(problem_, search->best()).figures),
                    cpu_seconds() - start, search->evaluations()});
  }
  return list;
}

nlohmann::ordered_json figures_json(const Criterion& criterion, const Figures& figures) {
  return {{"criterion", criterion.fitness(figures)},
          {"o1", criterion.o1(figures)},
          {"omin_expected", figures.trace}};
}

void Plan::run() {
  refuse_same_file({{"--robot", robot}, {"--cell", cell}, {"--candidates", candidates}, {"--extend", extend}},
                   {{"-o", out},
                    {"--report", report},
                    {"--state", state.empty() ? resume : state},
                    {"--json", common.json}});
  refuse_same_file({{"--resume", resume}}, {{"-o", out}, {"--report", report}, {"--json", common.json}});
  const Robot robot_file = load_robot(robot);
  if (!cell.empty()) cell_ = load_cell(cell);
  if (!robot_file.has_noise) {
    warnings_.push_back(fmt::format("{}: no noise given; {:.3g} mm and {:.3g} deg are assumed", robot,
                                    robot_file.position_sigma_m * 1e3,
                                    degrees(robot_file.orientation_sigma_rad)));
  }
  const Feasibility feasibility(robot_file, cell_);
  warnings_.insert(warnings_.end(), feasibility.warnings().begin(), feasibility.warnings().end());

  problem_.poses = poses;
  problem_.limits = robot_file.nominal.limits;
  problem_.feasible = [&feasibility](const Joints& q) { return feasibility.allows(q); };
  payload_column_ = !payloads.empty();
  PoseContext context = default_context<double>(robot_file.nominal);
  if (payloads.empty()) problem_.payloads = {context};
  for (const double kg : payloads) {
    context.payload_kg = kg;
    problem_.payloads.push_back(context);
  }
  std::optional<MeasuredData> data;
  if (!extend.empty()) {
    data = load_joints(extend, robot_file, {force});
    warnings_.insert(warnings_.end(), data->warnings.begin(), data->warnings.end());
  }
  take_data(robot_file, data);
  if (!candidates.empty()) take_candidates(robot_file, feasibility);
  if (method.empty()) method = candidates.empty() ? "refine" : "exchange";
  if (!candidates.empty() && moves_joints(methods.at(method))) {
    throw CLI::ValidationError("--method", method +
                                               " moves joints freely and cannot choose among candidates; "
                                               "exchange and detmax do");
  }

  // Also where no candidate is random: what the cell leaves of the joint space, and what takes the rest.
  std::vector<Joints> sampled;
  {
    std::mt19937_64 random = random_of(common.seed, 3);
    for (std::size_t k = 0; k < sampled_poses; ++k) {
      Joints q;
      for (std::size_t j = 0; j < joint_count; ++j) {
        const JointLimits& limits = problem_.limits[j];
        q[j] = limits.min_rad + (limits.max_rad - limits.min_rad) * uniform(random);
      }
      ++refusals_[feasibility.check(q)];
    }
    allowed_ = refusals_[Obstruction::none];
    refusals_.erase(Obstruction::none);
  }
  // Says what stands in the way where nearly nothing is allowed.
  if (candidates.empty()) feasible_poses(feasibility, robot_file, 1, common.seed);

  std::vector<PlannedMeasurement> like;
  for (const PoseContext& c : problem_.payloads) like.push_back({Joints{}, c, problem_.instrument});
  like.insert(like.end(), known_.begin(), known_.end());
  problem_.information = std::make_shared<PoseInformation>(robot_file, model_kinds.at(model), frames == "fit",
                                                           like, common.seed);
  std::vector<Block> known(known_.size());
  for (std::size_t k = 0; k < known_.size(); ++k) problem_.information->block(known_[k], known[k]);
  problem_.set_measured(std::move(known));
  check_number(robot_file);
  common.warn(warnings_);

  const double start = cpu_seconds();
  const auto search = make_search(methods.at(method), problem_, effort, common.seed);
  std::uint64_t evaluations_before = 0;
  this->search(*search, evaluations_before);
  const double seconds = cpu_seconds() - start;
  const PoseSet set =
      in_order_of_travel(problem_, rounded(problem_, search->best()), robot_file.max_speed_rad_s);
  const Criterion criterion = problem_.criterion();
  const ExactFigures exact = figures_of(problem_, set);
  const std::vector<double> random = random_fitness(problem_, random_sets, common.seed);
  const double median = random[random.size() / 2];

  MeasuredData plan;
  plan.columns.payload_mass = payload_column_;
  for (const PlannedPose& p : set) {
    Measurement row;
    row.q_rad = p.q_rad;
    row.context = problem_.payloads[p.payload];
    plan.rows.push_back(row);
  }
  save_data(out, plan);

  std::vector<Sigma> sigmas;
  for (std::size_t p = 0; p < problem_.information->names().size(); ++p) {
    const double units = exact.sigma[static_cast<Eigen::Index>(p)];
    sigmas.push_back(
        {problem_.information->names()[p], units * problem_.information->file_units()[p], units});
  }
  std::vector<Sigma> worst = sigmas;
  std::sort(worst.begin(), worst.end(), [](const Sigma& a, const Sigma& b) { return a.units > b.units; });

  const double fitness = criterion.fitness(exact.figures);
  common.say(fmt::format("{}: {} poses of {} by {}{}; {} of {} parameters are identifiable{}", out,
                         set.size(), robot_file.name, method, stopped_ ? ", STOPPED before the end" : "",
                         problem_.information->parameters(), problem_.information->parameters_of_model(),
                         problem_.information->nuisance() > 0
                             ? fmt::format(", beside {} frame parameters", problem_.information->nuisance())
                             : ""));
  common.say(fmt::format(
      "  criterion {:.6g} (expected Omin {:.6g} / O1 {:.6g}); random poses: {:.6g} (median of "
      "{} sets), {:.2f} times as large",
      fitness, exact.figures.trace, criterion.o1(exact.figures), median, random.size(), median / fitness));
  std::optional<Figures> before;
  if (!problem_.measured.empty()) {
    const ExactFigures alone = exact_figures(problem_.measured, problem_.information->nuisance());
    Criterion of_known = criterion;
    of_known.poses = static_cast<double>(problem_.measured.size());
    if (alone.full_rank) {
      before = alone.figures;
      common.say(fmt::format("  {} alone ({} poses): criterion {:.6g} (expected Omin {:.6g} / O1 {:.6g})",
                             extend, problem_.measured.size(), of_known.fitness(*before), before->trace,
                             of_known.o1(*before)));
    } else {
      common.say(fmt::format("  {} alone ({} poses) does not know all of these parameters", extend,
                             problem_.measured.size()));
    }
  }
  std::vector<std::size_t> at_payload(problem_.payloads.size(), 0);
  for (const PlannedPose& p : set) ++at_payload[p.payload];
  if (payload_column_) {
    std::string text;
    for (std::size_t p = 0; p < at_payload.size(); ++p) {
      text += fmt::format("{}{} with {:g} kg", p == 0 ? "" : ", ", at_payload[p],
                          problem_.payloads[p].payload_kg);
    }
    common.say("  poses by payload: " + text);
  }
  std::string reasons;
  for (const auto& [obstruction, count] : refusals_) {
    reasons += fmt::format("; {:.1f} % {}", 100.0 * static_cast<double>(count) / sampled_poses,
                           name_of(obstruction));
  }
  common.say(fmt::format("  {:.1f} % of the poses within the joint limits are allowed{}",
                         100.0 * static_cast<double>(allowed_) / sampled_poses, reasons));
  common.say("  least certain (1 sigma to expect):");
  for (std::size_t k = 0; k < std::min<std::size_t>(5, worst.size()); ++k) {
    common.say(fmt::format("    {:<40} {:.3g}", worst[k].name, worst[k].value));
  }
  common.say(fmt::format("  {} evaluations, {:.2f} s", search->evaluations(), seconds));
  if (stopped_) {
    common.say(fmt::format("stopped: the best plan so far was written{}",
                           state.empty() && resume.empty() ? "" : "; --resume goes on from there"));
  }

  std::vector<Comparison> compared;
  if (compare && !stopped_) {
    const StopOnSignal signals;
    compared = comparison(random);
    common.say(fmt::format("  {:<18} {:>12} {:>10} {:>12} {:>10}", "method", "criterion", "/ best",
                           "evaluations", "CPU s"));
    double best = fitness;
    for (const Comparison& c : compared) best = std::min(best, c.criterion);
    for (const Comparison& c : compared) {
      common.say(fmt::format("  {:<18} {:>12.6g} {:>10.4f} {:>12} {:>10.2f}", c.method, c.criterion,
                             c.criterion / best, c.evaluations, c.seconds));
    }
  }

  nlohmann::ordered_json result{{"poses", set.size()},
                                {"robot", robot_file.name},
                                {"method", method},
                                {"model", model},
                                {"measure", measure},
                                {"frames", frames},
                                {"seed", common.seed},
                                {"parameters", problem_.information->parameters_of_model()},
                                {"identifiable", problem_.information->parameters()},
                                {"frame_parameters", problem_.information->nuisance()}};
  result.update(figures_json(criterion, exact.figures));
  result["random_criterion"] = std::isfinite(median) ? nlohmann::ordered_json(median) : nullptr;
  result["feasible_share"] = static_cast<double>(allowed_) / sampled_poses;
  nlohmann::ordered_json& refused = result["refused"] = nlohmann::ordered_json::object();
  for (const auto& [obstruction, count] : refusals_) {
    refused[name_of(obstruction)] = static_cast<double>(count) / sampled_poses;
  }
  if (!extend.empty()) {
    nlohmann::ordered_json known_json{{"poses", problem_.measured.size()}, {"known", before.has_value()}};
    if (before) {
      Criterion of_known = criterion;
      of_known.poses = static_cast<double>(problem_.measured.size());
      known_json.update(figures_json(of_known, *before));
    }
    result["before"] = known_json;
  }
  result["evaluations"] = search->evaluations();
  result["resumed_at"] = evaluations_before;
  result["seconds"] = seconds;
  result["stopped"] = stopped_;
  nlohmann::ordered_json& list = result["sigmas"] = nlohmann::ordered_json::array();
  for (const Sigma& s : sigmas) list.push_back({{"name", s.name}, {"value", s.value}});
  nlohmann::ordered_json& loads = result["payloads"] = nlohmann::ordered_json::array();
  for (std::size_t p = 0; p < at_payload.size(); ++p) {
    loads.push_back({{"payload_kg", problem_.payloads[p].payload_kg}, {"poses", at_payload[p]}});
  }
  if (!compared.empty()) {
    nlohmann::ordered_json& rows = result["compared"] = nlohmann::ordered_json::array();
    for (const Comparison& c : compared) {
      rows.push_back({{"method", c.method},
                      {"criterion", c.criterion},
                      {"evaluations", c.evaluations},
                      {"seconds", c.seconds}});
    }
  }
  result["warnings"] = warnings_;
  result["output"] = out;
  common.write_json(result);
  if (!report.empty()) {
    write_file(report, html(page(robot_file, set, sigmas, *search, fitness, median)));
    common.say(report + ": written");
  }
}

Page Plan::page(const Robot& robot_file, const PoseSet& set, const std::vector<Sigma>& sigmas,
                const Search& search, double fitness, double random) const {
  Page page;
  page.arm = robot_file;
  page.title = fmt::format("Measurement poses for {}", robot_file.name);
  page.summary =
      fmt::format("{} poses; random ones would be {:.2f} times as bad.", set.size(), random / fitness);
  if (stopped_) page.doubts.emplace_back("The search was stopped before its end.");
  page.facts = {{"method", method},
                {"criterion", fmt::format("{:.6g}", fitness)},
                {"random poses (median)", fmt::format("{:.6g}", random)},
                {"identifiable parameters", fmt::format("{} of {}", problem_.information->parameters(),
                                                        problem_.information->parameters_of_model())},
                {"measured", measure},
                {"allowed within the limits",
                 fmt::format("{:.1f} %", 100.0 * static_cast<double>(allowed_) / sampled_poses)}};
  if (!extend.empty()) page.facts.push_back({"poses measured already", fmt::format("{}", known_.size())});
  PagePlan& plan = page.plan.emplace();
  plan.cell = cell_;
  for (const auto& [evaluations, log_fitness] : search.history()) {
    plan.progress.emplace_back(static_cast<double>(evaluations), std::exp(log_fitness));
  }
  plan.evaluations = static_cast<double>(search.evaluations());
  for (const PlannedPose& p : set) {
    plan.q_rad.push_back(p.q_rad);
    if (payload_column_) plan.payload_kg.push_back(problem_.payloads[p.payload].payload_kg);
  }
  for (const PlannedMeasurement& s : known_) plan.known_q_rad.push_back(s.q_rad);
  for (std::size_t j = 0; j < joint_count; ++j) {
    plan.limits_rad[j] = {problem_.limits[j].min_rad, problem_.limits[j].max_rad};
  }
  for (const Sigma& s : sigmas) plan.expected.push_back({s.name, s.value});
  Calibration now;
  stamp(now, robot_file);
  page.made_by = fmt::format("flexcomp {}, {}", now.tool_version, now.date);
  return page;
}

}  // namespace

void add_plan(CLI::App& app) {
  auto options = std::make_shared<Plan>();
  CLI::App* command = app.add_subcommand(
      "plan",
      "Measurement poses from which the parameters can be known best, inside limits, collisions and beam");
  add_robot_option(*command, options->robot);
  command->add_option("--cell", options->cell, "Tracker, obstacles and clearances of the place")
      ->type_name("CELL.yaml");
  command->add_option("--poses", options->poses, "How many poses to plan (with --extend: how many more)")
      ->check(CLI::Range(1U, 1000U))
      ->required();
  command
      ->add_option(
          "--candidates", options->candidates,
          "Choose among these joint readings only [deg]; with a column payload_kg each has its own load")
      ->type_name("P.csv");
  command
      ->add_option("--method", options->method,
                   "refine: exchange, then all joints along the gradient (default); exchange (default with "
                   "--candidates); detmax; sapso")
      ->check(CLI::IsMember(methods));
  command
      ->add_option("--extend", options->extend,
                   "Poses that are measured already (data file or joint readings): plan the next ones")
      ->type_name("D.csv");
  command
      ->add_option("--payloads", options->payloads,
                   "Payloads to choose from at each pose [kg], at the robot file's centre of mass")
      ->delimiter(',')
      ->check(non_negative_number())
      ->type_name("KG,KG,…");
  command
      ->add_option("--measure", options->measure,
                   "What will be measured: pose, position or reflectors. Default: as in --extend, else pose")
      ->check(CLI::IsMember(measurement_kinds));
  command->add_option("--model", options->model, "What shall be identified, as for identify")
      ->check(CLI::IsMember(model_kinds))
      ->capture_default_str();
  command
      ->add_option("--frames", options->frames,
                   "nominal: the instrument measures in Fb; fit: frames will be fitted and cost information")
      ->check(CLI::IsMember({"nominal", "fit"}))
      ->capture_default_str();
  command
      ->add_option("--effort", options->effort,
                   "How long to search: 1 is about a second of work for refine; 10 is ten times that")
      ->check(number_between(0.001, 1e4))
      ->capture_default_str();
  command
      ->add_option("--state", options->state,
                   "Write the state of the search to FILE, now and then and at the end")
      ->type_name("FILE");
  command
      ->add_option("--resume", options->resume,
                   "Go on from a state of this very task, to the result that an unbroken search would have")
      ->type_name("FILE");
  command->add_flag(
      "--compare", options->compare,
      "Also run every method on this task, exchange with 200 restarts, and print them side by side "
      "(minutes)");
  command->add_option("-o,--output", options->out, "The plan: joint readings [deg] in the order of travel")
      ->type_name("PLAN.csv")
      ->required();
  command->add_option("--report", options->report, "Self-contained page of the plan")->type_name("F.html");
  add_force_option(*command, options->force);
  options->common.add_seed_to(*command);
  options->common.add_to(*command);
  command->footer(
      "Example:\n  flexcomp plan --robot tx60l.yaml --cell cell.yaml --poses 14 --payloads 0,1.108 -o "
      "plan.csv\n"
      "The criterion is expected Omin / O1 (smaller is better). Ctrl-C stops the search; the best plan so "
      "far is "
      "written.\n"
      "Then measure, add the measured columns to the file and run identify.");
  command->callback([options] { options->run(); });
}

}  // namespace flexcomp::host
