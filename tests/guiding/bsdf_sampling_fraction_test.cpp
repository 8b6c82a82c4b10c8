// The BSDF sampling fraction learnt from paths.

#include <cmath>
#include <limits>
#include <vector>

#include <catch2/catch.hpp>

#include "runtime/core/random.h"
#include "runtime/guiding/illumination_trainer.h"

using namespace lobe;

namespace {

/// A one-dimensional stand-in for directions: on [0,1] the density of the BSDF is 1, that of the mixtures 2x.
FractionSample at(float x, float representable) {
  return {0, 1.0f, 2 * x, representable};
}

/// Uniform samples of the target a + (1−a) 2x.
std::vector<FractionSample> samplesOf(float a, float representable, int count) {
  std::vector<FractionSample> samples;
  Rng rng(3);
  for (int i = 0; i < count; ++i) {
    const float x = rng.uniform();
    samples.push_back(at(x, representable));
    samples.back().weight = a + (1 - a) * 2 * x;
  }
  return samples;
}

BsdfSamplingFraction learnt(const std::vector<FractionSample>& samples, int passes) {
  BsdfSamplingFraction fraction;
  for (int i = 0; i < passes; ++i) fraction.learn(samples);
  return fraction;
}

}  // namespace

TEST_CASE("guiding: the learnt BSDF sampling fraction is the fraction in the target") {
  for (const float a : {0.2f, 0.5f, 0.8f}) CHECK(learnt(samplesOf(a, 1, 20000), 10).bsdf() == Approx(a).margin(0.03));
  // If the mixtures can represent only 0.8, a fraction of 0.5 samples 0.5 + 0.2/2 from the BSDF and 0.4 from them.
  CHECK(learnt(samplesOf(0.6f, 0.8f, 20000), 10).bsdf() == Approx(0.5f).margin(0.04));
  CHECK(learnt(samplesOf(0, 1, 20000), 50).bsdf() == Approx(kMinBsdfFraction).margin(0.02));
  CHECK(learnt(samplesOf(1, 1, 20000), 50).bsdf() == Approx(1 - kMinBsdfFraction).margin(0.02));
}

TEST_CASE("guiding: few samples change the BSDF sampling fraction little and their scale does not matter") {
  CHECK(BsdfSamplingFraction().bsdf() == kProductProbabilities.bsdf);
  CHECK(learnt({}, 3).bsdf() == kProductProbabilities.bsdf);
  CHECK(learnt(samplesOf(1, 1, 1), 1).bsdf() == Approx(kProductProbabilities.bsdf).margin(0.08));
  std::vector<FractionSample> samples = samplesOf(0.7f, 1, 500), scaled = samples, outshone = samples;
  for (FractionSample& s : scaled) s.weight *= 1e6f;
  CHECK(learnt(scaled, 2).bsdf() == Approx(learnt(samples, 2).bsdf()).margin(1e-5));
  // A sample that is much brighter than all others counts as one sample.
  outshone.push_back(at(0, 1));
  outshone.back().weight = 1e9f;
  CHECK(learnt(outshone, 1).bsdf() == Approx(kProductProbabilities.bsdf).margin(0.08));
}

TEST_CASE("guiding: invalid samples do not change the BSDF sampling fraction") {
  const float infinity = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  std::vector<FractionSample> samples = samplesOf(0.7f, 1, 500);
  const float before = learnt(samples, 2).bsdf();
  for (const float weight : {0.0f, -1.0f, infinity, nan}) {
    samples.push_back(at(0.1f, 1));
    samples.back().weight = weight;
  }
  samples.push_back({0, infinity, 1, 1, 1});
  samples.push_back({0, 1, nan, 1, 1});
  samples.push_back({0, 0, 0, 1, 1});
  CHECK(learnt(samples, 2).bsdf() == before);
}

TEST_CASE("guiding: each record learns and keeps its own BSDF sampling fraction") {
  const auto particlesAt = [](float x, Rng& rng) {
    return Particle{{x + 0.01f * rng.uniform(), 0.01f * rng.uniform(), 0}, Vec3::UnitZ(), Vec3::UnitZ(), 1, 1};
  };
  Rng rng(1);
  std::vector<Particle> particles;
  for (int i = 0; i < 400; ++i) particles.push_back(particlesAt(static_cast<float>(i % 2), rng));
  const std::vector<RecordRequest> requests{{{0, 0, 0}, Vec3::UnitZ()}, {{1, 0, 0}, Vec3::UnitZ()}};
  IlluminationTrainer trainer({}, 1);
  const auto learn = [&] { trainer.learn(std::array{std::span<const Particle>(particles)}, requests); };
  const auto recordAt = [&](float x) { return trainer.cache().find({x, 0, 0}, Vec3::UnitZ()); };
  learn();
  REQUIRE((recordAt(0) && recordAt(1) && recordAt(0) != recordAt(1)));
  CHECK(recordAt(1)->bsdfFraction == kProductProbabilities.bsdf);
  std::vector<FractionSample> samples = samplesOf(0.9f, 1, 5000);
  for (FractionSample& s : samples) s.record = recordAt(1)->index;
  trainer.learnFractions(samples);
  learn();
  CHECK(recordAt(0)->bsdfFraction == kProductProbabilities.bsdf);
  CHECK(recordAt(1)->bsdfFraction > 0.6f);
}
