// A weighted sum of several models, the same everywhere on the surface.

#include <algorithm>
#include <charconv>

#include <fmt/format.h>

#include "materials/adapters/weighted_bsdf.h"
#include "materials/models.h"
#include "runtime/core/numbers.h"

namespace lobe {
namespace {

class Mixture final : public WeightedBsdf {
 public:
  Mixture(const std::vector<BsdfPtr>& parts, const PartWeights& weights) : WeightedBsdf(parts), weights_(weights) {}

 private:
  PartWeights weights(const Vec2&) const override { return weights_; }

  PartWeights weights_;
};

[[noreturn]] void refuse(const std::string& message) {
  throw ParameterError("weights", message);
}

/// Numbers between commas, semicolons or blanks.
std::vector<double> parseWeights(const std::string& text) {
  constexpr std::string_view kSeparators = " \t\r\n,;";
  std::vector<double> numbers;
  for (std::size_t at = text.find_first_not_of(kSeparators); at != std::string::npos;) {
    const std::size_t end = std::min(text.find_first_of(kSeparators, at), text.size());
    const std::optional<double> number = parseReal(std::string_view(text).substr(at, end - at));
    if (!number || !(*number >= 0.0 && *number <= 1e6))
      refuse(fmt::format("\"{}\" in weights is not a number of at least 0", text.substr(at, end - at)));
    numbers.push_back(*number);
    at = text.find_first_not_of(kSeparators, end);
  }
  return numbers;
}

PartWeights readWeights(const Parameters& parameters, std::size_t parts) {
  const std::vector<double> numbers = parseWeights(parameters.text("weights", ""));
  if (numbers.size() != parts)
    refuse(
        fmt::format("mixturebsdf needs a weight for each nested bsdf, but there are {} for {}", numbers.size(), parts));
  double total = 0.0;
  for (const double number : numbers) total += number;
  if (!(total > 0.0)) refuse("the sum of weights must be positive");
  // As Mitsuba 0.6: what may add energy is scaled down, unless the file insists, as the parts may be dark enough.
  const bool scales = parameters.flag("ensure_energy_conservation", true) && total > 1.0;
  if (scales)
    parameters.warn("weights", fmt::format("the sum of weights is {:.4g}: they are scaled by {:.4g} to a sum of 1 "
                                           "(ensureEnergyConservation)",
                                           total, 1.0 / total));
  PartWeights weights{};
  std::ranges::transform(numbers, weights.begin(),
                         [&](double number) { return static_cast<float>(number / (scales ? total : 1.0)); });
  return weights;
}

}  // namespace

BsdfPtr makeMixture(const Parameters& parameters) {
  const std::vector<BsdfPtr>& parts = parameters.children();
  if (parts.empty() || parts.size() > kMaxParts)
    throw ParameterError(
        "", fmt::format("mixturebsdf needs 1 to {} nested bsdfs, but there are {}", kMaxParts, parts.size()));
  return std::make_shared<Mixture>(parts, readWeights(parameters, parts.size()));
}

}  // namespace lobe
