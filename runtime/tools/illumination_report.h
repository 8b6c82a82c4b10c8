#pragma once
// Reports on trained illumination by lobedump, as text, JSON and point clouds.

#include <cstdio>
#include <filesystem>

#include <nlohmann/json_fwd.hpp>

#include "schema/illumination_file.h"

namespace lobe {

/// Scene, settings, and the distributions of the fields of the records; with withRecords also every record and its
/// components.
nlohmann::ordered_json toJson(const IlluminationFile& file, const std::filesystem::path& path, bool withRecords);

/// Prints the same as text with a table of quantiles.
void printIllumination(const IlluminationFile& file, const std::filesystem::path& path, std::FILE* out);

/// Prints a row for every record.
void printRecords(const IlluminationFile& file, std::FILE* out);

/// Writes the records as vertices of a binary PLY file: x y z, nx ny nz, radius, samples, background, bsdf_fraction,
/// likelihood_gain.
/// Throws std::runtime_error that names the file.
void writePoints(const IlluminationFile& file, const std::filesystem::path& out);

}  // namespace lobe
