// SPDX-License-Identifier: Apache-2.0
/// \file
/// A controller as seen over a bus: the same conversation on Modbus and CANopen (flexcomp/wire/store_state.hpp).
#ifndef FLEXCOMP_HOST_BUS_CONTROLLER_CLIENT_HPP
#define FLEXCOMP_HOST_BUS_CONTROLLER_CLIENT_HPP

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

/// Called now and then during a transfer.
using Progress = std::function<void(std::size_t done, std::size_t total)>;

struct ClientOptions {
  /// How long a controller may keep silent before it is given up. On CAN and on a serial line, where a frame can get
  /// lost, it is asked three times in this time; a serial line's own time for the bytes comes on top.
  std::chrono::milliseconds patience{3000};
  /// How long non-volatile memory may take to be erased and written.
  std::chrono::milliseconds working{20000};
};

/// The controller understood and said no.
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

/// Nobody answered in time.
class NoAnswer : public BusError {
 public:
  using BusError::BusError;
};

/// One controller. Every member throws BusError, whose message names the bus and what was asked.
class ControllerClient {
 public:
  virtual ~ControllerClient() = default;
  ControllerClient(const ControllerClient&) = delete;
  ControllerClient& operator=(const ControllerClient&) = delete;

  const std::string& where() const { return where_; }

  /// What the controller is and holds; asked once, when the connection is made.
  const wire::Capability& capability() const { return capability_; }
  wire::Status status();

  /// The arm that the controller was built for, checked against its hashes; nothing where it does not tell. Its name
  /// is empty where the controller knows only the hash.
  std::optional<Robot> robot();

  /// Announces an image and sends its bytes. The active set stays as it is.
  void stage(std::span<const std::uint8_t> image, const Progress& progress = {});

  /// Runs a command, and waits for its end where it writes non-volatile memory. A controller that is busy is asked
  /// again until patience ends. \throws RefusedByController with the controller's reason in words
  void run(wire::Command command, std::uint32_t argument = 0);

  /// The active image; empty where there is none. All of it is of one set.
  Bytes active_image(const Progress& progress = {});

  wire::ProbeResponse probe(const wire::ProbeRequest& request);

 protected:
  /// A record as bytes, in the order of the bus.
  enum class Record { capability, status, robot };

  /// What a bus tells where the controller says no: whether it is worth asking again, and the code in words.
  struct SaidNo {
    bool busy = false;
    bool no_such_object = false;
    std::string code;
  };

  ControllerClient(BusAddress address, const ClientOptions& options);

  /// Reads the capability record and refuses a protocol that is not known. To be called once the bus is open.
  void greet();

  // What a bus does. Each throws SaidNo where the controller refuses and BusError where it does not answer.
  virtual wire::ByteOrder byte_order() const = 0;
  virtual Bytes read_record(Record record, std::size_t size) = 0;
  virtual void send_image(std::span<const std::uint8_t> image, const Progress& progress) = 0;
  virtual void send_command(wire::Command command, std::uint32_t argument) = 0;
  virtual Bytes read_image(std::size_t size, const Progress& progress) = 0;
  virtual Bytes answer_probe(std::span<const std::uint8_t> request) = 0;

  const BusAddress& address() const { return address_; }
  const ClientOptions& options() const { return options_; }

 private:
  template <class Action>
  void insist(const std::string& what, const Action& action);
  [[noreturn]] void explain(const std::string& what, const SaidNo& no);

  BusAddress address_;
  ClientOptions options_;
  std::string where_;
  wire::Capability capability_;
};

/// Opens the bus and asks who is there. \throws BusError
std::unique_ptr<ControllerClient> connect(const BusAddress& address, const ClientOptions& options = {});

/// "commit the set"
std::string describe(wire::Command command);

/// "refused", with the reason and the detail in words.
std::string describe(wire::Answer answer, Refusal refusal, std::uint32_t detail);

}  // namespace flexcomp::host

#endif
