#pragma once
// The precompiled header of the targets that parse command lines: CLI11, besides what the other targets have
// precompiled.
#include <CLI/CLI.hpp>

#include "runtime/core/precompiled.h"
