#pragma once
// The precompiled header of all targets except the SIMD kernels, which have different flags. Parsing these headers took
// half of the build time. Sources still include the headers that they use.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Core>
#include <Eigen/Geometry>
