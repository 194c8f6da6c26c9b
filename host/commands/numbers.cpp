// SPDX-License-Identifier: Apache-2.0
#include "commands/numbers.hpp"

#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <string>

#include "units.hpp"

namespace flexcomp::host {

namespace {

CLI::Validator number_that(const std::function<bool(double)>& fits, const std::string& expected,
                           const std::string& in_help) {
  return {[fits, expected](const std::string& text) {
            // The same reader as for files: it takes no "nan", no "inf" and nothing that overflows. Blanks stand before
            // numbers in a list, "1, 2, 3".
            const auto value = parse_si(CLI::detail::trim_copy(text), unit::si);
            return value && fits(*value) ? std::string()
                                         : fmt::format("expected {}, found '{}'", expected, text);
          },
          in_help};
}

}  // namespace

CLI::Validator finite_number() {
  return number_that([](double) { return true; }, "a finite number", "");
}

CLI::Validator positive_number() {
  return number_that([](double value) { return value > 0; }, "a finite number above 0", "POSITIVE");
}

CLI::Validator non_negative_number() {
  return number_that([](double value) { return value >= 0; }, "a finite number, 0 or more", "NONNEGATIVE");
}

CLI::Validator number_between(double low, double high) {
  return number_that([low, high](double value) { return value >= low && value <= high; },
                     fmt::format("a number from {:g} to {:g}", low, high),
                     fmt::format("FLOAT in [{:g} - {:g}]", low, high));
}

}  // namespace flexcomp::host
