# SPDX-License-Identifier: BSD-3-Clause
"""Controls Debian's Chromium without a window, through the DevTools protocol."""

from __future__ import annotations

import itertools
import json
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from websockets.sync.client import connect

from modular_framework_testing.ros_session import until

START_TIMEOUT_S = 60.0
ANSWER_TIMEOUT_S = 60.0


class Chromium:
    """A browser with a single page, as a context manager that ends the browser.

    Args:
        address: Address of the page.
        width: Width of the page [px].
        height: Height of the page [px].
    """

    def __init__(self, address: str, width: int = 1280, height: int = 720) -> None:
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        command = ["chromium", "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--no-first-run"]
        command += ["--remote-debugging-port=0", f"--user-data-dir={self._profile.name}", "--enable-unsafe-swiftshader"]
        command += [f"--window-size={width},{height}", "about:blank"]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        port_file = Path(self._profile.name) / "DevToolsActivePort"
        until(
            lambda: port_file.exists() and len(port_file.read_text().split()) == 2, "Chromium starts", START_TIMEOUT_S
        )
        port, path = port_file.read_text().split()
        self._socket = connect(f"ws://127.0.0.1:{port}{path}", max_size=None)
        self._ids = itertools.count(1)
        self._session = ""
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        self._session = str(self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"])
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self._call("Emulation.setDeviceMetricsOverride", **size)
        self._call("Emulation.setFocusEmulationEnabled", enabled=True)
        self.open(address)

    def open(self, address: str) -> None:
        """Opens a page."""
        self._call("Page.navigate", url=address)

    def evaluate(self, script: str) -> Any:
        """Returns the value of a JavaScript expression in the page."""
        answer = self._call("Runtime.evaluate", expression=script, returnByValue=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def text(self, selector: str) -> str:
        """Returns the text of the first element that a CSS selector finds; "" without a match."""
        return str(self.evaluate(f"document.querySelector({json.dumps(selector)})?.textContent ?? ''"))

    def shows(self, selector: str, text: str, timeout_s: float = 60.0) -> None:
        """Waits until an element contains a text.

        Args:
            selector: CSS selector of the element.
            text: Text or part of the text.
            timeout_s: Maximum wait [s].
        """
        until(lambda: text in self.text(selector), f"{selector} shows '{text}'", timeout_s)

    def press(self, key: str) -> None:
        """Presses "Tab" or "Enter"."""
        code = {"Tab": 9, "Enter": 13}[key]
        text = {"text": "\r"} if key == "Enter" else {}
        names = {"key": key, "code": key, "windowsVirtualKeyCode": code}
        self._call("Input.dispatchKeyEvent", type="keyDown", **names, **text)
        self._call("Input.dispatchKeyEvent", type="keyUp", **names)

    def close(self) -> None:
        """Ends the browser."""
        self._socket.close()
        self._process.terminate()
        self._process.wait(20.0)
        self._profile.cleanup()

    def __enter__(self) -> Chromium:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        number = next(self._ids)
        session = {"sessionId": self._session} if self._session else {}
        self._socket.send(json.dumps({"id": number, "method": method, "params": parameters, **session}))
        while True:
            answer = json.loads(self._socket.recv(timeout=ANSWER_TIMEOUT_S))
            if answer.get("id") == number:
                assert "error" not in answer, answer
                return dict(answer["result"])
