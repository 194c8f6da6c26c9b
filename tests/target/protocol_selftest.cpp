// SPDX-License-Identifier: Apache-2.0
// The firmware library on a target against the host: every reply on both buses, every corrected command and every
// state of one long exchange, each by the CRC-32 of its bytes.
#include "protocol.hpp"

#include "examples/tx60l.h"
#include "golden.hpp"
#include "semihosting.hpp"
#if FLEXCOMP_TEST_IN_FLOAT
#include "golden_protocol_float.hpp"
constexpr auto& expected = golden::protocol_in_float;
#else
#include "golden_protocol_double.hpp"
constexpr auto& expected = golden::protocol_in_double;
#endif
static_assert((sizeof(flexcomp_real) == 4) == (FLEXCOMP_TEST_IN_FLOAT != 0), "the transcript of this scalar");

namespace {

int fail(const char* what, std::size_t at) {
  flexcomp::boards::write("protocol: ");
  flexcomp::boards::write(what);
  flexcomp::boards::write(" at entry ");
  flexcomp::boards::write_hex(at);
  flexcomp::boards::write("\n");
  return 1;
}

protocol::Transcript transcript;
protocol::Exchange exchange(transcript);

}  // namespace

int main() {
  constexpr std::size_t count = sizeof expected / sizeof expected[0];
  const bool at_its_end = exchange.run(staubli_tx60l, golden::image) && !transcript.full;
  std::size_t entries = 0;
  std::size_t different = count;
  transcript.each([&](const std::uint8_t* entry, std::size_t size) {
    if (different == count && entries < count && flexcomp::crc32(entry, size) != expected[entries])
      different = entries;
    ++entries;
  });
  if (!at_its_end) return fail("does not get to its end", entries);
  if (different != count) return fail("differs from the host", different);
  if (entries != count) return fail("is not as long as the host's", entries);
  flexcomp::boards::write("protocol: all replies agree with the host\n");
  return 0;
}
