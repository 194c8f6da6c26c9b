// SPDX-License-Identifier: Apache-2.0
#include "commands/outcome.hpp"

#include <fmt/format.h>

#include <string>

namespace flexcomp::host {
namespace {

/// What runs instead, where the controller can still be asked.
std::string what_runs(OutcomeTask& task) {
  if (!task.client) return {};
  try {
    const wire::Status now = task.client->status();
    const bool none = now.active_slot == wire::no_slot;
    task.result["sequence"] = now.active_sequence;
    task.result["crc"] = fmt::format("{:08x}", now.active_crc);
    return none ? "; no set is active" : fmt::format("; set {} runs", now.active_sequence);
  } catch (const BusError&) {
    return {};
  }
}

void end(const BusOptions& bus, OutcomeTask& task, const char* word, const std::string& why) {
  task.result["outcome"] = word;
  task.result["why"] = why;
  bus.write_json(task.result);
}

}  // namespace

OutcomeTask::OutcomeTask(const BusOptions& bus, bool is_undecided)
    : result{{"bus", bus.bus.text()}}, undecided(is_undecided) {}

void run_to_outcome(const BusOptions& bus, const std::function<void(OutcomeTask&)>& work, bool undecided) {
  OutcomeTask task(bus, undecided);
  const auto refuse = [&](const BusError& e, bool silent) {
    const std::string why = e.text() + (silent ? "" : what_runs(task));
    end(bus, task, "refused", why);
    return "refused: " + why;
  };
  const auto leave_open = [&](const std::string& why) {
    end(bus, task, "open", why);
    throw OutcomeOpen(bus.bus.text(), why);
  };
  try {
    work(task);
  } catch (const OutcomeOpen& e) {
    leave_open(e.text());
  } catch (const NoAnswer& e) {
    if (task.undecided) leave_open(e.text());
    throw NoAnswer(e.address(), refuse(e, true));
  } catch (const BusError& e) {
    if (task.undecided && !task.client) leave_open(e.text());
    const bool not_opened = e.code() == ErrorCode::no_can_sockets || e.code() == ErrorCode::bus_not_opened;
    throw BusError(e.address(), refuse(e, not_opened), e.code());
  }
  task.result["outcome"] = "active";
  bus.write_json(task.result);
}

}  // namespace flexcomp::host
