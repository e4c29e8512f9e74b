"""A headless Chromium for tests, spoken to over two pipes; nothing but the browser is needed."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import Any

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
FLAGS = ("--headless=new", "--remote-debugging-pipe", "--no-sandbox",
         "--no-first-run", "--disable-dev-shm-usage", "--hide-scrollbars")  # fmt: skip
WITHOUT_GL = ("--disable-gpu",)
SOFTWARE_GL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


class Browser:
    """One page; use as a context. `errors` are its script errors and what it could not load.

    Args:
        webgl: draw WebGL in software.
        origin: of a server that it may ask for files, such as http://127.0.0.1:8080; None: nobody.
    """

    def __init__(self, webgl: bool = False, origin: str | None = None) -> None:
        assert CHROMIUM is not None
        self._origins = ("file:", "data:", "about:", "blob:") + ((origin,) if origin else ())
        self._folder = tempfile.TemporaryDirectory(
            prefix="poise-browser-", ignore_cleanup_errors=True
        )
        to_read, self._to = os.pipe()
        self._from, to_write = os.pipe()

        def pipes() -> None:  # Chromium reads from 3 and writes to 4
            read, write = os.dup(to_read), os.dup(to_write)
            os.dup2(read, 3)
            os.dup2(write, 4)

        self._process = subprocess.Popen(
            [CHROMIUM, *FLAGS, *(SOFTWARE_GL if webgl else WITHOUT_GL),
             f"--user-data-dir={self._folder.name}"],
            preexec_fn=pipes, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(to_read)
        os.close(to_write)
        self._rest, self._count, self._session = b"", 0, None
        self.errors: list[str] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def __enter__(self) -> Browser:
        return self

    def __exit__(
        self, kind: type | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._to)
        os.close(self._from)
        self._folder.cleanup()

    def open(
        self, page: Path | str, width: int = 1280, height: int = 900, dark: bool = False
    ) -> None:
        """Load a file, or an address, in a window of this size."""
        url = page if isinstance(page, str) else page.resolve().as_uri()
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height,
                  deviceScaleFactor=1, mobile=width < 600)  # fmt: skip
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])
        self.call("Page.navigate", url=url)
        self.wait(f"document.readyState + location.protocol == 'complete{url.split(':')[0]}:'")

    def wait(self, condition: str, seconds: float = 30.0) -> None:
        """Wait until a JavaScript expression is true."""
        deadline = time.monotonic() + seconds
        while not self.run(condition):
            assert time.monotonic() < deadline, f"the page does not come to {condition}"
            time.sleep(0.05)

    def mouse(self, kind: str, x: float, y: float, button: str = "left") -> None:
        """Press, move or release the mouse at a place [pixels]: "Pressed", "Moved", "Released".

        It is moved with the button held, or with "none".
        """
        held = {"buttons": int(kind != "Released" and button != "none")}
        self.call("Input.dispatchMouseEvent", type=f"mouse{kind}", x=x, y=y, button=button,
                  clickCount=1, **held)  # fmt: skip

    def click(self, text: str) -> None:
        """Click with the mouse on the button that has this text, once there is one."""
        button = self._found(text, "button")
        place = self.run(
            f"(b => {{b.scrollIntoView({{block: 'center'}}); const r = b.getBoundingClientRect();"
            f"return [r.x + r.width / 2, r.y + r.height / 2]}})({button})"
        )
        self.mouse("Pressed", *place)
        self.mouse("Released", *place)

    def press(self, text: str, among: str = "button") -> None:
        """Click without the mouse, on what may still be moving as it unfolds: the innermost and
        last element of a CSS selector that has this text."""
        self.run(f"{self._found(text, among)}.click()")

    def _found(self, text: str, among: str) -> str:
        """JavaScript for the element, once there is one."""
        element = (
            f"[...document.querySelectorAll({json.dumps(among)})]"
            f".findLast(b => (b.innerText ?? '').trim() == {json.dumps(text)})"
        )
        self.wait(f"!!{element}")
        return element

    def save_to(self, folder: Path) -> None:
        """Let the page save files into a folder, and read and write the clipboard."""
        self._browser("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(folder))
        # what is not named is refused; which of the two a write needs depends on whether the user
        # has just touched the page
        permissions = ["clipboardReadWrite", "clipboardSanitizedWrite"]
        self._browser("Browser.grantPermissions", permissions=permissions)

    def _browser(self, method: str, **params: Any) -> dict[str, Any]:
        """A command to the browser, not to its page."""
        session, self._session = self._session, None
        try:
            return self.call(method, **params)
        finally:
            self._session = session

    def run(self, script: str) -> Any:
        """The value of a JavaScript expression, awaited."""
        done = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in done, done["exceptionDetails"]
        return done["result"].get("value")

    def screenshot(self, path: Path, full: bool = True) -> None:
        """The page as PNG."""
        taken = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=full)
        path.write_bytes(base64.b64decode(taken["data"]))

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """A command of the DevTools protocol, and its answer."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": params}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._receive()
            if answer.get("id") == self._count:
                assert "error" not in answer, answer["error"]
                return answer["result"]
            self._note(answer)

    def _receive(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            block = os.read(self._from, 1 << 20)
            assert block, "Chromium has ended"
            self._rest += block
        line, self._rest = self._rest.split(b"\0", 1)
        return json.loads(line)

    def _note(self, event: dict[str, Any]) -> None:
        params, method = event.get("params", {}), event.get("method")
        if method == "Runtime.exceptionThrown":
            self.errors.append(str(params["exceptionDetails"]))
        elif method == "Log.entryAdded" and params["entry"]["level"] in ("error", "warning"):
            self.errors.append(params["entry"]["text"])
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning"):
            self.errors.append(str(params["args"]))
        elif method == "Network.requestWillBeSent":
            url = params["request"]["url"]
            if not url.startswith(self._origins):
                self.errors.append(f"asks for {url[:200]}")
