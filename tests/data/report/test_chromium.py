"""The report of a run in headless Chromium: player, keys, figures, a phone's window, contrast."""

import pytest

from data.report.report_file import write_report
from tests.data.report.chromium import CONTRAST, DESKTOP, PHONE, OpenPage, started_chromium
from tests.data.report.conftest import write_run, write_video

SOURCE = "document.querySelector('.view img').src"


@pytest.fixture(scope="module")
def browser():
    with started_chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    folder = write_run(tmp_path_factory.mktemp("report") / "run")
    write_video(folder)
    return write_report(folder)


@pytest.fixture(scope="module", params=[DESKTOP, PHONE], ids=["desktop", "phone"])
def window(browser, report, request):
    with OpenPage(browser, report, request.param) as opened:
        yield opened


@pytest.fixture
def opened(window):
    """The page at its first frame; a page takes half a second to open."""
    window.page.emulate_media(color_scheme="light")
    window.page.get_by_label("Frame", exact=True).fill("0")
    window.value("scrollTo(0, 0)")
    window.value("document.activeElement.blur()")
    return window


def frame_of(opened):
    return opened.page.locator("output").inner_text()


def test_the_slider_moves_the_frame(opened):
    slider, before = opened.page.get_by_label("Frame", exact=True), opened.value(SOURCE)
    assert frame_of(opened) == "frame 0, 0.0 s"
    slider.fill("2")
    assert frame_of(opened) == "frame 3, 0.3 s"
    assert opened.value(SOURCE) != before
    assert slider.get_attribute("aria-valuetext") == "frame 3, 0.3 s"
    assert "12.4" in opened.page.locator(".objects tbody").inner_text()
    assert opened.page.locator(".view img").first.get_attribute("alt") == "Camera, frame 3"


def test_keys_and_buttons_move_the_frame(opened):
    frames = []
    for key in ("ArrowRight", "ArrowRight", "ArrowRight", "ArrowLeft", "Home", "End"):
        opened.page.keyboard.press(key)
        frames.append(frame_of(opened).partition(",")[0].removeprefix("frame "))
    assert frames == ["1", "3", "3", "1", "0", "3"]
    opened.page.get_by_label("Previous frame").click()
    assert frame_of(opened) == "frame 1, 0.1 s"
    opened.page.get_by_label("Next frame").click()
    assert frame_of(opened) == "frame 3, 0.3 s"


def test_the_space_bar_plays_to_the_end(opened):
    opened.page.keyboard.press("Space")
    assert opened.page.get_by_role("button", name="Pause").is_visible()
    opened.page.get_by_role("button", name="Play").wait_for(timeout=5000)
    assert frame_of(opened) == "frame 3, 0.3 s"


def test_figures_hold_data_and_mark_the_frame(opened):
    counts = opened.value(
        "[...document.querySelectorAll('.js-plotly-plot')].map("
        "(p) => p.data.reduce((sum, t) => sum + (t.x || []).length, 0))"
    )
    assert len(counts) == 6
    assert min(counts) > 0
    assert opened.value("document.querySelectorAll('.js-plotly-plot .main-svg').length") >= 6
    figure = opened.page.locator("#tracks .js-plotly-plot")
    figure.scroll_into_view_if_needed()
    opened.page.get_by_label("Frame", exact=True).fill("2")
    figure.scroll_into_view_if_needed()
    cursor = "document.querySelector('#tracks .js-plotly-plot').layout.shapes.at(-1).x0"
    opened.wait_for(f"{cursor} === 3")


def test_every_control_has_a_name_and_can_be_reached(opened):
    unnamed = opened.value(
        "[...document.querySelectorAll('button, input, select')].filter("
        "(e) => !(e.getAttribute('aria-label') || e.textContent.trim()) || e.tabIndex < 0).length"
    )
    assert unnamed == 0
    assert opened.value("[...document.images].every((image) => image.alt)")
    assert opened.value("document.documentElement.lang") == "en"
    opened.value("document.querySelector('a, button, input').focus()")
    assert opened.value("document.activeElement.textContent") == "Skip to content"
    assert opened.value("document.activeElement.getBoundingClientRect().left >= 0")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_is_legible_and_no_element_is_wider_than_the_window(opened, scheme):
    opened.page.emulate_media(color_scheme=scheme)
    opened.value("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    assert opened.value("document.documentElement.scrollWidth <= innerWidth")
    opened.wait_for(f"({CONTRAST}).length === 0")  # the figures are drawn anew


def test_figures_follow_the_theme(opened):
    color = "document.querySelector('.js-plotly-plot').layout.font.color"
    light = opened.value(color)
    opened.page.emulate_media(color_scheme="dark")
    opened.wait_for(f"{color} !== {light!r}")


def test_no_error_is_logged_and_no_file_requested(opened):
    assert opened.complaints == []
    assert set(opened.requests) <= {"file:", "data:"}
