#include "schema/cache_checks.h"

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

namespace lobe {
namespace {

constexpr double kWeightTolerance = 1e-4;
// The determinant of a more elongated covariance is not accurate in single precision.
constexpr double kMinRelativeDeterminant = 1e-7;
// Densities of narrower components overflow in single precision.
constexpr float kMinVariance = 1e-20f;

void checkComponent(const CacheComponent& c, std::size_t index, const std::string& name) {
  if (!allFinite({c.weight, c.meanX, c.meanY, c.covXX, c.covXY, c.covYY}))
    refuseDamaged(name, fmt::format("component {} is not finite", index));
  if (c.weight < 0) refuseDamaged(name, fmt::format("component {} has the negative weight {}", index, c.weight));
  const double diagonal = static_cast<double>(c.covXX) * c.covYY;
  const double determinant = diagonal - static_cast<double>(c.covXY) * c.covXY;
  if (!(c.covXX >= kMinVariance && c.covYY >= kMinVariance && determinant > kMinRelativeDeterminant * diagonal))
    refuseDamaged(name, fmt::format("the covariance of component {} is not positive definite", index));
}

}  // namespace

void refuseDamaged(const std::string& name, std::string_view fault) {
  throw std::runtime_error(fmt::format("{}: damaged: {}", name, fault));
}

bool allFinite(std::initializer_list<float> values) {
  for (const float v : values)
    if (!std::isfinite(v)) return false;
  return true;
}

void checkComponents(std::span<const CacheComponent> components, const std::string& name) {
  for (std::size_t i = 0; i < components.size(); ++i) checkComponent(components[i], i, name);
}

bool componentsInRange(std::uint32_t first, std::uint32_t count, std::span<const CacheComponent> all) {
  return first <= all.size() && count <= all.size() - first;
}

bool weightsSumToOne(std::span<const CacheComponent> mixture) {
  double sum = 0;
  for (const CacheComponent& c : mixture) sum += c.weight;
  return std::abs(sum - 1) <= kWeightTolerance;
}

void checkBufferPlace(std::span<const std::byte> payload, const std::string& name) {
  if (payload.size() >= FLATBUFFERS_MAX_BUFFER_SIZE) refuseDamaged(name, "too large");
  if (reinterpret_cast<std::uintptr_t>(payload.data()) % 8 != 0) refuseDamaged(name, "not aligned to 8 bytes");
}

std::size_t bufferSize(std::size_t vectors, std::string_view what) {
  constexpr std::size_t kOthers = 1 << 20;  // more than the other fields take
  if (vectors >= FLATBUFFERS_MAX_BUFFER_SIZE - kOthers)
    throw std::runtime_error(fmt::format("{} are too large: a file holds less than 2 GiB", what));
  return vectors + kOthers;
}

}  // namespace lobe
