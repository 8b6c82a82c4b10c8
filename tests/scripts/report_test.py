#!/usr/bin/python3
"""Opens a page of scripts/report in headless Chromium: the edge follows the slider and the pointer, the crop a click and the keyboard, error
maps appear, labels of charts are not cut off, the page fits the width of a phone, and there is no script error. Also checks the tables in
Markdown.

The argument is the folder of the tools. Exits with 77 if Chromium or Selenium is not installed.
"""

import hashlib
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
SKIPPED = 77
PEER = "another-renderer-whose-name-is-wider-than-a-phone"
DRAWING = """<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><title>Roughness α</title><desc>One sentence.</desc></svg>"""
UNTITLED = """<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"></svg>"""

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


def make_peer(tools, folder):
    """The pictures of another renderer, which is Lobe itself, without PNG files."""
    for seed in (1, 2):
        subprocess.run([tools / "loberender", ROOT / "scenes/jewelry.xml", "--integrator", "path", "--spp", "4", "--size", "240x150", "--seed", str(seed),
                        "-o", folder / f"jewelry-{seed}.exr"], check=True, stderr=subprocess.DEVNULL)
    (folder / "times.csv").write_text("scene,seed,seconds\njewelry,1,1.5\njewelry,2,1.7\n")


def make_page(tools, folder):
    out, peer = folder / "evaluation", folder / PEER
    peer.mkdir()
    make_peer(tools, peer)
    evaluate = [ROOT / "scripts/evaluate", out, "--scenes", "jewelry", "--methods", "path", "--method",
                "depth-2.0=--integrator path --max-depth 2", "--fit", "depth-2.0=--quality 0.1", "--seconds", "1",
                "--spp", "1", "2", "4", "--build", f"a={tools}", "--import", PEER, peer]
    subprocess.run(evaluate, check=True)
    before = {path: path.stat().st_mtime_ns for path in (out / "runs").rglob("*.exr")}
    subprocess.run(evaluate, check=True)
    assert before == {path: path.stat().st_mtime_ns for path in (out / "runs").rglob("*.exr")}, "complete runs are repeated"
    assert {folder.name for folder in (out / "caches").iterdir() if folder.is_dir()} == {"a", "a+depth-2.0"}, "caches of their own"
    record = next((out / "runs").rglob("*.run"))
    of_these_tools = record.read_text()
    record.write_text(of_these_tools.replace('"loberender": "', '"loberender": "0'))
    other = subprocess.run(evaluate, capture_output=True, text=True)
    assert other.returncode == 1 and "by another loberender" in other.stderr, f"pictures of other tools are mixed: {other.stderr}"
    record.write_text(of_these_tools)
    (folder / "drawing.svg").write_text(DRAWING)
    (folder / "untitled.svg").write_text(UNTITLED)
    subprocess.run([ROOT / "scripts/report", out, "--tools", tools, "--chart", folder / "untitled.svg", "--chart", folder / "drawing.svg"],
                   check=True)
    return out / "report.html"


def check_markdown(out):
    text = subprocess.run([ROOT / "scripts/report", out, "--markdown"], check=True, capture_output=True, text=True).stdout
    machine, best, counts, errors, costs = (part.splitlines() for part in text.split("\n\n"))
    assert re.search(" cores?; threads of a run: ", machine[0]) and "loberender " in machine[0], machine
    assert len(best) == 2 + 1 and best[2].startswith("| jewelry, 1 s | ") and best[2].count("**") in (2, 4) and best[2].count(" ± ") == 3, best
    assert counts[0].startswith("Lowest, of 1 scene: `a:"), counts
    assert errors[0] == f"|  | a:path | a:depth-2.0 | {PEER} |" and len(errors) == 2 + 4, errors
    for line in errors[2:]:
        assert line.count("**") in (2, 4) and "**" not in line.split("|")[-2], f"no method is the best: {line}"
    columns = "samples per pixel | rays, millions | segments per sample | training, s | memory, MB | mean / mean of all methods"
    assert costs[0] == f"| scene, budget | method | {columns} |", costs
    for line in costs[2:]:
        assert 0 < float(line.split("|")[-2]) < 9, f"not a mean relative to that of nine groups: {line}"
    assert errors[3].startswith("| jewelry, 1 sample |"), errors
    assert len(costs) == 2 + 9 and any(line.startswith("| jewelry, 4 samples | a:path | 4 | ") for line in costs), costs


def open_page(page):
    options = Options()
    options.binary_location = shutil.which("chromium")
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1300,1600"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(service=Service(shutil.which("chromedriver")), options=options)
    driver.get(page.as_uri())
    return driver


def check_values(driver, scene):
    """A line below a chart shows the values of the point that the pointer or the keyboard has chosen."""
    values = scene.find_element(By.CSS_SELECTOR, ".chart .values")
    points = scene.find_elements(By.CSS_SELECTOR, ".chart .plot circle")
    titles = [point.get_attribute("aria-label") for point in points]
    assert titles[0].startswith("a:path, ") and len(set(titles)) == len(points), titles
    ActionChains(driver).move_to_element(points[1]).click().perform()
    assert values.text == titles[1] and driver.switch_to.active_element == points[1], values.text
    points[1].send_keys(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_LEFT)
    assert values.text == titles[2] and driver.switch_to.active_element == points[2], values.text
    assert [point.get_attribute("tabindex") for point in points].count("0") == 1, "not one point is in the order of the tab key"


def check_chart(driver, scene):
    assert len(scene.find_elements(By.CSS_SELECTOR, "circle > title")) == 4 + 4 + 1, "not a point for each budget, and the peer's"
    check_values(driver, scene)
    text = scene.find_element(By.CSS_SELECTOR, ".chart").text
    assert text.count("slope") == text.count("±") == 2, f"slopes and their intervals are not shown: {text}"
    lines = [line.get_attribute("points").split() for line in scene.find_elements(By.CSS_SELECTOR, "polyline")]
    assert max(map(len, lines)) == 3, "a line joins budgets of seconds and of samples"
    assert driver.execute_script("return slope([[1, 1], [2, .6], [4, .2], [8, .15]])") == "-0.98 ± 0.65"
    assert driver.execute_script("return slope([[2, 1], [2.001, .6]])") == "", "a slope without different times"
    assert driver.execute_script("return ticks(...range([60, 60.1])).length") > 1, "too few ticks for one budget"
    styles = driver.execute_script("return [...Array(22).keys()].map(index => JSON.stringify(style(index)))")
    assert len(set(styles)) == 22, "methods look the same"


def check_best(driver):
    """In bold are the lowest variance and those that the uncertainties do not exclude, but no imported pictures."""
    driver.execute_script("""
      data.summary = [["a", 1, .2], ["b", 1.4, .3], ["c", 1.6, .3], ["d", .9, null]].map(([method, trimmed, trimmed_spread]) =>
        ({scene: "s", budget: method === "d" ? "imported" : "spp 1", method, trimmed, trimmed_spread, all: trimmed}));
      methods.splice(0, Infinity, "a", "b", "c", "d");""")
    best = driver.execute_script("return [...overview().querySelectorAll('td > strong')].map(cell => cell.textContent)")
    assert best == ["1 ± 0.2 (1)", "1.4 ± 0.3 (1.4)"], best
    driver.execute_script("data.summary = data.summary.slice(3);")
    assert driver.execute_script("return overview().querySelector('tbody').textContent") == "s, imported0.9 (0.9)", "no table of imported pictures"
    driver.refresh()


def check_pointer(driver, scene):
    """Dragging in the picture moves the edge only, a click the crop only."""
    slider, right, window = (scene.find_element(By.CSS_SELECTOR, name) for name in (".slider", "img.right", ".frame"))
    bar = scene.find_element(By.CSS_SELECTOR, "input[type=range]")

    def state():
        return right.value_of_css_property("clip-path"), bar.get_attribute("value"), window.get_attribute("style")

    before, quarter, crop = state(), slider.size["width"] // 4, scene.find_element(By.CSS_SELECTOR, ".crops figure")
    ActionChains(driver).move_to_element(slider).click_and_hold().move_by_offset(-quarter, 0).release().perform()
    after = state()
    assert crop.is_displayed(), "crops are made again while the edge is dragged"
    assert after[:2] != before[:2] and 24 <= int(after[1]) <= 26 and after[2] == before[2], (before, after)
    ActionChains(driver).move_to_element_with_offset(slider, quarter, 0).click().perform()
    assert state()[:2] == after[:2] and state()[2] != after[2], (after, state())


def check_runs(scene):
    """Times of a segment are there for all runs of ours, and relative to path of the same build."""
    header, *rows = ([cell.text for cell in row.find_elements(By.CSS_SELECTOR, "th, td")] for row in scene.find_elements(By.CSS_SELECTOR, ".scroll tr"))
    time, relative = header.index("time per segment, ns"), header.index("time per segment, relative to path")
    for row in rows:
        assert bool(row[time]) == bool(row[relative]) == (row[0] != PEER), row
        assert row[0] != "a:path" or row[relative] == "1", row
    assert len(rows) == 9, rows


def check_accessible(driver):
    """Areas that scroll can be reached and have names, and so do rows of tables."""
    unnamed = driver.execute_script("""
      return [...document.querySelectorAll(".scroll, [aria-label]")].filter(one => !(one.matches("[role], nav, input, select") &&
        one.ariaLabel && (one.tabIndex === 0 || !one.matches(".scroll")))).map(one => one.outerHTML.slice(0, 200))""")
    assert not unnamed, unnamed
    assert driver.execute_script("return [...document.querySelectorAll('tbody tr')].every(row => row.matches(':has(> th[scope=row]:first-child)'))")
    assert driver.execute_script("return document.querySelectorAll('main section').length === document.querySelectorAll('section').length")


def check_charts(driver):
    headings = [heading.text for heading in driver.find_elements(By.CSS_SELECTOR, "#charts h3")]
    assert headings == ["untitled.svg", "Roughness α"], headings
    assert [one.text for one in driver.find_elements(By.CSS_SELECTOR, "#charts p")] == ["One sentence."]
    for drawing in driver.find_elements(By.CSS_SELECTOR, "#charts img"):
        assert driver.execute_script("return arguments[0].naturalWidth", drawing) > 0, "a chart is not shown"


def check_phone(driver):
    # Windows of Chromium cannot be that narrow.
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": 360, "height": 800, "deviceScaleFactor": 1, "mobile": True})
    width = driver.execute_script("return document.documentElement.scrollWidth")
    assert width <= 360, f"too wide for a phone: {width} pixels"
    sizes, cut = driver.execute_script("""
      const texts = [...document.querySelectorAll("svg.plot text")];
      return [texts.map(text => parseFloat(getComputedStyle(text).fontSize) * Math.hypot(text.getScreenCTM().a, text.getScreenCTM().b)),
              texts.filter(text => {
                const [inner, outer] = [text.getBoundingClientRect(), text.ownerSVGElement.getBoundingClientRect()];
                return inner.left < outer.left || inner.right > outer.right || inner.top < outer.top || inner.bottom > outer.bottom;
              }).map(text => text.textContent)]""")
    assert min(sizes) >= 10 and not cut, (min(sizes), cut)
    drawn, natural = driver.execute_script("const image = document.querySelector('#charts img'); return [image.width, image.naturalWidth]")
    assert drawn >= 0.9 * natural, "drawings are too small to read"
    left, scrolled = driver.execute_script("""
      const place = document.getElementById("caches"), cell = place.querySelector("tbody th");
      place.scrollLeft = 1000;
      return [cell.getBoundingClientRect().left - place.getBoundingClientRect().left, place.scrollLeft]""")
    assert scrolled > 100 and abs(left) < 1, "the first column is not visible beside the others"


def check(driver, tools):
    check_best(driver)
    scene = driver.find_element(By.ID, "jewelry")
    right = scene.find_element(By.CSS_SELECTOR, "img.right")
    assert driver.execute_script("return arguments[0].naturalWidth", right) == 240, "the picture is not shown"
    bar = scene.find_element(By.CSS_SELECTOR, "input[type=range]")
    for _ in range(10):
        bar.send_keys(Keys.ARROW_RIGHT)
    assert "60%" in right.value_of_css_property("clip-path"), "the slider does not move"
    window = scene.find_element(By.CSS_SELECTOR, ".frame")
    before, top = window.value_of_css_property("left"), window.value_of_css_property("top")
    for key in (Keys.ALT, Keys.CONTROL, Keys.META):
        scene.find_element(By.CSS_SELECTOR, ".slider").send_keys(key, Keys.ARROW_DOWN, Keys.NULL)
    assert window.value_of_css_property("top") == top, "keys of the browser move the crop"
    scene.find_element(By.CSS_SELECTOR, ".slider").send_keys(Keys.ARROW_RIGHT)
    assert window.value_of_css_property("left") != before, "the crop does not move"
    # Crops are square, and so is the frame.
    assert abs(window.size["width"] - window.size["height"]) <= 2, window.size
    picture = right.get_attribute("src")
    scene.find_element(By.CSS_SELECTOR, "input[type=checkbox]").send_keys(Keys.SPACE)
    assert right.get_attribute("src") != picture, "there is no error map"
    assert right.get_attribute("alt") == f"jewelry, error map of {PEER}", right.get_attribute("alt")
    assert "logarithmic" in scene.find_element(By.CSS_SELECTOR, ".legend").text
    assert scene.find_element(By.CSS_SELECTOR, ".legend").is_displayed(), "error maps have no scale"
    captions = [caption.text for caption in scene.find_elements(By.CSS_SELECTOR, ".crops figcaption")]
    assert len(captions) == 3 and all("\nvariance 0." in caption for caption in captions), captions
    check_pointer(driver, scene)
    check_runs(scene)
    assert "Pictures: a:path 1 s," in scene.text, "pictures are not those of the longest time"
    check_chart(driver, scene)
    digest = hashlib.sha256((tools / "loberender").read_bytes()).hexdigest()
    shown = driver.find_element(By.ID, "machine").text
    assert "loberender " in shown and f"(hash {digest[:8]}) as a." in shown, shown
    headings = [cell.text for cell in driver.find_elements(By.CSS_SELECTOR, "#table tbody th")]
    assert headings == ["jewelry, 1 s", "jewelry, 1 sample", "jewelry, 2 samples", "jewelry, 4 samples"], headings
    header = [cell.text for cell in driver.find_elements(By.CSS_SELECTOR, "#table thead th")]
    assert header == ["", "a:path", "a:depth-2.0", PEER], header
    peers = [row.find_elements(By.TAG_NAME, "td")[2].text for row in driver.find_elements(By.CSS_SELECTOR, "#table tbody tr")]
    assert len(peers) == 4 and len(set(peers)) == 1 and " ± " in peers[0] and peers[0].endswith(", 1.6 s"), peers
    before = scene.find_element(By.CSS_SELECTOR, ".chart svg").get_attribute("outerHTML")
    Select(scene.find_element(By.CSS_SELECTOR, "div:has(> .chart) select")).select_by_index(2)
    assert scene.find_element(By.CSS_SELECTOR, ".chart svg").get_attribute("outerHTML") != before, "the chart does not show the other error"
    rows = driver.find_elements(By.CSS_SELECTOR, "#caches tbody tr")
    charts = driver.find_elements(By.CSS_SELECTOR, "#fit-charts svg.plot")
    assert len(charts) == 2, "there are no charts of the fits"
    for fits in charts:
        assert len(fits.find_elements(By.CSS_SELECTOR, "circle > title")) == len(rows) > 3, "the charts do not show every cache"
    assert driver.execute_script("data.plan.methods.v = ['--integrator', 'vcm']; return named('v') + named('a:path')") == "v (biased)a:path"
    command = driver.find_element(By.ID, "command").text
    assert "'depth-2.0=--integrator path --max-depth 2'" in command and "\n" not in command, command
    assert not driver.find_element(By.ID, "plan").is_displayed(), "the plan is not folded"
    check_charts(driver)
    check_accessible(driver)
    check_phone(driver)
    errors = driver.get_log("browser")
    assert not errors, errors


def main():
    if not (shutil.which("chromium") and shutil.which("chromedriver")):
        print("skipped: Chromium is not installed (chromium, chromium-driver)")
        return SKIPPED
    tools = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        page = make_page(tools, pathlib.Path(folder))
        check_markdown(page.parent)
        driver = open_page(page)
        try:
            check(driver, tools)
        finally:
            driver.quit()
    print("the page works")
    return 0


if __name__ == "__main__":
    sys.exit(main())
