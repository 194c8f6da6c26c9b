#include "../firmware/include/store.hpp"
