"""The page in Chromium: what it shows, and what visitors do to it."""

import re
import subprocess
import sys

import pytest
from browser import driven_chromium, serving

from upright.agents import AGENTS
from upright.studies.case import make_case
from upright.studies.run import make_run

pytestmark = [pytest.mark.slow, pytest.mark.wasm, pytest.mark.chromium]
DESKTOP, PHONE = {"width": 1200, "height": 900}, {"width": 390, "height": 844}


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """Address of the page, as `upright watch --build` writes it."""
    folder = tmp_path_factory.mktemp("site") / "page"
    command = [sys.executable, "-m", "upright", "watch", "--build", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == f"page: {folder}/index.html\n"
    with serving(folder) as (address, _):
        yield address


@pytest.fixture(scope="module")
def browser():
    with driven_chromium() as browser:
        yield browser


@pytest.fixture
def visit(address, browser):
    """Return a function that opens the page; nothing may go wrong, or go elsewhere."""
    wrong, contexts = [], []

    def visit_with(choice="", viewport=DESKTOP, **options):
        contexts.append(browser.new_context(viewport=viewport, **options))
        page = contexts[-1].new_page()
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("console", lambda message: wrong.append(message.text))
        page.on("request", lambda request: elsewhere(request.url))
        page.goto(f"{address}/{choice}")
        page.wait_for_function("document.querySelector('#trial').textContent")
        return page

    def elsewhere(url):
        if not url.startswith((address, "data:")):
            wrong.append(url)

    yield visit_with
    for context in contexts:
        context.close()
    assert not wrong


def lengths_in(page):
    """Return the steps of the last trials, from the table."""
    page.evaluate("document.querySelector('details').open = true")
    page.wait_for_selector("#lengths td", state="attached")
    cells = page.locator("#lengths td").all_inner_texts()
    return [int(cell.replace(",", "")) for cell in cells]


def number_in(page, row, column=0):
    """Return a number of the table of the present step."""
    page.evaluate("document.querySelector('details').open = true")
    cell = page.locator("#numbers tr", has_text=row).locator("td").nth(column)
    return float(cell.inner_text())


def wait_for(page, condition):
    page.wait_for_function(condition, timeout=120_000)


@pytest.mark.parametrize("name", AGENTS.built_in)
def test_every_agent_makes_the_trials_of_the_command_line(name, visit):
    noise = "gaussian-0.1"
    page = visit(f"#agent={name}&noise={noise}&seed=7&speed=max")
    wait_for(page, "document.querySelector('#caption').textContent.startsWith('It balances')")
    _, result = make_run(make_case(name, noise=noise), 7, 0)
    assert int(page.inner_text("#trial")) == result.trials
    assert lengths_in(page) == result.lengths[-10:].tolist()
    assert page.inner_text("#command") == f"upright learn {name} --noise {noise} --seed 7"


def test_a_swarm_makes_the_runs_of_a_study(visit):
    page = visit("#agent=random-search&seed=5&speed=max&view=swarm")
    wait_for(page, "document.querySelector('#caption').textContent.startsWith('100 of 100 stand')")
    case = make_case("random-search")
    trials = [make_run(case, 5, run)[1].trials for run in range(100)]
    told = f"up to {max(trials)}"
    page.wait_for_function(f"document.querySelector('#trial').textContent === '{told}'")
    command = "upright table --runs 100 --agents random-search --noises none --seed 5"
    assert page.inner_text("#command") == command


def test_it_moves_and_learns_with_nothing_filled_in(visit):
    page = visit()
    first = number_in(page, "Position")
    wait_for(page, "Number(document.querySelector('#trial').textContent) > 2")
    assert number_in(page, "Position") != first
    assert re.match(r"Trial \d+: (The pole fell|The cart left)", page.inner_text("#live"))
    wait_for(page, "document.querySelector('#caption').textContent.startsWith('It stands')")


def test_right_is_to_the_right(visit):
    page = visit()
    places = page.evaluate("""async () => {
        const { viewOf } = await import("./stage.js");
        const size = { clientWidth: 1000, clientHeight: 400 };
        const view = viewOf(size, { position_limit: 2.4, half_length: 0.5 });
        return [view.pole({ x: 0, theta: 0 }), view.pole({ x: 1, theta: 0.2 })];
    }""")
    (upright, leaning) = places
    assert upright[1][0] == upright[0][0] == 500
    assert upright[1][1] < upright[0][1]
    assert leaning[0][0] > 500
    assert leaning[1][0] > leaning[0][0]


@pytest.mark.parametrize(("key", "side"), [("ArrowRight", 1), ("ArrowLeft", -1)])
def test_keys_push_the_cart(key, side, visit):
    """Harder than the agent can, whichever way that pushes."""
    page = visit("#agent=adaptive-lqr")
    page.keyboard.press(".")  # stops the time, and lets a step pass
    before = number_in(page, "Velocity")
    page.focus("#stage")
    page.keyboard.press(f"Shift+{key}")
    for _ in range(4):
        page.keyboard.press(".")
    page.wait_for_timeout(200)
    assert side * (number_in(page, "Velocity") - before) > 0.5


def test_the_cart_and_the_pole_can_be_dragged(visit):
    page = visit("#agent=adaptive-lqr&start=zero")
    page.click("#play")
    box = page.locator("#stage").bounding_box()
    ground = box["y"] + box["height"] - 40
    x = box["x"] + box["width"] / 2 + number_in(page, "Position") * box["width"] / 5.52
    page.mouse.move(x, ground)
    page.mouse.down()
    page.mouse.move(x + box["width"] / 5.52, ground, steps=3)
    page.mouse.up()
    page.wait_for_timeout(300)
    assert number_in(page, "Position") == pytest.approx(1.0, abs=0.25)


def test_sliders_change_the_plant_and_the_address(visit):
    page = visit("#agent=adaptive-lqr")
    slider = page.locator("input[name=half_length]")
    slider.focus()
    slider.press("End")
    assert page.inner_text("#half_length-value") == "4 m"
    assert "half_length=2" in page.url
    page.locator("input[name=delay]").press("ArrowRight")
    assert "delay=1" in page.url
    command = "upright learn adaptive-lqr --seed 1 --parameter half_length=2 --condition delay=1"
    assert page.inner_text("#command") == command
    again = visit(page.url.rpartition("/")[2])
    assert again.inner_text("#half_length-value") == "4 m"
    assert again.input_value("input[name=delay]") == "1"


def test_a_link_with_nonsense_shows_the_usual_run(visit):
    page = visit("#agent=nobody&noise=loud&start=there&seed=-1&speed=odd&half_length=1e9&delay=x")
    assert page.inner_text("#command") == "upright learn q-learning --seed 1"


def test_the_time_stops_and_goes_on(visit):
    page = visit()
    page.keyboard.press(" ")
    before = page.inner_text("#simulated")
    page.wait_for_timeout(200)
    assert page.inner_text("#simulated") == before
    assert page.inner_text("#play") == "Play"
    page.keyboard.press(".")
    page.wait_for_function(f"document.querySelector('#simulated').textContent !== '{before}'")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_a_phone(scheme, visit):
    page = visit(viewport=PHONE, color_scheme=scheme, device_scale_factor=3, has_touch=True)
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    assert page.locator("#stage").bounding_box()["height"] <= 0.45 * PHONE["height"]
    assert page.evaluate("document.querySelector('#stage').width") >= 3 * 340
