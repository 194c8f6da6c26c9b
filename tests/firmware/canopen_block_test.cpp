// SPDX-License-Identifier: Apache-2.0
// SDO block transfer (CiA 301, 7.2.4.3.9 to .15) frame by frame, with a client that was written from the standard for this
// test, apart from the host's.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <deque>
#include <functional>
#include <optional>
#include <random>

#include "firmware/canopen_bench.hpp"

namespace flexcomp::firmware::bench {
namespace {

using wire::Answer;
using wire::Command;
using BlockFrame = SdoFrame;

/// CRC-16 CCITT bit by bit.
std::uint16_t crc16_by_bits(const Bytes& bytes) {
  unsigned crc = 0;
  for (const std::uint8_t b : bytes) {
    crc ^= static_cast<unsigned>(b) << 8U;
    for (int k = 0; k < 8; ++k) crc = (crc & 0x8000U) != 0 ? (crc << 1U) ^ 0x1021U : crc << 1U;
    crc &= 0xFFFFU;
  }
  return static_cast<std::uint16_t>(crc);
}

/// Segment `number` of a sub-block that begins at `at`.
BlockFrame segment_of(const Bytes& data, std::size_t at, unsigned number) {
  const std::size_t from = at + std::size_t{7} * (number - 1);
  const std::size_t n = std::min<std::size_t>(7, data.size() - from);
  BlockFrame f{};
  f[0] = static_cast<std::uint8_t>(number | (from + n == data.size() ? 0x80U : 0U));
  std::copy_n(data.begin() + static_cast<std::ptrdiff_t>(from), n, f.begin() + 1);
  return f;
}

BlockFrame end_of(const Bytes& data, int wrong_crc = 0, unsigned more_unused = 0) {
  BlockFrame f{};
  const unsigned unused = static_cast<unsigned>((7 - data.size() % 7) % 7) + more_unused;
  f[0] = static_cast<std::uint8_t>(0xC1U | (unused << 2U));
  store_u16(f.data() + 1, static_cast<std::uint16_t>(crc16_by_bits(data) ^ wrong_crc));
  return f;
}

class CanopenBlock : public testing::Test {
 protected:
  static constexpr std::uint8_t node_id = 5;

  CanopenBlock() { poll(0); }

  void poll(std::uint32_t ms) { poll_node(arm, node, ms); }

  /// All answers to a request, without polls.
  std::vector<BlockFrame> ask(const BlockFrame& f) {
    sent.clear();
    node.receive(co::sdo_request_id + node_id, f.data(), 8);
    return sent;
  }

  /// The same, with polls until nothing comes any more; each call sends a bounded number.
  std::vector<BlockFrame> ask_all(const BlockFrame& f) {
    std::vector<BlockFrame> out = ask(f);
    for (;;) {
      EXPECT_LE(sent.size(), CanopenNode::segments_per_call);
      sent.clear();
      node.poll(arm.now_ms);
      if (sent.empty()) return out;
      out.insert(out.end(), sent.begin(), sent.end());
    }
  }

  BlockFrame only(const std::vector<BlockFrame>& answers) {
    EXPECT_EQ(answers.size(), 1U);
    return answers.empty() ? BlockFrame{} : answers[0];
  }

  /// Begins a download; returns the size of the first sub-block.
  unsigned begin(const Bytes& data, bool sized = true) {
    const BlockFrame r = only(ask(
        sdo_frame(sized ? 0xC6 : 0xC4, co::image, 1, sized ? static_cast<std::uint32_t>(data.size()) : 0)));
    EXPECT_EQ(r, sdo_frame(0xA4, co::image, 1, r[4]));
    return r[4];
  }

  /// Sends all segments in order; the answers to sub-blocks have to be right.
  void segments(const Bytes& data, unsigned size) {
    for (std::size_t at = 0; at < data.size();) {
      const unsigned count = std::min<unsigned>(size, static_cast<unsigned>((data.size() - at + 6) / 7));
      for (unsigned k = 1; k < count; ++k) ASSERT_TRUE(ask(segment_of(data, at, k)).empty());
      const BlockFrame r = only(ask(segment_of(data, at, count)));
      ASSERT_EQ(r, (BlockFrame{0xA2, static_cast<std::uint8_t>(count), r[2]}));
      at += std::size_t{7} * count;
      ASSERT_TRUE(r[2] >= 1 && r[2] <= 127);
      ASSERT_NE(r[2], size) << "sizes alternate";
      size = r[2];
    }
  }

  void commit() {
    const BlockFrame save = sdo_frame(0x23, co::store_parameters, 1, co::save_signature);
    EXPECT_EQ(only(ask(save)), sdo_frame(0x60, co::store_parameters, 1));
    for (int k = 0; k < 100; ++k) poll(1);
  }

  /// Uploads; client with this size of sub-block, which it alternates with another one where that is given.
  Bytes upload(std::uint16_t index, std::uint8_t sub, unsigned size, unsigned other = 0) {
    const BlockFrame r = only(ask(sdo_frame(0xA4, index, sub, size)));
    EXPECT_EQ(r, sdo_frame(0xC6, index, sub, load_u32(r.data() + 4)));
    Bytes out;
    std::vector<BlockFrame> got = ask_all(BlockFrame{0xA3});
    for (;;) {
      EXPECT_LE(got.size(), size);
      for (std::size_t k = 0; k < got.size(); ++k) {
        EXPECT_EQ(got[k][0] & 0x7FU, k + 1);
        EXPECT_EQ((got[k][0] & 0x80U) != 0, out.size() + 7 >= load_u32(r.data() + 4));
        out.insert(out.end(), got[k].begin() + 1, got[k].end());
      }
      const auto taken = static_cast<std::uint8_t>(got.size());
      if (got.empty() || got.size() > size) return {};
      if (other != 0) std::swap(size, other);
      got = ask_all(BlockFrame{0xA2, taken, static_cast<std::uint8_t>(size)});
      if (got.size() == 1 && (got[0][0] & 0xE3U) == 0xC1U && out.size() >= load_u32(r.data() + 4)) break;
    }
    out.resize(out.size() - ((got[0][0] >> 2U) & 7U));
    EXPECT_EQ(load_u16(got[0].data() + 1), crc16_by_bits(out));
    EXPECT_TRUE(ask(BlockFrame{0xA1}).empty());
    EXPECT_EQ(out.size(), load_u32(r.data() + 4));
    return out;
  }

  Arm arm;
  std::vector<BlockFrame> sent;
  int room = -1;  ///< frames that the queue takes; -1: any number
  CanopenNode node{*arm.device,
                   1,
                   {node_id, 0, 2000},
                   {this, [](void* self, std::uint16_t id, const std::uint8_t* b, std::uint8_t n) {
                      auto& t = *static_cast<CanopenBlock*>(self);
                      if (id != co::sdo_answer_id + node_id) return true;
                      if (t.room == 0) return false;
                      if (t.room > 0) --t.room;
                      EXPECT_EQ(n, 8);
                      BlockFrame f{};
                      std::copy_n(b, n, f.begin());
                      t.sent.push_back(f);
                      return true;
                    }}};
};

TEST_F(CanopenBlock, TheCrcIsThatOfTheStandard) {
  const char text[] = "123456789";
  const auto* const bytes = reinterpret_cast<const std::uint8_t*>(text);
  EXPECT_EQ(co::crc16(0, bytes, 9), 0x31C3) << "CRC-16/XMODEM";
  EXPECT_EQ(co::crc16(co::crc16(0, bytes, 4), bytes + 4, 5), 0x31C3);
}

TEST_F(CanopenBlock, PushesAndPulls) {
  for (const bool sized : {true, false}) {
    const Bytes image = make_image(arm.robot, sized ? 5 : 6);
    segments(image, begin(image, sized));
    EXPECT_EQ(only(ask(end_of(image))), BlockFrame{0xA1});
    commit();
    EXPECT_EQ(arm.sequence(), sized ? 5U : 6U);
    for (const unsigned size : {1U, 2U, 7U, 8U, 9U, 63U, 64U, 126U, 127U}) {
      EXPECT_EQ(upload(co::image, 2, size), image) << size;
      EXPECT_EQ(upload(co::image, 2, size, 2), image) << size;
    }
  }
  EXPECT_EQ(upload(co::robot, 0, 127).size(), wire::robot_record_bytes);
  EXPECT_EQ(upload(0x1008, 0, 127), (Bytes{'f', 'l', 'e', 'x', 'c', 'o', 'm', 'p'}));
  EXPECT_EQ(upload(0x1018, 2, 127), (Bytes{'1', 'X', 'L', 'F'})) << "of one segment";
  // Up to the client's threshold the server answers as without blocks.
  EXPECT_EQ(only(ask(sdo_frame(0xA0, 0x1018, 2, 0x047F)))[0], 0x43);
  EXPECT_EQ(only(ask(sdo_frame(0xA0, co::capability, 0, 0xFF7F)))[0], 0x41);
  EXPECT_EQ(only(ask(sdo_frame(0xA0, co::robot, 0, 0xFF7F)))[0], 0xC6);
  // Without the client's CRC there is none.
  EXPECT_EQ(only(ask(sdo_frame(0xA0, 0x1018, 2, 0x7F)))[0], 0xC6);
  ask(BlockFrame{0xA3});
  EXPECT_EQ(only(ask(BlockFrame{0xA2, 1, 1})), (BlockFrame{0xCD, 0, 0}));
}

TEST_F(CanopenBlock, SmallObjectsComeInBlocksToo) {
  ask(sdo_frame(0xC6, 0x1017, 0, 2));
  EXPECT_EQ(only(ask(BlockFrame{0x81, 0xF4, 1})), (BlockFrame{0xA2, 1, 62}));
  EXPECT_EQ(only(ask(end_of(Bytes{0xF4, 1}))), BlockFrame{0xA1});
  EXPECT_EQ(only(ask(sdo_frame(0x40, 0x1017, 0))), sdo_frame(0x4B, 0x1017, 0, 500));
}

TEST_F(CanopenBlock, AbortCodes) {
  const Bytes image = make_image(arm.robot, 5);
  const auto size = static_cast<std::uint32_t>(image.size());
  const auto code = [this](const BlockFrame& f) { return abort_code_of(ask(f)); };
  EXPECT_EQ(code(sdo_frame(0xC6, 0x3000, 0, 9)), co::abort::no_object);
  EXPECT_EQ(code(sdo_frame(0xC6, co::image, 9, 9)), co::abort::no_sub_index);
  EXPECT_EQ(code(sdo_frame(0xC6, co::image, 2, 9)), co::abort::read_only);
  EXPECT_EQ(code(sdo_frame(0xC6, co::image, 1, 0)), co::abort::too_short);
  EXPECT_EQ(code(sdo_frame(0xC6, co::image, 1, staging_bytes + 1)), co::abort::too_long);
  EXPECT_EQ(code(sdo_frame(0xC6, co::probe, 1, 215)), co::abort::too_short);
  EXPECT_EQ(code(sdo_frame(0xA4, co::image, 1, 63)), co::abort::write_only);
  EXPECT_EQ(code(sdo_frame(0xA4, co::image, 2, 63)), co::abort::no_data);
  EXPECT_EQ(code(sdo_frame(0xA4, co::status, 0, 0)), co::abort::block_size);
  EXPECT_EQ(code(sdo_frame(0xA4, co::status, 0, 128)), co::abort::block_size);
  // Without a transfer they are about no object; the end of an upload is not answered.
  for (const unsigned first : {0xC1U, 0xA2U, 0xA3U}) {
    EXPECT_EQ(only(ask(BlockFrame{static_cast<std::uint8_t>(first)})),
              sdo_frame(0x80, 0, 0, co::abort::command));
  }
  EXPECT_TRUE(ask(BlockFrame{0xA1}).empty());

  begin(image);
  EXPECT_EQ(code(BlockFrame{}), co::abort::sequence) << "segment 0";
  begin(image);
  EXPECT_EQ(code(end_of(image)), co::abort::command) << "the end before the last segment";
  EXPECT_EQ(arm.device->status().state, 0) << "nothing is left behind";
  for (const bool sized : {true, false}) {
    segments(image, begin(image, sized));
    EXPECT_EQ(code(end_of(image, 1)), co::abort::crc);
    EXPECT_EQ(arm.device->status().state, 0);
    segments(image, begin(image, sized));
    EXPECT_EQ(code(end_of(image, 0, 1)), sized ? co::abort::too_short : co::abort::crc) << "n too high";
    EXPECT_EQ(arm.device->status().state, 0);
  }
  const Bytes shorter(image.begin(), image.end() - 1);
  Bytes longer = image;
  longer.resize((image.size() / 7 + 2) * 7);
  ask(sdo_frame(0xC6, co::image, 1, size));
  segments(shorter, 63);
  EXPECT_EQ(code(end_of(shorter)), co::abort::too_short);
  // The segments that follow an abort are not answered, each one as another request.
  ask(sdo_frame(0xC6, co::image, 1, 10 * 7 - 1));
  int answers = 0;
  for (unsigned k = 1; k <= 63; ++k) answers += static_cast<int>(ask(segment_of(longer, 0, k)).size());
  EXPECT_EQ(answers, 1);
  EXPECT_EQ(abort_code_of(ask(BlockFrame{0xC1})), co::abort::command);
  // Larger than what can be held.
  const Bytes huge(staging_bytes + 7);
  begin(huge, false);
  std::uint32_t last_code = 0;
  unsigned of = 63;
  for (std::size_t at = 0; at < huge.size() && last_code == 0;) {
    for (unsigned k = 1; k <= of && last_code == 0 && at + std::size_t{7} * k < huge.size() + 7; ++k) {
      last_code = abort_code_of(ask(segment_of(huge, at, k)));
    }
    at += std::size_t{7} * of;
    of = of == 63 ? 62 : 63;
  }
  if (last_code == 0) last_code = abort_code_of(ask(end_of(huge)));
  EXPECT_EQ(last_code, co::abort::too_long);

  // Silence.
  for (const bool with_all_segments : {false, true}) {
    const unsigned first = begin(image);
    if (with_all_segments) segments(image, first);
    poll(1);
    sent.clear();
    poll(2000);
    EXPECT_EQ(abort_code_of(sent), co::abort::timeout);
    EXPECT_EQ(arm.device->status().state, 0);
  }
  // The client's abort, NMT stop.
  begin(image);
  EXPECT_TRUE(ask(sdo_frame(0x80, co::image, 1, co::abort::general)).empty());
  EXPECT_EQ(arm.device->status().state, 0);
  begin(image);
  const std::uint8_t stop[2] = {2, 0};
  node.receive(0, stop, 2);
  EXPECT_EQ(arm.device->status().state, 0);
  const std::uint8_t start[2] = {1, 0};
  node.receive(0, start, 2);

  // Of uploads.
  segments(image, begin(image));
  ask(end_of(image));
  commit();
  const auto begin_upload = [&] {
    ask(sdo_frame(0xA4, co::image, 2, 10));
    return ask_all(BlockFrame{0xA3}).size();
  };
  EXPECT_EQ(begin_upload(), 10U);
  EXPECT_EQ(code(BlockFrame{0xA2, 11, 10}), co::abort::sequence);
  begin_upload();
  EXPECT_EQ(code(BlockFrame{0xA2, 10, 0}), co::abort::block_size);
  begin_upload();
  EXPECT_EQ(code(BlockFrame{0xA2, 10, 128}), co::abort::block_size);
  begin_upload();
  EXPECT_EQ(code(BlockFrame{0xA1}), co::abort::command) << "the end before the last segment";
  begin_upload();
  EXPECT_TRUE(ask(sdo_frame(0x80, co::image, 2, co::abort::general)).empty());
  EXPECT_EQ(code(BlockFrame{0xA2, 10, 10}), co::abort::command) << "it is over";
  begin_upload();
  ASSERT_EQ(arm.push(make_image(arm.robot, 6, 1, 6)), Answer::accepted);
  EXPECT_EQ(code(BlockFrame{0xA2, 10, 10}), co::abort::device_state) << "another set";
  begin_upload();
  poll(1);
  sent.clear();
  poll(2000);
  EXPECT_EQ(abort_code_of(sent), co::abort::timeout);
}

TEST_F(CanopenBlock, RefusedWhereTheQueueIsTooShort) {
  std::vector<BlockFrame> out;
  const CanTransmit transmit{&out, [](void* to, std::uint16_t, const std::uint8_t* b, std::uint8_t n) {
                               BlockFrame f{};
                               std::copy_n(b, n, f.begin());
                               static_cast<std::vector<BlockFrame>*>(to)->push_back(f);
                               return true;
                             }};
  for (const unsigned size : {0U, 1U, 3U, 20U, 63U, 64U, 255U}) {
    CanopenSettings settings{node_id, 0, 2000};
    settings.block_size = static_cast<std::uint8_t>(size);
    CanopenNode other(*arm.device, 2, settings, transmit);
    other.poll(0);
    out.clear();
    for (const BlockFrame& f : {sdo_frame(0xC4, co::image, 1), sdo_frame(0xA4, co::status, 0, 63)}) {
      other.receive(co::sdo_request_id + node_id, f.data(), 8);
    }
    ASSERT_EQ(out.size(), 2U);
    if (size == 0) {
      EXPECT_EQ(out[0], sdo_frame(0x80, co::image, 1, co::abort::command));
      EXPECT_EQ(out[1], sdo_frame(0x80, co::status, 0, co::abort::command));
    } else {
      EXPECT_EQ(out[0], sdo_frame(0xA4, co::image, 1, std::clamp(size, 3U, 63U)));
      EXPECT_EQ(out[1], sdo_frame(0xC6, co::status, 0, wire::status_bytes));
    }
  }
}

TEST_F(CanopenBlock, ContinuesWhenTheQueueHasRoom) {
  const Bytes image = make_image(arm.robot, 5);
  segments(image, begin(image));
  room = 0;
  EXPECT_TRUE(ask(end_of(image)).empty());
  room = -1;
  node.poll(arm.now_ms);
  EXPECT_EQ(only(sent), BlockFrame{0xA1});
  commit();
  ask(sdo_frame(0xA4, co::image, 2, 127));
  room = 0;
  ask(BlockFrame{0xA3});
  Bytes out;
  for (unsigned k = 0; sent.size() < 127 && k < 1000; ++k) {
    room = static_cast<int>(k % 3);
    node.poll(arm.now_ms);
  }
  ASSERT_EQ(sent.size(), 127U);
  for (unsigned k = 0; k < 127; ++k) {
    ASSERT_EQ(sent[k][0], k + 1);
    out.insert(out.end(), sent[k].begin() + 1, sent[k].end());
  }
  EXPECT_TRUE(std::equal(out.begin(), out.end(), image.begin()));
}

TEST_F(CanopenBlock, CopiesAreAnsweredAgain) {
  const Bytes image = make_image(arm.robot, 5);
  const auto twice = [this](const BlockFrame& f) {
    auto first = ask(f);
    const auto second = ask(f);
    EXPECT_EQ(first, second);
    return first;
  };
  ask(sdo_frame(0xC6, co::image, 1, static_cast<std::uint32_t>(image.size())));
  unsigned size = only(twice(sdo_frame(0xC6, co::image, 1, static_cast<std::uint32_t>(image.size()))))[4];
  for (std::size_t at = 0; at < image.size();) {
    const unsigned count = std::min<unsigned>(size, static_cast<unsigned>((image.size() - at + 6) / 7));
    for (unsigned k = 1; k < count; ++k) EXPECT_TRUE(twice(segment_of(image, at, k)).empty());
    const BlockFrame r = only(twice(segment_of(image, at, count)));
    EXPECT_EQ(r[1], count);
    at += std::size_t{7} * count;
    size = r[2];
  }
  // Late segments neither; one looks like the start of a download.
  EXPECT_TRUE(ask(segment_of(image, 0, 3)).empty());
  EXPECT_TRUE(ask(segment_of(image, 0, 0x21)).empty());
  EXPECT_EQ(only(twice(end_of(image))), BlockFrame{0xA1});
  EXPECT_EQ(only(ask(end_of(image))), BlockFrame{0xA1});
  commit();
  EXPECT_EQ(arm.pull(), image);

  // An upload by a client that alternates: a copy of its answer while segments go out changes nothing.
  ask(sdo_frame(0xA4, co::image, 2, 63));
  ask(BlockFrame{0xA3});
  std::vector<BlockFrame> got = sent;
  ask(BlockFrame{0xA3});
  got.insert(got.end(), sent.begin(), sent.end());
  while (got.size() < 63) {
    sent.clear();
    node.poll(arm.now_ms);
    got.insert(got.end(), sent.begin(), sent.end());
  }
  for (unsigned k = 0; k < 63; ++k) EXPECT_EQ(got[k], segment_of(image, 0, k + 1));
  const BlockFrame taken{0xA2, 63, 62};
  got = ask(taken);
  const auto more = ask_all(taken);
  got.insert(got.end(), more.begin(), more.end());
  ASSERT_EQ(got.size(), 62U);
  for (unsigned k = 0; k < 62; ++k) EXPECT_EQ(got[k], segment_of(image, 63 * 7, k + 1));
  // After them it says that none has arrived.
  EXPECT_EQ(ask_all(taken), got);
}

TEST_F(CanopenBlock, APollOfASmallObjectLeavesABlockAlone) {
  const Bytes image = make_image(arm.robot, 5);
  const BlockFrame question = sdo_frame(0x40, 0x1001, 0);
  unsigned size = begin(image);
  for (std::size_t at = 0; at < image.size();) {
    const unsigned count = std::min<unsigned>(size, static_cast<unsigned>((image.size() - at + 6) / 7));
    BlockFrame r{};
    for (unsigned k = 1; k <= count; ++k) {
      EXPECT_EQ(only(ask(question)), sdo_frame(0x4F, 0x1001, 0, 1));
      const auto answers = ask(segment_of(image, at, k));
      if (k == count) r = only(answers);
    }
    EXPECT_EQ(r[1], count);
    at += std::size_t{7} * count;
    size = r[2];
  }
  EXPECT_EQ(only(ask(question)), sdo_frame(0x4F, 0x1001, 0, 1));
  EXPECT_EQ(only(ask(end_of(image))), BlockFrame{0xA1});
  commit();
  // In an upload, between all segments.
  ask(sdo_frame(0xA4, co::image, 2, 63));
  std::vector<BlockFrame> got;
  room = 1;
  ask(BlockFrame{0xA3});
  while (got.size() < 63) {
    got.insert(got.end(), sent.begin(), sent.end());
    room = -1;
    const auto answer = ask(question);
    ASSERT_EQ(only(answer), sdo_frame(0x4F, 0x1001, 0, 0));
    sent.clear();
    room = 1;
    node.poll(arm.now_ms);
  }
  for (unsigned k = 0; k < 63; ++k) EXPECT_EQ(got[k], segment_of(image, 0, k + 1));
  // A larger object takes the channel.
  room = -1;
  begin(image);
  ask(segment_of(image, 0, 1));
  EXPECT_EQ(only(ask(sdo_frame(0x40, co::status, 0)))[0], 0x41);
  EXPECT_EQ(arm.device->status().state, 0);
}

/// A channel that loses, doubles and holds back frames of both directions, and a client that only knows the standard: it waits
/// for answers, resends what follows the last segment that was taken, and begins anew after an abort.
TEST_F(CanopenBlock, LostDoubledAndLateSegmentsNeverMakeAnotherImage) {
  std::mt19937 random(301);
  int whole = 0, given_up = 0;
  constexpr int runs = 400;
  for (int run = 0; run < runs; ++run) {
    const Bytes image =
        make_image(arm.robot, static_cast<std::uint32_t>(run + 1), 1, static_cast<std::uint32_t>(run + 1));
    const unsigned trouble = 10U + static_cast<unsigned>(run) % 50U;
    std::vector<BlockFrame> back;
    std::deque<BlockFrame> late;
    const auto pass = [&](const BlockFrame& f) {
      const auto to_node = [&](const BlockFrame& g) {
        for (const BlockFrame& r : ask(g)) {
          if (random() % trouble == 0) continue;
          back.push_back(r);
          if (random() % trouble == 0) back.push_back(r);
        }
      };
      const auto what = static_cast<unsigned>(random()) % (3 * trouble);
      if (what == 0) return;
      if (what == 1) {
        late.push_back(f);
        return;
      }
      to_node(f);
      if (what == 2) to_node(f);
      if (!late.empty() && random() % 4 == 0) {
        to_node(late.front());
        late.pop_front();
      }
    };
    bool done = false;
    for (int attempt = 0; attempt < 40 && !done; ++attempt) {
      back.clear();
      pass(sdo_frame(0xC6, co::image, 1, static_cast<std::uint32_t>(image.size())));
      if (back.empty() || back[0][0] != 0xA4) continue;
      unsigned size = back[0][4];
      bool lost = false;
      std::size_t at = 0;
      for (int rounds = 0; at < image.size() && !lost && rounds < 60; ++rounds) {
        back.clear();
        const unsigned count = std::min<unsigned>(size, static_cast<unsigned>((image.size() - at + 6) / 7));
        for (unsigned k = 1; k <= count; ++k) pass(segment_of(image, at, k));
        for (int again = 0; again < 4 && back.empty(); ++again) pass(segment_of(image, at, count));
        const auto taken = std::find_if(back.begin(), back.end(), [&](const BlockFrame& f) {
          return f[0] == 0xA2 && f[1] <= count && f[2] != size;
        });
        if (taken == back.end()) {
          lost = true;
        } else {
          at = std::min(image.size(), at + std::size_t{7} * (*taken)[1]);
          size = (*taken)[2];
        }
      }
      if (lost || at < image.size()) continue;
      back.clear();
      for (int again = 0; again < 4 && back.empty(); ++again) pass(end_of(image));
      done = !back.empty() && back[0] == BlockFrame{0xA1};
    }
    late.clear();
    if (!done) {
      ++given_up;
      ask(sdo_frame(0x80, co::image, 1));
      arm.run(Command::abort, 0, 1);
      continue;
    }
    ++whole;
    commit();
    ASSERT_EQ(arm.pull(), image) << run;
  }
  EXPECT_GE(whole, runs * 95 / 100) << given_up;
}

TEST_F(CanopenBlock, AnotherClientMayBeginAtAnyPoint) {
  const Bytes image = make_image(arm.robot, 5);
  for (const unsigned first : {0x40U, 0xA4U, 0xA0U}) {
    for (unsigned segments = 0; segments < 63; ++segments) {
      begin(image);
      for (unsigned k = 1; k <= segments; ++k) EXPECT_TRUE(ask(segment_of(image, 0, k)).empty());
      const BlockFrame r = only(ask(sdo_frame(first, co::capability, 0, 63)));
      EXPECT_EQ(r, sdo_frame(first == 0x40 ? 0x41 : 0xC6, co::capability, 0, wire::capability_bytes));
      EXPECT_EQ(arm.device->status().state, 0);
    }
  }
}

TEST_F(CanopenBlock, TwoNodesOfAnArmDoNotMixTheirTransfers) {
  std::vector<BlockFrame> out;
  CanopenNode other(*arm.device, 2, {7, 0, 2000},
                    {&out, [](void* to, std::uint16_t, const std::uint8_t* b, std::uint8_t n) {
                       BlockFrame f{};
                       std::copy_n(b, n, f.begin());
                       static_cast<std::vector<BlockFrame>*>(to)->push_back(f);
                       return true;
                     }});
  other.poll(0);
  const auto ask_other = [&](const BlockFrame& f) {
    out.clear();
    other.receive(co::sdo_request_id + 7, f.data(), 8);
    return out;
  };
  const Bytes image = make_image(arm.robot, 5);
  const unsigned size = begin(image);
  ask(segment_of(image, 0, 1));
  EXPECT_EQ(abort_code_of(ask_other(sdo_frame(0xC6, co::image, 1, 100))), co::abort::busy);
  EXPECT_EQ(only(ask_other(sdo_frame(0xA4, co::robot, 0, 63)))[0], 0xC6);
  ask(segment_of(image, 0, 2));
  EXPECT_EQ(ask_other(BlockFrame{0xA3}).size(), CanopenNode::segments_per_call);
  for (unsigned k = 3; k < size; ++k) EXPECT_TRUE(ask(segment_of(image, 0, k)).empty());
  EXPECT_EQ(only(ask(segment_of(image, 0, size)))[1], size);
  EXPECT_TRUE(ask_other(sdo_frame(0x80, co::image, 1)).empty());
  EXPECT_NE(arm.device->status().state, 0) << "the other's abort is not ours";
}

TEST_F(CanopenBlock, AnyFramesAreValidInput) {
  std::mt19937 random(7);
  const Bytes image = make_image(arm.robot, 5);
  ASSERT_EQ(arm.push(image), Answer::accepted);
  constexpr std::array<std::uint8_t, 12> first = {0xC6, 0xC4, 0xC1, 0xDD, 0xA4, 0xA0,
                                                  0xA1, 0xA2, 0xA3, 0x80, 0x40, 0x23};
  unsigned next = 1;
  for (int k = 0; k < 300000; ++k) {
    BlockFrame f{};
    for (auto& b : f) b = static_cast<std::uint8_t>(random() % 4 == 0 ? random() : 0);
    const unsigned what = random() % 4;
    if (what == 0) {
      f[0] = first[random() % first.size()];
      if (random() % 2 == 0) {
        store_u16(f.data() + 1, random() % 2 == 0 ? co::image : co::robot);
        f[3] = static_cast<std::uint8_t>(random() % 3);
        f[4] = static_cast<std::uint8_t>(random());
      } else {
        f[1] = static_cast<std::uint8_t>(random() % 70);
        f[2] = static_cast<std::uint8_t>(random());
      }
      next = 1;
    } else {
      f[0] = static_cast<std::uint8_t>(next | (random() % 64 == 0 ? 0x80U : 0U));
      next = next % 63 + 1;
    }
    room = random() % 16 == 0 ? static_cast<int>(random() % 4) : -1;
    sent.clear();
    node.receive(co::sdo_request_id + node_id, f.data(), 8);
    ASSERT_LE(sent.size(), CanopenNode::segments_per_call + 1U);
    if (random() % 8 == 0) poll(random() % 64 == 0 ? 2001 : 1);
  }
  room = -1;
  ask(sdo_frame(0x80, 0, 0));
  EXPECT_EQ(arm.sequence(), 5U);
  EXPECT_EQ(upload(co::image, 2, 63, 62), image);
}

}  // namespace
}  // namespace flexcomp::firmware::bench
