#include "runtime/tools/exr_options.h"

#include <array>
#include <utility>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "runtime/tools/option_names.h"
#include "runtime/tools/tool.h"

namespace lobe {
namespace {

using Compression = ExrFormat::Compression;

constexpr std::array<std::pair<const char*, Compression>, 7> kCompressions{{{"none", Compression::none},
                                                                            {"rle", Compression::rle},
                                                                            {"zips", Compression::zips},
                                                                            {"zip", Compression::zip},
                                                                            {"piz", Compression::piz},
                                                                            {"dwaa", Compression::dwaa},
                                                                            {"dwab", Compression::dwab}}};

const char* nameOf(Compression compression) {
  return kCompressions[static_cast<std::size_t>(compression)].first;
}

}  // namespace

std::vector<CLI::Option*> addExrOptions(CLI::App& app, ExrFormat& format) {
  using Type = ExrFormat::Type;
  static const std::vector<std::pair<std::string, Type>> types{{"float", Type::floats}, {"half", Type::halves}};
  return {
      app.add_option("--exr-type", format.type,
                     "Type of the pixels of .exr files: float (32 bits) or half (16 bits, values up to 65504); the "
                     "AOVs depth, variance and samples are always float")
          ->transform(oneOf(types))
          ->default_str("float"),
      app.add_option("--exr-compression", format.compression,
                     "Compression of .exr files: lossless, except for dwaa and dwab, which store values up to 32752")
          ->transform(oneOf(kCompressions))
          ->default_str("zip")};
}

void checkLossless(const ExrFormat& format, const std::set<Aov>& aovs) {
  if (format.isLossy() && (aovs.contains(Aov::variance) || aovs.contains(Aov::samples)))
    throw UsageError(fmt::format(
        "--exr-compression {} would change the AOVs variance and samples, because it takes them for colours; use zip",
        nameOf(format.compression)));
}

void noteClamped(const std::string& tool, const std::filesystem::path& path, std::size_t clamped,
                 const ExrFormat& format) {
  if (clamped == 0) return;
  const std::string option =
      format.isLossy() ? fmt::format("--exr-compression {}", nameOf(format.compression)) : "--exr-type half";
  printNote(tool, fmt::format("{}: {} values are too large for {}, and are stored as {}", path.string(), clamped,
                              option, format.isLossy() ? kLargestDwa : kLargestHalf));
}

}  // namespace lobe
