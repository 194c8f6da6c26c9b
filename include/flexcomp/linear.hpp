// SPDX-License-Identifier: Apache-2.0
/// \file
/// Fixed-size vectors, rotations and poses, without heap. Eigen types for the forward model; plain scalars
/// (Vec3, Mat3) for the kernels of the control cycle.
#ifndef FLEXCOMP_LINEAR_HPP
#define FLEXCOMP_LINEAR_HPP

// A failed assertion of Eigen's is a fault of this library. On a controller it ends in the firmware's own
// fault hook, `extern "C" void FLEXCOMP_FAULT()`, which must not return; the C library's assert would print,
// and bring a heap to do so. FLEXCOMP_FAULT names the function and must be the same in every source of a
// program, as Eigen's templates are. Where it is not defined (on a host) assert() is left as it is.
#ifdef FLEXCOMP_FAULT
#ifdef EIGEN_CORE_H
#error "include flexcomp before Eigen: FLEXCOMP_FAULT must reach all of Eigen in a program"
#endif
extern "C" [[noreturn]] void FLEXCOMP_FAULT();
#define eigen_assert(condition) ((condition) ? static_cast<void>(0) : FLEXCOMP_FAULT())
#endif
#include <Eigen/Core>

#include "flexcomp/detail/compiler.hpp"

namespace flexcomp {

/// Column of 3.
template <class S>
using Vector3 = Eigen::Matrix<S, 3, 1>;
/// Column of 6: rows of position, then of orientation (M17).
template <class S>
using Vector6 = Eigen::Matrix<S, 6, 1>;
/// 3x3 matrix, here a rotation.
template <class S>
using Matrix3 = Eigen::Matrix<S, 3, 3>;

/// Rigid transform of coordinates: x_outer = rotation x_inner + position.
template <class S>
struct Pose {
  Matrix3<S> rotation = Matrix3<S>::Identity();  ///< columns: axes of the inner frame
  Vector3<S> position = Vector3<S>::Zero();      ///< origin of the inner frame, m
};

/// Cross product.
template <class S>
inline Vector3<S> cross(const Vector3<S>& a, const Vector3<S>& b) {
  return {a.y() * b.z() - a.z() * b.y(), a.z() * b.x() - a.x() * b.z(), a.x() * b.y() - a.y() * b.x()};
}

/// Dot product.
template <class S>
inline S dot(const Vector3<S>& a, const Vector3<S>& b) {
  return a.x() * b.x() + a.y() * b.y() + a.z() * b.z();
}

/// Composition of two transforms.
template <class S>
inline Pose<S> operator*(const Pose<S>& outer, const Pose<S>& inner) {
  Pose<S> r;
  for (int j = 0; j < 3; ++j) {
    r.rotation.col(j) = outer.rotation.col(0) * inner.rotation(0, j) +
                        outer.rotation.col(1) * inner.rotation(1, j) +
                        outer.rotation.col(2) * inner.rotation(2, j);
  }
  r.position = outer.position + outer.rotation.col(0) * inner.position.x() +
               outer.rotation.col(1) * inner.position.y() + outer.rotation.col(2) * inner.position.z();
  return r;
}

/// Column of 3 as plain scalars, which stay in registers where an expression template would go through
/// memory.
template <class S>
struct Vec3 {
  S x;  ///< first
  S y;  ///< second
  S z;  ///< third
};

/// Sum.
template <class S>
inline Vec3<S> operator+(const Vec3<S>& a, const Vec3<S>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
/// Difference.
template <class S>
inline Vec3<S> operator-(const Vec3<S>& a, const Vec3<S>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
/// Multiple.
template <class S>
inline Vec3<S> operator*(const Vec3<S>& a, const S& k) {
  return {a.x * k, a.y * k, a.z * k};
}
/// Cross product.
template <class S>
inline Vec3<S> cross(const Vec3<S>& a, const Vec3<S>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
/// Dot product.
template <class S>
inline S dot(const Vec3<S>& a, const Vec3<S>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
/// Plain scalars of an Eigen column.
template <class S>
inline Vec3<S> vec3(const Vector3<S>& v) {
  return {v[0], v[1], v[2]};
}

/// Rows or columns of a 3x3 matrix, as the name of the variable says.
template <class S>
struct Mat3 {
  Vec3<S> a;  ///< first
  Vec3<S> b;  ///< second
  Vec3<S> c;  ///< third
};

/// Product of a matrix, given by its columns, and a vector.
template <class S>
inline Vec3<S> combine(const Mat3<S>& columns, const Vec3<S>& v) {
  return columns.a * v.x + columns.b * v.y + columns.c * v.z;
}
/// Columns of an Eigen matrix.
template <class S>
inline Mat3<S> columns_of(const Matrix3<S>& m) {
  return {{m(0, 0), m(1, 0), m(2, 0)}, {m(0, 1), m(1, 1), m(2, 1)}, {m(0, 2), m(1, 2), m(2, 2)}};
}

}  // namespace flexcomp

#endif
