// SPDX-License-Identifier: Apache-2.0
#include <flexcomp/forward.hpp>

#ifndef FLEXCOMP_SCALAR
#define FLEXCOMP_SCALAR double
#endif

// Some ten kilobytes: nothing for a controller's stack.
static flexcomp::Model<FLEXCOMP_SCALAR> model;

int main() {
  model.begin(flexcomp::NominalRobot<6>{});
  model.finish();
  return nominal_forward(model, {}).position.norm() > 0 ? 1 : 0;
}
