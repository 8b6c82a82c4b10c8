#pragma once
// Writes scene files for tests and reads them.

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "scenes/mitsuba/reader.h"

namespace lobe {

/// A temporary folder that is removed after the test.
class TestFolder {
 public:
  TestFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "lobe-scenes-XXXXXX").string();
    if (!mkdtemp(name.data())) throw std::runtime_error("cannot create a folder for the test");
    path_ = name;
  }
  ~TestFolder() { std::filesystem::remove_all(path_); }
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;

  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::ofstream(path_ / name, std::ios::binary) << text;
    return path_ / name;
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

inline constexpr const char* kSensor = "<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/></sensor>";

/// A scene whose body starts at line 2, column 1, followed by a sensor.
inline std::string sceneOf(const std::string& body) {
  return "<scene version=\"3.0.0\">\n" + body + "\n" + kSensor + "\n</scene>\n";
}

inline Scene readText(const std::string& text, const ReadOptions& options = {}) {
  const TestFolder folder;
  return readScene(folder.write("test.xml", text), options);
}

inline Scene readBody(const std::string& body, const ReadOptions& options = {}) {
  return readText(sceneOf(body), options);
}

/// The message of the SceneError that reading throws, without the folder: "test.xml:LINE:COLUMN: ..."; empty when there
/// is none.
inline std::string faultOfText(const std::string& text, const ReadOptions& options = {}) {
  const TestFolder folder;
  try {
    readScene(folder.write("test.xml", text), options);
  } catch (const SceneError& error) {
    const std::string message = error.what();
    const std::string prefix = folder.path().string() + "/";
    return message.starts_with(prefix) ? message.substr(prefix.size()) : message;
  }
  return "";
}

inline std::string faultOf(const std::string& body, const ReadOptions& options = {}) {
  return faultOfText(sceneOf(body), options);
}

inline ReadOptions lenient() {
  ReadOptions options;
  options.lenient = true;
  return options;
}

}  // namespace lobe
