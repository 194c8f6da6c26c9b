// SPDX-License-Identifier: Apache-2.0
/// \file
/// CANopen client of a controller over SocketCAN: objects of flexcomp/wire/canopen_objects.hpp by SDO (CiA 301, 7.2.4).
#ifndef FLEXCOMP_HOST_BUS_CANOPEN_CLIENT_HPP
#define FLEXCOMP_HOST_BUS_CANOPEN_CLIENT_HPP

#include <memory>

#include "bus/controller_client.hpp"

namespace flexcomp::host {

/// Connects to a node. \param address  holds a CanAddress \throws BusError
std::unique_ptr<ControllerClient> connect_canopen(const BusAddress& address, const ClientOptions& options);

/// Connects over an open socket of struct can_frame, which the client owns and closes.
std::unique_ptr<ControllerClient> connect_canopen(const BusAddress& address, const ClientOptions& options,
                                                  int socket);

}  // namespace flexcomp::host

#endif
