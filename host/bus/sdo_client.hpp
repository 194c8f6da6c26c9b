// SPDX-License-Identifier: Apache-2.0
/// \file
/// Client of a CANopen SDO channel (CiA 301, 7.2.4): expedited, segmented and block transfers over a CAN socket.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
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

/// What else was on the channel than the answers that were waited for.
struct SdoDisturbances {
  unsigned lost = 0;     ///< requests that were sent again, because no answer came
  unsigned doubled = 0;  ///< answers that had come before
  unsigned foreign = 0;  ///< answers to another client, about other objects

  bool any() const { return lost != 0 || doubled != 0 || foreign != 0; }
  std::string text()
      const;  ///< 2 requests sent again without an answer, 1 answer twice, 31 answers to another client
};

/// One client of one channel. An answer is taken only where it fits the request: by the object at the start of a transfer, by
/// command specifier and toggle bit in its segments. All others are counted and passed over. A request without an answer is
/// sent again: servers that know the segment for the one that they had last repeat their answer, others abort the
/// transfer, which may then be begun anew.
class SdoClient {
 public:
  using Progress = std::function<void(std::size_t done, std::size_t total)>;

  /// \param socket   one struct can_frame per read and write; owned by the caller
  /// \param timeout  limit of each answer of the server; requests are sent again after a twelfth of it, then after
  ///                 twice as long, and so on
  SdoClient(int socket, std::uint8_t node, std::chrono::milliseconds timeout);
  /// The same over the channel of these COB-IDs.
  SdoClient(int socket, std::uint16_t request_id, std::uint16_t answer_id, std::chrono::milliseconds timeout);

  /// Reads an object: expedited, segmented or, where more than in_few_segments bytes are expected, block upload (CiA 301,
  /// 7.2.4.3). A server that has no block transfer is asked for segments. \throws SdoAbort, SdoTimeout, std::system_error
  std::vector<std::uint8_t> upload(ObjectAddress object, const Progress& progress = {},
                                   std::size_t expected_size = 0);
  /// Writes an object: expedited up to 4 bytes, segmented up to in_few_segments, else block download. Throws as upload().
  void download(ObjectAddress object, std::span<const std::uint8_t> data, const Progress& progress = {});
  /// The same for at most 4 bytes, sent once and waited for a quarter of the time limit: for what must not be done twice.
  void download_once(ObjectAddress object, std::span<const std::uint8_t> data);

  /// All answers to one upload request of an object of at most 4 bytes: two where two nodes have one number. Waits for the
  /// first one as long as upload() until it asks again, and half as long for the next.
  std::vector<std::vector<std::uint8_t>> upload_from_all(ObjectAddress object);

  /// Bytes up to which a block transfer has no fewer frames than a segmented one.
  static constexpr std::size_t in_few_segments = 28;

  /// Takes in what still comes until nothing has come for a moment, at most a tenth of the time limit: after a transfer
  /// that was broken off its late answers must not be taken for those of the next one.
  void await_silence();

  /// Since the client was made.
  const SdoDisturbances& disturbances() const { return disturbances_; }

 private:
  using Payload = std::array<std::uint8_t, 8>;

  /// The answer that a request must have.
  struct Expected {
    ObjectAddress object;
    unsigned specifier = 0;
    bool first = true;    ///< of the transfer: the answer names the object
    unsigned toggle = 0;  ///< of a segment
    unsigned segment = 0;
    unsigned mask = 0xE0;  ///< bits of the first byte that are the specifier
  };
  enum class Fit { yes, doubled, foreign, out_of_step };

  std::vector<std::uint8_t> upload_segments(ObjectAddress object, std::size_t announced, bool is_announced,
                                            const Progress& progress);
  bool download_block(ObjectAddress object, std::span<const std::uint8_t> data, const Progress& progress);
  std::size_t send_sub_block(std::span<const std::uint8_t> data, std::size_t at, unsigned most, Payload& last,
                             const Progress& progress);
  Payload await_taken(ObjectAddress object, const Payload& last_segment, unsigned sent, bool alternates);
  std::optional<std::vector<std::uint8_t>> upload_block(ObjectAddress object, const Progress& progress);
  void throw_if_ours(const Payload& answer, const Expected& expected);
  Payload expedited_frame(ObjectAddress object, std::span<const std::uint8_t> data) const;
  Payload exchange(const Payload& request, const Expected& expected, bool once = false);
  Fit fit(const Payload& answer, const Expected& expected) const;
  void send(const Payload& payload, std::chrono::steady_clock::time_point end);
  bool receive(Payload& payload, std::chrono::steady_clock::time_point end);
  void drain();
  void begin_transfer(std::size_t bytes);
  /// When a frame is sent once more, at intervals that grow, and until when its answer is waited for.
  struct Repetition {
    std::chrono::steady_clock::time_point end;
    std::chrono::milliseconds wait;
    std::chrono::steady_clock::time_point again;
    std::chrono::steady_clock::time_point next() const { return std::min(again, end); }
  };
  Repetition repetition() const;
  /// Sends a frame once more where its time has come. \throws SdoTimeout  where that of its answer has gone
  void send_when_due(const Payload& frame, Repetition& when, bool is_heard, ObjectAddress object);
  /// Until when an answer is waited for.
  std::chrono::steady_clock::time_point answer_end() const;
  [[noreturn]] void abort(ObjectAddress object, std::uint32_t code);
  /// Ends a transfer whose answer does not come. \throws SdoTimeout
  [[noreturn]] void give_up(ObjectAddress object);

  int socket_;
  std::uint16_t request_id_;
  std::uint16_t answer_id_;
  std::chrono::milliseconds timeout_;
  std::chrono::steady_clock::time_point transfer_end_ = std::chrono::steady_clock::time_point::max();
  Payload last_{};             ///< the last answer that was taken
  bool server_blocks_ = true;  ///< until it refuses
  SdoDisturbances disturbances_;
};

}  // namespace flexcomp::host
