"""A headless Chromium, driven through chromedriver's own protocol: no package is needed."""

import base64
import contextlib
import json
import shutil
import subprocess
import time
import urllib.request
from urllib.error import HTTPError, URLError

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
ELEMENT = "element-6066-11e4-a52e-4f735466cecf"


class Browser:
    """One session."""

    def __init__(self, address, session):
        self.address, self.session = address, session

    def call(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(
            f"{self.address}/session/{self.session}/{path}".rstrip("/"),
            data,
            {"Content-Type": "application/json"},
            method=method,
        )
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                return json.load(answer)["value"]
        except HTTPError as error:
            raise AssertionError(error.read().decode()) from None

    def open(self, path):
        self.call("POST", "url", {"url": path.as_uri()})

    def run(self, script, *args):
        return self.call("POST", "execute/sync", {"script": script, "args": list(args)})

    def command(self, name, **params):
        return self.call("POST", "goog/cdp/execute", {"cmd": name, "params": params})

    def find(self, selector):
        return self.call("POST", "element", {"using": "css selector", "value": selector})[ELEMENT]

    def click(self, selector):
        self.call("POST", f"element/{self.find(selector)}/click", {})

    def type(self, selector, text):
        self.call("POST", f"element/{self.find(selector)}/value", {"text": text})

    def press(self, key):
        """Press a key where the focus is."""
        keys = [{"type": "keyDown", "value": key}, {"type": "keyUp", "value": key}]
        self.call("POST", "actions", {"actions": [{"type": "key", "id": "keyboard", "actions": keys}]})

    def console(self):
        """Errors and refused loads since the last call."""
        return [entry["message"] for entry in self.call("POST", "se/log", {"type": "browser"})]

    def resize(self, width, height, *, dark=False, phone=False):
        self.command(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=phone
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.command("Emulation.setEmulatedMedia", features=[scheme])

    def screenshot(self, file):
        file.write_bytes(base64.b64decode(self.call("GET", "screenshot")))


@contextlib.contextmanager
def browser(port=0):
    """A session, until the end of the block."""
    words = [DRIVER, f"--port={port}"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        try:
            port = next(
                line.rsplit(" ", 1)[1].strip(". \n") for line in process.stdout if "started successfully" in line
            )
            address = f"http://127.0.0.1:{port}"
            options = {
                "binary": CHROMIUM,
                "args": ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"],
            }
            wanted = {"goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "ALL"}}
            body = json.dumps({"capabilities": {"alwaysMatch": wanted}}).encode()
            request = urllib.request.Request(f"{address}/session", body, {"Content-Type": "application/json"})
            deadline = time.monotonic() + 30
            while True:
                try:
                    with urllib.request.urlopen(request, timeout=60) as answer:
                        session = json.load(answer)["value"]["sessionId"]
                    break
                except URLError:
                    if time.monotonic() > deadline:
                        raise
                    time.sleep(0.1)
            found = Browser(address, session)
            yield found
            found.call("DELETE", "")
        finally:
            process.terminate()
