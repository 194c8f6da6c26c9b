// SPDX-License-Identifier: Apache-2.0
// The CAN driver of the ZCU102 as it is on the board, over registers in memory. In the emulator the other setting of its
// switch runs (tests/hil/emulators); here are the words of the manual (UG1085, "CAN Controller").
#include <gmock/gmock.h>

#include <array>
#include <cstdint>

namespace {

std::array<std::uint32_t, 33> registers;

#define FLEXCOMP_ZYNQMP_CAN0 (reinterpret_cast<can_registers*>(registers.data()))
#include "../../firmware/boards/xlnx-zcu102-r5/zynqmp_can.c"

using ::testing::Each;
using ::testing::ElementsAre;

/// A register by its offset in bytes.
std::uint32_t& at(std::size_t offset) { return registers.at(offset / 4); }

class ZynqmpCan : public ::testing::Test {
 protected:
  ZynqmpCan() { registers = {}; }

  /// What is received.
  std::uint16_t id = 0;
  std::uint8_t size = 0;
  std::array<std::uint8_t, 8> bytes{};
};

TEST_F(ZynqmpCan, IsThatOfTheHardwareByDefault) { EXPECT_EQ(FLEXCOMP_ZYNQMP_IN_QEMU, 0); }

TEST_F(ZynqmpCan, StartsAtOneMegabitWithTwoFilters) {
  zynqmp_can_init(0x000, 0x601);
  EXPECT_EQ(at(0x00), 2U);  // enabled, not in reset
  EXPECT_EQ(at(0x04), 0U);
  const std::uint32_t quanta = 1 + (at(0x0C) & 0xFU) + 1 + ((at(0x0C) >> 4U) & 7U) + 1;
  EXPECT_EQ(100'000'000U / (at(0x08) + 1) / quanta, 1'000'000U);
  EXPECT_EQ(at(0x60), 3U);
  EXPECT_EQ(at(0x64), 0xFFF80000U);  // 11 bits, remote, extended
  EXPECT_EQ(at(0x68), 0U);
  EXPECT_EQ(at(0x6C), 0xFFF80000U);
  EXPECT_EQ(at(0x70), 0xC0200000U);
}

TEST_F(ZynqmpCan, SendsTheIdentifierOnTopAndTheFirstByteHighest) {
  const std::uint8_t bytes[5] = {0x11, 0x22, 0x33, 0x44, 0x55};
  EXPECT_EQ(zynqmp_can_send(0x581, bytes, 5), 1);
  EXPECT_EQ(at(0x30), 0xB0200000U);
  EXPECT_EQ(at(0x34), 0x50000000U);
  EXPECT_EQ(at(0x38), 0x11223344U);
  EXPECT_EQ(at(0x3C), 0x55000000U);
}

TEST_F(ZynqmpCan, SendsNothingWhereThereIsNoRoom) {
  const std::uint8_t bytes[8] = {1};
  at(0x18) = 1U << 10U;
  EXPECT_EQ(zynqmp_can_send(0x581, bytes, 8), 0);
  EXPECT_EQ(at(0x30), 0U);
  at(0x18) = 0;
  EXPECT_EQ(zynqmp_can_send(0x581, bytes, 9), 0) << "no frame is longer than 8 bytes";
}

TEST_F(ZynqmpCan, ReceivesAFrame) {
  at(0x1C) = 1U << 7U;
  at(0x50) = 0xC0200000U;
  at(0x54) = 0x80001234U;  // 8 bytes; the lower half is a time stamp
  at(0x58) = 0x40181001U;
  at(0x5C) = 0x00000002U;
  ASSERT_EQ(zynqmp_can_receive(&id, bytes.data(), &size), 1);
  EXPECT_EQ(id, 0x601);
  EXPECT_EQ(size, 8);
  EXPECT_THAT(bytes, ElementsAre(0x40, 0x18, 0x10, 0x01, 0, 0, 0, 2));
  EXPECT_EQ(at(0x24), 1U << 7U) << "asks to be told of the next one";
}

TEST_F(ZynqmpCan, LeavesAnEmptyFifoAlone) {
  id = 7;
  size = 7;
  EXPECT_EQ(zynqmp_can_receive(&id, bytes.data(), &size), 0);
  EXPECT_EQ(id, 7);
  EXPECT_EQ(size, 7);
  EXPECT_THAT(bytes, Each(0));
  EXPECT_EQ(at(0x24), 0U);
}

TEST_F(ZynqmpCan, TakesNeitherRemoteNorExtendedFramesNorTooLongOnes) {
  at(0x1C) = 1U << 7U;
  for (const std::uint32_t flag : {1U << 20U, 1U << 19U}) {
    at(0x50) = 0xC0200000U | flag;
    EXPECT_EQ(zynqmp_can_receive(&id, bytes.data(), &size), 0);
  }
  at(0x50) = 0xC0200000U;
  at(0x54) = 0xF0000000U;  // the standard allows codes above 8: they mean 8
  EXPECT_EQ(zynqmp_can_receive(&id, bytes.data(), &size), 1);
  EXPECT_EQ(size, 8);
}

TEST_F(ZynqmpCan, CountsOverflows) {
  zynqmp_can_init(0x000, 0x601);
  at(0x1C) = 1U << 6U;
  zynqmp_can_receive(&id, bytes.data(), &size);
  EXPECT_EQ(at(0x24), 1U << 6U) << "or it would be counted again and again";
  EXPECT_EQ(zynqmp_can_overflows(), 1U);
  at(0x1C) = 0;
  zynqmp_can_receive(&id, bytes.data(), &size);
  EXPECT_EQ(zynqmp_can_overflows(), 1U);
}

TEST_F(ZynqmpCan, InQemuTheWordsAreThoseOfSocketCan) {
  const std::uint8_t four[4] = {0x11, 0x22, 0x33, 0x44};
  std::uint8_t back[4] = {};
  EXPECT_EQ(zynqmp_can_id_word(0x601, 1), 0x601U);
  EXPECT_EQ(zynqmp_can_data_word(four, 1), 0x44332211U);
  zynqmp_can_data(0x44332211U, 1, back);
  EXPECT_THAT(back, ElementsAre(0x11, 0x22, 0x33, 0x44));
  EXPECT_TRUE(zynqmp_can_id(0x7FF, 1, &id));
  EXPECT_EQ(id, 0x7FF);
  EXPECT_FALSE(zynqmp_can_id(0x80000601U, 1, &id));
  EXPECT_FALSE(zynqmp_can_id(0x40000601U, 1, &id));
}

}  // namespace
