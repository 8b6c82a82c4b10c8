#!/usr/bin/python3
"""Opens a page of scripts/report in headless Chromium: the slider moves, the crop follows the keyboard, error maps appear, the page fits
the width of a phone, and there is no script error.

The argument is the folder of the tools. Exits with 77 if Chromium or Selenium is not installed.
"""

import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
SKIPPED = 77

try:
    from selenium import webdriver
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.select import Select
except ImportError:
    print("skipped: Selenium is not installed (python3-selenium)")
    sys.exit(SKIPPED)


def make_peer(tools, folder):
    """The pictures of another renderer, which is Lobe itself."""
    for seed in (1, 2):
        stem = folder / f"jewelry-{seed}"
        subprocess.run([tools / "loberender", ROOT / "scenes/jewelry.xml", "--integrator", "path", "--spp", "4", "--size", "240x150", "--seed", str(seed),
                        "-o", f"{stem}.exr", "-o", f"{stem}.png"], check=True, stderr=subprocess.DEVNULL)
    (folder / "times.csv").write_text("scene,seed,seconds\njewelry,1,1.5\njewelry,2,1.7\n")


def make_page(tools, folder):
    out, peer = folder / "evaluation", folder / "peer"
    peer.mkdir()
    make_peer(tools, peer)
    evaluate = [ROOT / "scripts/evaluate", out, "--scenes", "jewelry", "--methods", "path", "--method",
                "depth-2.0=--integrator path --max-depth 2", "--fit", "depth-2.0=--quality 0.1", "--spp", "1", "2",
                "--build", f"a={tools}", "--import", "peer", peer]
    subprocess.run(evaluate, check=True)
    before = {path: path.stat().st_mtime_ns for path in (out / "runs").rglob("*.exr")}
    subprocess.run(evaluate, check=True)
    assert before == {path: path.stat().st_mtime_ns for path in (out / "runs").rglob("*.exr")}, "complete runs are repeated"
    assert {folder.name for folder in (out / "caches").iterdir() if folder.is_dir()} == {"a", "a+depth-2.0"}, "caches of their own"
    record = next((out / "runs").rglob("*.run"))
    of_these_tools = record.read_text()
    record.write_text(of_these_tools.replace('"loberender": "', '"loberender": "0'))
    other = subprocess.run(evaluate, capture_output=True, text=True)
    assert other.returncode == 1 and "by other tools" in other.stderr, f"pictures of other tools are mixed: {other.stderr}"
    record.write_text(of_these_tools)
    subprocess.run([ROOT / "scripts/report", out, "--tools", tools], check=True)
    return out / "report.html"


def open_page(page):
    options = Options()
    options.binary_location = shutil.which("chromium")
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1300,1600"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(service=Service(shutil.which("chromedriver")), options=options)
    driver.get(page.as_uri())
    return driver


def check(driver):
    scene = driver.find_element(By.ID, "jewelry")
    right = scene.find_element(By.CSS_SELECTOR, "img.right")
    assert driver.execute_script("return arguments[0].naturalWidth", right) == 240, "the picture is not shown"
    bar = scene.find_element(By.CSS_SELECTOR, "input[type=range]")
    for _ in range(10):
        bar.send_keys(Keys.ARROW_RIGHT)
    assert "60%" in right.value_of_css_property("clip-path"), "the slider does not move"
    window = scene.find_element(By.CSS_SELECTOR, ".window")
    before = window.value_of_css_property("left")
    scene.find_element(By.CSS_SELECTOR, ".slider").send_keys(Keys.ARROW_RIGHT)
    assert window.value_of_css_property("left") != before, "the crop does not move"
    # Crops are square, and so is the frame.
    assert abs(window.size["width"] - window.size["height"]) <= 2, window.size
    picture = right.get_attribute("src")
    scene.find_element(By.CSS_SELECTOR, "input[type=checkbox]").send_keys(Keys.SPACE)
    assert right.get_attribute("src") != picture, "there is no error map"
    assert scene.find_element(By.CSS_SELECTOR, ".legend").is_displayed(), "error maps have no scale"
    assert len(scene.find_elements(By.CSS_SELECTOR, ".crops figure")) == 3
    assert len(scene.find_elements(By.CSS_SELECTOR, "svg circle")) == 5, "the chart does not have a point for each budget, and the peer's"
    assert scene.find_element(By.CSS_SELECTOR, "svg").text.count("slope") == 2, "slopes are not shown"
    header = [cell.text for cell in driver.find_elements(By.CSS_SELECTOR, "#table th")]
    assert header == ["", "a:path", "a:depth-2.0", "peer"], header
    peers = [row.find_elements(By.TAG_NAME, "td")[3].text for row in driver.find_elements(By.CSS_SELECTOR, "#table tbody tr")]
    assert len(peers) == 2 and peers[0] == peers[1] and peers[0].endswith(", 1.6 s"), peers
    before = scene.find_element(By.CSS_SELECTOR, ".chart svg").get_attribute("outerHTML")
    Select(scene.find_element(By.CSS_SELECTOR, "div:has(> .chart) select")).select_by_index(2)
    assert scene.find_element(By.CSS_SELECTOR, ".chart svg").get_attribute("outerHTML") != before, "the chart does not show the other error"
    rows = driver.find_elements(By.CSS_SELECTOR, "#caches tbody tr")
    charts = driver.find_elements(By.CSS_SELECTOR, "#fit-charts svg")
    assert len(charts) == 2, "there are no charts of the fits"
    for fits in charts:
        assert len(fits.find_elements(By.CSS_SELECTOR, "circle")) == len(rows) > 3, "the charts do not show every cache"
    driver.set_window_size(500, 1600)  # the narrowest window of Chromium
    assert driver.execute_script("return document.documentElement.scrollWidth <= innerWidth"), "too wide for a phone"
    errors = driver.get_log("browser")
    assert not errors, errors


def main():
    if not (shutil.which("chromium") and shutil.which("chromedriver")):
        print("skipped: Chromium is not installed (chromium, chromium-driver)")
        return SKIPPED
    with tempfile.TemporaryDirectory() as folder:
        driver = open_page(make_page(pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(folder)))
        try:
            check(driver)
        finally:
            driver.quit()
    print("the page works")
    return 0


if __name__ == "__main__":
    sys.exit(main())
