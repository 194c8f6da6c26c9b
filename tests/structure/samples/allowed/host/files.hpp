#pragma once
#include <flexcomp/core.hpp>
#include <vector>
