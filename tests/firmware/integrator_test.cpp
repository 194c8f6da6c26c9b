// SPDX-License-Identifier: Apache-2.0
// What flexcomp.h gives to integrators beside the step: feed-forward, calls at joint readings, sets by bytes, hooks,
// diagnostics, the checks of init. In double and in float.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "bench.hpp"
#include "flexcomp.h"
#include "flexcomp/arm_state.hpp"

namespace flexcomp::firmware::integrator {

using bench::Bytes;
using bench::real;
constexpr bool in_double = sizeof(Scalar) == 8;
constexpr double two_pi = 6.283185307179586;

/// An arm behind the C interface with two slots in RAM and a log.
class CArm {
 public:
  using Log = std::vector<std::pair<unsigned, std::uint32_t>>;

  flexcomp_memory memory;
  std::array<std::array<std::uint8_t, slot_bytes>, 2> slots;
  bool fails = false;
  unsigned forbidden = 0;  ///< bit of a command that `permit` refuses
  unsigned asked_local = 0;
  Log log;
  flexcomp_settings settings;
  flexcomp_robot robot;
  flexcomp_storage storage;
  flexcomp_arm* fc = nullptr;
  std::uint32_t now_ms = 0;

  explicit CArm(std::uint32_t cycle_us = 1000) : robot(bench_robot()) {
    for (auto& s : slots) s.fill(0xFF);
    flexcomp_settings_default(&settings);
    settings.cycle_us = cycle_us;
    storage.user = this;
    storage.read = [](void* self, unsigned slot, std::uint32_t offset, std::uint8_t* to, std::uint32_t size) {
      std::memcpy(to, static_cast<CArm*>(self)->slots[slot].data() + offset, size);
      return FLEXCOMP_STORAGE_DONE;
    };
    storage.erase = [](void* self, unsigned slot) {
      if (static_cast<CArm*>(self)->fails) return FLEXCOMP_STORAGE_FAILED;
      static_cast<CArm*>(self)->slots[slot].fill(0xFF);
      return FLEXCOMP_STORAGE_DONE;
    };
    storage.write = [](void* self, unsigned slot, std::uint32_t offset, const std::uint8_t* from,
                       std::uint32_t size) {
      std::memcpy(static_cast<CArm*>(self)->slots[slot].data() + offset, from, size);
      return FLEXCOMP_STORAGE_DONE;
    };
    start();
  }
  CArm(const CArm&) = delete;
  CArm& operator=(const CArm&) = delete;

  static flexcomp_robot bench_robot() {
    const Robot from = bench::tx60l();
    flexcomp_robot r;
    flexcomp_robot_default(&r);
    r.name = "bench";
    for (std::size_t j = 0; j < joints; ++j) {
      const NominalLink& link = from.links[j];
      r.links[j] = {link.theta_rad, link.d_m, link.a_m, link.alpha_rad, link.beta_rad};
      r.min_rad[j] = from.limits[j].min_rad;
      r.max_rad[j] = from.limits[j].max_rad;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      r.tool_xyz_m[k] = from.tool_xyz_m[k];
      r.payload_com_m[k] = from.payload_com_m[k];
    }
    r.payload_kg = from.payload_kg;
    return r;
  }

  /// Power-up: init, hooks, boot.
  void start() {
    fc = flexcomp_init(&memory, sizeof memory, &robot, &settings, &storage);
    ASSERT_NE(fc, nullptr);
    flexcomp_hooks hooks;
    hooks.user = this;
    hooks.permit = [](void* self, unsigned command, unsigned is_local) {
      auto& arm = *static_cast<CArm*>(self);
      arm.asked_local += is_local;
      return (arm.forbidden >> command) & 1U ? 0U : 1U;
    };
    hooks.log = [](void* self, unsigned event, std::uint32_t detail) {
      static_cast<CArm*>(self)->log.emplace_back(event, detail);
    };
    flexcomp_set_hooks(fc, &hooks);
    flexcomp_boot(fc);
  }

  flexcomp_state state() const {
    flexcomp_state s;
    flexcomp_get_state(fc, &s);
    return s;
  }

  /// Background and cycle until the store has ended its work.
  flexcomp_state settle(const Joints& q = {}, unsigned polls = 400) {
    for (unsigned k = 0; k < polls; ++k) {
      flexcomp_poll(fc, now_ms += 1);
      step(q);
    }
    return state();
  }

  Joints step(const Joints& q, const flexcomp_context* context = nullptr) {
    Joints out;
    last = flexcomp_step(fc, q.data(), context, out.data());
    return out;
  }

  /// Stages in portions of 100 bytes.
  unsigned stage(const Bytes& image) {
    unsigned answer = flexcomp_stage_begin(fc, static_cast<std::uint32_t>(image.size()));
    for (std::size_t at = 0; answer == 0 && at < image.size(); at += 100) {
      const std::size_t size = std::min<std::size_t>(100, image.size() - at);
      answer = flexcomp_stage_write(fc, static_cast<std::uint32_t>(at), image.data() + at,
                                    static_cast<std::uint32_t>(size));
    }
    return answer;
  }

  /// Makes a set active; the state after it.
  flexcomp_state push(const Bytes& image, const Joints& q = {}) {
    EXPECT_EQ(stage(image), 0U);
    EXPECT_EQ(flexcomp_stage_commit(fc), 0U);
    return settle(q);
  }

  Log take_log() { return std::exchange(log, {}); }

  flexcomp_status last = FLEXCOMP_NO_SET;
};

Bytes bench_image(std::uint32_t sequence, double size = 1, std::uint32_t seed = 1) {
  return bench::make_image(bench::tx60l(), sequence, size, seed);
}

/// Poses away from singularities of the bench arm: elbow bent, wrist bent, tool off axis 1.
Joints regular_pose(std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1, 1);
  return {real(1.5 * unit(random)), real(0.5 + 0.3 * unit(random)), real(1.2 + 0.3 * unit(random)),
          real(unit(random)),       real(1.1 + 0.3 * unit(random)), real(unit(random))};
}

bool all_finite(const Joints& v) {
  FiniteCheck<Scalar> check;
  check.add(v);
  return check.passed();
}

double norm(const Joints& v) {
  double sum = 0;
  for (const Scalar x : v) sum += static_cast<double>(x) * static_cast<double>(x);
  return std::sqrt(sum);
}

TEST(StepRate, IsTheDerivativeOfTheStepAtRegularPoses) {
  const Bytes image = bench_image(1);
  CArm arm(1000000);  // a cycle of a second: nothing is too fast
  arm.push(image);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  const double h = in_double ? 5e-4 : 2e-2;
  double worst = 0;
  int poses = 0;
  for (int n = 0; n < 200; ++n) {
    const Joints q = regular_pose(random);
    Joints v;
    // Every joint moves, so that its direction reaches an end.
    for (Scalar& x : v) x = real((0.3 + std::abs(unit(random))) * (unit(random) > 0 ? 1 : -1));
    const auto at = [&](double t) {
      Joints out;
      for (std::size_t j = 0; j < joints; ++j)
        out[j] = real(static_cast<double>(q[j]) + t * static_cast<double>(v[j]));
      return out;
    };
    // On the way to the pose the event of the jump settles.
    for (int k = 5; k > 1; --k) arm.step(at(-0.01 * k));
    const Joints far_before = arm.step(at(-2 * h));
    const Joints before = arm.step(at(-h));
    ASSERT_EQ(arm.last, FLEXCOMP_OK);
    Joints out, rate;
    ASSERT_EQ(flexcomp_step_rate(arm.fc, q.data(), v.data(), nullptr, out.data(), rate.data()), FLEXCOMP_OK);
    const Joints after = arm.step(at(h));
    const Joints far_after = arm.step(at(2 * h));
    ASSERT_EQ(arm.last, FLEXCOMP_OK);
    Joints off, bend;
    for (std::size_t j = 0; j < joints; ++j) {
      const auto difference = [j](const Joints& b, const Joints& a) {
        return static_cast<double>(b[j]) - static_cast<double>(a[j]);
      };
      const double narrow = difference(after, before);
      const double wide = difference(far_after, far_before);
      off[j] = real((8 * narrow - wide) / (12 * h) - static_cast<double>(rate[j]));
      bend[j] = real((difference(far_after, out) - difference(out, far_before)) / (2 * h));
    }
    // Between two values of its table the curve is straight: at a value it has no derivative.
    if (norm(bend) > 1e-4 && in_double) continue;
    ++poses;
    worst = std::max(worst, norm(off) / norm(v));
  }
  EXPECT_GT(poses, 150);
  std::printf("step_rate against differences of the step: %.1e relative\n", worst);
  EXPECT_LT(worst, in_double ? 1e-6 : 2e-3);
}

/// A path at rest at both ends, with its rate.
void path(double t, double end, Joints& q, Joints& rate) {
  const double w = two_pi / end;
  const double at = 0.5 * (1 - std::cos(w * t));
  const double speed = 0.5 * w * std::sin(w * t);
  const double from[6] = {0.2, 0.4, 1.1, -0.5, 0.9, 0.1};
  const double way[6] = {1.2, 0.3, -0.4, 1.1, 0.3, -1.4};
  for (std::size_t j = 0; j < joints; ++j) {
    q[j] = real(from[j] + way[j] * at);
    rate[j] = real(way[j] * speed);
  }
}

TEST(StepRate, IntegralFollowsTheOutputOverAPathWithEvents) {
  CArm arm;
  CArm twin;  // by flexcomp_step alone
  constexpr int cycles = 8000;
  Joints q, v;
  path(0, 8, q, v);
  for (CArm* a : {&arm, &twin}) a->push(bench_image(1), q);
  for (CArm* a : {&arm, &twin}) {
    ASSERT_EQ(a->stage(bench_image(2, 1.5, 9)), 0U);
    ASSERT_EQ(flexcomp_stage_verify(a->fc), 0U);
    for (int k = 0; k < 100; ++k) flexcomp_poll(a->fc, 1);
  }
  flexcomp_context context;
  flexcomp_context_default(arm.fc, &context);
  std::array<double, joints> integral{};
  double worst = 0;
  std::uint32_t flags = 0;
  unsigned stood = 0;
  for (int k = 0; k <= cycles; ++k) {
    path(k * 1e-3, 8, q, v);
    if (k == 1500) context.payload_kg += 3;
    if (k == 2500) context.force_n[0] = 200;
    if (k == 4500) {
      for (CArm* a : {&arm, &twin}) flexcomp_stage_commit(a->fc);
    }
    if (k > 4500 && k < 4800) {
      for (CArm* a : {&arm, &twin}) flexcomp_poll(a->fc, static_cast<std::uint32_t>(k));
    }
    if (k >= 3500 && k < 3505) q[2] = std::numeric_limits<Scalar>::quiet_NaN();
    Joints out, rate;
    flexcomp_step_rate(arm.fc, q.data(), v.data(), &context, out.data(), rate.data());
    flags |= flexcomp_step_flags(arm.fc);
    const Joints alone = twin.step(q, &context);
    ASSERT_EQ(alone, out) << k;
    ASSERT_TRUE(all_finite(rate)) << k;
    if (k >= 3500 && k < 3506) {
      EXPECT_EQ(norm(rate), 0) << k;
      ++stood;
    }
    if (k == 0) {
      for (std::size_t j = 0; j < joints; ++j) integral[j] = static_cast<double>(out[j]);
      continue;
    }
    for (std::size_t j = 0; j < joints; ++j) {
      integral[j] += 1e-3 * static_cast<double>(rate[j]);
      // The rectangle rule is off by half a cycle's change of the rate, until the path is at rest again.
      const double rectangle = 0.5e-3 * std::abs(static_cast<double>(rate[j]));
      worst = std::max(worst, std::abs(integral[j] - static_cast<double>(out[j])) - rectangle);
    }
  }
  EXPECT_EQ(stood, 6U);
  EXPECT_EQ(arm.state().active_sequence, 2U);
  EXPECT_NE(flags & FLEXCOMP_FLAG_SETTLING, 0U);
  EXPECT_NE(flags & FLEXCOMP_FLAG_REFUSED, 0U);
  std::printf("integral of the rate against the output: %.1e rad\n", worst);
  // Of which 1e-4 is the stop at the refusals: half a cycle of the rate, as above, that is never returned.
  EXPECT_LT(worst, 1.5e-4);
}

TEST(StepRate, IsFiniteAndPlainWhereThereIsNoAnswer) {
  CArm arm;
  Joints q = bench::some_joints();
  const Joints v = {1, -1, real(0.5), 0, 0, 2};
  Joints out, rate;
  EXPECT_EQ(flexcomp_step_rate(arm.fc, q.data(), v.data(), nullptr, out.data(), rate.data()),
            FLEXCOMP_NO_SET);
  EXPECT_EQ(rate, v);
  arm.push(bench_image(1), q);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::uint32_t flags = 0;
  for (int k = 0; k < 20000; ++k) {
    Joints w;
    for (std::size_t j = 0; j < joints; ++j) {
      // Through all singularities and beyond the limits, and now and then what no program means.
      q[j] = real(2.3 * std::sin(k * 1e-3 * static_cast<double>(j + 1)));
      w[j] = real(2.3e-0 * static_cast<double>(j + 1) * std::cos(k * 1e-3 * static_cast<double>(j + 1)));
    }
    const auto j = static_cast<std::size_t>(k % 6);
    if (k % 97 == 0) w[j] = std::numeric_limits<Scalar>::max();
    if (k % 101 == 0) w[j] = std::numeric_limits<Scalar>::quiet_NaN();
    if (k % 103 == 0) q[j] = real(1e30);
    flexcomp_step_rate(arm.fc, q.data(), w.data(), nullptr, out.data(), rate.data());
    flags |= flexcomp_step_flags(arm.fc);
    ASSERT_TRUE(all_finite(rate) && all_finite(out)) << k;
    if ((flexcomp_step_flags(arm.fc) & FLEXCOMP_FLAG_REFUSED) != 0) {
      ASSERT_EQ(norm(rate), 0);
    }
  }
  EXPECT_NE(flags & FLEXCOMP_FLAG_NEAR_SINGULAR, 0U);
}

TEST(AtReadings, UncorrectFindsTheCommandAndTheToolIsWhereTheNominalArmHasIt) {
  const Bytes image = bench_image(1);
  CArm arm(1000000);
  EXPECT_EQ(flexcomp_tool_pose(arm.fc, Joints{}.data(), nullptr, nullptr, nullptr), 0);
  EXPECT_EQ(flexcomp_joint_loads(arm.fc, Joints{}.data(), nullptr, nullptr, nullptr), 0);
  Joints back;
  Joints q = bench::some_joints();
  EXPECT_EQ(flexcomp_uncorrect(arm.fc, q.data(), nullptr, back.data()), 1);  // no set
  EXPECT_EQ(back, q);
  arm.push(image);
  auto model = std::make_unique<FirmwareModel>();
  ASSERT_EQ(model_from_image(image.data(), image.size(), bench::tx60l(), *model), Refusal::none);
  FirmwareContext context = default_context<Scalar>(bench::tx60l());
  std::mt19937 random(11);
  double joint = 0, position = 0, turn = 0;
  for (int n = 0; n < 200; ++n) {
    q = regular_pose(random);
    Joints reading;
    for (int k = 0; k < 4; ++k) reading = arm.step(q);
    ASSERT_EQ(arm.last, FLEXCOMP_OK);
    ASSERT_EQ(flexcomp_uncorrect(arm.fc, reading.data(), nullptr, back.data()), 1);
    joint = std::max(joint, bench::distance(back, q));
    Scalar xyz[3], wxyz[4];
    ASSERT_EQ(flexcomp_tool_pose(arm.fc, reading.data(), nullptr, xyz, wxyz), 1);
    const Pose<Scalar> nominal = nominal_forward(*model, q);
    const double w = wxyz[0], x = wxyz[1], y = wxyz[2], z = wxyz[3];
    EXPECT_GE(w, 0);
    const double rotation[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                                   {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                                   {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
    for (int r = 0; r < 3; ++r) {
      position = std::max(position, std::abs(static_cast<double>(xyz[r] - nominal.position[r])));
      for (int c = 0; c < 3; ++c)
        turn = std::max(turn, std::abs(rotation[r][c] - static_cast<double>(nominal.rotation(r, c))));
    }
    Joints torque, deflection;
    ASSERT_EQ(flexcomp_joint_loads(arm.fc, reading.data(), nullptr, torque.data(), deflection.data()), 1);
    flexcomp_diagnostics d;
    d.struct_size = sizeof d;
    ASSERT_EQ(flexcomp_get_diagnostics(arm.fc, &d), 1);
    for (std::size_t j = 0; j < joints; ++j) context.direction[j] = d.direction[j];
    const JointLoads<Scalar, joints> expected = joint_loads(*model, reading, context);
    for (std::size_t j = 0; j < joints; ++j) {
      EXPECT_NEAR(torque[j], expected.torque_nm[j], in_double ? 1e-12 : 1e-5);
      EXPECT_NEAR(deflection[j], expected.deflection_rad[j], in_double ? 1e-12 : 1e-8);
    }
  }
  std::printf("uncorrect: %.1e rad, tool pose: %.1e m, %.1e\n", joint, position, turn);
  EXPECT_LT(joint, in_double ? 1e-9 : 1e-5);
  EXPECT_LT(position, in_double ? 1e-8 : 1e-5);
  EXPECT_LT(turn, in_double ? 1e-8 : 1e-5);

  q[3] = std::numeric_limits<Scalar>::quiet_NaN();
  Joints untouched = {7, 7, 7, 7, 7, 7};
  EXPECT_EQ(flexcomp_uncorrect(arm.fc, q.data(), nullptr, back.data()), 0);
  EXPECT_EQ(flexcomp_tool_pose(arm.fc, q.data(), nullptr, untouched.data(), untouched.data()), 0);
  EXPECT_EQ(flexcomp_joint_loads(arm.fc, q.data(), nullptr, untouched.data(), untouched.data()), 0);
  EXPECT_EQ(untouched[0], 7);
  q = bench::some_joints();
  q[3] = real(2.5);  // beyond its limit
  EXPECT_EQ(flexcomp_uncorrect(arm.fc, q.data(), nullptr, back.data()), 0);
  flexcomp_context bad;
  flexcomp_context_default(arm.fc, &bad);
  bad.force_n[2] = std::numeric_limits<Scalar>::infinity();
  EXPECT_EQ(flexcomp_tool_pose(arm.fc, bench::some_joints().data(), &bad, untouched.data(), untouched.data()),
            0);
  // Finite, and its torque is not: nothing of it goes out.
  bad.force_n[2] = std::numeric_limits<Scalar>::max();
  bad.payload_com_m[0] = std::numeric_limits<Scalar>::max();
  EXPECT_EQ(flexcomp_tool_pose(arm.fc, bench::some_joints().data(), &bad, untouched.data(), untouched.data()),
            0);
  EXPECT_EQ(
      flexcomp_joint_loads(arm.fc, bench::some_joints().data(), &bad, untouched.data(), untouched.data()), 0);
  EXPECT_EQ(untouched, Joints({7, 7, 7, 7, 7, 7}));
}

TEST(AtReadings, AStartByUncorrectMovesNothing) {
  CArm first;
  first.push(bench_image(1));
  CArm arm;
  arm.slots = first.slots;
  arm.start();  // before any step the set is only requested of the cycle
  std::mt19937 random(2);
  const Joints standing = regular_pose(random);
  Joints command;
  ASSERT_EQ(flexcomp_uncorrect(arm.fc, standing.data(), nullptr, command.data()), 1);
  EXPECT_GT(bench::distance(command, standing), 1e-5);
  ASSERT_EQ(flexcomp_start(arm.fc, standing.data()), 1);
  for (int k = 0; k < 50; ++k)
    EXPECT_LT(bench::distance(arm.step(command), standing), in_double ? 1e-9 : 1e-5);
  EXPECT_EQ(arm.last, FLEXCOMP_OK);
}

TEST(Staging, ByBytesIsRefusedAndAnsweredAsOnAWire) {
  CArm arm;
  Bytes image = bench_image(1);
  EXPECT_EQ(flexcomp_stage_write(arm.fc, 0, image.data(), 4), 2U);  // wrong state
  EXPECT_EQ(flexcomp_stage_begin(arm.fc, 0), 9U);
  EXPECT_EQ(flexcomp_stage_begin(arm.fc, staging_bytes + 1), 1U);
  EXPECT_EQ(arm.state().refusal, static_cast<unsigned>(Refusal::too_long));
  EXPECT_EQ(arm.stage(image), 0U);
  EXPECT_EQ(flexcomp_stage_write(arm.fc, staging_bytes, image.data(), 4), 9U);
  EXPECT_EQ(flexcomp_stage_write(arm.fc, 0, nullptr, 4), 9U);
  EXPECT_EQ(flexcomp_stage_abort(arm.fc), 0U);
  EXPECT_EQ(arm.state().store, 0U);
  EXPECT_EQ(flexcomp_stage_commit(arm.fc), 2U);
  image[100] ^= 1U;
  EXPECT_EQ(arm.stage(image), 0U);
  flexcomp_stage_verify(arm.fc);
  flexcomp_state s = arm.settle();
  EXPECT_EQ(s.answer, 1U);
  EXPECT_EQ(s.refusal, static_cast<unsigned>(Refusal::checksum));
  s = arm.push(bench_image(3));
  EXPECT_EQ(s.answer, 0U);
  EXPECT_EQ(s.active_sequence, 3U);
  // A bus is another client.
  alignas(8) static flexcomp_tcp_memory tcp_memory;
  std::vector<std::uint8_t> reply;
  flexcomp_tcp* tcp = flexcomp_tcp_init(
      &tcp_memory, sizeof tcp_memory, arm.fc, 1,
      [](void* to, const std::uint8_t* bytes, std::size_t size) {
        static_cast<std::vector<std::uint8_t>*>(to)->assign(bytes, bytes + size);
      },
      &reply);
  const std::uint8_t begin[19] = {0, 0, 0, 0, 0, 13, 1, 0x10, 0x00, 0xA0, 0, 3, 6, 0, 0, 0, 200, 0, 1};
  EXPECT_EQ(arm.stage(bench_image(4)), 0U);
  flexcomp_tcp_receive(tcp, begin, sizeof begin);
  EXPECT_EQ(reply.at(7), 0x90);
  EXPECT_EQ(flexcomp_stage_abort(arm.fc), 0U);
  flexcomp_tcp_receive(tcp, begin, sizeof begin);
  EXPECT_EQ(reply.at(7), 0x10);
  EXPECT_EQ(flexcomp_stage_begin(arm.fc, 200), 3U);  // busy
  flexcomp_tcp_reset(tcp);
  arm.forbidden = 1U << FLEXCOMP_COMMAND_BEGIN;
  flexcomp_tcp_receive(tcp, begin, sizeof begin);
  EXPECT_EQ(reply.at(7), 0x90);
  EXPECT_EQ(arm.state().answer, 4U);
}

// A server builds the next connection where the last one was: what that had staged is dropped.
TEST(Buses, AnotherInitInTheSameMemoryEndsTheOldConnection) {
  CArm arm;
  alignas(8) static flexcomp_tcp_memory memory[2];
  alignas(8) static flexcomp_rtu_memory line_memory;
  std::vector<std::uint8_t> reply;
  const flexcomp_send send = [](void* to, const std::uint8_t* bytes, std::size_t size) {
    static_cast<std::vector<std::uint8_t>*>(to)->assign(bytes, bytes + size);
  };
  const std::uint8_t begin[19] = {0, 0, 0, 0, 0, 13, 1, 0x10, 0x00, 0xA0, 0, 3, 6, 0, 0, 0, 200, 0, 1};
  flexcomp_tcp* tcp = flexcomp_tcp_init(&memory[0], sizeof memory[0], arm.fc, 1, send, &reply);
  flexcomp_tcp_receive(tcp, begin, sizeof begin);
  EXPECT_EQ(reply.at(7), 0x10);
  // Other memory is another connection.
  flexcomp_tcp* other = flexcomp_tcp_init(&memory[1], sizeof memory[1], arm.fc, 1, send, &reply);
  flexcomp_tcp_receive(other, begin, sizeof begin);
  EXPECT_EQ(reply.at(7), 0x90);
  tcp = flexcomp_tcp_init(&memory[0], sizeof memory[0], arm.fc, 1, send, &reply);
  EXPECT_EQ(arm.state().store, 0U);
  flexcomp_tcp_receive(other, begin, sizeof begin);
  EXPECT_EQ(reply.at(7), 0x10);
  flexcomp_tcp_reset(other);

  const std::uint8_t begin_rtu[15] = {5, 0x10, 0x00, 0xA0, 0, 3, 6, 0, 0, 0, 200, 0, 1, 0xAE, 0xB8};
  flexcomp_rtu* rtu = flexcomp_rtu_init(&line_memory, sizeof line_memory, arm.fc, 5, 1750, send, &reply);
  flexcomp_rtu_receive(rtu, begin_rtu, sizeof begin_rtu, 0);
  EXPECT_EQ(arm.state().store, 1U);
  flexcomp_rtu_init(&line_memory, sizeof line_memory, arm.fc, 5, 1750, send, &reply);
  EXPECT_EQ(arm.state().store, 0U);
}

TEST(Hooks, LogTellsWhatBecomesOfSets) {
  CArm arm;
  using Log = CArm::Log;
  EXPECT_EQ(arm.take_log(), (Log{{FLEXCOMP_EVENT_BOOTED, 1}}));
  arm.push(bench_image(1));
  EXPECT_EQ(arm.take_log(), (Log{{FLEXCOMP_EVENT_ACTIVATED, 1}}));
  arm.push(bench_image(2, 2));
  EXPECT_EQ(arm.take_log(), (Log{{FLEXCOMP_EVENT_ACTIVATED, 2}}));
  for (int k = 0; k < 2; ++k) {
    ASSERT_EQ(arm.stage(bench_image(2, 3)), 0U);
    flexcomp_stage_verify(arm.fc);
    arm.settle();
    EXPECT_EQ(arm.take_log(),
              (Log{{FLEXCOMP_EVENT_IMAGE_REFUSED, static_cast<std::uint32_t>(Refusal::stale_sequence)}}));
  }
  EXPECT_EQ(flexcomp_command(arm.fc, FLEXCOMP_COMMAND_ROLLBACK), 0U);
  arm.settle();
  EXPECT_EQ(arm.take_log(), (Log{{FLEXCOMP_EVENT_ROLLED_BACK, 1}}));

  ASSERT_EQ(arm.stage(bench_image(3)), 0U);
  ASSERT_EQ(flexcomp_stage_commit_trial(arm.fc, 1000), 0U);
  arm.settle();
  EXPECT_EQ(arm.take_log(), (Log{{FLEXCOMP_EVENT_TRIAL_BEGUN, 3}}));
  arm.settle({}, 1100);
  EXPECT_EQ(arm.take_log(), (Log{{FLEXCOMP_EVENT_TRIAL_REVERTED, 1}}));
  ASSERT_EQ(arm.stage(bench_image(4)), 0U);
  ASSERT_EQ(flexcomp_stage_commit_trial(arm.fc, 0), 0U);
  arm.settle();
  EXPECT_EQ(flexcomp_command(arm.fc, FLEXCOMP_COMMAND_CONFIRM), 0U);
  arm.settle();
  EXPECT_EQ(arm.take_log(), (Log{{FLEXCOMP_EVENT_TRIAL_BEGUN, 4}, {FLEXCOMP_EVENT_TRIAL_CONFIRMED, 4}}));
  ASSERT_EQ(arm.stage(bench_image(5)), 0U);
  ASSERT_EQ(flexcomp_stage_commit_trial(arm.fc, 0), 0U);
  arm.settle();
  EXPECT_EQ(flexcomp_command(arm.fc, FLEXCOMP_COMMAND_ROLLBACK), 0U);
  arm.settle();
  EXPECT_EQ(arm.take_log(), (Log{{FLEXCOMP_EVENT_TRIAL_BEGUN, 5}, {FLEXCOMP_EVENT_ROLLED_BACK, 4}}));

  arm.fails = true;
  ASSERT_EQ(arm.stage(bench_image(6)), 0U);
  flexcomp_stage_commit(arm.fc);
  EXPECT_EQ(arm.settle().answer, 5U);
  EXPECT_EQ(arm.take_log(), (Log{{FLEXCOMP_EVENT_STORAGE_FAILED, FLEXCOMP_COMMAND_COMMIT}}));
  arm.fails = false;

  arm.start();
  EXPECT_EQ(arm.take_log(), (Log{{FLEXCOMP_EVENT_BOOTED, 0}}));
  arm.step({});
  EXPECT_EQ(flexcomp_command(arm.fc, FLEXCOMP_COMMAND_RESTORE_DEFAULTS), 0U);
  arm.settle();
  EXPECT_EQ(arm.take_log(), (Log{{FLEXCOMP_EVENT_RESTORED, 0}}));
}

TEST(Hooks, PermitDecidesAboutEveryCommand) {
  CArm arm;
  arm.push(bench_image(1));
  arm.take_log();
  EXPECT_GT(arm.asked_local, 0U);
  arm.forbidden = 1U << FLEXCOMP_COMMAND_RESTORE_DEFAULTS | 1U << FLEXCOMP_COMMAND_COMMIT;
  EXPECT_EQ(flexcomp_command(arm.fc, FLEXCOMP_COMMAND_RESTORE_DEFAULTS), 4U);
  EXPECT_EQ(arm.state().answer, 4U);
  EXPECT_STREQ(flexcomp_answer_text(4), "not authorised at the controller");
  EXPECT_EQ(arm.settle().active_sequence, 1U);
  EXPECT_EQ(arm.stage(bench_image(2)), 0U);
  EXPECT_EQ(arm.state().answer, 0U);
  EXPECT_EQ(flexcomp_stage_commit(arm.fc), 4U);
  EXPECT_EQ(arm.settle().active_sequence, 1U);
  EXPECT_EQ(arm.take_log(),
            (CArm::Log{{FLEXCOMP_EVENT_NOT_AUTHORISED, 8}, {FLEXCOMP_EVENT_NOT_AUTHORISED, 3}}));
  arm.forbidden = 1U << FLEXCOMP_COMMAND_RESTORE_DEFAULTS;
  EXPECT_EQ(flexcomp_stage_commit(arm.fc), 0U);
  EXPECT_EQ(flexcomp_command(arm.fc, FLEXCOMP_COMMAND_RESTORE_DEFAULTS), 4U);  // while the commit is written
  flexcomp_state s = arm.settle();
  EXPECT_EQ(s.answer, 0U);  // the end of the commit
  EXPECT_EQ(s.active_sequence, 2U);
  flexcomp_set_hooks(arm.fc, nullptr);
  arm.take_log();
  EXPECT_EQ(flexcomp_command(arm.fc, FLEXCOMP_COMMAND_RESTORE_DEFAULTS), 0U);
  EXPECT_EQ(arm.settle().active_sequence, 0U);
  EXPECT_TRUE(arm.log.empty());
}

TEST(Diagnostics, AreThoseOfTheLastStep) {
  CArm arm;
  flexcomp_diagnostics d{};
  EXPECT_EQ(flexcomp_get_diagnostics(arm.fc, &d), 0);
  d.struct_size = sizeof d;
  arm.push(bench_image(1));
  const Joints q = bench::some_joints();
  Joints out = arm.step(q);
  ASSERT_EQ(flexcomp_get_diagnostics(arm.fc, &d), 1);
  EXPECT_EQ(d.cycles, arm.state().cycles);
  EXPECT_EQ(d.status, arm.last);
  EXPECT_EQ(d.flags, flexcomp_step_flags(arm.fc));
  for (int k = 0; k < 3000; ++k) out = arm.step(q);
  flexcomp_context context;
  flexcomp_context_default(arm.fc, &context);
  context.payload_kg += 5;
  out = arm.step(q, &context);
  ASSERT_EQ(flexcomp_get_diagnostics(arm.fc, &d), 1);
  EXPECT_NE(d.flags & FLEXCOMP_FLAG_SETTLING, 0U);
  double offset = 0;
  for (std::size_t j = 0; j < joints; ++j) {
    EXPECT_EQ(d.correction_rad[j], out[j] - q[j]);
    offset = std::max(offset, std::abs(static_cast<double>(d.offset_rad[j])));
  }
  EXPECT_GT(offset, 1e-5);
  EXPECT_GE(d.remaining_orientation_rad, offset) << "what the offset holds back is in it";
  EXPECT_GT(d.remaining_position_m, offset);
  EXPECT_EQ(d.cycles_by_status[FLEXCOMP_OK] + d.cycles_by_status[FLEXCOMP_LIMITED] +
                d.cycles_by_status[FLEXCOMP_NO_SET] + d.cycles_by_status[FLEXCOMP_NEAR_SINGULAR],
            d.cycles);
}

TEST(Init, RefusesAProgramThatWasCompiledOtherwise) {
  static flexcomp_memory memory;
  const flexcomp_robot robot = CArm::bench_robot();
  const auto with = [&](std::size_t which) {
    std::array<std::size_t, 7> build = {FLEXCOMP_BUILD_};
    if (which < build.size()) ++build[which];
    unsigned error = 99;
    const flexcomp_arm* fc =
        flexcomp_init_checked(&memory, sizeof memory, &robot, nullptr, nullptr, &error, build[0], build[1],
                              build[2], build[3], build[4], build[5], build[6]);
    EXPECT_EQ(fc != nullptr, error == FLEXCOMP_INIT_DONE);
    return error;
  };
  EXPECT_EQ(with(7), FLEXCOMP_INIT_DONE);
  EXPECT_EQ(with(0), FLEXCOMP_INIT_OTHER_SCALAR);
  for (std::size_t k = 1; k < 6; ++k) EXPECT_EQ(with(k), FLEXCOMP_INIT_OTHER_CAPACITY) << k;
  EXPECT_EQ(with(6), FLEXCOMP_INIT_OTHER_STRUCTS);

  unsigned error = 99;
  EXPECT_EQ(flexcomp_init_explained(&memory, 100, &robot, nullptr, nullptr, &error), nullptr);
  EXPECT_EQ(error, FLEXCOMP_INIT_MEMORY);
  EXPECT_EQ(flexcomp_init_explained(&memory, sizeof memory, nullptr, nullptr, nullptr, &error), nullptr);
  EXPECT_EQ(error, FLEXCOMP_INIT_ROBOT);
  flexcomp_settings settings;
  flexcomp_settings_default(&settings);
  const auto is_refused = [&] {
    const flexcomp_arm* fc =
        flexcomp_init_explained(&memory, sizeof memory, &robot, &settings, nullptr, &error);
    EXPECT_EQ(fc == nullptr, error == FLEXCOMP_INIT_SETTINGS);
    return fc == nullptr;
  };
  EXPECT_FALSE(is_refused());
  for (const double steepest : {0.0, -1.0, 201.0, std::nan("")}) {
    settings.steepest = real(steepest);
    EXPECT_TRUE(is_refused()) << steepest;
  }
  for (const double steepest : {1.0, 20.0, 200.0}) {
    settings.steepest = real(steepest);
    EXPECT_FALSE(is_refused()) << steepest;
  }
  for (const double bad : {std::nan(""), -1.0, HUGE_VAL}) {
    for (flexcomp_real flexcomp_settings::*member :
         {&flexcomp_settings::largest_correction_rad, &flexcomp_settings::direction_band_rad,
          &flexcomp_settings::plausible_position_m, &flexcomp_settings::plausible_orientation_rad}) {
      const flexcomp_real good = settings.*member;
      settings.*member = real(bad);
      EXPECT_TRUE(is_refused()) << bad;
      settings.*member = good;
    }
  }
  settings.plausible_orientation_rad = real(2);
  EXPECT_TRUE(is_refused());
  flexcomp_settings_default(&settings);
  std::memset(&settings.on_refusal, 77, sizeof settings.on_refusal);  // as a C program may
  EXPECT_TRUE(is_refused());
  for (const int what : {0, 1}) {
    flexcomp_robot odd = robot;
    if (what == 0) odd.payload_kg = -5;
    if (what == 1) odd.max_rad[3] = 3e5;
    EXPECT_EQ(flexcomp_init_explained(&memory, sizeof memory, &odd, nullptr, nullptr, &error), nullptr);
    EXPECT_EQ(error, FLEXCOMP_INIT_ROBOT);
  }
  settings.struct_size -= 4;
  EXPECT_TRUE(is_refused());
  EXPECT_EQ(flexcomp_init(&memory, sizeof memory, &robot, &settings, nullptr), nullptr);
  for (unsigned k = 0; k <= 7; ++k) EXPECT_GT(std::string(flexcomp_init_error_text(k)).size(), 3U);
}

TEST(Settings, SlopeNearSingularitiesIsObeyed) {
  // Past a wrist singularity: a smaller slope changes the correction less from one command to the next.
  const auto greatest_change = [](double steepest) {
    CArm arm;
    arm.settings.steepest = real(steepest);
    arm.settings.cycle_us = 1000000;
    arm.start();
    arm.push(bench_image(1, 5), {0, real(0.4), real(1.1), real(0.3), real(-0.2), 0});
    double greatest = 0;
    Joints last{};
    for (int k = -200; k <= 200; ++k) {
      const Joints q = {0, real(0.4), real(1.1), real(0.3), real(k * 1e-3), 0};
      Joints c = arm.step(q);
      for (std::size_t j = 0; j < joints; ++j) c[j] -= q[j];
      if (k > -190) greatest = std::max(greatest, bench::distance(c, last));
      last = c;
    }
    return greatest;
  };
  EXPECT_LT(greatest_change(2), 0.8 * greatest_change(200));
}

}  // namespace flexcomp::firmware::integrator
