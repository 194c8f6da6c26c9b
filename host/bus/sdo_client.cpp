// SPDX-License-Identifier: Apache-2.0
#include "bus/sdo_client.hpp"

#include <fmt/format.h>
#include <linux/can.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <thread>

#include "flexcomp/bytes.hpp"
#include "flexcomp/wire/canopen_objects.hpp"

namespace flexcomp::host {
namespace {

namespace co = wire::canopen;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

// Command specifiers, the first byte of a frame (CiA 301, 7.2.4.3).
constexpr unsigned specifier_mask = 0xE0;
constexpr unsigned download_initiate = 0x20;
constexpr unsigned download_initiated = 0x60;
constexpr unsigned download_segment = 0x00;
constexpr unsigned download_segment_taken = 0x20;
constexpr unsigned upload_initiate = 0x40;
constexpr unsigned upload_initiated = 0x40;
constexpr unsigned upload_segment = 0x60;
constexpr unsigned upload_segment_given = 0x00;
constexpr unsigned aborted = 0x80;
constexpr unsigned expedited = 0x02;
constexpr unsigned size_indicated = 0x01;
constexpr unsigned last_segment = 0x01;
constexpr unsigned toggle_bit = 0x10;

// Of block transfers; what one side begins the other one answers with the other's specifier.
constexpr unsigned block_download = 0xC0;
constexpr unsigned block_upload = 0xA0;
constexpr unsigned with_crc = 0x04;
constexpr unsigned block_size_indicated = 0x02;
constexpr unsigned subcommand_mask = 0xE3;
constexpr unsigned upload_answer_mask = 0xE1;  ///< of the server: bit 0 tells the end from the start
constexpr unsigned block_end = 0x01;
constexpr unsigned sub_block_taken = 0x02;
constexpr unsigned block_start = 0x03;
constexpr unsigned last_of_block = 0x80;
constexpr unsigned segment_number = 0x7F;
/// Sub-blocks after which nothing has arrived, one after the other.
constexpr int most_in_vain = 20;

constexpr std::size_t in_segment = 7;
constexpr std::size_t in_expedited = 4;

struct AbortCode {
  std::uint32_t code;
  const char* text;
};

// CiA 301, table 22.
constexpr std::array abort_codes = std::to_array<AbortCode>({
    {0x05030000, "toggle bit not alternated"},
    {0x05040000, "SDO protocol timed out"},
    {0x05040001, "command specifier not valid or unknown"},
    {0x05040002, "invalid block size"},
    {0x05040003, "invalid sequence number"},
    {0x05040004, "CRC error"},
    {0x05040005, "out of memory"},
    {0x06010000, "unsupported access to an object"},
    {0x06010001, "attempt to read a write-only object"},
    {0x06010002, "attempt to write a read-only object"},
    {0x06020000, "object does not exist"},
    {0x06040043, "general parameter incompatibility"},
    {0x06040047, "general internal incompatibility in the device"},
    {0x06060000, "access failed due to a hardware error"},
    {0x06070010, "data type or length does not match"},
    {0x06070012, "data type does not match, length too high"},
    {0x06070013, "data type does not match, length too low"},
    {0x06090011, "sub-index does not exist"},
    {0x06090030, "invalid value"},
    {0x06090031, "value too high"},
    {0x06090032, "value too low"},
    {0x060A0023, "resource not available"},
    {0x08000000, "general error"},
    {0x08000020, "data cannot be transferred or stored"},
    {0x08000021, "data cannot be transferred or stored because of local control"},
    {0x08000022, "data cannot be transferred or stored because of the present device state"},
    {0x08000024, "no data available"},
});

/// Limit of an upload, bytes: a server that sends without end is stopped.
constexpr std::size_t longest = std::size_t{1} << 24U;
/// More frames than a socket of Linux holds by default, 212,992 bytes with some 800 for each.
constexpr unsigned most_queued = 300;

void address(std::array<std::uint8_t, 8>& frame, ObjectAddress object) {
  store_u16(frame.data() + 1, object.index);
  frame[3] = object.sub;
}

/// CiA 301, table 22: "SDO abort 0604 0043, general parameter incompatibility".
std::string abort_text(std::uint32_t code) {
  const auto* const known = std::find_if(abort_codes.begin(), abort_codes.end(),
                                         [code](const AbortCode& entry) { return entry.code == code; });
  return fmt::format("SDO abort {:04X} {:04X}, {}", code >> 16U, code & 0xFFFFU,
                     known != abort_codes.end() ? known->text : "unknown abort code");
}

}  // namespace

std::string ObjectAddress::text() const { return fmt::format("0x{:04X}:{}", index, sub); }

SdoAbort::SdoAbort(ObjectAddress object, std::uint32_t code, bool by_server)
    : std::runtime_error(
          fmt::format("{} at {}{}", abort_text(code), object.text(), by_server ? "" : " (by this program)")),
      code_(code),
      by_server_(by_server) {}

std::string SdoDisturbances::text() const {
  const auto some = [](unsigned count, const char* one, const char* many) {
    return fmt::format("{} {}", count, count == 1 ? one : many);
  };
  std::vector<std::string> parts;
  if (lost != 0) parts.push_back(some(lost, "request without an answer", "requests without an answer"));
  if (doubled != 0) parts.push_back(some(doubled, "answer twice", "answers twice"));
  if (foreign != 0) parts.push_back(some(foreign, "answer to another client", "answers to another client"));
  return fmt::format("{}", fmt::join(parts, ", "));
}

SdoClient::SdoClient(int socket, std::uint8_t node, milliseconds timeout)
    : SdoClient(socket, static_cast<std::uint16_t>(co::sdo_request_id + node),
                static_cast<std::uint16_t>(co::sdo_answer_id + node), timeout) {}

SdoClient::SdoClient(int socket, std::uint16_t request_id, std::uint16_t answer_id, milliseconds timeout)
    : socket_(socket), request_id_(request_id), answer_id_(answer_id), timeout_(timeout) {}

void SdoClient::send(const Payload& payload, steady_clock::time_point end) {
  can_frame frame{};
  frame.can_id = request_id_;
  frame.can_dlc = static_cast<__u8>(payload.size());
  std::copy(payload.begin(), payload.end(), frame.data);
  while (::send(socket_, &frame, sizeof frame, MSG_NOSIGNAL) != sizeof frame) {
    // A full transmit queue empties by itself; poll() does not wait for it on every driver.
    if (errno != ENOBUFS && errno != EAGAIN && errno != EINTR) {
      throw std::system_error(errno, std::generic_category(), "sending a CAN frame");
    }
    if (steady_clock::now() > end) throw SdoTimeout("the bus takes no frame");
    std::this_thread::sleep_for(milliseconds(1));
  }
}

bool SdoClient::receive(Payload& payload, steady_clock::time_point end) {
  // What is queued at the end is still read, but no flood that goes on.
  for (unsigned left_over = 0; left_over < most_queued; left_over += steady_clock::now() < end ? 0U : 1U) {
    const auto left = std::chrono::ceil<milliseconds>(end - steady_clock::now()).count();
    pollfd ready{socket_, POLLIN, 0};
    const int n = ::poll(&ready, 1, static_cast<int>(std::max<long>(left, 0)));
    if (n < 0 && errno != EINTR)
      throw std::system_error(errno, std::generic_category(), "waiting for a CAN frame");
    if (n == 0) return false;
    if (n < 0) continue;
    can_frame frame{};
    const ssize_t size = ::recv(socket_, &frame, sizeof frame, MSG_DONTWAIT);
    if (size < 0) {
      if (errno == EAGAIN || errno == EINTR) continue;
      throw std::system_error(errno, std::generic_category(), "receiving a CAN frame");
    }
    if (size == 0) throw std::system_error(ENODEV, std::generic_category(), "receiving a CAN frame");
    // The comparison also drops extended, remote and error frames: their flags are part of the id.
    if (size != sizeof frame || frame.can_id != answer_id_ || frame.can_dlc != payload.size()) {
      continue;
    }
    std::copy_n(frame.data, payload.size(), payload.begin());
    return true;
  }
  return false;
}

void SdoClient::drain() {
  Payload stale;
  for (unsigned k = 0; k < most_queued && receive(stale, steady_clock::now()); ++k) {
  }
}

void SdoClient::await_silence() {
  const auto end = steady_clock::now() + timeout_ / 10;
  const auto silence = std::clamp(timeout_ / 100, milliseconds(5), milliseconds(30));
  Payload stale;
  while (steady_clock::now() < end && receive(stale, steady_clock::now() + silence)) {
  }
}

void SdoClient::abort(ObjectAddress object, std::uint32_t code) {
  Payload frame{};
  frame[0] = aborted;
  address(frame, object);
  store_u32(frame.data() + 4, code);
  send(frame, steady_clock::now() + timeout_);
  throw SdoAbort(object, code, false);
}

void SdoClient::give_up(ObjectAddress object) {
  try {
    abort(object, co::abort::timeout);
  } catch (const SdoAbort&) {
    throw SdoTimeout(fmt::format("no answer about {}", object.text()));
  }
}

SdoClient::Fit SdoClient::fit(const Payload& answer, const Expected& expected) const {
  const unsigned specifier = answer[0] & specifier_mask;
  const bool names_object = specifier == upload_initiated || specifier == download_initiated;
  const bool same_object =
      load_u16(answer.data() + 1) == expected.object.index && answer[3] == expected.object.sub;
  if (expected.first) {
    const bool fits = (answer[0] & expected.mask) == expected.specifier;
    if ((names_object || fits) && !same_object) return Fit::foreign;
    return fits ? Fit::yes : Fit::doubled;
  }
  if (names_object) {
    // Our object: the answer to the start came twice; once the segments run, the server has begun anew. Another object
    // in segments: the server has one transfer, which is now that one.
    if (same_object) return expected.segment == 0 ? Fit::doubled : Fit::out_of_step;
    return specifier == upload_initiated && (answer[0] & expedited) == 0 ? Fit::out_of_step : Fit::foreign;
  }
  if (expected.mask != specifier_mask) {
    // Of a block download only its end; the server's answers before may come again.
    if ((answer[0] & expected.mask) == expected.specifier) return Fit::yes;
    return specifier == block_upload ? Fit::doubled : Fit::foreign;
  }
  if (specifier != expected.specifier) return Fit::foreign;
  if ((answer[0] & toggle_bit) == expected.toggle) return Fit::yes;
  // What is no copy of the last answer shows that an older one was taken for it.
  const bool copy = expected.segment == 0 || answer == last_;
  return copy ? Fit::doubled : Fit::out_of_step;
}

void SdoClient::throw_if_ours(const Payload& answer, const Expected& expected) {
  const ObjectAddress object = expected.object;
  const std::uint32_t code = load_u32(answer.data() + 4);
  const bool of_segments = code == co::abort::toggle || code == co::abort::timeout ||
                           code == co::abort::sequence || code == co::abort::crc;
  const bool same_object = load_u16(answer.data() + 1) == object.index && answer[3] == object.sub;
  // A segment is answered by an abort about another object where that one has replaced the transfer. The start of
  // a transfer is answered by none of the codes of segments: those are of an earlier one.
  const bool ours =
      expected.first ? same_object && !of_segments : same_object || of_segments || code == co::abort::command;
  if (ours) throw SdoAbort(object, code, true);
  ++(same_object ? disturbances_.doubled : disturbances_.foreign);
}

SdoClient::Repetition SdoClient::repetition() const {
  const auto wait = std::max(timeout_ / 12, milliseconds(1));
  return {answer_end(), wait, steady_clock::now() + wait};
}

void SdoClient::send_when_due(const Payload& frame, Repetition& when, bool is_heard, ObjectAddress object) {
  // Answers to others do not stop the clock.
  const auto now = steady_clock::now();
  if (is_heard && now < when.next()) return;
  if (now >= when.end) give_up(object);
  ++disturbances_.lost;
  send(frame, when.end);
  when.wait *= 2;
  when.again = now + when.wait;
}

SdoClient::Payload SdoClient::exchange(const Payload& request, const Expected& expected, bool once) {
  const ObjectAddress object = expected.object;
  Repetition when = repetition();
  if (once) when.end = when.again = steady_clock::now() + timeout_ / 4;
  send(request, when.end);
  Payload answer;
  for (;;) {
    const bool is_heard = receive(answer, when.next());
    if (is_heard && answer[0] == aborted) {
      throw_if_ours(answer, expected);
    } else if (is_heard) {
      switch (fit(answer, expected)) {
        case Fit::yes:
          last_ = answer;
          return answer;
        case Fit::doubled:
          ++disturbances_.doubled;
          break;
        case Fit::foreign:
          ++disturbances_.foreign;
          break;
        case Fit::out_of_step:
          ++disturbances_.foreign;
          abort(object, co::abort::toggle);
      }
    }
    send_when_due(request, when, is_heard, object);
  }
}

SdoClient::Payload SdoClient::expedited_frame(ObjectAddress object,
                                              std::span<const std::uint8_t> data) const {
  Payload frame{};
  address(frame, object);
  const auto unused = static_cast<unsigned>(in_expedited - data.size());
  frame[0] = static_cast<std::uint8_t>(download_initiate | (unused << 2U) | expedited | size_indicated);
  std::copy(data.begin(), data.end(), frame.begin() + 4);
  return frame;
}

/// A flood of answers that fit goes on no longer than this, nor does a server that sends slowly for ever.
void SdoClient::begin_transfer(std::size_t bytes) {
  // A bit rate of 20 kbit/s takes 1 ms for a byte.
  transfer_end_ = steady_clock::now() + 10 * timeout_ + milliseconds(2 * bytes);
  drain();
}

steady_clock::time_point SdoClient::answer_end() const {
  return std::min(steady_clock::now() + timeout_, transfer_end_);
}

void SdoClient::download_once(ObjectAddress object, std::span<const std::uint8_t> data) {
  begin_transfer(data.size());
  exchange(expedited_frame(object, data), {object, download_initiated}, true);
}

void SdoClient::download(ObjectAddress object, std::span<const std::uint8_t> data, const Progress& progress) {
  begin_transfer(data.size());
  if (!data.empty() && data.size() <= in_expedited) {
    exchange(expedited_frame(object, data), {object, download_initiated});
    return;
  }
  if (data.size() > in_few_segments && server_blocks_ && download_block(object, data, progress)) return;
  Payload frame{};
  address(frame, object);
  frame[0] = download_initiate | size_indicated;
  store_u32(frame.data() + 4, static_cast<std::uint32_t>(data.size()));
  exchange(frame, {object, download_initiated});

  Expected expected{object, download_segment_taken, false};
  std::size_t at = 0;
  do {
    const std::size_t size = std::min(in_segment, data.size() - at);
    const bool last = at + size == data.size();
    frame = {};
    frame[0] = static_cast<std::uint8_t>(download_segment | expected.toggle |
                                         static_cast<unsigned>((in_segment - size) << 1U) |
                                         (last ? last_segment : 0U));
    std::copy_n(data.begin() + static_cast<std::ptrdiff_t>(at), size, frame.begin() + 1);
    exchange(frame, expected);
    expected.toggle ^= toggle_bit;
    ++expected.segment;
    at += size;
    if (progress) progress(at, data.size());
  } while (at != data.size());
}

bool SdoClient::download_block(ObjectAddress object, std::span<const std::uint8_t> data,
                               const Progress& progress) {
  Payload frame{};
  address(frame, object);
  frame[0] = block_download | with_crc | block_size_indicated;
  store_u32(frame.data() + 4, static_cast<std::uint32_t>(data.size()));
  Payload answer;
  try {
    answer = exchange(frame, {.object = object, .specifier = block_upload, .mask = subcommand_mask});
  } catch (const SdoAbort& e) {
    if (!e.by_server() || e.code() != co::abort::command) throw;
    server_blocks_ = false;
    return false;
  }
  const bool crc_wanted = (answer[0] & with_crc) != 0;
  unsigned most = answer[4];
  if (most == 0 || most > segment_number) abort(object, co::abort::block_size);
  bool alternates = false;
  int in_vain = 0;
  std::size_t at = 0;
  Payload last_segment;
  try {
    while (at != data.size()) {
      const std::size_t sent = send_sub_block(data, at, most, last_segment, progress);
      answer = await_taken(object, last_segment, static_cast<unsigned>(sent), alternates);
      at = std::min(data.size(), at + in_segment * answer[1]);
      in_vain = answer[1] == 0 ? in_vain + 1 : 0;
      if (in_vain == most_in_vain) abort(object, co::abort::sequence);
      if (answer[2] == 0 || answer[2] > segment_number) abort(object, co::abort::block_size);
      alternates = answer[2] != most;
      most = answer[2];
    }
    const auto unused = static_cast<unsigned>((in_segment - data.size() % in_segment) % in_segment);
    frame = {};
    frame[0] = static_cast<std::uint8_t>(block_download | (unused << 2U) | block_end);
    if (crc_wanted) {
      store_u16(frame.data() + 1, co::crc16(0, data.data(), static_cast<std::uint32_t>(data.size())));
    }
    exchange(
        frame,
        {.object = object, .specifier = block_upload | block_end, .first = false, .mask = subcommand_mask});
  } catch (const SdoAbort& e) {
    // The server has accepted this length: segments of two sub-blocks were mixed up on the way.
    const bool of_length = e.code() == co::abort::too_long || e.code() == co::abort::too_short;
    if (e.by_server() && of_length) throw SdoAbort(object, co::abort::sequence, false);
    throw;
  }
  return true;
}

std::size_t SdoClient::send_sub_block(std::span<const std::uint8_t> data, std::size_t at, unsigned most,
                                      Payload& last, const Progress& progress) {
  const auto end = answer_end();
  std::size_t sent = 0;
  while (sent != most && at != data.size()) {
    const std::size_t size = std::min(in_segment, data.size() - at);
    last = {};
    last[0] = static_cast<std::uint8_t>(++sent);
    std::copy_n(data.begin() + static_cast<std::ptrdiff_t>(at), size, last.begin() + 1);
    at += size;
    if (at == data.size()) last[0] = static_cast<std::uint8_t>(last[0] | last_of_block);
    send(last, end);
    if (progress) progress(at, data.size());
  }
  return sent;
}

/// The server's answer to a sub-block of so many segments. Without one the last segment is sent again: it was lost, or its
/// answer. Where the server alternates between two sizes, an answer equal to the one before is a copy of it.
SdoClient::Payload SdoClient::await_taken(ObjectAddress object, const Payload& last_segment, unsigned sent,
                                          bool alternates) {
  Repetition when = repetition();
  Payload answer;
  for (;;) {
    const bool is_heard = receive(answer, when.next());
    if (is_heard && answer[0] == aborted) {
      throw_if_ours(answer, {.object = object, .first = false});
    } else if (is_heard) {
      if ((answer[0] & subcommand_mask) == (block_upload | sub_block_taken) && answer[1] <= sent &&
          !(alternates && answer == last_)) {
        last_ = answer;
        return answer;
      }
      ++((answer[0] & specifier_mask) == block_upload ? disturbances_.doubled : disturbances_.foreign);
    }
    send_when_due(last_segment, when, is_heard, object);
  }
}

/// Nothing where the server has no block transfer.
std::optional<std::vector<std::uint8_t>> SdoClient::upload_block(ObjectAddress object,
                                                                 const Progress& progress) {
  unsigned most = co::most_segments;
  Payload request{};
  address(request, object);
  request[0] = block_upload | with_crc;
  request[4] = static_cast<std::uint8_t>(most);
  Payload answer;
  try {
    answer = exchange(request, {.object = object, .specifier = block_download, .mask = upload_answer_mask});
  } catch (const SdoAbort& e) {
    if (!e.by_server() || e.code() != co::abort::command) throw;
    server_blocks_ = false;
    return std::nullopt;
  }
  const bool is_announced = (answer[0] & block_size_indicated) != 0;
  const bool crc_given = (answer[0] & with_crc) != 0;
  const std::size_t announced = load_u32(answer.data() + 4);
  const std::size_t longest_here = is_announced ? std::min(announced, longest) : longest;

  std::vector<std::uint8_t> out;
  unsigned taken = 0;  // of this sub-block
  bool complete = false;
  request = {block_upload | block_start};
  Repetition when = repetition();
  const auto take_stock = [&] {
    most = most == co::most_segments ? co::most_segments - 1U : co::most_segments;
    request = {static_cast<std::uint8_t>(block_upload | sub_block_taken), static_cast<std::uint8_t>(taken),
               static_cast<std::uint8_t>(most)};
    taken = 0;
    send(request, when.end);
    when.again = steady_clock::now() + when.wait;
  };
  send(request, when.end);
  for (;;) {
    const bool is_heard = receive(answer, when.next());
    if (is_heard && answer[0] == aborted) {
      throw_if_ours(answer, {.object = object, .first = false});
    } else if (is_heard) {
      if (complete && (answer[0] & upload_answer_mask) == (block_download | block_end)) break;
      const unsigned number = answer[0] & segment_number;
      const bool last = (answer[0] & last_of_block) != 0;
      if (complete || number == 0 || number > most) {
        // Ours are below 64: what is above answers other clients, or is the server's first answer once more.
        const bool names_other = number >= 0x40 && number < 0x70 && !last;
        ++(names_other ? disturbances_.foreign : disturbances_.doubled);
      } else {
        if (number == taken + 1) {
          ++taken;
          out.insert(out.end(), answer.begin() + 1, answer.end());
          if (out.size() >= longest_here + in_segment) abort(object, co::abort::too_long);
          complete = last;
          if (progress) progress(std::min(out.size(), longest_here), is_announced ? announced : out.size());
          when = repetition();
        } else if (number <= taken) {
          ++disturbances_.doubled;
        }
        if (last || number == most) take_stock();
      }
    }
    // Where some segments have come, the others are asked for.
    const auto now = steady_clock::now();
    const bool is_due = !is_heard || now >= when.next();
    if (is_due && taken != 0 && now < when.end) {
      ++disturbances_.lost;
      take_stock();
    } else {
      send_when_due(request, when, is_heard, object);
    }
  }
  const std::size_t unused = (answer[0] >> 2U) & 7U;
  out.resize(out.size() - std::min(unused, out.size()));
  const auto crc = co::crc16(0, out.data(), static_cast<std::uint32_t>(out.size()));
  if (crc_given && crc != load_u16(answer.data() + 1)) abort(object, co::abort::crc);
  if (is_announced && out.size() != announced) abort(object, co::abort::too_short);
  send({static_cast<std::uint8_t>(block_upload | block_end)}, steady_clock::now() + timeout_);
  return out;
}

std::vector<std::vector<std::uint8_t>> SdoClient::upload_from_all(ObjectAddress object) {
  await_silence();
  Payload frame{};
  frame[0] = upload_initiate;
  address(frame, object);
  const auto wait = std::max(timeout_ / 12, milliseconds(2));
  send(frame, steady_clock::now() + wait);
  std::vector<std::vector<std::uint8_t>> out;
  Payload answer;
  constexpr std::size_t enough = 8;
  const auto end = steady_clock::now() + timeout_ / 2;
  while (out.size() < enough && steady_clock::now() < end &&
         receive(answer, steady_clock::now() + (out.empty() ? wait : wait / 2))) {
    const bool same_object = std::equal(frame.begin() + 1, frame.begin() + 4, answer.begin() + 1);
    const bool is_expedited = (answer[0] & (specifier_mask | expedited)) == (upload_initiated | expedited);
    if (same_object && is_expedited) out.emplace_back(answer.begin() + 4, answer.end());
  }
  return out;
}

std::vector<std::uint8_t> SdoClient::upload(ObjectAddress object, const Progress& progress,
                                            std::size_t expected_size) {
  begin_transfer(expected_size);
  if (expected_size > in_few_segments && server_blocks_) {
    if (auto out = upload_block(object, progress)) return *std::move(out);
  }
  Payload frame{};
  frame[0] = upload_initiate;
  address(frame, object);
  const Payload initiated = exchange(frame, {object, upload_initiated});
  const bool sized = (initiated[0] & size_indicated) != 0;
  if ((initiated[0] & expedited) != 0) {
    const std::size_t unused = sized ? (initiated[0] >> 2U) & 3U : 0U;
    return {initiated.begin() + 4, initiated.end() - static_cast<std::ptrdiff_t>(unused)};
  }
  return upload_segments(object, load_u32(initiated.data() + 4), sized, progress);
}

std::vector<std::uint8_t> SdoClient::upload_segments(ObjectAddress object, std::size_t announced,
                                                     bool is_announced, const Progress& progress) {
  std::vector<std::uint8_t> out;
  const std::size_t most = is_announced ? std::min(announced, longest) : longest;
  Expected expected{object, upload_segment_given, false};
  for (bool last = false; !last;) {
    Payload frame{};
    frame[0] = static_cast<std::uint8_t>(upload_segment | expected.toggle);
    const Payload answer = exchange(frame, expected);
    const std::size_t size = in_segment - ((answer[0] >> 1U) & 7U);
    out.insert(out.end(), answer.begin() + 1, answer.begin() + 1 + static_cast<std::ptrdiff_t>(size));
    last = (answer[0] & last_segment) != 0;
    expected.toggle ^= toggle_bit;
    ++expected.segment;
    if (out.size() > most) abort(object, co::abort::too_long);
    if (progress) progress(out.size(), is_announced ? announced : out.size());
  }
  if (is_announced && out.size() != announced) {
    // The server has ended the transfer: there is nothing to abort.
    throw SdoAbort(object, co::abort::too_short, false);
  }
  return out;
}

}  // namespace flexcomp::host
