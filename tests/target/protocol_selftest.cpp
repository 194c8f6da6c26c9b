// SPDX-License-Identifier: Apache-2.0
// The firmware library on a target against the host: every reply on both buses, every corrected command and every
// state of one long exchange, byte by byte.
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
  flexcomp::boards::write(" at byte ");
  flexcomp::boards::write_hex(at);
  flexcomp::boards::write("\n");
  return 1;
}

protocol::Transcript transcript;
protocol::Exchange exchange(transcript);

}  // namespace

int main() {
  if (!exchange.run(staubli_tx60l, golden::image)) return fail("does not get to its end", transcript.size);
  for (std::size_t k = 0; k < transcript.size && k < sizeof expected; ++k) {
    if (transcript.bytes[k] != expected[k]) return fail("differs from the host", k);
  }
  if (transcript.size != sizeof expected) return fail("is not as long as the host's", transcript.size);
  flexcomp::boards::write("protocol: all replies agree with the host\n");
  return 0;
}
