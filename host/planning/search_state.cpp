// SPDX-License-Identifier: Apache-2.0
#include "planning/search_state.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "files/read_file.hpp"
#include "files/write_file.hpp"
#include "flexcomp/sha256.hpp"
#include "input_error.hpp"
#include "json.hpp"
#include "named_values.hpp"

namespace flexcomp::host {

namespace {

/// The first 64 bits of a file's SHA-256 in hexadecimal; empty for no file.
std::string fingerprint(const std::string& path) {
  if (path.empty()) return "";
  Sha256 sha;
  for (const char c : read_file(path)) sha.update(static_cast<std::uint8_t>(c));
  std::string hex;
  for (const std::uint8_t byte : sha.finish()) hex += fmt::format("{:02x}", byte);
  return hex.substr(0, 16);
}

}  // namespace

SearchState::SearchState(const PlanTask& task)
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

void SearchState::save(const std::string& path, const Search& search) const {
  write_file(path, Json{{"task", task_}, {"search", search.save()}}.dump() + "\n");
}

void SearchState::load(const std::string& path, Search& search) const {
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

}  // namespace flexcomp::host
