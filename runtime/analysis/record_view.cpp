#include "runtime/analysis/record_view.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "runtime/analysis/disc_panel.h"
#include "runtime/guiding/field_data.h"
#include "runtime/guiding/sample_storage_data.h"
#include "runtime/render/integrators/guided_integrator.h"

namespace lobe {
namespace {

constexpr int kCells = 30;  // along each axis of the square around the disc
constexpr int kColumns = 3;

/// A histogram of weights over the disc, normalised to a density.
class Histogram {
 public:
  void add(const Vec2& y, double weight) {
    cells_[index(y)] += weight;
    total_ += weight;
  }
  bool empty() const { return !(total_ > 0); }
  double density(const Vec2& y) const {
    constexpr double area = 4.0 / (kCells * kCells);
    return empty() ? 0 : cells_[index(y)] / (total_ * area);
  }

 private:
  static std::size_t index(const Vec2& y) {
    const auto cell = [](float v) { return std::clamp(static_cast<int>(0.5f * (v + 1) * kCells), 0, kCells - 1); };
    return static_cast<std::size_t>(cell(y.y())) * kCells + static_cast<std::size_t>(cell(y.x()));
  }
  std::array<double, static_cast<std::size_t>(kCells) * kCells> cells_{};
  double total_ = 0;
};

/// The particles around the record, in the record's frame.
Neighbourhood neighbourhoodOf(const IlluminationRecord& record, const RenderScene& scene,
                              const TrainedIllumination& illumination, const FieldOptions& options) {
  const SampleStorageData& particles = dataOf(illumination.particles);
  const std::array<std::span<const Particle>, 2> sources{particles.photons, particles.samples};
  const float reach = options.unitFraction * scene.lights.region().diagonal();
  const ParticleNeighbours neighbours(sources, options.neighbours, reach);
  if (neighbours.empty()) return {};
  return neighbours.around(record.position, record.normal, record.tangent);
}

/// The light of paths as long as those of the training.
IncidentRadiance lightAt(const RenderScene& scene, const TrainedIllumination& illumination, const Receiver& receiver,
                         const ServedDensity& density) {
  const GuidedSampler sampler(scene.scene, illumination.field, nullptr);
  PathOptions pathOptions;
  pathOptions.maxDepth = illumination.maxDepth - 1;  // without the segment to the camera
  const GuidedIntegrator paths(scene, pathOptions, sampler);
  IncidentRadianceOptions options;
  options.cells = kCells;
  options.perCell = 16;
  return {scene, paths, receiver, density, options, 0};
}

std::string numbers(const Vec3& v) {
  return fmt::format("{:.4g} {:.4g} {:.4g}", v.x() + 0.0f, v.y() + 0.0f, v.z() + 0.0f);  // no -0
}

std::string nevOf(const IncidentRadiance& light, const std::function<double(const Vec3&)>& pdf) {
  const std::optional<double> nev = light.nev(pdf);
  return nev ? fmt::format("{:.3g}", *nev) : "none";
}

double degreesBetween(const Vec3& a, const Vec3& b) {
  return std::acos(std::clamp(a.dot(b), -1.0f, 1.0f)) * 180 / std::numbers::pi;
}

std::string captionOf(const Receiver& receiver, const ServedDensity& density, const IlluminationRecord& record,
                      const IncidentRadiance& light) {
  return fmt::format(
      "position {}  normal {}  radius {:.3g}  distance {:.3g}, angle {:.0f}  samples {:.0f}  gaussians {}  background "
      "{:.2f}  NEV {}  with half cosine {}",
      numbers(record.position), numbers(record.normal), record.radius,
      (receiver.point.position - record.position).norm(), degreesBetween(receiver.normal, record.normal),
      record.samples, record.count, record.background,
      nevOf(light, [&](const Vec3& wi) { return density.mixture(wi); }),
      nevOf(light, [&](const Vec3& wi) { return density.defensive(wi); }));
}

constexpr int kWidth = kPanelGap + kColumns * (kPanel + kPanelGap);
const char* const kLegend =
    "All panels: density over the disc of directions on one logarithmic scale  x: tangent, to the right  y: up  "
    "centre: "
    "normal  edge: horizon  red ellipses: one standard deviation of the Gaussians";

Raster paper(const std::string& caption) {
  const int lines = countLines(kWidth, caption) + countLines(kWidth, kLegend);
  return {kWidth, kPanelGap + kLine + kPanel + kPanelGap + kScaleHeight + kPanelGap + lines * kLine + kPanelGap,
          kPaper};
}

Panel panelAt(int column) {
  return {kPanelGap + column * (kPanel + kPanelGap), kPanelGap + kLine, {{0, 0}, kWholeDisc}};
}

struct Field {
  std::string title;
  DiscFunction density;
};

/// Draws all panels on the same scale.
void drawPanels(Raster& raster, const std::array<Field, kColumns>& fields) {
  double peak = 0;
  for (int i = 0; i < kColumns; ++i) peak = std::max(peak, largest(panelAt(i), fields[i].density));
  for (int i = 0; i < kColumns; ++i) {
    drawText(raster, panelAt(i).left, kPanelGap, fields[i].title, kInk);
    drawDensity(raster, panelAt(i), fields[i].density, peak, kRecordDecades);
    drawScale(raster, panelAt(i).left, panelAt(i).top + kPanel + kPanelGap, sequentialColour,
              scaleLabels(peak, kRecordDecades));
  }
}

void drawCaption(Raster& raster, const std::string& caption) {
  const int top = kPanelGap + kLine + kPanel + kPanelGap + kScaleHeight + kPanelGap;
  drawLines(raster, drawLines(raster, top, caption), kLegend);
}

}  // namespace

Receiver receiverAt(const RenderScene& scene, const RayCamera& camera, int x, int y) {
  if (x < 0 || y < 0 || x >= camera.width() || y >= camera.height())
    throw NoRecord(fmt::format("the image has {}x{} pixels", camera.width(), camera.height()));
  const Vec2 middle(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
  const std::optional<Receiver> receiver = firstReceiver(scene, camera.rayThrough(middle));
  if (!receiver) throw NoRecord("no surface that scatters light is visible there");
  return *receiver;
}

RecordView viewRecord(const RenderScene& scene, const Receiver& receiver, const TrainedIllumination& illumination,
                      const FieldOptions& options) {
  const ServedDensity density(cacheOf(illumination.field), receiver);
  if (!density.record()) throw NoRecord(fmt::format("no record serves the point {}", numbers(receiver.point.position)));
  const IlluminationRecord record = cacheOf(illumination.field).unpacked(*density.record());

  const Neighbourhood around = neighbourhoodOf(record, scene, illumination, options);
  Histogram particles, truth;
  for (const WeightedPoint& p : around.points) particles.add(p.y, p.weight);
  const IncidentRadiance light = lightAt(scene, illumination, receiver, density);
  for (const IncidentRadiance::Sample& s : light.samples())
    truth.add(toDisc(density.frame().toLocal(s.wi)), 0.5 * (s.first + s.second) / s.density);

  const std::string caption = captionOf(receiver, density, record, light);
  RecordView view{paper(caption), caption};
  drawPanels(view.raster,
             {{{"mixture", [&](const Vec2& y) { return 2.0 * density.mixture(density.frame().toWorld(fromDisc(y))); }},
               {around.points.empty() ? "particles: not kept" : fmt::format("particles: {}", around.points.size()),
                [&](const Vec2& y) { return particles.density(y); }},
               {"path-traced reference", [&](const Vec2& y) { return truth.density(y); }}}});
  drawEllipses(view.raster, panelAt(0), record.gaussians());
  drawCaption(view.raster, view.caption);
  return view;
}

}  // namespace lobe
