"""A page as a parser sees it, and as headless Chromium draws and prints it."""

import re
import subprocess
from html.parser import HTMLParser

VOID = {"meta", "img", "br", "hr", "link", "input"}


class Reader(HTMLParser):
    """Reads a page, insisting that every tag is closed in its place."""

    def __init__(self, html):
        super().__init__(convert_charrefs=True)
        self.open, self.tags, self.attributes, self.text = [], [], [], []
        self.feed(html)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.attributes += [(tag, name, value) for name, value in attributes]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data.strip())

    def values(self, name):
        return [value for _, attribute, value in self.attributes if attribute == name]


def drawn(html, folder):
    """Write a page; return its picture, its PDF and what the browser complained of.

    The page forbids itself every request but for pictures inside it (Content-Security-Policy), so that an attempt to
    load anything else is a complaint.
    """
    page, picture, printed = folder / "report.html", folder / "page.png", folder / "page.pdf"
    page.write_text(html, "utf-8")
    browser = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
    browser += [f"--user-data-dir={folder / 'profile'}", "--window-size=1000,2000", "--no-pdf-header-footer"]
    browser += ["--enable-logging=stderr"]
    said = ""
    for wanted in (f"--screenshot={picture}", f"--print-to-pdf={printed}"):
        done = subprocess.run([*browser, wanted, page.as_uri()], check=True, capture_output=True, timeout=120)
        said += done.stderr.decode(errors="replace")
    return picture, printed, re.findall(r".*CONSOLE.*", said)
