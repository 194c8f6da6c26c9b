// SPDX-License-Identifier: Apache-2.0
/// \file
/// A controller on Modbus TCP or RTU, by libmodbus (flexcomp/wire/modbus_map.hpp).
#ifndef FLEXCOMP_HOST_BUS_MODBUS_CLIENT_HPP
#define FLEXCOMP_HOST_BUS_MODBUS_CLIENT_HPP

#include <memory>

#include "bus/controller_client.hpp"

namespace flexcomp::host {

/// `address` is one of Modbus. \throws BusError
std::unique_ptr<ControllerClient> connect_modbus(const BusAddress& address, const ClientOptions& options);

}  // namespace flexcomp::host

#endif
