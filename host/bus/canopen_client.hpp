// SPDX-License-Identifier: Apache-2.0
/// \file
/// A controller on CANopen, through SocketCAN (flexcomp/wire/canopen_objects.hpp).
#ifndef FLEXCOMP_HOST_BUS_CANOPEN_CLIENT_HPP
#define FLEXCOMP_HOST_BUS_CANOPEN_CLIENT_HPP

#include <memory>

#include "bus/controller_client.hpp"

namespace flexcomp::host {

/// `address` is one of CAN. \throws BusError
std::unique_ptr<ControllerClient> connect_canopen(const BusAddress& address, const ClientOptions& options);

/// The same over a socket that is open already and gives and takes struct can_frame; it is closed with the client.
std::unique_ptr<ControllerClient> connect_canopen(const BusAddress& address, const ClientOptions& options,
                                                  int socket);

}  // namespace flexcomp::host

#endif
