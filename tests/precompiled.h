#pragma once
#include <catch2/catch.hpp>

#include "runtime/core/precompiled.h"
