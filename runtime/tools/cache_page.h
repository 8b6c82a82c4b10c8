#pragma once
// An interactive HTML page of BRDF caches or of trained illumination. It needs no other file and no network.

#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "materials/lobe.h"
#include "schema/illumination_file.h"
#include "schema/lobe_cache.h"

namespace lobe {

/// A cache on the page. lobe: the one that it was fitted to, for target and ratio; may be null.
struct PagedCache {
  const LobeCache* cache;
  std::filesystem::path path;
  const Lobe* lobe;
};

/// The page shows the record that serves a chosen outgoing direction: target, fit and their ratio over the disc of
/// incident directions, the components, and the grades. Targets and ratios are stored for every record as grids of
/// cells, which are coarser for caches of many records. They take at most 8 MB of the page for each cache of up to 5800
/// records; beyond that they have 16 × 16 cells, and take 1.4 kB for each record. Records are evaluated in parallel;
/// advance is called after each of them, from any thread.
std::string lobePage(std::span<const PagedCache> caches, const std::function<void()>& advance);

/// The page shows a map of the records in the scene, and the mixture of the selected one. paths: of the files.
std::string illuminationPage(std::span<const IlluminationFile> files, std::span<const std::string> paths);

}  // namespace lobe
