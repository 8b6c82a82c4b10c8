// Models that contain other models, pass-through and diffuse transmission, compared with their parts.

#include <catch2/catch.hpp>

#include "runtime/core/sampling.h"
#include "tests/support/materials_test_util.h"

namespace lobe {
namespace {

const Vec3 kAbove = directionAt(50.0, 20.0);
const Vec3 kBelow = directionAt(140.0, 70.0);

/// The left half of the square in one colour, the right half in another.
class Halves final : public Texture {
 public:
  Halves(const Rgb& left, const Rgb& right) : left_(left), right_(right) {}
  Rgb eval(const Vec2& uv) const override { return uv.x() < 0.5f ? left_ : right_; }
  Rgb mean() const override { return 0.5f * (left_ + right_); }
  Rgb largest() const override { return left_.max(right_); }
  std::uint64_t fingerprint() const override { return 0; }
  TextureRange range() const override {
    return {std::min(luminance(left_), luminance(right_)), std::max(luminance(left_), luminance(right_))};
  }

 private:
  Rgb left_, right_;
};

/// A height field that is equal to u, for bump maps.
class Ramp final : public Texture {
 public:
  Rgb eval(const Vec2& uv) const override { return grey(uv.x()); }
  Rgb mean() const override { return grey(0.5f); }
  TextureRange range() const override { return {0.0f, 1.0f}; }
  Rgb largest() const override { return grey(1.0f); }
  std::uint64_t fingerprint() const override { return 0; }
};

BsdfPtr blendOf(double weight, const BsdfPtr& first, const BsdfPtr& second) {
  return bsdfOf("blendbsdf", {{"weight", weight}}, {first, second});
}

BsdfPtr mixtureOf(const std::string& weights, std::initializer_list<BsdfPtr> parts) {
  return bsdfOf("mixturebsdf", {{"weights", weights}}, parts);
}

BsdfPtr metalOf(double alpha, float tint = 1.0f) {
  return bsdfOf("roughconductor", {{"alpha", alpha}, {"specular_reflectance", grey(tint)}});
}

std::string messageOf(const std::string& type,
                      std::initializer_list<std::pair<std::string, ParameterValue>> values = {},
                      std::initializer_list<BsdfPtr> children = {}) {
  try {
    bsdfOf(type, values, children);
  } catch (const ParameterError& error) {
    return error.name + ": " + error.what();
  }
  return "no error";
}

void checkSame(const Bsdf& a, const Bsdf& b, const Vec2& uv) {
  Rng rng(31);
  for (int i = 0; i < 200; ++i) {
    const Vec3 wo = squareToSphere(rng.uniform2());
    const Vec3 wi = squareToSphere(rng.uniform2());
    const Vec2 u = rng.uniform2();
    const float choice = rng.uniform();
    CHECK((a.eval(wo, wi, uv) == b.eval(wo, wi, uv)).all());
    CHECK(a.pdf(wo, wi, uv) == b.pdf(wo, wi, uv));
    CHECK(a.deltaProbability(wo, uv) == b.deltaProbability(wo, uv));
    CHECK((a.albedo(wo, uv) == b.albedo(wo, uv)).all());
    const auto s = a.sample(wo, uv, choice, u);
    const auto t = b.sample(wo, uv, choice, u);
    REQUIRE(s.has_value() == t.has_value());
    if (s) CHECK((s->wi == t->wi && s->pdf == t->pdf));
    const auto d = a.sampleDelta(wo, uv, choice);
    const auto e = b.sampleDelta(wo, uv, choice);
    REQUIRE(d.has_value() == e.has_value());
    if (d) CHECK((d->wi == e->wi && (d->weight == e->weight).all() && d->eta == e->eta));
    CHECK(a.mixture(wo, uv).constant == b.mixture(wo, uv).constant);
    CHECK(a.mixture(wo, uv).glossyCount == b.mixture(wo, uv).glossyCount);
    CHECK(a.mixture(wo, uv).undescribedFraction == Approx(b.mixture(wo, uv).undescribedFraction));
  }
}

/// Remembers the largest random number with which it was asked for a sample. White; delta: deltaProbability.
class ChoiceRecorder final : public Bsdf {
 public:
  explicit ChoiceRecorder(float delta) : delta_(delta) {}
  Rgb eval(const Vec3&, const Vec3&, const Vec2&) const override { return Rgb::Zero(); }
  std::optional<BsdfSample> sample(const Vec3&, const Vec2&, float choice, const Vec2&) const override {
    largest_ = std::max(largest_, choice);
    return std::nullopt;
  }
  float pdf(const Vec3&, const Vec3&, const Vec2&) const override { return 0.0f; }
  std::optional<DeltaSample> sampleDelta(const Vec3&, const Vec2&, float choice) const override {
    largest_ = std::max(largest_, choice);
    return std::nullopt;
  }
  float deltaProbability(const Vec3&, const Vec2&) const override { return delta_; }
  LobeMixture mixture(const Vec3&, const Vec2&) const override { return {}; }
  Rgb albedo(const Vec3&, const Vec2&) const override { return grey(1.0f); }
  float largest() const { return largest_; }

 private:
  float delta_;
  mutable float largest_ = 0.0f;
};

}  // namespace

TEST_CASE("materials: null passes all light straight through") {
  const BsdfPtr none = bsdfOf("null");
  for (const Vec3& wo : {kAbove, kBelow}) {
    const auto s = none->sampleDelta(wo, kUv, 0.7f);
    REQUIRE(s);
    CHECK(s->wi == -wo);
    CHECK((s->weight == 1.0f).all());
    CHECK(s->eta == 1.0f);
    CHECK(none->deltaProbability(wo, kUv) == 1.0f);
    CHECK_FALSE(none->sample(wo, kUv, 0.5f, Vec2(0.5f, 0.5f)));
    CHECK(none->eval(wo, -wo, kUv).maxCoeff() == 0.0f);
  }
  CHECK(none->transmits());
}

TEST_CASE("materials: a diffuse transmitter scatters its transmittance to the opposite side for both sides") {
  const Rgb transmittance(0.2f, 0.5f, 0.8f);
  const BsdfPtr paper = bsdfOf("difftrans", {{"transmittance", transmittance}});
  CHECK(paper->transmits());
  CHECK(bsdfOf("difftrans")->albedo(kAbove, kUv).x() == 0.5f);
  for (const Vec3& wo : {kAbove, kBelow}) {
    CHECK(paper->eval(wo, wo, kUv).maxCoeff() == 0.0f);
    CHECK(paper->pdf(wo, wo, kUv) == 0.0f);
    CHECK(paper->mixture(wo, kUv).undescribedFraction == 1.0f);
    CHECK(paper->mixture(wo, kUv).constant == 0.0f);
    // With cosine-weighted sampling the weight of every sample is the albedo.
    for (const float u : {0.01f, 0.5f, 0.99f}) {
      const auto s = paper->sample(wo, kUv, 0.5f, Vec2(u, 0.3f));
      REQUIRE(s);
      CHECK(s->wi.z() * wo.z() < 0.0f);
      CHECK((s->f * std::abs(s->wi.z()) / s->pdf).isApprox(transmittance, 1e-5f));
    }
  }
}

TEST_CASE("materials: a blend with weight 0 or 1 equals one of its parts") {
  const BsdfPtr plastic = bsdfOf("plastic", {{"diffuse_reflectance", Rgb(0.8f, 0.4f, 0.2f)}});
  const BsdfPtr glass = bsdfOf("dielectric");
  const BsdfPtr masked = bsdfOf("mask", {{"opacity", 0.3}}, {bsdfOf("roughplastic")});
  const BsdfPtr paper = bsdfOf("difftrans");
  for (const auto& [first, second] : {std::pair(plastic, glass), std::pair(masked, paper)}) {
    checkSame(*blendOf(0.0, first, second), *first, kUv);
    checkSame(*blendOf(1.0, first, second), *second, kUv);
    const auto halves = std::make_shared<Halves>(grey(0.0f), grey(1.0f));
    const BsdfPtr textured = bsdfOf("blendbsdf", {{"weight", TexturePtr(halves)}}, {first, second});
    checkSame(*textured, *first, Vec2(0.2f, 0.5f));
    checkSame(*textured, *second, Vec2(0.8f, 0.5f));
  }
}

TEST_CASE("materials: a blend is the weighted sum of its parts") {
  const BsdfPtr metal = metalOf(0.2, 0.5f);
  const BsdfPtr plastic = bsdfOf("roughplastic", {{"alpha", 0.3}, {"diffuse_reflectance", Rgb(0.8f, 0.4f, 0.2f)}});
  const BsdfPtr blend = blendOf(0.25, metal, plastic);
  const Vec3 wi = directionAt(20.0, 190.0);
  CHECK(blend->eval(kAbove, wi, kUv)
            .isApprox(0.75f * metal->eval(kAbove, wi, kUv) + 0.25f * plastic->eval(kAbove, wi, kUv)));
  CHECK(blend->pdf(kAbove, wi, kUv) ==
        Approx(0.75f * metal->pdf(kAbove, wi, kUv) + 0.25f * plastic->pdf(kAbove, wi, kUv)));
  REQUIRE(blend->lobes().size() == 2);
  CHECK(blend->lobes()[0] == metal->lobes()[0]);
  CHECK(blend->lobes()[1] == plastic->lobes()[0]);
  const LobeMixture mixture = blend->mixture(kAbove, kUv);
  REQUIRE(mixture.glossyCount == 2);
  CHECK(mixture.glossy[0].lobe == 0);
  CHECK(mixture.glossy[0].tint == Approx(0.75f * 0.5f));
  CHECK(mixture.glossy[1].lobe == 1);
  CHECK(mixture.glossy[1].tint == Approx(0.25f));
  CHECK(mixture.constant == Approx(0.25f * plastic->mixture(kAbove, kUv).constant));
  CHECK_FALSE(blend->transmits());
  CHECK(blendOf(0.5, metal, bsdfOf("null"))->transmits());
}

TEST_CASE("materials: delta parts of a mixturebsdf conserve energy") {
  const BsdfPtr mirror = bsdfOf("conductor", {{"material", std::string("none")}});
  const BsdfPtr glass = bsdfOf("thindielectric");
  const BsdfPtr blend = mixtureOf("0.5 0.25 0.15", {mirror, glass, bsdfOf("diffuse")});
  CHECK(blend->deltaProbability(kAbove, kUv) == Approx(0.75 / 0.9));
  Rgb passed = Rgb::Zero();
  Rgb mirrored = Rgb::Zero();
  constexpr int kChoices = 20000;
  for (int i = 0; i < kChoices; ++i) {
    const auto s = blend->sampleDelta(kAbove, kUv, (static_cast<float>(i) + 0.5f) / kChoices);
    REQUIRE(s);
    (s->wi.z() < 0.0f ? passed : mirrored) += s->weight / kChoices;
  }
  const auto reflected = glass->sampleDelta(kAbove, kUv, 0.0f);
  REQUIRE(reflected->wi.z() > 0.0f);
  CHECK((passed + mirrored).x() == Approx(0.75f).epsilon(1e-3));
  CHECK(passed.x() < 0.25f);
  CHECK(passed.x() > 0.2f);
}

TEST_CASE("materials: of many lobes the mixture keeps those with the largest tints") {
  const BsdfPtr metals[] = {metalOf(0.1), metalOf(0.2, 0.1f), metalOf(0.3), metalOf(0.4), metalOf(0.5), metalOf(0.6)};
  const BsdfPtr bsdf =
      mixtureOf("0.15,0.15,0.15,0.15,0.15,0.05", {metals[0], metals[1], metals[2], metals[3], metals[4], metals[5]});
  REQUIRE(bsdf->lobes().size() == 6);
  const LobeMixture mixture = bsdf->mixture(kAbove, kUv);
  REQUIRE(mixture.glossyCount == kMaxLobes);
  for (const LobeTint& glossy : mixture.glossy) {
    CHECK(glossy.tint == Approx(0.15f));
    CHECK(glossy.lobe != 1);
    CHECK(glossy.lobe != 5);
  }
}

TEST_CASE("materials: the undescribed fraction of a blend is weighted by albedo") {
  const BsdfPtr blend =
      blendOf(0.25, bsdfOf("diffuse", {{"reflectance", 0.2}}), bsdfOf("difftrans", {{"transmittance", 0.6}}));
  CHECK(blend->mixture(kAbove, kUv).undescribedFraction == Approx(0.5f));
  CHECK(blend->mixture(kAbove, kUv).constant == Approx(0.15f));
  CHECK(blend->mixture(kBelow, kUv).undescribedFraction == Approx(1.0f));
}

TEST_CASE("materials: mixture weights are scaled to a sum of 1 only if their sum exceeds 1") {
  const BsdfPtr white = bsdfOf("diffuse", {{"reflectance", 1.0}});
  CHECK(mixtureOf("3, 1", {white, bsdfOf("conductor")})->mixture(kAbove, kUv).constant == Approx(0.75f));
  CHECK(mixtureOf("0.3;0.1", {white, white})->albedo(kAbove, kUv).x() == Approx(0.4f));
}

TEST_CASE("materials: errors in nested models are reported") {
  using Catch::Matchers::Contains;
  const BsdfPtr diffuse = bsdfOf("diffuse");
  CHECK_THAT(messageOf("blendbsdf", {{"weight", 0.5}}, {diffuse}), Contains("two nested bsdfs") && Contains("1"));
  CHECK_THAT(messageOf("mixturebsdf", {{"weights", std::string("0.5")}}), Contains("nested"));
  CHECK_THAT(messageOf("mixturebsdf", {}, {diffuse}), Contains("weights:") && Contains("there are 0 for 1"));
  CHECK_THAT(messageOf("mixturebsdf", {{"weights", std::string("0.5 0.5")}}, {diffuse}), Contains("2 for 1"));
  CHECK_THAT(messageOf("mixturebsdf", {{"weights", std::string("0.5x")}}, {diffuse}), Contains("\"0.5x\""));
  CHECK_THAT(messageOf("mixturebsdf", {{"weights", std::string("-1")}}, {diffuse}), Contains("\"-1\""));
  CHECK_THAT(messageOf("mixturebsdf", {{"weights", std::string("nan")}}, {diffuse}), Contains("\"nan\""));
  CHECK_THAT(messageOf("mixturebsdf", {{"weights", std::string("0")}}, {diffuse}), Contains("positive"));
  CHECK_THAT(messageOf("normalmap", {}, {diffuse}), Contains("texture"));
  CHECK_THAT(messageOf("twosided", {}, {bsdfOf("mask", {}, {diffuse})}), Contains("mask > twosided"));
}

TEST_CASE("materials: a normal map perturbs the normal in the frame of the tangent along u") {
  const auto mapped = [](const Rgb& colour, const Vec3& dpdu, const BsdfPtr& nested) {
    return bsdfOf("normalmap", {{"normalmap", constantTexture(colour)}}, {nested})
        ->perturbedNormal(Vec3::UnitZ(), kUv, dpdu, Vec3::UnitY());
  };
  const BsdfPtr diffuse = bsdfOf("diffuse");
  const Vec3 along = Vec3(0.0f, 2.0f, 0.0f);
  CHECK(mapped(Rgb(0.5f, 0.5f, 1.0f), along, diffuse).isApprox(Vec3::UnitZ()));
  // (0.6, 0, 0.8) is tilted along u, which is local y here; (0, 0.6, 0.8) is then tilted along −x.
  CHECK(mapped(Rgb(0.8f, 0.5f, 0.9f), along, diffuse).isApprox(Vec3(0.0f, 0.6f, 0.8f), 1e-5f));
  CHECK(mapped(Rgb(0.5f, 0.8f, 0.9f), along, diffuse).isApprox(Vec3(-0.6f, 0.0f, 0.8f), 1e-5f));
  CHECK(mapped(Rgb(0.65f, 0.5f, 0.7f), along, diffuse).isApprox(Vec3(0.0f, 0.6f, 0.8f), 1e-5f));  // any length
  CHECK(mapped(Rgb(0.5f, 0.5f, 0.5f), along, diffuse) == Vec3::UnitZ());
  CHECK(mapped(Rgb(0.5f, 0.5f, 0.0f), along, diffuse) == Vec3::UnitZ());
  CHECK(mapped(Rgb(0.8f, 0.5f, 0.9f), Vec3::Zero(), diffuse).norm() == Approx(1.0f));
  // Two rotations about the same axis add up.
  const BsdfPtr inner = bsdfOf("normalmap", {{"", constantTexture(Rgb(0.8f, 0.5f, 0.9f))}}, {diffuse});
  const Vec3 twice = mapped(Rgb(0.8f, 0.5f, 0.9f), Vec3::UnitX(), inner);
  CHECK(twice.isApprox(Vec3(0.96f, 0.0f, 0.28f), 1e-5f));
}

TEST_CASE("materials: mapped normals that face away from the viewer are flipped if the option is set") {
  const Rgb leaning(0.8f, 0.5f, 0.9f);  // (0.6, 0, 0.8)
  const auto normal = [&](bool flips, const Vec3& wo) {
    const BsdfPtr map =
        bsdfOf("normalmap", {{"", constantTexture(leaning)}, {"flip_invalid_normals", flips}}, {bsdfOf("diffuse")});
    return map->perturbedNormal(wo, kUv, Vec3::UnitX(), Vec3::UnitY());
  };
  const Vec3 facing = directionAt(70.0);
  const Vec3 averted = directionAt(70.0, 180.0);
  CHECK(normal(true, facing).isApprox(Vec3(0.6f, 0.0f, 0.8f), 1e-5f));
  CHECK(normal(true, averted).isApprox(Vec3(-0.6f, 0.0f, 0.8f), 1e-5f));
  CHECK(normal(false, averted).isApprox(Vec3(0.6f, 0.0f, 0.8f), 1e-5f));
  // The result is the same for −wo.
  CHECK(normal(true, -facing).isApprox(Vec3(0.6f, 0.0f, 0.8f), 1e-5f));
  CHECK(normal(true, -averted).isApprox(Vec3(-0.6f, 0.0f, 0.8f), 1e-5f));
  const auto slope = std::make_shared<Ramp>();
  const BsdfPtr bump =
      bsdfOf("bumpmap", {{"", TexturePtr(slope)}, {"flip_invalid_normals", true}}, {bsdfOf("diffuse")});
  const Vec3 n = Vec3(-1.0f, 0.0f, 1.0f).normalized();
  CHECK(bump->perturbedNormal(averted, kUv, Vec3::UnitX(), Vec3::UnitY()).isApprox(n, 1e-3f));
  CHECK(bump->perturbedNormal(facing, kUv, Vec3::UnitX(), Vec3::UnitY()).isApprox(Vec3(-n.x(), 0.0f, n.z()), 1e-3f));
}

TEST_CASE("materials: the normal map on the back of twosided is the mirror image of its front") {
  const BsdfPtr map = bsdfOf("normalmap", {{"", constantTexture(Rgb(0.8f, 0.5f, 0.9f))}}, {bsdfOf("diffuse")});
  const BsdfPtr both = bsdfOf("twosided", {}, {map});
  const auto normal = [&](const Vec3& wo) { return both->perturbedNormal(wo, kUv, Vec3::UnitX(), Vec3::UnitY()); };
  CHECK(normal(kAbove).isApprox(Vec3(0.6f, 0.0f, 0.8f), 1e-5f));
  // The mirror image of the normal of the front, (0.6, 0, −0.8), as a line.
  CHECK(normal(kBelow).isApprox(Vec3(-0.6f, 0.0f, 0.8f), 1e-5f));
}

TEST_CASE("materials: models pass on the terminator shadowing of their nested models") {
  const auto mapped = [](bool shadows) {
    return bsdfOf("normalmap", {{"", constantTexture(Rgb(0.8f, 0.5f, 0.9f))}, {"use_shadowing_function", shadows}},
                  {bsdfOf("diffuse")});
  };
  for (const bool shadows : {false, true}) {
    const BsdfPtr map = mapped(shadows);
    for (const BsdfPtr& bsdf :
         {map, bsdfOf("twosided", {}, {map}), bsdfOf("mask", {}, {map}), blendOf(0.5, bsdfOf("diffuse"), map),
          bsdfOf("bumpmap", {{"", constantTexture(grey(1.0f))}}, {map}), bsdfOf("coating", {}, {map}),
          bsdfOf("roughcoating", {}, {map})}) {
      CHECK(bsdf->shadowsTerminator() == shadows);
      CHECK(bsdf->mapsNormals());
    }
  }
  CHECK_FALSE(bsdfOf("diffuse")->shadowsTerminator());
  CHECK_FALSE(bsdfOf("coating", {}, {bsdfOf("diffuse")})->mapsNormals());
}

TEST_CASE("materials: mapped normals in a blend are averaged by weight") {
  const BsdfPtr flat = bsdfOf("diffuse");
  const BsdfPtr leaning = bsdfOf("normalmap", {{"", constantTexture(Rgb(0.8f, 0.5f, 0.9f))}}, {flat});
  const auto normal = [](const BsdfPtr& bsdf) {
    return bsdf->perturbedNormal(Vec3::UnitZ(), kUv, Vec3::UnitX(), Vec3::UnitY());
  };
  CHECK(normal(blendOf(0.0, flat, leaning)).isApprox(Vec3::UnitZ()));
  CHECK(normal(blendOf(1.0, flat, leaning)).isApprox(Vec3(0.6f, 0.0f, 0.8f), 1e-5f));
  CHECK(normal(blendOf(0.3, leaning, leaning)).isApprox(Vec3(0.6f, 0.0f, 0.8f), 1e-5f));
  CHECK(normal(blendOf(0.5, flat, leaning)).isApprox(Vec3(0.3f, 0.0f, 0.9f).normalized(), 1e-5f));
}

TEST_CASE("materials: random numbers that serve for a second choice stay below 1") {
  const auto masked = std::make_shared<ChoiceRecorder>(1.0f), coated = std::make_shared<ChoiceRecorder>(1.0f),
             roughlyCoated = std::make_shared<ChoiceRecorder>(0.0f);
  const BsdfPtr coating = bsdfOf("coating", {}, {coated}), roughCoating = bsdfOf("roughcoating", {}, {roughlyCoated});
  Rng rng(41);
  for (int i = 0; i < 2000; ++i) {
    const Vec3 wo = squareToSphere(rng.uniform2());
    const BsdfPtr mask = bsdfOf("mask", {{"opacity", static_cast<double>(rng.uniform())}}, {masked});
    mask->sampleDelta(wo, kUv, kOneMinusEpsilon);
    coating->sampleDelta(wo, kUv, kOneMinusEpsilon);
    roughCoating->sample(wo, kUv, kOneMinusEpsilon, Vec2(0.5f, 0.5f));
  }
  for (const auto& recorder : {masked, coated, roughlyCoated}) {
    CHECK(recorder->largest() > 0.99f);
    CHECK(recorder->largest() < 1.0f);
  }
}

}  // namespace lobe
