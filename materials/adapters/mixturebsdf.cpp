// A weighted sum of models, with weights that are constant over the surface.

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

/// Numbers separated by commas, semicolons or white space.
std::vector<double> parseWeights(const std::string& text) {
  constexpr std::string_view kSeparators = " \t\r\n,;";
  std::vector<double> numbers;
  for (std::size_t at = text.find_first_not_of(kSeparators); at != std::string::npos;) {
    const std::size_t end = std::min(text.find_first_of(kSeparators, at), text.size());
    const std::optional<double> number = parseReal(std::string_view(text).substr(at, end - at));
    if (!number || !(*number >= 0.0 && *number <= 1e6))
      refuse(fmt::format("weights contains \"{}\", which is not a number in [0, 1e6]", text.substr(at, end - at)));
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
  // As in Mitsuba 0.6, weights that sum to more than 1 are scaled down, because they may create energy. The file can
  // disable this for parts that are dark enough.
  const bool scales = parameters.flag("ensure_energy_conservation", true) && total > 1.0;
  if (scales)
    parameters.warn("weights", fmt::format("the sum of weights is {:.4g}; they are scaled by {:.4g} to a sum of 1 "
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
