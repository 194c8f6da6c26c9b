// SPDX-License-Identifier: Apache-2.0
// The core never asks for memory: counted at malloc itself, not at what calls it.
#include <cstddef>
#include <cstdlib>
#include <limits>
#include <memory>
#include <vector>

#include <flexcomp/compensate.hpp>
#include <flexcomp/identification.hpp>
#include <flexcomp/image.hpp>

#include <gtest/gtest.h>

#include "support/random_terms.hpp"

// A sanitizer brings its own malloc; there this test only runs the calls. glibc's names for the real one let a
// program put its own in front; elsewhere operator new is what is left to count.
#if defined(__SANITIZE_ADDRESS__)
#define FLEXCOMP_COUNTS_HEAP 0
#elif defined(__GLIBC__)
#define FLEXCOMP_COUNTS_HEAP 1
#else
#define FLEXCOMP_COUNTS_HEAP 0
#endif

namespace {
// NOLINTNEXTLINE: a counter that malloc itself must reach
volatile std::size_t allocations = 0;
}  // namespace

#if FLEXCOMP_COUNTS_HEAP
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);

void* malloc(std::size_t size) {
  allocations = allocations + 1;
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  allocations = allocations + 1;
  return __libc_calloc(count, size);
}
void* realloc(void* p, std::size_t size) {
  allocations = allocations + 1;
  return __libc_realloc(p, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  allocations = allocations + 1;
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** p, std::size_t alignment, std::size_t size) {
  allocations = allocations + 1;
  *p = __libc_memalign(alignment, size);
  return *p == nullptr ? 12 : 0;
}
}
#endif

namespace {

using flexcomp::Model;
using flexcomp::Refusal;

TEST(NoHeap, TheCounterCounts) {
#if FLEXCOMP_COUNTS_HEAP
  const std::size_t before = allocations;
  int* volatile owner = new int(1);  // volatile: a compiler may leave out an allocation that nobody sees
  delete owner;
  void* volatile p = std::malloc(17);
  std::free(p);
  EXPECT_EQ(allocations - before, 2U);
#else
  GTEST_SKIP() << "no heap to count under a sanitizer";
#endif
}

template <class S>
void everything_the_core_does() {
  for (const arms::Arm& arm : arms::all()) {
    arms::Random random(91);
    arms::TermSet<double> full = arms::everything(arm, random, 40);
    // Only what may be pushed goes through the image.
    arms::TermSet<double> pushable = arms::table1(arm);
    arms::add_joint_curves(pushable, random, 300e-6);
    const arms::TermSet<S> set = arms::as<S>(full);
    const arms::TermSet<S> sent = arms::as<S>(pushable);
    std::vector<std::uint8_t> bytes(flexcomp::image_size(sent.list()));
    const auto model = std::make_unique<Model<S>>();
    const auto received = std::make_unique<Model<S>>();
    std::vector<std::array<S, 6>> commands;
    for (int n = 0; n < 100; ++n) commands.push_back(arms::as<S>(random.pose(arm.robot)));
    commands[7][2] = std::numeric_limits<S>::quiet_NaN();
    commands[8][4] = S(0);

    Refusal prepared = Refusal::truncated;
    Refusal loaded = Refusal::truncated;
    Refusal checked = Refusal::truncated;
    std::size_t size = 0;
    S sum = S(0);
    const std::size_t before = allocations;
    prepared = model->prepare(arm.robot, set.list());
    flexcomp::ImageHeader header;
    header.nominal_hash = flexcomp::nominal_hash(arm.robot);
    header.name_hash = flexcomp::name_hash(arm.name, 3);
    size = flexcomp::encode_image(sent.list(), header, bytes.data(), bytes.size());
    flexcomp::ImageHeader read;
    checked = flexcomp::check_image(bytes.data(), bytes.size(), header.nominal_hash, header.name_hash, read);
    loaded = flexcomp::model_from_image(bytes.data(), bytes.size(), arm.robot, *received);
    const auto context = flexcomp::default_context<S>(arm.robot);
    for (const std::array<S, 6>& q : commands) {
      flexcomp::Workspace<S> ws;
      sum += flexcomp::forward(*model, q, context, ws).position.x();
      sum += flexcomp::nominal_forward(*model, q).position.y();
      const auto out = flexcomp::compensate(*received, q, context);
      sum += flexcomp::target_residual(*received, out.q, q, context).position_m;
      flexcomp::Linearisation<S> at;
      flexcomp::linearise(*model, q, context, at);
      for (const flexcomp::Term<S>& t : set.terms) {
        sum += flexcomp::column(*model, at, t, context)[0];
        sum += flexcomp::exact_column(*model, at, t, context)[5];
      }
    }
    const std::size_t after = allocations;
    EXPECT_EQ(after - before, 0U) << arm.name;
    EXPECT_EQ(prepared, Refusal::none);
    EXPECT_EQ(checked, Refusal::none);
    EXPECT_EQ(loaded, Refusal::none);
    EXPECT_EQ(size, bytes.size());
    EXPECT_TRUE(sum != sum) << "the NaN command was evaluated";
  }
}

TEST(NoHeap, NothingIsAllocatedInDouble) { everything_the_core_does<double>(); }
TEST(NoHeap, NothingIsAllocatedInFloat) { everything_the_core_does<float>(); }

}  // namespace
