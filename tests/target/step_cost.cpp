// SPDX-License-Identifier: Apache-2.0
// Searches for sets whose step takes more instructions than step_instructions() (flexcomp/admission.hpp) says: every kind
// of term alone and many of it, at the bounds that admission allows, then random mixtures, each followed by a change of one
// of the costliest sets so far; ordinary, singular and stretched poses, all loads. Ends with another status than 0 where one is found. With the line of each kind come the
// figures from which the constants of flexcomp/admission.hpp are set.
#include "budget_arm.hpp"
#include "flexcomp/admission.hpp"
#include "instructions.hpp"
#include "print.hpp"

namespace {

using budget::Scalar;
using flexcomp::Basis;
using flexcomp::Covariate;
using flexcomp::boards::instructions;
using flexcomp::boards::ticks;
using Model = flexcomp::Model<Scalar, 6>;
using Term = flexcomp::Term<Scalar>;
namespace slot = flexcomp::slot;

constexpr Scalar real(float v) { return static_cast<Scalar>(v); }

alignas(8) flexcomp_memory memory;
budget::Storage storage;
Model model;
flexcomp::Admission<Scalar, 6> admission;
std::uint32_t own;  // ticks of two readings with nothing between

class Random {
 public:
  std::uint32_t below(std::uint32_t n) {
    state_ = state_ * 1664525U + 1013904223U;
    return static_cast<std::uint32_t>((static_cast<std::uint64_t>(state_) * n) >> 32U);
  }
  Scalar around(Scalar size) {
    return (static_cast<Scalar>(below(1U << 24)) * real(2.0F / (1 << 24)) - real(1)) * size;
  }

 private:
  std::uint32_t state_ = FLEXCOMP_COST_SEED;
};
Random draw;

constexpr std::size_t most_terms = 39 + 64;
constexpr std::size_t rigid_terms = 30;  // of the paper's, which come first
constexpr std::size_t table_count = 6;
/// The terms of a set; the first ones are those of the paper where `paper` was asked for.
struct Set {
  std::array<Term, most_terms> terms;
  std::size_t count = 0;
  std::array<flexcomp::Table, table_count> tables;
  std::array<Scalar, 760> values;
  std::size_t value_count = 0;

  Term& add(std::uint8_t body, std::uint8_t s, Basis basis, std::uint8_t joint, Scalar argument,
            Scalar coefficient) {
    Term& t = terms[count++];
    t = {};
    t.place = {body, s};
    t.basis = basis;
    t.joint = joint;
    t.argument = argument;
    t.coefficient = coefficient;
    return t;
  }
  void curve(std::size_t table, std::size_t size) {
    flexcomp::Table& t = tables[table];
    t = {};
    t.offset = static_cast<std::uint16_t>(value_count);
    t.size = static_cast<std::uint16_t>(size);
    for (std::size_t k = 0; k < size; ++k) values[value_count++] = draw.around(real(1));
  }
  void grid(std::size_t table, std::size_t rows, std::size_t columns, Covariate row, Covariate column) {
    flexcomp::Table& t = tables[table];
    t = {};
    t.offset = static_cast<std::uint16_t>(value_count);
    t.size = static_cast<std::uint16_t>(rows + columns + rows * columns);
    t.rows = static_cast<std::uint16_t>(rows);
    t.columns = static_cast<std::uint16_t>(columns);
    t.row_covariate = row;
    t.column_covariate = column;
    t.row_joint = static_cast<std::uint8_t>(draw.below(6));
    t.column_joint = static_cast<std::uint8_t>(draw.below(6));
    for (std::size_t k = 0; k < rows; ++k)
      values[value_count++] = real(-3) + real(6) * static_cast<Scalar>(k) / static_cast<Scalar>(rows);
    for (std::size_t k = 0; k < columns; ++k)
      values[value_count++] = real(-3) + real(6) * static_cast<Scalar>(k) / static_cast<Scalar>(columns);
    for (std::size_t k = 0; k < rows * columns; ++k) values[value_count++] = draw.around(real(1));
  }
  /// Tables 0 to 2 are curves, 3 to 5 grids; all values within 1.
  void begin(std::size_t paper) {
    count = value_count = 0;
    for (; count < paper; ++count) terms[count] = selftest::make_term<Scalar>(selftest::entries[count]);
    curve(0, 6);
    curve(1, 32);
    curve(2, 128);
    grid(3, 64, 5, Covariate::joint_position, Covariate::joint_position);
    grid(4, 8, 8, Covariate::joint_position, Covariate::payload);
    grid(5, 8, 8, Covariate::direction, Covariate::temperature);
  }
  flexcomp::TermList<Scalar> list() const {
    return {terms.data(), count, tables.data(), table_count, values.data(), value_count};
  }
};
Set set;

/// The set with the greatest share of the formula, of those on the same path with few terms or many.
struct Costliest {
  Set set;
  std::uint32_t most = 0;   ///< instructions
  std::uint32_t share = 0;  ///< of the formula, 1/10000
};
std::array<Costliest, 4> costliest;
constexpr std::size_t few_terms = 12;

/// Kinds of terms as the formula has them, and with the variants that cost most.
constexpr const char* kind_names[] = {
    "own wave",       "other wave", "own curve",  "other curve",   "own scale",         "coupling",
    "reversal",       "grid",       "torque",     "cube",          "torque curve",      "lever",
    "own compliance", "link wave",  "link curve", "link torque",   "link moment",       "base moment",
    "link lever",     "link grid",  "thermal",    "tool reversal", "link torque curve", "link scale"};
constexpr std::uint32_t kinds = sizeof kind_names / sizeof kind_names[0];

void add_kind(std::uint32_t kind, std::uint32_t n, Scalar size) {
  const std::uint8_t joint = static_cast<std::uint8_t>(n % 6);
  const std::uint8_t body = static_cast<std::uint8_t>(joint + 1);
  const std::uint8_t other =
      static_cast<std::uint8_t>((n + 1 + n / 6) % 6 == joint ? (joint + 1) % 6 : (n + 1 + n / 6) % 6);
  const std::uint16_t curve = static_cast<std::uint16_t>(draw.below(3));
  const Scalar order = static_cast<Scalar>(1 + draw.below(12));
  switch (kind) {
    case 0:
      set.add(body, slot::theta, Basis::sine, joint, order, size);
      break;
    case 1:
      set.add(body, slot::theta, Basis::cosine, other, order, size);
      break;
    case 2:
      set.add(body, slot::theta, Basis::curve, joint, real(0), size).table = curve;
      break;
    case 3:
      set.add(body, slot::theta, Basis::curve, other, real(0), size).table = curve;
      break;
    case 4:
      set.add(body, slot::theta, Basis::joint_position, joint, real(0), size * real(0.3F));
      break;
    case 5:
      set.add(body, slot::theta, Basis::joint_position, other, real(0), size * real(0.3F));
      break;
    case 6:
      set.add(body, slot::theta, Basis::direction, joint, real(0), size * real(0.05F));
      break;
    case 7:
      set.add(body, slot::theta, Basis::grid, 0, real(0), size).table = static_cast<std::uint16_t>(3 + n % 3);
      break;
    case 8:
      set.add(body, slot::theta, Basis::load_torque, other, real(0), size * real(0.1F));
      break;
    case 9:
      set.add(body, slot::theta, Basis::load_torque_cubed, joint, real(0), size * real(1e-3F));
      break;
    case 10: {
      Term& t = set.add(body, slot::theta, Basis::curve, joint, real(0), size * real(0.1F));
      t.table = curve;
      t.factor = flexcomp::Factor::load_torque;
      break;
    }
    case 11: {
      const std::uint8_t at = static_cast<std::uint8_t>(n % 3 + 1);
      set.add(body, slot::theta, Basis::link_weight, at, real(0), size).distal_joint =
          static_cast<std::uint8_t>(at + 1 + n % (5U - at));
      break;
    }
    case 12:
      set.add(body, slot::theta, Basis::load_torque, joint, real(0), size * real(0.1F));
      break;
    case 13:
      set.add(body, slot::gamma, Basis::sine, other, order, size * real(0.3F));
      break;
    case 14:
      set.add(body, slot::beta, Basis::curve, other, real(0), size * real(0.3F)).table = curve;
      break;
    case 15:
      set.add(body, slot::alpha, Basis::load_torque, other, real(0), size * real(0.03F));
      break;
    case 16:
      set.add(body, slot::alpha, Basis::load_moment_y, joint, real(0), size * real(0.03F));
      break;
    case 17:
      set.add(flexcomp::body::base, static_cast<std::uint8_t>(n % 6), Basis::base_moment_x, 0, real(-0.375F),
              size * real(0.03F));
      break;
    case 18: {
      const std::uint8_t at = static_cast<std::uint8_t>(n % 3 + 1);
      set.add(body, slot::beta, Basis::link_weight, at, real(0), size).distal_joint =
          static_cast<std::uint8_t>(at + 1 + n % (5U - at));
      break;
    }
    case 19:
      set.add(body, slot::alpha, Basis::grid, 0, real(0), size * real(0.3F)).table =
          static_cast<std::uint16_t>(3 + n % 3);
      break;
    case 20:
      set.add(body, n % 2 == 0 ? slot::a : slot::d, Basis::thermal, 0, real(0), size * real(1e-3F));
      break;
    case 21:
      set.add(flexcomp::body::tool, static_cast<std::uint8_t>(n % 6), Basis::direction, joint, real(0),
              size * real(0.02F));
      break;
    case 22: {
      Term& t = set.add(body, slot::alpha, Basis::curve, joint, real(0), size * real(0.03F));
      t.table = curve;
      t.factor = flexcomp::Factor::load_torque;
      break;
    }
    default:
      set.add(body, slot::d, Basis::joint_position, other, real(0), size * real(0.1F));
      break;
  }
}

/// The paper's first terms and, where asked for, six steep ones that keep the iteration of the deflection from its early
/// end: what every step does, and what it does only there.
void begin(std::size_t paper, bool driven) {
  set.begin(paper);
  for (std::uint8_t joint = 0; driven && joint < 6; ++joint)
    set.add(static_cast<std::uint8_t>(joint + 1), slot::theta, Basis::sine,
            static_cast<std::uint8_t>((joint + 1) % 6), real(12), real(0.02F));
}

/// Scales the terms from `first` on until admission takes them, whatever they cost.
bool make_admitted(std::size_t first, flexcomp::Certificate<Scalar>& certificate) {
  const flexcomp::NominalRobot<6> robot = selftest::tx60l();
  flexcomp::AdmissionLimits<Scalar> limits;
  limits.instructions = ~0U;
  for (int tries = 0; tries < 80; ++tries) {
    if (model.prepare(robot, set.list()) != flexcomp::Refusal::none) return false;
    std::uint32_t detail = 0;
    admission.begin(model, limits, flexcomp::default_ranges<Scalar>(robot));
    while (admission.advance(model)) {
    }
    if (admission.finish(model, certificate, detail) == flexcomp::Refusal::none) return true;
    for (std::size_t k = first; k < set.count; ++k) {
      if (set.terms[k].basis != Basis::one) set.terms[k].coefficient *= real(0.8F);
    }
  }
  return false;
}

flexcomp_arm* start() {
  const flexcomp::NominalRobot<6> robot = selftest::tx60l();
  flexcomp::ImageHeader header;
  header.sequence = 1;
  header.nominal_hash = flexcomp::nominal_hash(robot);
  header.name_hash = robot.name_hash;
  const std::size_t size = flexcomp::encode_image(set.list(), header, storage.bytes, FLEXCOMP_STAGING_BYTES);
  if (size == 0) return nullptr;
  budget::seal(storage, size);
  flexcomp_settings settings;
  flexcomp_settings_default(&settings);
  settings.admission.instructions = ~0U;
  settings.plausible_position_m = real(0.3F);
  settings.plausible_orientation_rad = real(1);
  const flexcomp_robot c = budget::c_robot();
  const flexcomp_storage hooks = {&storage, budget::read, budget::erase, budget::write};
  flexcomp_arm* arm = flexcomp_init(&memory, sizeof memory, &c, &settings, &hooks);
  return arm != nullptr && flexcomp_boot(arm) == 0 ? arm : nullptr;
}

/// A command anywhere, beside the wrist's singularity, or with the arm stretched.
void next_command(Scalar q[6], std::uint32_t kind) {
  static budget::Commands commands(1);
  commands.next(q);
  if (kind % 3 == 1) q[4] = draw.around(real(0.03F));
  if (kind % 3 == 2) q[2] = real(-1.5707963F) + draw.around(real(0.05F));
  if (kind % 6 == 5) q[4] = draw.around(real(0.03F));
}

flexcomp_context next_context(flexcomp_arm* arm, std::uint32_t kind) {
  flexcomp_context c;
  flexcomp_context_default(arm, &c);
  if (kind % 4 == 0) return c;
  c.payload_kg = real(2.2F);
  for (Scalar& x : c.payload_com_m) x = draw.around(real(0.115F));
  if (kind % 4 == 1) return c;
  for (Scalar& x : c.force_n) x = draw.around(real(57));
  c.temperature_c += draw.around(real(30));
  return c;
}

/// The most that a step takes with the present set, and what the formula says; false where it does not start.
bool most_of(std::uint32_t steps, std::uint32_t& most, std::uint32_t& bound) {
  flexcomp_arm* arm = start();
  if (arm == nullptr) return false;
  bound = flexcomp::step_instructions(model);
  most = 0;
  for (std::uint32_t k = 0; k < steps; ++k) {
    Scalar q[6];
    next_command(q, k);
    const flexcomp_context context = next_context(arm, k / 6);
    const std::uint32_t from = ticks();
    flexcomp_step(arm, q, &context, q);
    const std::uint32_t count = instructions(from + own, ticks());
    if (count > most) most = count;
  }
  return true;
}

bool exceeded = false;

void judge(const char* what, std::uint32_t terms, std::uint32_t most, std::uint32_t bound) {
  const std::uint32_t share = most * 10000U / bound;
  const bool joints_only = model.plan().size(flexcomp::detail::group::move) == 0;
  Costliest& found = costliest[(joints_only ? 0U : 2U) + (set.count > rigid_terms + few_terms ? 1U : 0U)];
  if (share > found.share) found = {set, most, share};
  if (most > bound) {
    exceeded = true;
    print("EXCEEDED by ", what, ", ", terms, " terms: ", most, " instructions, the formula says ", bound,
          "\n");
  }
}

/// Prints how many terms of each kernel the costliest sets have.
void describe() {
  constexpr const char* path[] = {"joints only, few terms", "joints only, many", "off the joints, few",
                                  "off the joints, many"};
  constexpr const char* names[flexcomp::step_cost::kernels] = {
      "compliance", "lever", "torque",   "torque curve", "wave",     "curve",
      "grid",       "plain", "own wave", "own curve",    "own plain"};
  for (std::size_t k = 0; k < costliest.size(); ++k) {
    std::array<std::uint32_t, flexcomp::step_cost::kernels> count{};
    for (std::size_t n = 0; n < costliest[k].set.count; ++n) {
      const Term& t = costliest[k].set.terms[n];
      if (t.basis != Basis::one) ++count[static_cast<std::size_t>(flexcomp::step_cost::kernel_of(t))];
    }
    print(path[k], ": ", costliest[k].most, " instructions, ", costliest[k].share,
          " of 10000 of the formula:");
    for (std::size_t n = 0; n < count.size(); ++n)
      if (count[n] != 0) print(" ", count[n], " ", names[n]);
    print("\n");
  }
}

/// Adds a term, removes one that is not constant, or scales some, up to three times.
void change() {
  for (std::uint32_t times = 1 + draw.below(3); times != 0; --times) {
    const std::uint32_t free = static_cast<std::uint32_t>(set.count - rigid_terms);
    const std::uint32_t way = draw.below(3);
    if (way == 0 && free < 60) {
      add_kind(draw.below(kinds), draw.below(60), draw.below(2) == 0 ? real(1e-5F) : real(0.05F));
    } else if (way == 1 && free > 1) {
      const std::size_t at = rigid_terms + draw.below(free);
      set.terms[at] = set.terms[--set.count];
    } else {
      const Scalar factor = real(1) + draw.around(real(0.9F));
      for (std::size_t k = rigid_terms; k < set.count; ++k)
        if (draw.below(4) == 0) set.terms[k].coefficient *= factor;
    }
  }
}

}  // namespace

int main() {
  flexcomp::boards::start_instruction_counter();
  const std::uint32_t from = ticks();
  own = ticks() - from;
  flexcomp::Certificate<Scalar> certificate;
  constexpr std::uint32_t steps = FLEXCOMP_COST_STEPS;
  for (std::uint32_t base = 0; base < 4; ++base) {
    const std::size_t paper = base % 2 == 0 ? rigid_terms : budget::paper_terms;
    const bool driven = base / 2 == 1;
    std::uint32_t alone = 0, bound = 0;
    begin(paper, driven);
    if (!make_admitted(rigid_terms, certificate) || !most_of(4 * steps, alone, bound)) return 2;
    print(paper == rigid_terms ? "rigid" : "the paper's 39 terms", driven ? ", steep" : "", ": most ", alone,
          " formula ", bound, "\n");
    judge("the paper's terms", 0, alone, bound);
    for (std::uint32_t kind = 0; kind < kinds; ++kind) {
      std::uint32_t few = 0, many = 0;
      for (const std::uint32_t n : {6U, 48U}) {
        begin(paper, driven);
        for (std::uint32_t k = 0; k < n; ++k) add_kind(kind, k, driven ? real(1e-5F) : real(0.05F));
        std::uint32_t most = 0;
        if (!make_admitted(rigid_terms, certificate) || !most_of(steps, most, bound)) return 3;
        judge(kind_names[kind], n, most, bound);
        (n == 6 ? few : many) = most;
        if (n == 48)
          print("  ", kind_names[kind], ": most with 6 ", few, ", with 48 ", many, ", formula ", bound,
                ", per term ", many > few ? (many - few) / 42U : 0U, "\n");
      }
    }
  }
  for (std::uint32_t n = 0; n < FLEXCOMP_COST_SETS; ++n) {
    const bool joints_only = n % 2 == 0;
    const bool driven = draw.below(2) == 0;
    begin(draw.below(2) == 0 ? rigid_terms : budget::paper_terms, driven);
    const std::uint32_t terms = 1 + draw.below(draw.below(2) == 0 ? 8 : 48);
    const std::uint32_t first = draw.below(kinds);
    for (std::uint32_t k = 0; k < terms; ++k) {
      const std::uint32_t kind = draw.below(2) == 0 ? first : draw.below(kinds);
      add_kind(joints_only ? kind % 13U : kind, draw.below(60), driven ? real(1e-5F) : real(0.05F));
    }
    std::uint32_t most = 0, bound = 0;
    if (!make_admitted(rigid_terms, certificate) || !most_of(steps, most, bound)) return 4;
    judge("a mixture", terms, most, bound);
    set = costliest[n % 4].set;
    change();
    if (!make_admitted(rigid_terms, certificate)) continue;
    if (!most_of(steps, most, bound)) return 5;
    judge("one of the costliest, changed", static_cast<std::uint32_t>(set.count - rigid_terms), most, bound);
  }
  describe();
  return exceeded ? 1 : 0;
}
