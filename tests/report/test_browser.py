"""The report in a browser: its script runs, nothing escapes, and it fits a narrow and a dark screen."""

import re
import shutil

import pytest

from helpers.report_pages import analysed_quickly, coarse_record, comparison, hostile_run
from tactile_bayes.report import write_report
from tactile_bayes.rig import Rig

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not (CHROMIUM and DRIVER), reason="needs chromium and chromedriver on the PATH"),
]

OPTIONS = "headless=new", "no-sandbox", "disable-gpu", "disable-dev-shm-usage", "force-device-scale-factor=1"


class Keys:
    """Codes of WebDriver, section 17.4.2."""

    PAGE_UP, PAGE_DOWN, END, HOME, ARROW_LEFT = "\ue00e\ue00f\ue010\ue011\ue012"
    ARROW_RIGHT, ARROW_DOWN, SPACE, TAB = "\ue014\ue015\ue00d\ue004"


@pytest.fixture(scope="module")
def driver():
    webdriver = pytest.importorskip("selenium.webdriver")
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service

    options = Options()
    options.binary_location = CHROMIUM
    for option in OPTIONS:
        options.add_argument(f"--{option}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = Service(executable_path=DRIVER)
    browser = webdriver.Chrome(options=options, service=service)
    yield browser
    browser.quit()


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    folder = tmp_path_factory.mktemp("browser")
    run = analysed_quickly(coarse_record(), folder, rig=Rig(unknown="nothing"))
    shapes = comparison(run.posterior.attrs["data_sha256"], shares=(0.9995, 0.0005, 0.0))
    shapes.to_netcdf(folder / "comparison.nc", engine="h5netcdf")
    return write_report(folder)


def widen(driver, width):
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)


def shown(driver, path, *, width=1200, **media):
    """Open a page on a screen of a width, with what the system asks for."""
    widen(driver, width)
    wanted = [{"name": name.replace("_", "-"), "value": value} for name, value in media.items()]
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": wanted})
    driver.get(path.as_uri())
    return driver


@pytest.fixture
def page(driver, path):
    yield shown(driver, path)
    assert driver.get_log("browser") == []


def by(driver, identity):
    return driver.find_element("id", identity)


def press(driver, identity, *keys):
    for key in keys:
        by(driver, identity).send_keys(key)


def state(driver):
    """What the rod, its contact, the marks and the numbers are at."""
    return driver.execute_script(
        """
        const of = (selector, name) =>
            Array.from(document.querySelectorAll(selector), (one) => one.getAttribute(name));
        return {
            rod: of("#rod", "points")[0],
            contact: of("#contact", "cx")[0],
            force: of("#reaction", "x2")[0] + "," + of("#reaction", "y2")[0],
            moment: of("#moment", "d")[0],
            marks: of(".mark.moving", "cy"),
            rules: of(".rule.moving", "x1"),
            numbers: document.getElementById("numbers").innerText,
        };
        """
    )


def test_the_slider_moves_rod_contact_wrench_and_marks_together(page):
    before = state(page)
    press(page, "sample", Keys.ARROW_LEFT)
    after = state(page)
    for name in before:
        assert before[name] != after[name], name
    assert len(set(after["rules"])) == 1
    frames = page.execute_script("return JSON.parse(document.getElementById('data').textContent).frames")
    frame = frames["sweeps"][0]["frames"][int(by(page, "sample").get_property("value"))]
    assert [float(number) for number in after["rod"].replace(",", " ").split()] == pytest.approx(frames["rod"][frame])
    assert frames["said"]["angle"][frame] in after["numbers"]
    assert frames["said"]["force_y"][frame][0] in after["numbers"]


def test_the_keyboard_goes_through_a_sweep(page):
    last = int(by(page, "sample").get_attribute("max"))
    for key, expected in (
        (Keys.HOME, 0),
        (Keys.ARROW_RIGHT, 1),
        (Keys.PAGE_DOWN, 0),
        (Keys.PAGE_UP, 10),
        (Keys.END, last),
        (Keys.ARROW_RIGHT, last),
        (Keys.ARROW_DOWN, last - 1),
    ):
        press(page, "sample", key)
        assert int(by(page, "sample").get_property("value")) == expected
    assert by(page, "contact").get_attribute("class") == "touch none"
    assert by(page, "reaction").get_attribute("visibility") == "hidden"
    words = by(page, "sample").get_attribute("aria-valuetext")
    assert re.fullmatch(r"sample \d+, drive angle −?[\d.]+ degrees", words)


def test_sweeps_can_be_chosen(page):
    from selenium.webdriver.support.select import Select

    choice = Select(by(page, "sweep"))
    assert [option.text for option in choice.options] == ["sweep 0, forward", "sweep 1, backward"]
    samples = []
    for number in (1, 0):
        choice.select_by_index(number)
        assert by(page, "sample").get_property("value") == "0"
        samples.append(int(by(page, "said-sample").text))
    assert samples[0] > samples[1] == 0


def test_it_plays_to_the_end_and_stops(page):
    from selenium.webdriver.support.ui import WebDriverWait

    last = by(page, "sample").get_attribute("max")
    press(page, "sample", Keys.END, Keys.ARROW_LEFT, Keys.ARROW_LEFT)
    press(page, "play", Keys.SPACE)
    WebDriverWait(page, 60).until(lambda browser: by(browser, "play").text == "Play")
    assert by(page, "sample").get_property("value") == last
    assert by(page, "play").get_attribute("aria-pressed") == "false"


def test_the_band_is_told_by_key_and_pointer(page):
    from selenium.webdriver.common.action_chains import ActionChains

    said = [by(page, "band-said").text]
    press(page, "band-place", Keys.HOME)
    said.append(by(page, "band-said").text)
    ActionChains(page).move_to_element(by(page, "band-detail")).perform()
    said.append(by(page, "band-said").text)
    assert len(set(said)) == 3
    assert all(
        re.match(r"x = \S+ mm: y .*\S+ to \S+ mm .*95 %, median", words.replace("\u00a0", " ")) for words in said
    )
    place = int(by(page, "band-place").get_property("value"))
    band = page.execute_script("return JSON.parse(document.getElementById('data').textContent).band")
    assert by(page, "band-rule").get_attribute("x1") == f"{band['x'][place]:g}"
    assert band["said"][place] == by(page, "band-place").get_attribute("aria-valuetext")


def test_focus_is_seen(page):
    page.find_element("css selector", "body").send_keys(Keys.TAB)
    style = page.execute_script("return getComputedStyle(document.activeElement).outlineStyle")
    assert style == "solid"


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [400, 1200])
def test_it_fits_and_can_be_read(driver, path, width, scheme):
    """No scrolling sideways, and a contrast of 4.5 at least wherever there is text."""
    page = shown(driver, path, width=width, prefers_color_scheme=scheme)
    assert page.execute_script("return document.documentElement.scrollWidth") <= width
    contrasts = page.execute_script(
        """
        const parts = (colour) => colour.match(/[\\d.]+/g).map(Number);
        function luminance(colour) {
            const [r, g, b] = parts(colour).slice(0, 3).map((value) => {
                const share = value / 255;
                return share <= 0.03928 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
            });
            return 0.2126 * r + 0.7152 * g + 0.0722 * b;
        }
        function ground(one) {
            for (; one; one = one.parentElement) {
                const colour = parts(getComputedStyle(one).backgroundColor);
                if (colour.length < 4 || colour[3] > 0) return getComputedStyle(one).backgroundColor;
            }
            return "rgb(255, 255, 255)";
        }
        const written = "p, li, th, td, h1, h2, h3, a, label, summary, code, caption, text";
        return Array.from(document.querySelectorAll(written)).map((one) => {
                const style = getComputedStyle(one), ink = one.tagName === "text" ? style.fill : style.color;
                const [a, b] = [luminance(ink), luminance(ground(one))].sort((x, y) => y - x);
                return (a + 0.05) / (b + 0.05);
            });
        """
    )
    assert len(contrasts) > 200
    assert min(contrasts) >= 4.5
    paper = page.execute_script("return getComputedStyle(document.body).backgroundColor")
    assert (max(int(part) for part in re.findall(r"\d+", paper)) < 64) == (scheme == "dark")
    assert driver.get_log("browser") == []


def test_the_numbers_of_a_sample_fit_beside_any_rod(page):
    """Without scrolling, and whatever sample is shown they are as high."""
    for width in (400, 640, 959, 960, 1100, 1400):
        widen(page, width)
        heights = set()
        for key in (Keys.HOME, Keys.PAGE_UP, Keys.END):
            press(page, "sample", key)
            table = "document.getElementById('numbers')"
            inside, outside, height = page.execute_script(
                f"return [{table}.scrollWidth, {table}.parentElement.clientWidth, {table}.tBodies[0].offsetHeight]"
            )
            assert inside <= outside <= width
            heights.add(height)
        assert len(heights) == 1
        lines = page.execute_script(
            "return Array.from(document.querySelectorAll('.bars span:last-child'), (one) => one.getClientRects().length"
            ")"
        )
        assert lines == [1, 1, 1]


def test_who_wants_less_motion_gets_the_slider_alone(driver, path):
    page = shown(driver, path, prefers_reduced_motion="reduce")
    assert not by(page, "play").is_displayed()
    assert by(page, "still").is_displayed()
    assert by(page, "sample").is_displayed()


def test_no_text_of_a_record_runs_or_becomes_an_element(driver, tmp_path_factory):
    from selenium.common.exceptions import NoAlertPresentException

    page = shown(driver, write_report(hostile_run(tmp_path_factory.mktemp("hostile"))))
    with pytest.raises(NoAlertPresentException):
        page.switch_to.alert  # noqa: B018
    assert page.execute_script("return document.querySelectorAll('img, b, [onerror], [onload], [onclick]').length") == 0
    assert page.execute_script("return document.scripts.length") == 2
    assert driver.get_log("browser") == []
    before = state(page)
    press(page, "sample", Keys.ARROW_LEFT)
    assert state(page)["rod"] != before["rod"]


def test_a_script_that_was_put_in_would_not_run(driver, path, tmp_path):
    """That the page's own policy holds, were an escape ever forgotten."""
    text = path.read_text(encoding="utf-8").replace("<main>", "<main><script>document.title = 'broken in'</script>", 1)
    broken = tmp_path / "broken.html"
    broken.write_text(text, encoding="utf-8")
    page = shown(driver, broken)
    assert page.title != "broken in"
    assert any("Content Security Policy" in entry["message"] for entry in driver.get_log("browser"))
