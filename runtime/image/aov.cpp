#include "runtime/image/aov.h"

#include <fmt/format.h>

namespace lobe {
namespace {

constexpr std::array<const char*, kAovNames.size()> kComponents{"RGB", "XYZ", "Z", "RGB", "Y"};

std::string componentsOf(Aov aov) {
  return kComponents[static_cast<std::size_t>(aov)];
}

std::string nameOf(Aov aov) {
  return kAovNames[static_cast<std::size_t>(aov)];
}

}  // namespace

std::vector<ImageLayer> layersOf(const Aovs& aovs) {
  std::vector<ImageLayer> layers;
  for (const auto& [aov, image] : aovs)
    layers.push_back({nameOf(aov), componentsOf(aov), image, aov != Aov::albedo && aov != Aov::normal});
  return layers;
}

Aovs readAovs(const std::filesystem::path& path) {
  Aovs aovs;
  for (std::size_t i = 0; i < kAovNames.size(); ++i) {
    const Aov aov = static_cast<Aov>(i);
    std::array<std::string, 3> channels;
    for (std::size_t c = 0; c < channels.size(); ++c)
      channels[c] = fmt::format("{}.{}", nameOf(aov), componentsOf(aov)[c % componentsOf(aov).size()]);
    if (std::optional<Image> image = readChannels(path, channels)) aovs.emplace(aov, std::move(*image));
  }
  return aovs;
}

}  // namespace lobe
