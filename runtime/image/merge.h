#pragma once
// Pictures of the same scene made in parts, put together.

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "runtime/image/image_output.h"

namespace lobe {

/// Samples [first, last) of every pixel's random stream, of one seed and integrator: the same range again is no news.
struct SampleRange {
  std::string integrator;
  std::uint64_t seed;
  std::uint64_t first, last;
};

/// The ranges that a picture's attributes tell of, in no order: sampleRanges (of one that was merged), or else the one
/// of integrator, seed, sampleOffset (0 when missing) and samples; empty when they do not say. Throws
/// std::runtime_error when sampleRanges is not as mergeImages writes it.
std::vector<SampleRange> sampleRanges(const ImageAttributes& attributes);

struct MergedImage {
  Image image;
  ImageAttributes attributes;
};

/// The mean of pictures weighted by their samples a pixel. Of attributes those are kept that all have in common;
/// samples is the sum, and what is known of ranges is seed and sampleOffset when they join to one, else sampleRanges.
/// So a merged picture can be merged again. Throws std::runtime_error that names the file, or two, when a picture does
/// not say how many samples it has, sizes differ, or two hold samples of the same range.
MergedImage mergeImages(std::span<const std::filesystem::path> paths);

}  // namespace lobe
