// Grades, plots and differences shown by lobedump.

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <sstream>

#include "fitter/disc_mass.h"
#include "fitter/lobe_fit.h"
#include "runtime/analysis/colour_map.h"
#include "runtime/analysis/text.h"
#include "runtime/core/atomic_file.h"
#include "runtime/image/image.h"
#include "runtime/mixture/grid.h"
#include "runtime/tools/cache_diff.h"
#include "runtime/tools/cache_page.h"
#include "runtime/tools/cache_plot.h"
#include "schema/illumination_file.h"
#include "tests/support/fitter_test_lobes.h"
#include "tests/support/json.h"
#include "tests/support/tool_run.h"

using namespace lobe;
using namespace lobe::test;
namespace fs = std::filesystem;

namespace {

/// f/p in units of ∫ f dω with an independent implementation of the defensive density.
double ratioAt(const Lobe& lobe, const Vec3& wo, const FittedRecord& fit, const Vec3& wi) {
  const double guided = mixturePdf(fit.mixture, toDisc(wi)) * wi.z() / fit.record.cosineMass / 2;
  const double p = 0.1 * lobe.pdf(wo, wi) + 0.9 * guided;
  return p > 0 ? lobe.eval(wo, wi) * wi.z() / fit.record.albedo / p : 0;
}

/// The sampler of another lobe with zero reflectance.
class BlackLobe : public Lobe {
 public:
  explicit BlackLobe(LobePtr lobe) : lobe_(std::move(lobe)) {}
  LobeKind kind() const override { return lobe_->kind(); }
  std::string model() const override { return "black"; }
  std::string key() const override { return "black"; }
  std::string summary() const override { return "black"; }
  int revision() const override { return 1; }
  double eval(const Vec3&, const Vec3&) const override { return 0; }
  std::optional<LobeSample> sample(const Vec3& wo, const Vec2& u) const override { return lobe_->sample(wo, u); }
  float pdf(const Vec3& wo, const Vec3& wi) const override { return lobe_->pdf(wo, wi); }

 private:
  LobePtr lobe_;
};

/// Writes and opens a cache with one record, for the only direction of its grid.
LobeCache singleRecord(const fs::path& path, const Lobe& lobe, const Gaussian& g) {
  LobeCacheInfo info;
  info.model = lobe.model();
  info.summary = lobe.summary();
  info.key = lobe.key();
  info.gridCount = 1;
  info.settings.samples = 1024;
  const DirectionGrid grid{GridKind::elevation, 1};
  CacheRecord record = fitLobe(lobe, grid.direction(0), info.settings).record;
  record.count = 1;
  record.cosineMass = static_cast<float>(discMass(std::span(&g, 1)).cosine);
  writeAtomically(path, encodeLobeCache(info, std::vector{record},
                                        std::vector{CacheComponent{1, g.meanX, g.meanY, g.cov.xx, g.cov.xy, g.cov.yy}},
                                        std::vector<std::uint32_t>{0}));
  return LobeCache::open(path);
}

/// Writes a cache with one record per direction of its grid: of one Gaussian where fitted is true, otherwise without a
/// mixture, that is, left to BSDF sampling.
void writePartlyFitted(const fs::path& path, const std::vector<bool>& fitted) {
  LobeCacheInfo info;
  info.model = info.key = info.summary = info.toolVersion = "partial";
  info.gridCount = static_cast<std::uint32_t>(fitted.size());
  const Gaussian g{1, 0, 0, {0.04f, 0, 0.04f}};
  std::vector<CacheRecord> records(fitted.size());
  std::vector<CacheComponent> components;
  std::vector<std::uint32_t> lookup(fitted.size());
  for (std::uint32_t i = 0; i < info.gridCount; ++i) {
    lookup[i] = i;
    CacheRecord& r = records[i];
    r.entry = i;
    r.integral = r.albedo = 0.9f;
    if (!fitted[i]) continue;
    r.first = static_cast<std::uint32_t>(components.size());
    r.count = 1;
    r.cosineMass = static_cast<float>(discMass(std::span(&g, 1)).cosine);
    components.push_back({1, g.meanX, g.meanY, g.cov.xx, g.cov.xy, g.cov.yy});
  }
  writeAtomically(path, encodeLobeCache(info, records, components, lookup));
}

/// Writes and opens a cache of a Fibonacci grid with these look-ups and as many records, which are left to BSDF
/// sampling.
LobeCache withLookups(const fs::path& path, const std::vector<std::uint32_t>& lookup, bool quarter) {
  LobeCacheInfo info;
  info.model = info.key = info.summary = info.toolVersion = "looked up";
  info.gridKind = static_cast<std::uint8_t>(GridKind::fibonacci);
  info.gridCount = static_cast<std::uint32_t>(lookup.size());
  info.quarter = quarter;
  std::vector<CacheRecord> records(lookup.size());
  for (std::uint32_t i = 0; i < info.gridCount; ++i) records[i].entry = i;
  writeAtomically(path, encodeLobeCache(info, records, {}, lookup));
  return LobeCache::open(path);
}

/// The records in the table that lobedump --plot prints: a line about the plot, a header, one line for each row.
std::vector<int> plottedRecords(const std::string& table) {
  std::istringstream lines(table);
  std::string line;
  std::getline(lines, line);
  std::getline(lines, line);
  std::vector<int> records;
  for (int row = 0, record = 0; std::getline(lines, line);)
    if (std::istringstream(line) >> row >> record) records.push_back(record);
  return records;
}

double lightness(const Colour& c) {
  return 0.3 * c[0] + 0.6 * c[1] + 0.1 * c[2];
}

const char* const kScene = R"(<scene version="0.6.0">
  <default name="alpha" value="0.2"/>
  <bsdf type="roughconductor" id="Iso"><float name="alpha" value="$alpha"/></bsdf>
  <bsdf type="roughconductor" id="Aniso"><float name="alphaU" value="0.1"/><float name="alphaV" value="0.3"/></bsdf>
  <shape type="sphere"><ref id="Iso"/></shape>
  <shape type="sphere"><ref id="Aniso"/></shape>
</scene>)";

/// A folder with caches of kScene: good.lobe and poor.lobe of the isotropic lobe, more.lobe the same on a finer grid,
/// other.lobe of the anisotropic lobe.
struct Caches : Folder {
  Caches() {
    writeAtomically(*this / "scene.xml", std::string(kScene));
    fit("good", "--elevations 8", 0);
    fit("poor", "--elevations 8 --components 2", 0);
    fit("more", "--elevations 16", 0);
    fit("other", "--elevations 8", 1);
  }
  ToolRun run(const std::string& arguments) const { return runBinary(path(), arguments); }

 private:
  void fit(const std::string& name, const std::string& options, std::uint8_t grid) const {
    const std::string folder = name + "-fit";
    REQUIRE(run("lobefit scene.xml --directions 8 --samples 256 -o " + folder + " " + options).code == 0);
    for (const auto& entry : fs::directory_iterator(*this / folder)) {
      if (LobeCache::open(entry.path()).info().gridKind == grid) fs::copy_file(entry.path(), *this / (name + ".lobe"));
    }
    fs::remove_all(*this / folder);
  }
};

}  // namespace

TEST_CASE("fitter: the worst f/p is the largest ratio over the disc at the reported direction") {
  for (const double elevation : {10.0, 60.0, 85.0}) {
    const LobePtr lobe = roughConductor(0.3, 0.3)->lobes().front();
    const auto theta = static_cast<float>(elevation * 3.14159265 / 180);
    const Vec3 wo(std::sin(theta), 0, std::cos(theta));
    FitSettings settings;
    settings.components = 2;  // a poor fit, so that the ratio is well above one
    const FittedRecord fit = fitLobe(*lobe, wo, settings);
    double largest = 0;
    for (int i = 0; i < 500; ++i) {
      for (int j = 0; j < 500; ++j) {
        const Vec2 y(static_cast<float>(i + 0.5) / 250 - 1, static_cast<float>(j + 0.5) / 250 - 1);
        if (insideDisc(y)) largest = std::max(largest, ratioAt(*lobe, wo, fit, fromDisc(y)));
      }
    }
    const Quality quality = gradeMixture(*lobe, wo, fit.mixture, settings.samples);
    CAPTURE(elevation, largest);
    CHECK(fit.record.worstRatio == static_cast<float>(quality.worst));
    CHECK(quality.worst > 1 + std::max(quality.nev, quality.coverage) - 0.02);
    CHECK(quality.worst <= 1.02 * largest);
    CHECK(quality.worst > 0.8 * largest);
    CHECK(ratioAt(*lobe, wo, fit, quality.worstAt) == Approx(quality.worst).epsilon(0.02));
  }
}

TEST_CASE("fitter: a lobe without reflectance has no worst f/p but can be plotted") {
  const Folder folder;
  const BlackLobe black(roughConductor(0.3, 0.3)->lobes().front());
  const Gaussian g{1, 0, 0, {0.04f, 0, 0.04f}};
  const Quality quality = gradeMixture(black, Vec3::UnitZ(), std::span(&g, 1), 256);
  CHECK((quality.nev == 0 && quality.worst == 0));
  const LobeCache cache = singleRecord(folder / "x.lobe", black, g);
  CHECK(cache.records()[0].worstRatio == 0);
  CHECK(plotRecords(cache, std::vector{0}, &black).rows.size() == 1);
}

TEST_CASE("fitter: colour maps of plots are monotonic in lightness") {
  for (int i = 0; i < 100; ++i) {
    CHECK(lightness(sequentialColour(0.01 * (i + 1))) > lightness(sequentialColour(0.01 * i)));
    CHECK(lightness(divergingColour(0.01 * i)) > lightness(divergingColour(0.01 * (i + 1))));
    CHECK(lightness(divergingColour(-0.01 * i)) > lightness(divergingColour(-0.01 * (i + 1))));
  }
  CHECK(sequentialColour(7) == sequentialColour(1));
  CHECK((divergingColour(1)[0] > divergingColour(1)[2] && divergingColour(-1)[0] < divergingColour(-1)[2]));
}

TEST_CASE("fitter: a plot shows that a fit misses its target") {
  const Folder folder;
  const LobePtr lobe = roughConductor(0.3, 0.3)->lobes().front();
  // The target peaks on the left, this fit is on the right.
  const Gaussian wrong{1, 0.5f, 0.2f, {0.01f, 0, 0.01f}};
  const LobeCache cache = singleRecord(folder / "x.lobe", *lobe, wrong);
  const Plot plot = plotRecords(cache, std::vector{0}, lobe.get());
  REQUIRE(plot.raster.width() == 3 * 248 + 8);
  REQUIRE(plot.rows[0].view.centre.norm() == 0);
  const float half = plot.rows[0].view.half;
  const auto colourAt = [&](int panel, float x, float y) {
    return plot.raster.at(8 + panel * 248 + static_cast<int>(120 + 120 * x / half),
                          plot.rows[0].top + static_cast<int>(120 - 120 * y / half));
  };
  const DirectionGrid grid{GridKind::elevation, 1};
  const Vec2 mirror = -toDisc(grid.direction(0));
  CHECK(lightness(colourAt(0, mirror.x(), 0)) > lightness(colourAt(0, 0.5f, 0.2f)) + 0.2);
  CHECK(lightness(colourAt(1, mirror.x(), 0)) < lightness(colourAt(1, 0.5f, 0.2f)) - 0.2);
  CHECK(lightness(colourAt(1, 0.5f, 0.2f)) > lightness(colourAt(1, 0.5f, -0.2f)) + 0.2);  // y is up
  const Colour missed = colourAt(2, mirror.x() + 0.1f, 0), spare = colourAt(2, 0.5f, 0.2f);
  CHECK(missed[0] > missed[2] + 0.3f);
  CHECK(spare[2] > spare[0] + 0.3f);
  CHECK(plot.rows[0].grade->worst > 5);
}

TEST_CASE("fitter: plots have titles, scales and a legend within their borders") {
  const Folder folder;
  const LobePtr lobe = roughConductor(0.3, 0.3)->lobes().front();
  const LobeCache cache = singleRecord(folder / "x.lobe", *lobe, {1, -0.2f, 0, {0.05f, 0, 0.05f}});
  for (const Lobe* shown : {lobe.get(), static_cast<const Lobe*>(nullptr)}) {
    const Plot plot = plotRecords(cache, std::vector{0}, shown);
    const auto inked = [&](int from, int to) {
      for (int y = from; y < to; ++y)
        for (int x = 0; x < plot.raster.width(); ++x)
          if (lightness(plot.raster.at(x, y)) < 0.1) return true;
      return false;
    };
    const int top = plot.rows[0].top, bottom = top + 240;
    CHECK(inked(0, 30));                                  // the lobe
    CHECK(inked(30, top - 20));                           // titles of the columns
    CHECK(inked(top - 20, top - 4));                      // the record
    CHECK(inked(bottom + 14, bottom + 28));               // labels of the scales
    CHECK(inked(bottom + 40, plot.raster.height() - 8));  // the legend
    CHECK_FALSE(inked(plot.raster.height() - 8, plot.raster.height()));
    // The scale of the first panel rises from left to right.
    CHECK(lightness(plot.raster.at(240, bottom + 6)) > lightness(plot.raster.at(12, bottom + 6)) + 0.5);
  }
}

TEST_CASE("fitter: text is broken into lines that fit") {
  using Lines = std::vector<std::string>;
  CHECK(wrapped("one two  three  four", 10) == Lines{"one two", "three", "four"});
  CHECK(wrapped("one two  three  four", 11) == Lines{"one two", "three  four"});
  CHECK(wrapped("one two three", 7) == Lines{"one two", "three"});
  CHECK(wrapped("a  seven letters", 5) == Lines{"a", "seven", "lette", "rs"});
  CHECK(wrapped("", 5).empty());
  CHECK(spelledOut("ggx α 0.1×0.3, η 1.5") == "ggx alpha 0.1x0.3, eta 1.5");
}

TEST_CASE("fitter: the plotted records are spread from first to last") {
  CHECK(spreadRecords(64, 5) == std::vector{0, 15, 31, 47, 63});
  CHECK(spreadRecords(3, 5) == std::vector{0, 1, 2});
  CHECK(spreadRecords(1, 5) == std::vector{0});
}

TEST_CASE("fitter: lobedump --plot draws fits and with --scene also targets") {
  const Caches folder;
  ToolRun r = folder.run("lobedump --plot fit.png good.lobe");
  CHECK(r.code == 0);
  CHECK(r.error.empty());
  CHECK(lineCount(r.out) == 1 + 1 + 5);
  Image image = readImage(folder / "fit.png");
  CHECK((image.width == 256 && image.height > 5 * 248 + 8));

  r = folder.run("lobedump --plot all.png --scene scene.xml other.lobe --record 7");
  CHECK(r.code == 0);
  CHECK(lineCount(r.out) == 1 + 1 + 1);
  image = readImage(folder / "all.png");
  CHECK((image.width == 752 && image.height > 256));
  CHECK(folder.run("lobedump --plot again.png --scene scene.xml other.lobe --record 7").code == 0);
  CHECK(readFile(folder / "all.png") == readFile(folder / "again.png"));
  CHECK(folder.run("lobedump --plot upper.PNG good.lobe").code == 0);
  CHECK(folder.run("lobedump --html upper.HTML good.lobe").code == 0);
}

TEST_CASE("fitter: lobedump --plot leaves out records without a fit") {
  const Folder folder;
  const auto plot = [&](const std::vector<bool>& fitted, const std::string& options) {
    writePartlyFitted(folder / "x.lobe", fitted);
    return runBinary(folder.path(), "lobedump --plot x.png x.lobe " + options);
  };
  const std::vector<bool> ends{false, true, true, true, true, true, true, false};
  ToolRun r = plot(ends, "");
  CHECK((r.code == 0 && r.error.empty()));
  CHECK(plottedRecords(r.out) == std::vector{1, 2, 3, 4, 6});
  r = plot({true, false, true}, "");
  CHECK((r.code == 0 && r.error.empty()));
  CHECK(plottedRecords(r.out) == std::vector{0, 2});
  r = plot(ends, "--record 6");
  CHECK((r.code == 0 && r.error.empty()));
  CHECK(plottedRecords(r.out) == std::vector{6});

  fs::remove(folder / "x.png");
  r = plot(ends, "--record 7");
  CHECK(r.code == 1);
  CHECK_THAT(r.error,
             Catch::Contains("x.lobe (partial): record 7 is left to BSDF sampling, so there is no fit to draw"));
  r = plot({false, false}, "");
  CHECK(r.code == 1);
  CHECK_THAT(r.error, Catch::Contains("x.lobe (partial): all records are left to BSDF sampling, so there is no fit"));
  CHECK(folder.files() == 1);  // no plot was written
}

TEST_CASE("fitter: lobedump --plot reports invalid arguments") {
  const Caches folder;
  const ToolRun other = folder.run("lobedump --plot x.png --scene scene.xml -D alpha=0.25 good.lobe");
  CHECK(other.code == 1);
  CHECK_THAT(other.error, Catch::Contains("scene.xml: no material has the lobe of good.lobe"));
  const std::pair<const char*, const char*> cases[] = {{"lobedump --plot x.png good.lobe poor.lobe", "one cache file"},
                                                       {"lobedump --plot x.jpg good.lobe", "must be a .png file"},
                                                       {"lobedump --plot x.png good.lobe --record 8", "from 0 to 7"},
                                                       {"lobedump --plot x.png good.lobe --record -1", "--record"},
                                                       {"lobedump --plot x.png good.lobe --json", "excludes"},
                                                       {"lobedump --scene scene.xml good.lobe", "--plot or --html"},
                                                       {"lobedump --record 2 good.lobe", "--plot"}};
  for (const auto& [arguments, words] : cases) {
    const ToolRun r = folder.run(arguments);
    CAPTURE(arguments);
    CHECK(r.code == 2);
    CHECK_THAT(r.error, Catch::Contains(words));
    CHECK(lineCount(r.error) == 1);
  }
  CHECK(folder.run("lobedump --plot none/x.png good.lobe").code == 1);
  CHECK(folder.files() == 5);  // no file was written
}

TEST_CASE("fitter: lobedump --html writes a page that needs nothing else") {
  const Caches folder;
  const ToolRun r = folder.run("lobedump --html page.html --scene scene.xml good.lobe other.lobe");
  CHECK((r.code == 0 && r.out.empty() && r.error.empty()));
  const std::string page = readFile(folder / "page.html");
  CHECK_THAT(page, Catch::StartsWith("<!DOCTYPE html>") && Catch::EndsWith("</html>\n"));
  CHECK_THAT(page, Catch::Contains("good.lobe") && Catch::Contains("other.lobe") && !Catch::Contains("/* DATA */"));
  CHECK_THAT(page, !Catch::Contains("://") && !Catch::Contains(" src="));
  CHECK(folder.run("lobedump --html again.html --scene scene.xml good.lobe other.lobe").code == 0);
  CHECK(readFile(folder / "again.html") == page);
  // Names of files must not look like elements within the script.
  fs::copy_file(folder / "good.lobe", folder / "a<!--<script>.lobe");
  CHECK(folder.run("lobedump --html odd.html 'a<!--<script>.lobe'").code == 0);
  const std::string odd = readFile(folder / "odd.html");
  CHECK_THAT(odd, Catch::Contains("a\\u003c!--\\u003cscript>.lobe") && !Catch::Contains("<!--<script"));
  // Without a scene there are no targets.
  CHECK(folder.run("lobedump --html fits.html good.lobe other.lobe").code == 0);
  CHECK(readFile(folder / "fits.html").size() < page.size() / 2);
}

TEST_CASE("fitter: the page of caches reports its progress after each record") {
  const Caches folder;
  const LobeCache good = LobeCache::open(folder / "good.lobe"), more = LobeCache::open(folder / "more.lobe");
  const std::vector<PagedCache> paged{{&good, "good.lobe", nullptr}, {&more, "more.lobe", nullptr}};
  std::atomic<std::size_t> done = 0;
  lobePage(paged, [&] { ++done; });
  CHECK(done == good.records().size() + more.records().size());
}

TEST_CASE("fitter: lobedump --html reports invalid arguments") {
  const Caches folder;
  const std::pair<const char*, const char*> cases[] = {{"lobedump --html x.htm good.lobe", "must be an .html file"},
                                                       {"lobedump --html x.html good.lobe --json", "excludes"},
                                                       {"lobedump --html x.html good.lobe --plot x.png", "excludes"},
                                                       {"lobedump --html good.lobe good.lobe", "good.lobe"}};
  for (const auto& [arguments, words] : cases) {
    const ToolRun r = folder.run(arguments);
    CAPTURE(arguments);
    CHECK(r.code == 2);
    CHECK_THAT(r.error, Catch::Contains(words));
  }
  const ToolRun other = folder.run("lobedump --html x.html --scene scene.xml -D alpha=0.25 good.lobe");
  CHECK(other.code == 1);
  CHECK_THAT(other.error, Catch::Contains("scene.xml: no material has the lobe of good.lobe"));
  CHECK(folder.run("lobedump --html none/x.html good.lobe").code == 1);
  CHECK(folder.files() == 5);
}

TEST_CASE("fitter: lobedump --diff lists differences and returns exit codes like cmp") {
  const Caches folder;
  ToolRun r = folder.run("lobedump --diff good.lobe good.lobe");
  CHECK(r.code == 0);
  CHECK_THAT(r.out, Catch::EndsWith("equal\n"));
  r = folder.run("lobedump --diff good.lobe poor.lobe");
  CHECK(r.code == 1);
  CHECK(r.error.empty());
  CHECK_THAT(r.out, Catch::Contains("settings.components  8  2") && Catch::Contains("Of 8 records") &&
                        !Catch::Contains("different lobes"));
  r = folder.run("lobedump --diff good.lobe other.lobe");
  CHECK(r.code == 1);
  CHECK_THAT(r.out, Catch::Contains("different lobes") && Catch::Contains("grids differ"));
  const std::pair<const char*, const char*> cases[] = {{"lobedump --diff good.lobe none.lobe", "none.lobe"},
                                                       {"lobedump --diff good.lobe scene.xml", "not a Lobe file"},
                                                       {"lobedump --diff good.lobe", "two cache files"},
                                                       {"lobedump --diff good.lobe good.lobe --records", "excludes"}};
  for (const auto& [arguments, words] : cases) {
    r = folder.run(arguments);
    CAPTURE(arguments);
    CHECK(r.code == 2);
    CHECK_THAT(r.error, Catch::Contains(words));
  }
}

TEST_CASE("fitter: lobedump --diff --json counts and matches records") {
  const Caches folder;
  const auto diff = [&](const std::string& files) {
    return parseJson(folder.run("lobedump --diff --json " + files).out);
  };
  const auto same = diff("good.lobe good.lobe"), poor = diff("good.lobe poor.lobe"), back = diff("poor.lobe good.lobe");
  CHECK((same["equal"] == true && same["fields"].empty() && same["alike"] == 8));
  CHECK(same["records"][3]["same"] == true);
  CHECK((poor["equal"] == false && poor["same_lobe"] == true && poor["same_grid"] == true));
  CHECK(poor["fields"] == parseJson(R"([{"name": "settings.components", "a": "8", "b": "2"}])"));
  CHECK(poor["worse"] > poor["better"]);
  CHECK((poor["worse"] == back["better"] && poor["better"] == back["worse"]));
  CHECK(poor["a"]["summary"]["nev_median"] < poor["b"]["summary"]["nev_median"]);
  for (const char* side : {"a", "b"}) {
    const LobeCache cache = LobeCache::open(folder / poor[side]["file"].get<std::string>());
    CHECK(poor["records"][2][side]["worst_ratio"].get<float>() == cache.records()[2].worstRatio);
    CHECK(poor["records"][2][side]["components"] == cache.records()[2].count);
  }

  const auto more = diff("good.lobe more.lobe");
  CHECK((more["same_grid"] == false && more["records"].size() == 8));
  CHECK(more["records"][7]["b"]["record"] >= 14);
}

TEST_CASE("fitter: records are compared with those that the renderer looks up in a cache of one quadrant") {
  const Folder folder;
  const DirectionGrid grid{GridKind::fibonacci, 64};
  std::vector<std::uint32_t> all(64), inQuadrant(64);
  for (int i = 0; i < grid.count; ++i) {
    const Vec3 w = grid.direction(i);
    all[static_cast<std::size_t>(i)] = static_cast<std::uint32_t>(i);
    inQuadrant[static_cast<std::size_t>(i)] = w.x() >= 0 && w.y() >= 0 ? 0 : 1;
  }
  const LobeCache a = withLookups(folder / "a.lobe", all, false), b = withLookups(folder / "b.lobe", inQuadrant, true);
  const CacheDifference difference = compareCaches(a, b);
  int mirrored = 0;
  for (const RecordPair& pair : difference.records) {
    const Vec3 w = grid.direction(pair.a);
    // Entries near the sides of the quadrant may be outside.
    if (std::min(std::abs(w.x()), std::abs(w.y())) < 0.3f) continue;
    CHECK(pair.b == 0);
    mirrored += w.x() < 0 || w.y() < 0 ? 1 : 0;
  }
  CHECK(mirrored > 10);
}

TEST_CASE("fitter: caches without components can be compared") {
  const Folder folder;
  writePartlyFitted(folder / "a.lobe", {false, false});
  writePartlyFitted(folder / "b.lobe", {false, false, false});
  const LobeCache a = LobeCache::open(folder / "a.lobe"), b = LobeCache::open(folder / "b.lobe");
  const CacheDifference same = compareCaches(a, a), other = compareCaches(a, b);
  CHECK((same.equal && !other.equal && !other.sameGrid));
  CHECK((same.records.size() == 2 && same.records[0].same && same.records[1].same));
  CHECK((other.records.size() == 2 && other.records[0].same && !other.records[1].same));
  CHECK((other.better == 0 && other.worse == 0 && other.alike == 0));
}

TEST_CASE("fitter: lobedump shows all quantities of a record") {
  const Caches folder;
  const auto json = parseJson(folder.run("lobedump --json good.lobe").out)[0];
  const LobeCache cache = LobeCache::open(folder / "good.lobe");
  const CacheRecord& r = cache.records()[5];
  const auto& shown = json["records"][5];
  for (const auto& [name, value] : {std::pair("nev", r.nev), std::pair("nev_coverage", r.nevCoverage),
                                    std::pair("worst_ratio", r.worstRatio), std::pair("outside", r.outside)})
    CHECK(shown[name].get<float>() == value);
  CHECK(json["summary"]["worst_ratio"].get<double>() >= r.worstRatio);
  for (const char* options : {"", "--records "})
    CHECK_THAT(folder.run("lobedump good.lobe " + std::string(options)).out, Catch::Contains("worst f/p"));
}

TEST_CASE("fitter: lobedump prints no control characters of files to the terminal") {
  const Caches folder;
  const std::string odd = "a\x1b]0;title\x07\nb", shown = "a?]0;title??b";
  LobeCacheInfo info;
  info.model = info.key = info.summary = info.toolVersion = odd;
  info.gridCount = 1;
  writeAtomically(folder / "odd.lobe",
                  encodeLobeCache(info, std::vector{CacheRecord{}}, {}, std::vector<std::uint32_t>{0}));
  IlluminationInfo trained;
  trained.scene = trained.toolVersion = trained.settings.from = odd;
  writeAtomically(folder / "odd.illum", encodeIllumination(trained, {}, {}));
  const std::pair<const char*, int> commands[] = {{"lobedump odd.lobe", 0},
                                                  {"lobedump odd.illum", 0},
                                                  {"lobedump --diff odd.lobe good.lobe", 1},
                                                  {"lobedump --plot x.png odd.lobe", 1},
                                                  {"lobedump --html x.html --scene scene.xml odd.lobe", 1}};
  for (const auto& [command, code] : commands) {
    const ToolRun r = folder.run(command);
    CAPTURE(command);
    CHECK(r.code == code);
    CHECK_THAT(r.out + r.error, Catch::Contains(shown) && !Catch::Contains("\x1b") && !Catch::Contains("\x07"));
  }
  CHECK(parseJson(folder.run("lobedump --json odd.lobe").out)[0]["lobe"] == odd);
  CHECK(parseJson(folder.run("lobedump --json odd.illum").out)[0]["scene"] == odd);
}

TEST_CASE("fitter: lobedump shows no grades for a lobe without components") {
  const Caches folder;
  LobeCacheInfo info;
  info.model = info.key = info.summary = info.toolVersion = "mirror";
  info.gridCount = 2;
  CacheRecord record{};
  record.integral = record.albedo = 0.9f;
  writeAtomically(folder / "mirror.lobe",
                  encodeLobeCache(info, std::vector{record}, {}, std::vector<std::uint32_t>{0, 0}));
  const auto json = parseJson(folder.run("lobedump --json mirror.lobe").out)[0];
  CHECK((json["summary"]["nev_median"].is_null() && json["summary"]["mean_components"] == 0));
  CHECK((json["records"][0]["nev"].is_null() && json["records"][0]["worst_ratio"].is_null()));
  CHECK(json["records"][0]["albedo"].get<float>() == 0.9f);
  const std::string table = folder.run("lobedump --records mirror.lobe").out;
  CHECK_THAT(table, Catch::Contains("BSDF"));
  CHECK_THAT(table, !Catch::Contains("0.000"));
  const ToolRun plot = folder.run("lobedump --plot x.png mirror.lobe");
  CHECK((plot.code == 1 && plot.error.find("no fit to draw") != std::string::npos));
  const auto diff = parseJson(folder.run("lobedump --diff --json mirror.lobe good.lobe").out);
  CHECK((diff["better"] == 0 && diff["worse"] == 0 && diff["alike"] == 0));
}
