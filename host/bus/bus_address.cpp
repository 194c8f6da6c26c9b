// SPDX-License-Identifier: Apache-2.0
#include "bus/bus_address.hpp"

#include <fmt/format.h>
#include <net/if.h>

#include <charconv>
#include <optional>
#include <stdexcept>
#include <vector>

#include "flexcomp/wire/canopen_objects.hpp"

namespace flexcomp::host {
namespace {

namespace co = wire::canopen;

constexpr std::string_view can_form = "can:IFACE[:NODE[:CHANNEL]]";
constexpr std::string_view tcp_form = "modbus-tcp:HOST[:PORT][:UNIT]";
constexpr std::string_view rtu_form = "modbus-rtu:DEVICE[:BAUD[:PARITY]][:UNIT]";

/// Throws the error of one address.
class AddressError {
 public:
  AddressError(std::string_view address, std::string_view form) : address_(address), form_(form) {}
  [[noreturn]] void operator()(const std::string& what) const {
    throw std::invalid_argument(fmt::format("bus address '{}': {}; expected {}", address_, what, form_));
  }

 private:
  std::string_view address_;
  std::string_view form_;
};

/// Converts a text that is one decimal number.
std::optional<std::uint32_t> number(std::string_view text) {
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

template <class T>
T in_range(std::string_view text, std::string_view what, T least, T most, const AddressError& fail) {
  const std::optional<std::uint32_t> value = number(text);
  if (!value || *value < least || *value > most) {
    fail(fmt::format("{} is a whole number from {} to {}, not '{}'", what, least, most, text));
  }
  return static_cast<T>(*value);
}

std::vector<std::string_view> fields(std::string_view text) {
  std::vector<std::string_view> out;
  for (;;) {
    const std::size_t colon = text.find(':');
    out.push_back(text.substr(0, colon));
    if (colon == std::string_view::npos) return out;
    text.remove_prefix(colon + 1);
  }
}

/// Sets the COB-IDs of "own" or "684-6B4".
void parse_channel(std::string_view text, CanAddress& out, const AddressError& fail) {
  if (text == "own") {
    if (out.node > co::most_channels) {
      fail(fmt::format("'own' is for nodes up to {}; give REQUEST-ANSWER as the node has them in 1201h",
                       co::most_channels));
    }
    out.own_request = static_cast<std::uint16_t>(co::channel_request_id + out.node);
    out.own_answer = static_cast<std::uint16_t>(co::channel_answer_id + out.node);
    return;
  }
  const auto identifier = [](std::string_view digits) -> std::uint16_t {
    std::uint16_t id = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), id, 16);
    const bool whole = error == std::errc() && end == digits.data() + digits.size();
    return whole && !co::is_restricted(id) ? id : std::uint16_t{0};
  };
  const std::size_t dash = text.find('-');
  if (dash != std::string_view::npos) {
    out.own_request = identifier(text.substr(0, dash));
    out.own_answer = identifier(text.substr(dash + 1));
  }
  if (out.own_request == 0 || out.own_answer == 0 || out.own_request == out.own_answer) {
    fail(fmt::format(
        "CHANNEL is own, or two COB-IDs that CiA 301 does not restrict, such as 684-6B4, not '{}'", text));
  }
}

CanAddress parse_can(std::string_view rest, const AddressError& fail) {
  const std::vector<std::string_view> part = fields(rest);
  if (part.size() > 3) fail("there are too many fields");
  if (part[0].empty()) fail("the interface is missing");
  // A longer name would be cut off and could name another interface.
  if (part[0].size() >= IF_NAMESIZE) {
    fail(fmt::format("the name of an interface has at most {} characters", IF_NAMESIZE - 1));
  }
  CanAddress out;
  out.interface = part[0];
  if (part.size() > 1) out.node = in_range<std::uint8_t>(part[1], "NODE", 1, 127, fail);
  if (part.size() > 2) parse_channel(part[2], out, fail);
  return out;
}

ModbusTcpAddress parse_tcp(std::string_view rest, const AddressError& fail) {
  ModbusTcpAddress out;
  std::vector<std::string_view> part;
  if (rest.starts_with('[')) {
    const std::size_t close = rest.find(']');
    if (close == std::string_view::npos) fail("the bracket is not closed");
    out.host = rest.substr(1, close - 1);
    part = fields(rest.substr(close + 1));
    if (!part[0].empty()) fail(fmt::format("'{}' follows the bracket", part[0]));
  } else {
    part = fields(rest);
    out.host = part[0];
  }
  if (out.host.empty()) fail("the host is missing");
  if (part.size() > 3) fail("there are too many fields (an IPv6 address stands in square brackets)");
  if (part.size() > 1) out.port = in_range<std::uint16_t>(part[1], "PORT", 1, 65535, fail);
  if (part.size() > 2) out.unit = in_range<std::uint8_t>(part[2], "UNIT", 0, 255, fail);
  return out;
}

ModbusRtuAddress parse_rtu(std::string_view rest, const AddressError& fail) {
  ModbusRtuAddress out;
  constexpr std::uint32_t most_units = 247;
  std::vector<std::string_view> part = fields(rest);
  const auto last_number = [&part]() -> std::optional<std::uint32_t> {
    return part.size() > 1 ? number(part.back()) : std::nullopt;
  };
  if (const auto n = last_number(); n && *n <= most_units) {
    out.unit = in_range<std::uint8_t>(part.back(), "UNIT", 1, most_units, fail);
    part.pop_back();
  }
  const bool one_letter = part.size() > 1 && part.back().size() == 1 && !number(part.back());
  if (one_letter) {
    const char letter = part.back()[0];
    const std::string_view known = "NEOneo";
    const std::size_t k = known.find(letter);
    if (k == std::string_view::npos) fail(fmt::format("PARITY is N, E or O, not '{}'", letter));
    out.parity = static_cast<Parity>(known[k % 3]);
    part.pop_back();
    if (!last_number()) fail("PARITY stands behind a BAUD");
  }
  if (last_number()) {
    out.baud = in_range<std::uint32_t>(part.back(), "BAUD", 300, 4000000, fail);
    part.pop_back();
  }
  // The rest is the device, with any colons of its own.
  const std::size_t length = static_cast<std::size_t>(part.back().data() + part.back().size() - rest.data());
  out.device = rest.substr(0, length);
  if (out.device.empty()) fail("the device is missing");
  return out;
}

}  // namespace

std::uint16_t CanAddress::sdo_request() const {
  return own_request != 0 ? own_request : static_cast<std::uint16_t>(co::sdo_request_id + node);
}
std::uint16_t CanAddress::sdo_answer() const {
  return own_request != 0 ? own_answer : static_cast<std::uint16_t>(co::sdo_answer_id + node);
}

std::string BusAddress::text() const {
  if (const auto* can = std::get_if<CanAddress>(&at)) {
    const std::string channel =
        can->own_request != 0 ? fmt::format(":{:X}-{:X}", can->own_request, can->own_answer) : "";
    return fmt::format("can:{}:{}{}", can->interface, can->node, channel);
  }
  if (const auto* tcp = std::get_if<ModbusTcpAddress>(&at)) {
    const bool v6 = tcp->host.find(':') != std::string::npos;
    return fmt::format("modbus-tcp:{}{}{}:{}:{}", v6 ? "[" : "", tcp->host, v6 ? "]" : "", tcp->port,
                       tcp->unit);
  }
  const auto& rtu = std::get<ModbusRtuAddress>(at);
  return fmt::format("modbus-rtu:{}:{}:{}:{}", rtu.device, rtu.baud, static_cast<char>(rtu.parity), rtu.unit);
}

BusAddress parse_bus_address(std::string_view text) {
  const auto rest = [text](std::string_view scheme) -> std::optional<std::string_view> {
    if (!text.starts_with(scheme)) return std::nullopt;
    return text.substr(scheme.size());
  };
  if (const auto can = rest("can:")) return {parse_can(*can, {text, can_form})};
  if (const auto tcp = rest("modbus-tcp:")) return {parse_tcp(*tcp, {text, tcp_form})};
  if (const auto rtu = rest("modbus-rtu:")) return {parse_rtu(*rtu, {text, rtu_form})};
  AddressError{text, fmt::format("{}, {} or {}", can_form, tcp_form, rtu_form)}("no such kind of bus");
}

}  // namespace flexcomp::host
