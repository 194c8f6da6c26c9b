#include "files/declared_unit.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>

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
      {{"in", 254, 10000}, {"in", "inch", "inches", "\""}},
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

std::string lower(std::string_view text) {
  std::string out(text);
  std::transform(out.begin(), out.end(), out.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return out;
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
  for (const Named& u : units) out.emplace_back(u.unit.name);
  return out;
}

bool is_unit(std::string_view word) {
  return length_unit_of(word) || angle_unit_of(word) || time_unit_of(word) || lower(word) == "kg" ||
         lower(word) == "n";
}

std::string_view trimmed(std::string_view s) {
  const auto first = s.find_first_not_of(" \t");
  return first == std::string_view::npos ? std::string_view()
                                         : s.substr(first, s.find_last_not_of(" \t") - first + 1);
}

std::string letters_and_digits(std::string_view text) {
  std::string out;
  for (const char c : lower(text)) {
    // What lies beyond ASCII stays: the sigma of "σx" is a letter.
    if (std::isalnum(static_cast<unsigned char>(c)) != 0 || static_cast<unsigned char>(c) >= 0x80) out += c;
  }
  return out;
}

/// Words of a line: what blanks and punctuation part.
std::vector<std::string> words_of(std::string_view line) {
  std::vector<std::string> words;
  std::string word;
  for (const char c : line) {
    const bool part =
        std::isalnum(static_cast<unsigned char>(c)) != 0 || static_cast<unsigned char>(c) >= 0x80;
    if (part) {
      word += c;
    } else if (!word.empty()) {
      words.push_back(std::move(word));
      word.clear();
    }
  }
  if (!word.empty()) words.push_back(std::move(word));
  return words;
}

bool same(const std::optional<Unit>& a, const std::optional<Unit>& b) { return a->name == b->name; }

}  // namespace

std::optional<Unit> length_unit_of(std::string_view word) { return find(lengths(), word); }
std::optional<Unit> angle_unit_of(std::string_view word) { return find(angles(), word); }
std::optional<Unit> time_unit_of(std::string_view word) { return find(times(), word); }

const std::vector<std::string>& length_unit_names() {
  static const std::vector<std::string> all = names(lengths());
  return all;
}
const std::vector<std::string>& angle_unit_names() {
  static const std::vector<std::string> all = names(angles());
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

DeclaredUnits declared_units(const std::vector<std::string>& lines) {
  DeclaredUnits out;
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const std::vector<std::string> words = words_of(lines[k]);
    const auto speaks = std::find_if(words.begin(), words.end(), [](const std::string& w) {
      const std::string word = lower(w);
      return word == "unit" || word == "units" || word == "einheit" || word == "einheiten" ||
             word == "unités";
    });
    if (speaks == words.end()) continue;
    std::optional<Unit> length;
    std::optional<Unit> angle;
    bool inches = false;
    for (const std::string& word : words) {
      // "Units are in millimeters": the little word is a unit only where there is no other.
      if (lower(word) == "in") {
        inches = true;
        continue;
      }
      if (!length) length = length_unit_of(word);
      if (!angle) angle = angle_unit_of(word);
    }
    if (!length && !angle && inches) length = length_unit_of("in");
    if ((length && out.length && !same(length, out.length)) ||
        (angle && out.angle && !same(angle, out.angle))) {
      if (!out.contradicts) out.contradicts = k;
      continue;
    }
    if (length) out.length = length;
    if (angle) out.angle = angle;
  }
  return out;
}

}  // namespace flexcomp::host
