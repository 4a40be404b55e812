"""Record pictures of the page that `upright watch` shows: `python tools/record_page.py FOLDER`.

The page is built anew, and Chromium opens it in its first seconds, wide and on a phone.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from browser import driven_chromium, serving

from upright.live.static_page import build_page

SIZES = {
    "watch.png": {"viewport": {"width": 1200, "height": 930}, "color_scheme": "light"},
    "watch-phone.png": {"viewport": {"width": 390, "height": 844}, "color_scheme": "dark"},
}
"""Names of the pictures, and what the browser is like."""
STANDS = "document.querySelector('#caption').textContent.startsWith('It stands')"


def record(page: Path, folder: Path) -> None:
    """Write all pictures of a page to a folder."""
    with serving(page) as (address, _), driven_chromium() as browser:
        for name, like in SIZES.items():
            visited = browser.new_page(**like)  # type: ignore[arg-type]
            visited.goto(f"{address}/index.html")
            visited.wait_for_function(STANDS)
            visited.screenshot(path=folder / name)


if __name__ == "__main__":
    with TemporaryDirectory() as built:
        for _ in build_page(built):
            pass
        record(Path(built), Path(sys.argv[1]))
