// SPDX-License-Identifier: Apache-2.0
// The parameter store on non-volatile memory whose power fails anywhere: in and between operations, once and twice in a row,
// with units that read differently from start to start. FLEXCOMP_LONG_CUTS=1000000 makes the long run (docs/safety.md).
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>

#include "firmware/bench.hpp"

namespace flexcomp::firmware::bench {
namespace {

using wire::Answer;
using wire::Command;

constexpr std::uint32_t unit = 32;

/// Non-volatile memory in units of 32 bytes. Where the power goes, a unit that is written or erased may be old, new, a mixture for
/// good, unreadable, or marginal: then it reads as any of these, anew at each start, now and then at each reading.
class MarginalFlash {
 public:
  explicit MarginalFlash(std::uint64_t seed) : random_(seed) {
    for (auto& slot : slots_) slot.fill(erased_unit());
  }

  /// Storage steps until the power goes; -1: it stays. A unit written is a step, an erase is eight.
  long power = -1;
  unsigned double_writes = 0;  ///< of units that were whole
  bool wears_out = false;      ///< now and then a write fails
  std::map<std::string, long> cuts;

  /// A start: what is marginal is drawn anew.
  void start() {
    for (auto& slot : slots_) {
      for (Unit& u : slot) draw(u);
    }
  }

  /// A unit rots: becomes marginal between what it holds and noise.
  void rot(unsigned slot, std::size_t index) {
    Unit& u = slots_[slot][index];
    u.other = u.now;
    u.other[random_() % unit] ^= static_cast<std::uint8_t>(1U << (random_() % 8));
    u.is_marginal = true;
    u.written = true;
    draw(u);
  }

  Storage hooks() {
    Storage s;
    s.user = this;
    s.read = [](void* self, unsigned slot, std::uint32_t offset, std::uint8_t* to, std::uint32_t size) {
      return static_cast<MarginalFlash*>(self)->read(slot, offset, to, size);
    };
    s.erase = [](void* self, unsigned slot) { return static_cast<MarginalFlash*>(self)->erase(slot); };
    s.write = [](void* self, unsigned slot, std::uint32_t offset, const std::uint8_t* from,
                 std::uint32_t size) {
      return static_cast<MarginalFlash*>(self)->write(slot, offset, from, size);
    };
    return s;
  }

 private:
  using Content = std::array<std::uint8_t, unit>;
  struct Unit {
    Content now;    ///< what it holds
    Content other;  ///< what it may also be read as
    Content seen;   ///< what it reads as since the start
    bool is_marginal = false;
    bool flickers = false;  ///< with each reading
    bool fails = false;     ///< to be read
    bool written = false;   ///< since the last erase
  };
  static Unit erased_unit() {
    Unit u;
    u.now.fill(0xFF);
    u.other = u.seen = u.now;
    return u;
  }

  Content mixture(const Content& a, const Content& b) {
    Content m;
    for (std::size_t k = 0; k < unit; ++k) {
      const auto which = static_cast<std::uint8_t>(random_());
      m[k] = static_cast<std::uint8_t>((a[k] & which) | (b[k] & ~which));
    }
    return m;
  }

  void draw(Unit& u) {
    u.seen = u.now;
    u.fails = false;
    if (!u.is_marginal) return;
    switch (random_() % 4) {
      case 0:
        break;
      case 1:
        u.seen = u.other;
        break;
      case 2:
        u.seen = mixture(u.now, u.other);
        break;
      default:
        u.fails = true;
    }
  }

  /// What the power leaves of a unit on its way to `to`.
  void cut(Unit& u, const Content& to) {
    const Content from = u.now;
    switch (random_() % 5) {
      case 0:  // nothing has happened
        ++cuts["unit old"];
        break;
      case 1:  // it had just ended
        ++cuts["unit new"];
        u.now = to;
        break;
      case 2:
        ++cuts["unit mixed"];
        u.now = mixture(from, to);
        break;
      default:
        ++cuts["unit marginal"];
        u.now = random_() % 2 != 0 ? from : to;
        u.other = u.now == from ? to : from;
        u.is_marginal = true;
        u.flickers = random_() % 4 == 0;
    }
    u.written = true;
    if (u.now == erased_unit().now && !u.is_marginal) u.written = false;
  }

  StorageResult read(unsigned slot, std::uint32_t offset, std::uint8_t* to, std::uint32_t size) {
    bool fails = false;
    for (std::uint32_t k = 0; k < size;) {
      Unit& u = slots_[slot][(offset + k) / unit];
      if (u.flickers) draw(u);
      fails = fails || u.fails;
      const std::uint32_t from = (offset + k) % unit, n = std::min(unit - from, size - k);
      std::memcpy(to + k, u.seen.data() + from, n);
      k += n;
    }
    return fails ? StorageResult::failed : StorageResult::done;
  }

  StorageResult write(unsigned slot, std::uint32_t offset, const std::uint8_t* from, std::uint32_t size) {
    for (std::uint32_t k = 0; k < size; k += unit) {
      Unit& u = slots_[slot][(offset + k) / unit];
      Content to;
      std::memcpy(to.data(), from + k, unit);
      if (u.written && u.seen != erased_unit().now) ++double_writes;
      if (u.written) {  // it only looked erased: anything
        to = mixture(to, u.is_marginal ? mixture(u.now, u.other) : u.now);
        for (std::size_t b = 0; b < unit; ++b) to[b] &= u.now[b];
      }
      if (power == 0) {
        cut(u, to);
        throw PowerCut{};
      }
      if (power > 0) --power;
      if (wears_out && random_() % 40 == 0) {
        cut(u, to);
        draw(u);
        return StorageResult::failed;
      }
      u.now = u.seen = to;
      u.is_marginal = u.flickers = u.fails = false;
      u.written = true;
    }
    return StorageResult::done;
  }

  StorageResult erase(unsigned slot) {
    if (power >= 0 && power < 8) {
      const unsigned how = static_cast<unsigned>(random_() % 4);
      const std::size_t to = random_() % slots_[slot].size();
      std::size_t at = 0;
      for (Unit& u : slots_[slot]) {
        const bool is_reached = how == 0   ? at < to
                                : how == 1 ? true
                                : how == 2 ? random_() % 2 != 0
                                           : random_() % 16 == 0;
        ++at;
        if (!is_reached) continue;
        if (how == 0) {
          u = erased_unit();
        } else {
          cut(u, erased_unit().now);
        }
      }
      ++cuts["erase"];
      throw PowerCut{};
    }
    if (power >= 8) power -= 8;
    for (Unit& u : slots_[slot]) u = erased_unit();
    return StorageResult::done;
  }

  std::array<std::array<Unit, slot_bytes / unit>, 2> slots_;
  std::mt19937_64 random_;
};

Bytes small_image(const Robot& robot, std::uint32_t sequence, std::uint64_t seed) {
  Term<Scalar> t;
  t.place = {2, slot::theta};
  t.basis = Basis::load_torque;
  t.joint = 1;
  t.coefficient = static_cast<Scalar>(1e-6 * static_cast<double>(1 + seed % 100));
  return image_of(robot, sequence, {&t, 1, nullptr, 0, nullptr, 0});
}

/// A controller between two failures of its power.
class Session {
 public:
  explicit Session(MarginalFlash& flash) : robot(tx60l()) {
    flash.start();
    device = std::make_unique<Device>(robot, flash.hooks(), DeviceSettings{});
    device->store().boot();
    step();
  }
  void step() { device->step({}, default_context<Scalar>(robot)); }
  void settle() {
    for (int k = 0;
         k < 400 && device->status().state == static_cast<std::uint16_t>(wire::StoreState::working); ++k) {
      device->store().poll(now_ms += 1);
      step();
    }
  }
  Answer push(const Bytes& image, Command how, std::uint32_t argument = 0) {
    Store& store = device->store();
    Answer a = store.run(Command::begin, static_cast<std::uint32_t>(image.size()), 1);
    if (a == Answer::accepted) a = store.write(0, image.data(), static_cast<std::uint32_t>(image.size()), 1);
    if (a == Answer::accepted) a = store.run(how, argument, 1);
    if (a != Answer::accepted) return a;
    settle();
    return static_cast<Answer>(device->status().answer);
  }
  Answer run(Command c) {
    const Answer a = run_unlocked(device->store(), c);
    if (a != Answer::accepted) return a;
    settle();
    return static_cast<Answer>(device->status().answer);
  }
  Bytes pull() {
    Bytes out(device->store().active_bytes());
    if (!device->store().read_active(0, out.data(), static_cast<std::uint32_t>(out.size()))) out.clear();
    return out;
  }
  /// The set in use, by what the store says of it.
  std::uint32_t sequence() const { return device->store().active_sequence(); }

  Robot robot;
  std::unique_ptr<Device> device;
  std::uint32_t now_ms = 0;
};

struct Tally {
  long cuts = 0, lost = 0, mixed = 0, changed = 0;
};

/// Random operations on one memory with `count` cuts.
void torture(std::uint64_t seed, long count, bool rots, Tally& tally, MarginalFlash& flash) {
  std::mt19937_64 random(seed);
  const auto below = [&random](std::uint64_t n) { return static_cast<long>(random() % n); };
  std::map<std::uint32_t, Bytes> known;  // by sequence
  std::uint32_t now = 0;                 // sequence in use, 0: none
  std::uint32_t newest = 0;
  std::uint32_t rotten = 0;  // set in use of which one unit has rotted
  auto session = std::make_unique<Session>(flash);
  const auto restart = [&] {
    session.reset();
    session = std::make_unique<Session>(flash);
  };
  const auto say = [&](const char* what, long done, std::uint32_t was, std::uint32_t is) {
    std::printf("seed %llu after %ld cuts: %s, set %u, then %u\n", static_cast<unsigned long long>(seed),
                done, what, was, is);
  };
  for (long done = 0; done < count;) {
    const std::uint32_t before = session->sequence(), previous = session->device->status().previous_sequence;
    std::uint32_t after = before;
    const long what = below(10);
    // Where the power goes: anywhere in the operation, at times behind it.
    flash.power = below(4) != 0 ? below(36) : -1;
    flash.wears_out = rots && below(8) == 0;
    bool is_cut = false;
    try {
      if (what < 6) {
        after = newest = std::max(newest, before) + 1 + static_cast<std::uint32_t>(below(3));
        const Bytes image = small_image(session->robot, after, random());
        known[after] = image;
        if (what < 4) {
          if (session->push(image, Command::commit) != Answer::accepted) after = before;
        } else {
          Answer a = session->push(image, Command::commit_trial, 100000);
          if (a == Answer::accepted && what == 4) a = session->run(Command::confirm);
          if (a != Answer::accepted || what == 5) {
            after = before;
            if (session->device->status().state == static_cast<std::uint16_t>(wire::StoreState::trial))
              session->run(Command::rollback);
          }
        }
      } else if (what < 8) {
        after = previous;
        if (after == 0 || session->run(Command::rollback) != Answer::accepted) after = before;
      } else if (what == 8 && below(6) == 0) {
        after = 0;
        if (session->run(Command::restore_defaults) != Answer::accepted) after = before;
      }
      flash.wears_out = false;
      if (session->sequence() != after) {
        say("not what was acknowledged", done, after, session->sequence());
        ++tally.lost;
      }
    } catch (const PowerCut&) {
      is_cut = true;
    }
    flash.wears_out = false;
    if (!is_cut && flash.power >= 0) {
      // It goes between two operations.
      is_cut = below(2) != 0;
      flash.power = -1;
    }
    if (rots && !is_cut && below(20) == 0) {
      // One copy of the seal of the set in use, a mark, or anything of the other slot.
      const std::uint16_t active = session->device->store().active_slot();
      if (active != wire::no_slot) {
        if (rotten != session->sequence() && below(2) != 0) {
          rotten = session->sequence();
          flash.rot(active, slot_bytes / unit - 1 - static_cast<std::size_t>(below(4)));
        } else {
          flash.rot(active ^ 1U, static_cast<std::size_t>(below(slot_bytes / unit)));
        }
      }
    }
    if (is_cut) {
      ++done;
      ++tally.cuts;
      // And again while it starts.
      for (int n = 0; n < 1 && below(3) == 0; ++n) {
        flash.power = below(12);
        try {
          restart();
        } catch (const PowerCut&) {
          ++done;
          ++tally.cuts;
        }
      }
      flash.power = -1;
      restart();
      now = session->sequence();
      if (now != before && now != after) {
        say("neither the set before nor the one after", done, before, now);
        if (now == 0 || now == previous) {
          ++tally.lost;
        } else {
          ++tally.mixed;
        }
      }
    } else {
      now = session->sequence();
    }
    for (int plain = 0; plain < 3; ++plain) {
      if (now != 0 && session->pull() != known[now]) {
        ++tally.mixed;
      }
      if (plain == 2 || (!is_cut && below(8) != 0)) break;
      restart();
      if (session->sequence() != now) {
        say("changed", done, now, session->sequence());
        ++tally.changed;
        now = session->sequence();
      }
    }
    while (known.size() > 200) known.erase(known.begin());
  }
}

TEST(StoreTorture, NothingIsLostMixedOrChanged) {
  const char* text = std::getenv("FLEXCOMP_LONG_CUTS");
  const long count = text != nullptr ? std::atol(text) : 20000;
  for (const bool rots : {false, true}) {
    Tally tally;
    std::map<std::string, long> cuts;
    unsigned double_writes = 0;
    for (std::uint64_t seed = 0; tally.cuts < count / 2; ++seed) {
      MarginalFlash flash(1000 + seed);
      torture(seed, std::min(1000L, count / 2 - tally.cuts), rots, tally, flash);
      for (const auto& [kind, n] : flash.cuts) cuts[kind] += n;
      double_writes += flash.double_writes;
    }
    std::printf("[ measured ] %ld cuts%s: %ld sets lost, %ld mixed, %ld changed between plain starts;",
                tally.cuts, rots ? ", units that rot and wear" : "", tally.lost, tally.mixed, tally.changed);
    for (const auto& [kind, n] : cuts) std::printf(" %s %ld", kind.c_str(), n);
    std::printf(", %u double writes\n", double_writes);
    EXPECT_EQ(tally.lost, 0);
    EXPECT_EQ(tally.mixed, 0);
    EXPECT_EQ(tally.changed, 0);
    EXPECT_EQ(double_writes, 0U);
  }
}

}  // namespace
}  // namespace flexcomp::firmware::bench
