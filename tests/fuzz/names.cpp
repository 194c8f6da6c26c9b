// SPDX-License-Identifier: Apache-2.0
// Small texts in files of others: patterns of names, time stamps, numbers, units, names of columns. First byte: which; up to a
// line end the pattern, then the name.
#include "exchange/declared_unit.hpp"
#include "exchange/delimited_text.hpp"
#include "exchange/name_pattern.hpp"
#include "exchange/time_stamp.hpp"
#include "host_text.hpp"
#include "model/covariate.hpp"

namespace fuzz::names_target {
namespace {

using namespace flexcomp::host;

constexpr const char* words[] = {
    "{pose}",      "{reflector}", "*",    "::", "_",      "T",  "Z", "+01:00", "-",  ":",        "2026-03-01",
    "12:30:05.25", " [mm]",       "_deg", "mm", "inches", "e5", ",", ".",      "\n", "24:00:00", "60"};

void run(Input input) {
  const unsigned which = input.u8();
  const std::string text = input.text();
  const std::size_t end = std::min(text.find('\n'), text.size());
  const std::string first = text.substr(0, end);
  const std::string second = end < text.size() ? text.substr(end + 1) : "";
  const char decimal = (which & 8U) != 0 ? ',' : '.';
  const std::vector<std::string>& lengths = length_unit_names();
  reads([&] {
    switch (which % 4) {
      case 0: {
        const NamePattern pattern(first);
        if (const auto found = pattern.read(second)) {
          require(found->second < 4 && second.find(found->first) != std::string::npos,
                  "a pose that is not in the name");
        }
        break;
      }
      case 1:
        if (const auto stamp = time_stamp(text, *time_unit_of(time_unit_names().front()), decimal))
          require(std::isfinite(stamp->seconds) && flexcomp::host::words(stamp->clock)[0] != 0,
                  "a time that is not finite");
        break;
      case 2:
        if (const auto number =
                parse_number(text, decimal, *length_unit_of(lengths[which / 16 % lengths.size()])))
          require(std::isfinite(*number), "a number that is not finite");
        is_number(text);
        break;
      default:
        column_name(text);
        if (const auto factor = factor_of(text)) require(factor_name(*factor) == text, "another factor");
        if (const auto covariate = covariate_of(text))
          require(covariate_name(covariate->first, covariate->second) == text, "another covariate");
        length_unit_of(text);
        angle_unit_of(text);
        time_unit_of(text);
        is_no_angle(text);
        unit_in_name("p", 1, text, length_unit_of, "mm");
    }
  });
}

std::vector<Bytes> seeds() {
  return {with_options({0}, "*::{pose}_{reflector}\nA::G::P7_a"),
          with_options({0}, "{reflector}{pose}*"),
          with_options({0}, "P{pose}\nP12"),
          with_options({1}, "2026-03-01T12:30:05.25Z"),
          with_options({1}, "2026-03-01 12:30:05,25+01:00"),
          with_options({9}, "12:30:05,25"),
          with_options({1}, "12.5e3"),
          with_options({2}, "-1234.5e-3"),
          with_options({10}, "1.234,5"),
          with_options({1}, "2026-03-01T12:30:05.25"),
          with_options({3}, "load_torque"),
          with_options({3}, "temperature"),
          with_options({3}, "payload"),
          with_options({3}, "q3"),
          with_options({3}, "payload_kg"),
          with_options({3}, "temp_c"),
          with_options({3}, "time_s"),
          with_options({3}, "dir4"),
          with_options({3}, "speed6"),
          with_options({3}, "Measured X [mm]"),
          with_options({3}, "j1_deg")};
}

const Register registered({"names", run, seeds, mutate_words<words>});

}  // namespace
}  // namespace fuzz::names_target
