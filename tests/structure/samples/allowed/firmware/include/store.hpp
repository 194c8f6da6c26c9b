#pragma once
#include <flexcomp/core.hpp>
