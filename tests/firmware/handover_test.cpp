// SPDX-License-Identifier: Apache-2.0
// The control cycle in a thread of its own, as fast as it can, while sets come and go in the background.
// Every result must be that of exactly one whole set, in the order in which they were made active. (Run it
// with -fsanitize=thread too.)
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "firmware/bench.hpp"
#include "flexcomp_firmware/arithmetic.hpp"

namespace flexcomp::firmware::bench {
namespace {

using wire::Answer;
using wire::Command;

TEST(Handover, EveryCycleUsesOneWholeSet) {
  constexpr std::uint32_t sets = 8;
  DeviceSettings settings;
  settings.control.motion.cycle_us = 1000000;
  const Robot robot = tx60l();
  const Joints q = {real(0.1), real(-0.2), real(0.3), real(0.4), real(0.5), real(-0.6)};
  const FirmwareContext context = default_context<Scalar>(robot);
  std::vector<Bytes> images;
  std::vector<Joints> results = {q};  // no set: passed through
  for (std::uint32_t n = 1; n <= sets; ++n) {
    images.push_back(make_image(robot, n, 1, n));
    results.push_back(by_the_core(robot, images.back(), q, context).q);
  }
  Flash flash;
  Device device(robot, flash.hooks(), settings);
  device.store().boot();

  std::atomic<bool> stop{false};
  std::atomic<std::uint32_t> wrong{0};
  std::atomic<std::uint32_t> seen{0};  // bit n: set n was used
  // What is computed beside the step, in either context: by one whole set as well.
  const auto count_wrong_beside_the_step = [&] {
    FirmwareContext tracked = context;
    const FirmwareModel* model = device.cycle().current(tracked);
    if (model == nullptr) return;
    StepResult r;
    corrected_command(*model, q, tracked, settings.control.compensation, r);
    if (std::find(results.begin(), results.end(), r.q) == results.end()) ++wrong;
  };
  std::thread cycle([&] {
    while (!stop.load()) {
      count_wrong_beside_the_step();
      const StepResult r = device.step(q, context);
      bool known = false;
      for (std::uint32_t n = 0; n < results.size(); ++n) {
        if (r.q == results[n]) {
          known = true;
          seen.store(seen.load() | (1U << n));
        }
      }
      if (!known) ++wrong;
    }
  });

  std::mt19937 random(5);
  Store& store = device.store();
  std::uint32_t now = 0;
  std::uint32_t pushed = 0;
  std::uint32_t rounds = 0;
  // Until everything has happened often enough, however the two threads are scheduled.
  const auto begin = std::chrono::steady_clock::now();
  const std::uint32_t all = (1U << (sets + 1)) - 1U;
  for (int k = 0; pushed < 200 || rounds < 3 || seen.load() != all; ++k) {
    if (std::chrono::steady_clock::now() - begin > std::chrono::seconds(60)) break;
    store.poll(now += 1);
    count_wrong_beside_the_step();
    const std::uint32_t next = store.active_sequence() + 1;
    if (next <= sets) {
      const Bytes& image = images[next - 1];
      const auto size = static_cast<std::uint32_t>(image.size());
      if (store.run(Command::begin, size, 1) == Answer::accepted &&
          store.write(0, image.data(), size, 1) == Answer::accepted) {
        const bool trial = random() % 4 == 0;
        if (store.run(trial ? Command::commit_trial : Command::commit, 20, 1) == Answer::accepted) ++pushed;
      }
      if (random() % 3 == 0) store.run(Command::confirm, 0, 1);
      if (random() % 7 == 0) run_unlocked(store, Command::rollback);
    } else if (run_unlocked(store, Command::restore_defaults) == Answer::accepted) {
      ++rounds;
    }
    if (k % 8 == 0) std::this_thread::yield();
  }
  stop = true;
  cycle.join();
  EXPECT_EQ(wrong.load(), 0U);
  EXPECT_GE(pushed, 200U);
  EXPECT_GE(rounds, 3U);
  EXPECT_EQ(seen.load(), all) << "every set had its turn";
}

}  // namespace
}  // namespace flexcomp::firmware::bench
