// SPDX-License-Identifier: Apache-2.0
// Refused after the build: run-time type information.
struct Base {
  virtual int kind() const { return 0; }
};
struct Derived : Base {
  int kind() const override { return 1; }
};
int kind_of(Base* base) { return dynamic_cast<Derived*>(base) != nullptr ? base->kind() : 0; }
