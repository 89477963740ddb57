"""Pages with the table whose figures can be changed, outside a notebook and a report, and what they show."""

import json
from importlib import resources

import numpy as np

TEMPLATES = resources.files("uq").joinpath("templates")
SCRIPT = TEMPLATES.joinpath("adjustable.js").read_text("utf-8")
HEAD = f"<!DOCTYPE html><meta charset=utf-8><style>{TEMPLATES.joinpath('adjustable.css').read_text('utf-8')}</style>"
MODEL = """
const heard = {}, values = {law: LAW, state: {}};
globalThis.model = {
  get: (name) => values[name],
  set(name, value) { values[name] = value; (heard[`change:${name}`] ?? []).forEach((listen) => listen()); },
  on(name, listen) { (heard[name] ??= []).push(listen); },
  save_changes() { globalThis.saved = (globalThis.saved ?? 0) + 1; },
};
"""


def widget_page(law, state=None):
    """The widget with a model that stands in for the kernel's, which is ``model`` in the page, as an export has it, too."""
    script = SCRIPT.replace("export default {", "const widget = {")
    run = "globalThis.evaluate = evaluate;\nwidget.render({ model, el: document.querySelector('main') });"
    model = MODEL.replace("LAW", json.dumps(law)).replace("state: {}", f"state: {json.dumps(state or {})}")
    return f"{HEAD}<main></main><script type=module>{script}\n{model}\n{run}</script>"


def shown(browser, row):
    """3σ and mean errors [g·m²] of a row of the table, 0 being all together."""
    cells = browser.run(
        f"[...document.querySelectorAll('.adjustable tbody tr')[{row}].querySelectorAll('td.parts span')].map(e => e.textContent)"
    )
    figures = [float(text.replace("−", "-").replace("!", "")) for text in cells]
    return np.array(figures[::2]), np.array(figures[1::2])


def bars(browser):
    """The widths of all bars [px]."""
    return np.array(
        browser.run("[...document.querySelectorAll('td.parts i')].map(e => e.getBoundingClientRect().width)")
    )


def delays(browser, press, times=9):
    """From a key's or the pointer's event to the next frame, in which the bars have other widths [ms]; sorted."""
    browser.run("""
      globalThis.taken = [];
      const widths = () => [...document.querySelectorAll('td.parts i')].map((e) => e.style.width).join();
      let before = widths();
      for (const kind of ['keydown', 'pointerdown', 'beforeinput']) document.addEventListener(kind, (event) => {
        requestAnimationFrame(() => requestAnimationFrame((drawn) => {
          const after = widths();
          if (after !== before) taken.push(drawn - event.timeStamp);
          before = after;
        }));
      }, true);
    """)
    for number in range(times):
        press(number)
        browser.run(
            "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done))))"
        )
    return sorted(browser.run("taken"))
