#include "materials/adapters/weighted_bsdf.h"

#include <algorithm>
#include <numeric>

#include "runtime/core/sampling.h"

namespace lobe {
namespace {

float sum(const PartWeights& weights) {
  return std::accumulate(weights.begin(), weights.end(), 0.0f);
}

struct Pick {
  std::size_t part;
  float fraction;  ///< probability of this part
  float choice;    ///< rescaled to be uniform in [0,1)
};

/// Chooses a part with probability proportional to its weight. nullopt: all weights are zero.
std::optional<Pick> pick(const PartWeights& weights, float choice) {
  const float total = sum(weights);
  std::optional<Pick> last;
  float before = 0.0f;
  for (std::size_t i = 0; i < kMaxParts; ++i) {
    const float fraction = weights[i] / total;
    if (!(fraction > 0.0f)) continue;
    last = Pick{i, fraction, std::clamp((choice - before) / fraction, 0.0f, kOneMinusEpsilon)};
    before += fraction;
    if (choice < before) break;
  }
  return last;
}

/// Keeps the kMaxLobes largest tints.
void keepLargest(std::vector<LobeTint>& tints) {
  constexpr auto kKept = static_cast<std::size_t>(kMaxLobes);
  if (tints.size() <= kKept) return;
  std::ranges::nth_element(tints, tints.begin() + kMaxLobes, std::ranges::greater(), &LobeTint::tint);
  tints.resize(kKept);
}

}  // namespace

WeightedBsdf::WeightedBsdf(std::vector<BsdfPtr> parts) : parts_(std::move(parts)) {
  for (const BsdfPtr& part : parts_) {
    firstLobe_.push_back(static_cast<int>(lobes_.size()));
    lobes_.insert(lobes_.end(), part->lobes().begin(), part->lobes().end());
  }
}

WeightedBsdf::Split WeightedBsdf::split(const Vec3& wo, const Vec2& uv) const {
  const PartWeights all = weights(uv);
  Split result;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    if (!(all[i] > 0.0f)) continue;
    const float delta = parts_[i]->deltaProbability(wo, uv);
    result.smooth[i] = all[i] * (1.0f - delta);
    result.delta[i] = all[i] * delta;
  }
  return result;
}

Rgb WeightedBsdf::eval(const Vec3& wo, const Vec3& wi, const Vec2& uv) const {
  const PartWeights all = weights(uv);
  Rgb value = Rgb::Zero();
  for (std::size_t i = 0; i < parts_.size(); ++i)
    if (all[i] > 0.0f) value += all[i] * parts_[i]->eval(wo, wi, uv);
  return value;
}

std::optional<BsdfSample> WeightedBsdf::sample(const Vec3& wo, const Vec2& uv, float choice, const Vec2& u) const {
  const PartWeights smooth = split(wo, uv).smooth;
  const std::optional<Pick> picked = pick(smooth, choice);
  if (!picked) return std::nullopt;
  std::optional<BsdfSample> result = parts_[picked->part]->sample(wo, uv, picked->choice, u);
  if (!result) return std::nullopt;
  result->f = eval(wo, result->wi, uv);
  result->pdf = mixedPdf(smooth, wo, result->wi, uv);
  if (!(result->pdf > 0.0f)) return std::nullopt;
  return result;
}

float WeightedBsdf::mixedPdf(const PartWeights& smooth, const Vec3& wo, const Vec3& wi, const Vec2& uv) const {
  const float total = sum(smooth);
  float density = 0.0f;
  for (std::size_t i = 0; i < parts_.size(); ++i)
    if (smooth[i] > 0.0f) density += smooth[i] / total * parts_[i]->pdf(wo, wi, uv);
  return density;
}

float WeightedBsdf::pdf(const Vec3& wo, const Vec3& wi, const Vec2& uv) const {
  return mixedPdf(split(wo, uv).smooth, wo, wi, uv);
}

std::optional<DeltaSample> WeightedBsdf::sampleDelta(const Vec3& wo, const Vec2& uv, float choice) const {
  const std::optional<Pick> picked = pick(split(wo, uv).delta, choice);
  if (!picked) return std::nullopt;
  std::optional<DeltaSample> result = parts_[picked->part]->sampleDelta(wo, uv, picked->choice);
  if (!result) return std::nullopt;
  result->weight *= weights(uv)[picked->part] / picked->fraction;
  result->probability *= picked->fraction;
  result->component = (static_cast<double>(picked->part) + result->component) / static_cast<double>(parts_.size());
  return result;
}

std::optional<DeltaTransmission> WeightedBsdf::deltaTransmission(const Vec3& wo, const Vec2& uv) const {
  const PartWeights all = weights(uv);
  std::optional<DeltaTransmission> result;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    if (!(all[i] > 0.0f)) continue;
    const std::optional<DeltaTransmission> part = parts_[i]->deltaTransmission(wo, uv);
    if (!part) {
      // A part that says nothing may pass light in another direction than the others.
      if (parts_[i]->transmits() && parts_[i]->deltaProbability(wo, uv) > 0.0f) return std::nullopt;
      continue;
    }
    if (!result) {
      result = part;
      result->weight *= all[i];
    } else if (result->straight && part->straight) {
      result->weight += all[i] * part->weight;
    } else {
      return std::nullopt;
    }
  }
  return result;
}

float WeightedBsdf::deltaProbability(const Vec3& wo, const Vec2& uv) const {
  const Split parts = split(wo, uv);
  const float smooth = sum(parts.smooth);
  const float delta = sum(parts.delta);
  if (!(smooth > 0.0f)) return delta > 0.0f ? 1.0f : 0.0f;
  return delta / (smooth + delta);
}

LobeMixture WeightedBsdf::mixture(const Vec3& wo, const Vec2& uv) const {
  const PartWeights all = weights(uv);
  LobeMixture result;
  std::vector<LobeTint> tints;
  float albedos = 0.0f;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    if (!(all[i] > 0.0f)) continue;
    const LobeMixture part = parts_[i]->mixture(wo, uv);
    for (int k = 0; k < part.glossyCount; ++k) {
      const LobeTint& glossy = part.glossy[static_cast<std::size_t>(k)];
      tints.push_back({firstLobe_[i] + glossy.lobe, all[i] * glossy.tint});
    }
    result.constant += all[i] * part.constant;
    // The sampler's delta probability approximates the fraction of the delta part in the albedo.
    const float albedo = all[i] * luminance(parts_[i]->albedo(wo, uv)) * (1.0f - parts_[i]->deltaProbability(wo, uv));
    albedos += albedo;
    result.undescribedFraction += albedo * part.undescribedFraction;
  }
  result.undescribedFraction = albedos > 0.0f ? std::min(1.0f, result.undescribedFraction / albedos) : 0.0f;
  keepLargest(tints);
  std::ranges::copy(tints, result.glossy.begin());
  result.glossyCount = static_cast<int>(tints.size());
  return result;
}

Rgb WeightedBsdf::albedo(const Vec3& wo, const Vec2& uv) const {
  const PartWeights all = weights(uv);
  Rgb result = Rgb::Zero();
  for (std::size_t i = 0; i < parts_.size(); ++i)
    if (all[i] > 0.0f) result += all[i] * parts_[i]->albedo(wo, uv);
  return result;
}

bool WeightedBsdf::transmits() const {
  return std::ranges::any_of(parts_, [](const BsdfPtr& part) { return part->transmits(); });
}

Vec3 WeightedBsdf::perturbedNormal(const Vec3& wo, const Vec2& uv, const Vec3& dpdu, const Vec3& dpdv) const {
  const PartWeights all = weights(uv);
  Vec3 normal = Vec3::Zero();
  for (std::size_t i = 0; i < parts_.size(); ++i)
    if (all[i] > 0.0f) normal += all[i] * parts_[i]->perturbedNormal(wo, uv, dpdu, dpdv);
  return normal.z() > 0.0f ? Vec3(normal.normalized()) : Vec3::UnitZ();
}

bool WeightedBsdf::mapsNormals() const {
  return std::ranges::any_of(parts_, [](const BsdfPtr& part) { return part->mapsNormals(); });
}

bool WeightedBsdf::shadowsTerminator() const {
  return std::ranges::any_of(parts_, [](const BsdfPtr& part) { return part->shadowsTerminator(); });
}

}  // namespace lobe
