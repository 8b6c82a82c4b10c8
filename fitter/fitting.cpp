#include "lobe/fitting.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <span>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "fitter/compile.h"
#include "runtime/core/parallel.h"
#include "runtime/mixture/grid.h"

namespace lobe {
namespace {

Float3 floats(const Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

/// Adapts the functions of a host renderer to the Lobe interface.
class HostLobe : public Lobe {
 public:
  explicit HostLobe(const LobeFunctions& functions) : functions_(functions) {}

  LobeKind kind() const override { return functions_.anisotropic ? LobeKind::anisotropic : LobeKind::isotropic; }
  std::string model() const override { return functions_.model; }
  std::string key() const override { return functions_.key; }
  std::string summary() const override { return functions_.key; }
  int revision() const override { return functions_.revision; }
  bool mirrorSymmetric() const override { return functions_.mirrorSymmetric; }

  double eval(const Vec3& wo, const Vec3& wi) const override {
    return wo.z() > 0 && wi.z() > 0 ? functions_.evaluate(floats(wo), floats(wi)) : 0.0;
  }
  std::optional<LobeSample> sample(const Vec3& wo, const Vec2& u) const override {
    const std::optional<LobeDirection> drawn = functions_.sample(floats(wo), {u.x(), u.y()});
    if (!drawn) return std::nullopt;
    const Vec3 wi(drawn->wi.x, drawn->wi.y, drawn->wi.z);
    if (!(std::abs(wi.norm() - 1) < 1e-3f)) refuse("sample returns a direction that is not a unit vector");
    if (wi.z() <= 0) return std::nullopt;
    return LobeSample{wi, drawn->pdf};
  }
  float pdf(const Vec3& wo, const Vec3& wi) const override {
    const float density = functions_.pdf(floats(wo), floats(wi));
    if (!(density >= 0 && std::isfinite(density))) refuse("pdf returns a value that is negative or not finite");
    return density;
  }

 private:
  [[noreturn]] void refuse(const char* fault) const {
    throw std::runtime_error(fmt::format("lobe {}: {}", functions_.model, fault));
  }

  LobeFunctions functions_;
};

void validate(const LobeFunctions& lobe) {
  const bool named =
      !lobe.model.empty() && lobe.model.size() <= 64 &&
      std::ranges::all_of(lobe.model, [](unsigned char c) { return std::isalnum(c) || c == '-' || c == '_'; });
  if (!named)
    throw std::runtime_error(
        fmt::format("LobeFunctions::model '{}' must be a name of up to 64 letters, digits, '-' and '_'", lobe.model));
  if (lobe.key.empty() || std::ranges::any_of(lobe.key, [](unsigned char c) { return std::iscntrl(c) != 0; }))
    throw std::runtime_error("LobeFunctions::key must be text without control characters");
  if (!lobe.evaluate || !lobe.sample || !lobe.pdf)
    throw std::runtime_error("LobeFunctions: evaluate, sample and pdf must all be set");
}

/// Whether the lobe reflects light between any two directions of a small grid, or in the direction of a mirror.
bool reflects(const LobeFunctions& lobe) {
  const DirectionGrid grid{GridKind::fibonacci, 32};
  std::vector<Float3> directions{Float3{0, 0, 1}};
  for (int i = 0; i < grid.count; ++i) directions.push_back(floats(grid.direction(i)));
  return std::ranges::any_of(directions, [&](const Float3& wo) {
    const auto reflectsTo = [&](const Float3& wi) { return lobe.evaluate(wo, wi) > 0; };
    return reflectsTo({-wo.x, -wo.y, wo.z}) || std::ranges::any_of(directions, reflectsTo);
  });
}

/// Refuses a lobe without records of positive integral although it reflects light.
void checkSampled(const LobeFunctions& lobe, std::span<const CacheRecord> records) {
  const bool black = std::ranges::none_of(records, [](const CacheRecord& r) { return r.integral > 0; });
  if (black && reflects(lobe))
    throw std::runtime_error(
        fmt::format("lobe {}: sample draws no direction although evaluate is positive", lobe.model));
}

}  // namespace

void FittingOptions::validate() const {
  const auto require = [](bool condition, const char* field, const char* range) {
    if (!condition) throw std::runtime_error(fmt::format("FittingOptions::{} must be {}", field, range));
  };
  require(!folder.empty(), "folder", "the name of a folder");
  require(quality > 0 && std::isfinite(quality), "quality", "positive");
  require(components >= 1 && components <= static_cast<int>(kMaxCacheComponents), "components", "from 1 to 32");
}

CompiledLobe compileLobe(const LobeFunctions& lobe, const FittingOptions& options) {
  validate(lobe);
  options.validate();
  CompileOptions compile;
  compile.directory = options.folder;
  compile.force = options.force;
  compile.settings.quality = options.quality;
  compile.settings.components = static_cast<std::uint32_t>(options.components);
  const CompileJob job = planCompile({{std::make_shared<HostLobe>(lobe), {}}}, compile).front();
  if (!job.upToDate) {
    const FittedGrid fit = isolated([&] { return fitForFile(job, {}); });
    checkSampled(lobe, fit.records);
    writeCompiled(job, fit);
  }
  const LobeCache cache = LobeCache::open(job.path);
  float worst = 0;
  for (const CacheRecord& r : cache.records()) worst = std::max({worst, r.nev, r.nevCoverage});
  return {job.path, !job.upToDate, cache.records().size(), worst};
}

}  // namespace lobe
