// SPDX-License-Identifier: Apache-2.0
#include "ports.hpp"

#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <termios.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <map>
#include <thread>

#include "errors.hpp"

namespace flexcomp::hil {

namespace {

std::string reason() { return std::strerror(errno); }

/// Silence that brings a line back in step. Longer than that of Modbus over Serial Line V1.02, 2.5.1.1, because a process
/// receives bytes in bursts; much shorter than a client's response time-out.
constexpr std::uint32_t rtu_gap_us = 50'000;

/// Silence between two frames, V1.02, 2.5.1.1: 3.5 characters of 11 bits, at least 1.75 ms.
std::uint32_t silence_us(std::uint32_t baud) { return baud > 19200 ? 1750 : 38'500'000 / baud; }

constexpr std::size_t most_unsent_bytes = 65536;

/// Within this time a client that was answered does not give way to a new one.
constexpr std::uint32_t in_use_ms = 2000;

/// A connection that is ended waits so long for its client.
constexpr std::uint32_t ending_ms = 1000;

/// A client that is gone without a word (power, cable) is noticed within 25 s.
void keep_alive(int socket) {
  const auto set = [socket](int level, int option, int value) {
    ::setsockopt(socket, level, option, &value, sizeof value);
  };
  set(SOL_SOCKET, SO_KEEPALIVE, 1);
  set(IPPROTO_TCP, TCP_KEEPIDLE, 10);
  set(IPPROTO_TCP, TCP_KEEPINTVL, 5);
  set(IPPROTO_TCP, TCP_KEEPCNT, 3);
  set(IPPROTO_TCP, TCP_USER_TIMEOUT, 25'000);
}

}  // namespace

std::uint32_t now_ms() {
  using namespace std::chrono;  // NOLINT(google-build-using-namespace)
  return static_cast<std::uint32_t>(
      duration_cast<milliseconds>(steady_clock::now().time_since_epoch()).count());
}

std::uint32_t now_us() {
  using namespace std::chrono;  // NOLINT(google-build-using-namespace)
  return static_cast<std::uint32_t>(
      duration_cast<microseconds>(steady_clock::now().time_since_epoch()).count());
}

// --- CAN ----------------------------------------------------------------------------------------------

namespace {

host::Descriptor open_can(const host::CanAddress& address) {
  const auto fail = [&address](const std::string& what) {
    throw host::BusError("can:" + address.interface, what);
  };
  host::Descriptor socket(::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW));
  if (!socket) fail("this kernel has no SocketCAN (" + reason() + "); see hil/with-vcan");
  const unsigned index = ::if_nametoindex(address.interface.c_str());
  if (index == 0) fail("no such interface");
  // Nothing until follow_channel().
  if (::setsockopt(socket.get(), SOL_CAN_RAW, CAN_RAW_FILTER, nullptr, 0) != 0) fail(reason());
  sockaddr_can bound{};
  bound.can_family = AF_CAN;
  bound.can_ifindex = static_cast<int>(index);
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&bound), sizeof bound) != 0) fail(reason());
  return socket;
}

}  // namespace

CanPort::CanPort(firmware::Device& device, firmware::Origin origin, const host::CanAddress& address,
                 std::uint16_t heartbeat_ms, const std::string& memory)
    : address_(address),
      socket_(open_can(address)),
      memory_(memory),
      node_(device, origin, {address.node, heartbeat_ms, 2000}, {this, send}) {
  if (address.own_request != 0 && !node_.set_channel(address.own_request, address.own_answer))
    throw host::BusError(text(), "the node itself uses one of these COB-IDs");
  node_.set_memory(memory_.hooks());
  follow_channel();
}

/// Only 11-bit data frames with the identifiers of this node; others stay in the kernel.
void CanPort::follow_channel() {
  const std::uint32_t channel = node_.channel_request();
  if (channel == filtered_) return;
  constexpr canid_t mask = CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG;
  const std::array<can_filter, 3> filters{
      {{wire::canopen::nmt_id, mask},
       {static_cast<canid_t>(wire::canopen::sdo_request_id + address_.node), mask},
       {channel & CAN_SFF_MASK, mask}}};
  const std::size_t used = (channel & wire::canopen::not_valid) == 0 ? 3 : 2;
  if (::setsockopt(socket_.get(), SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(),
                   static_cast<socklen_t>(used * sizeof filters[0])) != 0) {
    throw host::BusError(text(), reason());
  }
  filtered_ = channel;
}

void CanPort::wait_on(std::vector<pollfd>& descriptors) const {
  // A socket whose interface is down reports an error permanently; serve() retries in each call.
  if (!down_) descriptors.push_back({socket_.get(), POLLIN, 0});
}

void CanPort::serve() {
  for (int k = 0; k < 256; ++k) {
    can_frame frame{};
    const ssize_t n = ::read(socket_.get(), &frame, sizeof frame);
    if (n < 0 && errno != EAGAIN && errno != EINTR) {
      if (!down_) std::fprintf(stderr, "flexcomp-controller: %s: %s\n", text().c_str(), std::strerror(errno));
      down_ = true;
      break;
    }
    if (n < 0) {
      down_ = false;
      break;
    }
    if (n != static_cast<ssize_t>(sizeof frame)) continue;
    node_.receive(static_cast<std::uint16_t>(frame.can_id & CAN_SFF_MASK), frame.data,
                  frame.can_dlc <= 8 ? frame.can_dlc : 8U);
  }
  node_.poll(now_ms());
  follow_channel();
}

bool CanPort::send(void* self, std::uint16_t id, const std::uint8_t* bytes, std::uint8_t size) {
  can_frame frame{};
  frame.can_id = id;
  frame.can_dlc = size;
  std::memcpy(frame.data, bytes, size);
  return ::write(static_cast<CanPort*>(self)->socket_.get(), &frame, sizeof frame) ==
         static_cast<ssize_t>(sizeof frame);
}

std::string CanPort::text() const { return host::BusAddress{address_}.text(); }

// --- Modbus TCP ---------------------------------------------------------------------------------------

TcpPort::TcpPort(firmware::Device& device, firmware::Origin first_origin,
                 const host::ModbusTcpAddress& address, std::uint32_t idle_ms)
    : address_(address), idle_ms_(idle_ms) {
  const auto fail = [&address](const std::string& what) {
    throw host::BusError("modbus-tcp:" + address.host + ":" + std::to_string(address.port), what);
  };
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE;
  addrinfo* found = nullptr;
  const int r = ::getaddrinfo(address.host.c_str(), std::to_string(address.port).c_str(), &hints, &found);
  if (r != 0) fail(::gai_strerror(r));
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> list(found, ::freeaddrinfo);
  std::string why = "no address";
  for (const addrinfo* a = found; a != nullptr && !listener_; a = a->ai_next) {
    host::Descriptor s(::socket(a->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    const int on = 1;
    if (s && ::setsockopt(s.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) == 0 &&
        ::bind(s.get(), a->ai_addr, a->ai_addrlen) == 0 && ::listen(s.get(), SOMAXCONN) == 0) {
      listener_ = std::move(s);
    } else {
      why = reason();
    }
  }
  if (!listener_) fail(why);
  sockaddr_storage bound{};
  socklen_t size = sizeof bound;
  if (::getsockname(listener_.get(), reinterpret_cast<sockaddr*>(&bound), &size) == 0) {
    const std::uint16_t port = bound.ss_family == AF_INET6
                                   ? reinterpret_cast<sockaddr_in6*>(&bound)->sin6_port
                                   : reinterpret_cast<sockaddr_in*>(&bound)->sin_port;
    address_.port = ntohs(port);
  }
  for (std::size_t k = 0; k < connections; ++k) {
    connections_.push_back(
        std::make_unique<Connection>(device, static_cast<firmware::Origin>(first_origin + k)));
  }
}

void TcpPort::wait_on(std::vector<pollfd>& descriptors) const {
  descriptors.push_back({listener_.get(), POLLIN, 0});
  for (const auto& c : connections_) {
    if (!c->socket) continue;
    const int read = c->out.size() < most_unsent_bytes && !c->is_finished ? POLLIN : 0;
    const int write = c->out.empty() ? 0 : POLLOUT;
    descriptors.push_back({c->socket.get(), static_cast<short>(read | write), 0});
  }
}

TcpPort::Address TcpPort::address_of(int socket) {
  Address out{};
  sockaddr_storage peer{};
  socklen_t size = sizeof peer;
  if (::getpeername(socket, reinterpret_cast<sockaddr*>(&peer), &size) != 0) return out;
  if (peer.ss_family == AF_INET6) {
    std::memcpy(out.data(), &reinterpret_cast<sockaddr_in6*>(&peer)->sin6_addr, 16);
  } else {
    std::memcpy(out.data(), &reinterpret_cast<sockaddr_in*>(&peer)->sin_addr, 4);
  }
  return out;
}

std::size_t TcpPort::connections_of(const Address& client) const {
  return static_cast<std::size_t>(
      std::count_if(connections_.begin(), connections_.end(),
                    [&client](const auto& c) { return c->socket && c->client == client; }));
}

/// A free connection. Else one of the address that has most, where the new client's has fewer by more than one; else one
/// that was neither answered nor, by another address, opened lately. Of these the one silent longest, first among those
/// that were never answered; or none. So neither a storm of connections nor one that asks once and stays ends a client
/// that is being served, and nobody keeps out other addresses.
TcpPort::Connection* TcpPort::place_for_new(const Address& client) {
  const std::uint32_t now = now_ms();
  std::size_t most = 0;
  for (const auto& c : connections_) {
    if (!c->socket) return c.get();
    most = std::max(most, connections_of(c->client));
  }
  const bool is_owed_one = connections_of(client) + 1 < most;
  Connection* place = nullptr;
  for (const auto& c : connections_) {
    const std::uint32_t idle = now - c->used_ms;
    const bool is_in_use = idle < in_use_ms && (c->answered || c->client != client);
    if (is_owed_one ? connections_of(c->client) != most : is_in_use) continue;
    if (place == nullptr || (place->answered && !c->answered) ||
        (place->answered == c->answered && idle > now - place->used_ms)) {
      place = c.get();
    }
  }
  return place;
}

void TcpPort::accept() {
  // As many as there are places: then the others are served again.
  for (std::size_t k = 0; k < connections; ++k) {
    host::Descriptor s(::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!s) return;
    const Address client = address_of(s.get());
    Connection* place = place_for_new(client);
    if (place == nullptr) continue;  // closed at once: all are in use
    const int on = 1;
    ::setsockopt(s.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    keep_alive(s.get());
    close(*place);
    place->socket = std::move(s);
    place->client = client;
    place->used_ms = now_ms();
    place->stream =
        std::make_unique<firmware::ModbusTcp>(place->server, address_.unit, firmware::Transmit{place, send});
    // Its request is there already, mostly; then it is a client that was answered.
    serve(*place);
  }
}

void TcpPort::close(Connection& c) {
  if (!c.socket) return;
  c.server.disconnect();
  c.socket.close();
  c.out.clear();
  c.stream.reset();
  c.answered = c.ending = c.is_finished = c.is_shut = false;
}

/// Closes a connection when all that was answered has been sent: a socket that is closed before throws it away.
void TcpPort::end(Connection& c, bool is_finished) {
  if (!c.ending) c.ended_ms = now_ms();
  c.ending = true;
  c.is_finished = is_finished;
}

void TcpPort::send(void* connection, const std::uint8_t* bytes, std::size_t size) {
  Connection& c = *static_cast<Connection*>(connection);
  c.out.insert(c.out.end(), bytes, bytes + size);
  c.answered = true;
  c.used_ms = now_ms();
}

bool TcpPort::flush(Connection& c) {
  std::size_t sent = 0;
  while (sent < c.out.size()) {
    const ssize_t n = ::send(c.socket.get(), c.out.data() + sent, c.out.size() - sent, MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0 && errno != EAGAIN && errno != EWOULDBLOCK) return false;
    if (n <= 0) break;
    sent += static_cast<std::size_t>(n);
  }
  c.out.erase(c.out.begin(), c.out.begin() + static_cast<std::ptrdiff_t>(sent));
  return true;
}

void TcpPort::serve(Connection& c) {
  // One longest frame in a turn: a client that sends many requests at once does not hold up the others. Requests of a
  // client that does not read its answers stay in the socket.
  std::array<std::uint8_t, wire::modbus::tcp_bytes> in;
  if (c.out.size() < most_unsent_bytes && !c.is_finished) {
    const ssize_t n = ::recv(c.socket.get(), in.data(), in.size(), 0);
    if (n == 0) {
      end(c, true);  // or only of what the client sends: a request before that is answered
    } else if (n < 0 && errno != EINTR && errno != EAGAIN && errno != EWOULDBLOCK) {
      close(c);
      return;
    } else if (n > 0 && !c.ending && !c.stream->receive(in.data(), static_cast<std::size_t>(n))) {
      end(c, false);
    }
  }
  bool is_over = !flush(c);
  if (c.ending) {
    if (c.out.empty() && !c.is_shut) {
      ::shutdown(c.socket.get(), SHUT_WR);
      c.is_shut = true;
    }
    is_over = is_over || (c.is_shut && c.is_finished) || now_ms() - c.ended_ms >= ending_ms;
  } else {
    is_over = is_over || (idle_ms_ != 0 && now_ms() - c.used_ms >= idle_ms_);
  }
  if (is_over) close(c);
}

void TcpPort::serve() {
  for (std::size_t k = 0; k < connections; ++k) {
    Connection& c = *connections_[(first_ + k) % connections];
    if (c.socket) serve(c);
  }
  first_ = (first_ + 1) % connections;
  accept();
}

std::string TcpPort::text() const { return host::BusAddress{address_}.text(); }

// --- Modbus RTU ---------------------------------------------------------------------------------------

namespace {

speed_t speed(std::uint32_t baud) {
  static const std::map<std::uint32_t, speed_t> known = {
      {1200, B1200},     {2400, B2400},     {4800, B4800},      {9600, B9600},     {19200, B19200},
      {38400, B38400},   {57600, B57600},   {115200, B115200},  {230400, B230400}, {460800, B460800},
      {500000, B500000}, {921600, B921600}, {1000000, B1000000}};
  const auto found = known.find(baud);
  return found == known.end() ? B0 : found->second;
}

}  // namespace

host::Descriptor RtuPort::open() const {
  host::Descriptor d(::open(address_.device.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  if (!d) return d;
  termios t{};
  if (::tcgetattr(d.get(), &t) != 0) return {};
  ::cfmakeraw(&t);
  t.c_cflag = static_cast<tcflag_t>(t.c_cflag & ~static_cast<tcflag_t>(CSTOPB | PARENB | PARODD | CRTSCTS));
  t.c_cflag |= CLOCAL | CREAD;
  if (address_.parity != host::Parity::none) t.c_cflag |= PARENB;
  if (address_.parity == host::Parity::none) t.c_cflag |= CSTOPB;  // V1.02, 2.5.1: a character has 11 bits
  if (address_.parity == host::Parity::odd) t.c_cflag |= PARODD;
  t.c_cc[VMIN] = 0;
  t.c_cc[VTIME] = 0;
  ::cfsetispeed(&t, speed(address_.baud));
  ::cfsetospeed(&t, speed(address_.baud));
  if (::tcsetattr(d.get(), TCSANOW, &t) != 0) return {};
  ::tcflush(d.get(), TCIOFLUSH);
  return d;
}

RtuPort::RtuPort(firmware::Device& device, firmware::Origin origin, const host::ModbusRtuAddress& address)
    : address_(address), server_(device, origin), line_(server_, address.unit, rtu_gap_us, {this, send}) {
  if (speed(address.baud) == B0) throw host::BusError(text(), "a baud rate that serial devices do not have");
  device_ = open();
  if (!device_) throw host::BusError(text(), reason());
}

void RtuPort::wait_on(std::vector<pollfd>& descriptors) const {
  if (device_) descriptors.push_back({device_.get(), POLLIN, 0});
}

void RtuPort::serve() {
  if (!device_) {
    if (now_ms() - closed_ms_ < 200) return;
    closed_ms_ = now_ms();
    device_ = open();
    if (!device_) return;
  }
  std::array<std::uint8_t, 512> in;
  for (int k = 0; k < 16; ++k) {
    const ssize_t n = ::read(device_.get(), in.data(), in.size());
    if (n > 0) {
      heard_us_ = now_us();
      line_.receive(in.data(), static_cast<std::size_t>(n), now_us());
      continue;
    }
    // With VMIN 0 a silent line reads 0 bytes; a pseudo-terminal whose other end is closed, or an adapter
    // that was pulled, reads EIO.
    if (n < 0 && errno != EAGAIN && errno != EINTR) {
      device_.close();
      server_.disconnect();
      closed_ms_ = now_ms();
    }
    break;
  }
  line_.poll(now_us());
}

void RtuPort::send(void* self, const std::uint8_t* bytes, std::size_t size) {
  const RtuPort& port = *static_cast<RtuPort*>(self);
  const int fd = port.device_.get();
  const std::uint32_t silent = now_us() - port.heard_us_;
  const std::uint32_t wanted = silence_us(port.address_.baud);
  if (silent < wanted) std::this_thread::sleep_for(std::chrono::microseconds(wanted - silent));
  while (size != 0) {
    const ssize_t n = ::write(fd, bytes, size);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0 && errno == EAGAIN) {
      pollfd room{fd, POLLOUT, 0};
      if (::poll(&room, 1, 100) <= 0) return;
      continue;
    }
    if (n <= 0) return;
    bytes += n;
    size -= static_cast<std::size_t>(n);
  }
}

std::string RtuPort::text() const { return host::BusAddress{address_}.text(); }

}  // namespace flexcomp::hil
