#!/usr/bin/python3
"""Opens pages of lobedump --html in headless Chromium: a direction chosen by mouse and keyboard changes the record, the map of records turns,
lists select records, the pages fit the width of a phone and work with its touch screen, and there is no script error.

The argument is the folder of the tools. Exits with 77 if Chromium or Selenium is not installed.
"""

import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
SCENE = ROOT / "tests/data/room.xml"
SKIPPED = 77
# A lobe too narrow for Gaussians.
MIRROR = """<scene version="2.1.0"><bsdf type="roughconductor" id="m"><float name="alpha" value="0.002"/></bsdf>
  <shape type="sphere"><ref id="m"/></shape></scene>"""

try:
    from selenium import webdriver
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.select import Select
except ImportError:
    print("skipped: Selenium is not installed (python3-selenium)")
    sys.exit(SKIPPED)


def make_pages(tools, folder):
    def run(tool, *arguments):
        subprocess.run([str(part) for part in (tools / tool, *arguments)], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    for name, options in (("lobes", ("--quality", 0.1)), ("scene", ("--directions", 8))):
        run("lobefit", SCENE, "-o", folder / name, "--samples", 256, *options)
    caches = [*(folder / "lobes").glob("*.lobe"), *(folder / "scene").glob("*.lobe")]
    run("lobedump", "--html", folder / "caches.html", "--scene", SCENE, *caches)
    run("lobedump", "--html", folder / "fits.html", caches[0])
    (folder / "mirror.xml").write_text(MIRROR)
    run("lobefit", folder / "mirror.xml", "-o", folder / "mirror", "--samples", 256)
    run("lobedump", "--html", folder / "mirror.html", *(folder / "mirror").glob("*.lobe"))
    run("loberender", SCENE, "--cache", folder / "lobes", "--spp", 1, "--passes", 3, "--photons", 2000, "--importons", 1000, "--light-paths", "off",
        "--russian-roulette", "throughput", "-o", folder / "room.exr", "--save-illumination", folder / "room.illum")
    run("lobedump", "--html", folder / "light.html", folder / "room.illum")


def start_browser():
    options = Options()
    options.binary_location = shutil.which("chromium")
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1300,1700"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(service=Service(shutil.which("chromedriver")), options=options)


class Page:
    def __init__(self, driver, path):
        self.driver = driver
        driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        driver.get(path.as_uri())

    def find(self, name):
        return self.driver.find_element(By.ID, name)

    def text(self, name):
        return self.driver.execute_script("return document.getElementById(arguments[0]).textContent", name)

    def output(self, name):
        return self.driver.execute_script("return document.getElementById(arguments[0]).value", name)

    def pixels(self, name):
        return self.driver.execute_script("return document.getElementById(arguments[0]).toDataURL()", name)

    def point(self, name, right, down):
        """Moves the mouse to a point of an element, as fractions of half its size from its centre."""
        element = self.find(name)
        size = element.size
        return ActionChains(self.driver).move_to_element_with_offset(element, int(right * size["width"] / 2), int(down * size["height"] / 2))

    def selected_row(self):
        return self.driver.execute_script("const row = document.querySelector('#list tr.selected'); return row ? Number(row.dataset.record) : null")

    def shrink(self, width):
        """Shows the page as on a phone. Windows of Chromium cannot be that narrow."""
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": True})

    def finish(self):
        for width in (500, 360):
            self.shrink(width)
            needed = self.driver.execute_script("return document.documentElement.scrollWidth")
            assert needed <= width, f"too wide for a phone of {width} pixels: {needed} pixels"
        errors = self.driver.get_log("browser")
        assert not errors, errors


def check_caches(driver, folder):
    page = Page(driver, folder / "caches.html")
    assert len(Select(page.find("file")).options) == 2
    title, fit, target = page.text("record-title"), page.pixels("fit"), page.pixels("target")
    page.point("directions", -.3, -.5).click().perform()
    assert page.text("record-title") != title, "a click chooses no other record"
    assert page.pixels("fit") != fit and page.pixels("target") != target, "the panels show the old record"
    chosen, title = page.output("chosen"), page.text("record-title")
    page.find("directions").send_keys(Keys.ARROW_RIGHT)
    assert page.output("chosen") != chosen, "the arrow keys do not move the direction"
    for _ in range(8):
        page.find("directions").send_keys(Keys.SHIFT, Keys.ARROW_DOWN)
    assert page.text("record-title") != title, "the arrow keys reach no other record"
    page.point("ratio", .1, 0).perform()
    for word in ("elevation", "fit", "target", "ratio"):
        assert word in page.output("probe"), page.output("probe")
    # Records are sorted from the worst to the best; the first is selected by the keyboard.
    worst = driver.execute_script("return [...document.querySelectorAll('#list tbody tr')].map(r => Number(r.children[6].textContent))")
    assert len(worst) > 3 and worst == sorted(worst, reverse=True), worst
    driver.find_element(By.CSS_SELECTOR, "#list tbody button").send_keys(Keys.ENTER)
    assert page.text("record-title").startswith(f"Record {page.selected_row()} of {len(worst)}"), page.text("record-title")
    assert f"served by record {page.selected_row()}" in page.output("chosen")
    Select(page.find("file")).select_by_index(1)
    assert page.text("record-title").endswith(" of 8"), page.text("record-title")
    page.finish()


def check_look_up(driver, folder):
    """Every record serves the direction that it was fitted for and, the lobe being symmetric, its mirror images."""
    page = Page(driver, folder / "caches.html")
    assert driver.execute_script("return view.cache.quarter"), "the lobe is not known to be symmetric"
    for mirror in ([1, 1], [-1, 1], [1, -1], [-1, -1]):
        wrong = driver.execute_script("""const [u, v] = arguments[0];
          return view.cache.records.map((r, i) => [i, view.serving(u * r.direction[0], v * r.direction[1])]).filter(([i, j]) => i !== j)""", mirror)
        assert not wrong, wrong
    # A fit is a density over the disc, up to its part outside; the target is one up to its cells, which are coarse for grazing directions.
    sums = driver.execute_script("""
      const n = 300, sums = [];
      view.cache.records.forEach((r, index) => {
        view.index = index;
        let fit = 0, target = 0;
        for (let k = 0; k < n * n; ++k) {
          const x = ((k % n + .5) / n * 2 - 1), y = (1 - (Math.floor(k / n) + .5) / n * 2), cell = view.cellAt(x, y);
          if (x * x + y * y >= 1) continue;
          fit += view.fit(x, y) * 4 / (n * n);
          if (cell !== null) target += view.targetAt(cell) * 4 / (n * n);
        }
        sums.push([fit, target]);
      });
      return sums""")
    assert all(abs(fit - 1) < .01 and abs(target - 1) < .2 for fit, target in sums), sums
    assert abs(sum(target for _, target in sums) / len(sums) - 1) < .01, sums
    page.finish()


def check_fits(driver, folder):
    page = Page(driver, folder / "fits.html")
    assert page.find("fit").is_displayed() and not page.find("target").is_displayed() and not page.find("ratio").is_displayed()
    page.finish()


def check_mirror(driver, folder):
    page = Page(driver, folder / "mirror.html")
    assert not page.find("panels").is_displayed() and not page.find("directions-scale").is_displayed()
    assert "left to BSDF sampling" in page.text("grades") and "no fit" in page.text("panels-hint")
    page.finish()


def check_touch(driver, page):
    """A finger that moves sideways turns the map until the browser scrolls the page instead; a second finger does nothing."""
    def touch(kind, x, primary=True):
        driver.execute_script("""
          const [kind, x, primary] = arguments, map = document.getElementById("map");
          map.setPointerCapture = () => {};  // which refuses fingers that do not exist
          map.dispatchEvent(new PointerEvent(kind, {pointerId: primary ? 7 : 8, pointerType: "touch", isPrimary: primary, buttons: 1, clientX: x, clientY: 100}))
          """, kind, x, primary)
        return page.pixels("map")

    still = touch("pointerdown", 100)
    turned = touch("pointermove", 140)
    assert turned != still, "a finger does not turn the map"
    touch("pointerdown", 240, primary=False)
    assert touch("pointermove", 200, primary=False) == turned, "a second finger turns the map"
    touch("pointercancel", 140)
    assert touch("pointermove", 180) == turned, "the map turns while the page is scrolled"


def check_phone(driver, page):
    page.shrink(360)
    driver.execute_script("view.draw()")
    assert page.find("map").value_of_css_property("touch-action") == "pan-y", "a drag on the map cannot scroll the page"
    for name in ("zoom-in", "zoom-out", "reset"):
        button = page.find(name)
        assert min(button.size["width"], button.size["height"]) >= 40, f"{name} is too small for a finger: {button.size}"
        before = page.pixels("map")
        button.send_keys(Keys.ENTER)
        assert page.pixels("map") != before, f"{name} does not change the map"
    check_touch(driver, page)


def check_light(driver, folder):
    page = Page(driver, folder / "light.html")
    assert "likelihood gain" in page.text("map-scale") and "in nats" in page.text("map-scale"), page.text("map-scale")
    gains = driver.execute_script("return view.records.map(record => record.gain).filter(gain => gain !== null)")
    assert min(gains) < 0 < max(gains), "the gains of few particles should have both signs"
    for act in (lambda: page.find("map").send_keys(Keys.ARROW_LEFT), lambda: page.find("map").send_keys("+"),
                lambda: page.find("zoom-in").click(), lambda: page.find("zoom-out").click(),
                lambda: page.point("map", .2, .2).click_and_hold().move_by_offset(60, 20).release().perform(),
                lambda: Select(page.find("colour")).select_by_visible_text("background weight"), lambda: page.find("facing").click()):
        before = page.pixels("map")
        act()
        assert page.pixels("map") != before, "the map does not change"
    record, mixture = page.output("light-chosen"), page.pixels("light")
    right, down = driver.execute_script("""
      const own = view.placed.find(p => p.i === view.index), box = document.getElementById("map").getBoundingClientRect();
      const {at} = view.placed.find(p => !own || Math.hypot(p.at[0] - own.at[0], p.at[1] - own.at[1]) > 50);
      return [2 * at[0] / box.width - 1, 2 * at[1] / box.height - 1]""")
    page.point("map", right, down).click().perform()
    assert page.output("light-chosen") != record, "no record is picked"
    driver.find_element(By.CSS_SELECTOR, "#list tbody tr:nth-child(3) button").send_keys(Keys.ENTER)
    assert page.text("light-title").startswith(f"Record {page.selected_row()} of ")
    assert page.pixels("light") != mixture, "the mixture is that of the old record"
    page.point("light", 0, 0).perform()
    assert "density" in page.output("light-probe"), page.output("light-probe")
    check_phone(driver, page)
    page.finish()


def main():
    if not (shutil.which("chromium") and shutil.which("chromedriver")):
        print("skipped: Chromium is not installed (chromium, chromium-driver)")
        return SKIPPED
    with tempfile.TemporaryDirectory(prefix="lobe-pages-") as name:
        folder = pathlib.Path(name)
        make_pages(pathlib.Path(sys.argv[1]).resolve(), folder)
        driver = start_browser()
        try:
            for check in (check_caches, check_look_up, check_fits, check_mirror, check_light):
                check(driver, folder)
                print(check.__name__, "passed", flush=True)
        finally:
            driver.quit()
    return 0


if __name__ == "__main__":
    sys.exit(main())
