// SPDX-License-Identifier: Apache-2.0
#include "bus/controller_client.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <map>
#include <thread>

#include "flexcomp/image.hpp"
#include "flexcomp/wire/robot_record.hpp"
#include "flexcomp/wire/unit_record.hpp"

namespace flexcomp::host {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr milliseconds polling_interval{10};

/// Limit of the length that a controller may announce, bytes.
constexpr std::size_t longest_image = std::size_t{1} << 24U;

bool is(const wire::Status& status, wire::StoreState state) {
  return status.state == static_cast<std::uint16_t>(state);
}

/// Whether a verify has passed.
bool is_verified(const wire::Status& now) {
  // An answer that is another client's is noticed at the commit, which verifies anew where it has to.
  return is(now, wire::StoreState::verified) ||
         (now.answer == static_cast<std::uint16_t>(wire::Answer::accepted) && now.refusal == 0);
}

/// Whether the store still has what the command is about, so that a command that is under way would take effect.
bool may_still_come(wire::Command command, const wire::Status& now) {
  switch (command) {
    case wire::Command::confirm:
      return is(now, wire::StoreState::trial);
    case wire::Command::restore_defaults:
      return now.active_slot != wire::no_slot || now.previous_sequence != 0;
    case wire::Command::rollback:
      return now.previous_sequence != 0 || is(now, wire::StoreState::trial);
    default:
      return is(now, wire::StoreState::receiving) || is(now, wire::StoreState::verified);
  }
}

std::string set_text(const wire::Status& now) {
  return now.active_slot == wire::no_slot ? "no set is active"
                                          : fmt::format("set {} runs", now.active_sequence);
}

}  // namespace

std::string describe(wire::Command command) {
  static const std::map<wire::Command, const char*> words{
      {wire::Command::begin, "announce a set"},
      {wire::Command::verify, "verify the set"},
      {wire::Command::commit, "commit the set"},
      {wire::Command::commit_trial, "commit the set on trial"},
      {wire::Command::confirm, "confirm the set on trial"},
      {wire::Command::rollback, "roll back"},
      {wire::Command::abort, "drop what is staged"},
      {wire::Command::restore_defaults, "erase both sets"},
      {wire::Command::unlock, "unlock what destroys sets"}};
  const auto known = words.find(command);
  return known == words.end() ? "nothing" : known->second;
}

std::string describe(wire::Answer answer, Refusal refusal, std::uint32_t detail) {
  if (answer == wire::Answer::not_authorised && detail == wire::needs_signature)
    return fmt::format("{}: it takes only signed commands", wire::text(answer));
  if (answer == wire::Answer::not_authorised && detail == wire::needs_unlock)
    return fmt::format("{}: an unlock has to come before", wire::text(answer));
  if (answer != wire::Answer::refused) return wire::text(answer);
  std::string why = text(refusal);
  switch (refusal) {
    case Refusal::unknown_basis:
      return fmt::format("{} (basis {})", why, detail);
    case Refusal::too_long:
      return fmt::format("{} (of {} bytes)", why, detail);
    case Refusal::stale_sequence:
    case Refusal::sequence_too_far:
      return fmt::format("{} ({})", why, detail);
    case Refusal::too_large:
    case Refusal::too_steep:
    case Refusal::too_compliant:
    case Refusal::not_allowed_covariate:
      return fmt::format("{} (number {} of those that are not constant)", why, detail + 1);
    case Refusal::too_costly:
      return fmt::format("{} ({})", why, detail);
    case Refusal::implausible:
      return fmt::format("{} (by {:.3f} mm or mrad)", why, detail / 1000.0);
    default:
      return why;
  }
}

ControllerClient::ControllerClient(const BusAddress& address, const ClientOptions& options)
    : options_(options), where_(address.text()) {}

void ControllerClient::read_capability() {
  Bytes bytes;
  retry_while_busy("read its capabilities",
                   [&] { bytes = read_record(Record::capability, wire::capability_bytes); });
  wire::decode(bytes.data(), byte_order(), capability_);
  constexpr unsigned major = wire::protocol_version >> 8U;
  if (capability_.protocol >> 8U != major || capability_.joints != wire::joints) {
    throw BusError(
        where_,
        fmt::format(
            "what answers is no flexcomp controller that this program knows: it says protocol {}.{} and {} "
            "joints, expected protocol {}.x and {} joints",
            capability_.protocol >> 8U, capability_.protocol & 0xFFU, capability_.joints, major,
            wire::joints));
  }
}

wire::Status ControllerClient::status() {
  Bytes bytes;
  retry_while_busy("read its status", [&] { bytes = read_record(Record::status, wire::status_bytes); });
  wire::Status out;
  wire::decode(bytes.data(), byte_order(), out);
  return out;
}

std::optional<Robot> ControllerClient::robot() {
  Bytes bytes;
  try {
    bytes = read_record(Record::robot, wire::robot_record_bytes);
  } catch (const BusRefusal& refusal) {
    if (refusal.no_such_object) return std::nullopt;
    throw_refusal("read which robot it is for", refusal, milliseconds(0));
  }
  Robot out;
  std::array<char, wire::robot_name_bytes> name{};
  const std::size_t size = wire::decode(bytes.data(), byte_order(), out.nominal, name.data());
  out.path = fmt::format("the controller at {}", where_);
  out.name.assign(name.data(), size);
  out.nominal.name_hash = capability_.name_hash;
  // The hash says nothing of limits, tool and payload.
  wire::detail::visit_robot(out.nominal, [this](double v) {
    if (!std::isfinite(v))
      throw BusError(where_, "the robot that the controller tells has a number that is not finite");
  });
  if (nominal_hash(out.nominal) != capability_.nominal_hash ||
      (size != 0 && name_hash(name.data(), size) != capability_.name_hash)) {
    throw BusError(
        where_,
        fmt::format("the robot that the controller tells ('{}') does not have the hashes that it tells",
                    out.name));
  }
  if (const std::optional<ControllerUnit> told = unit()) {
    out.serial = told->serial;
    out.nominal.unit_hash = told->hash;
  }
  return out;
}

std::optional<ControllerUnit> ControllerClient::unit() {
  if ((capability_.flags & wire::capability_flag::unit) == 0) return std::nullopt;
  Bytes bytes;
  retry_while_busy("read which unit it is",
                   [&] { bytes = read_record(Record::unit, wire::unit_record_bytes); });
  wire::UnitRecord record;
  wire::decode(bytes.data(), byte_order(), record);
  ControllerUnit out;
  out.hash = record.unit_hash;
  out.counter = record.counter;
  out.keys = record.keys;
  out.key_ids.assign(record.key_ids.begin(),
                     record.key_ids.begin() + std::min<std::ptrdiff_t>(record.keys, wire::listed_keys));
  if (record.serial_size == 0) return out;
  out.serial.assign(record.serial.begin(), record.serial.begin() + record.serial_size);
  if (!is_serial(out.serial) || name_hash(out.serial.data(), out.serial.size()) != out.hash) {
    // Not repeated: it may be what makes a terminal do something.
    throw BusError(where_,
                   "the serial number that the controller tells does not have the hash that it tells");
  }
  return out;
}

void ControllerClient::stage(std::span<const std::uint8_t> image, const Progress& progress) {
  retry_while_busy(
      "take in a set", [&] { send_image(image, progress); },
      std::max(options_.staging_timeout, options_.response_timeout));
}

void ControllerClient::run(wire::Command command, std::uint32_t argument) {
  const std::string what = describe(command);
  const bool background = command == wire::Command::verify;
  const auto start = steady_clock::now();
  const auto end = start + options_.write_timeout;
  const auto send = [&] { retry_while_busy(what, [&] { send_command(command, argument); }); };
  bool answered = false;
  while (!answered) {
    try {
      send();
      answered = true;
    } catch (const NoAnswer&) {
      // Each of these commands may be given twice.
      if (steady_clock::now() - start > options_.response_timeout) throw;
      if (!background) continue;
      const wire::Status now = status();
      answered = is(now, wire::StoreState::working) || is(now, wire::StoreState::verified) ||
                 now.answer == static_cast<std::uint16_t>(wire::Answer::refused);
    }
  }
  if (!background) return;
  for (;;) {
    const wire::Status now = status();
    if (!is(now, wire::StoreState::working)) {
      if (is_verified(now)) return;
      const auto answer = static_cast<wire::Answer>(now.answer);
      const auto refusal = static_cast<Refusal>(now.refusal);
      throw RefusedByController(
          where_,
          fmt::format("asked to {}, the controller failed: {}", what, describe(answer, refusal, now.detail)),
          answer, refusal);
    }
    if (steady_clock::now() > end) {
      throw NoAnswer(where_, fmt::format("asked to {}, the controller is still working after {:.1f} s", what,
                                         in_seconds(options_.write_timeout)));
    }
    std::this_thread::sleep_for(polling_interval);
  }
}

/// How long a controller is asked what became of a command.
class ControllerClient::Patience {
 public:
  explicit Patience(const ClientOptions& options)
      : silence_(3 * options.response_timeout),
        silent_until_(steady_clock::now() + silence_),
        working_until_(steady_clock::now() + options.write_timeout) {}
  void heard() {
    silent_until_ = steady_clock::now() + silence_;
    pause_ = polling_interval;
  }
  bool is_over() const { return steady_clock::now() > silent_until_; }
  bool has_worked_too_long() const { return steady_clock::now() > working_until_; }
  void wait() {
    std::this_thread::sleep_for(pause_);
    pause_ = std::min(2 * pause_, milliseconds(300));
  }
  milliseconds silence() const { return silence_; }

 private:
  milliseconds silence_;
  steady_clock::time_point silent_until_;
  steady_clock::time_point working_until_;
  milliseconds pause_ = polling_interval;
};

/// The status of a store that is not working; nothing where it has to be asked for again.
std::optional<wire::Status> ControllerClient::status_or_wait(Patience& patience,
                                                             const std::string& question) {
  try {
    const wire::Status now = status();
    patience.heard();
    if (!is(now, wire::StoreState::working)) return now;
    if (patience.has_worked_too_long()) {
      throw OutcomeOpen(where_, fmt::format("{}: the controller is still writing its memory after {:.1f} s",
                                            question, in_seconds(options_.write_timeout)));
    }
  } catch (const BusError& e) {
    if (patience.is_over()) {
      throw OutcomeOpen(where_, fmt::format("{}: its status could not be read for {:.1f} s ({})", question,
                                            in_seconds(patience.silence()), e.text()));
    }
  }
  patience.wait();
  return std::nullopt;
}

wire::Status ControllerClient::settled_status(const std::string& question) {
  Patience patience(options_);
  for (;;) {
    if (const auto now = status_or_wait(patience, question)) return *now;
  }
}

wire::Status ControllerClient::conclude(wire::Command command, std::uint32_t argument,
                                        const Reached& reached) {
  const std::string what = describe(command);
  std::string first_error;  // of the bus, after the command may have gone out
  std::optional<RefusedByController> refusal;
  bool answered = false;
  const auto give = [&] {
    try {
      retry_while_busy(what, [&] { send_command(command, argument); });
      answered = true;
    } catch (const RefusedByController& e) {
      if (!refusal) refusal = e;
    } catch (const BusError& e) {
      if (first_error.empty()) first_error = e.text();
    }
  };
  const unsigned connection_before = connection();
  const auto start = steady_clock::now();
  give();
  Patience patience(options_);
  bool dropped = false;
  for (;;) {
    std::string question = fmt::format("the controller was asked to {}", what);
    if (!first_error.empty()) question += fmt::format(", then: {}", first_error);
    const std::optional<wire::Status> now = status_or_wait(patience, question);
    if (!now) continue;
    if (reached(*now)) return *now;
    // Neither done nor being done. A command that is lost is given again, and one that may be late must find nothing
    // before the controller is said not to have executed it.
    const bool could = may_still_come(command, *now);
    const bool same_connection = connection() == connection_before;
    const bool is_rollback = command == wire::Command::rollback;
    const bool in_time = steady_clock::now() - start < patience.silence();
    if (could && !refusal && in_time && !(is_rollback && answered)) {
      // Two rollbacks are not one, and what is staged belongs to its connection.
      const bool may_repeat = !is_rollback && (same_connection || command == wire::Command::confirm);
      patience.wait();
      if (may_repeat) give();
      continue;
    }
    const bool staged = is(*now, wire::StoreState::receiving) || is(*now, wire::StoreState::verified);
    if (could && staged && same_connection && !dropped) {
      dropped = true;
      try {
        run(wire::Command::abort);
      } catch (const BusError&) {
        // The next status says whether it is still there.
      }
      continue;
    }
    if (could && !refusal && !(is_rollback && same_connection)) {
      throw OutcomeOpen(where_, fmt::format("{}; it has not, but still may: {}", question, set_text(*now)));
    }
    if (refusal) throw RefusedByController(*refusal);
    const auto answer = static_cast<wire::Answer>(now->answer);
    const auto reason = static_cast<Refusal>(now->refusal);
    std::string why = "nothing has changed: it was started anew, or another client came between";
    if (answer != wire::Answer::accepted && answer != wire::Answer::busy) {
      why = describe(answer, reason, now->detail);
    } else if (!first_error.empty()) {
      why = fmt::format("the command never got there: {}", first_error);
    }
    throw RefusedByController(where_, fmt::format("asked to {}, the controller failed: {}", what, why),
                              answer, reason);
  }
}

Bytes ControllerClient::active_image(const Progress& progress) {
  // The set may change between two requests: the bytes are valid only if the same set was active before and after.
  for (int attempt = 0; attempt < 3; ++attempt) {
    const wire::Status before = status();
    if (before.active_slot == wire::no_slot) return {};
    if (before.active_bytes > longest_image) {
      throw BusError(where_,
                     fmt::format("the controller tells of an active set of {} bytes", before.active_bytes));
    }
    Bytes image;
    try {
      retry_while_busy("read the active set", [&] { image = read_image(before.active_bytes, progress); });
    } catch (const RefusedByController&) {
      if (status().active_sequence == before.active_sequence) throw;
      continue;
    }
    const wire::Status after = status();
    if (after.active_sequence == before.active_sequence && after.active_crc == before.active_crc &&
        after.active_slot == before.active_slot) {
      return image;
    }
  }
  throw BusError(where_, "the active set changed each of the three times that it was read");
}

namespace {

/// The flag that a status stands for; for one that this version does not know, one that it does not know either.
std::uint16_t flags_of(std::uint16_t status) {
  switch (static_cast<StepStatus>(status)) {
    case StepStatus::ok:
      return 0;
    case StepStatus::near_singular:
      return step_flag::near_singular;
    case StepStatus::limited:
      return step_flag::limited;
    case StepStatus::at_limit:
      return step_flag::at_limit;
    case StepStatus::no_set:
      return step_flag::no_set;
    case StepStatus::refused:
      return step_flag::refused;
  }
  return 1U << step_flag::count;
}

}  // namespace

wire::ProbeResponse ControllerClient::probe(const wire::ProbeRequest& request) {
  std::array<std::uint8_t, wire::probe_request_bytes> question{};
  wire::encode(request, byte_order(), question.data());
  Bytes bytes;
  const bool with_flags = (capability_.flags & wire::capability_flag::probe_flags) != 0;
  retry_while_busy("answer a probe", [&] { bytes = exchange_probe(question, with_flags); });
  wire::ProbeResponse out;
  wire::decode(bytes.data(), byte_order(), out);
  if (with_flags) {
    wire::detail::Reader(bytes.data() + wire::probe_response_bytes, byte_order())(out.flags);
  } else {
    out.flags = flags_of(out.status);
  }
  return out;
}

/// Repeats a request until the controller is no longer busy with another client's transfer or a switch of sets.
template <class Action>
void ControllerClient::retry_while_busy(const std::string& request, const Action& action,
                                        std::optional<milliseconds> longest) {
  const milliseconds limit = longest.value_or(options_.response_timeout);
  const auto end = steady_clock::now() + limit;
  for (;;) {
    try {
      action();
      return;
    } catch (const BusRefusal& refusal) {
      if (!refusal.busy || steady_clock::now() > end) throw_refusal(request, refusal, limit);
    }
    std::this_thread::sleep_for(2 * polling_interval);
  }
}

void ControllerClient::throw_refusal(const std::string& request, const BusRefusal& from_bus,
                                     milliseconds waited) {
  // A bus has one code for many reasons; the status record has the reason.
  wire::Status now;
  try {
    const Bytes bytes = read_record(Record::status, wire::status_bytes);
    wire::decode(bytes.data(), byte_order(), now);
  } catch (...) {
    now.answer = 0xFFFF;
  }
  const auto answer = static_cast<wire::Answer>(now.answer);
  const auto refusal = static_cast<Refusal>(now.refusal);
  // An answer that is no refusal belongs to another client's command.
  const bool has_reason =
      now.answer != 0xFFFF && answer != wire::Answer::accepted && answer != wire::Answer::busy;
  if (from_bus.busy) {
    throw RefusedByController(
        where_,
        fmt::format("asked to {}, the controller was busy for {:.1f} s ({}): another client is at work",
                    request, in_seconds(waited), from_bus.code),
        wire::Answer::busy, Refusal::none);
  }
  throw RefusedByController(
      where_,
      fmt::format("asked to {}, the controller refused: {}", request,
                  has_reason ? fmt::format("{} ({})", describe(answer, refusal, now.detail), from_bus.code)
                             : from_bus.code),
      has_reason ? answer : wire::Answer::refused, has_reason ? refusal : Refusal::none);
}

std::unique_ptr<ControllerClient> connect(const BusAddress& address, const ClientOptions& options) {
  if (std::holds_alternative<CanAddress>(address.at)) return connect_canopen(address, options);
  return connect_modbus(address, options);
}

}  // namespace flexcomp::host
