// SPDX-License-Identifier: Apache-2.0
#include "model/effects.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>

namespace flexcomp::host {

namespace {

const std::vector<std::pair<Effect, std::string>>& registry() {
  static const std::vector<std::pair<Effect, std::string>> names{
      {Effect::joint_compliance, "joint_compliance"},
      {Effect::link_gravity, "link_gravity"},
      {Effect::nonlinear_compliance, "nonlinear_compliance"},
      {Effect::gear_harmonic, "gear_harmonic"},
      {Effect::joint_curve, "joint_curve"},
      {Effect::backlash, "backlash"},
      {Effect::readout_lag, "readout_lag"},
      {Effect::encoder_scale, "encoder_scale"},
      {Effect::joint_coupling, "joint_coupling"},
      {Effect::axis_wobble, "axis_wobble"},
      {Effect::link_bending, "link_bending"},
      {Effect::thermal_growth, "thermal_growth"},
      {Effect::base_drift, "base_drift"},
      {Effect::base_compliance, "base_compliance"},
      {Effect::payload_error, "payload_error"},
      {Effect::reflector_slip, "reflector_slip"},
      {Effect::unnamed, "unnamed"},
  };
  return names;
}

bool is_link(Place p) { return p.body >= 1 && p.body <= body::max_link; }

constexpr std::array<const char*, 6> link_slots{"theta", "d", "a", "alpha", "beta", "gamma"};
constexpr std::array<const char*, 6> frame_slots{"x", "y", "z", "rx", "ry", "rz"};
constexpr std::array<const char*, 4> load_slots{"mass", "com_x", "com_y", "com_z"};

Place link_place(unsigned link, std::uint8_t slot) { return {static_cast<std::uint8_t>(link), slot}; }

/// A term of joint or link `from_1` that the basis reads.
Term<double> make_term(Place place, Basis basis, unsigned from_1, Effect effect, double argument = 0) {
  Term<double> t;
  t.place = place;
  t.basis = basis;
  t.joint = static_cast<std::uint8_t>(from_1 == 0 ? 0 : from_1 - 1);
  t.effect = effect;
  t.argument = argument;
  t.coefficient = 0;
  return t;
}

/// A link-weight lever (M13) from joint `from_1` to joint `distal_1`, on theta of a link.
Term<double> make_lever(unsigned link, unsigned from_1, unsigned distal_1, Effect effect) {
  Term<double> t = make_term(link_place(link, slot::theta), Basis::link_weight, from_1, effect);
  t.distal_joint = static_cast<std::uint8_t>(distal_1 - 1);
  return t;
}

/// Everything of a term but its coefficient, table and instance.
bool same_kind(const Term<double>& a, const Term<double>& b) {
  return a.place == b.place && a.basis == b.basis && a.joint == b.joint && a.factor == b.factor &&
         a.effect == b.effect && a.argument == b.argument && a.distal_joint == b.distal_joint;
}

bool has_length(const Nominal& robot, unsigned link) {
  return robot.links[link - 1].a_m != 0 || robot.links[link - 1].d_m != 0;
}

/// The terms of growth of one link: its nominal length is in the basis, so a length of zero has no term.
void add_growth(std::vector<Term<double>>& terms, const Nominal& robot, unsigned link) {
  const NominalLink& l = robot.links[link - 1];
  if (l.d_m != 0)
    terms.push_back(make_term(link_place(link, slot::d), Basis::thermal, link, Effect::thermal_growth));
  if (l.a_m != 0)
    terms.push_back(make_term(link_place(link, slot::a), Basis::thermal, link, Effect::thermal_growth));
}

double twist_sine(const Nominal& robot, unsigned link) {
  return std::abs(std::sin(robot.links[link - 1].alpha_rad));
}

const char* factor_name(Factor factor) {
  switch (factor) {
    case Factor::one:
      return "";
    case Factor::load_torque:
      return "load_torque";
    case Factor::temperature:
      return "temperature";
    case Factor::payload:
      return "payload";
  }
  return "";
}

bool is_joint_covariate(Covariate c) {
  return c == Covariate::joint_position || c == Covariate::direction || c == Covariate::relative_speed;
}

}  // namespace

// --- names ------------------------------------------------------------------------------------------------------

std::string effect_name(Effect effect) {
  for (const auto& [e, name] : registry()) {
    if (e == effect) return name;
  }
  return {};
}

std::optional<Effect> effect_of(std::string_view name) {
  for (const auto& [e, n] : registry()) {
    if (n == name) return e;
  }
  return {};
}

const std::vector<std::string>& effect_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const auto& entry : registry()) all.push_back(entry.second);
    return all;
  }();
  return names;
}

std::string name(const EffectId& id) {
  std::vector<std::string> parts;
  if (id.effect == Effect::unnamed) parts.push_back("place=" + place_name(id.place));
  if (id.joint != 0) parts.push_back(fmt::format("joint={}", id.joint));
  if (id.order != 0) parts.push_back("order=" + format_si(id.order, unit::si));
  if (id.from != 0) parts.push_back(fmt::format("from={}", id.from));
  if (id.link != 0) parts.push_back(fmt::format("link={}", id.link));
  if (id.effect == Effect::joint_curve && id.factor != Factor::one) {
    parts.push_back(fmt::format("factor={}", factor_name(id.factor)));
  }
  if (id.effect == Effect::reflector_slip) parts.push_back("after=" + format_si(id.after_s, unit::si));
  if (id.effect == Effect::unnamed) {
    parts.push_back(fmt::format("of={}+{}", covariate_name(id.covariate[0], id.covariate_joint[0]),
                                covariate_name(id.covariate[1], id.covariate_joint[1])));
  }
  const std::string plain = effect_name(id.effect);
  return parts.empty() ? plain : fmt::format("{}[{}]", plain, fmt::join(parts, ","));
}

bool is_measurement_effect(Effect effect) {
  return effect == Effect::base_drift || effect == Effect::readout_lag || effect == Effect::reflector_slip;
}

std::string place_name(Place place) {
  if (is_link(place) && place.slot < link_slots.size())
    return fmt::format("link{}.{}", place.body, link_slots[place.slot]);
  if (place.body == body::base && place.slot < frame_slots.size())
    return fmt::format("base.{}", frame_slots[place.slot]);
  if (place.body == body::tool && place.slot < frame_slots.size())
    return fmt::format("tool.{}", frame_slots[place.slot]);
  if (place.body == body::load && place.slot < load_slots.size())
    return fmt::format("load.{}", load_slots[place.slot]);
  if (place.body == body::point && place.slot < 3) return fmt::format("point.{}", frame_slots[place.slot]);
  return {};
}

std::optional<Place> place_of(std::string_view name) {
  for (const std::uint8_t b : {body::base, body::tool, body::load, body::point}) {
    for (std::uint8_t s = 0; s < 6; ++s) {
      if (place_name({b, s}) == name) return Place{b, s};
    }
  }
  for (std::uint8_t b = 1; b <= joint_count; ++b) {
    for (std::uint8_t s = 0; s < 6; ++s) {
      if (place_name({b, s}) == name) return Place{b, s};
    }
  }
  return {};
}

Unit place_unit(Place place) {
  if (is_link(place)) return place.slot == slot::d || place.slot == slot::a ? unit::mm : unit::degree;
  if (place.body == body::load) return place.slot == slot::mass ? Unit{"kg", 1, 1} : unit::mm;
  return place.slot <= slot::z ? unit::mm : unit::degree;
}

std::string geometric_name(Place place) {
  return fmt::format("{}_{}", place_name(place), place_unit(place).name);
}

bool is_beyond_small(const Term<double>& term) {
  if (term.place.body != body::base && term.place.body != body::tool) return false;
  // A little more than the limit, for a value that was written with few digits.
  return std::abs(term.coefficient) > (term.place.slot <= slot::z ? 0.020 : radians(2)) * (1 + 1e-12);
}

std::string covariate_name(Covariate covariate, unsigned joint) {
  switch (covariate) {
    case Covariate::joint_position:
      return fmt::format("q{}", joint);
    case Covariate::payload:
      return "payload_kg";
    case Covariate::temperature:
      return "temp_c";
    case Covariate::time:
      return "time_s";
    case Covariate::direction:
      return fmt::format("dir{}", joint);
    case Covariate::relative_speed:
      return fmt::format("speed{}", joint);
  }
  return {};
}

std::optional<std::pair<Covariate, unsigned>> covariate_of(std::string_view name) {
  for (const Covariate c : {Covariate::joint_position, Covariate::payload, Covariate::temperature,
                            Covariate::time, Covariate::direction, Covariate::relative_speed}) {
    for (unsigned j = 1; j <= joint_count; ++j) {
      if (covariate_name(c, j) == name) return std::pair{c, is_joint_covariate(c) ? j : 0U};
    }
  }
  return {};
}

Unit covariate_unit(Covariate covariate) {
  return covariate == Covariate::joint_position ? unit::degree : unit::si;
}

// --- what an effect stands for ------------------------------------------------------------------------------------

std::optional<std::string> validation_error(const EffectId& id, const Nominal& robot) {
  const auto joint_wrong = [](unsigned j) { return j < 1 || j > joint_count; };
  switch (id.effect) {
    case Effect::joint_compliance:
    case Effect::nonlinear_compliance:
    case Effect::backlash:
    case Effect::readout_lag:
    case Effect::encoder_scale:
      if (joint_wrong(id.joint)) return "a joint from 1 to 6";
      break;
    case Effect::gear_harmonic:
      if (joint_wrong(id.joint)) return "a joint from 1 to 6";
      if (!(id.order > 0 && id.order <= 1e5)) return "an order above 0";
      break;
    case Effect::axis_wobble:
      if (joint_wrong(id.joint)) return "a joint from 1 to 6";
      if (id.order != 1 && id.order != 2) return "order 1 or 2";
      break;
    case Effect::joint_coupling:
      if (joint_wrong(id.joint) || joint_wrong(id.from)) return "joint and from, each from 1 to 6";
      if (id.joint == id.from) return "two joints (of a joint with itself the name is encoder_scale)";
      break;
    case Effect::joint_curve:
      if (joint_wrong(id.joint)) return "a joint from 1 to 6";
      if (id.coefficients < 6 || id.coefficients > 256) return "6 to 256 coefficients";
      break;
    case Effect::link_bending:
      if (joint_wrong(id.link)) return "a link from 1 to 6";
      break;
    case Effect::thermal_growth:
      if (id.link != 0 && joint_wrong(id.link)) return "a link from 1 to 6";
      if (id.link != 0 && !has_length(robot, id.link)) return "a link with a nominal length (d or a)";
      break;
    case Effect::link_gravity:
      if (!gravity_is_axial(robot))
        return "gravity along the axis of joint 1 (on other mountings the weight also loads joint 1, which "
               "has no term yet)";
      break;
    case Effect::unnamed:
      if (place_name(id.place).empty() || id.place.body == body::load) return "a place such as link3.theta";
      for (std::size_t side = 0; side < 2; ++side) {
        if (is_joint_covariate(id.covariate[side]) && joint_wrong(id.covariate_joint[side]))
          return "a joint from 1 to 6";
        const std::vector<double>& nodes = id.node[side];
        if (nodes.size() < 2 || nodes.size() > 64) return "2 to 64 nodes along each side of the grid";
        if (std::adjacent_find(nodes.begin(), nodes.end(), [](double a, double b) { return !(a < b); }) !=
            nodes.end()) {
          return "nodes of the grid in ascending order";
        }
      }
      break;
    case Effect::base_drift:
    case Effect::base_compliance:
    case Effect::payload_error:
    case Effect::reflector_slip:
      break;
    case Effect::geometric:
      return "an effect of the catalogue";
  }
  return {};
}

std::vector<EffectKey> keys(const EffectId& id, const Nominal& robot) {
  if (const auto wrong = validation_error(id, robot)) {
    throw std::invalid_argument(fmt::format("{}: expected {}", name(id), *wrong));
  }
  const Effect e = id.effect;
  const Place theta = link_place(id.joint, slot::theta);
  std::vector<EffectKey> list;
  const auto add = [&list](std::string key, const Unit& unit, std::vector<Term<double>> terms,
                           bool identified = true) {
    list.push_back({std::move(key), unit, std::move(terms), identified});
  };
  switch (e) {
    case Effect::joint_compliance:
      add("rad_per_nm", unit::si, {make_term(theta, Basis::load_torque, id.joint, e)});
      break;
    case Effect::nonlinear_compliance:
      add("rad_per_nm3", unit::si, {make_term(theta, Basis::load_torque_cubed, id.joint, e)});
      break;
    case Effect::link_gravity:
      // s_2, the upper arm's lever, ends at the origin of joint 3; s_23, the forearm's, at that of joint 5.
      add("k1_rad", unit::si, {make_lever(2, 2, 3, e)});
      add("k2_rad", unit::si, {make_lever(2, 3, 5, e)});
      add("k3_rad", unit::si, {make_lever(3, 3, 5, e)});
      break;
    case Effect::gear_harmonic:
      add("sin_rad", unit::si, {make_term(theta, Basis::sine, id.joint, e, id.order)});
      add("cos_rad", unit::si, {make_term(theta, Basis::cosine, id.joint, e, id.order)});
      break;
    case Effect::joint_curve: {
      Term<double> t = make_term(theta, Basis::curve, id.joint, e);
      t.factor = id.factor;
      t.table = 0;
      t.coefficient = 1;
      add("coefficients_rad", unit::si, {t});
      break;
    }
    case Effect::backlash:
      add("half_gap_rad", unit::si, {make_term(theta, Basis::direction, id.joint, e)});
      break;
    case Effect::readout_lag:
      add("rad", unit::si, {make_term(theta, Basis::relative_speed, id.joint, e)});
      break;
    case Effect::encoder_scale:
      add("gain", unit::si, {make_term(theta, Basis::joint_position, id.joint, e)});
      break;
    case Effect::joint_coupling:
      add("gain", unit::si, {make_term(theta, Basis::joint_position, id.from, e)});
      break;
    case Effect::axis_wobble: {
      const Place alpha = link_place(id.joint, slot::alpha);
      const Place gamma = link_place(id.joint, slot::gamma);
      add("alpha_sin_rad", unit::si, {make_term(alpha, Basis::sine, id.joint, e, id.order)});
      add("alpha_cos_rad", unit::si, {make_term(alpha, Basis::cosine, id.joint, e, id.order)});
      add("gamma_sin_rad", unit::si, {make_term(gamma, Basis::sine, id.joint, e, id.order)});
      add("gamma_cos_rad", unit::si, {make_term(gamma, Basis::cosine, id.joint, e, id.order)});
      break;
    }
    case Effect::link_bending:
      add("alpha_rad_per_nm", unit::si,
          {make_term(link_place(id.link, slot::alpha), Basis::load_moment_x, id.link, e)});
      // On a link whose twist is large the tilt about y is the next joint's own motion.
      add("beta_rad_per_nm", unit::si,
          {make_term(link_place(id.link, slot::beta), Basis::load_moment_y, id.link, e)},
          twist_sine(robot, id.link) <= 0.1);
      break;
    case Effect::thermal_growth: {
      std::vector<Term<double>> terms;
      for (unsigned link = 1; link <= joint_count; ++link) {
        if (id.link == 0 || id.link == link) add_growth(terms, robot, link);
      }
      add("per_k", unit::si, std::move(terms));
      break;
    }
    case Effect::base_drift:
      for (std::uint8_t s = 0; s < 6; ++s) {
        add(fmt::format("{}_{}_per_h", frame_slots[s], s < 3 ? "mm" : "deg"),
            s < 3 ? unit::mm_per_hour : unit::degree_per_hour,
            {make_term({body::base, s}, Basis::time, 0, e)});
      }
      break;
    case Effect::base_compliance:
      add("rx_rad_per_nm", unit::si,
          {make_term({body::base, slot::rx}, Basis::base_moment_x, 0, e, id.pivot_z_m)});
      add("ry_rad_per_nm", unit::si,
          {make_term({body::base, slot::ry}, Basis::base_moment_y, 0, e, id.pivot_z_m)});
      break;
    case Effect::payload_error:
      for (std::uint8_t s = 0; s < 4; ++s) {
        const Place place{body::load, s};
        add(fmt::format("{}_{}", load_slots[s], place_unit(place).name), place_unit(place),
            {make_term(place, Basis::one, 0, e)});
      }
      break;
    case Effect::reflector_slip:
      for (std::uint8_t s = 0; s < 3; ++s) {
        add(fmt::format("{}_mm", frame_slots[s]), unit::mm,
            {make_term({body::point, s}, Basis::step, 0, e, id.after_s)});
      }
      break;
    case Effect::unnamed: {
      Term<double> t = make_term(id.place, Basis::grid, 0, e);
      t.table = 0;
      t.coefficient = 1;
      const bool length = place_unit(id.place).name == "mm";
      add(length ? "values_mm" : "values_rad", length ? unit::mm : unit::si, {t});
      break;
    }
    case Effect::geometric:
      break;
  }
  return list;
}

std::uint16_t next_instance(const TermSet& set) {
  std::uint16_t highest = 0;
  for (const Term<double>& t : set.terms) highest = std::max(highest, t.instance);
  return static_cast<std::uint16_t>(highest + 1);
}

namespace {

/// Appends the table of a curve or grid with values zero; returns its index. Offsets are 16 bits wide.
std::uint16_t add_table(TermSet& set, const EffectId& id) {
  const std::size_t size = id.effect == Effect::joint_curve ? id.coefficients
                                                            : id.node[0].size() + id.node[1].size() +
                                                                  id.node[0].size() * id.node[1].size();
  if (set.values.size() + size > 0xFFFF)
    throw std::invalid_argument("expected at most 65535 values in all tables");
  Table table;
  table.offset = static_cast<std::uint16_t>(set.values.size());
  if (id.effect == Effect::joint_curve) {
    table.size = static_cast<std::uint16_t>(id.coefficients);
    set.values.resize(set.values.size() + id.coefficients, 0.0);
  } else {
    table.rows = static_cast<std::uint16_t>(id.node[0].size());
    table.columns = static_cast<std::uint16_t>(id.node[1].size());
    table.size = static_cast<std::uint16_t>(table.rows + table.columns + table.rows * table.columns);
    table.row_covariate = id.covariate[0];
    table.column_covariate = id.covariate[1];
    table.row_joint = static_cast<std::uint8_t>(std::max(1U, id.covariate_joint[0]) - 1);
    table.column_joint = static_cast<std::uint8_t>(std::max(1U, id.covariate_joint[1]) - 1);
    for (const std::vector<double>& side : id.node)
      set.values.insert(set.values.end(), side.begin(), side.end());
    set.values.resize(set.values.size() + static_cast<std::size_t>(table.rows) * table.columns, 0.0);
  }
  set.tables.push_back(table);
  return static_cast<std::uint16_t>(set.tables.size() - 1);
}

/// Parameters of a key whose terms are `indices` of the set: one, or one per value of the table.
void append_parameters(std::vector<Parameter>& parameters, const TermSet& set, const EffectId& id,
                       const EffectKey& key, const std::vector<std::size_t>& indices) {
  const std::string full = fmt::format("{}.{}", name(id), key.key);
  if (id.effect != Effect::joint_curve && id.effect != Effect::unnamed) {
    parameters.push_back({full, key.unit, indices, {}});
    return;
  }
  const Table& table = set.tables[set.terms[indices.front()].table];
  const std::size_t nodes = table.rows == 0 ? 0U : static_cast<std::size_t>(table.rows) + table.columns;
  for (std::size_t k = nodes; k < table.size; ++k) {
    parameters.push_back({fmt::format("{}[{}]", full, k - nodes), key.unit, indices, table.offset + k});
  }
}

}  // namespace

void add_effect(ParametricModel& model, const EffectId& id, const Nominal& robot) {
  const std::uint16_t instance = next_instance(model.set);
  for (const EffectKey& key : keys(id, robot)) {
    if (!key.identified) continue;
    std::vector<std::size_t> indices;
    for (Term<double> t : key.terms) {
      t.instance = instance;
      if (t.table != no_table) t.table = add_table(model.set, id);
      indices.push_back(model.set.terms.size());
      model.set.terms.push_back(t);
    }
    append_parameters(model.parameters, model.set, id, key, indices);
  }
}

// --- and back into names --------------------------------------------------------------------------------------------

namespace {

/// The id of the effect that these terms make up, from the terms alone.
EffectId identity_of(const TermSet& set, const std::vector<std::size_t>& members, const Nominal& robot) {
  const Term<double>& first = set.terms[members.front()];
  EffectId id;
  id.effect = first.effect;
  const unsigned place_link = is_link(first.place) ? first.place.body : 0;
  const unsigned basis_joint = first.joint + 1U;
  switch (first.effect) {
    case Effect::joint_compliance:
    case Effect::nonlinear_compliance:
    case Effect::backlash:
    case Effect::readout_lag:
    case Effect::encoder_scale:
      id.joint = place_link;
      break;
    case Effect::gear_harmonic:
    case Effect::axis_wobble:
      id.joint = place_link;
      id.order = first.argument;
      break;
    case Effect::joint_coupling:
      id.joint = place_link;
      id.from = basis_joint;
      break;
    case Effect::link_bending:
      id.link = place_link;
      break;
    case Effect::thermal_growth: {
      std::size_t all = 0;
      for (const NominalLink& l : robot.links) all += (l.a_m != 0 ? 1U : 0U) + (l.d_m != 0 ? 1U : 0U);
      id.link = members.size() == all ? 0 : place_link;
      break;
    }
    case Effect::base_compliance:
      id.pivot_z_m = first.argument;
      break;
    case Effect::reflector_slip:
      id.after_s = first.argument;
      break;
    case Effect::joint_curve:
    case Effect::unnamed: {
      if (first.table >= set.tables.size()) throw std::invalid_argument("a term without its table");
      const Table& table = set.tables[first.table];
      if ((table.rows == 0) != (first.effect == Effect::joint_curve) ||
          table.offset + table.size > set.values.size()) {
        throw std::invalid_argument("a term with a table of another kind");
      }
      if (first.effect == Effect::joint_curve) {
        id.joint = place_link;
        id.coefficients = table.size;
        id.factor = first.factor;
        break;
      }
      id.place = first.place;
      id.covariate = {table.row_covariate, table.column_covariate};
      id.covariate_joint = {is_joint_covariate(table.row_covariate) ? table.row_joint + 1U : 0U,
                            is_joint_covariate(table.column_covariate) ? table.column_joint + 1U : 0U};
      const double* v = set.values.data() + table.offset;
      id.node[0].assign(v, v + table.rows);
      id.node[1].assign(v + table.rows, v + table.rows + table.columns);
      break;
    }
    default:
      break;
  }
  return id;
}

EffectGroup group_of(const TermSet& set, const std::vector<std::size_t>& members, const Nominal& robot) {
  EffectGroup group;
  group.id = identity_of(set, members, robot);
  std::size_t matched = 0;
  for (const EffectKey& key : keys(group.id, robot)) {
    std::vector<std::size_t> indices;
    for (const Term<double>& wanted : key.terms) {
      for (const std::size_t m : members) {
        if (same_kind(set.terms[m], wanted)) indices.push_back(m);
      }
    }
    if (indices.empty()) continue;
    const bool table = key.terms.front().table != no_table;
    const double coefficient = set.terms[indices.front()].coefficient;
    const bool equal = std::all_of(indices.begin(), indices.end(), [&](std::size_t m) {
      return set.terms[m].coefficient == coefficient && (table || set.terms[m].table == no_table);
    });
    if (indices.size() != key.terms.size() || !equal || (table && coefficient != 1)) {
      throw std::invalid_argument(
          fmt::format("{}.{}: its terms do not fit together", name(group.id), key.key));
    }
    matched += indices.size();
    group.keys.push_back(key.key);
    append_parameters(group.parameters, set, group.id, key, indices);
  }
  if (matched != members.size()) {
    throw std::invalid_argument(fmt::format("{}: a term that is none of its keys", name(group.id)));
  }
  return group;
}

}  // namespace

std::vector<EffectGroup> effects_of(const TermSet& set, const Nominal& robot) {
  std::vector<std::vector<std::size_t>> groups;
  std::map<std::pair<Effect, std::uint16_t>, std::size_t> index;
  for (std::size_t k = 0; k < set.terms.size(); ++k) {
    const Term<double>& t = set.terms[k];
    if (t.effect == Effect::geometric) continue;
    const auto [at, is_new] = index.emplace(std::pair{t.effect, t.instance}, groups.size());
    if (is_new) groups.emplace_back();
    groups[at->second].push_back(k);
  }
  std::vector<EffectGroup> list;
  list.reserve(groups.size());
  for (const auto& members : groups) list.push_back(group_of(set, members, robot));
  return list;
}

TermSet canonical(const TermSet& set, const Nominal& robot) {
  TermSet out;
  const auto rank = [](const Term<double>& t) {
    return std::pair{t.place.body == body::base ? 0x3F : t.place.body, t.place.slot};
  };
  for (const Term<double>& t : set.terms) {
    if (t.effect != Effect::geometric) continue;
    const bool link = is_link(t.place) && t.place.body <= joint_count && t.place.slot <= slot::beta;
    const bool frame = (t.place.body == body::base || t.place.body == body::tool) && t.place.slot <= slot::rz;
    if (t.basis != Basis::one || !(link || frame)) {
      throw std::invalid_argument("a geometric term that is not a constant of a link, the base or the tool");
    }
    out.terms.push_back(t);
    out.terms.back().instance = 0;
  }
  std::stable_sort(out.terms.begin(), out.terms.end(),
                   [&](const auto& a, const auto& b) { return rank(a) < rank(b); });
  for (std::size_t k = 1; k < out.terms.size(); ++k) {
    if (out.terms[k].place == out.terms[k - 1].place) {
      throw std::invalid_argument(geometric_name(out.terms[k].place) + ": two terms at one place");
    }
  }
  std::uint16_t instance = 0;
  for (const EffectGroup& group : effects_of(set, robot)) {
    ++instance;
    // The parameters of a table all name the one term that reads it.
    std::vector<std::size_t> done;
    for (const Parameter& parameter : group.parameters) {
      for (const std::size_t k : parameter.terms) {
        if (std::find(done.begin(), done.end(), k) != done.end()) continue;
        done.push_back(k);
        Term<double> t = set.terms[k];
        t.instance = instance;
        if (t.table != no_table) {
          Table table = set.tables[t.table];
          const auto from = set.values.begin() + table.offset;
          table.offset = static_cast<std::uint16_t>(out.values.size());
          out.values.insert(out.values.end(), from, from + table.size);
          t.table = static_cast<std::uint16_t>(out.tables.size());
          out.tables.push_back(table);
        }
        out.terms.push_back(t);
      }
    }
  }
  return out;
}

std::vector<Parameter> parameters_of(const TermSet& set, const Nominal& robot) {
  std::vector<Parameter> parameters;
  for (std::size_t k = 0; k < set.terms.size(); ++k) {
    const Term<double>& t = set.terms[k];
    if (t.effect == Effect::geometric)
      parameters.push_back({geometric_name(t.place), place_unit(t.place), {k}, {}});
  }
  for (EffectGroup& group : effects_of(set, robot)) {
    parameters.insert(parameters.end(), group.parameters.begin(), group.parameters.end());
  }
  return parameters;
}

// --- the model of the paper -----------------------------------------------------------------------------------------

std::array<bool, joint_count> takes_beta(const Nominal& robot) {
  const double parallel = std::cos(parallel_within_rad);
  std::array<bool, joint_count> beta{};
  for (std::size_t i = 0; i + 1 < joint_count; ++i) {
    // The next axis is Rot(x,alpha) Rot(y,beta) e_z, seen from this one.
    beta[i] = std::abs(std::cos(robot.links[i].alpha_rad) * std::cos(robot.links[i].beta_rad)) > parallel;
  }
  return beta;
}

bool gravity_is_axial(const Nominal& robot) {
  return robot.gravity_m_s2[0] == 0 && robot.gravity_m_s2[1] == 0;
}

ParametricModel paper_model(const Nominal& robot, ModelKind kind, bool with_base) {
  ParametricModel model;
  const auto add = [&model](Place place) {
    model.parameters.push_back({geometric_name(place), place_unit(place), {model.set.terms.size()}, {}});
    model.set.terms.push_back(make_term(place, Basis::one, 0, Effect::geometric));
  };
  const std::array<bool, joint_count> beta = takes_beta(robot);
  for (unsigned link = 1; link <= joint_count; ++link) {
    add(link_place(link, slot::theta));
    if (!beta[link - 1]) add(link_place(link, slot::d));
    add(link_place(link, slot::a));
    add(link_place(link, slot::alpha));
    if (beta[link - 1]) add(link_place(link, slot::beta));
  }
  for (std::uint8_t s = 0; with_base && s < 6; ++s) add({body::base, s});
  EffectId id;
  if (kind == ModelKind::full || kind == ModelKind::no_gravity) {
    id.effect = Effect::joint_compliance;
    for (id.joint = 1; id.joint <= joint_count; ++id.joint) add_effect(model, id, robot);
  }
  if ((kind == ModelKind::full || kind == ModelKind::no_stiffness) && gravity_is_axial(robot)) {
    add_effect(model, EffectId{.effect = Effect::link_gravity}, robot);
  }
  return model;
}

}  // namespace flexcomp::host
