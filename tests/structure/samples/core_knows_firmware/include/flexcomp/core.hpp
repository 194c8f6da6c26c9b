#pragma once
#include <store.hpp>
