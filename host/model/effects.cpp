// SPDX-License-Identifier: Apache-2.0
#include "model/effects.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <stdexcept>
#include <utility>

#include "model/covariate.hpp"
#include "model/place.hpp"

namespace flexcomp::host {

namespace {

/// Everything of a term but its coefficient, table and instance.
bool same_kind(const Term<double>& a, const Term<double>& b) {
  return a.place == b.place && a.basis == b.basis && a.joint == b.joint && a.factor == b.factor &&
         a.effect == b.effect && a.argument == b.argument && a.distal_joint == b.distal_joint;
}

bool in_range(unsigned joint) { return joint >= 1 && joint <= joint_count; }

}  // namespace

// --- names ------------------------------------------------------------------------------------------------------

std::string effect_name(Effect effect) { return std::string(descriptor(effect).name); }

std::optional<Effect> effect_of(std::string_view name) {
  for (const EffectDescriptor& d : all_effects()) {
    if (d.name == name) return d.effect;
  }
  return {};
}

const std::vector<std::string>& effect_names() {
  static const std::vector<std::string> names = [] {
    std::map<Effect, std::string> by_number;
    for (const EffectDescriptor& d : all_effects()) by_number.emplace(d.effect, d.name);
    std::vector<std::string> all;
    for (const auto& entry : by_number) all.push_back(entry.second);
    return all;
  }();
  return names;
}

std::string name(const EffectId& id) {
  std::vector<std::string> parts;
  for (const Selector s : descriptor(id.effect).selectors) {
    switch (s) {
      case Selector::joint:
        parts.push_back(fmt::format("joint={}", id.joint));
        break;
      case Selector::order:
        parts.push_back("order=" + format_si(id.order, unit::si));
        break;
      case Selector::from:
        parts.push_back(fmt::format("from={}", id.from));
        break;
      case Selector::link:
        if (id.link != 0) parts.push_back(fmt::format("link={}", id.link));
        break;
      case Selector::factor:
        if (id.factor != Factor::one) parts.push_back("factor=" + factor_name(id.factor));
        break;
      case Selector::after:
        parts.push_back("after=" + format_si(id.after_s, unit::si));
        break;
      case Selector::place:
        parts.push_back("place=" + place_name(id.place));
        break;
      case Selector::grid:
        parts.push_back(fmt::format("of={}+{}", covariate_name(id.covariate[0], id.covariate_joint[0]),
                                    covariate_name(id.covariate[1], id.covariate_joint[1])));
        break;
      case Selector::pivot:
      case Selector::size:
        break;
    }
  }
  const std::string plain = effect_name(id.effect);
  return parts.empty() ? plain : fmt::format("{}[{}]", plain, fmt::join(parts, ","));
}

bool same_name(const EffectId& a, const EffectId& b) {
  return a.effect == b.effect && a.joint == b.joint && a.from == b.from && a.link == b.link &&
         a.order == b.order && a.place == b.place;
}

// --- terms --------------------------------------------------------------------------------------------------------

std::optional<std::string> validation_error(const EffectId& id, const Nominal& robot) {
  const EffectDescriptor& d = descriptor(id.effect);
  if (d.keys == nullptr) return "an effect of the catalogue";
  if (d.has(Selector::from) && !(in_range(id.joint) && in_range(id.from)))
    return "joint and from, each from 1 to 6";
  if (d.has(Selector::joint) && !in_range(id.joint)) return "a joint from 1 to 6";
  const bool all_links = d.all_links_by_default && id.link == 0;
  if (d.has(Selector::link) && !all_links && !in_range(id.link)) return "a link from 1 to 6";
  return d.rule == nullptr ? std::nullopt : d.rule(id, robot);
}

std::vector<EffectKey> keys(const EffectId& id, const Nominal& robot) {
  if (const auto wrong = validation_error(id, robot)) {
    throw std::invalid_argument(fmt::format("{}: expected {}", name(id), *wrong));
  }
  return descriptor(id.effect).keys(id, robot);
}

std::uint16_t next_instance(const TermSet& set) {
  std::uint16_t highest = 0;
  for (const Term<double>& t : set.terms) highest = std::max(highest, t.instance);
  return static_cast<std::uint16_t>(highest + 1);
}

namespace {

/// Appends the table of a curve or grid with values zero; returns its index. Offsets are 16 bits wide.
std::uint16_t add_table(TermSet& set, const EffectId& id) {
  const bool curve = descriptor(id.effect).table == TableKind::curve;
  const std::size_t rows = id.node[0].size();
  const std::size_t columns = id.node[1].size();
  const std::size_t size = curve ? id.coefficients : rows + columns + rows * columns;
  if (set.values.size() + size > 0xFFFF)
    throw std::invalid_argument("expected at most 65535 values in all tables");
  Table table;
  table.offset = static_cast<std::uint16_t>(set.values.size());
  table.size = static_cast<std::uint16_t>(size);
  if (!curve) {
    table.rows = static_cast<std::uint16_t>(rows);
    table.columns = static_cast<std::uint16_t>(columns);
    table.row_covariate = id.covariate[0];
    table.column_covariate = id.covariate[1];
    table.row_joint = static_cast<std::uint8_t>(std::max(1U, id.covariate_joint[0]) - 1);
    table.column_joint = static_cast<std::uint8_t>(std::max(1U, id.covariate_joint[1]) - 1);
    for (const std::vector<double>& side : id.node)
      set.values.insert(set.values.end(), side.begin(), side.end());
  }
  set.values.resize(table.offset + size, 0.0);
  set.tables.push_back(table);
  return static_cast<std::uint16_t>(set.tables.size() - 1);
}

/// Parameters of a key whose terms are `indices` of the set: one, or one per value of the table.
void append_parameters(std::vector<Parameter>& parameters, const TermSet& set, const EffectId& id,
                       const EffectKey& key, const std::vector<std::size_t>& indices) {
  const std::string full = fmt::format("{}.{}", name(id), key.key);
  if (descriptor(id.effect).table == TableKind::none) {
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
  const EffectDescriptor& d = descriptor(first.effect);
  EffectId id;
  id.effect = first.effect;
  const unsigned place_link = is_link(first.place) ? first.place.body : 0;
  const Table* table = nullptr;
  if (d.table != TableKind::none) {
    if (first.table >= set.tables.size()) throw std::invalid_argument("a term without its table");
    table = &set.tables[first.table];
    if ((table->rows == 0) != (d.table == TableKind::curve) ||
        table->offset + table->size > set.values.size()) {
      throw std::invalid_argument("a term with a table of another kind");
    }
  }
  for (const Selector s : d.selectors) {
    switch (s) {
      case Selector::joint:
        id.joint = place_link;
        break;
      case Selector::from:
        id.from = first.joint + 1U;
        break;
      case Selector::link:
        // Of all links where there are as many terms as all links have.
        if (!d.all_links_by_default || d.keys(id, robot).front().terms.size() != members.size())
          id.link = place_link;
        break;
      case Selector::order:
        id.order = first.argument;
        break;
      case Selector::pivot:
        id.pivot_z_m = first.argument;
        break;
      case Selector::after:
        id.after_s = first.argument;
        break;
      case Selector::factor:
        id.factor = first.factor;
        break;
      case Selector::size:
        id.coefficients = table->size;
        break;
      case Selector::place:
        id.place = first.place;
        break;
      case Selector::grid: {
        id.covariate = {table->row_covariate, table->column_covariate};
        id.covariate_joint = {is_joint_covariate(table->row_covariate) ? table->row_joint + 1U : 0U,
                              is_joint_covariate(table->column_covariate) ? table->column_joint + 1U : 0U};
        const double* v = set.values.data() + table->offset;
        id.node[0].assign(v, v + table->rows);
        id.node[1].assign(v + table->rows, v + table->rows + table->columns);
        break;
      }
    }
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

}  // namespace flexcomp::host
