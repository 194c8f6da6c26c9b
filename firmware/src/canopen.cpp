// SPDX-License-Identifier: Apache-2.0
#include "flexcomp_firmware/canopen.hpp"

#include <array>
#include <cstddef>
#include <cstring>

#include "flexcomp/bytes.hpp"
#include "flexcomp/wire/canopen_dictionary.hpp"

namespace flexcomp {
namespace firmware {

namespace co = wire::canopen;
using wire::ByteOrder;

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

CanopenNode::CanopenNode(Device& device, Origin origin, const CanopenSettings& settings,
                         const CanTransmit& transmit)
    : device_(device), origin_(origin), settings_(settings), transmit_(transmit) {
  reset();
}

void CanopenNode::reset() {
  forget();
  pending_ = false;
  argument_ = 0;
  command_ = 0;
  heartbeat_time_ = settings_.heartbeat_ms;
  faults_told_ = 0;
  inhibited_ = false;
  emergency_id_ = co::emergency_id + static_cast<std::uint32_t>(settings_.node);
  emergency_inhibit_ = co::emergency_inhibit_default;
  load_communication();
  state_ = co::NmtState::initialising;
  boot_up_ = true;
}

std::uint32_t CanopenNode::code_of(wire::Answer a) const {
  return co::abort_code(a, device_.store().refusal());
}

bool CanopenNode::staging() const { return index_ == co::image && sub_ == co::image_staging; }

/// Ends the transfer and discards what it has staged.
void CanopenNode::forget() {
  const bool downloads = transfer_ == Transfer::download || transfer_ == Transfer::block_download;
  if (downloads && staging()) device_.store().disconnect(origin_);
  transfer_ = Transfer::none;
  repeatable_ = Transfer::none;
}

void CanopenNode::reply(const std::uint8_t* frame) {
  std::memcpy(out_.data(), frame, out_.size());
  const std::uint16_t id = static_cast<std::uint16_t>(co::sdo_answer_id + settings_.node);
  pending_ = transmit_.send == nullptr || !transmit_.send(transmit_.user, id, out_.data(), 8);
}

void CanopenNode::abort(std::uint32_t code) {
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
void CanopenNode::abort_without_transfer() {
  if (transfer_ == Transfer::none) {
    index_ = 0;
    sub_ = 0;
  }
  abort(co::abort::command);
}

// --- network management -------------------------------------------------------------------------------

void CanopenNode::nmt(std::uint8_t command) {
  switch (static_cast<co::NmtCommand>(command)) {
    case co::NmtCommand::start:
      state_ = co::NmtState::operational;
      break;
    case co::NmtCommand::stop:
      forget();
      state_ = co::NmtState::stopped;
      break;
    case co::NmtCommand::enter_pre_operational:
      state_ = co::NmtState::pre_operational;
      break;
    case co::NmtCommand::reset_node:
    case co::NmtCommand::reset_communication:
      // Both reset the node's communication. The control cycle continues: a restart of the network must not
      // end the compensation.
      reset();
      break;
  }
}

void CanopenNode::receive(std::uint16_t id, const std::uint8_t* bytes, std::size_t size) {
  if (id == co::nmt_id) {
    if (size == 2 && state_ != co::NmtState::initialising && (bytes[1] == 0 || bytes[1] == settings_.node)) {
      nmt(bytes[0]);
    }
    return;
  }
  if (id != co::sdo_request_id + settings_.node || size != 8) return;
  if (state_ == co::NmtState::pre_operational || state_ == co::NmtState::operational) request(bytes);
}

void CanopenNode::poll(std::uint32_t now_ms) {
  if (touched_) {
    touched_ = false;
    touched_ms_ = now_ms;
  }
  if (pending_) {
    const std::uint16_t id = static_cast<std::uint16_t>(co::sdo_answer_id + settings_.node);
    pending_ = transmit_.send == nullptr || !transmit_.send(transmit_.user, id, out_.data(), 8);
  }
  send_segments();
  const std::uint16_t heartbeat = static_cast<std::uint16_t>(co::heartbeat_id + settings_.node);
  if (boot_up_) {
    const std::uint8_t boot[1] = {static_cast<std::uint8_t>(co::NmtState::initialising)};
    if (transmit_.send == nullptr || !transmit_.send(transmit_.user, heartbeat, boot, 1)) return;
    boot_up_ = false;
    state_ = co::NmtState::pre_operational;
    heartbeat_ms_ = now_ms;
  } else if (heartbeat_time_ != 0 && now_ms - heartbeat_ms_ >= heartbeat_time_) {
    const std::uint8_t beat[1] = {static_cast<std::uint8_t>(state_)};
    if (transmit_.send != nullptr && transmit_.send(transmit_.user, heartbeat, beat, 1))
      heartbeat_ms_ = now_ms;
  }
  observe_faults();
  send_emergency(now_ms);
  if (now_ms - touched_ms_ >= settings_.sdo_timeout_ms) {
    if (transfer_ != Transfer::none) abort(co::abort::timeout);
    repeatable_ = Transfer::none;
  }
}

// --- communication parameters -------------------------------------------------------------------------

void CanopenNode::set_memory(const CanMemory& memory) {
  memory_ = memory;
  load_communication();
}

/// Takes 0x1015 and 0x1017 from the memory, where it holds a whole record.
void CanopenNode::load_communication() {
  if (memory_.load == nullptr || memory_.save == nullptr) return;
  std::uint8_t record[co::communication_bytes] = {};
  if (memory_.load(memory_.user, record) == 0) return;
  if (record[0] != 1 || record[1] != 0 || co::crc16(0, record, 6) != load_u16(record + 6)) return;
  heartbeat_time_ = load_u16(record + 2);
  emergency_inhibit_ = load_u16(record + 4);
}

/// Abort code of writing 0x1010:2 or, where the defaults are wanted, 0x1011:2. A record of version 0 holds nothing.
std::uint32_t CanopenNode::save_communication(bool defaults) {
  if (memory_.load == nullptr || memory_.save == nullptr) return co::abort::access;
  std::uint8_t record[co::communication_bytes] = {};
  if (!defaults) {
    record[0] = 1;
    store_u16(record + 2, heartbeat_time_);
    store_u16(record + 4, emergency_inhibit_);
    store_u16(record + 6, co::crc16(0, record, 6));
  }
  return memory_.save(memory_.user, record) != 0 ? co::abort::none : co::abort::hardware;
}

// --- emergencies --------------------------------------------------------------------------------------

namespace {

struct FaultCode {
  std::uint16_t fault;
  std::uint16_t code;
};

constexpr FaultCode fault_codes[] = {
    {wire::fault::storage, co::emergency_code::storage},
    {wire::fault::no_valid_set, co::emergency_code::no_valid_set},
    {wire::fault::older_slot, co::emergency_code::older_slot},
    {wire::fault::trial_reverted, co::emergency_code::trial_reverted},
};

}  // namespace

/// Puts new faults into 0x1003. One that comes and goes again and again takes one entry.
void CanopenNode::observe_faults() {
  const std::uint16_t faults = device_.store().faults();
  for (const FaultCode& f : fault_codes) {
    if ((faults & f.fault) == 0 || (faults_seen_ & f.fault) != 0) continue;
    const std::uint32_t entry = f.code | static_cast<std::uint32_t>(faults) << 16U;
    if (history_size_ != 0 && history_[0] == entry) continue;
    if (history_size_ < history_.size()) ++history_size_;
    for (std::size_t k = history_size_ - 1U; k > 0; --k) history_[k] = history_[k - 1];
    history_[0] = entry;
  }
  faults_seen_ = faults;
}

/// Sends the EMCY that is due, at most one: a fault that nobody was told of, or that some have disappeared.
void CanopenNode::send_emergency(std::uint32_t now_ms) {
  if (inhibited_ && now_ms - emergency_ms_ < (emergency_inhibit_ + 9U) / 10U) return;
  inhibited_ = false;
  if (state_ != co::NmtState::pre_operational && state_ != co::NmtState::operational) return;
  if ((emergency_id_ & co::emergency_off) != 0) return;
  const std::uint16_t faults = device_.store().faults();
  std::uint16_t told = faults_told_;
  std::uint16_t code = co::emergency_code::none;
  if ((told & ~faults) != 0) {
    told = told & faults;
  } else {
    for (const FaultCode& f : fault_codes) {
      if ((faults & ~told & f.fault) == 0) continue;
      code = f.code;
      told = told | f.fault;
      break;
    }
  }
  if (told == faults_told_) return;
  wire::Status status;
  device_.store().status(status);
  std::uint8_t frame[8] = {};
  store_u16(frame, code);
  frame[2] = faults != 0 ? 1 : 0;
  store_u16(frame + 3, faults);
  store_u16(frame + 5, status.refusal);
  const std::uint16_t id = static_cast<std::uint16_t>(emergency_id_);
  if (transmit_.send == nullptr || !transmit_.send(transmit_.user, id, frame, 8)) return;
  faults_told_ = told;
  emergency_ms_ = now_ms;
  inhibited_ = emergency_inhibit_ != 0;
}

/// Writes 0x1014: bits of the identifier change only while EMCY is off (CiA 301, 7.5.2.17).
std::uint32_t CanopenNode::set_emergency_id(std::uint32_t id) {
  constexpr std::uint32_t identifier = 0x7FF;
  if ((id & ~(co::emergency_off | identifier)) != 0 || co::is_restricted(id & identifier))
    return co::abort::value;
  const bool same = ((id ^ emergency_id_) & identifier) == 0;
  if (!same && (emergency_id_ & co::emergency_off) == 0) return co::abort::value;
  emergency_id_ = id;
  return co::abort::none;
}

// --- SDO server ---------------------------------------------------------------------------------------

/// Whether the object of an initiate request can be uploaded and has at most 4 bytes. Its upload is one frame and has no
/// state, so it is served while a transfer runs: a master that polls such an object over the only channel that it knows
/// does not disturb the client whose transfer it is.
bool CanopenNode::is_small(const std::uint8_t* frame) {
  std::uint32_t code = co::abort::none;
  const Entry* entry = find(load_u16(frame + 1), frame[3], code);
  return entry != nullptr && entry->access != Access::wo && entry->size != 0 && entry->size <= 4;
}

void CanopenNode::upload_beside(const std::uint8_t* frame) {
  const std::uint16_t index = index_;
  const std::uint8_t sub = sub_;
  index_ = load_u16(frame + 1);
  sub_ = frame[3];
  std::uint8_t answer[8] = {};
  std::uint32_t size = 0;
  const std::uint32_t code = get(size, answer + 4);
  answer[0] = code == co::abort::none ? static_cast<std::uint8_t>(0x43U | ((4U - size) << 2U)) : 0x80U;
  if (code != co::abort::none) store_u32(answer + 4, code);
  std::memcpy(answer + 1, frame + 1, 3);
  index_ = index;
  sub_ = sub;
  reply(answer);
}

void CanopenNode::request(const std::uint8_t* frame) {
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
      if (settings_.block_size == 0) break;
      if ((frame[0] & 1U) == 0) {
        begin_block_download(frame);
      } else {
        end_block_download(frame);
      }
      return;
    case request_specifier::block_upload:
      if (settings_.block_size == 0) break;
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
std::uint32_t CanopenNode::accept(std::uint32_t size, bool known) {
  std::uint32_t code = co::abort::none;
  const Entry* entry = find(index_, sub_, code);
  if (entry == nullptr) return code;
  if (entry->access == Access::ro) return co::abort::read_only;
  if (staging()) {
    if (!known) return code_of(device_.begin_unknown(origin_));
    if (size == 0) return co::abort::too_short;
    return code_of(device_.run(wire::Command::begin, size, origin_));
  }
  if (known && size > entry->size) return co::abort::too_long;
  if (known && size < entry->size) return co::abort::too_short;
  return co::abort::none;
}

/// Stores the next bytes of a download.
std::uint32_t CanopenNode::take(const std::uint8_t* bytes, std::uint32_t size) {
  if (size_known_ && size > size_ - done_) return co::abort::too_long;
  if (staging()) {
    const std::uint32_t code = code_of(device_.store().write(done_, bytes, size, origin_));
    if (code != co::abort::none) return code;
  } else {
    if (size > scratch_.size() - done_) return co::abort::too_long;
    std::memcpy(scratch_.data() + done_, bytes, size);
  }
  done_ += size;
  return co::abort::none;
}

/// Ends a download: checks its size and writes the object.
std::uint32_t CanopenNode::complete() {
  if (size_known_ && done_ != size_) return co::abort::too_short;
  if (staging()) {
    if (done_ == 0) return co::abort::too_short;
    return code_of(device_.store().end(origin_));
  }
  std::uint32_t code = co::abort::none;
  const Entry* entry = find(index_, sub_, code);
  if (entry == nullptr) return code;
  if (done_ > entry->size) return co::abort::too_long;
  if (done_ < entry->size) return co::abort::too_short;
  return set(scratch_.data(), done_);
}

// Initiate download (CiA 301, 7.2.4.3). n: bytes without data, e: expedited, s: size indicated.
//   request   byte 0: 001 0 nn e s   1-2: index   3: sub-index   4-7: data (e) or size (s)
//   response  byte 0: 011 00000      1-2: index   3: sub-index   4-7: 0
void CanopenNode::begin_download(const std::uint8_t* frame) {
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
void CanopenNode::download_segment(const std::uint8_t* frame) {
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
/// the image.
std::uint32_t CanopenNode::start_upload(std::uint32_t& size) {
  std::uint32_t code = co::abort::none;
  const Entry* entry = find(index_, sub_, code);
  if (entry == nullptr) return code;
  if (entry->access == Access::wo) return co::abort::write_only;
  return get(size, scratch_.data());
}

/// Copies bytes of the object that is uploaded. False where the active set has changed since the upload began: the segments
/// would mix two images.
bool CanopenNode::read_segment(std::uint32_t offset, std::uint8_t* to, std::uint32_t size) {
  if (index_ != co::image) {
    std::memcpy(to, scratch_.data() + offset, size);
    return true;
  }
  wire::Status status;
  device_.store().status(status);
  return status.active_crc == image_crc_ && status.active_bytes == size_ &&
         device_.store().read_active(offset, to, size);
}

// Initiate upload.
//   request   byte 0: 010 00000      1-2: index   3: sub-index   4-7: 0
//   response  byte 0: 010 0 nn e s   1-2: index   3: sub-index   4-7: data (e) or size (s)
void CanopenNode::begin_upload(const std::uint8_t* frame) {
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
void CanopenNode::upload_segment(const std::uint8_t* frame) {
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

// --- SDO blocks ---------------------------------------------------------------------------------------

namespace {

/// Sub-commands of a block transfer, bits 1 … 0 of the first byte.
constexpr std::uint8_t block_subcommand = 3;
constexpr std::uint8_t block_initiate = 0;
constexpr std::uint8_t block_ended = 1;
constexpr std::uint8_t block_taken = 2;

constexpr std::uint8_t last_of_block = 0x80;
constexpr std::uint8_t segment_number = 0x7F;

/// Segments of a sub-block of a download: it alternates with one less, which must not be one.
std::uint8_t segments_taken(const CanopenSettings& settings) {
  if (settings.block_size > co::most_segments) return co::most_segments;
  return settings.block_size < 3 ? std::uint8_t{3} : settings.block_size;
}

/// Whether a request starts the block upload of an object that there is. Its first byte could also be that of the last
/// segment of a download, number 32 or 36; three more bytes would have to name an object and two to be 0.
bool starts_block_upload(const std::uint8_t* frame) {
  if ((frame[0] & 0xFBU) != 0xA0U || frame[4] == 0 || frame[4] > 127 || frame[6] != 0 || frame[7] != 0)
    return false;
  std::uint32_t code = co::abort::none;
  return find(load_u16(frame + 1), frame[3], code) != nullptr;
}

}  // namespace

/// Whether a request is a segment of the block download that runs. Its numbers are below 64, those of the frames that
/// start uploads, block downloads and their ends are not. Once the last one is here, only copies of it and late ones
/// come. The client may be another one, that knows nothing of the transfer.
bool CanopenNode::is_block_segment(const std::uint8_t* frame) const {
  if (transfer_ != Transfer::block_download || frame[0] == last_of_block) return false;
  if ((frame[0] & segment_number) > co::most_segments) return false;
  if (starts_block_upload(frame)) return false;
  return block_ == Block::segments || frame[0] < last_of_block ||
         std::memcmp(segment_.data(), frame, segment_.size()) == 0;
}

/// Whether a request is one of the segments that were under way when this node has aborted their transfer: they are not
/// answered, as each of them would be another request.
bool CanopenNode::is_leftover(const std::uint8_t* frame) {
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
void CanopenNode::begin_block_download(const std::uint8_t* frame) {
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
  block_size_ = segments_taken(settings_);
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
void CanopenNode::block_segment(const std::uint8_t* frame) {
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
void CanopenNode::acknowledge(const std::uint8_t* frame) {
  acknowledged_ = sequence_;
  sequence_ = 0;
  const std::uint8_t most = segments_taken(settings_);
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
void CanopenNode::end_block_download(const std::uint8_t* frame) {
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
void CanopenNode::block_upload(const std::uint8_t* frame) {
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
void CanopenNode::begin_block_upload(const std::uint8_t* frame) {
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
void CanopenNode::block_acknowledged(const std::uint8_t* frame) {
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
void CanopenNode::send_segments() {
  const std::uint16_t id = static_cast<std::uint16_t>(co::sdo_answer_id + settings_.node);
  for (unsigned k = 0; k < segments_per_call; ++k) {
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
    if (transmit_.send == nullptr || !transmit_.send(transmit_.user, id, segment, 8)) return;
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
void CanopenNode::end_block_upload() {
  block_ = Block::end;
  const unsigned unused = (7U - size_ % 7U) % 7U;
  std::uint8_t answer[8] = {static_cast<std::uint8_t>(0xC1U | (unused << 2U))};
  store_u16(answer + 1, with_crc_ ? crc_ : std::uint16_t{0});
  reply(answer);
}

// --- objects ------------------------------------------------------------------------------------------

std::uint32_t CanopenNode::command(wire::Command command, std::uint32_t argument) {
  return code_of(device_.run(command, argument, origin_));
}

/// Writes the selected object; the size has been checked.
std::uint32_t CanopenNode::set(const std::uint8_t* bytes, std::uint32_t size) {
  switch (index_) {
    case co::store_parameters:
      if (load_u32(bytes) != co::save_signature) return co::abort::not_stored;
      if (sub_ == co::communication_parameters) return save_communication(false);
      return command(wire::Command::commit, 0);
    case co::restore_parameters:
      if (load_u32(bytes) != co::load_signature) return co::abort::not_stored;
      if (sub_ == co::communication_parameters) return save_communication(true);
      return command(wire::Command::restore_defaults, 0);
    case co::error_history:
      if (bytes[0] != 0) return co::abort::value;
      history_size_ = 0;
      return co::abort::none;
    case co::emergency:
      return set_emergency_id(load_u32(bytes));
    case co::emergency_inhibit:
      emergency_inhibit_ = load_u16(bytes);
      return co::abort::none;
    case co::heartbeat_time:
      heartbeat_time_ = load_u16(bytes);
      return co::abort::none;
    case co::command:
      if (sub_ == co::command_argument) {
        argument_ = load_u32(bytes);
        return co::abort::none;
      }
      command_ = load_u16(bytes);
      return command(static_cast<wire::Command>(command_), argument_);
    case co::probe: {
      std::memcpy(probe_request_.data(), bytes, size);
      wire::ProbeRequest probe;
      wire::decode(probe_request_.data(), ByteOrder::little, probe);
      wire::encode(device_.probe(probe), ByteOrder::little, probe_response_.data());
      return co::abort::none;
    }
    default:
      return co::abort::read_only;
  }
}

/// Copies the value of the selected object to `out`, at least 4 bytes; of the active image only its size.
std::uint32_t CanopenNode::get(std::uint32_t& size, std::uint8_t* out) {
  std::uint32_t code = co::abort::none;
  const Entry* entry = find(index_, sub_, code);
  if (entry == nullptr) return code;
  size = entry->size;
  std::uint32_t number = 0;
  switch (index_) {
    case co::device_type:
      break;
    case co::error_register:
      number = device_.store().faults() != 0 ? 1U : 0U;
      break;
    case co::error_history:
      if (sub_ > history_size_) return co::abort::no_data;
      number = sub_ == 0 ? history_size_ : history_[sub_ - 1U];
      break;
    case co::emergency:
      number = emergency_id_;
      break;
    case co::emergency_inhibit:
      number = emergency_inhibit_;
      break;
    case co::device_name:
    case co::software_version: {
      const char* const text = index_ == co::device_name ? "flexcomp" : firmware_version_text;
      size = static_cast<std::uint32_t>(std::strlen(text));
      std::memcpy(out, text, size);
      return co::abort::none;
    }
    case co::store_parameters:
    case co::restore_parameters:
      // Sub 0: two sub-indices; sub 1 and 2: on command.
      number = sub_ == 0 ? 2U : 1U;
      if (sub_ == co::communication_parameters && (memory_.load == nullptr || memory_.save == nullptr))
        number = 0;
      break;
    case co::heartbeat_time:
      number = heartbeat_time_;
      break;
    case co::identity: {
      const Robot& robot = device_.robot();
      const Sha256Digest& hash = is_given(robot.unit_hash) ? robot.unit_hash : robot.name_hash;
      const std::uint32_t values[5] = {4, 0, co::product_code, firmware_version, load_u32(hash.data())};
      number = values[sub_];
      break;
    }
    case co::sdo_server: {
      const std::uint32_t values[3] = {2, co::sdo_request_id + static_cast<std::uint32_t>(settings_.node),
                                       co::sdo_answer_id + static_cast<std::uint32_t>(settings_.node)};
      number = values[sub_];
      break;
    }
    case co::capability:
      wire::encode(device_.capability(), ByteOrder::little, out);
      return co::abort::none;
    case co::status:
      wire::encode(device_.status(), ByteOrder::little, out);
      return co::abort::none;
    case co::robot:
      device_.robot_record(ByteOrder::little, out);
      return co::abort::none;
    case co::unit:
      wire::encode(device_.unit(), ByteOrder::little, out);
      return co::abort::none;
    case co::certificate:
      wire::encode(device_.certificate(), ByteOrder::little, out);
      return co::abort::none;
    case co::certificate_summary:
      number = sub_ == 0 ? 9U : device_.certificate_summary(sub_);
      break;
    case co::status_summary: {
      const wire::Status s = device_.status();
      const std::uint32_t values[8] = {7,        s.state,           s.answer, s.refusal,
                                       s.faults, s.active_sequence, s.detail, s.trial_cycles_left};
      number = values[sub_];
      break;
    }
    case co::image:
      if (sub_ == co::image_active) {
        wire::Status status;
        device_.store().status(status);
        size = status.active_bytes;
        image_crc_ = status.active_crc;
        return size == 0 ? co::abort::no_data : co::abort::none;
      }
      number = 2;
      break;
    case co::command:
      number = sub_ == 0 ? 2U : sub_ == co::command_argument ? argument_ : command_;
      break;
    case co::probe:
      if (sub_ == co::probe_request) std::memcpy(out, probe_request_.data(), probe_request_.size());
      if (sub_ == co::probe_response) std::memcpy(out, probe_response_.data(), probe_response_.size());
      if (sub_ != 0) return co::abort::none;
      number = 2;
      break;
    case co::corrections:
      number = 7;
      if (sub_ != 0) {
        const float v = device_.correction_deg(sub_ - 1U);
        std::memcpy(&number, &v, sizeof number);
      }
      break;
    default:
      return co::abort::no_object;
  }
  store_u32(out, number);
  return co::abort::none;
}

}  // namespace firmware
}  // namespace flexcomp
