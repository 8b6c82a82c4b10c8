#pragma once
// Merges renders of the same scene with different samples.

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "runtime/image/aov.h"

namespace lobe {

/// Samples [first, last) of every pixel's random stream, for one seed and integrator. Rendering the same range again
/// gives the same samples.
struct SampleRange {
  std::string integrator;
  std::uint64_t seed;
  std::uint64_t first, last;
};

/// The sample ranges recorded in the attributes of an image, in any order: those of sampleRanges (merged images),
/// otherwise the range given by integrator, seed, sampleOffset (default 0) and samples; empty if these are missing.
/// Throws std::runtime_error if sampleRanges does not have the format that mergeImages writes.
std::vector<SampleRange> sampleRanges(const ImageAttributes& attributes);

/// Throws std::runtime_error that names both files if they have samples of the same seed, as their attributes say. Such
/// images are not independent. Does nothing for images without these attributes.
void checkDifferentSeeds(const std::filesystem::path& a, const std::filesystem::path& b);

/// The samples per pixel of an image. Throws std::runtime_error that names the file if it does not record them.
double samplesOf(const std::filesystem::path& path);

struct MergedImage {
  Image image;
  ImageAttributes attributes;
  Aovs aovs;
};

/// The mean of the images weighted by their samples per pixel. Attributes that all images have in common are kept, and
/// samples is the sum. fireflyCut and clampedFraction are combined; if parts have different limits, fireflyLimit is
/// dropped as any attribute that differs. Reconstructions from gradients in L2 are linear in the samples, except for
/// the replacement of negative pixels, so that their mean is an image of all samples. AOVs that all images have in
/// common are those of all samples together, up to rounding: means of albedo and normal, the smallest depth, the sum of
/// the samples, and the variance of the pixel, to which the differences between the images add. The ranges are stored
/// as seed and sampleOffset if they form one range, otherwise as sampleRanges, so that a merged image can be merged
/// again. Throws std::runtime_error that names the file or files if an image does not record its number of samples,
/// sizes or scenes differ, two images contain samples of the same range, or an image was reconstructed in L1, which is
/// biased.
MergedImage mergeImages(std::span<const std::filesystem::path> paths);

/// The variance of each pixel and channel of the merged image, from the differences between its parts, which must have
/// different seeds. Throws std::runtime_error like mergeImages, and if there are fewer than two parts or two parts have
/// the same seed.
Image varianceOfMerged(std::span<const std::filesystem::path> paths, const Image& merged);

}  // namespace lobe
