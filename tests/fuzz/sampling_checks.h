#pragma once
// Samples with files that a reader has accepted: whatever they contain, densities must be finite and not negative, or
// pictures would have invalid pixels.

#include <filesystem>

#include "lobe/field.h"
#include "scenes/scene.h"

namespace lobe::fuzz {

/// Samples the product of the BRDF cache and a fixed illumination. Ends the program if a density or a direction is
/// invalid. path: the cache, which is renamed to the name that is expected for its lobe.
void checkSamplingOfLobe(const std::filesystem::path& path);

/// The same at some records of the field, for a diffuse surface.
void checkSamplingOfField(const Field& field);

/// Samples the smooth parts of all materials of the scene, with the same checks.
void checkSamplingOfMaterials(const Scene& scene);

}  // namespace lobe::fuzz
