"""Headless Chromium, driven as a person drives it: keys and clicks, by its debugging protocol over two pipes."""

import base64
import json
import os
import shutil
import subprocess
from itertools import count
from pathlib import Path

import pytest

NO_CHROMIUM, NO_AXE = "no chromium: apt-get install chromium", "no axe-core: make axe-core"
NO_POPPLER = "no pdftotext: apt-get install poppler-utils"
NO_FONT = "no Liberation Sans: apt-get install fonts-liberation"
WANTING = (NO_CHROMIUM, NO_AXE, NO_POPPLER, NO_FONT)
# a page is laid out and its script run by a browser alone; .ci/run installs it, and the last line of a run counts these
needs_chromium = pytest.mark.skipif(shutil.which("chromium") is None, reason=NO_CHROMIUM)
# what stands on a printed page is read by Poppler, a package of the same system as the browser
needs_poppler = pytest.mark.skipif(shutil.which("pdftotext") is None, reason=NO_POPPLER)
# how much fits a screen or a sheet is judged in the font that pages name; another one may be wider
needs_font = pytest.mark.skipif("Liberation" not in subprocess.getoutput("fc-match 'Liberation Sans'"), reason=NO_FONT)
PHONE, DESK = 390, 1400  # widths in pixels
AXE = Path(__file__).parents[2] / "out" / "axe" / "node_modules" / "axe-core" / "axe.min.js"
# the judge of accessibility comes by npm, which is no package of the environment; counted in the same way
needs_axe = pytest.mark.skipif(not AXE.is_file(), reason=NO_AXE)
VIOLATIONS = """axe.run(document, {resultTypes: ['violations']}).then(({violations}) => violations.flatMap(
  ({id, nodes}) => nodes.map(({target, failureSummary}) => `${id}: ${target} ${failureSummary}`)))"""
KEYS = {
    "Tab": (9, ""),
    "ArrowRight": (39, ""),
    "ArrowLeft": (37, ""),
    "Enter": (13, "\r"),
    "Home": (36, ""),
    "End": (35, ""),
}


class Browser:
    """One page of a browser; what it complains of is in ``complaints``."""

    def __init__(self, folder, html):
        page = folder / "page.html"
        page.write_text(html, "utf-8")
        to_browser, self._write = os.pipe()
        self._read, from_browser = os.pipe()

        command = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
        command += ["--remote-debugging-pipe", f"--user-data-dir={folder / 'profile'}", "--window-size=1100,900"]
        connected = f'exec "$@" 3<&{to_browser} 4>&{from_browser}'  # the browser reads at 3 and writes at 4
        self._process = subprocess.Popen(
            ["bash", "-c", connected, "bash", *command, "about:blank"],
            pass_fds=(to_browser, from_browser), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(to_browser)
        os.close(from_browser)
        self._number, self._buffer, self._session, self.complaints = count(1), b"", None, []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Runtime", "Log", "Page", "Network"):
            self.call(f"{domain}.enable")
        self.requests = []
        self.call("Page.navigate", url=page.as_uri())
        while self.run("document.readyState") != "complete":
            pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.terminate()
        self._process.wait(20)
        os.close(self._write)
        os.close(self._read)

    def call(self, method, **parameters):
        """Call a method of the protocol; return its result."""
        number = next(self._number)
        session = {"sessionId": self._session} if self._session else {}
        os.write(
            self._write, json.dumps({"id": number, "method": method, "params": parameters} | session).encode() + b"\0"
        )
        while True:
            message = self._message()
            if message.get("id") == number:
                assert "error" not in message, message
                return message["result"]
            self._hear(message)

    def _message(self):
        while b"\0" not in self._buffer:
            read = os.read(self._read, 1 << 20)
            assert read, "the browser has gone"
            self._buffer += read
        message, _, self._buffer = self._buffer.partition(b"\0")
        return json.loads(message)

    def _hear(self, message):
        if message.get("method") in ("Runtime.exceptionThrown", "Log.entryAdded"):
            self.complaints.append(message["params"])
        if message.get("method") == "Network.requestWillBeSent":
            self.requests.append(message["params"]["request"]["url"])

    def run(self, code):
        """Return what JavaScript says, a promise's value where it is one."""
        result = self.call("Runtime.evaluate", expression=code, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def load(self, url=None):
        """Load this page again, or another, without its policy, so that a judge's script may run in it."""
        self.call("Page.setBypassCSP", enabled=True)
        url = url or self.run("document.URL")
        self.call("Page.navigate", url=url)
        while self.run("[document.URL, document.readyState]") != [url, "complete"]:
            pass

    def show_page(self, html):
        """Show another page in place of this."""
        frame = self.call("Page.getFrameTree")["frameTree"]["frame"]["id"]
        self.call("Page.setDocumentContent", frameId=frame, html=html)

    def show(self, width, *, dark=False):
        """Show the page on a screen of this width."""
        scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.call("Emulation.setEmulatedMedia", features=scheme)
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=844, deviceScaleFactor=1, mobile=True)

    def unfold(self):
        """Load the page so that a judge's script may run in it, and open all that is folded."""
        self.load()
        self.run("for (const folded of document.querySelectorAll('details')) folded.open = true")

    def violations_on_screens(self):
        """What axe-core objects to on a phone and on a desk, light and dark."""
        objections = {}
        for width in (PHONE, DESK):
            for dark in (False, True):
                self.show(width, dark=dark)
                objections[width, dark] = self.violations()
        return {screen: texts for screen, texts in objections.items() if texts}

    def violations(self):
        """What axe-core objects to."""
        self.run(f"{AXE.read_text('utf-8')};0")
        return self.run(VIOLATIONS)

    def press(self, key, times=1):
        """Press a key where the focus is."""
        code, text = KEYS.get(key, (ord(key[0].upper()), key))
        about = {"key": key, "code": key, "windowsVirtualKeyCode": code}
        for _ in range(times):
            self.call("Input.dispatchKeyEvent", type="keyDown", **about, **({"text": text} if text else {}))
            self.call("Input.dispatchKeyEvent", type="keyUp", **about)

    def type(self, text):
        """Type text where the focus is, over what is selected."""
        self.call("Input.insertText", text=text)

    def click(self, selector, along=0.5):
        """Click an element, at a fraction of its width."""
        x, y = self.run(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)}); e.scrollIntoView({{block: 'center'}});"
            f" const r = e.getBoundingClientRect(); return [r.left + {along} * r.width, r.top + r.height / 2]; }})()"
        )
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def picture(self, path, *, width=1100, dark=False):
        """Write a picture of the whole page."""
        scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.call("Emulation.setEmulatedMedia", features=scheme)
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=False)
        shot = self.call("Page.captureScreenshot", captureBeyondViewport=False)
        path.write_bytes(base64.b64decode(shot["data"]))
