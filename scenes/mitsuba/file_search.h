#pragma once
// Looks for the files that a scene names.

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

namespace lobe {

/// Whether there is a file or folder of this name. There is none if the file system refuses the name (too long, a
/// circle of links, a folder without permission).
bool pathExists(const std::filesystem::path& path);

/// The folders in which files are looked for. What has been found, or not found, is remembered, so that many names in
/// many folders do not take long.
class FileSearch {
 public:
  /// own: the folder of the scene, in which files are looked for last.
  explicit FileSearch(std::filesystem::path own) : own_(std::move(own)) {}

  /// Files will be looked for in this folder first. Returns false if there is no such folder.
  bool add(const std::filesystem::path& folder);
  /// Removes all folders except the scene's own one.
  void clear();

  struct Result {
    std::filesystem::path path;    ///< if there is no file, where it would be in the scene's own folder
    std::filesystem::path wanted;  ///< where a file was looked for that differs in case or slashes; otherwise empty
  };
  /// Throws LoopCancelled.
  const Result& find(const std::string& name);

 private:
  struct Folder {
    std::filesystem::path path, canonical;
  };
  /// The names in a folder.
  struct Listing {
    std::unordered_multimap<std::string, std::string> names;  ///< by their spelling in lower case
    bool isComplete = true;                                   ///< false if the folder cannot be read
  };

  Result search(const std::string& name);
  bool exists(const std::filesystem::path& folder, const std::string& name) const;
  std::optional<std::filesystem::path> fileOfSimilarName(std::filesystem::path folder, std::string name);
  const Listing& listingOf(const std::filesystem::path& folder);
  std::optional<std::string> similarEntry(const std::filesystem::path& folder, const std::string& name);

  std::filesystem::path own_;
  std::vector<Folder> folders_;
  std::map<std::string, Result> results_;              // by name, for these folders
  std::unordered_map<std::string, Listing> listings_;  // by path
};

}  // namespace lobe
