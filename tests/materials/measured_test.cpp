// Measured materials: their files, the tables used for sampling, and both models compared with analytic BRDFs.

#include <catch2/catch.hpp>

#include <algorithm>
#include <cstdlib>
#include <limits>

#include "materials/lobes/bilinear_warp.h"
#include "materials/lobes/microfacet.h"
#include "materials/lobes/tensor_file.h"
#include "runtime/core/sampling.h"
#include "tests/support/chi2.h"
#include "tests/support/materials_test_util.h"
#include "tests/support/measured_files.h"
#include "tests/support/tool_run.h"

namespace lobe {
namespace {

using Catch::Matchers::Contains;

std::filesystem::path write(const test::Folder& folder, const std::string& name, const std::string& bytes) {
  std::ofstream(folder / name, std::ios::binary) << bytes;
  return folder / name;
}

BsdfPtr bsdfOfFile(const std::string& type, const std::filesystem::path& path) {
  return bsdfOf(type, {{"filename", path.string()}});
}

/// The error message of the model for a file with these bytes.
std::string faultOfFile(const std::string& type, const std::string& bytes) {
  const test::Folder folder;
  try {
    bsdfOfFile(type, write(folder, "file", bytes));
  } catch (const ParameterError& error) {
    CHECK(error.name == "filename");
    CHECK_THAT(error.what(), Contains(folder.path().string()));
    return error.what();
  }
  return "no error";
}

/// A coloured diffuse base plus a glossy lobe.
Brdf analytic(double alphaU, double alphaV) {
  return [microfacet = Microfacet(Microfacet::Kind::ggx, alphaU, alphaV)](const Eigen::Vector3d& wo,
                                                                          const Eigen::Vector3d& wi) {
    const double glossy = microfacet.reflection(wo.cast<float>(), wi.cast<float>());
    return Rgb(Rgb(0.1f, 0.05f, 0.02f) + static_cast<float>(0.4 * glossy));
  };
}

std::vector<TestField> isotropicFields() {
  return measuredFields(analytic(0.45, 0.45), {0.0f}, 48);
}

struct MeasuredModels {
  test::Folder folder;
  Brdf brdf = analytic(0.45, 0.45);
  BsdfPtr measured = bsdfOfFile("measured", write(folder, "m_rgb.bsdf", tensorFile(isotropicFields())));
  BsdfPtr merl = bsdfOfFile("merl", write(folder, "m.binary", merlFile(brdf)));
};
const MeasuredModels& models() {
  static const MeasuredModels made;
  return made;
}

/// The largest relative error of the model, compared with the BRDF, for directions up to the elevation.
double worstError(const Bsdf& bsdf, const Brdf& brdf, double elevation) {
  Rng rng(5);
  double worst = 0.0;
  for (int i = 0; i < 3000; ++i) {
    const Vec3 wo = directionAt(elevation * rng.uniform(), 360.0 * rng.uniform());
    const Vec3 wi = directionAt(elevation * rng.uniform(), 360.0 * rng.uniform());
    const Rgb right = brdf(wo.cast<double>(), wi.cast<double>());
    worst = std::max<double>(worst, ((bsdf.eval(wo, wi, kUv) - right).abs() / right).maxCoeff());
  }
  return worst;
}

std::vector<TestField> changed(std::vector<TestField> fields, const TestField& other) {
  *std::ranges::find(fields, other.name, &TestField::name) = other;
  return fields;
}

std::vector<TestField> without(std::vector<TestField> fields, const std::string& name) {
  std::erase_if(fields, [&](const TestField& field) { return field.name == name; });
  return fields;
}

}  // namespace

TEST_CASE("materials: a tensor file returns fields of the requested type and dimensions") {
  const test::Folder folder;
  const TensorFile file(write(
      folder, "t", tensorFile({floatField("a", {2, 3}, {1, 2, 3, 4, 5, 6}), {"b", 1, {2}, "hi"}, {"c", 5, {0}, ""}})));
  CHECK(file.has("a"));
  CHECK_FALSE(file.has("d"));
  CHECK(file.floats("a", 2).shape == std::vector<std::size_t>{2, 3});
  CHECK(file.floats("a", 2).values == std::vector<float>{1, 2, 3, 4, 5, 6});
  CHECK(file.bytes("b", 1).values == std::vector<std::uint8_t>{'h', 'i'});
  CHECK_THROWS_WITH(file.floats("a", 1), Contains("\"a\"") && Contains("2 dimensions"));
  CHECK_THROWS_WITH(file.floats("b", 1), Contains("\"b\"") && Contains("32-bit floats"));
  CHECK_THROWS_WITH(file.bytes("c", 1), Contains("\"c\""));
  CHECK_THROWS_WITH(file.floats("d", 1), Contains("\"d\" is missing"));
}

TEST_CASE("materials: tensor files truncated at any byte or corrupted are rejected") {
  const std::string whole =
      tensorFile({floatField("first", {2, 2}, {1, 2, 3, 4}), floatField("second", {1, 3}, {5, 6, 7})});
  CHECK_THAT(faultOfFile("measured", whole), Contains("is missing"));
  int refused = 0;
  for (std::size_t length = 0; length < whole.size(); ++length)
    refused += faultOfFile("measured", whole.substr(0, length)).find("is missing") == std::string::npos;
  CHECK(refused == static_cast<int>(whole.size()));

  CHECK_THAT(faultOfFile("measured", "tensor file, or not?"), Contains("not a tensor file"));
  CHECK_THAT(faultOfFile("measured", std::string("tensor_file\0\2\0", 14)), Contains("version 2.0"));
  const TestField a = floatField("a", {1}, {1});
  CHECK_THAT(faultOfFile("measured", tensorFile({a, a})), Contains("\"a\" occurs twice"));
  CHECK_THAT(faultOfFile("measured", tensorFile({{"a", 12, {1}, "1234"}})), Contains("\"a\"") && Contains("type 12"));
  for (const std::vector<std::uint64_t>& shape :
       {std::vector<std::uint64_t>{1ull << 63, 8}, {1ull << 32, 1ull << 32}, {~0ull}, {0, ~0ull}, {3}})
    CHECK_THAT(faultOfFile("measured", tensorFile({floatField("a", shape, {1, 2})})),
               Contains("\"a\" is larger") || Contains("is missing"));
  std::string late = tensorFile({a});
  late.replace(late.size() - 20, 8, bytesOf(~std::uint64_t{3}));
  CHECK_THAT(faultOfFile("measured", late), Contains("\"a\" starts at byte"));
}

TEST_CASE("materials: measured files with inconsistent fields are rejected with the name of the field") {
  const std::vector<TestField> whole = isotropicFields();
  const auto fault = [&](const TestField& other) { return faultOfFile("measured", tensorFile(changed(whole, other))); };
  CHECK(faultOfFile("measured", tensorFile(whole)) == "no error");
  for (const char* name : {"phi_i", "theta_i", "sigma", "ndf", "vndf", "luminance", "rgb", "jacobian"})
    CHECK_THAT(faultOfFile("measured", tensorFile(without(whole, name))),
               Contains(std::string("\"") + name + "\" is missing"));
  CHECK_THAT(fault(floatField("theta_i", {2}, {0.5f, 0.5f})), Contains("\"theta_i\" is not strictly ascending"));
  CHECK_THAT(fault(floatField("theta_i", {2}, {0, 90})), Contains("\"theta_i\" spans"));
  CHECK_THAT(fault(floatField("theta_i", {2}, {0, 1})), Contains("1×19 tables") && Contains("1×2"));
  CHECK_THAT(fault(floatField("phi_i", {3}, {0, 1, 2})), Contains("tables"));
  CHECK_THAT(fault(floatField("sigma", {2, 2}, {1, 1, 0, 1})), Contains("\"sigma\"") && Contains("not positive"));
  CHECK_THAT(fault(floatField("ndf", {1, 2}, {1, 1})), Contains("\"ndf\"") && Contains("2×2"));
  CHECK_THAT(fault(floatField("ndf", {2, 2}, {1, 1, 1, std::numeric_limits<float>::quiet_NaN()})),
             Contains("\"ndf\"") && Contains("not finite"));
  CHECK_THAT(fault(floatField("ndf", {2, 2}, {1, 1, 1, 2e9f})), Contains("\"ndf\"") && Contains("over 1e+09"));
  CHECK_THAT(fault(floatField("sigma", {2, 2}, {1, 1, 1e-30f, 1})), Contains("\"sigma\"") && Contains("below 1e-09"));
  CHECK_THAT(fault(floatField("rgb", {1, 19, 2, 2, 2}, std::vector<float>(152))), Contains("2 colours"));
  std::vector<TestField> spectral = without(whole, "rgb");
  spectral.push_back(floatField("spectra", {1}, {1}));
  CHECK_THAT(faultOfFile("measured", tensorFile(spectral)), Contains("spectral") && Contains("rgb variant"));
}

TEST_CASE("materials: a bilinear warp inverts its samples and they match its density") {
  Rng rng(21);
  const TableSize size{7, 5};
  std::vector<float> values(3 * size.nodes());
  for (float& value : values) value = rng.uniform() < 0.2f ? 0.0f : rng.uniform();
  std::fill_n(values.begin() + 2 * static_cast<std::ptrdiff_t>(size.nodes()), size.nodes(), 0.0f);
  const BilinearWarp warp(size, std::move(values));
  const ParameterNodes nodes({0.0f}, {0.0f, 1.0f, 2.0f});
  for (const double parameter : {-1.0, 0.3, 1.6}) {
    const TableBlend blend = nodes.at(0.0, parameter);
    double worst = 0.0;
    for (int i = 0; i < 1000; ++i) {
      const Eigen::Vector2d u = rng.uniform2().cast<double>();
      const WarpPoint drawn = warp.sample(u, blend);
      const WarpPoint back = warp.invert(drawn.point, blend);
      worst = std::max({worst, (back.point - u).norm(), std::abs(back.density - drawn.density),
                        std::abs(warp.density(drawn.point, blend) - drawn.density)});
    }
    CHECK(worst < 1e-5);
    const Chi2Result r =
        chi2Square([&] { return std::optional(warp.sample(rng.uniform2().cast<double>(), blend).point); },
                   [&](const Eigen::Vector2d& p) { return warp.density(p, blend); });
    INFO(parameter << ": " << r.message);
    CHECK(r.passed(3));
  }
  CHECK(warp.density({0.2, 0.7}, nodes.at(0.0, 2.0)) == Approx(1.0));
}

TEST_CASE("materials: measured models reproduce the BRDF from which their files were made") {
  CHECK(worstError(*models().measured, models().brdf, 70.0) < 0.03);
  CHECK(worstError(*models().merl, models().brdf, 70.0) < 0.03);
  CHECK(models().measured->lobes()[0]->kind() == LobeKind::isotropic);
  CHECK(models().measured->lobes()[0]->summary() == "m_rgb");
}

TEST_CASE("materials: measured models support anisotropy and symmetry of the measured azimuths") {
  const test::Folder folder;
  const Brdf brdf = analytic(0.35, 0.6);
  for (const int symmetry : {1, 2, 4}) {
    const int nodes = 1 + 24 / symmetry;
    std::vector<float> phi;
    for (int i = 0; i < nodes; ++i) phi.push_back(-kPi + kPi / 12.0f * static_cast<float>(i));
    const BsdfPtr bsdf = bsdfOfFile("measured", write(folder, "a.bsdf", tensorFile(measuredFields(brdf, phi, 32))));
    CHECK(bsdf->lobes()[0]->kind() == LobeKind::anisotropic);
    INFO("symmetry " << symmetry);
    CHECK(worstError(*bsdf, brdf, 70.0) < 0.06);
    Rng rng(31);
    const Vec3 wo = directionAt(50.0, 25.0);
    const auto sampler = [&]() -> std::optional<Vec3> {
      const auto s = bsdf->lobes()[0]->sample(wo, rng.uniform2());
      return s ? std::optional<Vec3>(s->wi) : std::nullopt;
    };
    const Chi2Result r = chi2Sphere(sampler, [&](const Vec3& wi) { return bsdf->pdf(wo, wi, kUv); });
    INFO(r.message);
    CHECK(r.passed(3));
  }
}

TEST_CASE("materials: samples of measured models match their density") {
  std::uint64_t seed = 40;
  for (const BsdfPtr& bsdf : {models().measured, models().merl})
    for (const double elevation : {0.0, 57.0, 89.9}) {
      const Vec3 wo = directionAt(elevation, 200.0);
      Rng rng(++seed);
      const auto sampler = [&]() -> std::optional<Vec3> {
        const auto s = bsdf->sample(wo, kUv, 0.5f, rng.uniform2());
        return s ? std::optional<Vec3>(s->wi) : std::nullopt;
      };
      const Chi2Result r = chi2Sphere(sampler, [&](const Vec3& wi) { return bsdf->pdf(wo, wi, kUv); });
      INFO(bsdf->lobes()[0]->summary() << " at " << elevation << ": " << r.message);
      CHECK(r.passed(6));
    }
}

TEST_CASE("materials: measured models are finite everywhere and their samples match eval and pdf") {
  Rng rng(51);
  for (const BsdfPtr& bsdf : {models().measured, models().merl}) {
    int bad = 0;
    for (int i = 0; i < 5000; ++i) {
      const double elevations[] = {0.0, 89.99, 90.0, 89.9999999, 100.0 * rng.uniform()};
      const Vec3 wo = directionAt(elevations[i % 5], 360.0 * rng.uniform());
      const Vec3 wi =
          i % 3 ? directionAt(elevations[i / 5 % 5], 360.0 * rng.uniform()) : Vec3(-wo.x(), -wo.y(), wo.z());
      const Rgb f = bsdf->eval(wo, wi, kUv);
      const float p = bsdf->pdf(wo, wi, kUv);
      bad += !(f.allFinite() && (f >= 0.0f).all() && std::isfinite(p) && p >= 0.0f);
      if (const auto s = bsdf->sample(wo, kUv, 0.5f, rng.uniform2()))
        bad += !((s->f == bsdf->eval(wo, s->wi, kUv)).all() && s->pdf == bsdf->pdf(wo, s->wi, kUv) && s->pdf > 0.0f &&
                 std::abs(s->wi.norm() - 1.0f) < 1e-5f);
    }
    CHECK(bad == 0);
    CHECK(bsdf->eval(-Vec3::UnitZ(), -Vec3::UnitZ(), kUv).maxCoeff() == 0.0f);
  }
}

TEST_CASE("materials: a MERL material is reciprocal") {
  Rng rng(61);
  double worst = 0.0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3 wo = squareToCosineHemisphere(rng.uniform2());
    const Vec3 wi = squareToCosineHemisphere(rng.uniform2());
    const Rgb there = models().merl->eval(wo, wi, kUv);
    worst = std::max<double>(worst, ((models().merl->eval(wi, wo, kUv) - there).abs() / there).maxCoeff());
  }
  CHECK(worst < 1e-5);
}

TEST_CASE("materials: invalid MERL files are rejected and unmeasured values are black") {
  CHECK_THAT(faultOfFile("merl", ""), Contains("not a MERL file"));
  CHECK_THAT(faultOfFile("merl", bytesOf(std::vector<std::int32_t>{90, -90, 180})), Contains("90×-90×180"));
  CHECK_THAT(faultOfFile("merl", bytesOf(std::vector<std::int32_t>{90, 90, 180, 1})), Contains("16"));
  CHECK_THAT(faultOfFile("merl", merlFile([](const auto&, const auto&) { return grey(1e31f); })),
             Contains("not finite or over 1e+30"));
  const std::string unmeasured = merlFile([](const auto&, const auto&) { return grey(-1.0f); });
  const test::Folder folder;
  const BsdfPtr black = bsdfOfFile("merl", write(folder, "m", unmeasured));
  CHECK(black->eval(directionAt(20.0), directionAt(40.0), kUv).maxCoeff() == 0.0f);
  CHECK(black->albedo(directionAt(20.0), kUv).maxCoeff() == 0.0f);
  CHECK(black->sample(directionAt(20.0), kUv, 0.5f, Vec2(0.6f, 0.4f)).has_value());
}

TEST_CASE("materials: a measured lobe is identified by the content of its file and not by the path") {
  const test::Folder folder;
  std::vector<TestField> fields = isotropicFields();
  const BsdfPtr a = bsdfOfFile("measured", write(folder, "a.bsdf", tensorFile(fields)));
  const BsdfPtr b = bsdfOfFile("measured", write(folder, "b.bsdf", tensorFile(fields)));
  const BsdfPtr c = bsdfOfFile(
      "measured", write(folder, "c.bsdf", tensorFile(changed(fields, floatField("ndf", {2, 2}, {1, 1, 1, 2})))));
  CHECK(a->lobes()[0]->key() == b->lobes()[0]->key());
  CHECK(a->lobes()[0]->key() == models().measured->lobes()[0]->key());
  CHECK(a->lobes()[0]->key() != c->lobes()[0]->key());
}

TEST_CASE("materials: real measurements conserve energy and are sampled with low variance") {
  const char* folder = std::getenv("LOBE_DATA");
  if (!folder) {
    WARN("LOBE_DATA is not set: skipped");
    return;
  }
  struct Real {
    const char* type;
    const char* name;
    double mostReflected;  ///< the measurement of the vinyl film creates energy at grazing angles
  };
  for (const Real& real :
       {Real{"measured", "paper_white_rgb.bsdf", 1.0}, Real{"measured", "cc_ibiza_sunset_rgb.bsdf", 1.0},
        Real{"measured", "satin_rosaline_rgb.bsdf", 1.2}, Real{"merl", "pink-fabric.binary", 1.0}}) {
    const BsdfPtr bsdf = bsdfOfFile(real.type, std::filesystem::path(folder) / "measured" / real.name);
    for (const double elevation : {0.0, 40.0, 70.0, 85.0, 89.99}) {
      INFO(real.name << " at " << elevation);
      const Vec3 wo = directionAt(elevation, 300.0);
      Rng rng(71);
      Mean albedo;
      for (int i = 0; i < 6000; ++i) {
        const auto s = bsdf->sample(wo, kUv, 0.5f, rng.uniform2());
        albedo.add(s ? luminance(s->f) * s->wi.z() / s->pdf : 0.0);
      }
      CHECK(albedo.value() < real.mostReflected);
      const double variance = albedo.squares / 6000.0 / (albedo.value() * albedo.value()) - 1.0;
      CHECK(variance < 0.2);
      CHECK(luminance(bsdf->albedo(wo, kUv)) == Approx(std::min(albedo.value(), 1.0)).epsilon(0.06));
    }
  }
}

}  // namespace lobe
