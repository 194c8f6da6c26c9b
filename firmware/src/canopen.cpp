// SPDX-License-Identifier: Apache-2.0
#include "flexcomp_firmware/canopen.hpp"

#include <cstring>

#include "flexcomp/bytes.hpp"

namespace flexcomp {
namespace firmware {

namespace co = wire::canopen;
using wire::ByteOrder;

namespace {

constexpr std::uint32_t identifier_bits = 0x7FF;

/// A time in units of 100 us that has passed for certain, ms.
std::uint32_t rounded_up_ms(std::uint16_t time) { return (time + 9U) / 10U; }

}  // namespace

CanopenNode::CanopenNode(Device& device, Origin origin, const CanopenSettings& settings,
                         const CanTransmit& transmit)
    : device_(device),
      settings_(settings),
      transmit_(transmit),
      servers_{{{*this, origin}, {*this, origin + second_origin}}} {
  reset();
}

void CanopenNode::reset() {
  const std::uint32_t node = settings_.node;
  servers_[0].reset({co::sdo_request_id + node, co::sdo_answer_id + node});
  servers_[1].reset(channel_);
  heartbeat_time_ = settings_.heartbeat_ms;
  faults_told_ = 0;
  inhibited_ = false;
  emergency_id_ = co::emergency_id + node;
  emergency_inhibit_ = co::emergency_inhibit_default;
  pdo_id_ = co::not_valid | co::no_remote_frames | (co::pdo_id + node);
  pdo_type_ = co::pdo_event_driven;
  pdo_inhibit_ = co::pdo_inhibit_default;
  pdo_timer_ms_ = 0;
  pdo_sent_ = false;
  load_communication();
  state_ = co::NmtState::initialising;
  boot_up_ = true;
}

// --- network management -------------------------------------------------------------------------------

void CanopenNode::nmt(std::uint8_t command) {
  switch (static_cast<co::NmtCommand>(command)) {
    case co::NmtCommand::start:
      state_ = co::NmtState::operational;
      break;
    case co::NmtCommand::stop:
      for (SdoServer& server : servers_) server.forget();
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
  if (!communicates() || size != 8) return;
  for (SdoServer& server : servers_) {
    if (server.takes(id)) server.request(bytes);
  }
}

/// Whether SDO and EMCY may go out (CiA 301, 7.3.2.2.3).
bool CanopenNode::communicates() const {
  return state_ == co::NmtState::pre_operational || state_ == co::NmtState::operational;
}

bool CanopenNode::send(std::uint32_t id, const std::uint8_t* bytes, std::uint8_t size) {
  return transmit_.send != nullptr &&
         transmit_.send(transmit_.user, static_cast<std::uint16_t>(id & identifier_bits), bytes, size);
}

void CanopenNode::poll(std::uint32_t now_ms) {
  const std::uint32_t heartbeat = co::heartbeat_id + static_cast<std::uint32_t>(settings_.node);
  if (boot_up_) {
    const std::uint8_t boot[1] = {static_cast<std::uint8_t>(co::NmtState::initialising)};
    if (!send(heartbeat, boot, 1)) return;
    boot_up_ = false;
    state_ = co::NmtState::pre_operational;
    heartbeat_ms_ = now_ms;
  } else if (heartbeat_time_ != 0 && now_ms - heartbeat_ms_ >= heartbeat_time_) {
    const std::uint8_t beat[1] = {static_cast<std::uint8_t>(state_)};
    if (send(heartbeat, beat, 1)) heartbeat_ms_ = now_ms;
  }
  observe_faults();
  send_emergency(now_ms);
  send_pdo(now_ms);
  for (SdoServer& server : servers_) server.poll(now_ms);
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
  if (inhibited_ && now_ms - emergency_ms_ < rounded_up_ms(emergency_inhibit_)) return;
  inhibited_ = false;
  if (!communicates() || (emergency_id_ & co::not_valid) != 0) return;
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
  if (!send(emergency_id_, frame, 8)) return;
  faults_told_ = told;
  emergency_ms_ = now_ms;
  inhibited_ = emergency_inhibit_ != 0;
}

// --- process data -------------------------------------------------------------------------------------

/// Sends the TPDO that is due: the first one in operational, one for each change, and after the event timer; with the
/// inhibit time between (CiA 301, 7.5.2.37).
void CanopenNode::send_pdo(std::uint32_t now_ms) {
  if (state_ != co::NmtState::operational || (pdo_id_ & co::not_valid) != 0) {
    pdo_sent_ = false;
    return;
  }
  const std::uint32_t since_ms = now_ms - pdo_ms_;
  if (pdo_sent_ && since_ms < rounded_up_ms(pdo_inhibit_)) return;
  const wire::Status status = device_.status();
  std::array<std::uint8_t, 8> frame{};
  frame[0] = static_cast<std::uint8_t>(status.state);
  frame[1] = static_cast<std::uint8_t>(status.last_status);
  store_u16(frame.data() + 2, status.faults);
  store_u32(frame.data() + 4, status.active_sequence);
  const bool is_due = pdo_timer_ms_ != 0 && since_ms >= pdo_timer_ms_;
  const bool is_same = std::memcmp(frame.data(), pdo_.data(), frame.size()) == 0;
  if ((pdo_sent_ && is_same && !is_due) || !send(pdo_id_, frame.data(), 8)) return;
  pdo_ = frame;
  pdo_sent_ = true;
  pdo_ms_ = now_ms;
}

// --- identifiers --------------------------------------------------------------------------------------

/// Writes a COB-ID of 11 bits. Its identifier changes only while bit 31 is set (CiA 301, 7.5.2.17, .33 and .37), and is none
/// that is restricted or that another service of this node has. `fixed`: bits besides that are as they are.
std::uint32_t CanopenNode::set_identifier(std::uint32_t& which, std::uint32_t value, std::uint32_t fixed) {
  if (((value ^ fixed) & ~(co::not_valid | identifier_bits)) != 0) return co::abort::value;
  const bool same = ((value ^ which) & identifier_bits) == 0;
  if (!same && (which & co::not_valid) == 0) return co::abort::value;
  if ((value & co::not_valid) == 0) {
    if (co::is_restricted(value & identifier_bits)) return co::abort::value;
    SdoIdentifiers& channel = servers_[1].identifiers();
    for (const std::uint32_t* other : {&emergency_id_, &pdo_id_, &channel.request, &channel.answer}) {
      const bool taken =
          (*other & co::not_valid) == 0 && ((*other ^ value) & identifier_bits) == 0 && other != &which;
      if (taken) return co::abort::value;
    }
  }
  which = value;
  return co::abort::none;
}

bool CanopenNode::set_channel(std::uint32_t request_id, std::uint32_t answer_id) {
  servers_[1].reset({});
  channel_ = {};
  SdoIdentifiers& now = servers_[1].identifiers();
  if (((request_id | answer_id) & co::not_valid) != 0 ||
      set_identifier(now.request, request_id, 0) != co::abort::none ||
      set_identifier(now.answer, answer_id, 0) != co::abort::none) {
    now = {};
    return false;
  }
  channel_ = now;
  return true;
}

// --- objects ------------------------------------------------------------------------------------------

std::uint32_t CanopenNode::command(const SdoServer& by, wire::Command command, std::uint32_t argument) {
  const wire::Answer answer = device_.run(command, argument, by.origin());
  return co::abort_code(answer, device_.store().refusal());
}

/// Writes an object; the size has been checked.
std::uint32_t CanopenNode::set(SdoServer& by, std::uint16_t index, std::uint8_t sub,
                               const std::uint8_t* bytes, std::uint32_t size) {
  ClientObjects& client = by.objects();
  switch (index) {
    case co::store_parameters:
      if (load_u32(bytes) != co::save_signature) return co::abort::not_stored;
      if (sub == co::communication_parameters) return save_communication(false);
      return command(by, wire::Command::commit, 0);
    case co::restore_parameters:
      if (load_u32(bytes) != co::load_signature) return co::abort::not_stored;
      if (sub == co::communication_parameters) return save_communication(true);
      return command(by, wire::Command::restore_defaults, 0);
    case co::error_history:
      if (bytes[0] != 0) return co::abort::value;
      history_size_ = 0;
      return co::abort::none;
    case co::emergency:
      return set_identifier(emergency_id_, load_u32(bytes), 0);
    case co::emergency_inhibit:
      emergency_inhibit_ = load_u16(bytes);
      return co::abort::none;
    case co::heartbeat_time:
      heartbeat_time_ = load_u16(bytes);
      return co::abort::none;
    case co::command:
      if (sub == co::command_argument) {
        client.argument = load_u32(bytes);
        return co::abort::none;
      }
      client.command = load_u16(bytes);
      return command(by, static_cast<wire::Command>(client.command), client.argument);
    case co::probe:
      std::memcpy(client.probe_request.data(), bytes, size);
      client.is_asked = true;
      return co::abort::none;
    case co::sdo_channel: {
      SdoIdentifiers& now = servers_[1].identifiers();
      const std::uint32_t code = set_identifier(sub == 1 ? now.request : now.answer, load_u32(bytes), 0);
      // What is under way has no channel any more.
      if (((now.request | now.answer) & co::not_valid) != 0) servers_[1].forget();
      return code;
    }
    case co::pdo:
      return set_pdo(sub, bytes);
    default:
      return co::abort::read_only;
  }
}

/// Writes a communication parameter of the TPDO (CiA 301, 7.5.2.37).
std::uint32_t CanopenNode::set_pdo(std::uint8_t sub, const std::uint8_t* bytes) {
  switch (sub) {
    case co::pdo_cob_id:
      return set_identifier(pdo_id_, load_u32(bytes), co::no_remote_frames);
    case co::pdo_transmission:
      if (bytes[0] < co::pdo_event_driven) return co::abort::value;
      pdo_type_ = bytes[0];
      return co::abort::none;
    case co::pdo_inhibit:
      if ((pdo_id_ & co::not_valid) == 0) return co::abort::value;
      pdo_inhibit_ = load_u16(bytes);
      return co::abort::none;
    default:
      pdo_timer_ms_ = load_u16(bytes);
      return co::abort::none;
  }
}

/// Copies the value of an object to `out`, at least 4 bytes. `size` is that of the dictionary, and that of the value
/// where it varies. Image and robot are read by the server.
std::uint32_t CanopenNode::get(SdoServer& by, std::uint16_t index, std::uint8_t sub, std::uint32_t& size,
                               std::uint8_t* out) {
  ClientObjects& client = by.objects();
  std::uint32_t number = 0;
  switch (index) {
    case co::device_type:
      break;
    case co::error_register:
      number = device_.store().faults() != 0 ? 1U : 0U;
      break;
    case co::error_history:
      if (sub > history_size_) return co::abort::no_data;
      number = sub == 0 ? history_size_ : history_[sub - 1U];
      break;
    case co::emergency:
      number = emergency_id_;
      break;
    case co::emergency_inhibit:
      number = emergency_inhibit_;
      break;
    case co::device_name:
    case co::software_version: {
      const char* const text = index == co::device_name ? "flexcomp" : firmware_version_text;
      size = static_cast<std::uint32_t>(std::strlen(text));
      std::memcpy(out, text, size);
      return co::abort::none;
    }
    case co::store_parameters:
    case co::restore_parameters:
      // Sub 0: two sub-indices; sub 1 and 2: on command.
      number = sub == 0 ? 2U : 1U;
      if (sub == co::communication_parameters && (memory_.load == nullptr || memory_.save == nullptr))
        number = 0;
      break;
    case co::heartbeat_time:
      number = heartbeat_time_;
      break;
    case co::identity: {
      const Robot& robot = device_.robot();
      const Sha256Digest& hash = is_given(robot.unit_hash) ? robot.unit_hash : robot.name_hash;
      const std::uint32_t values[5] = {4, 0, co::product_code, firmware_version, load_u32(hash.data())};
      number = values[sub];
      break;
    }
    case co::sdo_server:
    case co::sdo_channel: {
      const SdoIdentifiers& server = servers_[index - co::sdo_server].identifiers();
      const std::uint32_t values[3] = {2, server.request, server.answer};
      number = values[sub];
      break;
    }
    case co::pdo: {
      const std::uint32_t values[6] = {5, pdo_id_, pdo_type_, pdo_inhibit_, 0, pdo_timer_ms_};
      number = values[sub];
      break;
    }
    case co::pdo_mapping:
      number = sub == 0 ? static_cast<std::uint32_t>(co::pdo_mapped.size()) : co::pdo_mapped[sub - 1U];
      break;
    case co::capability:
      wire::encode(device_.capability(), ByteOrder::little, out);
      return co::abort::none;
    case co::status:
      wire::encode(device_.status(), ByteOrder::little, out);
      return co::abort::none;
    case co::unit:
      wire::encode(device_.unit(), ByteOrder::little, out);
      return co::abort::none;
    case co::certificate:
      wire::encode(device_.certificate(), ByteOrder::little, out);
      return co::abort::none;
    case co::certificate_summary:
      number = sub == 0 ? 9U : device_.certificate_summary(sub);
      break;
    case co::status_summary: {
      const wire::Status s = device_.status();
      const std::uint32_t values[10] = {9,        s.state,           s.answer, s.refusal,
                                        s.faults, s.active_sequence, s.detail, s.trial_cycles_left,
                                        s.state,  s.last_status};
      number = values[sub];
      break;
    }
    case co::image:
      number = 2;
      break;
    case co::command:
      number = sub == 0 ? 2U : sub == co::command_argument ? client.argument : client.command;
      break;
    case co::probe:
      number = sub == 0 ? 3U : client.probe_flags;
      if (sub == 0 || sub == co::probe_flags) break;
      if (sub == co::probe_request) {
        std::memcpy(out, client.probe_request.data(), size);
      } else if (client.is_asked) {
        wire::ProbeRequest request;
        wire::decode(client.probe_request.data(), ByteOrder::little, request);
        const wire::ProbeResponse response = device_.probe(request);
        wire::encode(response, ByteOrder::little, out);
        client.probe_flags = response.flags;
      } else {
        std::memset(out, 0, size);
      }
      return co::abort::none;
    case co::corrections:
      number = 7;
      if (sub != 0) {
        const float v = device_.correction_deg(sub - 1U);
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
