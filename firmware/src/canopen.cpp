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

const Entry* find(std::uint16_t index, std::uint8_t sub, std::uint32_t& code) {
  code = co::abort::no_object;
  for (const Entry& e : dictionary) {
    if (e.index != index) continue;
    if (e.sub == sub) {
      code = co::abort::none;
      return &e;
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
  state_ = co::NmtState::initialising;
  boot_up_ = true;
}

std::uint32_t CanopenNode::code_of(wire::Answer a) const {
  return co::abort_code(a, device_.store().refusal());
}

bool CanopenNode::staging() const { return index_ == co::image && sub_ == co::image_staging; }

/// Ends the transfer and discards what it has staged.
void CanopenNode::forget() {
  if (transfer_ == Transfer::download && staging()) device_.store().disconnect(origin_);
  transfer_ = Transfer::none;
  repeatable_ = Transfer::none;
}

void CanopenNode::reply(const std::uint8_t* frame) {
  std::memcpy(out_.data(), frame, out_.size());
  const std::uint16_t id = static_cast<std::uint16_t>(co::sdo_answer_id + settings_.node);
  pending_ = transmit_.send == nullptr || !transmit_.send(transmit_.user, id, out_.data(), 8);
}

void CanopenNode::abort(std::uint32_t code) {
  forget();
  std::uint8_t frame[8] = {0x80};
  store_u16(frame + 1, index_);
  frame[3] = sub_;
  store_u32(frame + 4, code);
  reply(frame);
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
  if (now_ms - touched_ms_ >= settings_.sdo_timeout_ms) {
    if (transfer_ != Transfer::none) abort(co::abort::timeout);
    repeatable_ = Transfer::none;
  }
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
    default:
      // Block transfer and unknown specifiers. The abort repeats the client's multiplexor.
      forget();
      index_ = load_u16(frame + 1);
      sub_ = frame[3];
      abort(co::abort::command);
  }
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
    abort(co::abort::command);
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

// Initiate upload.
//   request   byte 0: 010 00000      1-2: index   3: sub-index   4-7: 0
//   response  byte 0: 010 0 nn e s   1-2: index   3: sub-index   4-7: data (e) or size (s)
void CanopenNode::begin_upload(const std::uint8_t* frame) {
  index_ = load_u16(frame + 1);
  sub_ = frame[3];
  std::uint32_t code = co::abort::none;
  const Entry* entry = find(index_, sub_, code);
  if (entry != nullptr && entry->access == Access::wo) code = co::abort::write_only;
  std::uint32_t size = 0;
  if (code == co::abort::none) code = get(size, scratch_.data());
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
    abort(co::abort::command);
    return;
  }
  if (((frame[0] & toggle_bit) != 0) != toggle_) {
    abort(co::abort::toggle);
    return;
  }
  std::uint8_t answer[8] = {};
  const std::uint32_t n = size_ - done_ < 7 ? size_ - done_ : 7;
  if (index_ == co::image) {
    // If the active set has changed since, the segments would mix two images.
    wire::Status status;
    device_.store().status(status);
    if (status.active_crc != image_crc_ || status.active_bytes != size_ ||
        !device_.store().read_active(done_, answer + 1, n)) {
      abort(co::abort::device_state);
      return;
    }
  } else {
    std::memcpy(answer + 1, scratch_.data() + done_, n);
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

// --- objects ------------------------------------------------------------------------------------------

std::uint32_t CanopenNode::command(wire::Command command, std::uint32_t argument) {
  return code_of(device_.run(command, argument, origin_));
}

/// Writes the selected object; the size has been checked.
std::uint32_t CanopenNode::set(const std::uint8_t* bytes, std::uint32_t size) {
  switch (index_) {
    case co::store_parameters:
      if (load_u32(bytes) != co::save_signature) return co::abort::not_stored;
      return command(wire::Command::commit, 0);
    case co::restore_parameters:
      if (load_u32(bytes) != co::load_signature) return co::abort::not_stored;
      return command(wire::Command::restore_defaults, 0);
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
    case co::device_name:
    case co::software_version: {
      const char* const text = index_ == co::device_name ? "flexcomp" : firmware_version_text;
      size = static_cast<std::uint32_t>(std::strlen(text));
      std::memcpy(out, text, size);
      return co::abort::none;
    }
    case co::store_parameters:
    case co::restore_parameters:
      number = 1;  // sub 0: one sub-index; sub 1: on command
      break;
    case co::heartbeat_time:
      number = heartbeat_time_;
      break;
    case co::identity: {
      const std::uint32_t values[5] = {4, 0, co::product_code, firmware_version,
                                       load_u32(device_.robot().name_hash.data())};
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
