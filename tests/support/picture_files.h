#pragma once
// The bytes of image files, which the encoders of stb_image_write write.

#include <cstdint>
#include <string>
#include <vector>

namespace lobe::test {

/// type: png, bmp, tga or jpg. codes: 8-bit RGB, row by row from the top.
std::string pictureFile(const std::string& type, int width, int height, const std::vector<std::uint8_t>& codes);

/// values: RGB, row by row from the top.
std::string hdrFile(int width, int height, const std::vector<float>& values);

/// RGB codes that compress badly.
std::vector<std::uint8_t> noiseCodes(int width, int height);

}  // namespace lobe::test
