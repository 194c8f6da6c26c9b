// SPDX-License-Identifier: Apache-2.0
/// \file
/// Client of a CANopen SDO channel (CiA 301, 7.2.4): expedited and segmented transfers over a CAN socket.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace flexcomp::host {

struct ObjectAddress {
  std::uint16_t index = 0;
  std::uint8_t sub = 0;

  std::string text() const;  ///< 0x1018:1
};

/// SDO abort transfer (CiA 301, 7.2.4.3), by the server, or by this client after an invalid answer.
class SdoAbort : public std::runtime_error {
 public:
  SdoAbort(ObjectAddress object, std::uint32_t code, bool by_server);
  std::uint32_t code() const { return code_; }
  bool by_server() const { return by_server_; }

 private:
  std::uint32_t code_;
  bool by_server_;
};

class SdoTimeout : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class SdoClient {
 public:
  using Progress = std::function<void(std::size_t done, std::size_t total)>;

  /// \param socket   one struct can_frame per read and write; owned by the caller
  /// \param timeout  limit of each answer of the server
  SdoClient(int socket, std::uint8_t node, std::chrono::milliseconds timeout);

  /// Reads an object: expedited or segmented upload (CiA 301, 7.2.4.3). \throws SdoAbort, SdoTimeout, std::system_error
  std::vector<std::uint8_t> upload(ObjectAddress object, const Progress& progress = {});
  /// Writes an object: expedited up to 4 bytes, else segmented download (CiA 301, 7.2.4.3). Throws as upload().
  void download(ObjectAddress object, std::span<const std::uint8_t> data, const Progress& progress = {});

 private:
  using Payload = std::array<std::uint8_t, 8>;

  std::vector<std::uint8_t> upload_segments(ObjectAddress object, std::size_t announced, bool is_announced,
                                            const Progress& progress);
  Payload exchange(const Payload& request, ObjectAddress object, bool first);
  void send(const Payload& payload, std::chrono::steady_clock::time_point end);
  bool receive(Payload& payload, std::chrono::steady_clock::time_point end);
  void drain();
  [[noreturn]] void abort(ObjectAddress object, std::uint32_t code);

  int socket_;
  std::uint8_t node_;
  std::chrono::milliseconds timeout_;
};

}  // namespace flexcomp::host
