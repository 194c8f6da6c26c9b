// SPDX-License-Identifier: Apache-2.0
#include "exchange/declared_unit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>

#include "files/text.hpp"
#include "input_error.hpp"

namespace flexcomp::host {

namespace {

struct Named {
  Unit unit;
  std::vector<std::string_view> words;
};

const std::vector<Named>& lengths() {
  static const std::vector<Named> all{
      {unit::mm, {"mm", "millimeter", "millimeters", "millimetre", "millimetres", "millimeter(s)"}},
      {{"m", 1, 1}, {"m", "meter", "meters", "metre", "metres"}},
      {{"cm", 1, 100}, {"cm", "centimeter", "centimeters", "centimetre", "centimetres"}},
      {{"um", 1, 1000000},
       {"um", "µm", "μm", "micron", "microns", "micrometer", "micrometers", "micrometre"}},
      {{"in", 254, 10000}, {"in", "inch", "inches", "zoll", "\""}},
      {{"ft", 3048, 10000}, {"ft", "foot", "feet"}}};
  return all;
}

const std::vector<Named>& angles() {
  static const std::vector<Named> all{{unit::degree, {"deg", "degree", "degrees", "°"}},
                                      {{"rad", 1, 1}, {"rad", "radian", "radians"}}};
  return all;
}

const std::vector<Named>& times() {
  static const std::vector<Named> all{{{"s", 1, 1}, {"s", "sec", "second", "seconds"}},
                                      {{"ms", 1, 1000}, {"ms", "msec", "millisecond", "milliseconds"}},
                                      {{"us", 1, 1000000}, {"us", "µs", "microsecond", "microseconds"}}};
  return all;
}

std::optional<Unit> find(const std::vector<Named>& units, std::string_view word) {
  const std::string wanted = lower(word);
  for (const Named& u : units) {
    if (std::find(u.words.begin(), u.words.end(), wanted) != u.words.end()) return u.unit;
  }
  return {};
}

std::vector<std::string> names(const std::vector<Named>& units) {
  std::vector<std::string> out;
  out.reserve(units.size());
  for (const Named& u : units) out.emplace_back(u.unit.name);
  return out;
}

bool one_of(const std::vector<std::string_view>& words, std::string_view word) {
  return std::find(words.begin(), words.end(), lower(word)) != words.end();
}

/// Units that nothing here is read in: a column that has one is not one without unit.
bool is_foreign_unit(std::string_view word) {
  static const std::vector<std::string_view> all{"kg",   "g",   "lb",     "lbs",    "n",  "kn",
                                                 "mrad", "gon", "arcmin", "arcsec", "nm", "rpm"};
  return one_of(all, word);
}

bool is_unit(std::string_view word) {
  return length_unit_of(word) || angle_unit_of(word) || time_unit_of(word) || is_foreign_unit(word);
}

/// What lies beyond ASCII counts as letters, as the sigma of "σx".
bool in_word(char c) {
  const auto byte = static_cast<unsigned char>(c);
  return std::isalnum(byte) != 0 || byte >= 0x80;
}

std::string letters_and_digits(std::string_view text) {
  std::string out = lower(text);
  std::erase_if(out, [](char c) { return !in_word(c); });
  return out;
}

/// Words in lower case, and what stands between them but blanks, a character each.
std::vector<std::string> tokens_of(std::string_view written) {
  const std::string line = lower(written);
  std::vector<std::string> tokens;
  bool goes_on = false;
  for (std::size_t k = 0; k < line.size(); ++k) {
    const char c = line[k];
    // "Unit(s)", "millimeter(s)"
    if (goes_on && line.compare(k, 3, "(s)") == 0) {
      tokens.back() += 's';
      k += 2;
      goes_on = false;
      continue;
    }
    if (in_word(c) && goes_on) {
      tokens.back() += c;
    } else if (c != ' ' && c != '\t') {
      tokens.emplace_back(1, c);
    }
    goes_on = in_word(c);
  }
  return tokens;
}

bool is_word(const std::string& token) { return in_word(token.front()); }

/// A line's words as far as they tell units.
class Declaration {
 public:
  explicit Declaration(std::string_view line) : tokens_(tokens_of(line)) {
    for (std::size_t k = 0; k < tokens_.size(); ++k) {
      if (!one_of({"unit", "units", "einheit", "einheiten", "unités"}, tokens_[k])) continue;
      begin_ = begin_of(k);
      if (begin_ < tokens_.size()) return;
    }
    begin_ = tokens_.size();
  }

  /// All units of a kind, in the order in which they stand there.
  std::vector<Unit> units(UnitOf unit_of) const {
    std::vector<Unit> out;
    for (std::size_t k = begin_; k < tokens_.size(); ++k) {
      if (!is_unit_at(k)) continue;
      if (const auto unit = unit_of(tokens_[k])) out.push_back(*unit);
    }
    return out;
  }

  /// "Units: furlongs"; "Units: Metric" says too little, but nothing wrong.
  bool not_understood() const {
    bool words = false;
    for (std::size_t k = begin_; k < tokens_.size(); ++k) {
      if (is_temperature(k) || is_unit_at(k) || is(k, {"metric", "metrisch"})) return false;
      words = words || (is_word(tokens_[k]) && std::isdigit(static_cast<unsigned char>(tokens_[k][0])) == 0);
    }
    return words && plural_;
  }

 private:
  bool is(std::size_t k, const std::vector<std::string_view>& words) const {
    return k < tokens_.size() && one_of(words, tokens_[k]);
  }

  /// Where the units begin that are declared after the word "unit" at `k`; the end where it declares none.
  std::size_t begin_of(std::size_t k) {
    plural_ = is(k, {"units", "einheiten", "unités"});
    ++k;
    if (is(k, {"of", "for"})) k += 2;  // "unit of length: mm"
    if (is(k, {":", "="})) return k + 1;
    if (is(k, {"are", "is", "sind", "ist"})) ++k;
    if (is(k, {"in"}) && !is_unit_at(k)) ++k;
    return k < tokens_.size() && is_unit_at(k) ? k : tokens_.size();
  }

  bool is_temperature(std::size_t k) const {
    return is(k, {"celsius", "fahrenheit", "kelvin", "°c", "°f"}) ||
           (is(k, {"deg", "degree", "degrees"}) && is(k + 1, {"c", "f", "celsius", "fahrenheit"}));
  }

  bool is_unit_at(std::size_t k) const {
    // "Units: in, deg", but "lengths in mm": the little word is a unit only where no other word follows it.
    if (tokens_[k] == "in") return k + 1 >= tokens_.size() || !is_word(tokens_[k + 1]);
    return !is_temperature(k) && is_unit(tokens_[k]);
  }

  std::vector<std::string> tokens_;
  std::size_t begin_ = 0;
  bool plural_ = false;
};

}  // namespace

std::optional<Unit> length_unit_of(std::string_view word) { return find(lengths(), word); }
std::optional<Unit> angle_unit_of(std::string_view word) { return find(angles(), word); }
std::optional<Unit> time_unit_of(std::string_view word) { return find(times(), word); }

bool is_no_angle(std::string_view word) {
  static const std::vector<std::string_view> all{
      "v",     "mv",    "a",    "ma",  "%",      "w",      "hz",   "nm",      "n·m",    "n",     "kg",
      "°c",    "degc",  "k",    "rpm", "1/min",  "u/min",  "1/s",  "inc",     "counts", "ticks", "°/s",
      "deg/s", "rad/s", "mm/s", "m/s", "deg/s²", "rad/s²", "°/s²", "deg/s^2", "rad/s^2"};
  return length_unit_of(word) || time_unit_of(word) || one_of(all, word);
}

const std::vector<std::string>& length_unit_names() {
  static const std::vector<std::string> all = names(lengths());
  return all;
}
const std::vector<std::string>& angle_unit_names() {
  static const std::vector<std::string> all = names(angles());
  return all;
}
const std::vector<std::string>& time_unit_names() {
  static const std::vector<std::string> all = names(times());
  return all;
}

ColumnName column_name(std::string_view cell) {
  std::string_view text = trimmed(cell);
  for (const auto& [open, close] : {std::array<char, 2>{'[', ']'}, std::array<char, 2>{'(', ')'}}) {
    if (!text.ends_with(close)) continue;
    const auto at = text.rfind(open);
    if (at == std::string_view::npos || at == 0) continue;
    const std::string_view inside = trimmed(text.substr(at + 1, text.size() - at - 2));
    return {letters_and_digits(text.substr(0, at)), std::string(inside)};
  }
  const auto at = text.find_last_of("_ ");
  if (at != std::string_view::npos && at > 0 && is_unit(text.substr(at + 1))) {
    return {letters_and_digits(text.substr(0, at)), std::string(text.substr(at + 1))};
  }
  return {letters_and_digits(text), ""};
}

std::optional<Unit> agreed_unit(const std::string& path, std::size_t line, const std::string& field,
                                const std::vector<UnitSource>& sources) {
  const UnitSource* first = nullptr;
  for (const UnitSource& source : sources) {
    if (!source.unit) continue;
    if (first == nullptr) first = &source;
    if (source.unit->name == first->unit->name) continue;
    throw InputError(path, line, field, fmt::format("{}, as {} says", first->unit->name, first->by),
                     fmt::format("{}, as {} says", source.unit->name, source.by));
  }
  return first == nullptr ? std::nullopt : first->unit;
}

std::optional<Unit> unit_in_name(const std::string& path, std::size_t line, const std::string& label,
                                 UnitOf unit_of, const std::string& known) {
  const std::string word = column_name(label).unit;
  if (word.empty()) return {};
  const std::optional<Unit> unit = unit_of(word);
  if (!unit) throw InputError(path, line, label, known, fmt::format("'{}'", word));
  return unit;
}

DeclaredUnits declared_units(const DelimitedText& table) {
  DeclaredUnits out;
  for (std::size_t k = 0; k < table.remarks.size(); ++k) {
    const std::size_t line = table.remark_lines[k];
    const std::string& text = table.remarks[k];
    const Declaration declaration(text);
    if (declaration.not_understood()) {
      throw InputError(table.path, line, "",
                       fmt::format("units that are known ({}; {})", fmt::join(length_unit_names(), ", "),
                                   fmt::join(angle_unit_names(), ", ")),
                       fmt::format("'{}'", text));
    }
    const auto note = [&](UnitSource& source, UnitOf unit_of, const char* kind) {
      for (const Unit& unit : declaration.units(unit_of)) {
        if (!source.unit) source = {unit, fmt::format("line {}", line)};
        if (source.unit->name == unit.name) continue;
        const std::string here = fmt::format("line {}", line);
        throw InputError(table.path, line, "",
                         source.by == here
                             ? fmt::format("one unit of {}", kind)
                             : fmt::format("the same units as in {}, {}", source.by, source.unit->name),
                         fmt::format("'{}'", text));
      }
    };
    note(out.length, length_unit_of, "length");
    note(out.angle, angle_unit_of, "angle");
    note(out.time, time_unit_of, "time");
  }
  return out;
}

}  // namespace flexcomp::host
