// SPDX-License-Identifier: Apache-2.0
// The program against a controller that knows its unit and whom it trusts: exit status, words, JSON, and what was sent.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <stdlib.h>
#include <sys/wait.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>

#include "files/calibration_file.hpp"
#include "host/bus/bus_fake_modbus.hpp"
#include "support/robot_files.hpp"
#include "support/text_file.hpp"

namespace authorised_commands {

using namespace flexcomp;        // NOLINT(google-build-using-namespace)
using namespace flexcomp::host;  // NOLINT(google-build-using-namespace)
using nlohmann::json;
using support::path_of;
using support::read;
using testing::HasSubstr;
using testing::Not;

constexpr std::uint64_t hour_ms = 3600000;

std::uint64_t now_ms() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::milliseconds>(now).count());
}

/// What a command answered.
struct Said {
  int status = 0;
  std::string text;  ///< both streams
};

class Authorised : public testing::Test {
 protected:
  void SetUp() override {
    fake::Controller& device = server_.device;
    const Robot& arm = support::tx60l();
    device.robot = arm.nominal;
    device.name = arm.name;
    device.capability.nominal_hash = nominal_hash(arm.nominal);
    device.capability.name_hash = arm.nominal.name_hash;
    const std::string text = read(support::robots + "tx60l.yaml");
    robot_ = support::write("r.yaml", text + "serial: 'A-1'\n");
    other_ = support::write("other.yaml", text + "serial: 'B-2'\n");
    plain_ = support::write("plain.yaml", text);
    cal_ = support::write("c.yaml", "geometric: [{link: 2, a_mm: 0.3}]\n");
    std::filesystem::remove(path_of("k.key"));
    std::filesystem::remove(path_of("k.key.pub"));
    key_.write(path_of("k.key"));
    std::filesystem::remove(path_of("stranger.key"));
    std::filesystem::remove(path_of("stranger.key.pub"));
    stranger_.write(path_of("stranger.key"));
    std::filesystem::remove(path_of("j.json"));
  }

  /// Runs the program; {bus}, {robot}, {cal}, {key} … stand for what their names say.
  Said run(const std::string& command, const std::string& input = "</dev/null") {
    commands().clear();
    std::string line = command;
    const std::array<std::array<std::string, 2>, 8> words{{{"{bus}", server_.address().text()},
                                                           {"{robot}", robot_},
                                                           {"{other}", other_},
                                                           {"{plain}", plain_},
                                                           {"{cal}", cal_},
                                                           {"{key}", path_of("k.key")},
                                                           {"{stranger}", path_of("stranger.key")},
                                                           {"{dir}", path_of("")}}};
    for (const auto& [name, value] : words) {
      for (std::size_t at = 0; (at = line.find(name)) != std::string::npos;)
        line.replace(at, name.size(), value);
    }
    line = fmt::format("setsid {}/flexcomp {} --json {} 2>&1 {}", FLEXCOMP_BIN_DIR, line, path_of("j.json"),
                       input);
    Said out;
    std::FILE* const pipe = ::popen(line.c_str(), "r");
    std::array<char, 4096> buffer{};
    for (std::size_t n = 0; (n = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0;)
      out.text.append(buffer.data(), n);
    const int ended = ::pclose(pipe);
    out.status = WIFEXITED(ended) ? WEXITSTATUS(ended) : -1;
    return out;
  }

  /// Refused with these words, and no command went out.
  void refused(const std::string& command, int status, const std::vector<std::string>& words) {
    const Said said = run(command);
    EXPECT_EQ(said.status, status) << command << "\n" << said.text;
    for (const std::string& word : words) EXPECT_THAT(said.text, HasSubstr(word)) << command;
    EXPECT_TRUE(commands().empty()) << command << "\n" << said.text;
    if (status == 4) {
      EXPECT_EQ(result()["outcome"], "refused") << command;
    }
  }

  Said done(const std::string& command) {
    Said said = run(command);
    EXPECT_EQ(said.status, 0) << command << "\n" << said.text;
    return said;
  }

  static json result() { return json::parse(read(path_of("j.json"))); }
  std::vector<wire::Command>& commands() { return server_.device.commands; }
  fake::Controller& device() { return server_.device; }

  fake::ModbusServer server_{false};
  SigningKey key_ = SigningKey::generate();
  SigningKey stranger_ = SigningKey::generate();
  std::string robot_, other_, plain_, cal_;
};

TEST_F(Authorised, ASignedSetIsPushedAndShown) {
  device().belongs_to("A-1", {key_.public_key()});
  const std::uint64_t before = now_ms();
  Said said = done("push --to {bus} --key {key} --robot {robot} {cal} --dry-run");
  EXPECT_TRUE(commands().empty());
  EXPECT_THAT(said.text, HasSubstr("for unit 'A-1', signed with key " + text(key_.id()) + ", counter "));
  EXPECT_EQ(result()["serial"], "A-1");
  EXPECT_EQ(result()["key_id"], text(key_.id()));
  EXPECT_GE(result()["counter"].get<std::uint64_t>(), before);

  said = done("push --to {bus} --key {key} --robot {robot} {cal}");
  EXPECT_EQ(result()["outcome"], "active");
  EXPECT_EQ(result()["serial"], "A-1");
  EXPECT_EQ(result()["key_id"], text(key_.id()));
  EXPECT_EQ(result()["counter"], device().unit.counter);
  EXPECT_GE(device().unit.counter, before);
  EXPECT_LE(device().unit.counter, now_ms());
  EXPECT_TRUE(is_signed_by(device().active, key_.public_key()));
  const ImageRecords first = image_records(device().active, "");
  EXPECT_EQ(first.unit_hash, name_hash("A-1", 3));

  // Settled without sending: the signature of the file's set would be another one.
  said = done("push --to {bus} --key {key} --robot {robot} {cal} --resume");
  EXPECT_TRUE(commands().empty()) << said.text;
  EXPECT_THAT(said.text, HasSubstr("equal but for its signature"));
  EXPECT_EQ(result()["sent"], false);
  EXPECT_EQ(image_records(device().active, "").counter, first.counter);
  EXPECT_EQ(result()["bytes"], device().active.size());
  EXPECT_EQ(result()["outcome"], "active");
  // Another set is sent.
  cal_ = support::write("c2.yaml", "geometric: [{link: 2, a_mm: 0.4}]\n");
  done("push --to {bus} --key {key} --robot {robot} {cal} --resume");
  EXPECT_EQ(result()["sent"], true);
  EXPECT_GT(image_records(device().active, "").counter, first.counter);

  // A pulled image is bound and signed already; it is signed anew.
  done("pull --from {bus} --image {dir}i.bin -o {dir}pulled.yaml");
  refused("push --to {bus} {dir}i.bin", 4, {"was signed with the counter", "--key", "nothing was sent"});
  said = run("push --to {bus} {dir}i.bin --key {key} --sequence 9");
  EXPECT_GT(image_records(device().active, "").counter, first.counter);
}

TEST_F(Authorised, APushIsRefusedBeforeItIsSent) {
  // Who is asked for comes from the user.
  refused("push --to {bus} --key {key} {cal}", 2, {"--robot (with --key)"});
  refused("push --to {bus} --key {key} --robot {plain} {cal}", 3,
          {"plain.yaml: serial: expected the serial number"});
  refused("push --to {bus} --key {key} --confirm", 2, {"--key"});
  refused("push --key {key} --dry-run --against {cal} --robot {robot} {cal}", 2, {"--key"});
  refused("push --to {bus} --counter 7 {cal}", 2, {"--counter", "--key"});
  refused("push --to {bus} --key {key}.pub --robot {robot} {cal}", 3, {"found a public key"});
  refused("push --to {bus} --key {dir}none.key --robot {robot} {cal}", 3, {"none.key"});
  // Firmware of before.
  refused("push --to {bus} --robot {robot} {cal}", 4,
          {"unit 'A-1'", "cannot check", "serial number out of the robot file"});
  refused("push --to {bus} --key {key} --robot {robot} {cal}", 4, {"cannot check"});
  refused("push --to {bus} --dry-run --robot {robot} {cal}", 4, {"cannot check"});

  device().belongs_to("A-1", {key_.public_key()});
  refused("push --to {bus} --robot {robot} {cal}", 4, {"takes only signed sets", "--key", text(key_.id())});
  refused("push --to {bus} {cal}", 4, {"takes only signed sets"});
  refused("push --to {bus} --key {stranger} --robot {robot} {cal}", 4,
          {"trusts one key (" + text(key_.id()) + "), not " + text(stranger_.id())});
  refused("push --to {bus} --key {key} --robot {other} {cal}", 4, {"unit 'B-2'", "unit 'A-1'"});
  refused("push --to {bus} --robot {other} {cal}", 4, {"unit 'B-2'", "unit 'A-1'"});
  EXPECT_TRUE(device().active.empty());
  // Of more keys than it lists it may trust one more.
  device().unit.keys = 6;
  device().unit.key_ids.fill(id_of(PublicKey{}));
  done("push --to {bus} --key {key} --robot {robot} {cal}");
  Said said = run("pull --from {bus} -o {dir}p.yaml --robot {other}");
  EXPECT_EQ(said.status, 4);
  EXPECT_THAT(said.text, HasSubstr("other.yaml is unit 'B-2', the controller belongs to unit 'A-1'"));
  said = run("push --to {bus} --key {stranger} --robot {robot} {cal}");
  EXPECT_EQ(said.status, 4);
  EXPECT_THAT(said.text, HasSubstr("refused: "));
  EXPECT_THAT(said.text, HasSubstr("signed with a key that the controller does not trust"));
}

TEST_F(Authorised, ASetForAnotherUnitIsRefusedAsAnImageToo) {
  Robot b = support::tx60l();
  set_serial(b, "B-2");
  const std::vector<std::uint8_t> image = make_image(load_calibration(cal_, b), b, 3);
  const std::string file = support::write("b.bin", {image.begin(), image.end()});
  device().belongs_to("A-1");
  refused("push --to {bus} " + file, 4, {hex(b.nominal.unit_hash).substr(0, 12), "unit 'A-1'"});
  refused("push --to {bus} --dry-run " + file, 3, {"b.bin", "unit 'A-1'"});
  device().belongs_to("B-2");
  done("push --to {bus} " + file);
  EXPECT_EQ(device().active, image);
  // Whoever has no serial number takes none of them.
  device().unit.unit_hash = {};
  device().unit.serial_size = 0;
  refused("push --to {bus} --sequence 8 --robot {robot} {cal}", 4, {"unit 'A-1'", "without a serial number"});
}

TEST_F(Authorised, CountersAreNotGoneOnFromBlindly) {
  device().belongs_to("A-1", {key_.public_key()});
  const std::string push = "push --to {bus} --key {key} --robot {robot} {cal} ";
  device().unit.counter = now_ms() + hour_ms;
  const std::uint64_t ahead = device().unit.counter;
  done(push);
  EXPECT_EQ(device().unit.counter, ahead + 1);
  device().unit.counter = now_ms() + 30 * hour_ms;
  const std::uint64_t far = device().unit.counter;
  refused(push, 4, {"more than a day ahead", fmt::format("--counter {}", far + 1)});
  refused(push + "--dry-run", 4, {"more than a day ahead"});
  refused(push + fmt::format("--counter {}", far), 4, {"is not above"});
  done(push + fmt::format("--counter {}", far + 5));
  EXPECT_EQ(device().unit.counter, far + 5);
  device().unit.counter = std::numeric_limits<std::uint64_t>::max();
  refused(push, 4, {"more than a day ahead"});
  refused(push + "--counter 18446744073709551615", 4, {"is not above"});
  refused(push + "--counter -1", 2, {"--counter"});
  refused(push + "--counter 18446744073709551616", 2, {"--counter"});
}

TEST_F(Authorised, RollbackUnlocksOrIsSigned) {
  const auto fill = [this] {
    device().previous = fake::numbered_image(40, 6);
    device().activate(fake::numbered_image(50, 7));
  };
  // Firmware of before asks for nothing.
  fill();
  done("rollback --at {bus}");
  EXPECT_EQ(commands(), std::vector{wire::Command::rollback});
  // No key is trusted.
  fill();
  device().belongs_to("A-1");
  done("rollback --at {bus} --robot {robot}");
  EXPECT_EQ(commands(), (std::vector{wire::Command::unlock, wire::Command::unlock, wire::Command::rollback}));
  EXPECT_EQ(result()["outcome"], "active");
  EXPECT_EQ(result()["sequence"], 6);
  EXPECT_EQ(result()["dropped"], 7);
  fill();
  refused("rollback --at {bus} --key {key}", 4, {"trusts no key"});
  refused("rollback --at {bus} --robot {other}", 4, {"unit 'B-2'", "unit 'A-1'"});
  // Out of a trial nobody is asked.
  device().status.state = static_cast<std::uint16_t>(wire::StoreState::trial);
  done("rollback --at {bus}");
  EXPECT_EQ(commands(), std::vector{wire::Command::rollback});

  device().belongs_to("A-1", {key_.public_key()});
  fill();
  const Said said = run("rollback --at {bus}");
  EXPECT_EQ(said.status, 4);
  EXPECT_THAT(said.text, HasSubstr("refused: "));
  EXPECT_THAT(said.text, HasSubstr("not authorised at the controller: it takes only signed commands"));
  EXPECT_THAT(said.text,
              HasSubstr("it trusts one key (" + text(key_.id()) + "), and --key signs the command"));
  EXPECT_EQ(result()["outcome"], "refused");
  EXPECT_EQ(device().status.active_sequence, 7U);
  refused("rollback --at {bus} --key {stranger}", 4, {"not " + text(stranger_.id())});
  done("rollback --at {bus} --key {key} --robot {robot}");
  EXPECT_EQ(device().status.active_sequence, 6U);
  EXPECT_EQ(result()["key_id"], text(key_.id()));
  EXPECT_EQ(result()["counter"], device().unit.counter);
  EXPECT_EQ(commands(), (std::vector{wire::Command::begin, wire::Command::verify, wire::Command::rollback}));
  // The same counter again is refused by the controller, and nothing stays staged.
  fill();
  device().unit.counter += hour_ms;
  const std::uint64_t counter = device().unit.counter;
  refused(fmt::format("rollback --at {{bus}} --key {{key}} --counter {}", counter), 4, {"is not above"});
  done(fmt::format("rollback --at {{bus}} --key {{key}} --counter {}", counter + 1));
}

TEST_F(Authorised, EraseAsksFirst) {
  device().belongs_to("A-1", {key_.public_key()});
  const auto fill = [this] {
    device().previous = fake::numbered_image(40, 6);
    device().activate(fake::numbered_image(50, 7));
  };
  fill();
  refused("erase --at {bus}", 2, {"--yes"});
  Said said = run("erase --at {bus} --yes");
  EXPECT_EQ(said.status, 4);
  EXPECT_THAT(said.text, HasSubstr("--key signs the command"));
  EXPECT_EQ(device().status.active_sequence, 7U);
  done("erase --at {bus} --yes --key {key}");
  EXPECT_EQ(result()["outcome"], "active");
  EXPECT_TRUE(device().active.empty() && device().previous.empty());
  device().belongs_to("A-1");
  fill();
  done("erase --at {bus} --yes");
  EXPECT_TRUE(device().active.empty());
  // On a terminal: its name, or nothing happens.
  for (const std::string name : {"staubli-tx60", "", "staubli-tx60l"}) {
    fill();
    commands().clear();
    const std::string line = fmt::format("printf '{}\\n' | script -qec '{}/flexcomp erase --at {}' /dev/null",
                                         name, FLEXCOMP_BIN_DIR, server_.address().text());
    const int ended = std::system(line.c_str());
    const bool right = name == "staubli-tx60l";
    EXPECT_EQ(WEXITSTATUS(ended), right ? 0 : 2);
    EXPECT_EQ(device().active.empty(), right);
    EXPECT_EQ(commands().empty(), !right);
  }
}

TEST_F(Authorised, StatusAndTrustTellWhomAControllerTrusts) {
  Said said = done("status --of {bus}");
  EXPECT_THAT(said.text, Not(HasSubstr("trusts")));
  EXPECT_TRUE(result()["unit"].is_null());
  said = done("trust {key}.pub --at {bus}");
  EXPECT_THAT(said.text, HasSubstr("trusts no keys"));
  EXPECT_EQ(result()["keys"][0]["trusted"], false);

  device().belongs_to("A-1", {key_.public_key()});
  device().unit.counter = 42;
  said = done("status --of {bus}");
  EXPECT_THAT(said.text, HasSubstr("unit       unit 'A-1'"));
  EXPECT_THAT(said.text, HasSubstr("trusts     one key (" + text(key_.id()) + "); highest counter 42"));
  json unit = result()["unit"];
  EXPECT_EQ(unit["serial"], "A-1");
  EXPECT_EQ(unit["unit_hash"], hex(name_hash("A-1", 3)));
  EXPECT_EQ(unit["keys"], 1);
  EXPECT_EQ(unit["key_ids"], json::array({text(key_.id())}));
  EXPECT_EQ(unit["counter"], 42);
  said = done("trust {key}.pub {stranger}.pub --at {bus} -o {dir}k.h");
  EXPECT_EQ(result()["unit"], unit);
  EXPECT_EQ(result()["keys"][0]["trusted"], true);
  EXPECT_EQ(result()["keys"][1]["trusted"], false);
  EXPECT_THAT(read(path_of("k.h")), HasSubstr("flexcomp_trusted_keys[2][32]"));
  device().unit.keys = 5;
  done("trust {stranger}.pub --at {bus}");
  EXPECT_TRUE(result()["keys"][0]["trusted"].is_null());
  device().belongs_to("A-1");
  EXPECT_THAT(done("status --of {bus}").text, HasSubstr("no key: takes sets from everybody"));
}

}  // namespace authorised_commands
