// SPDX-License-Identifier: Apache-2.0
// What a foreign controller answers to the client of a bus, in records and refusals: whatever it says, the client ends with a
// result or one of its own errors, and what it takes for a robot, a set or an active push is one. The frames below the records
// are those of libmodbus and of SdoClient (tests/host/bus/, tests/hil/disturbed_can_test.cpp).
#include <ctime>

#include "bus/transfer.hpp"
#include "flexcomp/wire/robot_record.hpp"
#include "flexcomp/wire/unit_record.hpp"
#include "host_text.hpp"
#include "model/parameter_image.hpp"

/// A client that waits is not waited for: what it asks then is what the input answers at once.
extern "C" int nanosleep(const timespec* /*requested*/, timespec* /*left*/) { return 0; }

namespace fuzz::bus_records_target {
namespace {

using namespace flexcomp::host;
namespace wire = flexcomp::wire;

/// The set of the paper with this sequence, 7 or 8.
const std::vector<std::uint8_t>& image_with(std::uint32_t sequence) {
  static const auto make = [](std::uint32_t number) {
    const Calibration calibration =
        load_calibration(path_of(file_of("tests/data/tx60l_table1.yaml")), tx60l());
    return make_image(calibration, tx60l(), number, {.allow_unnamed = true, .allow_inadmissible = true});
  };
  static const std::vector<std::uint8_t> seven = make(7), eight = make(8);
  return sequence == 7 ? seven : eight;
}

/// Answers with what the input says: each answer is a byte, what is wrong with it, then changes of the right one.
class Foreign final : public ControllerClient {
 public:
  explicit Foreign(Input& input)
      : ControllerClient(BusAddress{CanAddress{"fuzz", 1}}, {.response_timeout = std::chrono::milliseconds(0),
                                                             .write_timeout = std::chrono::milliseconds(0)}),
        input_(input),
        order_((input.u8() & 1U) != 0 ? wire::ByteOrder::big : wire::ByteOrder::little) {
    image_ = image_with(7);
    read_capability();
  }
  const flexcomp::host::Bytes& last_image() const { return last_image_; }

 protected:
  wire::ByteOrder byte_order() const override { return order_; }
  flexcomp::host::Bytes read_record(Record record, std::size_t size) override {
    flexcomp::host::Bytes bytes(size);
    if (record == Record::capability) {
      wire::Capability c;
      c.protocol = wire::protocol_version;
      c.joints = wire::joints;
      c.scalar_bytes = 8;
      c.bases = 0xFFFFFFFF;
      c.terms = c.tables = 4096;
      c.values = 4096;
      c.image_bytes = 4096;
      c.flags = input_.u8() & 1U;
      c.nominal_hash = flexcomp::nominal_hash(tx60l().nominal);
      c.name_hash = tx60l().nominal.name_hash;
      wire::encode(c, order_, bytes.data());
    } else if (record == Record::status) {
      wire::Status s;
      s.state = input_.u8() % 6;
      s.answer = input_.u8() % 12;
      s.refusal = input_.u8() % 32;
      const SetIdentity active = identity(image_);
      s.active_slot = 0;
      s.active_sequence = active.sequence;
      s.active_crc = active.crc;
      s.active_bytes = active.bytes;
      wire::encode(s, order_, bytes.data());
    } else if (record == Record::unit) {
      const std::string serial = "arm 5";
      wire::UnitRecord u;
      u.unit_hash = flexcomp::name_hash(serial.data(), serial.size());
      u.counter = input_.u8();
      u.keys = input_.u8() % 6;
      u.serial_size = static_cast<std::uint16_t>(serial.size());
      std::copy(serial.begin(), serial.end(), u.serial.begin());
      wire::encode(u, order_, bytes.data());
    } else {
      wire::encode(tx60l().nominal, tx60l().name.c_str(), tx60l().name.size(), order_, bytes.data());
    }
    disturb(bytes);
    return bytes;
  }
  void send_image(std::span<const std::uint8_t> image, const Progress& progress) override {
    progress_or_refuse(image.size(), progress);
    staged_.assign(image.begin(), image.end());
  }
  void send_command(wire::Command command, std::uint32_t) override {
    progress_or_refuse(0, {});
    if (command == wire::Command::commit || command == wire::Command::commit_trial) image_ = staged_;
  }
  flexcomp::host::Bytes read_image(std::size_t size, const Progress& progress) override {
    progress_or_refuse(size, progress);
    last_image_ = image_;
    last_image_.resize(size);
    disturb(last_image_);
    return last_image_;
  }
  flexcomp::host::Bytes exchange_probe(std::span<const std::uint8_t> request, bool with_flags) override {
    require(request.size() == wire::probe_request_bytes, "a probe of another length");
    flexcomp::host::Bytes bytes(wire::probe_response_bytes + (with_flags ? 2U : 0U));
    disturb(bytes);
    return bytes;
  }

 private:
  void progress_or_refuse(std::size_t size, const Progress& progress) {
    const unsigned what = input_.u8();
    if (what == 1) throw BusRefusal{true, false, "busy"};
    if (what == 2) throw BusRefusal{false, false, "refused"};
    if (what == 3) throw BusRefusal{false, true, "no such object"};
    if (what == 4) throw NoAnswer(where(), "silent");
    if (progress) progress(size, size);
  }
  void disturb(flexcomp::host::Bytes& bytes) {
    progress_or_refuse(0, {});
    for (unsigned changes = input_.u8() % 5; changes != 0 && !bytes.empty(); --changes) {
      const std::size_t at = input_.u16() % bytes.size();
      const Bytes by = input_.bytes(input_.u8() % 9);
      for (std::size_t k = 0; k < by.size() && at + k < bytes.size(); ++k) bytes[at + k] = by[k];
    }
  }

  Input& input_;
  wire::ByteOrder order_;
  flexcomp::host::Bytes image_;
  flexcomp::host::Bytes staged_;
  flexcomp::host::Bytes last_image_;
};

/// True where `ask` ended without an error of the bus.
template <class Ask>
bool answers(const Ask& ask) {
  bool is_answered = false;
  reads([&] {
    try {
      ask();
      is_answered = true;
    } catch (const OutcomeOpen&) {
    }
  });
  return is_answered;
}

void operate(Foreign& client, unsigned operation) {
  switch (operation % 12) {
    case 0:
      answers([&] { client.status(); });
      break;
    case 1:
      answers([&] {
        const std::optional<Robot> robot = client.robot();
        if (!robot) return;
        require(flexcomp::nominal_hash(robot->nominal) == client.capability().nominal_hash, "another robot");
        wire::detail::visit_robot(robot->nominal, [](double v) {
          require(std::isfinite(v), "a robot of numbers that are not finite");
        });
      });
      break;
    case 2:
      answers([&] {
        const flexcomp::host::Bytes image = pull_image(client);
        calibration_held(client, image, tx60l());
      });
      break;
    case 3:
    case 4: {
      const std::vector<std::uint8_t>& image = image_with(8);
      PushOptions options;
      if (operation % 12 == 4) options.trial_cycles = 10;
      if (answers([&] { push_image(client, image, options); }))
        require(client.last_image() == image, "a push is active of which other bytes were read back");
      break;
    }
    case 5:
      answers([&] { confirm_trial(client); });
      break;
    case 6:
      answers([&] { roll_back(client); });
      break;
    case 7:
      answers([&] { client.unit(); });
      break;
    case 8:
      answers([&] { refuse_other_unit(client, client.unit(), "image", {}, ""); });
      answers([&] {
        refuse_other_unit(client, client.unit(), "image", flexcomp::name_hash("arm 6", 5), "arm 6");
      });
      break;
    case 9:
      answers([&] { erase(client); });
      break;
    case 10:
      answers([&] { read_back(client, image_with(8)); });
      answers([&] { robot_of(client, ""); });
      break;
    default:
      answers([&] { client.probe({}); });
      answers([&] { refuse_beyond_capability(client, "image", image_with(8)); });
      answers([&] { next_sequence(client); });
  }
}

void run(Input input) {
  std::unique_ptr<Foreign> client;
  if (!answers([&] { client = std::make_unique<Foreign>(input); })) return;
  for (int k = 0; k < 6 && !input.is_empty(); ++k) operate(*client, input.u8());
}

std::vector<Bytes> seeds() {
  std::vector<Bytes> all;
  for (unsigned operation = 0; operation < 12; ++operation) {
    // All is right; and one byte of the first record is not.
    all.push_back(Output().u8(operation & 1U).u8(0).u8(0).u8(operation).add(Bytes(40, 0)).out);
    all.push_back(Output()
                      .u8(operation & 1U)
                      .u8(0)
                      .u8(1)
                      .u16(operation * 9)
                      .u8(1)
                      .u8(255)
                      .u8(operation)
                      .add(Bytes(20, 0))
                      .out);
    for (unsigned refusal = 1; refusal < 5; ++refusal)
      all.push_back(Output()
                        .u8(0)
                        .u8(0)
                        .u8(0)
                        .u8(operation)
                        .u8(refusal)
                        .add(Bytes(12, static_cast<std::uint8_t>(refusal)))
                        .out);
    // In any state, with any answer.
    for (unsigned state = 0; state < 6; ++state)
      all.push_back(Output()
                        .u8(0)
                        .u8(0)
                        .u8(0)
                        .u8(operation)
                        .u8(state)
                        .u8(state)
                        .u8(state * 5)
                        .u8(0)
                        .u8(0)
                        .add(Bytes(12, 0))
                        .out);
  }
  // A joint limit that is not a number: no hash speaks of it.
  all.push_back(Output().u8(0).u8(0).u8(0).u8(1).u8(0).u8(1).u16(240).u8(8).u32(0).u32(0x7FF80000).out);
  return all;
}

const Register registered({"bus_records", run, seeds, nullptr});

}  // namespace
}  // namespace fuzz::bus_records_target
