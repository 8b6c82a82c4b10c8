#include "scenes/mitsuba/findings.h"

#include <algorithm>
#include <numeric>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace lobe {
namespace {

constexpr std::size_t kMostLines = 10;
/// Limit on kinds of faults: a file with more of them is probably not a scene.
constexpr std::size_t kMostKinds = 10000;
/// Limit on the bytes of a message, for which the longest message about a sound scene leaves much room.
constexpr std::size_t kLongestMessage = 4000;

std::string andMore(std::size_t count) {
  return count > 1 ? fmt::format(" ({} more of this kind)", count - 1) : "";
}

std::size_t total(const std::vector<Fault>& faults) {
  return std::accumulate(faults.begin(), faults.end(), std::size_t{0},
                         [](std::size_t sum, const Fault& fault) { return sum + fault.count; });
}

/// Whether lenient reading tolerates all of them.
bool areTolerable(const std::vector<Fault>& faults) {
  return std::ranges::none_of(faults, [](const Fault& fault) { return fault.consequence.empty(); });
}

std::string describe(const std::vector<Fault>& faults) {
  if (faults.empty()) return "it depends on something that has a fault";
  if (faults.size() == 1) return faults.front().text();
  const std::size_t shown = std::min(kMostLines, faults.size());
  std::string lines;
  for (std::size_t i = 0; i < shown; ++i) lines += faults[i].text() + '\n';
  const std::string rest =
      shown < faults.size() ? fmt::format("; --check shows the other {}", faults.size() - shown) : "";
  return lines + fmt::format("{} faults of {} kinds{}{}", total(faults), faults.size(), rest,
                             areTolerable(faults) ? "; --lenient reads what can be read" : "");
}

}  // namespace

std::string shortened(std::string_view text, std::size_t most) {
  if (text.size() <= most) return std::string(text);
  const auto continuesCharacter = [&](std::size_t i) { return (text[i] & 0xc0) == 0x80; };
  while (most > 0 && continuesCharacter(most)) --most;
  return std::string(text.substr(0, most)) + "...";
}

std::string Fault::text() const {
  const std::string hint = consequence.empty() ? "" : fmt::format(" (with --lenient, {})", consequence);
  return fmt::format("{}: {}{}{}", where, message, hint, andMore(count));
}

SceneError::SceneError(std::string where, std::string message)
    : SceneError(std::vector{Fault{std::move(where), shortened(message, kLongestMessage), ""}}) {}

SceneError::SceneError(std::vector<Fault> all) : std::runtime_error(describe(all)), faults_(std::move(all)) {}

void Findings::fault(std::string where, const std::string& kind, const std::string& message,
                     const std::string& consequence) {
  std::string key = shortened(kind, kLongestMessage);
  if (faults_.size() >= kMostKinds && !faultOfKind_.contains(key)) return leaveOut(std::move(where));
  const auto [entry, isNew] = faultOfKind_.try_emplace(std::move(key), faults_.size());
  // Some elements are read twice, and report the same fault again.
  if (!places_.emplace(entry->second, where).second) return;
  if (isNew)
    faults_.push_back({std::move(where), shortened(message, kLongestMessage), shortened(consequence, kLongestMessage)});
  else
    ++faults_[entry->second].count;
}

/// Lenient reading does not tolerate this, because it reports everything that it leaves out.
void Findings::leaveOut(std::string where) {
  if (faults_.size() > kMostKinds)
    ++faults_.back().count;
  else
    faults_.push_back({std::move(where),
                       fmt::format("at most {} kinds of faults are listed, and this is another one", kMostKinds), ""});
}

void Findings::warn(const std::string& where, const std::string& kind, const std::string& message) {
  const auto [entry, isNew] = warningOfKind_.try_emplace(shortened(kind, kLongestMessage), warnings_.size());
  if (isNew) warnings_.push_back({where, shortened(message, kLongestMessage), 0});
  Warning& warning = warnings_[entry->second];
  // An element that is read twice repeats its warnings.
  if (warning.count == 0 || warning.where != where) ++warning.count;
}

void Findings::note(std::string text) {
  text = shortened(text, kLongestMessage);
  if (knownNotes_.insert(text).second) notes_.push_back(std::move(text));
}

void Findings::noteWithoutEffect(const std::string& owner, const std::string& parameter) {
  if (!knownWithoutEffect_.emplace(owner, parameter).second) return;
  const auto [entry, isNew] = withoutEffectOf_.try_emplace(owner, withoutEffect_.size());
  if (isNew) withoutEffect_.push_back({owner, {}});
  withoutEffect_[entry->second].parameters.push_back(parameter);
}

std::vector<std::string> Findings::warnings() const {
  std::vector<std::string> lines;
  for (const Warning& warning : warnings_)
    lines.push_back(fmt::format("{}: {}{}", warning.where, warning.message, andMore(warning.count)));
  return lines;
}

std::vector<std::string> Findings::notes() const {
  std::vector<std::string> lines = notes_;
  if (withoutEffect_.empty()) return lines;
  std::vector<std::string> parts;
  for (const auto& [owner, parameters] : withoutEffect_)
    parts.push_back(fmt::format("{} of {}", fmt::join(parameters, ", "), owner));
  lines.push_back(fmt::format("parameters without effect on the picture: {}", fmt::join(parts, "; ")));
  return lines;
}

}  // namespace lobe
