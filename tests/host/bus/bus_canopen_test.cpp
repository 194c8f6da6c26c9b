// SPDX-License-Identifier: Apache-2.0
// The SDO client and the controller on top of it against a server on a socket pair, which can be told to misbehave.
#include <gmock/gmock.h>
#include <linux/can.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <functional>
#include <map>
#include <mutex>
#include <thread>
#include <tuple>
#include <utility>

#include "bus/heartbeats.hpp"
#include "bus/sdo_client.hpp"
#include "bus/transfer.hpp"
#include "flexcomp/wire/canopen_objects.hpp"
#include "flexcomp/wire/unit_record.hpp"
#include "host/bus/bus_fake_controller.hpp"
#include "support/thrown.hpp"

namespace flexcomp::host {
namespace {

namespace co = wire::canopen;
using fake::numbered_bytes;
using fake::numbered_image;
using fake::quick;
using std::chrono::milliseconds;
using std::chrono::steady_clock;
using support::thrown;
using testing::HasSubstr;

constexpr std::uint8_t node = 5;

can_frame frame_of(std::uint32_t id, std::initializer_list<unsigned> bytes) {
  can_frame out{};
  out.can_id = id;
  out.can_dlc = 8;
  std::size_t k = 0;
  for (const unsigned b : bytes) out.data[k++] = static_cast<std::uint8_t>(b);
  return out;
}

/// Both ends of a bus, the far one served frame by frame in a thread.
class Bus {
 public:
  using Serve = std::function<void(const can_frame&, const std::function<void(const can_frame&)>&)>;

  explicit Bus(Serve serve) : serve_(std::move(serve)) {
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends_), 0);
    thread_ = std::thread([this] { loop(); });
  }
  ~Bus() {
    stop_ = true;
    thread_.join();
    ::close(ends_[1]);
    if (!given_) ::close(ends_[0]);
  }
  int near() const { return ends_[0]; }
  /// The near end for somebody who closes it.
  int give() {
    given_ = true;
    return ends_[0];
  }
  void put(const can_frame& frame) {
    // The client may be gone when the copy of the last answer comes.
    const ssize_t sent = ::send(ends_[1], &frame, sizeof frame, MSG_NOSIGNAL);
    EXPECT_TRUE(sent == static_cast<ssize_t>(sizeof frame) || errno == EPIPE);
  }
  std::vector<can_frame> seen() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return seen_;
  }

 private:
  void loop() {
    while (!stop_) {
      pollfd ready{ends_[1], POLLIN, 0};
      if (::poll(&ready, 1, 5) <= 0) continue;
      can_frame frame{};
      if (::recv(ends_[1], &frame, sizeof frame, 0) != sizeof frame) return;
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        seen_.push_back(frame);
      }
      serve_(frame, [this](const can_frame& f) { put(f); });
    }
  }

  Serve serve_;
  int ends_[2] = {-1, -1};
  std::atomic<bool> stop_{false};
  bool given_ = false;
  std::mutex mutex_;
  std::vector<can_frame> seen_;
  std::thread thread_;
};

/// An SDO server over a table of objects. Written from the standard for this test, apart from the client.
class SdoServer {
 public:
  std::function<std::uint32_t(ObjectAddress, Bytes& value)> read;         ///< abort code, or 0 and the value
  std::function<std::uint32_t(ObjectAddress, const Bytes& value)> wrote;  ///< abort code, or 0
  bool sizes = true;                                                      ///< says sizes in advance
  int drop_answer = -1;   ///< the answer with this number is lost
  int wrong_toggle = -1;  ///< the answer with this number has a wrong toggle bit
  std::function<void(std::uint32_t)> on_abort;

  void operator()(const can_frame& in, const std::function<void(const can_frame&)>& put) {
    if (in.can_id != 0x600U + node || in.can_dlc != 8) return;
    can_frame out{};
    out.can_id = 0x580U + node;
    out.can_dlc = 8;
    if (!answer(in, out)) return;
    const int number = count_++;
    if (number == drop_answer) return;
    if (number == wrong_toggle) out.data[0] = static_cast<std::uint8_t>(out.data[0] ^ 0x10U);
    put(out);
  }

 private:
  static ObjectAddress object_of(const can_frame& f) {
    return {static_cast<std::uint16_t>(f.data[1] | (f.data[2] << 8)), f.data[3]};
  }
  bool abort(can_frame& out, std::uint32_t code) {
    out.data[0] = 0x80;
    out.data[1] = static_cast<std::uint8_t>(object_.index);
    out.data[2] = static_cast<std::uint8_t>(object_.index >> 8U);
    out.data[3] = object_.sub;
    std::memcpy(out.data + 4, &code, 4);
    return true;
  }
  bool answer(const can_frame& in, can_frame& out) {
    const unsigned command = in.data[0] >> 5U;
    if (command == 4) {
      std::uint32_t code = 0;
      std::memcpy(&code, in.data + 4, 4);
      if (on_abort) on_abort(code);
      return false;
    }
    if (command == 1 || command == 2) {
      object_ = object_of(in);
      std::memcpy(out.data + 1, in.data + 1, 3);
      toggle_ = 0;
    }
    std::uint32_t code = 0;
    if (command == 1) {
      value_.clear();
      out.data[0] = 0x60;
      if ((in.data[0] & 2) != 0) {
        value_.assign(in.data + 4, in.data + 8 - ((in.data[0] >> 2) & 3));
        code = wrote(object_, value_);
      }
    } else if (command == 0) {
      if ((in.data[0] & 0x10) != toggle_) return abort(out, 0x05030000);
      value_.insert(value_.end(), in.data + 1, in.data + 8 - ((in.data[0] >> 1) & 7));
      out.data[0] = static_cast<std::uint8_t>(0x20U | toggle_);
      toggle_ ^= 0x10U;
      if ((in.data[0] & 1) != 0) code = wrote(object_, value_);
    } else if (command == 2) {
      value_.clear();
      at_ = 0;
      code = read(object_, value_);
      if (value_.size() <= 4 && !value_.empty()) {
        out.data[0] = static_cast<std::uint8_t>(sizes ? 0x43U | ((4U - value_.size()) << 2U) : 0x42U);
        std::copy(value_.begin(), value_.end(), out.data + 4);
      } else {
        out.data[0] = sizes ? 0x41 : 0x40;
        const auto size = static_cast<std::uint32_t>(value_.size());
        if (sizes) std::memcpy(out.data + 4, &size, 4);
      }
    } else if (command == 3) {
      if ((in.data[0] & 0x10) != toggle_) return abort(out, 0x05030000);
      const std::size_t n = std::min<std::size_t>(7, value_.size() - at_);
      std::copy_n(value_.begin() + static_cast<std::ptrdiff_t>(at_), n, out.data + 1);
      at_ += n;
      const unsigned last = at_ == value_.size() ? 1 : 0;
      out.data[0] = static_cast<std::uint8_t>(toggle_ | ((7U - n) << 1U) | last);
      toggle_ ^= 0x10U;
    } else {
      object_ = object_of(in);
      return abort(out, 0x05040001);
    }
    return code == 0 || abort(out, code);
  }

  ObjectAddress object_;
  Bytes value_;
  std::size_t at_ = 0;
  unsigned toggle_ = 0;
  int count_ = 0;
};

/// A server with one object of any length.
struct OneObject {
  Bytes value;
  SdoServer server;
  OneObject() {
    server.read = [this](ObjectAddress, Bytes& out) { return out = value, 0U; };
    server.wrote = [this](ObjectAddress, const Bytes& in) { return value = in, 0U; };
  }
};

TEST(SdoClient, CarriesAnyLengthBothWays) {
  for (const bool sizes : {true, false}) {
    OneObject far;
    far.server.sizes = sizes;
    Bus bus(std::ref(far.server));
    SdoClient client(bus.near(), node, milliseconds(1000));
    for (const std::size_t size : {0U, 1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U, 13U, 14U, 15U, 21U, 500U, 1000U}) {
      const Bytes sent = numbered_bytes(size);
      client.download({0x2010, 1}, sent);
      EXPECT_EQ(far.value, sent) << size;
      // Without its size, what is given in one frame is always four bytes.
      if (sizes || size == 0 || size >= 4) {
        EXPECT_EQ(client.upload({0x2010, 2}), sent) << size;
      }
    }
  }
}

TEST(SdoClient, SpeaksFramesAsTheStandardHasThem) {
  OneObject far;
  Bus bus(std::ref(far.server));
  SdoClient client(bus.near(), node, milliseconds(1000));
  const Bytes eight = numbered_bytes(8);
  client.download({0x2011, 2}, std::span(eight).first(2));
  client.download({0x2010, 1}, eight);
  const std::vector<can_frame> seen = bus.seen();
  ASSERT_EQ(seen.size(), 4U);
  const auto is = [](const can_frame& f, std::initializer_list<unsigned> bytes) {
    const can_frame expected = frame_of(0x605, bytes);
    return f.can_id == expected.can_id && f.can_dlc == 8 && std::memcmp(f.data, expected.data, 8) == 0;
  };
  EXPECT_TRUE(is(seen[0], {0x2B, 0x11, 0x20, 2, eight[0], eight[1]}));
  EXPECT_TRUE(is(seen[1], {0x21, 0x10, 0x20, 1, 8, 0, 0, 0}));
  EXPECT_TRUE(is(seen[2], {0x00, eight[0], eight[1], eight[2], eight[3], eight[4], eight[5], eight[6]}));
  EXPECT_TRUE(is(seen[3], {0x1D, eight[7]}));
}

TEST(SdoClient, SaysAnAbortInWords) {
  SdoServer server;
  server.read = [](ObjectAddress, Bytes&) { return 0x06020000U; };
  Bus bus(std::ref(server));
  SdoClient client(bus.near(), node, milliseconds(1000));
  const SdoAbort e = thrown<SdoAbort>([&] { client.upload({0x2003, 0}); });
  EXPECT_TRUE(e.by_server());
  EXPECT_STREQ(e.what(), "SDO abort 0602 0000, object does not exist at 0x2003:0");
}

TEST(SdoClient, GivesUpInTimeAndTellsTheServer) {
  Bus bus([](const can_frame&, const auto&) {});
  SdoClient client(bus.near(), node, milliseconds(100));
  const auto start = steady_clock::now();
  EXPECT_THROW(client.upload({0x1018, 1}), SdoTimeout);
  const auto took = steady_clock::now() - start;
  EXPECT_GE(took, milliseconds(100));
  EXPECT_LT(took, milliseconds(1000));
  // The request is sent again after longer and longer waits; the server is told that it is over.
  const can_frame request = frame_of(0x605, {0x40, 0x18, 0x10, 1});
  const can_frame end = frame_of(0x605, {0x80, 0x18, 0x10, 1, 0, 0, 4, 5});
  for (int k = 0; k < 100 && (bus.seen().empty() || bus.seen().back().data[0] != 0x80); ++k) {
    std::this_thread::sleep_for(milliseconds(5));
  }
  const std::vector<can_frame> seen = bus.seen();
  ASSERT_GE(seen.size(), 3U);
  ASSERT_LE(seen.size(), 5U);
  for (std::size_t k = 0; k < seen.size(); ++k) {
    EXPECT_EQ(std::memcmp(seen[k].data, (k + 1 < seen.size() ? request : end).data, 8), 0) << k;
  }
  EXPECT_EQ(client.disturbances().lost, seen.size() - 2);
}

TEST(SdoClient, TakesNoOtherFrameForItsAnswer) {
  OneObject far;
  far.value = {1, 2, 3, 4};
  Bus bus([&far](const can_frame& in, const auto& put) {
    put(frame_of(0x586, {0x43, 0x18, 0x10, 1, 9, 9, 9, 9}));                  // another node
    put(frame_of(0x585, {0x43, 0x18, 0x10, 2, 9, 9, 9, 9}));                  // another object
    put(frame_of(0x585, {0x80, 0x00, 0x20, 0, 0, 0, 4, 5}));                  // an abort about another object
    put(frame_of(0x585U | CAN_EFF_FLAG, {0x43, 0x18, 0x10, 1, 9, 9, 9, 9}));  // an extended frame
    can_frame short_one = frame_of(0x585, {0x43, 0x18, 0x10, 1, 9, 9, 9});
    short_one.can_dlc = 7;
    put(short_one);
    far.server(in, put);
  });
  // An answer that was still under way when its question was given up.
  bus.put(frame_of(0x585, {0x43, 0x18, 0x10, 1, 7, 7, 7, 7}));
  SdoClient client(bus.near(), node, milliseconds(1000));
  EXPECT_EQ(client.upload({0x1018, 1}), far.value);
}

TEST(SdoClient, StopsAServerThatMakesNoSense) {
  for (const bool upload : {true, false}) {
    OneObject far;
    far.value = numbered_bytes(30);
    far.server.wrong_toggle = 2;
    std::atomic<std::uint32_t> told{0};
    far.server.on_abort = [&told](std::uint32_t code) { told = code; };
    Bus bus(std::ref(far.server));
    SdoClient client(bus.near(), node, milliseconds(300));
    const SdoAbort e = thrown<SdoAbort>([&] {
      if (upload) {
        client.upload({0x2010, 2});
      } else {
        client.download({0x2010, 1}, numbered_bytes(30));
      }
    });
    for (int k = 0; k < 100 && told == 0; ++k) std::this_thread::sleep_for(milliseconds(2));
    // A confirmation with the other toggle bit is the one before once more: the segment is sent again, which this server
    // refuses. Another segment than the one before is no copy.
    EXPECT_EQ(e.by_server(), !upload);
    if (upload) {
      EXPECT_EQ(told, e.code());
    }
    EXPECT_EQ(e.code(), co::abort::toggle);
  }
  // More than was announced.
  Bus bus([](const can_frame& in, const auto& put) {
    if (in.data[0] == 0x40) put(frame_of(0x585, {0x41, 0x10, 0x20, 2, 9}));
    if (in.data[0] >> 5 == 3) put(frame_of(0x585, {in.data[0] & 0x10U, 1, 2, 3, 4, 5, 6, 7}));
  });
  SdoClient client(bus.near(), node, milliseconds(300));
  EXPECT_EQ(thrown<SdoAbort>([&] { client.upload({0x2010, 2}); }).code(), co::abort::too_long);
}

/// A server of one block download or upload, as far as `answer` goes; returns the abort code that the client sends.
std::uint32_t aborted_by_client(bool upload,
                                const std::function<std::vector<can_frame>(const can_frame&)>& answer) {
  std::atomic<std::uint32_t> told{0};
  Bus bus([&](const can_frame& in, const auto& put) {
    std::uint32_t code = 0;
    std::memcpy(&code, in.data + 4, 4);
    if (in.data[0] == 0x80) told = code;
    for (const can_frame& f : answer(in)) put(f);
  });
  SdoClient client(bus.near(), node, milliseconds(120));
  try {
    if (upload) {
      client.upload({0x2010, 2}, {}, 70);
    } else {
      client.download({0x2010, 1}, numbered_bytes(70));
    }
    ADD_FAILURE() << "that was no transfer";
  } catch (const SdoAbort& e) {
    EXPECT_FALSE(e.by_server()) << e.what();
  } catch (const SdoTimeout&) {
  }
  for (int k = 0; k < 100 && told == 0; ++k) std::this_thread::sleep_for(milliseconds(2));
  return told;
}

TEST(SdoClient, StopsABlockServerThatMakesNoSense) {
  using Frames = std::vector<can_frame>;
  const auto down = [](unsigned size, unsigned taken, unsigned next) {
    return [=](const can_frame& in) -> Frames {
      if ((in.data[0] & 0xE1) == 0xC0) return {frame_of(0x585, {0xA4, 0x10, 0x20, 1, size})};
      if ((in.data[0] & 0x80) != 0 && in.data[0] != 0x80) return {frame_of(0x585, {0xA2, taken, next})};
      return {};
    };
  };
  EXPECT_EQ(aborted_by_client(false, down(0, 1, 1)), co::abort::block_size);
  EXPECT_EQ(aborted_by_client(false, down(128, 1, 1)), co::abort::block_size);
  EXPECT_EQ(aborted_by_client(false, down(127, 5, 0)), co::abort::block_size);
  EXPECT_EQ(aborted_by_client(false, down(127, 5, 128)), co::abort::block_size);
  EXPECT_EQ(aborted_by_client(false, down(127, 0, 127)), co::abort::sequence) << "takes nothing, ever";
  EXPECT_EQ(aborted_by_client(false, down(127, 11, 127)), co::abort::timeout) << "more than was sent";
  EXPECT_EQ(aborted_by_client(false, down(127, 10, 127)), co::abort::timeout) << "the end is not answered";

  const auto up = [](unsigned announced, unsigned segments, const can_frame& end) {
    return [=](const can_frame& in) -> Frames {
      if (in.data[0] == 0xA4) return {frame_of(0x585, {0xC6, 0x10, 0x20, 2, announced})};
      if (in.data[0] == 0xA2) return {end};
      Frames out;
      for (unsigned k = 1; in.data[0] == 0xA3 && k <= segments; ++k) {
        out.push_back(frame_of(0x585, {k == segments ? k | 0x80U : k}));
      }
      return out;
    };
  };
  EXPECT_EQ(aborted_by_client(true, up(70, 10, frame_of(0x585, {0xC1, 1, 0}))), co::abort::crc);
  EXPECT_EQ(aborted_by_client(true, up(70, 10, frame_of(0x585, {0xC5, 0, 0}))), co::abort::too_short) << "n";
  EXPECT_EQ(aborted_by_client(true, up(70, 9, frame_of(0x585, {0xC1, 0, 0}))), co::abort::too_short);
  EXPECT_EQ(aborted_by_client(true, up(70, 11, frame_of(0x585, {0xC1, 0, 0}))), co::abort::too_long);
  EXPECT_EQ(aborted_by_client(true, up(70, 10, frame_of(0x585, {0xA1}))), co::abort::timeout);
}

TEST(SdoClient, AsksForSegmentsWhereAServerHasNoBlocks) {
  OneObject far;
  far.value = numbered_bytes(100);
  Bus bus(std::ref(far.server));
  SdoClient client(bus.near(), node, milliseconds(1000));
  EXPECT_EQ(client.upload({0x2010, 2}, {}, 100), far.value);
  EXPECT_EQ(client.upload({0x2010, 2}, {}, 100), far.value);
  client.download({0x2010, 1}, numbered_bytes(99));
  EXPECT_EQ(far.value, numbered_bytes(99));
  int asked = 0;
  for (const can_frame& f : bus.seen()) asked += f.data[0] == 0xA4 || f.data[0] == 0xC6 ? 1 : 0;
  EXPECT_EQ(asked, 1) << "once";
}

/// The object dictionary of a controller.
struct CanopenDevice : fake::Controller {
  SdoServer server;
  std::uint32_t argument = 0;
  Bytes answer_bytes = Bytes(wire::probe_response_bytes);

  CanopenDevice() {
    constexpr auto little = wire::ByteOrder::little;
    server.read = [this](ObjectAddress o, Bytes& out) -> std::uint32_t {
      if (o.index == co::capability) return out = capability_record(little), 0;
      if (o.index == co::status) return out = status_record(little), 0;
      if (o.index == co::unit && has_unit()) return out = unit_record(little), 0;
      if (o.index == co::robot && tells_robot) return out = robot_record(little), 0;
      if (o.index == co::image && o.sub == co::image_active) return out = active, 0;
      if (o.index == co::probe && o.sub == co::probe_response) return out = answer_bytes, 0;
      if (o.index == co::probe && o.sub == co::probe_flags && tells_flags()) {
        out.resize(2);
        store_u16(out.data(), probe({}).flags);
        return 0;
      }
      return co::abort::no_object;
    };
    server.wrote = [this](ObjectAddress o, const Bytes& in) -> std::uint32_t {
      const auto code = [this](wire::Answer a) {
        return co::abort_code(a, static_cast<Refusal>(status.refusal));
      };
      if (o.index == co::image) {
        const wire::Answer a = run(wire::Command::begin, static_cast<std::uint32_t>(in.size()));
        staged = in;
        return code(a);
      }
      if (o.index == co::command && o.sub == co::command_argument) return argument = load_u32(in.data()), 0;
      if (o.index == co::command) return code(run(static_cast<wire::Command>(load_u16(in.data())), argument));
      if (o.index == co::probe) {
        wire::ProbeRequest request;
        wire::decode(in.data(), little, request);
        wire::encode(probe(request), little, answer_bytes.data());
        return 0;
      }
      return co::abort::no_object;
    };
  }
};

/// A client of what answers on a bus.
std::unique_ptr<ControllerClient> client_on(Bus& bus) {
  return connect_canopen({CanAddress{"vcan9", node}}, quick(), bus.give());
}

TEST(CanopenClient, PushesAndReadsBack) {
  CanopenDevice device;
  device.working_polls = 3;
  Bus bus(std::ref(device.server));
  const auto client = client_on(bus);
  EXPECT_EQ(client->capability().terms, 64);
  const Bytes image = numbered_image(1001);
  std::size_t reported = 0;
  PushOptions options;
  options.progress = [&reported](std::size_t done, std::size_t) { reported = done; };
  push_image(*client, image, options);
  EXPECT_EQ(device.active, image);
  EXPECT_EQ(reported, image.size());
  EXPECT_EQ(next_sequence(*client), 2U);
}

TEST(CanopenClient, LosesOneFrameAndGoesOn) {
  // Each answer of a push in turn is lost, but not the one to a command, which must not be given twice.
  for (const int lost : {0, 5, 40, 100, 150}) {
    CanopenDevice device;
    device.server.drop_answer = lost;
    Bus bus(std::ref(device.server));
    const auto client = client_on(bus);
    const Bytes image = numbered_image(1001);
    push_image(*client, image);
    EXPECT_EQ(device.active, image) << lost;
  }
}

/// What a channel does to the answers of a server, by their numbers.
struct Disturbed {
  SdoServer& server;
  std::function<std::vector<can_frame>(int number, const can_frame&)> answers;
  int number = 0;
  void operator()(const can_frame& in, const std::function<void(const can_frame&)>& put) {
    server(in, [&](const can_frame& answer) {
      for (const can_frame& f : answers(number, answer)) put(f);
      ++number;
    });
  }
};

TEST(CanopenClient, EveryDoubledAnswerLeavesAPushAlone) {
  CanopenDevice device;
  Disturbed channel{device.server, [](int, const can_frame& f) { return std::vector{f, f}; }};
  Bus bus(std::ref(channel));
  const auto client = client_on(bus);
  const auto start = steady_clock::now();
  EXPECT_EQ(push_image(*client, numbered_image(1001, 3)).active_sequence, 3U);
  EXPECT_LT(steady_clock::now() - start, milliseconds(1000));
}

TEST(CanopenClient, TwoNodesWithOneNumberAreNamed) {
  // Two arms that differ in one object only; in the last case in none that is read, as one node behind a gateway that doubles.
  for (const auto& [index, sub, words] :
       {std::tuple<unsigned, unsigned, const char*>{0x1018, 4, "serial number 0x1 and 0x2"},
        {0x1018, 3, "firmware revision 0x1 and 0x2"},
        {0x2002, 5, "sequence of the active set 0x1 and 0x2"},
        {0x2000, 0, nullptr}}) {
    std::array<CanopenDevice, 2> devices;
    for (std::uint8_t k = 0; k < 2; ++k) {
      devices[k].server.read =
          [&, k, object = ObjectAddress{static_cast<std::uint16_t>(index), static_cast<std::uint8_t>(sub)},
           read = devices[k].server.read](ObjectAddress o, Bytes& value) {
            const std::uint32_t code = read(o, value);
            if (o.index != 0x1018 && o.index != 0x2002) return code;
            const bool differs = o.index == object.index && o.sub == object.sub;
            value = {static_cast<std::uint8_t>(differs ? k + 1 : 7), 0, 0, 0};
            return 0U;
          };
    }
    Bus bus([&](const can_frame& in, const auto& put) {
      for (CanopenDevice& device : devices) device.server(in, put);
    });
    if (words == nullptr) {
      EXPECT_EQ(client_on(bus)->capability().terms, 64);
      continue;
    }
    const BusError e = thrown<BusError>([&] { client_on(bus); });
    EXPECT_THAT(
        e.what(),
        HasSubstr(std::string("two nodes have the number 5: each request is answered twice, with ") + words));
  }
}

TEST(CanopenClient, TwoNodesThatAnswerDifferentlyAreNamedInPlaceOfAnEndlessTransfer) {
  std::array<CanopenDevice, 2> devices;
  for (std::uint8_t k = 0; k < 2; ++k) {
    devices[k].server.read = [k, read = devices[k].server.read](ObjectAddress o, Bytes& value) {
      if (o.index == 0x1018) return value = {k, 0, 0, 1}, 0U;
      const std::uint32_t code = read(o, value);
      // The second one's records are shorter, so that its transfers end before the first one's.
      if (k == 1 && value.size() > 20) value.resize(20);
      return code;
    };
  }
  Bus bus([&](const can_frame& in, const auto& put) {
    for (CanopenDevice& device : devices) device.server(in, put);
  });
  const auto start = steady_clock::now();
  EXPECT_THAT(
      thrown<BusError>([&] { client_on(bus); }).what(),
      HasSubstr(
          "two nodes have the number 5: each request is answered twice, with serial number 0x1000000 and "
          "0x1000001"));
  EXPECT_LT(steady_clock::now() - start, quick().response_timeout * 5);
}

/// What Heartbeats says about `asked` after these frames.
std::string heard_about(std::uint8_t asked, std::initializer_list<std::pair<unsigned, int>> frames) {
  int ends[2] = {-1, -1};
  EXPECT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends), 0);
  Heartbeats heartbeats{Descriptor(ends[0])};
  const Descriptor far(ends[1]);
  for (const auto& [id, state] : frames) {
    can_frame f{};
    f.can_id = id;
    f.can_dlc = state < 0 ? 8 : 1;
    f.data[0] = static_cast<std::uint8_t>(state);
    EXPECT_EQ(::send(far.get(), &f, sizeof f, 0), static_cast<ssize_t>(sizeof f));
  }
  return heartbeats.about(asked, milliseconds(20));
}

TEST(Heartbeats, TellWhoIsThere) {
  EXPECT_EQ(Heartbeats().about(5, milliseconds(60000)), "") << "without a socket, and without waiting";
  EXPECT_EQ(heard_about(5, {}), "; nothing was heard");
  EXPECT_EQ(heard_about(5, {{0x705, 4}}), "; node 5 is stopped");
  EXPECT_EQ(heard_about(5, {{0x705, 127}, {0x707, 5}}), "; node 5 is pre-operational");
  EXPECT_EQ(heard_about(5, {{0x705, 0}}), "; node 5 is starting");
  EXPECT_EQ(heard_about(5, {{0x705, 0}, {0x705, 127}, {0x705, 5}}), "; node 5 is operational");
  EXPECT_EQ(heard_about(5, {{0x705, 0x84}}), "; node 5 is stopped") << "node guarding";
  EXPECT_EQ(heard_about(5, {{0x705, 77}}), "; node 5 is in state 77, which CiA 301 does not know");
  EXPECT_EQ(heard_about(5, {{0x707, 5}, {0x703, 127}, {0x707, 5}, {0x087, -1}}), "; heard here: 3, 7");
  EXPECT_EQ(heard_about(5, {{0x085, -1}}), "; node 5 sends EMCY");
  EXPECT_EQ(heard_about(5, {{0x080, -1}, {0x700, 5}, {0x605, -1}, {0x80000705U, 5}, {0x40000705U, 5}}),
            "; nothing was heard")
      << "SYNC, node 0, requests, extended and remote frames";
  EXPECT_EQ(heard_about(5, {{0x705, -1}}), "; nothing was heard") << "8 bytes are no heartbeat";
}

TEST(Heartbeats, TellTwoNodesWithOneNumberWhereTheirStatesDiffer) {
  const char* two = "; two nodes have the number 5: its heartbeats say ";
  EXPECT_EQ(heard_about(5, {{0x705, 5}, {0x705, 127}, {0x705, 5}, {0x705, 127}, {0x705, 5}}),
            std::string(two) + "operational and pre-operational by turns");
  EXPECT_EQ(heard_about(5, {{0x705, 5}, {0x705, 4}, {0x705, 5}, {0x705, 4}, {0x705, 5}, {0x705, 4}}),
            std::string(two) + "stopped and operational by turns");
  // A master that starts, stops and starts it; resets; one state after the other.
  EXPECT_EQ(heard_about(5, {{0x705, 127}, {0x705, 5}, {0x705, 5}, {0x705, 127}, {0x705, 5}}),
            "; node 5 is operational");
  EXPECT_EQ(
      heard_about(5,
                  {{0x705, 0}, {0x705, 127}, {0x705, 0}, {0x705, 127}, {0x705, 0}, {0x705, 127}, {0x705, 0}}),
      "; node 5 is starting");
  EXPECT_EQ(heard_about(5, {{0x705, 127}, {0x705, 5}, {0x705, 4}, {0x705, 127}, {0x705, 5}, {0x705, 4}}),
            "; node 5 is stopped");
}

TEST(CanopenClient, AnswersToAMasterThatPollsLeaveAPushAlone) {
  CanopenDevice device;
  const can_frame polled = frame_of(0x585, {0x4F, 0x01, 0x10, 0, 1});
  const can_frame refused = frame_of(0x585, {0x80, 0x00, 0x30, 0, 0, 0, 2, 6});
  Disturbed channel{device.server, [&](int, const can_frame& f) {
                      return std::vector{polled, f, refused, polled};
                    }};
  Bus bus(std::ref(channel));
  const auto client = client_on(bus);
  EXPECT_EQ(push_image(*client, numbered_image(1001, 3)).active_sequence, 3U);
}

TEST(CanopenClient, SaysThatAnotherMasterTookTheChannel) {
  // A server with one transfer, which the other master's poll replaces after every third segment.
  CanopenDevice device;
  int segments = 0;
  Bus bus([&](const can_frame& in, const auto& put) {
    if (in.data[0] >> 5 == 0 && ++segments % 3 == 0) {
      put(frame_of(0x585, {0x4F, 0x01, 0x10, 0, 1}));
      put(frame_of(0x585, {0x80, 0x01, 0x10, 0, 1, 0, 4, 5}));
      return;
    }
    device.server(in, put);
  });
  const auto client =
      connect_canopen({CanAddress{"vcan9", node}}, {.response_timeout = milliseconds(60)}, bus.give());
  const BusError e = thrown<BusError>([&] { push_image(*client, numbered_image(100)); });
  EXPECT_THAT(e.what(),
              HasSubstr("can:vcan9:5: node 5: asked to write object 0x2010:1, the transfer was broken off"));
  EXPECT_THAT(e.what(), HasSubstr("answers to another client (another master uses this node's SDO channel)"));
}

TEST(CanopenClient, ACommitWhoseAnswerIsLostIsJudgedByTheStatus) {
  // 0: executed, 1: refused in the background, 2: the command itself was lost, and is given again.
  for (const int what : {0, 1, 2}) {
    CanopenDevice device;
    if (what == 1) device.commit_ends = wire::Answer::storage_failed;
    if (what == 2) device.commits_lost = 1;
    bool commit = false;
    Bus bus([&](const can_frame& in, const auto& put) {
      const bool is_commit = in.data[0] == 0x2B && in.data[1] == 0x11 && in.data[4] == 3;
      device.server(in, [&](const can_frame& f) {
        if (!is_commit || std::exchange(commit, true)) put(f);
      });
    });
    const auto client = client_on(bus);
    if (what == 1) {
      EXPECT_THAT(thrown<RefusedByController>([&] { push_image(*client, numbered_image(100, 7)); }).what(),
                  HasSubstr("non-volatile memory failed"));
    } else {
      EXPECT_EQ(push_image(*client, numbered_image(100, 7)).active_sequence, 7U);
    }
  }
}

TEST(CanopenClient, AControllerThatKeepsSilentAfterTheCommitLeavesItOpen) {
  for (const bool comes_back : {true, false}) {
    CanopenDevice device;
    std::atomic<bool> silent{false};
    auto since = steady_clock::now();
    Bus bus([&](const can_frame& in, const auto& put) {
      const bool is_commit = in.data[0] == 0x2B && in.data[1] == 0x11 && in.data[4] == 3;
      if (comes_back && silent && steady_clock::now() - since > milliseconds(800)) silent = false;
      device.server(in, [&](const can_frame& f) {
        if (!silent && !is_commit) put(f);
      });
      if (is_commit) {
        silent = true;
        since = steady_clock::now();
      }
    });
    const auto client = client_on(bus);
    if (comes_back) {
      EXPECT_EQ(push_image(*client, numbered_image(100, 7)).active_sequence, 7U);
    } else {
      const OutcomeOpen e = thrown<OutcomeOpen>([&] { push_image(*client, numbered_image(100, 7)); });
      EXPECT_THAT(
          e.what(),
          HasSubstr("can:vcan9:5: open: the controller was asked to commit the set, then: node 5 did not "
                    "answer for"));
      EXPECT_THAT(e.what(), HasSubstr("its status could not be read for 1.8 s"));
    }
    EXPECT_EQ(device.status.active_sequence, 7U);
  }
}

TEST(CanopenClient, SaysWhyASetWasRefused) {
  CanopenDevice device;
  device.verify_refuses = Refusal::unknown_basis;
  Bus bus(std::ref(device.server));
  const auto client = client_on(bus);
  const RefusedByController e =
      thrown<RefusedByController>([&] { push_image(*client, numbered_image(100)); });
  EXPECT_EQ(e.refusal(), Refusal::unknown_basis);
  EXPECT_STREQ(
      e.what(),
      "can:vcan9:5: asked to verify the set, the controller refused: the image has a basis that the "
      "controller does not evaluate (basis 23) (SDO abort 0604 0043, general parameter incompatibility at "
      "0x2011:2)");
  EXPECT_TRUE(device.active.empty());
  EXPECT_TRUE(device.staged.empty());
}

TEST(CanopenClient, WaitsForABusyControllerButNotForEver) {
  CanopenDevice device;
  device.busy = 3;
  Bus bus(std::ref(device.server));
  const auto client = client_on(bus);
  push_image(*client, numbered_image(50));
  EXPECT_EQ(device.active.size(), 50U);
  device.busy = 1000000;
  const RefusedByController e = thrown<RefusedByController>([&] { push_image(*client, numbered_image(60)); });
  EXPECT_EQ(e.answer(), wire::Answer::busy);
  EXPECT_THAT(e.what(), HasSubstr("busy for 0.6 s"));
  device.busy = 0;
  device.working_polls = 1000000;
  EXPECT_THROW(roll_back(*client), OutcomeOpen);
}

TEST(CanopenClient, ProbesWithAllBits) {
  CanopenDevice device;
  Bus bus(std::ref(device.server));
  const auto client = client_on(bus);
  fake::expect_exact_probe(*client);
  device.capability.flags |= wire::capability_flag::probe_flags;
  Bus other(std::ref(device.server));
  fake::expect_exact_probe(*client_on(other), true);
}

TEST(CanopenClient, SaysWhoDidNotAnswer) {
  Bus bus([](const can_frame&, const auto&) {});
  const auto start = steady_clock::now();
  EXPECT_STREQ(thrown<NoAnswer>([&] { client_on(bus); }).what(),
               "can:vcan9:5: node 5 did not answer for 0.60 s when asked to read object 0x2000:0; seen "
               "meanwhile: 3 requests without an answer");
  EXPECT_LT(steady_clock::now() - start, milliseconds(1500));
}

TEST(CanopenClient, RefusesWhatIsNoController) {
  {
    CanopenDevice device;
    device.capability.protocol = 0x0200;
    Bus bus(std::ref(device.server));
    EXPECT_THROW(client_on(bus), BusError);
  }
  SdoServer other;
  other.read = [](ObjectAddress, Bytes& out) { return out = {1, 2, 3, 4}, 0U; };
  Bus bus(std::ref(other));
  EXPECT_STREQ(thrown<BusError>([&] { client_on(bus); }).what(),
               "can:vcan9:5: object 0x2000:0 of node 5 has 4 bytes, expected 128");
}

TEST(CanopenClient, TellsTheRobotOrAsksForIt) {
  CanopenDevice device;
  Bus bus(std::ref(device.server));
  const auto client = client_on(bus);
  const Robot robot = robot_of(*client, "");
  EXPECT_EQ(robot.name, "fake");
  EXPECT_EQ(robot.nominal.links[1].a_m, 0.4);
  EXPECT_EQ(robot.nominal.name_hash, device.capability.name_hash);
  device.robot.links[1].a_m = 0.41;
  EXPECT_THROW(robot_of(*client, ""), BusError);
  device.tells_robot = false;
  EXPECT_EQ(thrown<BusError>([&] { robot_of(*client, ""); }).code(), ErrorCode::unknown_robot);
}

TEST(CanopenClient, TellsItsUnitAndUnlocks) {
  CanopenDevice device;
  device.belongs_to("B-7");
  device.previous = numbered_image(40, 1);
  device.activate(numbered_image(50, 2));
  Bus bus(std::ref(device.server));
  const auto client = client_on(bus);
  EXPECT_EQ(client->unit()->serial, "B-7");
  unlock(*client);
  EXPECT_EQ(roll_back(*client).active_sequence, 1U);
}

}  // namespace
}  // namespace flexcomp::host
