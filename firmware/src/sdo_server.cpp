// SPDX-License-Identifier: Apache-2.0
#include "flexcomp_firmware/sdo_server.hpp"

#include <cstring>

#include "flexcomp/bytes.hpp"
#include "flexcomp_firmware/canopen.hpp"

namespace flexcomp {
namespace firmware {

namespace co = wire::canopen;

namespace {

using co::Access;

/// Entry of the object dictionary as it is served; size 0 where it varies.
struct Entry {
  std::uint16_t index;
  std::uint8_t sub;
  Access access;
  std::uint16_t size;
};

/// The dictionary without names, made at compile time so that they take no flash.
constexpr std::array<Entry, co::object_count> served() {
  std::array<Entry, co::object_count> out{};
  for (std::size_t k = 0; k < co::object_count; ++k) {
    const co::Object& o = co::objects[k];
    out[k] = Entry{o.index, o.sub, o.access == Access::constant ? Access::ro : o.access, o.size};
  }
  return out;
}
constexpr std::array<Entry, co::object_count> dictionary = served();

constexpr bool is_sorted_by_index() {
  for (std::size_t k = 1; k < co::object_count; ++k) {
    if (co::objects[k].index < co::objects[k - 1].index) return false;
  }
  return true;
}
static_assert(is_sorted_by_index(), "find() halves the table");

const Entry* find(std::uint16_t index, std::uint8_t sub, std::uint32_t& code) {
  std::size_t first = 0;
  for (std::size_t end = dictionary.size(); first < end;) {
    const std::size_t middle = (first + end) / 2;
    if (dictionary[middle].index < index) {
      first = middle + 1;
    } else {
      end = middle;
    }
  }
  code = co::abort::no_object;
  for (; first < dictionary.size() && dictionary[first].index == index; ++first) {
    if (dictionary[first].sub == sub) {
      code = co::abort::none;
      return &dictionary[first];
    }
    code = co::abort::no_sub_index;
  }
  return nullptr;
}

/// SDO command specifiers (CiA 301, 7.2.4.3), bits 7 … 5 of the first byte.
namespace request_specifier {
constexpr unsigned download_segment = 0;
constexpr unsigned begin_download = 1;
constexpr unsigned begin_upload = 2;
constexpr unsigned upload_segment = 3;
constexpr unsigned abort = 4;
constexpr unsigned block_upload = 5;
constexpr unsigned block_download = 6;
}  // namespace request_specifier

constexpr std::uint8_t toggle_bit = 0x10;

}  // namespace

void SdoServer::reset(const SdoIdentifiers& identifiers) {
  forget();
  pending_ = false;
  identifiers_ = identifiers;
  objects_.argument = 0;
  objects_.command = 0;
}

std::uint32_t SdoServer::code_of(wire::Answer a) const {
  return co::abort_code(a, node_.device_.store().refusal());
}

bool SdoServer::staging() const { return index_ == co::image && sub_ == co::image_staging; }

void SdoServer::forget() {
  const bool downloads = transfer_ == Transfer::download || transfer_ == Transfer::block_download;
  if (downloads && staging()) node_.device_.store().disconnect(origin_);
  transfer_ = Transfer::none;
  repeatable_ = Transfer::none;
}

bool SdoServer::send(const std::uint8_t* frame) { return node_.send(identifiers_.answer, frame, 8); }

void SdoServer::reply(const std::uint8_t* frame) {
  std::memcpy(out_.data(), frame, out_.size());
  pending_ = !send(out_.data());
}

void SdoServer::poll(std::uint32_t now_ms) {
  if (touched_) {
    touched_ = false;
    touched_ms_ = now_ms;
  }
  if (pending_) pending_ = !send(out_.data());
  send_segments();
  if (now_ms - touched_ms_ >= node_.settings_.sdo_timeout_ms) {
    if (transfer_ != Transfer::none) abort(co::abort::timeout);
    repeatable_ = Transfer::none;
  }
}

void SdoServer::abort(std::uint32_t code) {
  const bool in_sub_block = transfer_ == Transfer::block_download && block_ == Block::segments;
  leftover_ = sequence_;
  leftovers_ = in_sub_block ? block_size_ : std::uint8_t{0};
  forget();
  std::uint8_t frame[8] = {0x80};
  store_u16(frame + 1, index_);
  frame[3] = sub_;
  store_u32(frame + 4, code);
  reply(frame);
}

/// Answers what only fits another transfer than the one that runs. Where none does, it is about no object: a client that
/// begins the next one must not take it for the answer.
void SdoServer::abort_without_transfer() {
  if (transfer_ == Transfer::none) {
    index_ = 0;
    sub_ = 0;
  }
  abort(co::abort::command);
}

// --- transfers ----------------------------------------------------------------------------------------

/// Whether the object of an initiate request can be uploaded and has at most 4 bytes. Its upload is one frame and has no
/// state, so it is served while a transfer runs: a master that polls such an object over the only channel that it knows
/// does not disturb the client whose transfer it is.
bool SdoServer::is_small(const std::uint8_t* frame) {
  std::uint32_t code = co::abort::none;
  const Entry* entry = find(load_u16(frame + 1), frame[3], code);
  return entry != nullptr && entry->access != Access::wo && entry->size != 0 && entry->size <= 4;
}

void SdoServer::upload_beside(const std::uint8_t* frame) {
  std::uint8_t answer[8] = {};
  std::uint32_t size = 0;
  std::uint32_t code = co::abort::none;
  const Entry* entry = find(load_u16(frame + 1), frame[3], code);
  if (entry != nullptr) {
    size = entry->size;
    code = node_.get(*this, entry->index, entry->sub, size, answer + 4);
  }
  answer[0] = code == co::abort::none ? static_cast<std::uint8_t>(0x43U | ((4U - size) << 2U)) : 0x80U;
  if (code != co::abort::none) store_u32(answer + 4, code);
  std::memcpy(answer + 1, frame + 1, 3);
  reply(answer);
}

void SdoServer::request(const std::uint8_t* frame) {
  const bool polls = frame[0] >> 5U == request_specifier::begin_upload;
  if (transfer_ != Transfer::none && polls && is_small(frame)) {
    // Does not prolong a transfer that its client has left.
    upload_beside(frame);
    return;
  }
  if (is_block_segment(frame)) {
    block_segment(frame);
    return;
  }
  if (is_leftover(frame)) return;
  touched_ = true;
  switch (frame[0] >> 5U) {
    case request_specifier::download_segment:
      download_segment(frame);
      return;
    case request_specifier::begin_download:
      forget();
      begin_download(frame);
      return;
    case request_specifier::begin_upload:
      forget();
      begin_upload(frame);
      return;
    case request_specifier::upload_segment:
      upload_segment(frame);
      return;
    case request_specifier::abort:
      forget();
      return;
    case request_specifier::block_download:
      if (node_.settings_.block_size == 0) break;
      if ((frame[0] & 1U) == 0) {
        begin_block_download(frame);
      } else {
        end_block_download(frame);
      }
      return;
    case request_specifier::block_upload:
      if (node_.settings_.block_size == 0) break;
      block_upload(frame);
      return;
    default:
      break;
  }
  // What is not served. The abort repeats the client's multiplexor.
  forget();
  index_ = load_u16(frame + 1);
  sub_ = frame[3];
  abort(co::abort::command);
}

/// Abort code of a download of this size to the object, `none` where it is accepted.
std::uint32_t SdoServer::accept(std::uint32_t size, bool known) {
  std::uint32_t code = co::abort::none;
  const Entry* entry = find(index_, sub_, code);
  if (entry == nullptr) return code;
  if (entry->access == Access::ro) return co::abort::read_only;
  if (staging()) {
    if (!known) return code_of(node_.device_.begin_unknown(origin_));
    if (size == 0) return co::abort::too_short;
    return code_of(node_.device_.run(wire::Command::begin, size, origin_));
  }
  if (known && size > entry->size) return co::abort::too_long;
  if (known && size < entry->size) return co::abort::too_short;
  return co::abort::none;
}

/// Stores the next bytes of a download.
std::uint32_t SdoServer::take(const std::uint8_t* bytes, std::uint32_t size) {
  if (size_known_ && size > size_ - done_) return co::abort::too_long;
  if (staging()) {
    const std::uint32_t code = code_of(node_.device_.store().write(done_, bytes, size, origin_));
    if (code != co::abort::none) return code;
  } else {
    if (size > scratch_.size() - done_) return co::abort::too_long;
    std::memcpy(scratch_.data() + done_, bytes, size);
  }
  done_ += size;
  return co::abort::none;
}

/// Ends a download: checks its size and writes the object.
std::uint32_t SdoServer::complete() {
  if (size_known_ && done_ != size_) return co::abort::too_short;
  if (staging()) {
    if (done_ == 0) return co::abort::too_short;
    return code_of(node_.device_.store().end(origin_));
  }
  std::uint32_t code = co::abort::none;
  const Entry* entry = find(index_, sub_, code);
  if (entry == nullptr) return code;
  if (done_ > entry->size) return co::abort::too_long;
  if (done_ < entry->size) return co::abort::too_short;
  return node_.set(*this, index_, sub_, scratch_.data(), done_);
}

// Initiate download (CiA 301, 7.2.4.3). n: bytes without data, e: expedited, s: size indicated.
//   request   byte 0: 001 0 nn e s   1-2: index   3: sub-index   4-7: data (e) or size (s)
//   response  byte 0: 011 00000      1-2: index   3: sub-index   4-7: 0
void SdoServer::begin_download(const std::uint8_t* frame) {
  const bool expedited = (frame[0] & 2U) != 0;
  const bool sized = (frame[0] & 1U) != 0;
  index_ = load_u16(frame + 1);
  sub_ = frame[3];
  done_ = 0;
  toggle_ = false;
  size_known_ = sized || expedited;
  std::uint32_t code = co::abort::none;
  if (expedited) {
    size_ = 4;
    if (sized) {
      size_ = 4U - ((frame[0] >> 2U) & 3U);
    } else {
      const Entry* entry = find(index_, sub_, code);
      if (entry != nullptr && entry->size != 0 && entry->size < 4) size_ = entry->size;
    }
  } else {
    size_ = sized ? load_u32(frame + 4) : 0;
  }
  code = accept(size_, size_known_);
  if (code != co::abort::none) {
    abort(code);
    return;
  }
  transfer_ = Transfer::download;
  if (expedited) {
    code = take(frame + 4, size_);
    if (code == co::abort::none) code = complete();
    if (code != co::abort::none) {
      abort(code);
      return;
    }
    transfer_ = Transfer::none;
  }
  std::uint8_t answer[8] = {0x60};
  store_u16(answer + 1, index_);
  answer[3] = sub_;
  reply(answer);
}

// Download segment. t: toggle, n: bytes without data, c: last segment.
//   request   byte 0: 000 t nnn c    1-7: data
//   response  byte 0: 001 t 0000     1-7: 0
// The segment before once more, byte for byte, is one that was doubled, or whose response was lost: it is not stored
// again, its response is repeated.
void SdoServer::download_segment(const std::uint8_t* frame) {
  std::uint8_t answer[8] = {static_cast<std::uint8_t>(0x20U | (frame[0] & toggle_bit))};
  if (repeatable_ == Transfer::download && std::memcmp(segment_.data(), frame, segment_.size()) == 0) {
    reply(answer);
    return;
  }
  if (transfer_ != Transfer::download) {
    abort_without_transfer();
    return;
  }
  if (((frame[0] & toggle_bit) != 0) != toggle_) {
    abort(co::abort::toggle);
    return;
  }
  std::uint32_t code = take(frame + 1, 7U - ((frame[0] >> 1U) & 7U));
  const bool last = (frame[0] & 1U) != 0;
  if (code == co::abort::none && last) code = complete();
  if (code != co::abort::none) {
    abort(code);
    return;
  }
  if (last) transfer_ = Transfer::none;
  toggle_ = !toggle_;
  repeatable_ = Transfer::download;
  std::memcpy(segment_.data(), frame, segment_.size());
  reply(answer);
}

/// Abort code of an upload of the selected object; where it is `none`, its size, and its value in scratch_ unless it is
/// the image or the robot.
std::uint32_t SdoServer::start_upload(std::uint32_t& size) {
  std::uint32_t code = co::abort::none;
  const Entry* entry = find(index_, sub_, code);
  if (entry == nullptr) return code;
  if (entry->access == Access::wo) return co::abort::write_only;
  size = entry->size;
  if (index_ == co::image && sub_ == co::image_active) {
    wire::Status status;
    node_.device_.store().status(status);
    size = status.active_bytes;
    image_crc_ = status.active_crc;
    return size == 0 ? co::abort::no_data : co::abort::none;
  }
  return index_ == co::robot ? co::abort::none : node_.get(*this, index_, sub_, size, scratch_.data());
}

/// Copies bytes of the object that is uploaded. False where the active set has changed since the upload began: the segments
/// would mix two images.
bool SdoServer::read_segment(std::uint32_t offset, std::uint8_t* to, std::uint32_t size) {
  if (index_ == co::robot) {
    node_.device_.robot_record_part(offset, to, size);
    return true;
  }
  if (index_ != co::image || sub_ != co::image_active) {
    std::memcpy(to, scratch_.data() + offset, size);
    return true;
  }
  wire::Status status;
  node_.device_.store().status(status);
  return status.active_crc == image_crc_ && status.active_bytes == size_ &&
         node_.device_.store().read_active(offset, to, size);
}

// Initiate upload.
//   request   byte 0: 010 00000      1-2: index   3: sub-index   4-7: 0
//   response  byte 0: 010 0 nn e s   1-2: index   3: sub-index   4-7: data (e) or size (s)
void SdoServer::begin_upload(const std::uint8_t* frame) {
  index_ = load_u16(frame + 1);
  sub_ = frame[3];
  std::uint32_t size = 0;
  const std::uint32_t code = start_upload(size);
  if (code != co::abort::none) {
    abort(code);
    return;
  }
  std::uint8_t answer[8] = {0x41};
  store_u16(answer + 1, index_);
  answer[3] = sub_;
  if (size <= 4) {
    answer[0] = static_cast<std::uint8_t>(0x43U | ((4U - size) << 2U));
    std::memcpy(answer + 4, scratch_.data(), size);
  } else {
    store_u32(answer + 4, size);
    transfer_ = Transfer::upload;
    size_ = size;
    done_ = 0;
    toggle_ = false;
  }
  reply(answer);
}

// Upload segment.
//   request   byte 0: 011 t 0000     1-7: 0
//   response  byte 0: 000 t nnn c    1-7: data
// The response before is repeated where its request comes once more.
void SdoServer::upload_segment(const std::uint8_t* frame) {
  if (repeatable_ == Transfer::upload && (segment_[0] & toggle_bit) == (frame[0] & toggle_bit)) {
    reply(segment_.data());
    return;
  }
  if (transfer_ != Transfer::upload) {
    abort_without_transfer();
    return;
  }
  if (((frame[0] & toggle_bit) != 0) != toggle_) {
    abort(co::abort::toggle);
    return;
  }
  std::uint8_t answer[8] = {};
  const std::uint32_t n = size_ - done_ < 7 ? size_ - done_ : 7;
  if (!read_segment(done_, answer + 1, n)) {
    abort(co::abort::device_state);
    return;
  }
  done_ += n;
  const bool last = done_ == size_;
  answer[0] = static_cast<std::uint8_t>((toggle_ ? toggle_bit : 0U) | ((7U - n) << 1U) | (last ? 1U : 0U));
  toggle_ = !toggle_;
  if (last) transfer_ = Transfer::none;
  repeatable_ = Transfer::upload;
  std::memcpy(segment_.data(), answer, segment_.size());
  reply(answer);
}

// --- blocks -------------------------------------------------------------------------------------------

namespace {

/// Sub-commands of a block transfer, bits 1 … 0 of the first byte.
constexpr std::uint8_t block_subcommand = 3;
constexpr std::uint8_t block_initiate = 0;
constexpr std::uint8_t block_ended = 1;
constexpr std::uint8_t block_taken = 2;

constexpr std::uint8_t last_of_block = 0x80;
constexpr std::uint8_t segment_number = 0x7F;

/// Whether a request starts the block upload of an object that there is. Its first byte could also be that of the last
/// segment of a download, number 32 or 36; three more bytes would have to name an object and two to be 0.
bool starts_block_upload(const std::uint8_t* frame) {
  if ((frame[0] & 0xFBU) != 0xA0U || frame[4] == 0 || frame[4] > 127 || frame[6] != 0 || frame[7] != 0)
    return false;
  std::uint32_t code = co::abort::none;
  return find(load_u16(frame + 1), frame[3], code) != nullptr;
}

}  // namespace

/// Segments of a sub-block of a download: it alternates with one less, which must not be one.
std::uint8_t SdoServer::segments_taken() const {
  const std::uint8_t most = node_.settings_.block_size;
  if (most > co::most_segments) return co::most_segments;
  return most < 3 ? std::uint8_t{3} : most;
}

/// Whether a request is a segment of the block download that runs. Its numbers are below 64, those of the frames that
/// start uploads, block downloads and their ends are not. Once the last one is here, only copies of it and late ones
/// come. The client may be another one, that knows nothing of the transfer.
bool SdoServer::is_block_segment(const std::uint8_t* frame) const {
  if (transfer_ != Transfer::block_download || frame[0] == last_of_block) return false;
  if ((frame[0] & segment_number) > co::most_segments) return false;
  if (starts_block_upload(frame)) return false;
  return block_ == Block::segments || frame[0] < last_of_block ||
         std::memcmp(segment_.data(), frame, segment_.size()) == 0;
}

/// Whether a request is one of the segments that were under way when this node has aborted their transfer: they are not
/// answered, as each of them would be another request.
bool SdoServer::is_leftover(const std::uint8_t* frame) {
  const unsigned number = frame[0] & segment_number;
  if (leftover_ >= leftovers_ || number != leftover_ + 1U) {
    leftovers_ = 0;
    return false;
  }
  ++leftover_;
  return true;
}

// Initiate block download. cc, sc: the client, the server makes a CRC; s: size indicated.
//   request   byte 0: 110 00 cc s 0   1-2: index   3: sub-index   4-7: size (s)
//   response  byte 0: 101 00 sc 00    1-2: index   3: sub-index   4: segments of the sub-block
void SdoServer::begin_block_download(const std::uint8_t* frame) {
  forget();
  index_ = load_u16(frame + 1);
  sub_ = frame[3];
  done_ = 0;
  size_known_ = (frame[0] & 2U) != 0;
  with_crc_ = (frame[0] & 4U) != 0;
  size_ = size_known_ ? load_u32(frame + 4) : 0;
  const std::uint32_t code = accept(size_, size_known_);
  if (code != co::abort::none) {
    abort(code);
    return;
  }
  transfer_ = Transfer::block_download;
  block_ = Block::segments;
  block_size_ = segments_taken();
  sequence_ = 0;
  crc_ = 0;
  std::uint8_t answer[8] = {0xA4};
  std::memcpy(answer + 1, frame + 1, 3);
  answer[4] = block_size_;
  reply(answer);
}

// Segment of a block download. c: last segment.
//   request   byte 0: c, number of the segment (7 bits)   1-7: data
//   response, after the sub-block   byte 0: 101 000 10    1: last segment taken   2: segments of the next sub-block
// Segments out of order are passed over; the client sends what follows the last one taken once more. The last segment is
// kept until the end of the transfer says how many of its bytes count.
void SdoServer::block_segment(const std::uint8_t* frame) {
  const unsigned number = frame[0] & segment_number;
  const bool last = frame[0] >= last_of_block;
  // The segment that was acknowledged at last comes again: it was doubled, or the response was lost. It is not the
  // first of the next sub-block, as no sub-block but the last has one segment only.
  const bool again = repeatable_ == Transfer::block_download && sequence_ == 0 &&
                     std::memcmp(segment_.data(), frame, segment_.size()) == 0;
  if (again && (block_ == Block::end || number != 1)) {
    const std::uint8_t answer[8] = {0xA2, acknowledged_, block_size_};
    reply(answer);
    return;
  }
  if (block_ == Block::end) return;
  if (number == 0) {
    abort(co::abort::sequence);
    return;
  }
  if (number > block_size_) return;
  const bool next = number == sequence_ + 1U;
  if (next) {
    touched_ = true;
    ++sequence_;
    std::uint32_t code = co::abort::none;
    if (!last) {
      code = take(frame + 1, 7);
      crc_ = co::crc16(crc_, frame + 1, 7);
    }
    if (code != co::abort::none) {
      abort(code);
      return;
    }
  }
  if (next && last) block_ = Block::end;
  if (last || number == block_size_) acknowledge(frame);
}

/// Answers the last segment of a sub-block, `frame`.
void SdoServer::acknowledge(const std::uint8_t* frame) {
  acknowledged_ = sequence_;
  sequence_ = 0;
  const std::uint8_t most = segments_taken();
  block_size_ = static_cast<std::uint8_t>(block_size_ == most ? most - 1 : most);
  repeatable_ = Transfer::block_download;
  std::memcpy(segment_.data(), frame, segment_.size());
  const std::uint8_t answer[8] = {0xA2, acknowledged_, block_size_};
  reply(answer);
}

// End of a block download. n: bytes of the last segment without data.
//   request   byte 0: 110 nnn 01   1-2: CRC
//   response  byte 0: 101 000 01
// The request once more, where the response was lost, is answered again.
void SdoServer::end_block_download(const std::uint8_t* frame) {
  const std::uint8_t answer[8] = {0xA1};
  if (transfer_ == Transfer::none && repeatable_ == Transfer::block_download &&
      std::memcmp(segment_.data(), frame, segment_.size()) == 0) {
    reply(answer);
    return;
  }
  if (transfer_ != Transfer::block_download || block_ != Block::end) {
    abort_without_transfer();
    return;
  }
  const std::uint32_t size = 7U - ((frame[0] >> 2U) & 7U);
  std::uint32_t code = take(segment_.data() + 1, size);
  crc_ = co::crc16(crc_, segment_.data() + 1, size);
  if (code == co::abort::none && size_known_ && done_ != size_) code = co::abort::too_short;
  if (code == co::abort::none && with_crc_ && crc_ != load_u16(frame + 1)) code = co::abort::crc;
  if (code == co::abort::none) code = complete();
  if (code != co::abort::none) {
    abort(code);
    return;
  }
  transfer_ = Transfer::none;
  repeatable_ = Transfer::block_download;
  std::memcpy(segment_.data(), frame, segment_.size());
  reply(answer);
}

/// Requests of a block upload, by their sub-command. One that does not fit where the transfer is, is a copy, or answers one.
void SdoServer::block_upload(const std::uint8_t* frame) {
  const unsigned subcommand = frame[0] & block_subcommand;
  if (subcommand == block_initiate) {
    begin_block_upload(frame);
    return;
  }
  if (transfer_ != Transfer::block_upload) {
    // The end of an upload is not answered; a copy of it neither.
    if (transfer_ != Transfer::none || subcommand != block_ended) abort_without_transfer();
    return;
  }
  if (subcommand == block_taken) {
    block_acknowledged(frame);
    return;
  }
  if (subcommand == block_ended) {
    if (block_ == Block::end) {
      transfer_ = Transfer::none;
    } else {
      abort(co::abort::command);
    }
    return;
  }
  // Sub-command 3, start. Once more where all segments of the first sub-block were lost.
  const bool all_sent = sequence_ == block_size_ || done_ + 7U * sequence_ >= size_;
  if (block_ == Block::segments && done_ == 0 && all_sent) sequence_ = 0;
  if (block_ == Block::initiated) block_ = Block::segments;
  send_segments();
}

// Initiate block upload. pst: size up to which the server may answer as to 010.
//   request   byte 0: 101 00 cc 00    1-2: index   3: sub-index   4: segments of a sub-block   5: pst
//   response  byte 0: 110 00 sc s 0   1-2: index   3: sub-index   4-7: size
//   request   byte 0: 101 000 11
void SdoServer::begin_block_upload(const std::uint8_t* frame) {
  forget();
  index_ = load_u16(frame + 1);
  sub_ = frame[3];
  std::uint32_t size = 0;
  std::uint32_t code = start_upload(size);
  if (code == co::abort::none && (frame[4] == 0 || frame[4] > 127)) code = co::abort::block_size;
  if (code != co::abort::none) {
    abort(code);
    return;
  }
  if (frame[5] != 0 && size <= frame[5]) {
    begin_upload(frame);
    return;
  }
  transfer_ = Transfer::block_upload;
  block_ = Block::initiated;
  with_crc_ = (frame[0] & 4U) != 0;
  alternating_ = false;
  block_size_ = frame[4];
  size_ = size;
  done_ = 0;
  sequence_ = 0;
  highest_ = 0;
  crc_ = 0;
  crc_bytes_ = 0;
  segment_ = {};
  std::uint8_t answer[8] = {0xC6};
  std::memcpy(answer + 1, frame + 1, 3);
  store_u32(answer + 4, size);
  reply(answer);
}

// Response of the client to a sub-block.
//   request   byte 0: 101 000 10   1: last segment taken   2: segments of the next sub-block
// A copy of the response before, where sizes alternate, is passed over while the sub-block goes out; after that it says that
// nothing of the sub-block has arrived.
void SdoServer::block_acknowledged(const std::uint8_t* frame) {
  if (block_ == Block::end) {
    end_block_upload();
    return;
  }
  if (alternating_ && std::memcmp(segment_.data(), frame, segment_.size()) == 0) {
    const bool all_sent = sequence_ == block_size_ || done_ + 7U * sequence_ >= size_;
    if (all_sent) sequence_ = 0;
    send_segments();
    return;
  }
  if (frame[1] > highest_) {
    abort(co::abort::sequence);
    return;
  }
  if (frame[2] == 0 || frame[2] > 127) {
    abort(co::abort::block_size);
    return;
  }
  alternating_ = frame[2] != block_size_;
  std::memcpy(segment_.data(), frame, segment_.size());
  const std::uint32_t taken = 7U * frame[1];
  done_ = taken < size_ - done_ ? done_ + taken : size_;
  block_size_ = frame[2];
  sequence_ = 0;
  highest_ = 0;
  if (done_ == size_) {
    end_block_upload();
    return;
  }
  block_ = Block::segments;
  send_segments();
}

/// Sends segments of a block upload until the sub-block is out, the queue is full, or there were segments_per_call.
//   byte 0: c, number of the segment (7 bits)   1-7: data
void SdoServer::send_segments() {
  for (unsigned k = 0; k < CanopenNode::segments_per_call; ++k) {
    if (transfer_ != Transfer::block_upload || block_ != Block::segments || pending_) return;
    const std::uint32_t offset = done_ + 7U * sequence_;
    if (sequence_ == block_size_ || offset >= size_) return;
    const std::uint32_t n = size_ - offset < 7 ? size_ - offset : 7;
    std::uint8_t segment[8] = {static_cast<std::uint8_t>(sequence_ + 1U)};
    if (offset + n == size_) segment[0] = static_cast<std::uint8_t>(segment[0] | last_of_block);
    if (!read_segment(offset, segment + 1, n)) {
      abort(co::abort::device_state);
      return;
    }
    if (!send(segment)) return;
    touched_ = true;
    ++sequence_;
    if (sequence_ > highest_) highest_ = sequence_;
    if (offset == crc_bytes_) {
      crc_ = co::crc16(crc_, segment + 1, n);
      crc_bytes_ += n;
    }
  }
}

// End of a block upload.
//   byte 0: 110 nnn 01   1-2: CRC, or 0 where the client makes none
//   request, which is not answered   byte 0: 101 000 01
void SdoServer::end_block_upload() {
  block_ = Block::end;
  const unsigned unused = (7U - size_ % 7U) % 7U;
  std::uint8_t answer[8] = {static_cast<std::uint8_t>(0xC1U | (unused << 2U))};
  store_u16(answer + 1, with_crc_ ? crc_ : std::uint16_t{0});
  reply(answer);
}

}  // namespace firmware
}  // namespace flexcomp
