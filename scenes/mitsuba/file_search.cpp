#include "scenes/mitsuba/file_search.h"

#include <algorithm>
#include <cctype>
#include <iterator>
#include <system_error>

#include "runtime/core/parallel.h"

namespace lobe {
namespace {

std::string lowerCase(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace

bool pathExists(const std::filesystem::path& path) {
  std::error_code error;
  return std::filesystem::exists(path, error);
}

bool FileSearch::add(const std::filesystem::path& folder) {
  std::error_code error;
  Folder added{folder, std::filesystem::canonical(folder, error)};
  if (error || !std::filesystem::is_directory(added.canonical, error)) return false;
  const auto known =
      std::ranges::find_if(folders_, [&](const Folder& f) { return f.canonical.native() == added.canonical.native(); });
  if (known == folders_.end())
    folders_.push_back(std::move(added));
  else
    std::rotate(known, known + 1, folders_.end());
  results_.clear();
  return true;
}

void FileSearch::clear() {
  folders_.clear();
  results_.clear();
}

const FileSearch::Result& FileSearch::find(const std::string& name) {
  if (const auto known = results_.find(name); known != results_.end()) return known->second;
  return results_.emplace(name, search(name)).first->second;
}

FileSearch::Result FileSearch::search(const std::string& name) {
  std::vector<std::filesystem::path> folders;
  std::transform(folders_.rbegin(), folders_.rend(), std::back_inserter(folders),
                 [](const Folder& folder) { return folder.path; });
  folders.push_back(own_);
  for (const std::filesystem::path& folder : folders) {
    throwIfCancelled();
    if (exists(folder, name)) return {folder / name, {}};
  }
  for (const std::filesystem::path& folder : folders) {
    throwIfCancelled();
    if (std::optional<std::filesystem::path> similar = fileOfSimilarName(folder, name))
      return {std::move(*similar), folder / name};
  }
  return {own_ / name, {}};
}

/// Whether there is such a file. A name that is not similar to any in the listing of the folder, if that has been made,
/// is not looked up in the file system, because there may be many of them.
bool FileSearch::exists(const std::filesystem::path& folder, const std::string& name) const {
  const bool isPlain = !name.empty() && name != "." && name != ".." && name.find('/') == std::string::npos;
  if (isPlain) {
    const auto known = listings_.find(folder.native());
    if (known != listings_.end() && known->second.isComplete && !known->second.names.contains(lowerCase(name)))
      return false;
  }
  return pathExists(folder / name);
}

/// The file that the name matches when case and the difference between '/' and '\\' are ignored, as on Windows; nullopt
/// unless there is exactly one.
std::optional<std::filesystem::path> FileSearch::fileOfSimilarName(std::filesystem::path folder, std::string name) {
  std::ranges::replace(name, '\\', '/');
  for (const std::filesystem::path& part : std::filesystem::path(name)) {
    if (part.empty() || part == "." || part == ".." || part == "/" || exists(folder, part.string())) {
      folder /= part;
      continue;
    }
    const std::optional<std::string> next = similarEntry(folder, part.string());
    if (!next || !pathExists(folder / *next)) return std::nullopt;
    folder /= *next;
  }
  return folder;
}

/// Makes the listing if there is none yet.
const FileSearch::Listing& FileSearch::listingOf(const std::filesystem::path& folder) {
  if (const auto known = listings_.find(folder.native()); known != listings_.end()) return known->second;
  Listing listing;
  std::error_code error;
  std::filesystem::directory_iterator entry(folder.empty() ? "." : folder, error);
  for (; !error && entry != std::filesystem::directory_iterator(); entry.increment(error)) {
    throwIfCancelled();
    const std::string found = entry->path().filename().string();
    listing.names.emplace(lowerCase(found), found);
  }
  listing.isComplete = !error;
  return listings_.emplace(folder.native(), std::move(listing)).first->second;
}

/// The only entry of the folder whose name differs at most in case.
std::optional<std::string> FileSearch::similarEntry(const std::filesystem::path& folder, const std::string& name) {
  const auto [first, last] = listingOf(folder).names.equal_range(lowerCase(name));
  return first != last && std::next(first) == last ? std::optional(first->second) : std::nullopt;
}

}  // namespace lobe
