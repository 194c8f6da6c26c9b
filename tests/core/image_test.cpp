// SPDX-License-Identifier: Apache-2.0
// The parameter image as an adversary would send it, and the arithmetic that it rests on.
#include <flexcomp/compensate.hpp>
#include <flexcomp/image.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "support/random_terms.hpp"

namespace {

using arms::TermSet;
using flexcomp::Basis;
using flexcomp::ImageHeader;
using flexcomp::Model;
using flexcomp::Refusal;
using flexcomp::Table;
using flexcomp::Term;
using Bytes = std::vector<std::uint8_t>;

const arms::Robot tx60l = arms::tx60l();

ImageHeader header_of(const arms::Robot& robot, std::uint32_t sequence = 7) {
  ImageHeader h;
  h.sequence = sequence;
  h.nominal_hash = flexcomp::nominal_hash(robot);
  h.name_hash = flexcomp::name_hash("arm", 3);
  return h;
}

template <class S>
Bytes encode(const TermSet<S>& set, const ImageHeader& header = header_of(tx60l)) {
  Bytes bytes(flexcomp::image_size(set.list()));
  EXPECT_EQ(flexcomp::encode_image(set.list(), header, bytes.data(), bytes.size()), bytes.size());
  return bytes;
}

void fix_crc(Bytes& bytes) {
  flexcomp::store_u32(bytes.data() + bytes.size() - 4, flexcomp::crc32(bytes.data(), bytes.size() - 4));
}

/// Memory of exactly this size, so that a sanitizer sees any byte read beyond it.
std::unique_ptr<std::uint8_t[]> exactly(const Bytes& bytes) {
  std::unique_ptr<std::uint8_t[]> exact(new std::uint8_t[bytes.size()]);
  std::copy(bytes.begin(), bytes.end(), exact.get());
  return exact;
}

Refusal check(const Bytes& bytes, const arms::Robot& robot = tx60l) {
  ImageHeader read;
  const ImageHeader expected = header_of(robot);
  return flexcomp::check_image(exactly(bytes).get(), bytes.size(), expected.nominal_hash, expected.name_hash,
                               read);
}

/// Check and build, as a controller does.
template <class S>
Refusal load(const Bytes& bytes, Model<S>& model, const arms::Robot& robot = tx60l) {
  const Refusal r = check(bytes, robot);
  if (r != Refusal::none) return r;
  return flexcomp::model_from_image(exactly(bytes).get(), bytes.size(), robot, model);
}

Refusal load(const Bytes& bytes) {
  const auto model = std::make_unique<Model<double>>();
  return load(bytes, *model);
}

Refusal load(const TermSet<double>& set) { return load(encode(set)); }

/// Reads an image back into a list.
template <class S>
struct Collector {
  TermSet<S> set;
  Refusal table(const Table& t, const std::uint8_t* values) {
    set.tables.push_back(t);
    for (std::size_t k = 0; k < t.size; ++k) set.values.push_back(flexcomp::load_scalar<S>(values + 8 * k));
    return Refusal::none;
  }
  Refusal term(const Term<S>& t) {
    set.terms.push_back(t);
    return Refusal::none;
  }
};

double any_finite(arms::Random& random) {
  for (;;) {
    const double v = flexcomp::double_of(random.bits());
    if (flexcomp::is_finite(v)) return v;
  }
}

/// Any list that the layout can represent, valid for a model or not.
TermSet<double> any_list(arms::Random& random) {
  TermSet<double> set;
  const std::size_t tables = random.below(5);
  for (std::size_t k = 0; k < tables; ++k) {
    Table t;
    t.offset = static_cast<std::uint16_t>(set.values.size());
    t.size = static_cast<std::uint16_t>(random.below(80));
    t.rows = static_cast<std::uint16_t>(random.bits());
    t.columns = static_cast<std::uint16_t>(random.bits());
    t.row_covariate = static_cast<flexcomp::Covariate>(random.below(256));
    t.column_covariate = static_cast<flexcomp::Covariate>(random.below(256));
    t.row_joint = static_cast<std::uint8_t>(random.bits());
    t.column_joint = static_cast<std::uint8_t>(random.bits());
    for (std::size_t i = 0; i < t.size; ++i) set.values.push_back(any_finite(random));
    set.tables.push_back(t);
  }
  const std::size_t terms = random.below(90);
  for (std::size_t k = 0; k < terms; ++k) {
    Term<double> t;
    t.place = {static_cast<std::uint8_t>(random.bits()), static_cast<std::uint8_t>(random.bits())};
    t.basis = static_cast<Basis>(random.below(256));
    t.joint = static_cast<std::uint8_t>(random.bits());
    t.factor = static_cast<flexcomp::Factor>(random.below(256));
    t.effect = static_cast<flexcomp::Effect>(random.below(256));
    t.instance = static_cast<std::uint16_t>(random.bits());
    t.table = static_cast<std::uint16_t>(random.bits());
    if (t.basis == Basis::link_weight) {
      t.distal_joint = static_cast<std::uint8_t>(random.bits());
    } else {
      t.argument = any_finite(random);
    }
    t.coefficient = any_finite(random);
    set.terms.push_back(t);
  }
  return set;
}

/// A set as identify makes it: Table 1 with curves, all of it pushable.
TermSet<double> usual_set() {
  arms::Random random(81);
  TermSet<double> set = arms::table1(arms::all()[0]);
  arms::add_joint_curves(set, random, 300e-6, 24);
  return set;
}

TEST(Image, RoundTripIsByteExact) {
  arms::Random random(82);
  for (int n = 0; n < 2000; ++n) {
    const TermSet<double> set = any_list(random);
    const Bytes bytes = encode(set, header_of(tx60l, static_cast<std::uint32_t>(random.bits())));
    ASSERT_EQ(check(bytes), Refusal::none);
    ImageHeader header;
    ASSERT_EQ(flexcomp::read_header(bytes.data(), bytes.size(), header), Refusal::none);
    ASSERT_EQ(header.terms, set.terms.size());
    ASSERT_EQ(header.tables, set.tables.size());
    ASSERT_EQ(header.values, set.values.size());
    Collector<double> back;
    ASSERT_EQ(flexcomp::visit_image<double>(bytes.data(), bytes.size(), back), Refusal::none);
    ASSERT_EQ(encode(back.set, header), bytes);
  }
}

TEST(Image, LayoutIsAsDocumented) {
  TermSet<double> set;
  const std::uint16_t table = set.add_curve({1, 2, 3, 4, 5, 6});
  Term<double>& t = set.add({3, 4}, Basis::curve, -2.0, 5, 0.5);
  t.table = table;
  t.factor = flexcomp::Factor::payload;
  t.effect = flexcomp::Effect::joint_curve;
  t.instance = 0x1234;
  ImageHeader h;
  h.sequence = 0xA1B2C3D4;
  for (std::size_t k = 0; k < 32; ++k) {
    h.nominal_hash[k] = static_cast<std::uint8_t>(k);
    h.name_hash[k] = static_cast<std::uint8_t>(100 + k);
  }
  const Bytes b = encode(set, h);
  ASSERT_EQ(b.size(), 96U + 4 + 8 + 48 + 4 + 28 + 4);
  EXPECT_EQ(std::memcmp(b.data(), "FLXC\x01\x00\x60\x00", 8), 0);
  EXPECT_EQ(flexcomp::load_u32(&b[8]), b.size());
  EXPECT_EQ(flexcomp::load_u32(&b[12]), 0xA1B2C3D4U);
  EXPECT_EQ(b[16], 0);
  EXPECT_EQ(b[47], 31);
  EXPECT_EQ(b[48], 100);
  EXPECT_EQ(flexcomp::load_u16(&b[80]), 1);
  EXPECT_EQ(flexcomp::load_u16(&b[82]), 1);
  EXPECT_EQ(flexcomp::load_u32(&b[84]), 6U);
  EXPECT_EQ(flexcomp::load_u64(&b[88]), 0U);
  EXPECT_EQ(flexcomp::load_u16(&b[96]), 2);   // a table …
  EXPECT_EQ(flexcomp::load_u16(&b[98]), 56);  // … of 8 + 8 · 6 bytes
  EXPECT_EQ(flexcomp::double_of(flexcomp::load_u64(&b[108])), 1.0);
  const std::size_t term = 96 + 4 + 56;
  const std::uint8_t expected[] = {1, 0, 28, 0, 3, 4, 15, 5, 3, 5, 0x34, 0x12, 0, 0, 0, 0};
  EXPECT_EQ(std::memcmp(&b[term], expected, sizeof expected), 0);
  EXPECT_EQ(flexcomp::double_of(flexcomp::load_u64(&b[term + 16])), 0.5);
  EXPECT_EQ(flexcomp::double_of(flexcomp::load_u64(&b[term + 24])), -2.0);
  EXPECT_EQ(flexcomp::load_u32(&b[b.size() - 4]), flexcomp::crc32(b.data(), b.size() - 4));
}

TEST(Image, TheModelItGivesIsTheOneThatWasSent) {
  for (const arms::Arm& arm : arms::all()) {
    arms::Random random(83);
    TermSet<double> set = arms::table1(arm);
    arms::add_joint_curves(set, random, 300e-6);
    const auto direct = std::make_unique<Model<double>>();
    const auto sent = std::make_unique<Model<double>>();
    ASSERT_EQ(direct->prepare(arm.robot, set.list()), Refusal::none);
    ASSERT_EQ(load(encode(set, header_of(arm.robot)), *sent, arm.robot), Refusal::none);
    for (int n = 0; n < 1000; ++n) {
      const auto q = random.pose(arm.robot);
      const auto context = arms::random_context(arm.robot, random);
      const auto a = flexcomp::compensate(*direct, q, context);
      const auto b = flexcomp::compensate(*sent, q, context);
      ASSERT_EQ(a.q, b.q);
      ASSERT_EQ(a.status, b.status);
    }
  }
}

TEST(Image, AModelIsPreparedAnewFromEachImage) {
  // Whatever an earlier set or a refused one has left behind must not be seen.
  const arms::Arm& arm = arms::all()[0];
  arms::Random random(84);
  const auto used = std::make_unique<Model<double>>();
  const auto fresh = std::make_unique<Model<double>>();
  TermSet<double> before = arms::everything(arm, random);
  ASSERT_EQ(used->prepare(arm.robot, before.list()), Refusal::none);
  Term<double> bad;
  bad.place = {9, 0};
  before.terms.push_back(bad);
  ASSERT_EQ(used->prepare(arm.robot, before.list()), Refusal::bad_place);
  const Bytes bytes = encode(arms::table1_geometry(arm), header_of(arm.robot));
  ASSERT_EQ(load(bytes, *used, arm.robot), Refusal::none);
  ASSERT_EQ(load(bytes, *fresh, arm.robot), Refusal::none);
  for (int n = 0; n < 100; ++n) {
    const auto q = random.pose(arm.robot);
    const auto context = arms::random_context(arm.robot, random);
    ASSERT_EQ(flexcomp::compensate(*used, q, context).q, flexcomp::compensate(*fresh, q, context).q);
  }
}

TEST(Image, EveryTruncationIsRefused) {
  const Bytes whole = encode(usual_set());
  ASSERT_EQ(check(whole), Refusal::none);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const Bytes part(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    ASSERT_EQ(check(part), Refusal::truncated) << size;
  }
  Bytes longer = whole;
  longer.push_back(0);
  EXPECT_EQ(check(longer), Refusal::bad_length);
}

TEST(Image, EveryFlippedBitIsRefused) {
  Bytes bytes = encode(usual_set());
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    const auto mask = static_cast<std::uint8_t>(1U << (bit % 8));
    bytes[bit / 8] = static_cast<std::uint8_t>(bytes[bit / 8] ^ mask);
    ASSERT_NE(check(bytes), Refusal::none) << bit;
    bytes[bit / 8] = static_cast<std::uint8_t>(bytes[bit / 8] ^ mask);
  }
}

TEST(Image, AnotherRobotOrAnotherGeometryIsRefused) {
  const Bytes bytes = encode(usual_set());
  arms::Robot longer = tx60l;
  longer.links[3].d_m += 1e-6;
  EXPECT_EQ(check(bytes, longer), Refusal::wrong_nominal);
  ImageHeader other = header_of(tx60l);
  other.name_hash = flexcomp::name_hash("Arm", 3);
  EXPECT_EQ(check(encode(usual_set(), other)), Refusal::wrong_robot);
}

TEST(Image, HeaderFieldsAreChecked) {
  const Bytes good = encode(usual_set());
  const auto with = [&](std::size_t at, std::uint8_t value) {
    Bytes b = good;
    b[at] = value;
    fix_crc(b);
    return load(b);
  };
  EXPECT_EQ(with(0, 'f'), Refusal::bad_magic);
  EXPECT_EQ(with(4, 2), Refusal::schema);
  EXPECT_EQ(with(4, 0), Refusal::schema);
  EXPECT_EQ(with(5, 1), Refusal::none) << "a minor version only adds what may be skipped";
  EXPECT_EQ(with(6, 100), Refusal::bad_length);
  EXPECT_EQ(with(80, static_cast<std::uint8_t>(good[80] + 1)), Refusal::bad_length);
  EXPECT_EQ(with(82, static_cast<std::uint8_t>(good[82] + 1)), Refusal::bad_length);
  EXPECT_EQ(with(84, static_cast<std::uint8_t>(good[84] + 1)), Refusal::bad_length);
}

/// A term that is accepted.
Term<double> good_term() {
  Term<double> t;
  t.place = {2, 0};
  t.basis = Basis::load_torque;
  t.joint = 1;
  t.coefficient = 1e-5;
  return t;
}

/// The image of that term with a change.
Bytes one_term(const std::function<void(Term<double>&)>& change) {
  TermSet<double> set;
  set.terms.push_back(good_term());
  change(set.terms.back());
  return encode(set);
}

TEST(Image, RecordsAreChecked) {
  using T = Term<double>&;
  const Bytes b = one_term([](T) {});
  ASSERT_EQ(load(b), Refusal::none);
  const auto with = [](const std::function<void(T)>& change) { return load(one_term(change)); };
  EXPECT_EQ(with([](T t) { t.basis = static_cast<Basis>(flexcomp::basis_count); }), Refusal::unknown_basis);
  EXPECT_EQ(with([](T t) { t.joint = 6; }), Refusal::bad_value);
  EXPECT_EQ(with([](T t) { t.place = {7, 0}; }), Refusal::bad_place);
  for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    EXPECT_EQ(with([=](T t) { t.coefficient = bad; }), Refusal::bad_value);
    EXPECT_EQ(with([=](T t) { t.argument = bad; }), Refusal::bad_value);
    TermSet<double> table;
    table.add_curve({0, 0, 0, bad, 0, 0});
    EXPECT_EQ(load(table), Refusal::bad_value);
  }
  // A double that no float can hold is a value out of range for a controller of floats.
  const Bytes huge = one_term([](T t) { t.coefficient = 1e39; });
  const auto single = std::make_unique<Model<float>>();
  EXPECT_EQ(load(huge, *single), Refusal::bad_value);
  EXPECT_EQ(load(huge), Refusal::none);

  // The distal joint of a lever stands in the image as a number: one that is none is refused.
  Bytes bytes = one_term([](T t) {
    t.basis = Basis::link_weight;
    t.distal_joint = 2;
  });
  EXPECT_EQ(load(bytes), Refusal::none);
  for (const double argument : {1.0, 2.5, 6.0, -1.0, 258.0}) {
    flexcomp::store_u64(bytes.data() + flexcomp::image::header_bytes + 16, flexcomp::bits_of(argument));
    fix_crc(bytes);
    EXPECT_EQ(load(bytes), Refusal::bad_value) << argument;
  }

  // What belongs to the measurement is never pushed.
  using flexcomp::Effect;
  for (const Effect e : {Effect::base_drift, Effect::readout_lag, Effect::reflector_slip})
    EXPECT_EQ(with([=](T t) { t.effect = e; }), Refusal::bad_place);
  // … also under another name: what follows a clock or a speed would move the arm without a bound per cycle.
  for (const Basis basis : {Basis::time, Basis::step, Basis::relative_speed})
    EXPECT_EQ(with([=](T t) { t.basis = basis; }), Refusal::bad_place);
  EXPECT_EQ(with([](T t) { t.place = arms::on_point(0); }), Refusal::bad_place);

  // A term of another length, a length that runs out of the image, a record of another type.
  const auto altered = [&](std::size_t at, std::uint16_t value) {
    Bytes c = b;
    flexcomp::store_u16(&c[at], value);
    fix_crc(c);
    return load(c);
  };
  EXPECT_EQ(altered(96, 3), Refusal::bad_length) << "28 bytes are no unit";
  EXPECT_EQ(altered(96, 4), Refusal::bad_length) << "28 bytes are no signature";
  EXPECT_EQ(altered(96, 5), Refusal::unknown_record);
  EXPECT_EQ(altered(96, 0), Refusal::unknown_record);
  EXPECT_EQ(altered(96, 0x8005), Refusal::bad_length) << "skipped, but the header announced a term";
  EXPECT_EQ(altered(96, 2), Refusal::bad_length) << "28 bytes are no table";
  EXPECT_EQ(altered(98, 24), Refusal::bad_length);
  EXPECT_EQ(altered(98, 27), Refusal::bad_length);
  EXPECT_EQ(altered(98, 32), Refusal::bad_length);
  EXPECT_EQ(altered(98, 0xFFFC), Refusal::bad_length);
}

TEST(Image, AnUnknownRecordIsSkippedOnlyIfItSaysSo) {
  const Bytes good = encode(usual_set());
  for (const bool optional : {false, true}) {
    Bytes b(good.begin(), good.end() - 4);
    const std::uint8_t record[] = {
        77, static_cast<std::uint8_t>(optional ? 0x80 : 0), 8, 0, 1, 2, 3, 4, 5, 6, 7, 8};
    b.insert(b.end(), std::begin(record), std::end(record));
    b.resize(b.size() + 4);
    flexcomp::store_u32(&b[8], static_cast<std::uint32_t>(b.size()));
    fix_crc(b);
    EXPECT_EQ(load(b), optional ? Refusal::none : Refusal::unknown_record);
  }
}

TEST(Image, MoreThanTheModelHoldsIsRefused) {
  using Capacity = flexcomp::DefaultCapacity;
  // Constant terms cost nothing, however many; effects count.
  TermSet<double> set;
  for (std::size_t k = 0; k < 500; ++k) set.add({1, 0}, Basis::one, 1e-6);
  for (std::size_t k = 0; k < Capacity::terms; ++k) set.add({1, 0}, Basis::joint_position, 1e-6);
  EXPECT_EQ(load(set), Refusal::none);
  set.add({1, 0}, Basis::joint_position, 1e-6);
  EXPECT_EQ(load(set), Refusal::too_many_terms);

  TermSet<double> tables;
  for (std::size_t k = 0; k < Capacity::tables; ++k) tables.add_curve(std::vector<double>(6));
  EXPECT_EQ(load(tables), Refusal::none);
  tables.add_curve(std::vector<double>(6));
  EXPECT_EQ(load(tables), Refusal::table_too_large);

  TermSet<double> values;
  for (std::size_t k = 0; k < 3; ++k) values.add_curve(std::vector<double>(256));
  EXPECT_EQ(load(values), Refusal::none);
  values.add_curve(std::vector<double>(6));
  EXPECT_EQ(load(values), Refusal::table_too_large);
}

TEST(Image, TablesAreChecked) {
  using Nodes = std::vector<double>;
  using T = Table&;
  const auto grid = [](
                        const Nodes& rows, const Nodes& columns,
                        const std::function<void(T)>& change = [](T) {}) {
    TermSet<double> set;
    set.add_grid(rows, columns, Nodes(rows.size() * columns.size()));
    change(set.tables.back());
    return load(set);
  };
  EXPECT_EQ(grid({0, 1}, {0, 1}), Refusal::none);
  EXPECT_EQ(grid({0}, {0, 1}), Refusal::bad_value);
  EXPECT_EQ(grid({0, 1}, {0}), Refusal::bad_value);
  EXPECT_EQ(grid({0, 0}, {0, 1}), Refusal::bad_value);
  EXPECT_EQ(grid({0, 1}, {0, 1, 0.5}), Refusal::bad_value);
  const std::function<void(T)> bad[] = {[](T t) { t.rows = 3; }, [](T t) { t.columns = 0xFFFF; },
                                        [](T t) { t.row_joint = 6; }, [](T t) { t.column_joint = 255; },
                                        [](T t) { t.row_covariate = static_cast<flexcomp::Covariate>(6); }};
  for (const auto& change : bad) EXPECT_EQ(grid({0, 1}, {0, 1}, change), Refusal::bad_value);
  for (const std::size_t size : {0U, 1U, 5U, 257U}) {
    TermSet<double> set;
    set.add_curve(std::vector<double>(size));
    EXPECT_EQ(load(set), Refusal::bad_value) << size;
  }
  // A curve that reads a grid, a grid that reads a curve, a table that comes only later.
  TermSet<double> set;
  set.add_curve(std::vector<double>(6));
  set.add_grid({0, 1}, {0, 1}, {0, 0, 0, 0});
  set.add({1, 0}, Basis::curve, 1.0).table = 1;
  EXPECT_EQ(load(set), Refusal::bad_value);
  set.terms[0].basis = Basis::grid;
  EXPECT_EQ(load(set), Refusal::none);
  set.terms[0].table = 0;
  EXPECT_EQ(load(set), Refusal::bad_value);
  set.terms[0].table = 2;
  EXPECT_EQ(load(set), Refusal::bad_value);
}

TEST(Image, WhatDoesNotFitIsNotWritten) {
  const TermSet<double> set = usual_set();
  const std::size_t size = flexcomp::image_size(set.list());
  Bytes out(size + 8, 0xEE);
  EXPECT_EQ(flexcomp::encode_image(set.list(), header_of(tx60l), out.data(), size - 1), 0U);
  EXPECT_EQ(std::count(out.begin(), out.end(), 0xEE), static_cast<std::ptrdiff_t>(out.size()));
  EXPECT_EQ(flexcomp::encode_image(set.list(), header_of(tx60l), out.data(), size), size);
  for (std::size_t k = size; k < out.size(); ++k) EXPECT_EQ(out[k], 0xEE);
  // A record's length has 16 bits: 8,190 values are the last that it can announce.
  for (const std::size_t values : {8190U, 8191U}) {
    TermSet<double> large;
    large.add_curve(std::vector<double>(values));
    Bytes b(flexcomp::image_size(large.list()));
    EXPECT_EQ(flexcomp::encode_image(large.list(), header_of(tx60l), b.data(), b.size()),
              values == 8190U ? b.size() : 0U);
  }
  TermSet<double> many;
  many.terms.resize(65536);
  Bytes b(flexcomp::image_size(many.list()));
  EXPECT_EQ(flexcomp::encode_image(many.list(), header_of(tx60l), b.data(), b.size()), 0U);
}

TEST(Image, AListWhoseTablesRunOutOfItsValuesIsRefused) {
  TermSet<double> set;
  set.add_curve(std::vector<double>(6));
  set.tables[0].size = 7;
  const auto model = std::make_unique<Model<double>>();
  EXPECT_EQ(model->prepare(tx60l, set.list()), Refusal::bad_value);
  Bytes b(flexcomp::image_size(set.list()));
  EXPECT_EQ(flexcomp::encode_image(set.list(), header_of(tx60l), b.data(), b.size()), 0U);
  set.tables[0].size = 6;
  set.tables[0].offset = 1;
  EXPECT_EQ(model->prepare(tx60l, set.list()), Refusal::bad_value);
  set.tables[0].offset = 0;
  EXPECT_EQ(model->prepare(tx60l, set.list()), Refusal::none);
}

/// Runs whatever was accepted: it may compensate or refuse, but never leave its bounds.
template <class S>
void run(const Model<S>& model, arms::Random& random) {
  const std::array<S, 6> q = arms::as<S>(random.pose(tx60l));
  const auto out = flexcomp::compensate(model, q, flexcomp::default_context<S>(tx60l));
  for (std::size_t i = 0; i < 6; ++i) {
    ASSERT_TRUE(out.q[i] >= model.lower(i) && out.q[i] <= model.upper(i));
    ASSERT_LE(std::abs(out.q[i] - q[i]), S(0.1) + S(8) * std::numeric_limits<S>::epsilon());
  }
}

TEST(Image, AnyBytesWithARightChecksumAreSafe) {
  // An adversary who can make a CRC: random bytes behind a right header, and good images with random damage.
  arms::Random random(85);
  const Bytes good = encode(usual_set());
  const auto model = std::make_unique<Model<double>>();
  const auto single = std::make_unique<Model<float>>();
  int accepted = 0;
  constexpr int rounds = 20000;
  for (int n = 0; n < rounds; ++n) {
    Bytes b = good;
    const std::size_t kind = random.below(4);
    if (kind == 0) {
      b.resize(100 + random.below(400));
      for (std::size_t k = 96; k < b.size(); ++k) b[k] = static_cast<std::uint8_t>(random.bits());
      flexcomp::store_u32(&b[8], static_cast<std::uint32_t>(b.size()));
    } else if (kind == 1) {
      // Right heads around random bodies, and counts to match.
      b.resize(96);
      const std::size_t terms = random.below(20);
      for (std::size_t k = 0; k < terms; ++k) {
        const std::uint8_t head[] = {1, 0, 28, 0};
        b.insert(b.end(), std::begin(head), std::end(head));
        for (int i = 0; i < 28; ++i) b.push_back(static_cast<std::uint8_t>(random.bits()));
        std::uint8_t* const body = b.data() + b.size() - 28;
        body[0] = static_cast<std::uint8_t>(random.below(8));
        body[1] = static_cast<std::uint8_t>(random.below(7));
        body[2] = static_cast<std::uint8_t>(random.below(flexcomp::basis_count));
        body[3] = static_cast<std::uint8_t>(random.below(6));
        body[4] = static_cast<std::uint8_t>(random.below(4));
        body[5] = 0;
      }
      b.resize(b.size() + 4);
      flexcomp::store_u32(&b[8], static_cast<std::uint32_t>(b.size()));
      flexcomp::store_u16(&b[80], static_cast<std::uint16_t>(terms));
      flexcomp::store_u16(&b[82], 0);
      flexcomp::store_u32(&b[84], 0);
    } else {
      for (std::size_t k = 0, flips = 1 + random.below(kind == 2 ? 1 : 8); k < flips; ++k)
        b[80 + random.below(b.size() - 80)] = static_cast<std::uint8_t>(random.bits());
    }
    fix_crc(b);
    if (load(b, *model) == Refusal::none) {
      ++accepted;
      run(*model, random);
    }
    if (load(b, *single) == Refusal::none) run(*single, random);
    if (::testing::Test::HasFatalFailure()) return;
  }
  std::printf(
      "[ measured ] %d of %d damaged images with a right checksum were accepted, and ran within bounds\n",
      accepted, rounds);
  EXPECT_GT(accepted, rounds / 20);
}

TEST(Image, AnyBytesAtAllAreSafe) {
  arms::Random random(86);
  for (int n = 0; n < 20000; ++n) {
    Bytes b(random.below(300));
    for (std::uint8_t& v : b) v = static_cast<std::uint8_t>(random.bits());
    ASSERT_NE(load(b), Refusal::none);
    // visit_image on what nobody has checked.
    if (b.size() >= 8) {
      std::memcpy(b.data(), "FLXC\x01\x00\x60\x00", 8);
      if (b.size() >= 12) flexcomp::store_u32(&b[8], static_cast<std::uint32_t>(b.size()));
    }
    Collector<double> back;
    flexcomp::visit_image<double>(exactly(b).get(), b.size(), back);
  }
}

// --- numbers ----------------------------------------------------------------------------------------------

std::uint32_t bits(float v) {
  std::uint32_t b;
  std::memcpy(&b, &v, sizeof b);
  return b;
}

/// What float_from_bits promises: nearest, ties to even, zero below the normal range, infinity above.
void expect_nearest(std::uint64_t pattern) {
  const double d = flexcomp::double_of(pattern);
  const float got = flexcomp::detail::float_from_bits(pattern);
  if (std::isnan(d)) {
    ASSERT_TRUE(std::isnan(got));
    return;
  }
  if (std::abs(d) < 0x1p-126) {
    ASSERT_EQ(bits(got), std::signbit(d) ? 0x80000000U : 0U) << d;
    return;
  }
  ASSERT_EQ(bits(got), bits(static_cast<float>(d))) << d;
}

TEST(Numbers, FloatIsTheNearestOfAnyDouble) {
  arms::Random random(87);
  for (int n = 0; n < 2000000; ++n) {
    const std::uint64_t b = random.bits();
    expect_nearest(b);
    // In and beside the range of floats, with ties and near-ties in the 29 bits that fall off.
    const std::uint64_t exponent = 1023 - 130 + b % 262;
    const std::uint64_t leading = (random.bits() & 0xFFFFFFE0000000ULL) & 0xFFFFFFFFFFFFFULL;
    const std::uint64_t off[] = {
        0, 0x10000000, 0x0FFFFFFF, 0x10000001, 0x1FFFFFFF, 1, random.bits() & 0x1FFFFFFF};
    expect_nearest((b & 0x8000000000000000ULL) | (exponent << 52U) | leading | off[random.below(7)]);
    if (::testing::Test::HasFatalFailure()) return;
  }
  for (const double d :
       {0.0, -0.0, 1.0, 3.4028234663852886e38, 3.4028235677973366e38, 3.5e38, 1e300, 0x1p-126,
        0x1.fffffep-127, 0x1p-127, 1e-300, 5e-324, 0.1, HUGE_VAL, -HUGE_VAL, std::nan("")}) {
    expect_nearest(flexcomp::bits_of(d));
  }
}

TEST(Numbers, FloatToBinary64IsExact) {
  arms::Random random(88);
  for (int n = 0; n < 1000000; ++n) {
    const auto b = static_cast<std::uint32_t>(random.bits());
    float v;
    std::memcpy(&v, &b, sizeof v);
    const double d = flexcomp::double_of(flexcomp::detail::bits_from_float(v));
    if (std::isnan(v)) {
      ASSERT_TRUE(std::isnan(d));
    } else if (std::fpclassify(v) == FP_SUBNORMAL) {
      ASSERT_EQ(flexcomp::bits_of(d), flexcomp::bits_of(std::signbit(v) ? -0.0 : 0.0));  // as documented
    } else {
      ASSERT_EQ(flexcomp::bits_of(d), flexcomp::bits_of(static_cast<double>(v)));
    }
  }
}

TEST(Numbers, AFloatControllerReadsTheNearestOfWhatWasSent) {
  arms::Random random(89);
  TermSet<double> set = usual_set();
  for (Term<double>& t : set.terms) t.coefficient = random.around(1e-3);
  const Bytes bytes = encode(set);
  Collector<float> back;
  ASSERT_EQ(flexcomp::visit_image<float>(bytes.data(), bytes.size(), back), Refusal::none);
  for (std::size_t k = 0; k < set.terms.size(); ++k) {
    ASSERT_EQ(back.set.terms[k].coefficient, static_cast<float>(set.terms[k].coefficient));
    ASSERT_EQ(back.set.terms[k].argument, static_cast<float>(set.terms[k].argument));
  }
  for (std::size_t k = 0; k < set.values.size(); ++k)
    ASSERT_EQ(back.set.values[k], static_cast<float>(set.values[k]));
  // And what it writes is read by a host of doubles as the same floats.
  Collector<double> again;
  const Bytes rough = encode(back.set);
  ASSERT_EQ(flexcomp::visit_image<double>(rough.data(), rough.size(), again), Refusal::none);
  for (std::size_t k = 0; k < set.terms.size(); ++k)
    ASSERT_EQ(again.set.terms[k].coefficient, static_cast<double>(back.set.terms[k].coefficient));
}

TEST(Numbers, Crc32) {
  const auto of = [](const std::string& s) {
    return flexcomp::crc32(reinterpret_cast<const std::uint8_t*>(s.data()), s.size());
  };
  EXPECT_EQ(of("123456789"), 0xCBF43926U);
  EXPECT_EQ(of(""), 0U);
  EXPECT_EQ(of("a"), 0xE8B7BE43U);
  EXPECT_EQ(of("The quick brown fox jumps over the lazy dog"), 0x414FA339U);
  // In pieces as in one, for every position of the cut.
  const std::string s = "The quick brown fox jumps over the lazy dog";
  const auto* p = reinterpret_cast<const std::uint8_t*>(s.data());
  for (std::size_t cut = 0; cut <= s.size(); ++cut)
    EXPECT_EQ(flexcomp::crc32(p + cut, s.size() - cut, flexcomp::crc32(p, cut)), 0x414FA339U);
}

std::string hex(const flexcomp::Sha256Digest& d) {
  std::string s;
  for (const std::uint8_t b : d) {
    const char* digits = "0123456789abcdef";
    s += digits[b >> 4U];
    s += digits[b & 15U];
  }
  return s;
}

std::string sha256(const std::string& s) { return hex(flexcomp::name_hash(s.data(), s.size())); }

TEST(Numbers, Sha256VectorsOfFips180) {
  EXPECT_EQ(sha256(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(
      sha256(
          "abcdefghbcdefghicdefghijdefghijkefghijklfghijklmghijklmnhijklmnoijklmnopjklmnopqklmnopqrlmnopqrs"
          "mnopqrstnopqrstu"),
      "cf5b16a778af8380036ce59e7b0492370b249b11e8f07a51afac45037afee9d1");
  EXPECT_EQ(sha256(std::string(1000000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Numbers, NominalHashKnowsTheGeometryAndNothingElse) {
  const flexcomp::Sha256Digest hash = flexcomp::nominal_hash(tx60l);
  arms::Robot other = tx60l;
  for (flexcomp::JointLimits& l : other.limits) l = arms::limits(-1, 1);
  other.gravity_m_s2 = {9.8, 0, 0};
  other.tool_xyz_m = {1, 2, 3};
  other.tool_wxyz = {0, 1, 0, 0};
  other.payload_kg = 99;
  other.payload_com_m = {1, 1, 1};
  other.reference_temperature_c = 0;
  other.name_hash = flexcomp::name_hash("x", 1);
  EXPECT_EQ(flexcomp::nominal_hash(other), hash);

  for (std::size_t i = 0; i < 6; ++i) {
    double flexcomp::NominalLink::*const members[] = {
        &flexcomp::NominalLink::theta_rad, &flexcomp::NominalLink::d_m, &flexcomp::NominalLink::a_m,
        &flexcomp::NominalLink::alpha_rad, &flexcomp::NominalLink::beta_rad};
    for (double flexcomp::NominalLink::*const member : members) {
      arms::Robot changed = tx60l;
      double& v = changed.links[i].*member;
      v = std::nextafter(v, 10.0);
      EXPECT_NE(flexcomp::nominal_hash(changed), hash) << "link " << i;
      if (tx60l.links[i].*member == 0) {
        v = -0.0;
        EXPECT_EQ(flexcomp::nominal_hash(changed), hash) << "negative zero is zero";
      }
    }
  }
  arms::Robot swapped = tx60l;
  std::swap(swapped.links[4], swapped.links[0]);
  EXPECT_NE(flexcomp::nominal_hash(swapped), hash);
}

TEST(Numbers, NominalHashIsTheDocumentedBytes) {
  const arms::Robot robot = arms::ur10();
  std::string bytes("flexcomp-nominal-1");
  bytes += '\0';
  bytes += '\x06';
  for (const flexcomp::NominalLink& l : robot.links) {
    for (const double v : {l.theta_rad, l.d_m, l.a_m, l.alpha_rad, l.beta_rad}) {
      std::uint64_t b;
      std::memcpy(&b, &v, sizeof b);
      for (int k = 0; k < 8; ++k) bytes += static_cast<char>(b >> (8 * k) & 0xFFU);
    }
  }
  EXPECT_EQ(flexcomp::nominal_hash(robot), flexcomp::name_hash(bytes.data(), bytes.size()));
}

}  // namespace
