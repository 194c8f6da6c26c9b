#include "files.hpp"
#include "store.hpp"
