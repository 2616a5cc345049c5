"""A headless Chromium for tests, spoken to through two pipes (its DevTools protocol): no driver needed."""

from __future__ import annotations

import base64
import itertools
import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

import warpedfoam as wf

NAMES = (
    "chromium", "chromium-headless-shell", "chromium-browser", "google-chrome", "google-chrome-stable",
    "chrome", "microsoft-edge",
)  # fmt: skip
FLAGS = [
    "--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--hide-scrollbars", "--no-first-run", "--disable-quic",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--disable-dev-shm-usage", "--mute-audio", "--force-color-profile=srgb", "--remote-debugging-pipe",
]  # fmt: skip
# The browser reads commands from descriptor 3 and answers on 4.
_LAUNCH = """
import fcntl, os, sys
ends = [fcntl.fcntl(int(n), fcntl.F_DUPFD, 10) for n in sys.argv[1:3]]
for end, place in zip(ends, (3, 4)):
    os.dup2(end, place)
os.execv(sys.argv[3], sys.argv[3:])
"""
#: Seconds that any one command may take on a busy machine.
PATIENCE = 90.0


#: Names a file that appears once a browser has been installed, or could not be.
COMING = "WARPEDFOAM_BROWSER_COMING"
#: What graphics drivers say of reading one pixel, which is how the page finds the bubble under a finger.
IDLE = "GPU stall due to ReadPixels"


def browser_path() -> str | None:
    """Where a Chromium is: the variable WARPEDFOAM_BROWSER, or one of the usual names."""
    named = os.environ.get("WARPEDFOAM_BROWSER")
    return named or next((found for name in NAMES if (found := shutil.which(name))), None)


def awaited_browser() -> str | None:
    """As `browser_path`, once an installation that goes on beside the tests has ended."""
    end = time.monotonic() + PATIENCE
    coming = os.environ.get(COMING)
    while coming and not Path(coming).exists() and time.monotonic() < end:
        time.sleep(0.5)
    return browser_path()


class Browser:
    """One browser with one page. Complaints of pages and requests to a network are kept in lists."""

    def __init__(self) -> None:
        path = browser_path()
        assert path is not None
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        to_read, to_write = os.pipe()
        from_read, from_write = os.pipe()
        command = [path, *FLAGS, f"--user-data-dir={self._folder.name}", "about:blank"]
        self._process = subprocess.Popen(
            [sys.executable, "-c", _LAUNCH, str(to_read), str(from_write), *command],
            pass_fds=(to_read, from_write),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(to_read)
        os.close(from_write)
        self._in, self._out, self._rest = to_write, from_read, b""
        self._ids = itertools.count(1)
        self._session: str | None = None
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self._loaded = 0
        try:
            targets = self._send("Target.getTargets")["targetInfos"]
            (page,) = [t["targetId"] for t in targets if t["type"] == "page"][:1]
            self._session = self._send("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
            for domain in ("Page", "Runtime", "Log", "Network"):
                self._send(f"{domain}.enable")
        except BaseException:
            self.close()
            raise

    @property
    def pid(self) -> int:
        """Number of the browser's process."""
        return self._process.pid

    def close(self) -> None:
        """End the browser and remove what it wrote."""
        self._session = None
        try:
            self._send("Browser.close")
            self._process.wait(10.0)
        except (OSError, TimeoutError, subprocess.TimeoutExpired, EOFError):
            self._process.kill()
            self._process.wait()
        os.close(self._in)
        os.close(self._out)
        self._folder.cleanup()

    def _send(self, method: str, **params: Any) -> Any:
        number = next(self._ids)
        message: dict[str, Any] = {"id": number, "method": method, "params": params}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._in, json.dumps(message).encode() + b"\0")
        while (answer := self._next()).get("id") != number:
            pass
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']['message']}")
        return answer["result"]

    def _next(self) -> dict[str, Any]:
        end = time.monotonic() + PATIENCE
        while b"\0" not in self._rest:
            if not select.select([self._out], [], [], max(0.0, end - time.monotonic()))[0]:
                raise TimeoutError("the browser does not answer")
            more = os.read(self._out, 1 << 20)
            if not more:
                raise EOFError("the browser has ended")
            self._rest += more
        raw, self._rest = self._rest.split(b"\0", 1)
        message: dict[str, Any] = json.loads(raw)
        self._noted(message.get("method", ""), message.get("params", {}))
        return message

    def _noted(self, method: str, params: dict[str, Any]) -> None:
        if method == "Page.loadEventFired":
            self._loaded += 1
        elif method == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])
        elif method == "Log.entryAdded":
            if IDLE not in params["entry"]["text"]:
                self.complaints.append(params["entry"]["text"])
        elif method == "Runtime.exceptionThrown":
            details = params["exceptionDetails"]
            self.complaints.append(details.get("exception", {}).get("description", details["text"]))
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning", "assert"):
            self.complaints.append(str([a.get("value", a.get("description")) for a in params["args"]]))

    def window(self, width: int, height: int, *, dots: float = 1.0, phone: bool = False) -> None:
        """Size of the window in its pixels, device pixels in each, and whether there are fingers."""
        self._send(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=dots, mobile=phone,
        )  # fmt: skip
        self._send("Emulation.setTouchEmulationEnabled", enabled=phone, maxTouchPoints=2 if phone else 1)

    def dark(self, wanted: bool) -> None:
        """What the machine of the reader prefers."""
        value = "dark" if wanted else "light"
        self._send("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": value}])

    def open(self, path: Path) -> None:
        """Open a file and wait until the viewer is ready; what was noted before is forgotten."""
        self.complaints.clear()
        self.requests.clear()
        loaded = self._loaded
        self._send("Page.navigate", url=path.resolve().as_uri())
        while self._loaded == loaded:
            self._next()
        self.ask("foamViewer.ready")
        self.settle()

    def ask(self, code: str) -> Any:
        """Value of an expression in the page, awaited."""
        answer = self._send("Runtime.evaluate", expression=code, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"].get("exception", {}).get("description", "failed"))
        return answer["result"].get("value")

    def settle(self) -> None:
        """Wait until what was asked for is on the screen."""
        self.ask("new Promise(r => requestAnimationFrame(() => requestAnimationFrame(() => r())))")

    def mouse(self, *path: tuple[float, float], button: str = "left", modifiers: int = 0) -> None:
        """Press at the first place, move along the others, let go at the last."""
        kinds = ["mousePressed", *["mouseMoved"] * (len(path) - 1), "mouseReleased"]
        for kind, place in zip(kinds, (*path, path[-1]), strict=True):
            self.mouse_event(kind, place, button=button, modifiers=modifiers)
        self.settle()

    def mouse_event(
        self, kind: str, place: tuple[float, float], *, button: str = "left", modifiers: int = 0
    ) -> None:
        """One of mousePressed, mouseMoved (with the button down) and mouseReleased."""
        x, y = place
        down = 0 if kind == "mouseReleased" else {"left": 1, "right": 2, "middle": 4}[button]
        common = {"button": button, "buttons": down, "clickCount": 1, "modifiers": modifiers}
        self._send("Input.dispatchMouseEvent", type=kind, x=x, y=y, **common)

    def wheel(self, place: tuple[float, float], amount: float) -> None:
        """Turn the wheel at a place; above 0 towards the reader."""
        x, y = place
        self._send("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=amount)
        self.settle()

    def touch(self, *paths: tuple[tuple[float, float], ...]) -> None:
        """Fingers, each along a path of as many places."""
        for step, kind in enumerate(["touchStart"] + ["touchMove"] * (len(paths[0]) - 1)):
            points = [{"x": path[step][0], "y": path[step][1], "id": k} for k, path in enumerate(paths)]
            self._send("Input.dispatchTouchEvent", type=kind, touchPoints=points)
        self._send("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
        self.settle()

    def accessibility(self) -> list[tuple[str, str]]:
        """Role and name of everything that a screen reader is told of."""
        nodes = self._send("Accessibility.getFullAXTree")["nodes"]
        heard = [node for node in nodes if not node["ignored"]]
        return [
            (node.get("role", {}).get("value", ""), node.get("name", {}).get("value", "")) for node in heard
        ]

    def key(self, name: str, *, text: str | None = None, modifiers: int = 0, code: int = 0) -> None:
        """Press a key and let go; ``code`` is that of keys which the browser itself heeds, as Tab (9)."""
        common: dict[str, Any] = {"key": name, "modifiers": modifiers, "windowsVirtualKeyCode": code}
        down = {"type": "rawKeyDown"} if text is None else {"type": "keyDown", "text": text}
        self._send("Input.dispatchKeyEvent", **down, **common)
        self._send("Input.dispatchKeyEvent", type="keyUp", **common)
        self.settle()

    def paper(self) -> bytes:
        """The page as it is printed: a PDF."""
        return base64.b64decode(self._send("Page.printToPDF", printBackground=False)["data"])

    def screenshot(self, path: Path | None = None) -> np.ndarray[Any, np.dtype[np.uint8]]:
        """Pixels (height, width, 3) of the window; also written to ``path``."""
        import io

        from matplotlib.image import imread

        self.settle()
        raw = base64.b64decode(self._send("Page.captureScreenshot", format="png")["data"])
        if path is not None:
            path.write_bytes(raw)
        pixels = np.round(255.0 * imread(io.BytesIO(raw), format="png")[..., :3])
        return pixels.astype(np.uint8)


# ------------------------------------------------------------------ what tests of the viewer share

WHITE = np.array([255, 255, 255])
ACCENT = np.array([0xD4, 0x00, 0x9F])
CANVAS = "document.getElementById('scene').getBoundingClientRect().toJSON()"


def shown(browser, path, *args, **kwargs):
    browser.open(wf.write_view(path / "view.html", *args, **kwargs))


def scene(browser):
    """Pixels of the canvas."""
    box = browser.ask(CANVAS)
    pixels = browser.screenshot()
    scale = pixels.shape[1] / browser.ask("innerWidth")
    x, y, w, h = (round(scale * box[k]) for k in ("x", "y", "width", "height"))
    return pixels[y : y + h, x : x + w].astype(int)


def front(foam, towards):
    """Bubbles whose centres face the eye most, foremost first."""
    normals = foam.cell.surface.normals(foam.bubble_centres)
    return np.argsort(-(normals @ np.asarray(towards)))


def axis(elevation, azimuth):
    e, a = np.radians([elevation, azimuth])
    return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


def where(browser, point):
    return tuple(browser.ask(f"foamViewer.where({list(map(float, point))})"))


def numbers(browser):
    """The table of the picked bubble: caption, and rows by name."""
    code = """[document.querySelector('#numbers caption')?.textContent ?? null,
      Object.fromEntries(
        [...document.querySelectorAll('#numbers td')].map((c) => [c.dataset.name, c.textContent]))]"""
    return browser.ask(code)


def number(text):
    return float(text.replace("−", "-"))


def check_numbers(browser, foam, bubble):
    import pytest  # what else takes the browser from here does without

    caption, rows = numbers(browser)
    assert caption == f"Bubble {foam.bubble_ids[bubble]}"
    assert number(rows["sides"]) == foam.network.sides[bubble]
    assert number(rows["charge"]) == foam.network.charges[bubble]
    assert number(rows["area"]) == pytest.approx(foam.bubble_areas[bubble], rel=1e-5)
    assert number(rows["volume"]) == pytest.approx(foam.bubble_volumes[bubble], rel=1e-5)
    assert number(rows["target volume"]) == pytest.approx(foam.target_volumes[bubble], rel=1e-5)
    if foam.pressures is not None:
        assert number(rows["pressure"]) == pytest.approx(foam.pressures[bubble], rel=1e-4)
    mean = foam.bubble_curvatures[bubble] / foam.bubble_areas[bubble]
    assert number(rows["mean Gaussian curvature"]) == pytest.approx(mean, rel=1e-4)
