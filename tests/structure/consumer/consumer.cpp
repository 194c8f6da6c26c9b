#include <flexcomp/forward.hpp>

int main() {
  flexcomp::Model<double> model;
  model.begin(flexcomp::NominalRobot<6>{});
  model.finish();
  return nominal_forward(model, {}).position.norm() > 0 ? 1 : 0;
}
