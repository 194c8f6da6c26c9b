// SPDX-License-Identifier: Apache-2.0
/// \file
/// The parameter image: terms as bytes, bound to one robot; the same on every bus and in every slot of
/// storage. All numbers are little-endian, reals are binary64 in SI units.
///
///     header, 96 bytes                                  records, from byte header_bytes
///      0  "FLXC"                                         u16 type (bit 15: may be skipped if unknown)
///      4  u8  schema major, u8 schema minor              u16 length of what follows, a multiple of 4
///      6  u16 header_bytes (96)                          type 1, term, 28 bytes:
///      8  u32 total_bytes, header … CRC                     u8 body, slot, basis, joint, factor, effect
///     12  u32 sequence                                      u16 instance, u16 table, u16 0
///     16  nominal hash, 32 bytes                            f64 argument, f64 coefficient
///     48  SHA-256 of the robot's name, 32 bytes          type 2, table, 8 + 8 n bytes (curve: rows 0):
///     80  u16 terms, u16 tables                             u16 rows, u16 columns
///     84  u32 table values                                  u8 row covariate, u8 row joint,
///     88  u32 flags (0)                                     u8 column covariate, u8 column joint
///     92  u8  joints (0: six), 3 bytes 0                    f64 values (term.hpp, Table)
///                                                        tables come before terms
///     last 4 bytes:                                      type 3, unit, 32 bytes, the first record where there is one:
///         CRC-32 (IEEE 802.3) of all before                 SHA-256 of the unit's serial number
///                                                        type 4, signature, 84 bytes, the last one (signature.hpp)
///
/// The argument of a link-weight term is the number of its distal joint, from 0.
///
/// Schema 1.1 added the number of joints and the types 3 and 4; an image without them has the minor number 0 and is what
/// it was. Coupling and kinds of joints are the robot's: the nominal hash binds a set to them. What a set can do at
/// most is calculated by the controller (certificate_record.hpp) and not believed.
#ifndef FLEXCOMP_IMAGE_HPP
#define FLEXCOMP_IMAGE_HPP

#include <cstddef>
#include <cstdint>

#include "flexcomp/bytes.hpp"
#include "flexcomp/crc32.hpp"
#include "flexcomp/model.hpp"
#include "flexcomp/robot.hpp"
#include "flexcomp/status.hpp"
#include "flexcomp/term.hpp"

namespace flexcomp {

/// Constants of the layout; see the table at the top.
namespace image {
constexpr std::uint8_t schema_major = 1;      ///< of what this build writes and reads
constexpr std::uint8_t schema_minor = 1;      ///< of what this build writes, 0 where nothing of 1.1 is in it
constexpr std::size_t header_bytes = 96;      ///< size of the header
constexpr std::size_t crc_bytes = 4;          ///< size of the CRC-32 at the end
constexpr std::size_t record_head_bytes = 4;  ///< type and length of a record
constexpr std::size_t term_bytes = 28;        ///< a term record without its head
constexpr std::size_t table_head_bytes = 8;   ///< a table record before its values, without its head
constexpr std::size_t max_table_values = 8190;     ///< limit of a record's 16-bit length
constexpr std::uint16_t record_term = 1;           ///< type of a term record
constexpr std::uint16_t record_table = 2;          ///< type of a table record
constexpr std::uint16_t record_unit = 3;           ///< type of the record that binds a set to one unit
constexpr std::uint16_t record_signature = 4;      ///< type of the signature record
constexpr std::size_t unit_bytes = 32;             ///< a unit record without its head
constexpr std::size_t signature_bytes = 84;        ///< a signature record without its head
constexpr std::uint16_t optional_record = 0x8000;  ///< bit of a type: may be skipped if unknown
}  // namespace image

/// Header of an image; see the table at the top.
struct ImageHeader {
  std::uint8_t schema_major = image::schema_major;  ///< another one is refused
  std::uint8_t schema_minor = image::schema_minor;  ///< a higher one only adds
  std::uint8_t joints = 6;                          ///< of the robot
  std::uint32_t total_bytes = 0;                    ///< header … CRC
  std::uint32_t sequence = 0;                       ///< a newer set has a higher one
  Sha256Digest nominal_hash{};                      ///< of the geometry, nominal_hash()
  Sha256Digest name_hash{};                         ///< of the robot's name, name_hash()
  std::uint16_t terms = 0;                          ///< number of term records
  std::uint16_t tables = 0;                         ///< number of table records
  std::uint32_t values = 0;                         ///< sum of the tables' values
  Sha256Digest
      unit_hash{};  ///< of the serial number that the set is bound to; zeros: none. Not read by read_header()
};

/// True where a hash names something: it is not all zeros.
inline bool is_given(const Sha256Digest& hash) {
  unsigned any = 0;
  for (const std::uint8_t byte : hash) any |= byte;
  return any != 0;
}

/// Size of the image of a list, bytes; `bound`: with a unit record.
template <class S>
inline std::size_t image_size(const TermList<S>& list, bool bound = false) {
  std::size_t size = image::header_bytes + image::crc_bytes;
  if (bound) size += image::record_head_bytes + image::unit_bytes;
  for (std::size_t k = 0; k < list.table_count; ++k) {
    size += image::record_head_bytes + image::table_head_bytes +
            8 * static_cast<std::size_t>(list.tables[k].size);
  }
  return size + list.count * (image::record_head_bytes + image::term_bytes);
}

/// Writes the image of a list into `out`; returns its size, or 0 where it exceeds `capacity`, a count
/// overflows or a table exceeds the list's values. Of the header only sequence, nominal_hash, name_hash and
/// unit_hash are read.
template <class S>
inline std::size_t encode_image(const TermList<S>& list, const ImageHeader& header, std::uint8_t* out,
                                std::size_t capacity) {
  const bool is_bound = is_given(header.unit_hash);
  const std::size_t size = image_size(list, is_bound);
  if (size > capacity || list.count > 0xFFFF || list.table_count > 0xFFFF) return 0;
  for (std::size_t k = 0; k < list.table_count; ++k) {
    if (!has_values(list, list.tables[k]) || list.tables[k].size > image::max_table_values) return 0;
  }
  for (std::size_t k = 0; k < image::header_bytes; ++k) out[k] = 0;
  out[0] = 'F';
  out[1] = 'L';
  out[2] = 'X';
  out[3] = 'C';
  out[4] = image::schema_major;
  out[5] = is_bound ? image::schema_minor : 0;
  store_u16(out + 6, static_cast<std::uint16_t>(image::header_bytes));
  store_u32(out + 8, static_cast<std::uint32_t>(size));
  store_u32(out + 12, header.sequence);
  for (std::size_t k = 0; k < 32; ++k) {
    out[16 + k] = header.nominal_hash[k];
    out[48 + k] = header.name_hash[k];
  }
  store_u16(out + 80, static_cast<std::uint16_t>(list.count));
  store_u16(out + 82, static_cast<std::uint16_t>(list.table_count));
  std::uint8_t* p = out + image::header_bytes;
  if (is_bound) {
    store_u16(p, image::record_unit);
    store_u16(p + 2, static_cast<std::uint16_t>(image::unit_bytes));
    p += image::record_head_bytes;
    for (const std::uint8_t byte : header.unit_hash) *p++ = byte;
  }
  std::uint32_t values = 0;
  for (std::size_t k = 0; k < list.table_count; ++k) {
    const Table& t = list.tables[k];
    store_u16(p, image::record_table);
    store_u16(p + 2, static_cast<std::uint16_t>(image::table_head_bytes + 8U * t.size));
    store_u16(p + 4, t.rows);
    store_u16(p + 6, t.columns);
    p[8] = static_cast<std::uint8_t>(t.row_covariate);
    p[9] = t.row_joint;
    p[10] = static_cast<std::uint8_t>(t.column_covariate);
    p[11] = t.column_joint;
    p += image::record_head_bytes + image::table_head_bytes;
    for (std::size_t i = 0; i < t.size; ++i, p += 8)
      store_u64(p, to_binary64_bits(list.values[t.offset + i]));
    values += t.size;
  }
  store_u32(out + 84, values);
  for (std::size_t k = 0; k < list.count; ++k) {
    const Term<S>& t = list.terms[k];
    store_u16(p, image::record_term);
    store_u16(p + 2, static_cast<std::uint16_t>(image::term_bytes));
    p[4] = t.place.body;
    p[5] = t.place.slot;
    p[6] = static_cast<std::uint8_t>(t.basis);
    p[7] = t.joint;
    p[8] = static_cast<std::uint8_t>(t.factor);
    p[9] = static_cast<std::uint8_t>(t.effect);
    store_u16(p + 10, t.instance);
    store_u16(p + 12, t.table);
    store_u16(p + 14, 0);
    store_u64(p + 16, to_binary64_bits(t.basis == Basis::link_weight ? S(t.distal_joint) : t.argument));
    store_u64(p + 24, to_binary64_bits(t.coefficient));
    p += image::record_head_bytes + image::term_bytes;
  }
  store_u32(p, crc32(out, size - image::crc_bytes));
  return size;
}

/// Reads and checks the header alone: magic, schema, lengths against `size`. Reads nothing beyond `size`.
inline Refusal read_header(const std::uint8_t* bytes, std::size_t size, ImageHeader& header) {
  if (size < image::header_bytes + image::crc_bytes) return Refusal::truncated;
  if (bytes[0] != 'F' || bytes[1] != 'L' || bytes[2] != 'X' || bytes[3] != 'C') return Refusal::bad_magic;
  header.schema_major = bytes[4];
  header.schema_minor = bytes[5];
  if (header.schema_major != image::schema_major) return Refusal::schema;
  if (load_u16(bytes + 6) != image::header_bytes) return Refusal::bad_length;
  header.total_bytes = load_u32(bytes + 8);
  header.sequence = load_u32(bytes + 12);
  for (std::size_t k = 0; k < 32; ++k) {
    header.nominal_hash[k] = bytes[16 + k];
    header.name_hash[k] = bytes[48 + k];
  }
  header.terms = load_u16(bytes + 80);
  header.tables = load_u16(bytes + 82);
  header.values = load_u32(bytes + 84);
  header.joints = bytes[92] != 0 ? bytes[92] : std::uint8_t{6};
  if (header.total_bytes > size) return Refusal::truncated;
  if (header.total_bytes != size) return Refusal::bad_length;
  return Refusal::none;
}

/// Hash of the serial number that an image of `size` bytes, accepted by read_header(), is bound to; null where it is bound to
/// none.
inline const std::uint8_t* bound_unit(const std::uint8_t* bytes, std::size_t size) {
  const std::uint8_t* p = bytes + image::header_bytes;
  const bool is_there =
      size >= image::header_bytes + image::record_head_bytes + image::unit_bytes + image::crc_bytes &&
      load_u16(p) == image::record_unit && load_u16(p + 2) == image::unit_bytes;
  return is_there ? p + image::record_head_bytes : nullptr;
}

/// Whether an image is for the unit with this hash of its serial number (zeros: it has none), or for any.
inline Refusal check_unit(const std::uint8_t* bytes, std::size_t size, const Sha256Digest& unit_hash) {
  const std::uint8_t* bound = bound_unit(bytes, size);
  if (bound == nullptr) return Refusal::none;
  if (!is_given(unit_hash)) return Refusal::wrong_unit;
  for (std::size_t k = 0; k < image::unit_bytes; ++k) {
    if (bound[k] != unit_hash[k]) return Refusal::wrong_unit;
  }
  return Refusal::none;
}

/// What the signature record of an image of `size` bytes, accepted by read_header(), holds (signature.hpp); null where it is
/// not signed.
inline const std::uint8_t* signature_of(const std::uint8_t* bytes, std::size_t size) {
  constexpr std::size_t last = image::record_head_bytes + image::signature_bytes + image::crc_bytes;
  const std::uint8_t* p = bytes + size - last;
  const bool is_there = size >= image::header_bytes + last && load_u16(p) == image::record_signature &&
                        load_u16(p + 2) == image::signature_bytes;
  return is_there ? p + image::record_head_bytes : nullptr;
}

/// Whether an image is for this robot.
inline Refusal check_binding(const ImageHeader& header, const Sha256Digest& nominal,
                             const Sha256Digest& name) {
  if (header.name_hash != name) return Refusal::wrong_robot;
  return header.nominal_hash != nominal ? Refusal::wrong_nominal : Refusal::none;
}

/// Checks header, CRC-32 and binding to a robot, without reading the records. Work: ten instructions per
/// byte.
inline Refusal check_image(const std::uint8_t* bytes, std::size_t size, const Sha256Digest& nominal,
                           const Sha256Digest& name, ImageHeader& header) {
  const Refusal r = read_header(bytes, size, header);
  if (r != Refusal::none) return r;
  if (crc32(bytes, size - image::crc_bytes) != load_u32(bytes + size - image::crc_bytes))
    return Refusal::checksum;
  return check_binding(header, nominal, name);
}

namespace detail {

/// The distal joint (from 0) that a term's argument names; 0 where it names none.
template <class S>
inline std::uint8_t distal_joint_of(S argument) {
  if (!(argument > S(0)) || !(argument < S(256))) return 0;
  const auto joint = static_cast<std::uint8_t>(argument);
  return S(joint) < argument ? std::uint8_t{0} : joint;
}

}  // namespace detail

/// Where the reading of an image's records stands.
struct ImageCursor {
  std::size_t at = image::header_bytes;  ///< of the next record
  std::size_t terms = 0;                 ///< so far
  std::size_t tables = 0;                ///< so far
  std::size_t values = 0;                ///< of all tables so far
};

/// True where all records of an image of `size` bytes have been read.
constexpr bool at_end(const ImageCursor& cursor, std::size_t size) {
  return cursor.at + image::crc_bytes >= size;
}

/// Passes the record at the cursor, which is not at the end, to a visitor: `Refusal table(const Table&, const std::uint8_t*
/// values)` or `Refusal term(const Term<S>&)`.
template <class S, class Visitor>
inline Refusal visit_record(const std::uint8_t* bytes, std::size_t size, ImageCursor& cursor,
                            Visitor&& visitor) {
  const std::uint8_t* p = bytes + cursor.at;
  const std::size_t left = size - image::crc_bytes - cursor.at;
  if (left < image::record_head_bytes) return Refusal::bad_length;
  const std::uint16_t type = load_u16(p);
  const std::size_t length = load_u16(p + 2);
  if (length % 4 != 0 || length > left - image::record_head_bytes) return Refusal::bad_length;
  const std::uint8_t* body = p + image::record_head_bytes;
  cursor.at += image::record_head_bytes + length;
  if (type == image::record_term) {
    if (length != image::term_bytes) return Refusal::bad_length;
    Term<S> t;
    t.place = {body[0], body[1]};
    t.basis = static_cast<Basis>(body[2]);
    t.joint = body[3];
    t.factor = static_cast<Factor>(body[4]);
    t.effect = static_cast<Effect>(body[5]);
    t.instance = load_u16(body + 6);
    t.table = load_u16(body + 8);
    t.argument = load_scalar<S>(body + 12);
    t.coefficient = load_scalar<S>(body + 20);
    if (!is_finite(t.argument) || !is_finite(t.coefficient)) return Refusal::bad_value;
    if (t.basis == Basis::link_weight) {
      t.distal_joint = detail::distal_joint_of(t.argument);
      t.argument = S(0);
    }
    ++cursor.terms;
    return visitor.term(t);
  }
  if (type == image::record_table) {
    if (length < image::table_head_bytes || (length - image::table_head_bytes) % 8 != 0)
      return Refusal::bad_length;
    Table t;
    t.size = static_cast<std::uint16_t>((length - image::table_head_bytes) / 8);
    t.offset = static_cast<std::uint16_t>(cursor.values);
    t.rows = load_u16(body);
    t.columns = load_u16(body + 2);
    t.row_covariate = static_cast<Covariate>(body[4]);
    t.row_joint = body[5];
    t.column_covariate = static_cast<Covariate>(body[6]);
    t.column_joint = body[7];
    for (std::size_t k = 0; k < t.size; ++k) {
      if (!is_finite(load_scalar<S>(body + image::table_head_bytes + 8 * k))) return Refusal::bad_value;
    }
    cursor.values += t.size;
    ++cursor.tables;
    return visitor.table(t, body + image::table_head_bytes);
  }
  // Read by bound_unit() and signature_of(): here only their places are checked.
  if (type == image::record_unit) {
    return body == bytes + image::header_bytes + image::record_head_bytes && length == image::unit_bytes
               ? Refusal::none
               : Refusal::bad_length;
  }
  if (type == image::record_signature)
    return at_end(cursor, size) && length == image::signature_bytes ? Refusal::none : Refusal::bad_length;
  return (type & image::optional_record) == 0 ? Refusal::unknown_record : Refusal::none;
}

/// Whether the records that were read are as many as the header says.
inline Refusal check_counts(const ImageHeader& header, const ImageCursor& cursor) {
  return cursor.terms == header.terms && cursor.tables == header.tables && cursor.values == header.values
             ? Refusal::none
             : Refusal::bad_length;
}

/// Passes each record of a checked image to a visitor, as visit_record() does; ends at the first refusal. Work is linear in
/// the size of the image.
template <class S, class Visitor>
inline Refusal visit_image(const std::uint8_t* bytes, std::size_t size, Visitor&& visitor) {
  ImageHeader header;
  const Refusal head = read_header(bytes, size, header);
  if (head != Refusal::none) return head;
  ImageCursor cursor;
  while (!at_end(cursor, size)) {
    const Refusal r = visit_record<S>(bytes, size, cursor, visitor);
    if (r != Refusal::none) return r;
  }
  return check_counts(header, cursor);
}

/// Adds what an image holds to a model, as visit_record() finds it. Effects of the measurement (place `point`, base drift,
/// readout lag, reflector slip) are refused: they are never pushed.
template <class S, std::size_t N, class Cap>
struct ModelBuilder {
  Model<S, N, Cap>& model;  ///< after begin()
  /// Copies a table.
  Refusal table(const Table& t, const std::uint8_t* values) {
    return model.add_table_from([values](std::size_t k) { return load_scalar<S>(values + 8 * k); }, t);
  }
  /// Adds a term.
  Refusal term(const Term<S>& t) {
    // By the basis, not only by the effect: the controller's clock is not the tracker's, and a term that
    // follows it would move the arm without a bound on the change per cycle.
    if (t.place.body == body::point || t.basis == Basis::time || t.basis == Basis::step ||
        t.basis == Basis::relative_speed || belongs_to_measurement(t.effect)) {
      return Refusal::bad_place;
    }
    return model.add(t);
  }
};

/// Prepares a model from an image that check_image() accepted. On a refusal the model must not be used.
template <class S, std::size_t N, class Cap>
inline Refusal model_from_image(const std::uint8_t* bytes, std::size_t size, const NominalRobot<N>& robot,
                                Model<S, N, Cap>& model) {
  model.begin(robot);
  const Refusal r = visit_image<S>(bytes, size, ModelBuilder<S, N, Cap>{model});
  if (r == Refusal::none) model.finish();
  return r;
}

}  // namespace flexcomp

#endif
