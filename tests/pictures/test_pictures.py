import math
import re
import subprocess
import sys
import time
import weakref

import imageio_ffmpeg
import numpy as np
import pygame
import pytest
from helpers import UPRIGHT, python
from PIL import Image

from upright.core.parameters import Parameters, State
from upright.errors import UprightError
from upright.pictures import picture as drawing
from upright.pictures import text as text_module
from upright.pictures import video as video_module
from upright.pictures.colours import CART, FALLEN, FORCE, GHOST, LIMIT, PAST, POLE
from upright.pictures.picture import HEIGHT, ROOM_ABOVE, WIDTH, Layout, picture
from upright.pictures.scene import History, Scene
from upright.pictures.size import SIZE, Size, parse_size
from upright.pictures.text import text_picture
from upright.pictures.video import write_video
from upright.pictures.window import Window

NOMINAL = Parameters()
USUAL = Layout(NOMINAL, SIZE, has_chart=False)
TRACK_Y, HINGE_Y, GAUGE_X = int(USUAL.track_y), USUAL.hinge_y, USUAL.gauge_x


def at(x=0.0, degrees=0.0):
    return State(x, 0.0, math.radians(degrees), 0.0)


def draw(state=UPRIGHT, parameters=NOMINAL, **scene):
    return picture(parameters, Scene(state, **scene))


def places(pixels, colour, top=ROOM_ABOVE - 8):
    """Return the columns and rows of this colour below the gauge, smoothed edges left out."""
    wanted = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    rows, columns = np.nonzero((np.abs(pixels.astype(int) - wanted) <= 3).all(axis=2))
    return columns[rows >= top], rows[rows >= top]


def metres(column, parameters=NOMINAL):
    return (column - WIDTH / 2) / scale(parameters)


def scale(parameters):
    return Layout(parameters, SIZE, has_chart=False).metre


# ------------------------------------------------------------------------------------- pictures


def test_a_picture_is_an_array_of_pixels_that_may_be_changed():
    pixels = draw(at(1, 5), caption="trial 1")
    assert pixels.shape == (HEIGHT, WIDTH, 3)
    assert pixels.dtype == np.uint8
    pixels[:] = 0
    assert draw(at(1, 5), caption="trial 1").any()


def test_the_same_scene_gives_the_same_picture_and_another_one_does_not():
    scene = {"measured": at(0.5, 3), "force": 10.0, "caption": "trial 1"}
    pixels = draw(at(0.5, 2), **scene)
    np.testing.assert_array_equal(pixels, draw(at(0.5, 2), **scene))
    others = [
        draw(at(0.6, 2), **scene),
        draw(at(0.5, 3), **scene),
        draw(at(0.5, 2), **scene | {"measured": None}),
        draw(at(0.5, 2), **scene | {"force": -10.0}),
        draw(at(0.5, 2), **scene | {"caption": "trial 2"}),
    ]
    assert all((other != pixels).any() for other in others)


@pytest.mark.parametrize("x", [-2.4, -1.0, 0.0, 0.3, 2.4])
@pytest.mark.parametrize("half_length", [0.25, 0.5, 2.0])
def test_the_cart_is_drawn_at_its_position(x, half_length):
    parameters = NOMINAL._replace(half_length=half_length)
    columns, rows = places(draw(at(x), parameters), CART)
    middle = (columns.min() + columns.max() + 1) / 2
    assert metres(middle, parameters) == pytest.approx(x, abs=0.02)
    assert rows.max() < TRACK_Y


@pytest.mark.parametrize("degrees", [-110, -30, -10, 0, 4, 10, 90])
@pytest.mark.parametrize("half_length", [0.25, 0.5, 2.0])
def test_the_pole_is_drawn_with_its_length_and_angle(degrees, half_length):
    parameters = NOMINAL._replace(half_length=half_length)
    columns, rows = places(draw(at(0.2, degrees), parameters), POLE)
    far = np.argmax(np.hypot(columns - WIDTH / 2, rows - HINGE_Y))
    hinge = WIDTH / 2 + 0.2 * scale(parameters)
    length = 2 * half_length * scale(parameters)
    lean = math.radians(degrees)
    assert columns[far] == pytest.approx(hinge + length * math.sin(lean), abs=6)
    assert rows[far] == pytest.approx(HINGE_Y - length * math.cos(lean), abs=6)


@pytest.mark.parametrize("state", [at(0.7, 5), at(-2.2, 11), at(1.5, -40)])
def test_the_mirrored_state_gives_the_mirrored_picture(state):
    mirrored = State(*(-value for value in state))
    world = slice(ROOM_ABOVE, TRACK_Y)
    left = draw(mirrored, force=-10.0)[world, ::-1].astype(int)
    right = draw(state, force=10.0)[world].astype(int)
    assert np.abs(left - right).mean() < 0.5  # edges may lie half a fine pixel apart
    assert np.abs(right - draw(mirrored)[world]).mean() > 2


@pytest.mark.parametrize("position_limit", [0.5, 2.4, 30.0])
@pytest.mark.parametrize("half_length", [0.25, 0.5, 2.0])
def test_track_and_pole_fit_into_the_picture(position_limit, half_length):
    parameters = NOMINAL._replace(position_limit=position_limit, half_length=half_length)
    pixels = draw(UPRIGHT, parameters)
    columns, _ = places(pixels, LIMIT)
    limit = position_limit * scale(parameters)
    assert columns.min() == pytest.approx(WIDTH / 2 - limit, abs=4)
    assert columns.max() == pytest.approx(WIDTH / 2 + limit, abs=4)
    _, rows = places(pixels, POLE, top=0)
    assert rows[rows > 50].min() >= ROOM_ABOVE - 8


def test_what_was_measured_is_drawn_where_it_differs():
    state = at(0.5, 2)
    seen = [draw(state), draw(state, measured=state), draw(state, measured=at(math.nan))]
    hidden = state._replace(x_dot=1.0)  # nothing that a picture shows
    for pixels in [*seen, draw(state, measured=hidden)]:
        assert len(places(pixels, GHOST, top=0)[0]) == 0
    columns, _ = places(draw(state, measured=at(0.5, 12)), GHOST)
    assert columns.mean() > places(draw(state), POLE)[0].mean() + 5


def test_noise_too_small_for_the_pole_is_seen_at_the_gauge():
    state, measured = at(0, 2), at(0, 2.45)
    columns, rows = places(draw(state, measured=measured), GHOST, top=0)
    gauge = columns[rows < ROOM_ABOVE - 8]
    true, rows = places(draw(state), POLE, top=0)
    true = true[rows < ROOM_ABOVE - 8]
    assert GAUGE_X < true.mean() < gauge.mean() - 2


def test_an_arrow_shows_the_force():
    assert len(places(draw(), FORCE)[0]) == 0
    right, left = (places(draw(force=force), FORCE)[0] for force in (10.0, -10.0))
    assert right.min() > WIDTH / 2 > left.max()
    flipped = places(draw(force=10.0, parameters=NOMINAL._replace(force=-10.0)), FORCE)[0]
    np.testing.assert_array_equal(flipped, right)
    stronger = places(draw(force=15.0), FORCE)[0]
    assert np.ptp(stronger) == pytest.approx(1.5 * np.ptp(right), rel=0.1)
    assert len(places(draw(force=0.01), FORCE)[0]) > 0


@pytest.mark.parametrize("size", [Size(320, 176), Size(960, 528), Size(1280, 704)])
def test_a_picture_of_another_size_is_the_same_drawing(size):
    scene = Scene(at(0.5, 3), at(0.5, 5), 10.0, "q-learning · trial 2", "step 3 · 0.1 s", "fallen")
    scene = scene._replace(history=History(np.array([10, 500]), 3, 1000), last_fall=at(-1, -12))
    usual, other = (Image.fromarray(picture(NOMINAL, scene, each)) for each in (SIZE, size))
    assert other.size == size
    shrunk = [
        np.asarray(each.resize((160, 88), Image.Resampling.BOX), int) for each in (usual, other)
    ]
    assert np.abs(shrunk[0] - shrunk[1]).mean() < 1.5


def test_a_larger_picture_is_drawn_sharply_not_enlarged():
    large = picture(NOMINAL, Scene(at(0, 7)), Size(1920, 1056)).astype(int)
    row = large[700]  # across the pole
    edge = (np.abs(row - row[0]).sum(axis=1) > 0) & (places_of(large, POLE)[700] == 0)
    inside = places_of(large, POLE)[700].sum()
    assert inside == pytest.approx(8 * 3 / math.cos(math.radians(7)), abs=2)
    near = np.flatnonzero(places_of(large, POLE)[700])
    assert edge[near[0] - 3 : near[0]].sum() <= 3


def places_of(pixels, colour):
    wanted = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return (np.abs(pixels - wanted) <= 3).all(axis=2)


@pytest.mark.parametrize("size", [Size(1280, 352), Size(640, 700), Size(400, 1000)])
@pytest.mark.parametrize("has_chart", [True, False])
def test_everything_is_inside_pictures_of_other_proportions(size, has_chart):
    layout = Layout(NOMINAL, size, has_chart)
    hinge = layout.hinge(UPRIGHT)
    assert layout.tip(hinge, 0.0)[1] >= ROOM_ABOVE - 1e-9
    assert layout.hinge(at(2.4))[0] < layout.width
    history = History(np.array([3, 40]), 5, 100) if has_chart else None
    pixels = picture(NOMINAL, Scene(UPRIGHT, history=history, caption="a", note="b"), size)
    assert pixels.shape == (size.height, size.width, 3)
    assert places_of(pixels.astype(int), POLE).any()


def chart(lengths, present=0, ending=""):
    history = History(np.array(lengths, np.int64), present, 1000)
    pixels = draw(history=history, ending=ending).astype(int)[HEIGHT - 72 : HEIGHT - 29, 24:]
    return [places_of(pixels, colour) for colour in (PAST, POLE, FORCE, LIMIT)]


def test_the_chart_has_a_bar_for_every_trial_on_a_logarithmic_scale():
    past, now, _, _ = chart([9, 99, 999], 99)
    heights = [past[:, column].sum() for column in (4, 20, 36)]
    assert heights[1] - heights[0] == pytest.approx(heights[2] - heights[1], abs=2)
    assert heights[0] > 5
    assert now[:, 52].sum() == heights[1]
    assert not past[:, 47:].any()
    assert not any(colour.any() for colour in chart([]))


@pytest.mark.parametrize(("ending", "which"), [("", 1), ("balanced", 2), ("fallen", 3)])
def test_the_last_bar_tells_how_the_trial_ended(ending, which):
    bars = [colour[:, 20].sum() > 0 for colour in chart([9], 500, ending)]
    assert bars == [each == which for each in range(4)]


def test_many_trials_share_bars_and_the_longest_is_seen():
    lengths = [10] * 5000
    lengths[2500] = 1000
    past = chart(lengths)[0]
    heights = past.sum(axis=0)
    assert (heights > 0).sum() > 450
    tallest = heights.max()
    assert tallest > 2 * np.median(heights[heights > 0])
    assert (heights == tallest).sum() <= 3


def test_the_last_fall_is_drawn_behind():
    columns, _ = places(draw(at(1), last_fall=at(-1, -12)), FALLEN)
    assert metres(columns.min()) < -1.2
    assert (metres(columns) < -0.5).mean() > 0.99  # the rest are smoothed edges
    for last_fall in (None, at(math.nan)):
        assert len(places(draw(at(1), last_fall=last_fall), FALLEN)[0]) < 10


@pytest.mark.parametrize("ending", ["fallen", "balanced"])
def test_a_picture_says_how_the_trial_ended(ending):
    colour = {"fallen": LIMIT, "balanced": FORCE}[ending]
    _, rows = places(draw(ending=ending, detail="step 9"), colour, top=0)
    assert (rows < ROOM_ABOVE - 8).sum() > 300


def test_a_long_title_leaves_the_gauge_alone():
    def gauge(caption):
        return draw(caption=caption)[:ROOM_ABOVE, int(GAUGE_X) - 110 :]

    long = "a_module_with_a_long_name.and_another:ClassWithALongName · trial 1,000"
    np.testing.assert_array_equal(gauge(long), gauge(""))
    assert (draw(caption=long) != draw(caption=long[:-1] + "1")).any()  # its end is what changes


@pytest.mark.parametrize(
    ("text", "size"),
    [
        ("640", (640, 352)),
        ("1280", (1280, 704)),
        ("1920", (1920, 1056)),
        ("1000", (1000, 544)),
        ("1280x720", (1280, 720)),
        (" 800 X 600 ", (800, 600)),
        ("320x176", (320, 176)),
        ("3840x2160", (3840, 2160)),
    ],
)
def test_a_size_is_a_width_or_a_width_and_a_height(text, size):
    assert parse_size(text) == size


@pytest.mark.parametrize(
    "text",
    [
        *("", "big", "0", "-640", "318", "3842", "641", "640x353", "640x", "x352", "640x100"),
        *("1e3", "640x352x2", "99999999999", "640.0", "640x3842", "٦٤٠"),
    ],
)
def test_what_is_not_a_size_is_refused(text):
    with pytest.raises(UprightError) as refused:
        parse_size(text)
    assert repr(text) in str(refused.value)
    assert "WIDTHxHEIGHT" in str(refused.value)


BEYOND = [at(3, 110), at(-50, -400), at(1e300, 1e300), State(0, math.inf, 0, 0), at(math.nan)]


@pytest.mark.parametrize("state", BEYOND)
def test_states_beyond_all_limits_can_be_drawn(state):
    pixels = draw(state, measured=State(*[math.inf] * 4), force=1e9)
    number = all(map(math.isfinite, state))
    assert (len(places(pixels, CART)[0]) > 0) == number
    assert ("not finite" in text_picture(NOMINAL, Scene(state))) != number
    assert (draw(force=math.nan) == draw(at(math.nan))).all()


def test_pictures_need_no_display_and_outlive_the_end_of_pygame():
    before = draw(at(1), caption="trial 1")
    pygame.quit()
    pygame.font.init()
    np.testing.assert_array_equal(draw(at(1), caption="trial 1"), before)
    program = (
        "from upright.core.parameters import Parameters, State\n"
        "from upright.pictures.scene import Scene\nfrom upright.pictures.picture import picture\n"
        "picture(Parameters(), Scene(State(0, 0, 0, 0)))\n"
        "import pygame; print(pygame.display.get_init())"
    )
    ended = python(program, DISPLAY="", WAYLAND_DISPLAY="")
    assert (ended.stdout, ended.stderr) == ("False\n", "")


def test_without_pygame_only_text_can_be_drawn(monkeypatch, tmp_path):
    drawing._backdrop.cache_clear()
    monkeypatch.setitem(sys.modules, "pygame", None)
    tries = (draw, lambda: Window("upright", 50), lambda: write_video(tmp_path / "a.mp4", [], 50))
    for attempt in tries:
        with pytest.raises(UprightError, match=r"pip install .*'video' of upright"):
            attempt()
    assert "pole" in text_picture(NOMINAL, Scene(UPRIGHT))


def test_the_original_pygame_is_refused(monkeypatch):
    monkeypatch.delattr(pygame, "IS_CE")
    with pytest.raises(UprightError, match="needs pygame-ce, but pygame is installed"):
        draw()


def test_a_video_needs_the_program_that_writes_it(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(UprightError, match=r"imageio-ffmpeg: pip install .*'video' of upright"):
        write_video(tmp_path / "film.mp4", frames(1), 50)


# ----------------------------------------------------------------------------------------- text


def cart_column(text):
    return text.splitlines()[-3].index("█")


def test_text_shows_cart_and_pole():
    lines = text_picture(NOMINAL, Scene(at(-1.2, 10), None, -10.0, "trial 1")).splitlines()
    assert lines[0] == "trial 1"
    assert lines[-1] == "cart -1.20 m, +0.00 m/s; pole +10.0°, +0°/s; force -10.0 N"
    tops = [line.index("/") for line in lines[1:5]]
    assert tops == sorted(tops, reverse=True)
    assert tops[0] > tops[-1]
    ends = [cart_column(text_picture(NOMINAL, Scene(at(x)))) for x in (-9, -2.4, 0, 2.4, 9)]
    assert ends[0] == ends[1] < ends[2] < ends[3] == ends[4]
    assert ends[2] - ends[1] == ends[3] - ends[2]


def test_text_of_the_mirrored_state_is_mirrored():
    def world(state):
        rows = text_picture(NOMINAL, Scene(state)).splitlines()[1:-2]
        width = text_module.COLUMNS + 2 * text_module.ROWS
        return [row.ljust(width) for row in rows]

    swapped = str.maketrans("/\\", "\\/")
    mirrored = [row[::-1].translate(swapped) for row in world(at(-1.7, -8))]
    assert world(at(1.7, 8)) == mirrored


# ---------------------------------------------------------------------------------------- video


def frames(count):
    for i in range(count):
        yield draw(at(i / 50, i / 10), caption=f"step {i}")


def test_an_mp4_holds_every_picture_in_a_format_that_browsers_play(tmp_path):
    path = tmp_path / "film.mp4"
    write_video(path, frames(60), 50)
    reader = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", path]
    ended = subprocess.run([*reader, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], capture_output=1)
    (about,) = re.findall(r"Stream .*Video: (h264.*)", ended.stderr.decode().partition("Output")[0])
    assert all(word in about for word in ("yuv420p", f"{WIDTH}x{HEIGHT}", " 50 fps"))
    read = np.frombuffer(ended.stdout, np.uint8).reshape(-1, HEIGHT, WIDTH, 3)
    assert len(read) == 60
    for frame, drawn in zip(read, frames(60), strict=True):
        assert np.abs(frame.astype(int) - drawn).mean() < 3


def test_a_gif_holds_every_picture_and_loops(tmp_path):
    path = tmp_path / "film.gif"
    write_video(path, frames(120), 50)
    with Image.open(path) as film:
        assert film.size == (WIDTH, HEIGHT)
        assert film.n_frames == 120
        assert film.info["duration"] == 20
        assert film.info["loop"] == 0
        for i, drawn in enumerate(frames(120)):
            film.seek(i)
            assert np.abs(np.asarray(film.convert("RGB"), int) - drawn).mean() < 1


def test_frames_are_written_as_they_arrive(tmp_path):
    alive = weakref.WeakSet()

    class Frame(np.ndarray):
        __hash__ = object.__hash__
        __eq__ = object.__eq__

    def watched():
        for frame in frames(150):
            mine = frame.view(Frame)
            alive.add(mine)
            assert len(alive) < 5
            yield mine

    write_video(tmp_path / "film.mp4", watched(), 50)


@pytest.mark.parametrize("ending", [".mp4", ".gif"])
def test_a_video_may_have_another_size(ending, tmp_path):
    path = (tmp_path / "film").with_suffix(ending)
    size = Size(850, 470)  # no multiples of 16
    write_video(path, [picture(NOMINAL, Scene(at(1, 5)), size)] * 3, 50, size)
    reader = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", path, "-f", "null", "-"]
    assert "850x470" in subprocess.run(reader, capture_output=True, text=True).stderr


def test_colours_that_appear_late_are_in_a_gif(tmp_path):
    path = tmp_path / "film.gif"
    late = draw(at(1), ending="fallen", last_fall=at(-1, 12), history=History(np.array([9]), 9, 99))
    write_video(path, [*frames(150), late], 50)
    with Image.open(path) as film:
        film.seek(film.n_frames - 1)
        assert np.abs(np.asarray(film.convert("RGB"), int) - late).max() < 70
        assert np.abs(np.asarray(film.convert("RGB"), int) - late).mean() < 1


def breaks(error):
    yield from frames(5)
    raise error


@pytest.mark.parametrize("ending", [".mp4", ".gif"])
@pytest.mark.parametrize("error", [KeyboardInterrupt(), RuntimeError("lost"), OSError("lost")])
def test_a_broken_video_leaves_what_was_there(error, ending, tmp_path):
    (tmp_path / "old").with_suffix(ending).write_text("old")
    for name in ("old", "new"):
        with pytest.raises(type(error)) as raised:
            write_video((tmp_path / name).with_suffix(ending), breaks(error), 50)
        assert raised.value is error
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


@pytest.mark.parametrize(
    ("name", "given", "said"),
    [
        ("film.avi", frames(1), r"'\.avi'.*\.mp4, \.gif"),
        ("film", frames(1), r"''.*\.mp4, \.gif"),
        ("missing/film.mp4", frames(1), "folder does not exist"),
        ("film.mp4", [], "no picture"),
        ("film.gif", [], "no picture"),
        ("film.mp4", [np.zeros((HEIGHT, 7, 3), np.uint8)], r"\(352, 7, 3\)"),
        ("film.mp4", [np.zeros((HEIGHT, WIDTH, 3))], "float64"),
    ],
)
def test_an_impossible_video_is_refused(name, given, said, tmp_path):
    with pytest.raises(UprightError, match=said):
        write_video(tmp_path / name, given, 50)
    assert list(tmp_path.iterdir()) == []


def test_a_failing_writer_leaves_no_file(monkeypatch, tmp_path):
    failing = tmp_path / "failing"
    failing.write_text("#!/bin/sh\nhead -c 1000000 >/dev/null\necho disk full >&2\nexit 1\n")
    failing.chmod(0o755)
    monkeypatch.setattr(video_module, "_ffmpeg", lambda: str(failing))
    with pytest.raises(UprightError, match=r"film\.mp4.*disk full"):
        write_video(tmp_path / "film.mp4", frames(10), 50)
    assert list(tmp_path.iterdir()) == [failing]


# --------------------------------------------------------------------------------------- window


@pytest.fixture
def window(monkeypatch):
    """A window on the display that SDL has for tests."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame.display.quit()
    window = Window("upright", 50)
    yield window
    window.close()
    pygame.quit()


def test_a_window_shows_the_picture(window):
    pixels = draw(at(1, 5), caption="trial 1")
    window.show(pixels)
    shown = pygame.surfarray.array3d(window._window.get_surface()).swapaxes(0, 1)
    np.testing.assert_array_equal(shown, pixels)


def test_a_window_keeps_its_pace(window):
    pixels = draw()
    window.show(pixels)
    began = time.monotonic()
    for _ in range(20):
        window.show(pixels)
    taken = time.monotonic() - began
    assert taken > 0.38
    assert taken < 10  # 0.4 s, but for what else the machine has to do


@pytest.mark.parametrize(
    "event",
    [
        pygame.event.Event(pygame.QUIT),
        pygame.event.Event(pygame.WINDOWCLOSE),
        pygame.event.Event(pygame.KEYDOWN, key=pygame.K_ESCAPE),
        pygame.event.Event(pygame.KEYDOWN, key=pygame.K_q),
    ],
)
def test_a_window_is_closed_by_its_user(event, window):
    window.show(draw())
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_a))
    window.show(draw())
    assert window.is_open
    pygame.event.post(event)
    window.show(draw())
    assert not window.is_open
    window.show(draw())
    window.close()
    pygame.event.post(event)  # meant for the window that is gone
    another = Window("another", 50)
    another.show(draw())
    assert another.is_open
    another.close()


def test_keys_ask_for_a_speed_a_pause_and_a_step(window):
    for key, text in (
        (pygame.K_PLUS, "+"),
        (pygame.K_EQUALS, "="),
        (pygame.K_KP_MINUS, "-"),
        (pygame.K_SPACE, " "),
        (pygame.K_RIGHT, ""),
        (pygame.K_n, "n"),
        (pygame.K_x, "x"),
        (pygame.K_UP, ""),
        (pygame.K_DOWN, ""),
    ):
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key, unicode=text))
    asked = ["faster", "faster", "slower", "pause", "step", "step", "faster", "slower"]
    assert window.commands() == asked
    assert window.commands() == []


def test_a_window_may_have_another_size(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    window = Window("upright", 0, Size(1280, 720), resizable=True)
    assert window.size == (1280, 720)
    pixels = picture(NOMINAL, Scene(at(1, 5)), window.size)
    window.draw(pixels)
    shown = pygame.surfarray.array3d(window._window.get_surface()).swapaxes(0, 1)
    np.testing.assert_array_equal(shown, pixels)
    window.close()
    assert window.size == (1280, 720)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is always a display")
@pytest.mark.parametrize("display", ["", ":997"])
def test_without_a_display_a_window_is_refused(display):
    program = (
        "import os; os.environ.pop('SDL_VIDEODRIVER', None)\n"
        "from upright.pictures.window import Window\n"
        "from upright.errors import UprightError\n"
        "try: Window('upright', 50)\n"
        "except UprightError as error: print(error)"
    )
    ended = python(program, DISPLAY=display, WAYLAND_DISPLAY="")
    assert "there is no display" in ended.stdout
    assert "video" in ended.stdout
