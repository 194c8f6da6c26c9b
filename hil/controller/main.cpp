// SPDX-License-Identifier: Apache-2.0
// flexcomp-controller: the firmware library as a Linux process. A thread of its own runs the control cycle,
// as the timer interrupt of a controller would; the main thread serves the buses and the parameter store.
#include <signal.h>
#include <sys/signalfd.h>
#include <time.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "bus/bus_address.hpp"
#include "errors.hpp"
#include "files/robot_file.hpp"
#include "flexcomp_firmware/device.hpp"
#include "ports.hpp"
#include "signing/keys.hpp"
#include "slot_file.hpp"

namespace {

using namespace flexcomp;  // NOLINT(google-build-using-namespace)

constexpr std::string_view usage =
    "usage: flexcomp-controller --robot R.yaml --store FILE [options]\n"
    "The flexcomp firmware as a process: parameter store, control cycle and bus servers.\n"
    "\n"
    "  --robot R.yaml                             the arm, as the calibrator's robot file\n"
    "  --store FILE                               non-volatile memory; made where it does not exist\n"
    "  --can IFACE[:NODE[:CHANNEL]]               serve CANopen on a SocketCAN interface; CHANNEL opens the "
    "SDO server\n"
    "                                             1201h: own (67Fh + NODE and 6AFh + NODE), or such as "
    "684-6B4.\n"
    "                                             1010h:2 saves heartbeat and inhibit time in FILE.can\n"
    "  --modbus-tcp HOST[:PORT][:UNIT]            serve Modbus TCP; PORT 0 takes a free one\n"
    "  --modbus-idle-s 60                         close TCP connections without a request for so long, s; 0: "
    "never\n"
    "  --modbus-rtu DEVICE[:BAUD[:PARITY]][:UNIT] serve Modbus RTU on a serial device\n"
    "  --cycle-us 1000                            period of the control cycle, us\n"
    "  --trust KEY.pub                            use sets only that are signed with this key; again: each "
    "counts\n"
    "  --trial-cycles 60000                       control cycles until an unconfirmed trial reverts\n"
    "  --heartbeat-ms 1000                        CANopen heartbeat, ms, where FILE.can has none; 0: none\n"
    "  --help                                     this text\n"
    "\n"
    "Prints one line `ready ...` when it serves, ends on SIGTERM or SIGINT.\n"
    "Exit status: 0 ended by signal; 2 usage; 3 robot or store refused; 4 a bus could not be opened.\n";

class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct Options {
  std::string robot;
  std::string store;
  std::vector<std::string> keys;  ///< files
  std::optional<host::CanAddress> can;
  std::optional<host::ModbusTcpAddress> tcp;
  std::optional<host::ModbusRtuAddress> rtu;
  std::uint32_t cycle_us = 1000;
  std::uint32_t trial_cycles = 60000;
  std::uint16_t heartbeat_ms = 1000;
  std::uint32_t modbus_idle_s = 60;
};

std::uint32_t number(const std::string& option, const std::string& text, std::uint32_t least,
                     std::uint32_t most) {
  std::uint32_t v = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), v);
  if (error != std::errc() || end != text.data() + text.size() || v < least || v > most) {
    throw UsageError(option + ": expected a whole number from " + std::to_string(least) + " to " +
                     std::to_string(most) + ", found '" + text + "'");
  }
  return v;
}

/// Parses a Modbus TCP address, also with PORT 0: a free port, which the `ready` line names.
host::ModbusTcpAddress tcp_address(const std::string& text) {
  const std::size_t bracket = text.starts_with('[') ? text.find(']') : 0;
  const std::size_t colon = bracket == std::string::npos ? bracket : text.find(':', bracket);
  const bool any_port = colon != std::string::npos && text.compare(colon, 2, ":0") == 0 &&
                        (colon + 2 == text.size() || text[colon + 2] == ':');
  std::string named = text;
  if (any_port) named.replace(colon, 2, ":1");
  auto address = std::get<host::ModbusTcpAddress>(host::parse_bus_address("modbus-tcp:" + named).at);
  if (any_port) address.port = 0;
  return address;
}

/// Parses the options; nothing for --help.
std::optional<Options> parse(const std::vector<std::string>& arguments) {
  Options o;
  for (std::size_t k = 0; k < arguments.size(); ++k) {
    std::string option = arguments[k];
    if (option == "--help" || option == "-h") return std::nullopt;
    std::string value;
    const std::size_t equals = option.find('=');
    if (option.starts_with("--") && equals != std::string::npos) {
      value = option.substr(equals + 1);
      option.resize(equals);
    } else {
      if (k + 1 >= arguments.size())
        throw UsageError(option + ": a value is missing, or the option is unknown");
      value = arguments[++k];
    }
    if (option == "--robot") {
      o.robot = value;
    } else if (option == "--store") {
      o.store = value;
    } else if (option == "--trust") {
      o.keys.push_back(value);
    } else if (option == "--can") {
      o.can = std::get<host::CanAddress>(host::parse_bus_address("can:" + value).at);
    } else if (option == "--modbus-tcp") {
      o.tcp = tcp_address(value);
    } else if (option == "--modbus-rtu") {
      o.rtu = std::get<host::ModbusRtuAddress>(host::parse_bus_address("modbus-rtu:" + value).at);
    } else if (option == "--modbus-idle-s") {
      o.modbus_idle_s = number(option, value, 0, 1000000);
    } else if (option == "--cycle-us") {
      o.cycle_us = number(option, value, 50, 1000000);
    } else if (option == "--fade-cycles") {
      // Older scripts give it; a change of set now settles at a rate, whatever the cycle.
      number(option, value, 0, 10000000);
    } else if (option == "--trial-cycles") {
      o.trial_cycles = number(option, value, 1, 0xFFFFFFFF);
    } else if (option == "--heartbeat-ms") {
      o.heartbeat_ms = static_cast<std::uint16_t>(number(option, value, 0, 65535));
    } else {
      throw UsageError("unknown option '" + option + "'");
    }
  }
  if (o.robot.empty()) throw UsageError("--robot is missing");
  if (o.store.empty()) throw UsageError("--store is missing");
  return o;
}

/// Runs the control cycle: the joints oscillate slowly about the middle of their ranges, so that directions and
/// published values change. Missed cycles are skipped, not caught up.
void run_cycle(firmware::Device& device, std::uint32_t cycle_us, const std::atomic<bool>& stop) {
  const auto context = default_context<firmware::Scalar>(device.robot());
  timespec next{};
  ::clock_gettime(CLOCK_MONOTONIC, &next);
  const std::int64_t period_ns = static_cast<std::int64_t>(cycle_us) * 1000;
  for (std::uint64_t k = 0; !stop.load(std::memory_order_relaxed); ++k) {
    const double t = static_cast<double>(k) * cycle_us * 1e-6;
    firmware::Joints q;
    for (std::size_t j = 0; j < firmware::joints; ++j) {
      const JointLimits& limits = device.robot().limits[j];
      const double oscillation = std::sin(t * (0.3 + 0.05 * static_cast<double>(j)));
      q[j] = static_cast<firmware::Scalar>(0.5 * (limits.min_rad + limits.max_rad) +
                                           0.05 * (limits.max_rad - limits.min_rad) * oscillation);
    }
    device.step(q, context);
    timespec now{};
    ::clock_gettime(CLOCK_MONOTONIC, &now);
    std::int64_t at = next.tv_sec * 1'000'000'000LL + next.tv_nsec + period_ns;
    const std::int64_t earliest = now.tv_sec * 1'000'000'000LL + now.tv_nsec;
    if (at < earliest) at = earliest;
    next.tv_sec = at / 1'000'000'000LL;
    next.tv_nsec = at % 1'000'000'000LL;
    ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, nullptr);
  }
}

/// Whose sets are used; the keys must outlive it.
firmware::Trust trust(const std::vector<host::PublicKey>& keys) {
  firmware::Trust t;
  static_assert(sizeof(host::PublicKey) == signing::key_bytes);
  t.keys = reinterpret_cast<const std::uint8_t(*)[signing::key_bytes]>(keys.data());
  t.count = static_cast<std::uint16_t>(keys.size());
  t.check = [](void*, const std::uint8_t* key, const std::uint8_t* signature, const std::uint8_t* message,
               std::uint32_t size) {
    host::PublicKey k;
    host::Signature s;
    std::copy_n(key, k.size(), k.begin());
    std::copy_n(signature, s.size(), s.begin());
    return host::verify(k, {message, size}, s) ? 1 : 0;
  };
  return t;
}

int serve(const Options& options) {
  const host::Robot robot = host::load_robot(options.robot);
  hil::SlotFile slots(options.store);

  firmware::DeviceSettings settings;
  settings.control.motion.cycle_us = options.cycle_us;
  settings.store.trial_cycles = options.trial_cycles;
  settings.name = robot.name.c_str();
  settings.serial = robot.serial.c_str();
  std::vector<host::PublicKey> keys;
  for (const std::string& path : options.keys) keys.push_back(host::read_public_key(path));
  if (!keys.empty() && robot.serial.empty()) {
    throw host::InputError(options.robot, 0, "serial", "a serial number, as signed sets are for one unit",
                           "none");
  }
  const auto device = std::make_unique<firmware::Device>(robot.nominal, slots.hooks(), settings);
  device->set_trust(trust(keys));
  device->boot();
  const std::uint16_t faults = device->store().faults();
  if ((faults & wire::fault::older_slot) != 0) {
    std::fprintf(stderr, "flexcomp-controller: the newest set is damaged, the one before is used\n");
  }
  if ((faults & wire::fault::storage) != 0)
    std::fprintf(stderr, "flexcomp-controller: the store cannot be read\n");

  // Signals are received through a descriptor, also in threads started from here on.
  sigset_t signals;
  ::sigemptyset(&signals);
  ::sigaddset(&signals, SIGTERM);
  ::sigaddset(&signals, SIGINT);
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  const host::Descriptor signalled(::signalfd(-1, &signals, SFD_NONBLOCK | SFD_CLOEXEC));

  std::vector<std::unique_ptr<hil::Port>> ports;
  if (options.can)
    ports.push_back(std::make_unique<hil::CanPort>(*device, 1, *options.can, options.heartbeat_ms,
                                                   options.store + ".can"));
  if (options.rtu) ports.push_back(std::make_unique<hil::RtuPort>(*device, 2, *options.rtu));
  if (options.tcp)
    ports.push_back(std::make_unique<hil::TcpPort>(*device, 3, *options.tcp, options.modbus_idle_s * 1000));

  std::atomic<bool> stop{false};
  std::thread cycle(run_cycle, std::ref(*device), options.cycle_us, std::cref(stop));

  // Before the word that they serve: a CANopen node answers once it has sent its boot-up message.
  for (const auto& port : ports) port->serve();
  device->poll(hil::now_ms());
  std::string ready = "ready robot=" + robot.name;
  for (const auto& port : ports) ready += " " + port->text();
  ready += " cycle_us=" + std::to_string(options.cycle_us) +
           " sequence=" + std::to_string(device->store().active_sequence());
  std::puts(ready.c_str());
  std::fflush(stdout);

  std::vector<pollfd> waiting;
  for (;;) {
    waiting.clear();
    waiting.push_back({signalled.get(), POLLIN, 0});
    for (const auto& port : ports) port->wait_on(waiting);
    wire::Status status;
    device->store().status(status);
    const bool working = status.state == static_cast<std::uint16_t>(wire::StoreState::working);
    ::poll(waiting.data(), waiting.size(), working ? 0 : 5);
    if ((waiting[0].revents & POLLIN) != 0) break;
    for (const auto& port : ports) port->serve();
    device->poll(hil::now_ms());
  }
  stop = true;
  cycle.join();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const auto say = [](const char* what) { std::fprintf(stderr, "flexcomp-controller: %s\n", what); };
  try {
    const std::optional<Options> options = parse({argv + 1, argv + argc});
    if (!options) {
      std::fwrite(usage.data(), 1, usage.size(), stdout);
      return 0;
    }
    return serve(*options);
  } catch (const UsageError& e) {
    say(e.what());
    say("see --help");
    return static_cast<int>(host::ExitStatus::usage);
  } catch (const std::invalid_argument& e) {
    say(e.what());
    return static_cast<int>(host::ExitStatus::usage);
  } catch (const host::InputError& e) {
    say(e.what());
    return static_cast<int>(host::ExitStatus::input_refused);
  } catch (const host::BusError& e) {
    say(e.what());
    return static_cast<int>(host::ExitStatus::bus);
  } catch (const std::exception& e) {
    say(e.what());
    return static_cast<int>(host::ExitStatus::failed);
  }
}
