// SPDX-License-Identifier: Apache-2.0
/// \file
/// Client of a controller, the same protocol on Modbus and CANopen (flexcomp/wire/store_state.hpp).
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "bus/bus_address.hpp"
#include "errors.hpp"
#include "flexcomp/status.hpp"
#include "flexcomp/wire/store_state.hpp"
#include "model/robot.hpp"

namespace flexcomp::host {

using Bytes = std::vector<std::uint8_t>;

/// For messages.
inline double in_seconds(std::chrono::milliseconds t) { return std::chrono::duration<double>(t).count(); }

/// Reports bytes transferred so far.
using Progress = std::function<void(std::size_t done, std::size_t total)>;

struct ClientOptions {
  /// Time limit of a response. Where frames get lost, several attempts share it; on a serial line the transmission time
  /// is added.
  std::chrono::milliseconds response_timeout{3000};
  /// Time limit for erasing and writing non-volatile memory.
  std::chrono::milliseconds write_timeout{20000};
  /// How long the staging area may belong to another client. Longer than the 3 s of silence after which a controller gives it
  /// to the next one (store_state.hpp).
  std::chrono::milliseconds staging_timeout{10000};
};

/// The controller refused a request.
class RefusedByController : public BusError {
 public:
  RefusedByController(const std::string& address, const std::string& text, wire::Answer answer,
                      Refusal refusal)
      : BusError(address, text), answer_(answer), refusal_(refusal) {}
  wire::Answer answer() const { return answer_; }
  Refusal refusal() const { return refusal_; }  ///< where the answer is `refused`

 private:
  wire::Answer answer_;
  Refusal refusal_;
};

/// No response within the time limit.
class NoAnswer : public BusError {
 public:
  using BusError::BusError;
};

/// A command went out, and what became of it cannot be told now. Message: `can:vcan0:5: open: …`.
class OutcomeOpen : public DoubtfulResult {
 public:
  OutcomeOpen(const std::string& address, const std::string& text)
      : DoubtfulResult(address + ": open: " + text, ErrorCode::outcome_open),
        address_(address),
        text_(text) {}
  const std::string& address() const { return address_; }
  const std::string& text() const { return text_; }

 private:
  std::string address_;
  std::string text_;
};

/// Which unit a controller belongs to, and whom it trusts (flexcomp/wire/unit_record.hpp).
struct ControllerUnit {
  Sha256Digest hash{};        ///< of the serial number; zeros: it has none
  std::string serial;         ///< empty where there is none, or only its hash is told
  std::uint64_t counter = 0;  ///< highest one of a signature that was accepted, 0: none
  std::size_t keys = 0;       ///< that are trusted
  std::vector<std::array<std::uint8_t, 8>> key_ids;  ///< of the first of them
};

/// Connection to one controller. Every member throws BusError, whose message names the address and the request.
class ControllerClient {
 public:
  virtual ~ControllerClient() = default;
  ControllerClient(const ControllerClient&) = delete;
  ControllerClient& operator=(const ControllerClient&) = delete;

  const std::string& where() const { return where_; }

  /// Capability record: bases, capacities, hashes. Read once, when the connection is made.
  const wire::Capability& capability() const { return capability_; }
  wire::Status status();

  /// Reads the nominal robot of the controller and verifies it against the capability's hashes; nothing where the
  /// controller has no robot record. The name is empty where it has only the hash. The serial number is that of unit().
  std::optional<Robot> robot();

  /// Reads the unit record, whose serial number is verified against its hash; nothing where the controller has none.
  std::optional<ControllerUnit> unit();

  /// Transfers an image into the staging area. The active set does not change.
  void stage(std::span<const std::uint8_t> image, const Progress& progress = {});

  /// Executes a store command that changes no active set (begin, verify, abort, unlock), and waits for its end. A busy controller
  /// is asked again until response_timeout. \throws RefusedByController with the controller's reason
  void run(wire::Command command, std::uint32_t argument = 0);

  /// Tells from a status whether a command took effect.
  using Reached = std::function<bool(const wire::Status&)>;

  /// Executes a store command that changes the active set, and says what became of it by the controller's status alone:
  /// an answer may be lost, late, or another client's. After any error the status is asked for again, over a new
  /// connection where the old one is broken, until the controller has kept silent for three response times, or has worked
  /// for write_timeout. Returns the status that says so where the command took effect.
  /// \throws BusError  it did not, and cannot any more: the controller runs what it ran before
  /// \throws OutcomeOpen  this cannot be told
  wire::Status conclude(wire::Command command, std::uint32_t argument, const Reached& reached);

  /// The status, once the store is no longer working; asked for as by conclude(). \throws OutcomeOpen
  wire::Status settled_status(const std::string& question);

  /// Reads the active image, consistent: the same set was active before and after. Empty where there is none.
  Bytes active_image(const Progress& progress = {});

  /// Asks for the corrected command. Flags are those of the status where the controller tells no others.
  wire::ProbeResponse probe(const wire::ProbeRequest& request);

 protected:
  /// Records that are read as bytes, in the byte order of the bus.
  enum class Record { capability, status, robot, unit };

  /// Refusal as the bus reports it: Modbus exception or SDO abort.
  struct BusRefusal {
    bool busy = false;  ///< worth another attempt
    bool no_such_object = false;
    std::string code;  ///< number and text
  };

  ControllerClient(const BusAddress& address, const ClientOptions& options);

  /// Reads the capability record and refuses an unknown protocol. To be called once the bus is open.
  void read_capability();

  // Primitives of a bus. Each throws BusRefusal where the controller refuses and BusError where it does not respond; after
  // an error that broke the connection the next one opens it anew.
  virtual wire::ByteOrder byte_order() const = 0;
  virtual Bytes read_record(Record record, std::size_t size) = 0;
  virtual void send_image(std::span<const std::uint8_t> image, const Progress& progress) = 0;
  virtual void send_command(wire::Command command, std::uint32_t argument) = 0;
  virtual Bytes read_image(std::size_t size, const Progress& progress) = 0;
  /// The probe response record; where `with_flags`, its flags (u16) behind it.
  virtual Bytes exchange_probe(std::span<const std::uint8_t> request, bool with_flags) = 0;

  /// Number of the connection: what was sent over an earlier one may still arrive. 0 where the bus keeps the order.
  virtual unsigned connection() const { return 0; }

  const ClientOptions& options() const { return options_; }

 private:
  class Patience;
  std::optional<wire::Status> status_or_wait(Patience& patience, const std::string& question);

  template <class Action>
  void retry_while_busy(const std::string& request, const Action& action,
                        std::optional<std::chrono::milliseconds> longest = std::nullopt);
  [[noreturn]] void throw_refusal(const std::string& request, const BusRefusal& from_bus,
                                  std::chrono::milliseconds waited);

  ClientOptions options_;
  std::string where_;
  wire::Capability capability_;
};

/// Opens the bus and reads the capability of the controller. \throws BusError
std::unique_ptr<ControllerClient> connect(const BusAddress& address, const ClientOptions& options = {});

/// Connects to a node over SocketCAN: objects of flexcomp/wire/canopen_objects.hpp by SDO (CiA 301, 7.2.4).
/// \param address  holds a CanAddress \throws BusError
std::unique_ptr<ControllerClient> connect_canopen(const BusAddress& address, const ClientOptions& options);

/// Connects over an open socket of struct can_frame, which the client owns and closes.
std::unique_ptr<ControllerClient> connect_canopen(const BusAddress& address, const ClientOptions& options,
                                                  int socket);

/// Connects to a unit over Modbus TCP or RTU, by libmodbus: registers of flexcomp/wire/modbus_map.hpp.
/// \param address  holds a ModbusTcpAddress or a ModbusRtuAddress \throws BusError
std::unique_ptr<ControllerClient> connect_modbus(const BusAddress& address, const ClientOptions& options);

/// Text of a command for messages: "commit the set".
std::string describe(wire::Command command);

/// Text of an answer for messages, with the reason and its detail: "unknown basis (basis 40)".
std::string describe(wire::Answer answer, Refusal refusal, std::uint32_t detail);

}  // namespace flexcomp::host
