// Materials of the RGL database: tables adapted to the visible normals (Dupuy and Jakob 2018, "An Adaptive
// Parameterization for Efficient Material Acquisition and Rendering"), in the rgb variant of its files.
//
// The direction ω_i that parameterises the tables of the files is wo here.

#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "materials/lobes/bilinear_warp.h"
#include "materials/lobes/measured_lobe.h"
#include "materials/lobes/tensor_file.h"

namespace lobe {
namespace {

constexpr double kPiD = std::numbers::pi;

/// The tables contain values times the cosine of wi and are interpolated across the horizon. Close to the horizon,
/// where nothing can be measured, division by the cosine would be unbounded, so the divisor is at least this (0.6
/// degrees). The albedo changes by less than 1 in 300, and mixtures fitted to the BRDF do not use Gaussians for the
/// horizon.
constexpr double kLeastCosine = 1e-2;

struct MeasuredTables {
  ParameterNodes nodes;
  bool isotropic;
  /// Full circle over the range of measured azimuths: 1, or 2 or 4 for symmetric materials.
  int symmetry;
  BilinearWarp visible;    ///< density of visible half vectors over their square
  BilinearWarp luminance;  ///< over the square from which visible is sampled
  TableSize colourSize;
  std::vector<Eigen::Array3f> colours;  ///< over the same square
  /// Density D of half vectors over their square, and projected area σ of the microsurface over the square of wo; empty
  /// if the colours already contain the factor D / 4σ.
  TableSize normalSize, areaSize;
  std::vector<float> normals, areas;
};

class RglLobe final : public MeasuredLobe {
 public:
  RglLobe(std::string name, std::uint64_t contentHash, MeasuredTables tables)
      : MeasuredLobe(std::move(name), contentHash), tables_(std::move(tables)) {}

  LobeKind kind() const override { return tables_.isotropic ? LobeKind::isotropic : LobeKind::anisotropic; }
  std::string model() const override { return "measured"; }

 private:
  /// A viewing direction in terms of the tables.
  struct View {
    TableBlend blend;
    Spherical wo;
    double azimuth;  ///< origin of the azimuth of half vectors
  };

  View viewOf(const Eigen::Vector3d& wo) const {
    const Spherical at = spherical(wo);
    const double phi = tables_.isotropic ? tables_.nodes.first().front() : at.phi;
    return {tables_.nodes.at(phi, at.theta), at, tables_.isotropic ? at.phi : 0.0};
  }

  /// The signs that mirror wo, by the material's symmetry, into the range of measured azimuths.
  Eigen::Vector2d mirrors(const Eigen::Vector3d& wo) const {
    if (tables_.symmetry == 1) return {1.0, 1.0};
    const double y = wo.y() > 0.0 ? -1.0 : 1.0;
    return {tables_.symmetry == 4 ? (wo.x() > 0.0 ? -1.0 : 1.0) : y, y};
  }
  static Eigen::Vector3d mirrored(const Eigen::Vector3d& w, const Eigen::Vector2d& mirrors) {
    return {w.x() * mirrors.x(), w.y() * mirrors.y(), w.z()};
  }

  Rgb measured(const Directions& directions) const override {
    const Eigen::Vector2d mirrors = this->mirrors(directions.wo);
    const View view = viewOf(mirrored(directions.wo, mirrors));
    const Eigen::Vector2d half = halfVectorToSquare(mirrored(directions.half, mirrors), view.azimuth);
    const Eigen::Vector2d place = tables_.visible.invert(half, view.blend).point;
    const TableCell cell(tables_.colourSize, place);
    const Eigen::Array3d colour = cell.interpolate([&](std::size_t x, std::size_t y) {
      const std::size_t node = y * tables_.colourSize.width + x;
      return view.blend([&](std::size_t table) -> Eigen::Array3d {
        return tables_.colours[table * tables_.colourSize.nodes() + node].cast<double>();
      });
    });
    const double scale = factor(half, view.wo) / std::max(directions.wi.z(), kLeastCosine);
    return (colour.max(0.0) * scale).cast<float>();
  }

  /// D / 4σ, by which the colours of files with a Jacobian have been divided.
  double factor(const Eigen::Vector2d& half, const Spherical& wo) const {
    if (tables_.normals.empty()) return 1.0;
    const auto look = [](const std::vector<float>& values, const TableSize& size, const Eigen::Vector2d& point) {
      return TableCell(size, point).interpolate([&](std::size_t x, std::size_t y) {
        return static_cast<double>(values[y * size.width + x]);
      });
    };
    const Eigen::Vector2d at(std::sqrt(wo.theta * (2.0 / kPiD)), wo.phi / (2.0 * kPiD) + 0.5);
    return look(tables_.normals, tables_.normalSize, half) / (4.0 * look(tables_.areas, tables_.areaSize, at));
  }

  Eigen::Vector3d sampleHalfVector(const Eigen::Vector3d& wo, const Eigen::Vector2d& u) const override {
    const Eigen::Vector2d mirrors = this->mirrors(wo);
    const View view = viewOf(mirrored(wo, mirrors));
    const WarpPoint bright = tables_.luminance.sample(u, view.blend);
    const WarpPoint half = tables_.visible.sample(bright.point, view.blend);
    return mirrored(squareToHalfVector(half.point, view.azimuth), mirrors);
  }

  double halfVectorDensity(const Eigen::Vector3d& wo, const Eigen::Vector3d& half) const override {
    const Eigen::Vector2d mirrors = this->mirrors(wo);
    const View view = viewOf(mirrored(wo, mirrors));
    const WarpPoint place =
        tables_.visible.invert(halfVectorToSquare(mirrored(half, mirrors), view.azimuth), view.blend);
    return place.density * tables_.luminance.density(place.point, view.blend) / halfVectorJacobian(half);
  }

  MeasuredTables tables_;
};

/// Converts the fields of a file to tables and rejects inconsistent files.
class TableReader {
 public:
  explicit TableReader(const TensorFile& file)
      : file_(file), nodes_(axis("phi_i", 2.0 * kPiD), axis("theta_i", 0.5 * kPiD)) {}

  MeasuredTables read() const {
    const std::vector<float>& phi = nodes_.first();
    const bool isotropic = phi.size() <= 2;
    TableSize visibleSize{}, luminanceSize{};
    std::vector<float> visible = perView("vndf", 4, visibleSize).values;
    std::vector<float> luminance = perView("luminance", 4, luminanceSize).values;
    MeasuredTables tables{nodes_,
                          isotropic,
                          isotropic ? 1 : symmetryOf(phi.back() - phi.front()),
                          BilinearWarp(visibleSize, clamped(std::move(visible))),
                          BilinearWarp(luminanceSize, clamped(std::move(luminance))),
                          {},
                          {},
                          {},
                          {},
                          {},
                          {}};
    tables.colours = colours(tables.colourSize);
    if (file_.bytes("jacobian", 1).values.front() != 0) {
      tables.normals = clamped(plane("ndf", tables.normalSize));
      tables.areas = plane("sigma", tables.areaSize);
      constexpr float kLeastArea = 1e-9f;
      if (std::ranges::min(tables.areas) < kLeastArea)
        file_.fail("sigma", fmt::format("contains areas that are not positive or below {:g}", kLeastArea));
    }
    return tables;
  }

 private:
  std::vector<float> axis(const std::string& name, double longest) const {
    std::vector<float> nodes = file_.floats(name, 1).values;
    for (std::size_t i = 1; i < nodes.size(); ++i)
      if (!(nodes[i] > nodes[i - 1])) file_.fail(name, "is not strictly ascending");
    if (nodes.back() - nodes.front() > longest + 1e-3) file_.fail(name, "spans a larger range than the angle can have");
    return nodes;
  }

  int symmetryOf(double span) const {
    const int symmetry = static_cast<int>(std::lround(2.0 * kPiD / span));
    if (symmetry != 1 && symmetry != 2 && symmetry != 4)
      file_.fail("phi_i", "spans neither a full circle nor half or a quarter of one");
    return symmetry;
  }

  /// The last two dimensions are y and x.
  TableSize sizeOf(const std::string& name, const std::vector<std::size_t>& shape) const {
    const TableSize size{shape.back(), shape[shape.size() - 2]};
    if (size.width < 2 || size.height < 2)
      file_.fail(name, fmt::format("has tables of {}×{}, but at least 2×2 are needed", size.width, size.height));
    return size;
  }

  Tensor<float> perView(const std::string& name, std::size_t dimensions, TableSize& size) const {
    Tensor<float> tensor = file_.floats(name, dimensions);
    if (tensor.shape[0] != nodes_.first().size() || tensor.shape[1] != nodes_.second().size())
      file_.fail(name, fmt::format("has {}×{} tables, but phi_i and theta_i require {}×{}", tensor.shape[0],
                                   tensor.shape[1], nodes_.first().size(), nodes_.second().size()));
    size = sizeOf(name, tensor.shape);
    return tensor;
  }

  std::vector<float> plane(const std::string& name, TableSize& size) const {
    Tensor<float> tensor = file_.floats(name, 2);
    size = sizeOf(name, tensor.shape);
    return std::move(tensor.values);
  }

  std::vector<Eigen::Array3f> colours(TableSize& size) const {
    const Tensor<float> rgb = perView("rgb", 5, size);
    if (rgb.shape[2] != 3) file_.fail("rgb", fmt::format("has {} colours, but 3 are needed", rgb.shape[2]));
    std::vector<Eigen::Array3f> result(nodes_.tables() * size.nodes());
    for (std::size_t i = 0; i < result.size(); ++i) {
      const float* const first = rgb.values.data() + i / size.nodes() * 3 * size.nodes() + i % size.nodes();
      result[i] = {first[0], first[size.nodes()], first[2 * size.nodes()]};
    }
    return result;
  }

  /// Removes the small negative values that measurement and compression cause.
  static std::vector<float> clamped(std::vector<float> values) {
    for (float& value : values) value = std::max(value, 0.0f);
    return values;
  }

  const TensorFile& file_;
  ParameterNodes nodes_;
};

std::shared_ptr<const MeasuredLobe> readRgl(const std::filesystem::path& path) {
  const TensorFile file(path);
  if (!file.has("rgb") && (file.has("spectra") || file.has("wavelengths")))
    file.fail("this is the spectral variant; the rgb variant of the material (name_rgb.bsdf) is needed");
  return std::make_shared<RglLobe>(path.stem().string(), file.hash(), TableReader(file).read());
}

}  // namespace

BsdfPtr makeMeasured(const Parameters& parameters) {
  return makeMeasuredFrom(parameters, readRgl);
}

}  // namespace lobe
