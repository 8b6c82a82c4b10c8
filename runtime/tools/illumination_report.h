#pragma once
// What lobedump says of trained illumination, for people, machines and viewers of point clouds.

#include <cstdio>
#include <filesystem>

#include <nlohmann/json_fwd.hpp>

#include "schema/illumination_file.h"

namespace lobe {

/// Scene, settings, records and the distributions of what they hold; with every record and its components when
/// withRecords.
nlohmann::ordered_json toJson(const IlluminationFile& file, const std::filesystem::path& path, bool withRecords);

/// The same as lines of text and a table of quantiles.
void printIllumination(const IlluminationFile& file, const std::filesystem::path& path, std::FILE* out);

/// A row for every record.
void printRecords(const IlluminationFile& file, std::FILE* out);

/// The records as a binary PLY: x y z, nx ny nz, radius, samples, background. Throws std::runtime_error that names out.
void writePoints(const IlluminationFile& file, const std::filesystem::path& out);

}  // namespace lobe
