// SPDX-License-Identifier: Apache-2.0
/// \file
/// Enumerators by the name that options, JSON and stored states give them.
#pragma once

#include <map>
#include <stdexcept>
#include <string>

#include "measurement/measured_data.hpp"
#include "model/effects.hpp"
#include "model/paper_model.hpp"

namespace flexcomp::host {

template <class Value>
using NamedValues = std::map<std::string, Value>;

inline const NamedValues<ModelKind> model_kinds{{"full", ModelKind::full},
                                                {"geometric", ModelKind::geometric},
                                                {"no-gravity", ModelKind::no_gravity},
                                                {"no-stiffness", ModelKind::no_stiffness}};
inline const NamedValues<MeasurementKind> measurement_kinds{{"pose", MeasurementKind::pose},
                                                            {"position", MeasurementKind::position},
                                                            {"reflectors", MeasurementKind::reflectors}};

/// \throws std::out_of_range  a value without a name
template <class Value>
const std::string& name_in(const NamedValues<Value>& names, Value value) {
  for (const auto& [name, v] : names) {
    if (v == value) return name;
  }
  throw std::out_of_range("a value without a name");
}

}  // namespace flexcomp::host
