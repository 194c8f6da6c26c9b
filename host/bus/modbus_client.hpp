// SPDX-License-Identifier: Apache-2.0
/// \file
/// Modbus TCP and RTU client of a controller, by libmodbus: registers of flexcomp/wire/modbus_map.hpp.
#ifndef FLEXCOMP_HOST_BUS_MODBUS_CLIENT_HPP
#define FLEXCOMP_HOST_BUS_MODBUS_CLIENT_HPP

#include <memory>

#include "bus/controller_client.hpp"

namespace flexcomp::host {

/// Connects to a unit. \param address  holds a ModbusTcpAddress or a ModbusRtuAddress \throws BusError
std::unique_ptr<ControllerClient> connect_modbus(const BusAddress& address, const ClientOptions& options);

}  // namespace flexcomp::host

#endif
