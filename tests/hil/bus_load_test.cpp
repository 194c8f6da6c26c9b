// SPDX-License-Identifier: Apache-2.0
// What a push costs on a CAN bus: client and firmware on one channel, on which every frame is counted with its stuff bits,
// with block transfer and without.
#include <gtest/gtest.h>
#include <linux/can.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <memory>
#include <mutex>
#include <thread>

#include "bus/transfer.hpp"
#include "firmware/bench.hpp"
#include "flexcomp_firmware/canopen.hpp"

namespace flexcomp::hil {
namespace {

namespace bench = firmware::bench;
namespace co = wire::canopen;
using std::chrono::milliseconds;

/// Bits of a data frame with an 11-bit identifier between two others: ISO 11898-1, with stuff bits and intermission.
unsigned bits_of(const can_frame& f) {
  std::vector<bool> bits;
  const auto put = [&bits](unsigned value, unsigned count) {
    for (unsigned k = count; k-- > 0;) bits.push_back((value >> k & 1U) != 0);
  };
  put(0, 1);  // start of frame
  put(f.can_id, 11);
  put(0, 3);  // RTR, IDE, r0
  put(f.can_dlc, 4);
  for (unsigned k = 0; k < f.can_dlc; ++k) put(f.data[k], 8);
  unsigned crc = 0;
  for (const bool bit : bits) {
    const bool next = bit != ((crc & 0x4000U) != 0);
    crc = (crc << 1U) & 0x7FFFU;
    if (next) crc ^= 0x4599U;
  }
  put(crc, 15);
  unsigned stuffed = 0;
  unsigned run = 0;
  bool last = true;
  for (const bool bit : bits) {
    run = bit == last ? run + 1 : 1;
    last = bit;
    if (run == 5) {
      ++stuffed;
      last = !bit;
      run = 1;
    }
  }
  constexpr unsigned delimiters_acknowledge_end_intermission = 1 + 2 + 7 + 3;
  return static_cast<unsigned>(bits.size()) + stuffed + delimiters_acknowledge_end_intermission;
}

struct Load {
  unsigned frames = 0, bits = 0;
};

/// The firmware behind one end of a socket pair, in a thread.
class CountedController {
 public:
  explicit CountedController(std::uint8_t block_size) {
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends_), 0);
    firmware::CanopenSettings settings{node_id, 0, 2000};
    settings.block_size = block_size;
    node_ = std::make_unique<firmware::CanopenNode>(
        *arm_.device, firmware::Origin{1}, settings,
        firmware::CanTransmit{this, [](void* self, std::uint16_t id, const std::uint8_t* b, std::uint8_t n) {
                                can_frame f{};
                                f.can_id = id;
                                f.can_dlc = n;
                                std::copy_n(b, n, f.data);
                                auto& c = *static_cast<CountedController*>(self);
                                c.count(f);
                                return ::send(c.ends_[1], &f, sizeof f, MSG_NOSIGNAL) == sizeof f;
                              }});
    node_->poll(0);
    thread_ = std::thread([this] {
      while (!stop_) turn();
    });
  }
  ~CountedController() {
    stop_ = true;
    thread_.join();
    ::close(ends_[1]);
  }
  std::unique_ptr<host::ControllerClient> client() {
    return host::connect_canopen({host::CanAddress{"counted", node_id}}, {}, ends_[0]);
  }
  Load load() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return load_;
  }

 private:
  static constexpr std::uint8_t node_id = 5;

  void count(const can_frame& f) {
    ++load_.frames;
    load_.bits += bits_of(f);
  }
  void turn() {
    pollfd ready{ends_[1], POLLIN, 0};
    ::poll(&ready, 1, 1);
    const std::lock_guard<std::mutex> lock(mutex_);
    can_frame f{};
    while (::recv(ends_[1], &f, sizeof f, MSG_DONTWAIT) == sizeof f) {
      count(f);
      node_->receive(static_cast<std::uint16_t>(f.can_id), f.data, f.can_dlc);
      // What the store does takes no time here: how often a client asks whether it is done would differ from run to run.
      arm_.until_done();
    }
    arm_.device->store().poll(++arm_.now_ms);
    node_->poll(arm_.now_ms);
    arm_.step();
  }

  bench::Arm arm_;
  std::unique_ptr<firmware::CanopenNode> node_;
  int ends_[2] = {-1, -1};
  Load load_;
  std::mutex mutex_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

TEST(BusLoad, AFrameHasTheBitsOfTheStandard) {
  can_frame f{};
  EXPECT_GE(bits_of(f), 47U);
  f.can_dlc = 8;
  EXPECT_LE(bits_of(f), 47U + 64U + 24U);
  f.can_id = 0x555;
  std::fill_n(f.data, 8, std::uint8_t{0x55});
  EXPECT_LE(bits_of(f), 47U + 64U + 4U) << "hardly a stuff bit";
}

TEST(BusLoad, APushInBlocksCostsLessThanSixTenths) {
  const host::Bytes image = bench::make_image(bench::tx60l(), 1);
  Load loads[2];
  Load pulls[2];
  for (const unsigned k : {0U, 1U}) {
    CountedController far(k == 0 ? std::uint8_t{0} : co::most_segments);
    const auto client = far.client();
    host::push_image(*client, image);
    loads[k] = far.load();
    EXPECT_EQ(host::pull_image(*client), image);
    pulls[k] = far.load();
    pulls[k].frames -= loads[k].frames;
    pulls[k].bits -= loads[k].bits;
  }
  std::printf("| CAN, set of %zu bytes | frames | bits | ms at 1 Mbit/s |\n", image.size());
  const auto row = [](const char* what, const Load& l) {
    std::printf("| %-24s | %5u | %6u | %5.1f |\n", what, l.frames, l.bits, l.bits * 1e-3);
  };
  row("push in segments", loads[0]);
  row("push in blocks", loads[1]);
  row("pull in segments", pulls[0]);
  row("pull in blocks", pulls[1]);
  EXPECT_LE(loads[1].frames, loads[0].frames * 6 / 10);
  EXPECT_LE(loads[1].bits, loads[0].bits * 6 / 10);
  EXPECT_LE(pulls[1].bits, pulls[0].bits * 6 / 10);
}

}  // namespace
}  // namespace flexcomp::hil
