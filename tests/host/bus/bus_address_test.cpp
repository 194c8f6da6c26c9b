// SPDX-License-Identifier: Apache-2.0
// How a controller is named: every form, its defaults, and what is said of a wrong one.
#include "bus/bus_address.hpp"

#include <gmock/gmock.h>

#include <stdexcept>
#include <string>

namespace flexcomp::host {
namespace {

std::string full(const char* text) { return parse_bus_address(text).text(); }

TEST(BusAddress, FillsInTheDefaultsOfTheStandards) {
  EXPECT_EQ(full("can:vcan0"), "can:vcan0:1");
  EXPECT_EQ(full("can:can1:127"), "can:can1:127");
  EXPECT_EQ(full("can:vcan0:5:own"), "can:vcan0:5:684-6B4");
  EXPECT_EQ(full("can:vcan0:48:own"), "can:vcan0:48:6AF-6DF");
  EXPECT_EQ(full("can:vcan0:127:3ff-1a0"), "can:vcan0:127:3FF-1A0");
  EXPECT_EQ(full("modbus-tcp:localhost"), "modbus-tcp:localhost:502:255");
  EXPECT_EQ(full("modbus-tcp:10.0.0.7:1502"), "modbus-tcp:10.0.0.7:1502:255");
  EXPECT_EQ(full("modbus-tcp:10.0.0.7:1502:0"), "modbus-tcp:10.0.0.7:1502:0");
  EXPECT_EQ(full("modbus-tcp:[::1]"), "modbus-tcp:[::1]:502:255");
  EXPECT_EQ(full("modbus-tcp:[fe80::2%eth0]:1502:3"), "modbus-tcp:[fe80::2%eth0]:1502:3");
  EXPECT_EQ(full("modbus-rtu:/dev/ttyS0"), "modbus-rtu:/dev/ttyS0:19200:E:1");
  EXPECT_EQ(full("modbus-rtu:/dev/ttyS0:115200"), "modbus-rtu:/dev/ttyS0:115200:E:1");
  EXPECT_EQ(full("modbus-rtu:/dev/ttyS0:115200:n"), "modbus-rtu:/dev/ttyS0:115200:N:1");
  EXPECT_EQ(full("modbus-rtu:/dev/ttyS0:115200:O:17"), "modbus-rtu:/dev/ttyS0:115200:O:17");
  EXPECT_EQ(full("modbus-rtu:/dev/ttyS0:9600:247"), "modbus-rtu:/dev/ttyS0:9600:E:247");
  EXPECT_EQ(full("modbus-rtu:/dev/ttyS0:3"), "modbus-rtu:/dev/ttyS0:19200:E:3");
}

TEST(BusAddress, LeavesTheColonsOfADeviceAlone) {
  EXPECT_EQ(full("modbus-rtu:/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0-port0:9600:N:5"),
            "modbus-rtu:/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0-port0:9600:N:5");
}

TEST(BusAddress, SaysWhatIsWrongAndWhatIsExpected) {
  const auto complaint = [](const char* text) -> std::string {
    try {
      return "accepted as " + full(text);
    } catch (const std::invalid_argument& e) {
      return e.what();
    }
  };
  EXPECT_EQ(complaint("can:vcan0:128"),
            "bus address 'can:vcan0:128': NODE is a whole number from 1 to 127, not '128'; expected "
            "can:IFACE[:NODE[:CHANNEL]]");
  using testing::HasSubstr;
  EXPECT_THAT(complaint("can:vcan0:0"), HasSubstr("NODE is a whole number from 1 to 127, not '0'"));
  EXPECT_THAT(complaint("can:vcan0:0x5"), HasSubstr("not '0x5'"));
  EXPECT_THAT(complaint("can:vcan0:5:own:7"), HasSubstr("too many fields"));
  for (const char* channel : {"6", "", "Own", "684", "684-", "-6B4", "684-684", "684-6B4-", "0x684-0x6B4",
                              "605-6B4", "684-585", "0-6B4", "684-6E0", "684-10684", "684 -6B4"}) {
    EXPECT_THAT(complaint((std::string("can:vcan0:5:") + channel).c_str()),
                HasSubstr("CHANNEL is own, or two COB-IDs"))
        << channel;
  }
  EXPECT_THAT(complaint("can:vcan0:49:own"), HasSubstr("'own' is for nodes up to 48"));
  EXPECT_THAT(complaint("can:"), HasSubstr("the interface is missing"));
  EXPECT_THAT(complaint("can:an-interface-too-long:1"), HasSubstr("at most 15 characters"));
  EXPECT_THAT(complaint("modbus-tcp:"), HasSubstr("the host is missing"));
  EXPECT_THAT(complaint("modbus-tcp:::1:502"), HasSubstr("the host is missing"));
  EXPECT_THAT(complaint("modbus-tcp:fe80::2:502"), HasSubstr("square brackets"));
  EXPECT_THAT(complaint("modbus-tcp:[::1"), HasSubstr("not closed"));
  EXPECT_THAT(complaint("modbus-tcp:h:65536"), HasSubstr("PORT is a whole number from 1 to 65535"));
  EXPECT_THAT(complaint("modbus-tcp:h:502:256"), HasSubstr("UNIT is a whole number from 0 to 255"));
  EXPECT_THAT(complaint("modbus-rtu:/dev/ttyS0:9600:X"), HasSubstr("PARITY is N, E or O, not 'X'"));
  EXPECT_THAT(complaint("modbus-rtu:/dev/ttyS0:N"), HasSubstr("PARITY stands behind a BAUD"));
  EXPECT_THAT(complaint("modbus-rtu:/dev/ttyS0:9600:E:0"), HasSubstr("UNIT is a whole number from 1 to 247"));
  EXPECT_THAT(complaint("modbus-rtu:/dev/ttyS0:299"), HasSubstr("BAUD is a whole number from 300"));
  EXPECT_THAT(complaint("modbus-rtu:"), HasSubstr("the device is missing"));
  EXPECT_THAT(complaint("canopen:vcan0"),
              HasSubstr("no such kind of bus; expected can:IFACE[:NODE[:CHANNEL]], modbus-tcp:"));
  EXPECT_THAT(complaint(""), HasSubstr("no such kind of bus"));
}

}  // namespace
}  // namespace flexcomp::host
