// SPDX-License-Identifier: Apache-2.0
#include "files/calibration_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>

#include "files/write_file.hpp"
#include "files/yaml_field.hpp"
#include "model/covariate.hpp"
#include "model/effects.hpp"
#include "model/place.hpp"
#include "nearest.hpp"
#include "quaternion.hpp"

namespace flexcomp::host {

namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t link_slot_count = 5;  // gamma has no constant part
constexpr int largest_multiple = 999'999;   // of the scale of a row of the covariance factor

// --- selectors of effects, both ways ------------------------------------------------------------------------------

std::string number(double si, const Unit& unit) { return yaml_number(si, unit); }

std::string list_text(const std::vector<std::string>& items) {
  return fmt::format("[{}]", fmt::join(items, ", "));
}

/// A key that tells two effects of one name apart.
struct SelectorKey {
  Selector selector;
  const char* key;
  bool optional;
  void (*read)(const YamlField& field, EffectId& id);
  std::string (*text)(const EffectId& id);  ///< empty where the key is left out
};

template <unsigned EffectId::*member>
SelectorKey counted(Selector selector, const char* key) {
  return {selector, key, false,
          [](const YamlField& field, EffectId& id) { id.*member = field.integer(1, joint_count); },
          [](const EffectId& id) { return id.*member == 0 ? "" : fmt::format("{}", id.*member); }};
}

void read_covariates(const YamlField& of, EffectId& id) {
  const auto names = of.items();
  if (names.size() != 2) throw of.error("two covariates such as [q2, payload_kg]");
  for (std::size_t side = 0; side < 2; ++side) {
    const auto covariate = covariate_of(names[side].text());
    if (!covariate)
      throw names[side].error("one of q1 … q6, payload_kg, temp_c, time_s, dir1 … dir6, speed1 … speed6");
    std::tie(id.covariate[side], id.covariate_joint[side]) = *covariate;
  }
}

std::string covariates_text(const EffectId& id) {
  return list_text({covariate_name(id.covariate[0], id.covariate_joint[0]),
                    covariate_name(id.covariate[1], id.covariate_joint[1])});
}

void read_nodes(const YamlField& grid, EffectId& id) {
  const auto sides = grid.items();
  if (sides.size() != 2) throw grid.error("two lists of nodes");
  for (std::size_t side = 0; side < 2; ++side) {
    for (const YamlField& node : sides[side].items())
      id.node[side].push_back(node.number(covariate_unit(id.covariate[side])));
  }
}

std::string nodes_text(const EffectId& id) {
  std::vector<std::string> sides;
  for (std::size_t side = 0; side < 2; ++side) {
    std::vector<std::string> nodes;
    for (const double v : id.node[side]) nodes.push_back(number(v, covariate_unit(id.covariate[side])));
    sides.push_back(list_text(nodes));
  }
  return list_text(sides);
}

/// Keys of one selector in the order in which they are read: `grid` needs the covariates. Selector::size has none.
const std::vector<SelectorKey>& selector_keys() {
  static const std::vector<SelectorKey> all{
      counted<&EffectId::joint>(Selector::joint, "joint"),
      counted<&EffectId::from>(Selector::from, "from"),
      counted<&EffectId::link>(Selector::link, "link"),
      {Selector::order, "order", false,
       [](const YamlField& field, EffectId& id) { id.order = field.number(unit::si, 0, "an order above 0"); },
       [](const EffectId& id) { return number(id.order, unit::si); }},
      {Selector::pivot, "pivot_z_mm", true,
       [](const YamlField& field, EffectId& id) { id.pivot_z_m = field.number(unit::mm); },
       [](const EffectId& id) { return number(id.pivot_z_m, unit::mm); }},
      {Selector::after, "after_s", false,
       [](const YamlField& field, EffectId& id) { id.after_s = field.number(unit::si); },
       [](const EffectId& id) { return number(id.after_s, unit::si); }},
      {Selector::factor, "factor", true,
       [](const YamlField& field, EffectId& id) {
         const auto factor = factor_of(field.text());
         if (!factor) throw field.error("one of load_torque, temperature, payload");
         id.factor = *factor;
       },
       [](const EffectId& id) { return factor_name(id.factor); }},
      {Selector::place, "place", false,
       [](const YamlField& field, EffectId& id) {
         const auto place = place_of(field.text());
         if (!place) throw field.error("a place such as link3.theta");
         id.place = *place;
       },
       [](const EffectId& id) { return place_name(id.place); }},
      {Selector::grid, "of", false, read_covariates, covariates_text},
      {Selector::grid, "grid", false, read_nodes, nodes_text}};
  return all;
}

// --- reading ------------------------------------------------------------------------------------------------------

/// Builds the terms of a file in its order.
class SetReader {
 public:
  SetReader(Calibration& calibration, const Robot& robot) : out_(calibration), robot_(robot) {}

  void geometric(const YamlField& list) {
    std::map<unsigned, std::size_t> seen;
    for (const YamlField& entry : list.items()) {
      const unsigned link = entry.at("link").integer(1, joint_count);
      const auto [at, is_new] = seen.emplace(link, entry.line());
      if (!is_new)
        throw entry.error("each link once",
                          fmt::format("link {} again (first in line {})", link, at->second));
      constants(entry, static_cast<std::uint8_t>(link), link_slot_count, "link");
    }
  }

  /// Constant terms of one body under keys such as x_mm, each with its sigma.
  void constants(const YamlField& entry, std::uint8_t body, std::uint8_t slots,
                 const std::string& other_key = "") {
    std::vector<std::string> names;
    for (std::uint8_t s = 0; s < slots; ++s) names.push_back(key_of({body, s}));
    require_keys(entry, names,
                 other_key.empty() ? std::vector<std::string>{} : std::vector<std::string>{other_key});
    for (std::uint8_t s = 0; s < slots; ++s) {
      const auto field = entry.find(names[s]);
      if (!field) continue;
      Term<double> t;
      t.place = {body, s};
      t.coefficient = field->number(place_unit(t.place));
      if (is_beyond_small(t)) throw field->error(small_terms_rule);
      add(t, sigma(entry, names[s], place_unit(t.place)));
    }
  }

  void effect(const YamlField& entry) {
    const YamlField name_field = entry.at("effect");
    const std::string effect_text = name_field.text();
    const auto effect = effect_of(effect_text);
    if (!effect)
      throw name_field.error(
          expected_name(effect_text, effect_names(), "one of", "an effect of the catalogue"));
    std::vector<std::string> selectors{"effect"};
    const EffectId id = identity(entry, *effect, selectors);
    if (*effect == Effect::joint_curve && id.factor == Factor::one) {
      selectors.emplace_back("regularised");
      const auto field = entry.find("regularised");
      if (field && field->boolean()) out_.regularised.push_back(id.joint);
    }
    if (const auto wrong = validation_error(id, robot_.nominal)) throw entry.error(*wrong, name(id));
    const auto [at, is_new] = seen_.emplace(name(id), entry.line());
    if (!is_new)
      throw entry.error("each effect once", fmt::format("{} again (first in line {})", name(id), at->second));

    const std::vector<EffectKey> list = keys(id, robot_.nominal);
    std::vector<std::string> names;
    names.reserve(list.size());
    for (const EffectKey& key : list) names.push_back(key.key);
    require_keys(entry, names, selectors);
    const std::uint16_t instance = next_instance(out_.terms);
    for (const EffectKey& key : list) {
      const auto field = entry.find(key.key);
      if (!field) continue;
      if (key.terms.front().table != no_table) {
        table(entry, *field, id, key, instance);
        continue;
      }
      const double value = field->number(key.unit);
      for (Term<double> t : key.terms) {
        t.coefficient = value;
        t.instance = instance;
        add(t, sigma(entry, key.key, key.unit));
      }
    }
  }

 private:
  static std::string key_of(Place place) {
    const std::string full = geometric_name(place);
    return full.substr(full.find('.') + 1);
  }

  static void require_keys(const YamlField& entry, const std::vector<std::string>& coefficients,
                           const std::vector<std::string>& others) {
    std::vector<std::string> known = others;
    known.insert(known.end(), coefficients.begin(), coefficients.end());
    // Uncertainties stand beside their coefficients only; among the hints they would hide the keys that matter.
    std::vector<std::string> all = known;
    for (const std::string& c : coefficients) {
      const auto sigma = entry.find("sigma_" + c);
      if (!sigma) continue;
      if (!entry.has(c)) throw sigma->error(fmt::format("it beside {}", c), "it alone");
      all.push_back("sigma_" + c);
    }
    entry.require_keys(all);
  }

  static double sigma(const YamlField& entry, const std::string& key, const Unit& unit) {
    const auto field = entry.find("sigma_" + key);
    if (!field) return none;
    const double value = field->number(unit);
    if (value < 0) throw field->error("a standard deviation of 0 or more");
    return value;
  }

  void add(const Term<double>& term, double sigma) {
    out_.terms.terms.push_back(term);
    out_.sigma.push_back(sigma);
  }

  /// The selectors of an effect: what stands in the brackets of its name. Their keys are appended to `selectors`.
  static EffectId identity(const YamlField& entry, Effect effect, std::vector<std::string>& selectors) {
    EffectId id;
    id.effect = effect;
    const EffectDescriptor& d = descriptor(effect);
    for (const Selector s : d.selectors) {
      if (s == Selector::size) id.coefficients = entry.at("coefficients_rad").items().size();
      for (const SelectorKey& k : selector_keys()) {
        if (k.selector != s) continue;
        selectors.emplace_back(k.key);
        const bool optional = k.optional || (s == Selector::link && d.all_links_by_default);
        if (!optional || entry.has(k.key)) k.read(entry.at(k.key), id);
      }
    }
    return id;
  }

  /// Numbers of a curve (a list) or a grid (a list of rows).
  static std::vector<double> numbers(const YamlField& field, const EffectId& id, const Unit& unit) {
    std::vector<double> values;
    if (descriptor(id.effect).table == TableKind::curve) {
      for (const YamlField& item : field.items()) values.push_back(item.number(unit));
      if (values.size() != id.coefficients) throw field.error(fmt::format("{} numbers", id.coefficients));
      return values;
    }
    const auto rows = field.items();
    if (rows.size() != id.node[0].size()) {
      throw field.error(fmt::format("{} rows, one per node of the first side", id.node[0].size()));
    }
    for (const YamlField& row : rows) {
      const auto items = row.items();
      if (items.size() != id.node[1].size()) {
        throw row.error(fmt::format("{} values, one per node of the second side", id.node[1].size()));
      }
      for (const YamlField& item : items) values.push_back(item.number(unit));
    }
    return values;
  }

  void table(const YamlField& entry, const YamlField& field, const EffectId& id, const EffectKey& key,
             std::uint16_t instance) {
    const std::vector<double> values = numbers(field, id, key.unit);
    const std::size_t first_term = out_.terms.terms.size();
    ParametricModel one;
    one.set = std::move(out_.terms);
    try {
      add_effect(one, id, robot_.nominal);
    } catch (const std::invalid_argument& e) {
      throw field.error("less", e.what());
    }
    for (std::size_t k = 0; k < values.size(); ++k) one.parameters[k].set(one.set, values[k]);
    out_.terms = std::move(one.set);
    out_.terms.terms[first_term].instance = instance;
    out_.sigma.push_back(none);
    if (const auto sigmas = entry.find("sigma_" + key.key)) {
      const std::vector<double> list = numbers(*sigmas, id, key.unit);
      out_.value_sigma.resize(out_.terms.values.size() - list.size(), none);
      out_.value_sigma.insert(out_.value_sigma.end(), list.begin(), list.end());
    }
    out_.value_sigma.resize(out_.terms.values.size(), none);
  }

  Calibration& out_;
  const Robot& robot_;
  std::map<std::string, std::size_t> seen_;
};

Frame read_frame(const YamlField& field) {
  field.require_keys({"xyz_mm", "quaternion_wxyz"});
  Frame frame;
  frame.position_m = field.at("xyz_mm").vector3(unit::mm);
  if (const auto q = field.find("quaternion_wxyz")) frame.orientation = q->quaternion();
  return frame;
}

Sha256Digest read_hash(const YamlField& field) {
  const std::string text = field.text();
  Sha256Digest digest{};
  bool good = text.size() == 2 * digest.size();
  for (std::size_t k = 0; good && k < digest.size(); ++k) {
    const char* p = text.data() + 2 * k;
    const auto [end, error] = std::from_chars(p, p + 2, digest[k], 16);
    good = error == std::errc() && end == p + 2;
  }
  if (!good) throw field.error("64 hexadecimal digits");
  return digest;
}

/// Numbers of one row of the covariance factor; as many as its rows at most, the rest is zero.
std::vector<double> read_covariance_row(const YamlField& row, std::size_t rows, double scale) {
  const YamlField field = row.at("row");
  const std::vector<YamlField> items = field.items();
  if (items.size() > rows) {
    throw field.error(fmt::format("at most {} numbers: no more columns than parameters", rows),
                      fmt::format("{}", items.size()));
  }
  std::vector<double> numbers;
  numbers.reserve(items.size());
  for (const YamlField& item : items) {
    const double number = scale > 0 ? item.whole_number(largest_multiple) * scale : item.number(unit::si);
    if (!std::isfinite(number)) throw item.error("a finite number, times scale");
    numbers.push_back(number);
  }
  return numbers;
}

/// A lower triangle, or rows of a length of their own where any has a `scale` or `own`.
CovarianceFactor read_covariance(const YamlField& list) {
  const std::vector<YamlField> rows = list.items();
  const auto count = static_cast<Eigen::Index>(rows.size());
  CovarianceFactor out;
  std::set<std::string> seen;
  std::vector<std::vector<double>> numbers;
  const bool is_compact =
      std::ranges::any_of(rows, [](const YamlField& row) { return row.has("scale") || row.has("own"); });
  if (is_compact) out.own = out.scale = Eigen::VectorXd::Zero(count);
  std::size_t columns = is_compact ? 0 : rows.size();
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const YamlField& row = rows[r];
    const auto i = static_cast<Eigen::Index>(r);
    row.require_keys({"parameter", "scale", "row", "own"});
    out.parameters.push_back(row.at("parameter").text());
    if (!seen.insert(out.parameters.back()).second)
      throw row.at("parameter").error("each parameter once", out.parameters.back() + " twice");
    if (const auto scale = row.find("scale")) out.scale[i] = scale->number(unit::si, 0, "a number above 0");
    if (const auto own = row.find("own")) {
      out.own[i] = own->number(unit::si);
      if (!(out.own[i] >= 0)) throw own->error("a standard deviation of 0 or more");
    }
    numbers.push_back(read_covariance_row(row, rows.size(), is_compact ? out.scale[i] : 0));
    if (!is_compact && numbers[r].size() != r + 1) {
      throw row.error(fmt::format("{} numbers: a lower triangle", r + 1),
                      fmt::format("{}", numbers[r].size()));
    }
    columns = std::max(columns, numbers[r].size());
  }
  out.factor = Eigen::MatrixXd::Zero(count, static_cast<Eigen::Index>(columns));
  for (std::size_t r = 0; r < rows.size(); ++r) {
    for (std::size_t k = 0; k < numbers[r].size(); ++k)
      out.factor(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(k)) = numbers[r][k];
  }
  return out;
}

void read_head(const YamlField& root, const Robot& robot, Calibration& c) {
  if (const auto field = root.find("robot")) {
    c.robot = field->text();
    if (c.robot != robot.name)
      throw field->error(fmt::format("'{}', the robot of {}", robot.name, robot.path));
  }
  if (const auto field = root.find("nominal_hash")) {
    c.nominal_hash = read_hash(*field);
    if (*c.nominal_hash != nominal_hash(robot.nominal)) {
      throw field->error(fmt::format("the nominal geometry of {} ({}…)", robot.path,
                                     hex(nominal_hash(robot.nominal)).substr(0, 12)),
                         hex(*c.nominal_hash).substr(0, 12) + "…: made for another geometry");
    }
  }
  if (const auto field = root.find("flexcomp_version")) c.tool_version = field->text();
  if (const auto field = root.find("date")) c.date = field->text();
  if (const auto field = root.find("sequence"))
    c.sequence = field->integer(0, std::numeric_limits<std::uint32_t>::max());
  if (const auto field = root.find("frames")) {
    field->require_keys({"f", "e"});
    c.frames.emplace();
    if (const auto f = field->find("f")) c.frames->f = read_frame(*f);
    if (const auto e = field->find("e")) c.frames->e = read_frame(*e);
  }
  if (const auto field = root.find("covariance_factor")) c.covariance = read_covariance(*field);
  if (const auto field = root.find("confounded")) {
    for (const YamlField& entry : field->items()) {
      entry.require_keys({"parameter", "with"});
      Confounded confounded;
      confounded.parameter = entry.at("parameter").text();
      for (const YamlField& other : entry.at("with").items()) confounded.with.push_back(other.text());
      c.confounded.push_back(std::move(confounded));
    }
  }
  if (const auto field = root.find("at_bound")) {
    for (const YamlField& entry : field->items()) {
      entry.require_keys({"parameter", "upper_95_si"});
      c.at_bound.push_back({entry.at("parameter").text(), entry.at("upper_95_si").number(unit::si)});
    }
  }
  if (const auto field = root.find("residuals")) {
    for (const std::string& key : field->keys())
      c.residuals.emplace_back(key, field->at(key).number(unit::si));
  }
}

// --- writing ------------------------------------------------------------------------------------------------------

/// Uncertainties are known to few digits.
std::string sigma_number(double si, const Unit& unit) {
  return yaml_number(fmt::format("{:.6g}", si / unit.si_per_file_unit()));
}

std::string frame_text(const Frame& f) {
  const auto p = [&](int k) { return number(f.position_m[k], unit::mm); };
  const Eigen::Quaterniond& q = f.orientation;
  return fmt::format("{{xyz_mm: [{}, {}, {}], quaternion_wxyz: [{}, {}, {}, {}]}}", p(0), p(1), p(2),
                     number(q.w(), unit::si), number(q.x(), unit::si), number(q.y(), unit::si),
                     number(q.z(), unit::si));
}

double sigma_at(const std::vector<double>& sigma, std::size_t k) {
  return k < sigma.size() ? sigma[k] : none;
}

/// `key: value` with its sigma where there is one.
void put(std::vector<std::string>& parts, const std::string& key, double si, double sigma, const Unit& unit) {
  parts.push_back(fmt::format("{}: {}", key, number(si, unit)));
  if (!std::isnan(sigma)) parts.push_back(fmt::format("sigma_{}: {}", key, sigma_number(sigma, unit)));
}

/// Geometric terms of one body, in the order of their slots.
std::vector<std::string> constants_text(const Calibration& c, std::uint8_t body) {
  std::vector<std::string> parts;
  for (std::uint8_t s = 0; s < 6; ++s) {
    for (std::size_t k = 0; k < c.terms.terms.size(); ++k) {
      const Term<double>& t = c.terms.terms[k];
      if (t.effect != Effect::geometric || t.place != Place{body, s}) continue;
      const std::string full = geometric_name(t.place);
      put(parts, full.substr(full.find('.') + 1), t.coefficient, sigma_at(c.sigma, k), place_unit(t.place));
    }
  }
  return parts;
}

/// Numbers of a curve as a list, of a grid as a list of rows.
std::string values_text(const EffectId& id, const std::vector<std::string>& values) {
  if (descriptor(id.effect).table == TableKind::curve) return list_text(values);
  const auto columns = static_cast<std::ptrdiff_t>(id.node[1].size());
  std::vector<std::string> rows;
  for (auto at = values.begin(); at != values.end(); at += columns)
    rows.push_back(list_text({at, at + columns}));
  return list_text(rows);
}

std::vector<std::string> selectors_text(const EffectId& id) {
  std::vector<std::string> parts{"effect: " + effect_name(id.effect)};
  for (const Selector s : descriptor(id.effect).selectors) {
    for (const SelectorKey& k : selector_keys()) {
      const std::string text = k.selector == s ? k.text(id) : "";
      if (!text.empty()) parts.push_back(fmt::format("{}: {}", k.key, text));
    }
  }
  return parts;
}

std::string effect_text(const Calibration& c, const EffectGroup& group) {
  std::vector<std::string> parts = selectors_text(group.id);
  if (group.id.effect == Effect::joint_curve && group.id.factor == Factor::one &&
      c.is_regularised(group.id.joint))
    parts.emplace_back("regularised: true");
  if (descriptor(group.id.effect).table != TableKind::none) {
    std::vector<std::string> values;
    std::vector<std::string> sigmas;
    bool any_sigma = false;
    for (const Parameter& p : group.parameters) {
      const double sigma = sigma_at(c.value_sigma, *p.value);
      any_sigma = any_sigma || !std::isnan(sigma);
      values.push_back(number(p.get(c.terms), p.unit));
      sigmas.push_back(sigma_number(std::isnan(sigma) ? 0 : sigma, p.unit));
    }
    parts.push_back(group.keys.front() + ": " + values_text(group.id, values));
    if (any_sigma) parts.push_back("sigma_" + group.keys.front() + ": " + values_text(group.id, sigmas));
  } else {
    for (std::size_t k = 0; k < group.parameters.size(); ++k) {
      const Parameter& p = group.parameters[k];
      put(parts, group.keys[k], p.get(c.terms), sigma_at(c.sigma, p.terms.front()), p.unit);
    }
  }
  return fmt::format("  - {{{}}}\n", fmt::join(parts, ", "));
}

/// Numbers of a row of the covariance factor. \param scale  they are whole multiples of it; 0: any
std::string covariance_row_text(const Eigen::VectorXd& row, double scale) {
  std::string text;
  for (Eigen::Index k = 0; k < row.size(); ++k) {
    if (k > 0) text += scale > 0 ? "," : ", ";  // several curves have 100,000 of them: no spaces
    text += scale > 0 ? fmt::format("{}", std::lround(row[k] / scale))
                      : yaml_number(fmt::format("{:.9g}", row[k]));
  }
  return text;
}

std::string covariance_text(const CovarianceFactor& covariance) {
  const Eigen::Index count = covariance.factor.rows();
  const bool is_compact = covariance.own.size() > 0 || covariance.scale.size() > 0;
  const Eigen::VectorXd none_at_all = Eigen::VectorXd::Zero(count);
  const Eigen::VectorXd& own = covariance.own.size() > 0 ? covariance.own : none_at_all;
  const Eigen::VectorXd& scale = covariance.scale.size() > 0 ? covariance.scale : none_at_all;
  // Without any of these keys a reader expects a lower triangle.
  const bool is_told = (own.array() > 0).any() || (scale.array() > 0).any();
  std::string text = "covariance_factor:  # covariance = factor * factor^T";
  text += is_compact ? " + diag(own^2), SI units (m, rad, rad/(N m)); factor = scale * row, then zeros\n"
                     : ", SI units (m, rad, rad/(N m)); lower triangle\n";
  for (Eigen::Index r = 0; r < count; ++r) {
    Eigen::Index size = is_compact ? covariance.factor.cols() : r + 1;
    while (is_compact && size > 0 && covariance.factor(r, size - 1) == 0) --size;
    text +=
        fmt::format("  - {{parameter: {}, ", yaml_quoted(covariance.parameters[static_cast<std::size_t>(r)]));
    if (scale[r] > 0) text += fmt::format("scale: {}, ", number(scale[r], unit::si));
    text += fmt::format("row: [{}]", covariance_row_text(covariance.factor.row(r).head(size), scale[r]));
    if (own[r] > 0 || (is_compact && !is_told && r == 0))
      text += fmt::format(", own: {}", sigma_number(own[r], unit::si));
    text += "}\n";
  }
  return text;
}

}  // namespace

Calibration load_calibration(const std::string& path, const Robot& robot) {
  const YamlField root = YamlField::load(path);
  root.require_keys({"robot", "nominal_hash", "flexcomp_version", "date", "sequence", "frames", "geometric",
                     "base", "tool", "effects", "confounded", "at_bound", "residuals", "covariance_factor"});
  Calibration calibration;
  calibration.path = path;
  read_head(root, robot, calibration);
  SetReader reader(calibration, robot);
  if (const auto field = root.find("geometric")) reader.geometric(*field);
  if (const auto field = root.find("base")) reader.constants(*field, body::base, 6);
  if (const auto field = root.find("tool")) reader.constants(*field, body::tool, 6);
  if (const auto field = root.find("effects")) {
    for (const YamlField& entry : field->items()) reader.effect(entry);
  }
  return calibration;
}

std::string calibration_text(const Calibration& c, const Robot& robot) {
  canonical(c.terms, robot.nominal);  // throws where a term would be lost below
  std::string text = "# Differences from the nominal robot, each with its standard deviation (sigma_…).\n";
  text += "robot: " + yaml_quoted(robot.name) + "\n";
  if (c.nominal_hash) text += "nominal_hash: " + yaml_quoted(hex(*c.nominal_hash)) + "\n";
  if (!c.tool_version.empty()) text += "flexcomp_version: " + yaml_quoted(c.tool_version) + "\n";
  if (!c.date.empty()) text += "date: " + yaml_quoted(c.date) + "\n";
  if (c.sequence) text += fmt::format("sequence: {}\n", *c.sequence);
  if (c.frames) {
    text += "frames:  # measured = f * base … tool * e\n";
    text += "  f: " + frame_text(c.frames->f) + "\n  e: " + frame_text(c.frames->e) + "\n";
  }
  std::string links;
  for (std::uint8_t link = 1; link <= joint_count; ++link) {
    const std::vector<std::string> parts = constants_text(c, link);
    if (!parts.empty()) links += fmt::format("  - {{link: {}, {}}}\n", link, fmt::join(parts, ", "));
  }
  if (!links.empty()) text += "geometric:\n" + links;
  if (const auto parts = constants_text(c, body::base); !parts.empty())
    text += fmt::format("base: {{{}}}\n", fmt::join(parts, ", "));
  if (const auto parts = constants_text(c, body::tool); !parts.empty())
    text += fmt::format("tool: {{{}}}\n", fmt::join(parts, ", "));
  const std::vector<EffectGroup> groups = effects_of(c.terms, robot.nominal);
  if (!groups.empty()) text += "effects:\n";
  for (const EffectGroup& group : groups) text += effect_text(c, group);
  if (!c.confounded.empty()) text += "confounded:  # left out, and what carries it\n";
  for (const Confounded& confounded : c.confounded) {
    std::vector<std::string> with;
    for (const std::string& other : confounded.with) with.push_back(yaml_quoted(other));
    text +=
        fmt::format("  - {{parameter: {}, with: {}}}\n", yaml_quoted(confounded.parameter), list_text(with));
  }
  if (!c.at_bound.empty()) text += "at_bound:  # as small as physics allows; 95 % sure to be below (SI)\n";
  for (const AtBound& bound : c.at_bound) {
    text += fmt::format("  - {{parameter: {}, upper_95_si: {}}}\n", yaml_quoted(bound.parameter),
                        sigma_number(bound.upper_95, unit::si));
  }
  if (!c.residuals.empty()) text += "residuals:\n";
  for (const auto& [key, value] : c.residuals)
    text += fmt::format("  {}: {}\n", key, number(value, unit::si));
  if (c.covariance) text += covariance_text(*c.covariance);
  return text;
}

void save_calibration(const std::string& path, const Calibration& calibration, const Robot& robot) {
  write_file(path, calibration_text(calibration, robot));
}

}  // namespace flexcomp::host
