// SPDX-License-Identifier: Apache-2.0
// The client and the firmware over a CAN channel that loses, doubles, delays and reorders frames, with another master on it,
// and controllers and clients that are killed in the middle. Every push, confirm and rollback ends in a word that is true when
// it is judged by the controller itself, and the controller has a whole set.
//
//   FLEXCOMP_TRANSFERS=2000 hil_tests --file disturbed_can_test.cpp     the long run; its table is in docs/buses.md
#include <gtest/gtest.h>
#include <linux/can.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <random>
#include <thread>
#include <tuple>

#include "bus/transfer.hpp"
#include "firmware/bench.hpp"
#include "flexcomp_firmware/canopen.hpp"

namespace flexcomp::hil {
namespace {

namespace bench = firmware::bench;
namespace co = wire::canopen;
using host::Bytes;
using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr std::uint8_t node_id = 5;
constexpr std::uint32_t trial_cycles = 20000;  ///< longer than the longest confirm

/// What the channel does to a frame, either way.
struct Disturbance {
  const char* name;
  double lost = 0;  ///< so many of all frames
  double doubled = 0;
  double delayed = 0;           ///< by up to 20 ms; others pass them
  milliseconds poll{0};         ///< another master reads 1001h so often
  bool full_load = false;       ///< foreign frames without end, on this channel and others
  double kills_controller = 0;  ///< in so many transfers
  double kills_client = 0;
  bool exact = false;  ///< 99 % of the transfers have to end active
};

const std::array disturbances = std::to_array<Disturbance>({
    {.name = "none", .exact = true},
    {.name = "loss 0.2 %", .lost = 0.002, .exact = true},
    {.name = "loss 2 %", .lost = 0.02},
    {.name = "1 % doubled", .doubled = 0.01, .exact = true},
    {.name = "5 % up to 20 ms late", .delayed = 0.05},
    {.name = "poll 10 /s", .poll = milliseconds(100), .exact = true},
    {.name = "poll 10 /s, loss 0.2 %, 1 % doubled",
     .lost = 0.002,
     .doubled = 0.01,
     .poll = milliseconds(100),
     .exact = true},
    {.name = "full load", .full_load = true, .exact = true},
    {.name = "controller killed", .lost = 0.002, .kills_controller = 0.7},
    {.name = "client killed", .lost = 0.002, .kills_client = 0.7},
    {.name = "all of these",
     .lost = 0.005,
     .doubled = 0.005,
     .delayed = 0.01,
     .poll = milliseconds(100),
     .kills_controller = 0.2,
     .kills_client = 0.2},
});

/// The firmware on one end of a socket pair, behind such a channel, in a thread.
class DisturbedController {
 public:
  DisturbedController(const Disturbance& what, std::uint32_t seed) : what_(what), random_(seed) {
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends_), 0);
    start();
    thread_ = std::thread([this] {
      while (!stop_) turn();
    });
  }
  ~DisturbedController() {
    stop_ = true;
    thread_.join();
    ::close(ends_[0]);
    ::close(ends_[1]);
  }

  int client_end() const { return ::dup(ends_[0]); }
  void kill_in(milliseconds after, milliseconds gone_for) {
    const std::lock_guard<std::mutex> lock(mutex_);
    kill_at_ = steady_clock::now() + after;
    gone_for_ = gone_for;
  }
  /// No more disturbances: what is under way arrives, the store comes to its end.
  void calm() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      is_calm_ = true;
      kill_at_.reset();
    }
    const auto end = steady_clock::now() + std::chrono::seconds(5);
    for (int quiet = 0; quiet < 5 && steady_clock::now() < end;) {
      std::this_thread::sleep_for(milliseconds(2));
      const std::lock_guard<std::mutex> lock(mutex_);
      const bool busy = !arm_ || !under_way_.empty() ||
                        arm_->device->status().state == static_cast<std::uint16_t>(wire::StoreState::working);
      quiet = busy ? 0 : quiet + 1;
    }
  }
  void disturb() {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_calm_ = false;
  }
  unsigned kills() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return kills_;
  }
  template <class Look>
  auto look(const Look& l) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return l(*arm_);
  }

 private:
  struct UnderWay {
    steady_clock::time_point due;
    bool to_node;
    can_frame frame;
  };

  void start() {
    arm_ = std::make_unique<bench::Arm>(flash_);
    node_ = std::make_unique<firmware::CanopenNode>(
        *arm_->device, firmware::Origin{1}, firmware::CanopenSettings{node_id, 100, 2000},
        firmware::CanTransmit{this, [](void* self, std::uint16_t id, const std::uint8_t* b, std::uint8_t n) {
                                can_frame f{};
                                f.can_id = id;
                                f.can_dlc = n;
                                std::copy_n(b, n, f.data);
                                static_cast<DisturbedController*>(self)->put(false, f);
                                return true;
                              }});
  }
  bool happens(double share) {
    return !is_calm_ && share > 0 && std::uniform_real_distribution<double>(0, 1)(random_) < share;
  }
  void put(bool to_node, const can_frame& frame) {
    for (int copies = happens(what_.doubled) ? 2 : 1; copies > 0; --copies) {
      if (happens(what_.lost)) continue;
      auto due = steady_clock::now();
      if (happens(what_.delayed)) due += microseconds(random_() % 20000);
      under_way_.push_back({due, to_node, frame});
    }
  }
  void deliver() {
    const auto now = steady_clock::now();
    // An answer that is made here is under way behind the others.
    for (std::size_t left = under_way_.size(); left > 0; --left) {
      const UnderWay next = under_way_.front();
      under_way_.pop_front();
      if (next.due > now) {
        under_way_.push_back(next);
      } else if (!next.to_node) {
        ::send(ends_[1], &next.frame, sizeof next.frame, MSG_NOSIGNAL | MSG_DONTWAIT);
      } else if (node_) {
        node_->receive(static_cast<std::uint16_t>(next.frame.can_id), next.frame.data, next.frame.can_dlc);
      }
    }
  }
  void foreign_request(std::uint16_t index) {
    can_frame f{};
    f.can_id = co::sdo_request_id + node_id;
    f.can_dlc = 8;
    f.data[0] = 0x40;
    store_u16(f.data + 1, index);
    put(true, f);
  }
  void turn() {
    pollfd ready{ends_[1], POLLIN, 0};
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!under_way_.empty()) ready.events = 0;
    }
    ::poll(&ready, 1, ready.events == 0 ? 0 : 1);
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto now = steady_clock::now();
    can_frame f{};
    while (::recv(ends_[1], &f, sizeof f, MSG_DONTWAIT) == sizeof f) put(true, f);
    if (!is_calm_ && what_.poll.count() != 0 && now >= next_poll_) {
      next_poll_ = now + what_.poll;
      foreign_request(co::error_register);
    }
    if (!is_calm_ && what_.full_load && now >= next_poll_) {
      next_poll_ = now + microseconds(500);
      foreign_request(co::error_register);
      for (unsigned k = 0; k < 4; ++k) {
        can_frame other{};
        other.can_id = static_cast<canid_t>(0x180U + random_() % 0x380U);
        other.can_dlc = 8;
        if (other.can_id != co::sdo_answer_id + node_id) put(false, other);
      }
    }
    if (kill_at_ && now >= *kill_at_) {
      kill_at_.reset();
      ++kills_;
      node_.reset();
      arm_.reset();
      back_at_ = now + gone_for_;
    }
    if (!arm_ && now >= back_at_) start();
    deliver();
    if (!arm_ || now < next_ms_) return;
    next_ms_ = now + milliseconds(1);
    arm_->device->store().poll(++arm_->now_ms);
    node_->poll(arm_->now_ms);
    arm_->step();
  }

  const Disturbance& what_;
  std::mt19937 random_;
  int ends_[2] = {-1, -1};
  bench::Flash flash_;
  std::unique_ptr<bench::Arm> arm_;
  std::unique_ptr<firmware::CanopenNode> node_;
  std::deque<UnderWay> under_way_;
  steady_clock::time_point next_poll_, next_ms_, back_at_;
  std::optional<steady_clock::time_point> kill_at_;
  milliseconds gone_for_{0};
  unsigned kills_ = 0;
  bool is_calm_ = false;
  std::mutex mutex_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

struct Killed {};

const host::ClientOptions quick_options{.response_timeout = milliseconds(300),
                                        .write_timeout = milliseconds(2000)};

std::unique_ptr<host::ControllerClient> client_of(const DisturbedController& far) {
  return host::connect_canopen({host::CanAddress{"disturbed", node_id}}, quick_options, far.client_end());
}

struct Count {
  int active = 0, refused = 0, open = 0, killed = 0, wrong = 0, broken = 0;
  std::map<std::string, int> why;
  double seconds = 0, longest_s = 0;
};

/// What is done over the channel: seven in ten are pushes, the others pushes on trial, confirms and rollbacks.
enum class Transfer { push, trial, confirm, rollback };

Transfer draw_transfer(const wire::Status& before, double draw) {
  if (before.state == static_cast<std::uint16_t>(wire::StoreState::trial))
    return draw < 0.6 ? Transfer::confirm : Transfer::rollback;
  if (before.previous_sequence != 0 && draw < 0.12) return Transfer::rollback;
  return draw < 0.3 ? Transfer::trial : Transfer::push;
}

/// The controller's sets, as the judge sees them.
struct Held {
  wire::Status status;
  Bytes active;
  Bytes permanent;  ///< a restart runs it: the active one, but for a set on trial
  Bytes previous;   ///< rollback returns to it
  bool on_trial() const { return status.state == static_cast<std::uint16_t>(wire::StoreState::trial); }
};

/// What became of a transfer that was begun with `before`, and the sets after it. `is_active` is what the word active says;
/// `is_whole`: one of the sets that may run now does, byte for byte.
struct Judged {
  Held now;
  bool is_active = false;
  bool is_whole = false;
};
Judged judge(DisturbedController& far, const Held& before, Transfer what, const Bytes& image,
             unsigned kills) {
  Judged out;
  Held& now = out.now;
  std::tie(now.status, now.active) =
      far.look([](bench::Arm& arm) { return std::pair(arm.device->status(), arm.pull()); });
  const bool is_sent = host::identity(image).is_active(now.status) && now.active == image;
  // A restart ends a trial.
  const bool may_have_reverted = kills != 0 && before.on_trial();
  switch (what) {
    case Transfer::push:
    case Transfer::trial:
      out.is_active = is_sent && (what == Transfer::trial) == now.on_trial();
      out.is_whole = is_sent || now.active == before.active;
      break;
    case Transfer::confirm:
      out.is_active = now.active == before.active && !now.on_trial();
      out.is_whole = now.active == before.active || (may_have_reverted && now.active == before.permanent);
      break;
    case Transfer::rollback: {
      const Bytes& other = before.on_trial() ? before.permanent : before.previous;
      out.is_active = now.active == other && !now.on_trial();
      out.is_whole = out.is_active || now.active == before.active;
      break;
    }
  }
  now.permanent = now.on_trial() ? before.permanent : now.active;
  now.previous = now.permanent == before.permanent ? before.previous : before.permanent;
  if (now.status.previous_sequence == 0) now.previous.clear();
  return out;
}

Count transfers_over(const Disturbance& what, int times, std::uint32_t seed) {
  Count out;
  DisturbedController far(what, seed);
  std::mt19937 random(seed + 1);
  const auto draw = [&random] { return std::uniform_real_distribution<double>(0, 1)(random); };
  const auto chance = [&draw](double share) { return share > 0 && draw() < share; };
  const firmware::Robot robot = bench::tx60l();
  Held before;
  for (int k = 0; k < times; ++k) {
    far.disturb();
    const Transfer transfer = draw_transfer(before.status, draw());
    const bool sends = transfer == Transfer::push || transfer == Transfer::trial;
    const Bytes image =
        bench::make_image(robot, before.status.active_sequence + 1, 1, static_cast<std::uint32_t>(k) + 1);
    host::PushOptions options;
    if (transfer == Transfer::trial) options.trial_cycles = trial_cycles;
    const unsigned kills_before = far.kills();
    if (chance(what.kills_controller)) {
      // The shorter commands are over sooner.
      far.kill_in(milliseconds(random() % (sends ? 130 : 30)), milliseconds(random() % 400));
    }
    int frames_left = chance(what.kills_client) ? static_cast<int>(random() % 420) : -1;
    options.progress = [&frames_left](std::size_t, std::size_t) {
      if (frames_left-- == 0) throw Killed{};
    };
    enum class Word { active, refused, open, killed } word = Word::active;
    std::string why;
    const auto start = steady_clock::now();
    try {
      const auto client = client_of(far);
      if (sends) host::push_image(*client, image, options);
      if (transfer == Transfer::confirm) host::confirm_trial(*client);
      if (transfer == Transfer::rollback) host::roll_back(*client);
    } catch (const host::OutcomeOpen& e) {
      word = Word::open;
      why = e.what();
    } catch (const host::BusError& e) {
      word = Word::refused;
      why = e.what();
    } catch (const Killed&) {
      word = Word::killed;
    }
    const double took = std::chrono::duration<double>(steady_clock::now() - start).count();
    out.seconds += took;
    out.longest_s = std::max(out.longest_s, took);
    if (!why.empty()) ++out.why[why];
    far.calm();
    // The judge looks into the controller, not over the bus.
    const unsigned kills = far.kills() - kills_before;
    const Judged judged = judge(far, before, transfer, image, kills);
    if (!judged.is_whole) ++out.broken;
    // What a restart ended after the word, or before a rollback, is no untrue word.
    const bool restart_ended_trial = kills != 0 && (transfer == Transfer::trial || before.on_trial());
    const bool told_wrong = (word == Word::active && !judged.is_active && !restart_ended_trial) ||
                            (word == Word::refused && judged.is_active &&
                             !(transfer == Transfer::rollback && restart_ended_trial));
    if (told_wrong) ++out.wrong;
    if (!judged.is_whole || told_wrong)
      std::printf("  %s %d: transfer %d, word %d, is so %d, whole %d: %s\n", what.name, k,
                  static_cast<int>(transfer), static_cast<int>(word), judged.is_active, judged.is_whole,
                  why.c_str());
    ++(word == Word::active    ? out.active
       : word == Word::refused ? out.refused
       : word == Word::open    ? out.open
                               : out.killed);
    if (sends && (word == Word::open || word == Word::killed)) {
      // What push --resume does, over a channel without disturbances.
      const auto client = client_of(far);
      const bool found = host::read_back(*client, image).has_value();
      if (found != (judged.now.active == image)) ++out.wrong;
    }
    before = judged.now;
  }
  return out;
}

TEST(DisturbedCan, EveryTransferEndsInATrueWord) {
  const char* const text = std::getenv("FLEXCOMP_TRANSFERS");
  const int all = text == nullptr ? 55 : std::atoi(text);
  const int each =
      std::max(1, (all + static_cast<int>(disturbances.size()) - 1) / static_cast<int>(disturbances.size()));
  std::printf(
      "| CAN: %-36s | transfers | active | refused | open | client killed | untrue | not whole | mean s | "
      "longest s |\n",
      "channel");
  std::uint32_t seed = 16;
  for (const Disturbance& what : disturbances) {
    const Count c = transfers_over(what, each, seed += 10);
    std::printf("| %-41s | %9d | %6d | %7d | %4d | %13d | %6d | %9d | %6.2f | %9.2f |\n", what.name, each,
                c.active, c.refused, c.open, c.killed, c.wrong, c.broken, c.seconds / each, c.longest_s);
    if (std::getenv("FLEXCOMP_REASONS") != nullptr) {
      for (const auto& [why, count] : c.why) std::printf("    %d x %s\n", count, why.c_str());
    }
    std::fflush(stdout);
    EXPECT_EQ(c.wrong, 0) << what.name;
    EXPECT_EQ(c.broken, 0) << what.name;
    if (what.exact) {
      EXPECT_GE(c.active, each - std::max(each / 100, text == nullptr ? 1 : 0)) << what.name;
    }
  }
}

}  // namespace
}  // namespace flexcomp::hil
